"""`vsd lines`: how many people cross counting lines and doors, in either direction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import click

from vsd_analytics.cli.answers import has_value, print_answers
from vsd_analytics.cli.options import exact_option, floor_option, json_option, language_option, range_options
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.render.text import Layout, TableLayout

if TYPE_CHECKING:
    from vsd_analytics.site.model import Floor

_COUNTS: Final = ("left", "n_to_left", "right", "n_to_right", "n_both", "net_to_left")
_INSIDE: Final = ("n_in", "n_out", "people", "people_in_view", "most_people", "drift")
LAYOUTS: Final[dict[str, Layout]] = {
    "lines": (TableLayout(("name", *_COUNTS, "recorded_h", "unrecorded_open_h")),),
    "doors": (
        TableLayout(("n_in", "n_out", "people", "people_in_view", "most_people", "known_open_h", "open_h")),
        TableLayout(("drift", "drift_per_1000", "n_days")),
    ),
    "door_days": (TableLayout(("local_date", *_INSIDE, "known_open_h")),),
    "line_peaks": (
        TableLayout(("name", "people_per_min", "per_m_s", "of_most_share", "width_m", "whole_h")),
        TableLayout(("name", "local_date", "local_hour"), only="local_date"),
    ),
    "line_days": (TableLayout(("name", "local_date", *_COUNTS, "unrecorded_open_h")),),
    "line_hours": (TableLayout(("name", "local_hour", *_COUNTS, "unrecorded_open_h"), some=("recorded_h", "open_h")),),
}
"""Hours of the day in which nothing was recorded are printed where the site is open, as `vsd hours` prints them."""


@click.command()
@range_options
@click.option(
    "--page", "is_page", is_flag=True, help="Write a page of the week's footfall: usual, last year, next week."
)
@click.option("--out", metavar="DIR", help="Folder of the page (default: reports/ of the project).")
@floor_option
@exact_option
@language_option
@json_option
@pass_project
def lines(
    project: Project,
    week: str | None,
    days: str | None,
    is_page: bool,
    out: str | None,
    floor_id: str | None,
    as_json: bool,
) -> int:
    """Print how many people crossed counting lines and doors in either direction: in all, by day and by hour.

    A person crosses a [[line]] of vsd.toml from 0.25 m on one side to 0.25 m on the other; each way back counts, too.
    The net number is unknown where an opening hour was not recorded. Of floors whose lines are doors (inside = "left"),
    with [doors] empty_at: people inside, and how many the doors have left over when the day ends (drift).

    --page writes a page of the footfall of a week instead: each line beside its usual range, the week before and a year
    before, the last weeks, and what is expected next week.

    Exit code 1: no line was recorded.

    \b
    Example:
      vsd lines --week last
      vsd lines --range 2026-11-02..2026-11-15 --json
      vsd lines --week last --page
    """
    from vsd_analytics.cli.ranges import period_with_history, purged_hours_notes
    from vsd_analytics.errors import UsageError
    from vsd_analytics.figures.doors import door_answers
    from vsd_analytics.figures.line_peaks import line_peaks
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
    if is_page and (as_json or days is not None):
        raise UsageError("--page writes a page of one week", fix="vsd lines --week last --page")
    if out is not None and not is_page:
        raise UsageError("--out is the folder of a page", fix=f"vsd lines --week {week or 'last'} --page --out {out}")
    if is_page:
        return _write_page(project, floor, week or "last", out)
    has_doors = any(line.floor_id == floor.floor_id and line.inside for line in project.site.lines)
    with period_with_history(project, floor, week=week, days=days) as period:
        whole, *parts = line_answers(period)
        answers = audience_answers(
            [whole, *(door_answers(period) if has_doors else ()), line_peaks(period), *parts], period.data.site
        )
        notes = purged_hours_notes(period.data.warehouse)
    print_answers(answers, days=(period.first, period.last), layouts=LAYOUTS, as_json=as_json, notes=notes)
    return 0 if has_value(answers, "lines", ["n_to_left", "n_to_right", "n_both"]) else 1


def _write_page(project: Project, floor: Floor, week: str, out: str | None) -> int:
    """Write the page of a week's footfall."""
    from vsd_analytics.answer import Answers
    from vsd_analytics.cli.ranges import period_with_history
    from vsd_analytics.cli.report_formats import write
    from vsd_analytics.figures.footfall import footfall_answers
    from vsd_analytics.figures.share.answers import audience_answers
    from vsd_analytics.figures.trend import TREND_WEEKS
    from vsd_analytics.report.pages.footfall import footfall_html
    from vsd_analytics.warehouse.provenance import are_made_up, engines

    project.speak()
    folder = project.pages(out)
    with period_with_history(project, floor, week=week, days=None, n_weeks=TREND_WEEKS) as period:
        answers = Answers(audience_answers(footfall_answers(period), project.site))
        is_made_up = are_made_up(engines(project.site, period.first, period.last))
        html = footfall_html(
            answers, project.site, floor, period.first, is_exact=project.is_exact, is_made_up=is_made_up
        )
    name = f"footfall-{period.first:%G-W%V}" + ("" if len(project.site.floors) == 1 else f"-{floor.floor_id}")
    [path] = write(folder, {f"{name}.html": html.encode()})
    click.echo(path)
    return 0 if has_value(answers, "footfall", ["n_open"]) else 1
