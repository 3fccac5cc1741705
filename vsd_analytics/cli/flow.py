"""`vsd flow`: where people go from one area to the next, and the routes they take from door to door."""

from __future__ import annotations

from typing import Final, Literal

import click

from vsd_analytics.cli.answers import has_value, print_answers
from vsd_analytics.cli.options import choice_option, exact_option, floor_option, range_options
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.render.text import Layout, TableLayout

LAYOUTS: Final[dict[str, Layout]] = {
    "flow": (TableLayout(("name", "to_name", "next_area_share", "per_open_h", "followed_per_open_h")),),
    "flow_areas": (
        TableLayout(("name", "leave_per_open_h", "not_followed_share", "inflow_ratio", "n_left", "recorded_share")),
    ),
    "flow_links": (TableLayout(("name", "to_name", "linked_share")),),
    "flow_routes": (TableLayout(("route", "route_share")),),
}


@click.command()
@range_options
@floor_option
@exact_option
@choice_option("--format", "kind", choices=["text", "json", "csv"], default="text", help="Output format.")
@pass_project
def flow(
    project: Project,
    week: str | None,
    days: str | None,
    floor_id: str | None,
    kind: Literal["text", "json", "csv"],
) -> int:
    """Print where people go next from each area (origin-destination matrix), and their routes from door to door.

    The areas are those with visits = true. At those with door = true, people come in and leave. Tracks that are lost
    on the way went nowhere: they count as long as they were followed (Aalen-Johansen). Those who come into an area are
    counted without these links, too: where the flows bring more or fewer, the command says so.

    Over floor that no camera sees, and from one camera's view to the next, nobody is followed. There links are
    estimated by time and walking speed, less as many as fit with time running backwards, which is chance. They are
    printed apart and are in no other share.

    Exit code 1: no area asks for visits, or of none enough people were followed.

    \b
    Example:
      vsd flow --week last
      vsd flow --range 2026-11-02..2026-11-15 --format json
    """
    from vsd_analytics.cli.ranges import period_with_history, purged_hours_notes
    from vsd_analytics.errors import UsageError
    from vsd_analytics.figures.flow_answers import flow_answers
    from vsd_analytics.figures.share.answers import audience_answers
    from vsd_analytics.render.frame import csv_text
    from vsd_analytics.site.places import known_floor

    floor = known_floor(project.site, floor_id)
    if not any(a.has_visits for a in project.site.areas if a.floor_id == floor.floor_id):
        raise UsageError(
            f"no area of floor {floor.floor_id!r} asks for visits",
            why="flow is computed only between areas that ask for visits",
            fix="add visits = true to two [[area]] of vsd.toml or more; door = true where people come and go",
        )
    with period_with_history(project, floor, week=week, days=days) as period:
        answers = audience_answers(flow_answers(period), period.data.site)
        notes = purged_hours_notes(period.data.warehouse)
    if kind == "csv":
        click.echo(csv_text(answers["flow"]), nl=False)
    else:
        days_of = (period.first, period.last)
        print_answers(answers, days=days_of, layouts=LAYOUTS, as_json=kind == "json", notes=notes)
    return 0 if has_value(answers, "flow", ["next_area_share"]) else 1
