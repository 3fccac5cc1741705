"""Which fixtures stood on the floor in each selection of the page: old weeks draw the old layout."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date, timedelta

from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.density import fixtures_at
from vsd_analytics.figures.week.floor_maps import map_fixtures
from vsd_analytics.figures.week.model_map import MapFixture
from vsd_analytics.planner.logged_changes import PlannerChange

Layout = tuple[MapFixture, ...]


def layouts(data: WeekData, *, before: date, changes: Sequence[PlannerChange]) -> tuple[Layout, ...]:
    """Return the fixtures at the end of this week, of the other week, and before and after each logged change.

    Args:
        data: This week.
        before: First day of the other week.
        changes: The logged changes; sides without weeks have this week's layout.

    Returns:
        2 + 2 * n_changes layouts; none where they are all alike.
    """
    days = [data.sunday, before + timedelta(days=6)]
    for change in changes:
        days += [data.sunday if side is None else side.days[1] for side in (change.before, change.after)]
    found = tuple(map_fixtures(fixtures_at(data, day)) for day in days)
    return found if len(set(found)) > 1 else ()
