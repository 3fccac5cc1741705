"""`vsd counts`: the sums that door counters send, added to the counting lines that they count."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.added_intervals import print_added
from vsd_analytics.cli.options import FilePath, json_option
from vsd_analytics.cli.output import emit_json, table
from vsd_analytics.cli.project import Project, pass_project

if TYPE_CHECKING:
    from vsd_analytics.config.door_counts import Way


@click.group()
def counts() -> None:
    """Add what door counters count: people in and out in intervals of an hour or less. `vsd lines` prints them.

    \b
    Example:
      vsd counts add doors.csv --line entrance --left in --right out --every 15min
      vsd lines --week last
    """


@counts.command("add")
@click.argument("file", type=FilePath())
@click.option("--line", "line_id", required=True, metavar="LINE", help='A [[line]] with counted_by = "counter".')
@click.option("--left", metavar="COLUMN", help="Column of people to the left side of the line.")
@click.option("--right", metavar="COLUMN", help="Column of people to its right side.")
@click.option("--both", metavar="COLUMN", help="Column of people of a counter that does not tell ways apart.")
@click.option(
    "--every", metavar="LENGTH", help="Length of each interval: 5min, 15min, 1h (default: the file has ends)."
)
@click.option("--time", "time_column", default="time", show_default=True, metavar="COLUMN", help="Column of starts.")
@click.option("--end", "end_column", default="end", show_default=True, metavar="COLUMN", help="Column of ends.")
@click.option("--zone", metavar="ZONE", help="Zone of times without an offset (default: the site's).")
@click.option("--replace", "is_replacing", is_flag=True, help="Take the file's counts where others are stored.")
@click.option("--yes", "is_believed", is_flag=True, help="The file is right: add it also where it looks wrong.")
@json_option
@pass_project
def counts_add(
    project: Project,
    file: Path,
    line_id: str,
    left: str | None,
    right: str | None,
    both: str | None,
    every: str | None,
    time_column: str,
    end_column: str,
    zone: str | None,
    is_replacing: bool,
    is_believed: bool,
    as_json: bool,
) -> int:
    """Add the intervals of a CSV file to a line. What is stored already is not added again.

    Lines that cannot be used are listed with the reason; the other lines are added, and the exit code is 1. So it is
    with a warning (W232): people, hours or directions unlike those of the weeks before. A file that is almost surely
    wrong is not added.

    \b
    Example:
      vsd counts add doors.csv --line entrance --left in --right out --every 15min
      vsd counts add street.csv --line street --both count --every 1h --zone UTC
    """
    from vsd_analytics.config.context_file import ContextColumns, zone_named
    from vsd_analytics.config.door_counts import add_counts

    site = project.site
    named: dict[Way, str | None] = {"left": left, "right": right, "both": both}
    columns: dict[Way, str] = {way: name for way, name in named.items() if name is not None}
    in_zone = site.zone if zone is None else zone_named(zone)
    times = ContextColumns(time_column, "", end_column, every, in_zone)
    added = add_counts(site, file, line_id, columns, times=times, is_replacing=is_replacing, is_believed=is_believed)
    return print_added(line_id, added, described={"line_id": line_id}, as_json=as_json, is_believed=is_believed)


@counts.command("list")
@json_option
@pass_project
def counts_list(project: Project, as_json: bool) -> None:
    """List the lines that have counts: first and last local day, intervals.

    \b
    Example:
      vsd counts list
    """
    from vsd_analytics.config.door_counts import counted_lines

    rows = [
        {"line_id": line_id, "first": first.isoformat(), "last": last.isoformat(), "n_intervals": n}
        for line_id, (first, last), n in counted_lines(project.site)
    ]
    if as_json:
        emit_json({"counts": rows})
    elif rows:
        for line in table([[f"{v:,}" if isinstance(v, int) else str(v) for v in row.values()] for row in rows]):
            click.echo(line)
    else:
        project.say("nothing was added yet; vsd counts add doors.csv --line LINE --left in --right out --every 15min")


@counts.command("remove")
@click.argument("line_id", metavar="LINE")
@json_option
@pass_project
def counts_remove(project: Project, line_id: str, as_json: bool) -> None:
    """Delete the counts of a line. To have them again, add their files again.

    \b
    Example:
      vsd counts remove entrance
    """
    from vsd_analytics.config.door_counts import remove_counts

    is_new = remove_counts(project.site, line_id)
    if as_json:
        emit_json({"removes": line_id, "is_new": is_new})
        return
    click.echo(f"{'removed' if is_new else 'has no counts'}  {line_id}")
