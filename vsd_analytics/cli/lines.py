"""`vsd lines`: how many people cross counting lines and doors, in either direction."""

from __future__ import annotations

from typing import Final

import click

from vsd_analytics.cli.answers import has_value, print_answers
from vsd_analytics.cli.options import exact_option, floor_option, json_option, range_options
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.render.text import Layout, TableLayout

_COUNTS: Final = ("left", "n_to_left", "right", "n_to_right", "net_to_left")
_INSIDE: Final = ("n_in", "n_out", "people", "people_in_view", "most_people", "drift")
LAYOUTS: Final[dict[str, Layout]] = {
    "lines": (TableLayout(("name", *_COUNTS, "recorded_h", "unrecorded_open_h")),),
    "doors": (
        TableLayout(("n_in", "n_out", "people", "people_in_view", "most_people", "known_open_h", "open_h")),
        TableLayout(("drift", "drift_per_1000", "n_days")),
    ),
    "door_days": (TableLayout(("local_date", *_INSIDE, "known_open_h")),),
    "line_days": (TableLayout(("name", "local_date", *_COUNTS, "unrecorded_open_h")),),
    "line_hours": (TableLayout(("name", "local_hour", *_COUNTS, "unrecorded_open_h")),),
}


@click.command()
@range_options
@floor_option
@exact_option
@json_option
@pass_project
def lines(project: Project, week: str | None, days: str | None, floor_id: str | None, as_json: bool) -> int:
    """Print how many people crossed counting lines and doors in either direction: in all, by day and by hour.

    A person crosses a [[line]] of vsd.toml from 0.25 m on one side to 0.25 m on the other; each way back counts, too.
    The net number is unknown where an opening hour was not recorded. Of floors whose lines are doors (inside = "left"),
    with [doors] empty_at: people inside, and how many the doors have left over when the day ends (drift).

    Exit code 1: no line was recorded.

    \b
    Example:
      vsd lines --week last
      vsd lines --range 2026-11-02..2026-11-15 --json
    """
    from vsd_analytics.cli.ranges import period_with_history, purged_hours_notes
    from vsd_analytics.errors import UsageError
    from vsd_analytics.figures.doors import door_answers
    from vsd_analytics.figures.lines import line_answers
    from vsd_analytics.figures.share.answers import audience_answers
    from vsd_analytics.site.places import known_floor

    floor = known_floor(project.site, floor_id)
    if not any(line.floor_id == floor.floor_id for line in project.site.lines):
        raise UsageError(
            f"floor {floor.floor_id!r} has no counting line",
            why="crossings are counted only on lines that vsd.toml draws",
            fix='add [[line]] with id = "entrance", name = "Entrance", points = [[18.2, 0.8], [20.7, 0.8]] to vsd.toml',
        )
    has_doors = any(line.floor_id == floor.floor_id and line.inside for line in project.site.lines)
    with period_with_history(project, floor, week=week, days=days) as period:
        answers = audience_answers(
            [*line_answers(period), *(door_answers(period) if has_doors else ())], period.data.site
        )
        notes = purged_hours_notes(period.data.warehouse)
    print_answers(answers, days=(period.first, period.last), layouts=LAYOUTS, as_json=as_json, notes=notes)
    return 0 if has_value(answers, "lines", ["n_to_left", "n_to_right"]) else 1
