"""`vsd site build`: the index over all floors, sites and weeks."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import click

from vsd_analytics.cli.shared import Project, emit_json, json_option, pass_project, render_error


@click.group()
def site() -> None:
    """Make the static site of all reports: one index over floors, sites and weeks.

    \b
    Example:
      vsd site build --open
    """


@site.command()
@click.argument("folders", nargs=-1, metavar="[PROJECT]...", type=click.Path(path_type=Path))
@click.option("--root", metavar="DIR", type=click.Path(path_type=Path), help="Every project directly in this folder.")
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for index.html (default: reports/ of the project; needed for several).",
)
@click.option("--make", "is_made", is_flag=True, help="First write the reports of stored weeks that have none.")
@click.option("--open", "is_opened", is_flag=True, help="Open the index in a browser.")
@json_option
@pass_project
def build(
    project: Project,
    folders: tuple[Path, ...],
    root: Path | None,
    out: Path | None,
    is_made: bool,
    is_opened: bool,
    as_json: bool,
) -> int:
    """Write index.html over all reports: which floors changed, how often, how sure, and every earlier week.

    It is made from the JSON twins of the reports and links to them with relative addresses, so it works from a folder
    and from any web server. Reports that do not lie below the index are copied beside it, into a folder for each
    project. Weeks stay listed when their records are purged. What cannot be listed is named, with exit code 1.

    A page written without its twin (vsd report alone) gets one if the records still give the very same page.

    \b
    Example:
      vsd site build --make --open
      vsd site build riverside harbour --out public
      vsd site build --root sites --out public
    """
    from vsd_analytics.errors import UsageError, VsdError
    from vsd_analytics.index.floors import catalogue
    from vsd_analytics.index.render import render_index
    from vsd_analytics.index.shelves import gather, projects_below, sources_of, write_index

    named = [*folders, *(projects_below(root) if root is not None else [])]
    sources = sources_of(named or [project.root])
    if out is None and len(sources) > 1:
        raise UsageError("several projects need a folder for their index", mend="--out public")
    for source in sources:
        if (source.folder / "vsd.toml").is_file():
            inner = Project(
                folder=str(source.folder), now_text=project.now_text, quiet=project.quiet, verbose=project.verbose
            )
            make_twins(inner)
            if is_made:
                make_missing(inner)
    target = out if out is not None else sources[0].reports
    shelf = gather(sources, target)
    found = catalogue(shelf.entries)
    problems = (*shelf.problems, *found.problems)
    if not shelf.entries:
        for problem in problems:
            project.say(render_error(problem, word="warning"))
        raise VsdError(
            "there is no report to list",
            code="E510",
            why=f"no report with its JSON twin was found in {', '.join(str(s.reports) for s in sources)}",
            mend="vsd site build --make, or vsd report --week last --format html,json",
        )
    path = write_index(target, render_index(found))
    n_weeks = len(found.earlier) + (found.latest is not None)
    if as_json:
        told = [{k: v for k, v in p.as_dict().items() if k != "ok"} for p in problems]
        emit_json({"ok": True, "path": str(path), "floors": len(found.floors), "weeks": n_weeks, "problems": told})
    else:
        counted = f"{_n(len(found.floors), 'floor')}, {_n(n_weeks, 'week')}, {_n(len(shelf.entries), 'report')}"
        click.echo(f"{path}   {path.stat().st_size / 1000:.0f} KB   {counted}")
        for problem in problems:
            project.say(render_error(problem, word="warning"))
    if is_opened:
        click.launch(str(path))
    return 1 if problems else 0


def make_twins(project: Project) -> list[Path]:
    """Write the twins of pages that have none, where the records still give the same page to the last byte.

    Any other page keeps its place without figures: a twin made of other data than the page would contradict it.

    Args:
        project: A project with a vsd.toml.

    Returns:
        The twins written.
    """
    from vsd_analytics.errors import VsdError
    from vsd_analytics.index.read import STEM, files_in, kind_of

    folder = project.root / "reports"
    names = files_in(folder)
    lacking = [n.removesuffix(".html") for n in names if kind_of(n) == "report" and n.endswith(".html")]
    written = []
    for stem in (s for s in lacking if f"{s}.json" not in names):
        found = STEM.fullmatch(stem)
        try:
            twin = _twin_of(project, stem, floor_id=found["floor"] if found else None)
        except VsdError:
            continue  # its records are gone, or its floor: named with the other pages without figures
        if twin is not None:
            written.append(twin)
            project.say(f"{twin.name}: the figures of {stem}.html")
    return written


def _twin_of(project: Project, stem: str, *, floor_id: str | None) -> Path | None:
    from vsd_analytics.cli.report_formats import ReportFiles
    from vsd_analytics.cli.reports import make_reports
    from vsd_analytics.store.durable import publish

    floors = [f.floor_id for f in project.site.floors]
    if (floor_id is None) != (len(floors) == 1) or floor_id not in (None, *floors):
        return None
    (report,) = make_reports(project, week=stem[:8], floor_id=floor_id)
    files = ReportFiles(report, project.site, is_only=len(floors) == 1)
    folder = project.root / "reports"
    if files.of("html")[f"{stem}.html"] != (folder / f"{stem}.html").read_bytes():
        return None
    publish(folder / f"{stem}.json", files.of("json")[f"{stem}.json"])
    return folder / f"{stem}.json"


def make_missing(project: Project) -> list[Path]:
    """Write page and twin of every stored week and floor that has no twin, up to the last whole one.

    A page that stands there is not written over, and gets no twin when nothing is stored of its week any more.

    Args:
        project: A project with a vsd.toml.

    Returns:
        The files written.
    """
    from vsd_analytics.cli.ranges import last_monday
    from vsd_analytics.warehouse.warehouse import stored_extent

    extent = stored_extent(project.site)
    if extent is None:
        return []
    monday, last = extent.first_day - timedelta(days=extent.first_day.weekday()), last_monday(project)
    written = []
    while monday <= last:
        iso = monday.isocalendar()
        written += write_week(project, f"{iso.year}-W{iso.week:02d}")
        monday += timedelta(weeks=1)
    return written


def write_week(project: Project, week: str) -> list[Path]:
    """Write page and twin of each floor that has no twin of a week yet, into the project's folder of reports.

    Args:
        project: A project with a vsd.toml.
        week: ISO week, such as 2026-W46.

    Returns:
        The files written: a page before its twin.
    """
    from vsd_analytics.cli.report_formats import ReportFiles
    from vsd_analytics.cli.reports import make_reports
    from vsd_analytics.store.durable import publish

    folder = project.root / "reports"
    folder.mkdir(exist_ok=True)
    floors = [f.floor_id for f in project.site.floors]
    written = []
    for floor_id in floors:
        stem = week if len(floors) == 1 else f"{week}-{floor_id}"
        page, twin = folder / f"{stem}.html", folder / f"{stem}.json"
        if twin.exists():
            continue
        (report,) = make_reports(project, week=week, floor_id=floor_id)
        if page.exists() and report.state == "no_data":
            continue
        files = ReportFiles(report, project.site, is_only=len(floors) == 1)
        if not page.exists():
            publish(page, files.of("html")[page.name])
            written.append(page)
        publish(twin, files.of("json")[twin.name])
        written.append(twin)
    return written


def _n(count: int, noun: str) -> str:
    return f"{count:,} {noun}{'' if count == 1 else 's'}"
