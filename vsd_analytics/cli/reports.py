"""`vsd report`: the weekly page and its twins."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from vsd_analytics.cli.ranges import last_monday
from vsd_analytics.cli.shared import Project, emit_json, json_option, parse_week, pass_project, progress

if TYPE_CHECKING:
    from vsd_analytics.report.model import WeekReport


@click.command()
@click.option("--week", metavar="WEEK", default="last", show_default=True, help="ISO week: 2026-W46, last, last-2.")
@click.option(
    "--format",
    "kind",
    type=click.Choice(["html", "json", "csv"]),
    default="html",
    show_default=True,
    help="The page, or a twin of it.",
)
@click.option(
    "--out", metavar="DIR", help="Folder to write to, or - for standard output (default: reports/ of the project)."
)
@click.option("--floor", "floor_id", metavar="FLOOR", help="Only this floor (default: one report for each).")
@click.option("--strict", is_flag=True, help="Exit with 1 when too little was recorded to compare.")
@click.option("--open", "is_opened", is_flag=True, help="Open the page in a browser.")
@json_option
@pass_project
def report(
    project: Project,
    week: str,
    kind: str,
    out: str | None,
    floor_id: str | None,
    strict: bool,
    is_opened: bool,
    as_json: bool,
) -> int:
    """Write the weekly report: more violations or fewer, where, when, and how sure.

    \b
    Example:
      vsd report --week last --open
      vsd report --week 2026-W46 --format json --out -
    """
    if as_json:
        kind, out = "json", "-"
    reports = make_reports(project, week=week, floor_id=floor_id)
    if out == "-":
        _print(reports, kind)
    else:
        folder = Path(out) if out is not None else project.root / "reports"
        paths = [path for r in reports for path in _write(r, kind, folder, is_only=len(project.site.floors) == 1)]
        for path in paths:
            click.echo(f"{path}   {path.stat().st_size / 1000:.0f} KB")
        if is_opened and kind == "html":
            click.launch(str(paths[0]))
    return 1 if strict and any(r.state in ("no_data", "too_incomplete") for r in reports) else 0


def make_reports(project: Project, *, week: str, floor_id: str | None) -> list[WeekReport]:
    """Return the finished report of each floor for a week, with a progress bar over facts that must be made."""
    from vsd_analytics.errors import UsageError
    from vsd_analytics.report.assemble import week_report

    monday = parse_week(week, last=last_monday(project))
    floors = [f.floor_id for f in project.site.floors]
    if floor_id is not None and floor_id not in floors:
        raise UsageError(
            f"no floor has the id {floor_id!r}", why=f"this site has {', '.join(floors)}", mend=f"--floor {floors[0]}"
        )
    with progress(None, total=None, label="facts", unit="h", quiet=project.quiet) as bar:

        def plan(n_hours: int) -> None:
            bar.total = (bar.total or 0) + n_hours

        now = project.now if project.now_text is not None else None
        return [
            week_report(project.site, monday, floor_id=f, now=now, on_plan=plan, on_hours=bar.update)
            for f in ([floor_id] if floor_id else floors)
        ]


def write_report(project: Project, *, week: str, kind: str, out: str, floor_id: str | None) -> list[Path]:
    """Write the report of a week and return the files."""
    reports = make_reports(project, week=week, floor_id=floor_id)
    return [path for r in reports for path in _write(r, kind, Path(out), is_only=len(project.site.floors) == 1)]


def _print(reports: list[WeekReport], kind: str) -> None:
    import json

    from vsd_analytics.errors import UsageError
    from vsd_analytics.report.render import render_html
    from vsd_analytics.report.twins import to_json

    if kind == "csv":
        raise UsageError("csv is several files", mend="--out reports/")
    if len(reports) > 1 and kind == "html":
        raise UsageError("there is one page for each floor", mend="--floor FLOOR --out -")
    if kind == "html":
        click.echo(render_html(reports[0]), nl=False)
    elif len(reports) == 1:
        click.echo(to_json(reports[0]), nl=False)
    else:
        emit_json({"reports": [json.loads(to_json(r)) for r in reports]})


def _write(report: WeekReport, kind: str, folder: Path, *, is_only: bool) -> list[Path]:
    from vsd_analytics.report.render import render_html
    from vsd_analytics.report.twins import to_csv, to_json

    folder.mkdir(parents=True, exist_ok=True)
    stem = report.week.iso if is_only else f"{report.week.iso}-{report.site.floor_id}"
    texts: dict[str, bytes]
    if kind == "html":
        texts = {f"{stem}.html": render_html(report).encode()}
    elif kind == "json":
        texts = {f"{stem}.json": to_json(report)}
    else:
        texts = {f"{stem}-{name}": text.encode() for name, text in to_csv(report).items()}
    for name, data in texts.items():
        (folder / name).write_bytes(data)
    return [folder / name for name in texts]
