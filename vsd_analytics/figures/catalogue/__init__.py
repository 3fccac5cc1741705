"""The catalogue of a report: its figures by id, M0 to M29, as the JSON file of the report gives them.

One file per family. docs/figures.md defines each figure; it is made from the headers of the SQL files.
Nothing in a figure tells of one person: no track ids, no count under `mask_below`, no ranking of a week recorded too
little for one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from vsd_analytics.figures.catalogue import (
    change_figures,
    count_figures,
    hour_figures,
    people_figures,
    place_figures,
    recording_figures,
)
from vsd_analytics.figures.catalogue.form import Asked
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.findings import Findings
from vsd_analytics.figures.week.model_recording import Coverage
from vsd_analytics.figures.week.results import AreaRow, Figure, Level, When


def figures(
    data: WeekData,
    found: Findings,
    *,
    coverage: Coverage,
    level: Level,
    areas: Sequence[AreaRow],
    when: When,
    is_ranked: bool,
) -> Mapping[str, Figure]:
    """Return the thirty figures of the week by catalogue id.

    Args:
        data: The week.
        found: The answers of the analysis room.
        coverage: Recorded hours.
        level: Headline numbers, already without what must be held back.
        areas: Areas, likewise.
        when: The timetable, likewise.
        is_ranked: The week was recorded well enough to say what is highest.
    """
    asked = Asked(data, found, coverage, level, areas, when, is_ranked)
    made: dict[str, Figure] = {}
    for family in (
        recording_figures,
        people_figures,
        count_figures,
        hour_figures,
        place_figures,
        change_figures,
    ):
        made |= family.figures(asked)
    return dict(sorted(made.items(), key=lambda item: int(item[0][1:])))
