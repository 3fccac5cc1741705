"""`vsd context`: what else happened at the site, such as sales, weather or footfall."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from vsd_analytics.cli.added_intervals import print_added
from vsd_analytics.cli.options import FilePath, exact_option, floor_option, json_option
from vsd_analytics.cli.output import emit_json, table
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.render.text import Layout, TableLayout

if TYPE_CHECKING:
    from vsd_analytics.config.context_series import Adds, ContextSeries

LAYOUTS: Final[dict[str, Layout]] = {
    "context_conversion": (
        TableLayout(("series", "name", "value_per_visit", "value_unit", "n_visits", "n_days", "known_share")),
    ),
    "context_value": (TableLayout(("series", "name", "value_per_person_h", "value_unit", "n_days", "known_share")),),
    "context_change": (
        TableLayout(("series", "name", "series_change", "series_difference", "value_unit")),
        TableLayout(("series", "violation_rate_change", "violation_rate_verdict")),
        TableLayout(("series", "equal_value_change", "equal_value_verdict")),
        TableLayout(("series", "series_step", "step_change", "n_weeks", "n_days")),
        TableLayout(
            ("series", "violation_rate", "usual_lo", "usual_hi", "equal_value_usual_lo", "equal_value_usual_hi")
        ),
    ),
}


@click.group()
def context() -> None:
    """Add series of what else happened: sales, weather, footfall. They stand beside figures; no other figure changes.

    \b
    Example:
      vsd context add sales.csv --name sales --unit EUR --sum --every 1h
      vsd context list
      vsd sql "select * from context_days where name = 'sales'" --week last
    """


@context.command("add")
@click.argument("file", type=FilePath())
@click.option("--name", required=True, metavar="NAME", help="The series: sales, temperature.")
@click.option("--unit", metavar="UNIT", help="Unit of the values; a new series needs one.")
@click.option("--sum", "adds", flag_value="sum", help="Values of hours add up, as sales do.")
@click.option("--mean", "adds", flag_value="mean", help="Values of hours are averaged, as temperatures are.")
@click.option("--every", metavar="LENGTH", help="Length of each interval: 15min, 1h, 1d (default: the file has ends).")
@click.option("--time", "time_column", default="time", show_default=True, metavar="COLUMN", help="Column of starts.")
@click.option("--end", "end_column", default="end", show_default=True, metavar="COLUMN", help="Column of ends.")
@click.option("--value", "value_column", default="value", show_default=True, metavar="COLUMN", help="Column of values.")
@click.option("--zone", metavar="ZONE", help="Zone of times without an offset (default: the site's).")
@click.option("--place", metavar="ID", help="Area or floor it concerns (default: site, the whole site).")
@click.option("--replace", "is_replacing", is_flag=True, help="Take the file's value where the series has another one.")
@json_option
@pass_project
def context_add(
    project: Project,
    file: Path,
    name: str,
    unit: str | None,
    adds: Adds | None,
    every: str | None,
    time_column: str,
    end_column: str,
    value_column: str,
    zone: str | None,
    place: str | None,
    is_replacing: bool,
    as_json: bool,
) -> int:
    """Add the intervals of a CSV file to a series. What the series has already is not added again.

    Lines that cannot be used are listed with the reason; the other lines are added, and the exit code is 1.

    \b
    Example:
      vsd context add sales.csv --name sales --unit EUR --sum --every 1h
      vsd context add weather.csv --name temperature --unit degC --mean --every 1h --zone UTC
    """
    from vsd_analytics.config.context_file import ContextColumns, zone_named
    from vsd_analytics.config.context_series import add_context

    site = project.site
    columns = ContextColumns(
        time_column, value_column, end_column, every, site.zone if zone is None else zone_named(zone)
    )
    series, added = add_context(
        site, file, columns,
        name=name, at=project.now, unit=unit, place=place, adds=adds, is_replacing=is_replacing,
    )  # fmt: skip
    return print_added(name, added, described=_described(project, series), as_json=as_json)


@context.command("list")
@json_option
@pass_project
def context_list(project: Project, as_json: bool) -> None:
    """List the series: unit, place, how they add, first and last local day, intervals.

    \b
    Example:
      vsd context list
    """
    from vsd_analytics.config.context_series import context_series

    series = list(context_series(project.site).values())
    rows = [_described(project, each) for each in series]
    if as_json:
        emit_json({"series": rows})
    elif rows:
        for line in table([[f"{v:,}" if isinstance(v, int) else str(v) for v in row.values()] for row in rows]):
            click.echo(line)
    else:
        project.say("nothing was added yet; vsd context add sales.csv --name sales --unit EUR --sum --every 1h")


@context.command("figures")
@click.option("--week", default="last", show_default=True, metavar="WEEK", help="ISO week such as 2026-W46, or last.")
@floor_option
@exact_option
@json_option
@pass_project
def context_figures(project: Project, week: str, floor_id: str | None, as_json: bool) -> int:
    """Print figures made with the series: value per visit and person-hour, violations at an equal value.

    A week's violations are compared with the week before as if the series had been equal, by what days of the 16 weeks
    before had more of both. Sales per visit need an area with visits = true. Reports have these figures with
    show_context = true under [report].

    Exit code 1: no figure has a value.

    \b
    Example:
      vsd context figures --week last
      vsd context figures --week 2026-W46 --json
    """
    from datetime import timedelta

    from vsd_analytics.answer import Answers
    from vsd_analytics.cli.answers import has_value, print_answers
    from vsd_analytics.cli.output import facts_progress
    from vsd_analytics.cli.ranges import shared_days
    from vsd_analytics.config.context_series import context_series
    from vsd_analytics.errors import UsageError
    from vsd_analytics.report.pages.story import week_report
    from vsd_analytics.site.places import known_floor

    floor = known_floor(project.site, floor_id)
    if not context_series(project.site):
        fix = "vsd context add sales.csv --name sales --unit EUR --sum --every 1h"
        raise UsageError("nothing was added yet", fix=fix)
    monday, _ = shared_days(project, week=week, days=None)
    with facts_progress(quiet=project.quiet) as (on_plan, on_hours):
        report = week_report(
            project.site, monday, floor_id=floor.floor_id, clock=project.now, on_plan=on_plan, on_hours=on_hours,
            has_context=True,
        )  # fmt: skip
    answers = Answers(answer for answer in report.answers if answer.name in LAYOUTS)
    days = (monday, monday + timedelta(days=6))
    print_answers(answers, days=days, layouts=LAYOUTS, as_json=as_json, notes=report.provenance.notes)
    values = {"context_conversion": "value_per_visit", "context_value": "value_per_person_h"}
    values["context_change"] = "equal_value_change"
    return 0 if any(has_value(answers, name, [column]) for name, column in values.items()) else 1


@context.command("remove")
@click.argument("name")
@json_option
@pass_project
def context_remove(project: Project, name: str, as_json: bool) -> None:
    """Take a series back. Its lines stay in context.jsonl; to have it again, add its file again.

    \b
    Example:
      vsd context remove sales
    """
    from vsd_analytics.config.context_series import remove_context

    is_new = remove_context(project.site, name, at=project.now)
    if as_json:
        emit_json({"removes": name, "is_new": is_new})
        return
    click.echo(f"{'removed' if is_new else 'was removed before'}  {name}")


def _described(project: Project, series: ContextSeries) -> dict[str, Any]:
    first, last = series.days(project.site.zone)
    return {"name": series.name, "unit": series.unit, "place": series.place, "adds": series.adds,
            "first": first.isoformat(), "last": last.isoformat(), "n_intervals": len(series.values)}  # fmt: skip
