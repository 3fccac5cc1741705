"""Which hours of a week had far more or fewer violations than usual (M24)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason, State
from vsd_analytics.figures.forecast import HISTORY_WEEKS
from vsd_analytics.figures.slots import Slots, iso_week, load_slots
from vsd_analytics.figures.special_days import special_days
from vsd_analytics.site.model import Site
from vsd_analytics.stats.unusual import Unusual, UnusualSlots, unusual_hours
from vsd_analytics.warehouse.warehouse import Warehouse

UNIT: Final = "violations"


@dataclass(frozen=True, slots=True)
class UnusualWeek:
    """The unusual hours of a week.

    Attributes:
        week: ISO week.
        floor_id: Floor; None = the whole site.
        unit: Of the counts.
        rows: At most five, least likely first.
        n_unusual: How many there are.
        n_tested: Hours that were recorded and have a usual count.
        state: "ok" when at least one hour could be judged; then no row means nothing unusual.
        reason: Why not.
    """

    week: str
    floor_id: str | None
    unit: str
    rows: tuple[Unusual, ...]
    n_unusual: int
    n_tested: int
    state: State
    reason: Reason | None


def unusual(
    warehouse: Warehouse,
    monday: date,
    *,
    floor_id: str | None = None,
    as_known: Callable[[Slots], Slots] | None = None,
) -> UnusualWeek:
    """Return the unusual hours of the week that starts on `monday`.

    Args:
        warehouse: Opened from `forecast.first_day(monday)`, or from wherever records begin, to the week's end.
        monday: First day of the week.
        floor_id: Only the cameras of this floor; None = all.
        as_known: As for `forecast.forecast`.

    Raises:
        UsageError: E101, `monday` is no Monday, or the site has no such floor.

    Example:
        >>> vsd.unusual(warehouse, date(2026, 11, 9)).state  # needs four weeks of history
        'not_enough_data'
    """
    slots = load_slots(
        warehouse, monday, n_weeks=HISTORY_WEEKS + 1, floor_id=floor_id, there=(monday, monday + timedelta(days=6))
    )
    unusual_slots = unusual_in_last_week(slots if as_known is None else as_known(slots), warehouse.site)
    counts = unusual_slots.n_unusual, unusual_slots.n_tested
    return UnusualWeek(
        iso_week(monday), floor_id, UNIT, unusual_slots.rows, *counts, unusual_slots.state, unusual_slots.reason
    )


def unusual_in_last_week(slots: Slots, site: Site) -> UnusualSlots:
    """Return the hours of the last of some weeks that are far from what the weeks before it make usual.

    Public holidays are left out of both: that such an hour is unlike others is no news. Hours that are hidden from
    readers are not judged.
    """
    if (why := slots.why_no_violations) is not None:
        return UnusualSlots((), 0, 0, 0, "not_measurable", why)
    settings = site.settings
    n = slots.violations.n
    x_h = special_days(site, slots.monday, n_weeks=len(n)).ordinary_h(slots.violations.x_h)
    return unusual_hours(
        n[-1],
        x_h[-1] if slots.hidden is None else np.where(slots.hidden[-1], 0.0, x_h[-1]),
        monday=slots.monday,
        before_n=n[:-1],
        before_x_h=x_h[:-1],
        q_max=settings.unusual_false_share,
        min_change=settings.unusual_min_change,
        min_difference=settings.unusual_min_violations,
        share=settings.forecast_share,
    )
