"""`vsd planner`: two weeks of a floor as one page to explore."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.options import exact_option, json_option, language_option
from vsd_analytics.cli.output import emit_json, facts_progress
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import last_monday
from vsd_analytics.errors import UsageError
from vsd_analytics.site.instants import parse_week
from vsd_analytics.site.places import named_floors

if TYPE_CHECKING:
    from vsd_analytics.planner.planner_data import PlannerData


@click.command()
@click.option("--week", metavar="WEEK", default="last", show_default=True, help="ISO week: 2026-W46, last, last-2.")
@click.option("--before", metavar="WEEK", help="The week it is compared with (default: the one before).")
@click.option(
    "--weeks",
    type=click.IntRange(2, 12),
    metavar="N",
    help="Weeks of the change log to look back, 2 to 12 (default: 12 if they have a logged change, else 2).",
)
@click.option("--floor", "floor_id", metavar="FLOOR", help="Only this floor (default: one page for each).")
@click.option(
    "--out",
    metavar="DIR",
    help="Folder to write to, or - for standard output (default: reports/ of the project, with --exact operator/).",
)
@click.option("--open", "is_opened", is_flag=True, help="Open the page in a browser.")
@exact_option
@language_option
@json_option
@pass_project
def planner(
    project: Project,
    week: str,
    before: str | None,
    weeks: int | None,
    floor_id: str | None,
    out: str | None,
    is_opened: bool,
    as_json: bool,
) -> None:
    """Write a page to explore a floor: days, hours, logged changes, maps, the rates of any rectangle.

    A click on a logged change shows the weeks before and after it, what it did, and what became of the whole floor.
    One file that needs no network and no server. Its figures are those of the report; the page contains no count under
    mask_below, its weeks are over, and chosen hours change the figures of the whole floor only. With --exact, it is the
    operator's: exact, of any week, and by hour in every place. With --json, print the figures of the whole week and
    where the page was written.

    \b
    Example:
      vsd planner --week last --open
      vsd planner --weeks 12
      vsd planner --week 2026-W46 --before 2026-W42 --floor ground --out pages/
    """
    from vsd_analytics.planner.page import render_planner

    project.speak()
    monday = parse_week(week, last=last_monday(project))
    earlier = None if before is None else parse_week(before, last=last_monday(project))
    if earlier == monday:
        raise UsageError(
            "a week is not compared with itself", fix=f"--before {week}-1" if week == "last" else "--before last-1"
        )
    n_pages = len(named_floors(project.site, floor_id))
    if out == "-" and (as_json or n_pages > 1):
        raise UsageError("there is one page for each floor", fix="--floor FLOOR --out -, without --json")
    with facts_progress(quiet=project.quiet) as (on_plan, on_hours):
        from vsd_analytics.cli.report_formats import write
        from vsd_analytics.planner.planner_data import planner_pages

        floors = planner_pages(
            project.site,
            monday,
            before=earlier,
            weeks=weeks,
            floor_id=floor_id,
            clock=project.now,
            on_plan=on_plan,
            on_hours=on_hours,
        )
    folder = project.pages(None if out == "-" else out)
    printed = []
    for data in floors:
        page = render_planner(data)
        if out == "-":
            click.echo(page, nl=False)
            continue
        floor = "" if len(project.site.floors) == 1 else f"-{data.floor.floor_id}"
        [path] = write(folder, {f"{data.week.ref.iso}{floor}-planner.html": page.encode()})
        printed.append(_as_dict(data, path))
        if not as_json:
            click.echo(f"{path}   {path.stat().st_size / 1000:.0f} KB")
    if as_json:
        emit_json({"planners": printed})
    if is_opened and printed:
        click.launch(str(printed[0]["path"]))


def _as_dict(data: PlannerData, path: Path) -> dict[str, object]:
    from dataclasses import asdict

    hidden = data.week.hidden
    return {
        "path": str(path),
        "bytes": path.stat().st_size,
        "floor": data.floor.floor_id,
        "week": data.week.ref.iso,
        "before": None if data.before is None else data.before.ref.iso,
        "why_not_compared": data.why_not_compared,
        "weeks": data.weeks,
        "changes": [c.number for c in data.changes],
        "places": [
            {
                "id": row.place_id,
                "name": row.name,
                "held_back": hidden.get(k),
                "violation_rate": None if k in hidden else asdict(row.violation_rate),
                "close_time_share": None if k in hidden else asdict(row.close_time_share),
                "encounter_rate": None if k in hidden else asdict(row.encounter_rate),
            }
            for k, row in enumerate(data.places)
        ],
    }
