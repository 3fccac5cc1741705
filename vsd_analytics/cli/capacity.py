"""`vsd capacity`: for how much of the time areas and floors are full, and by how many people they are overfull."""

from __future__ import annotations

from typing import Final

import click

from vsd_analytics.cli.answers import has_value, print_answers
from vsd_analytics.cli.options import exact_option, floor_option, json_option, range_options
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.figures.room_levels import IATA_LEVELS
from vsd_analytics.render.text import Layout, TableLayout

_TIME: Final = ("busy_share", "full_share", "over_share")
LAYOUTS: Final[dict[str, Layout]] = {
    "capacity": (
        TableLayout(("name", "capacity", "people", *_TIME, "surplus_people", "recorded_share")),
        TableLayout(("name", "area_m2", *(f"room_{level}_share" for level in "abcdef"))),
        TableLayout(("name", *(f"iata_{level}_share" for level in IATA_LEVELS)), only="iata_optimum_share"),
    )
}


@click.command()
@range_options
@floor_option
@exact_option
@json_option
@pass_project
def capacity(project: Project, week: str | None, days: str | None, floor_id: str | None, as_json: bool) -> int:
    """Print for how much of the open time areas and floors with a capacity are full, and by how many people too full.

    Time counts where all cameras that see the place recorded: without one of them, people are too few. On a floor only
    people in view count.

    Exit code 1: no place with a capacity was recorded.

    \b
    Example:
      vsd capacity --week last
      vsd capacity --range 2026-11-02..2026-11-15 --json
    """
    from vsd_analytics.cli.ranges import period_with_history, purged_hours_notes
    from vsd_analytics.errors import UsageError
    from vsd_analytics.figures import capacities as figures
    from vsd_analytics.figures.share.answers import audience_answers
    from vsd_analytics.site.places import known_floor

    floor = known_floor(project.site, floor_id)
    areas = [a for a in project.site.areas if a.floor_id == floor.floor_id]
    if floor.capacity is None and all(a.capacity is None for a in areas):
        raise UsageError(
            f"floor {floor.floor_id!r} and its areas state no capacity",
            why="the use of a capacity is computed only for places that have one",
            fix="add capacity = 40 (people at once) to an [[area]] or a [[floor]] of vsd.toml",
        )
    with period_with_history(project, floor, week=week, days=days) as period:
        answers = audience_answers([figures.capacity(period)], period.data.site)
        notes = purged_hours_notes(period.data.warehouse)
    print_answers(answers, days=(period.first, period.last), layouts=LAYOUTS, as_json=as_json, notes=notes)
    return 0 if has_value(answers, "capacity", ["full_share"]) else 1
