"""`vsd site build`: the index over all floors, sites and weeks."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import click

from vsd_analytics.cli.options import FilePath, json_option, language_option, path_option
from vsd_analytics.cli.output import count, emit_json, render_error
from vsd_analytics.cli.project import Project, folder_of_files, pass_project
from vsd_analytics.errors import ReportError, UsageError, VsdError


@click.group()
def site() -> None:
    """Make the static site of all reports: one index over floors, sites and weeks.

    \b
    Example:
      vsd site build --open
    """


@site.command()
@click.argument("folders", nargs=-1, metavar="[PROJECT]...", type=FilePath())
@path_option("--root", metavar="DIR", help="Every project directly in this folder.")
@click.option(
    "--out",
    metavar="DIR",
    type=click.Path(path_type=Path, file_okay=False),
    help="Folder for index.html (default: reports/ of the project; needed for several).",
)
@click.option("--make", "is_made", is_flag=True, help="First write the reports of stored weeks that have none.")
@click.option("--open", "is_opened", is_flag=True, help="Open the index in a browser.")
@language_option
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
    """Write index.html over all reports: which floors changed, which really differ, how certain, every earlier week.

    Floors are compared at the same crowding, over ten weeks, and never ranked: the page names those that differ beyond
    chance (docs/methods/sites.md). With --json the comparison is printed.

    It is made from the JSON files of the reports and links to them with relative addresses, so it works from a folder
    and from any web server. Reports that are not below the index are copied beside it, into a folder for each
    project. Weeks stay listed when their records are purged. The command names what it cannot list, with exit code 1.

    A page without its JSON file (vsd report alone) gets one if the records still give the very same page.

    \b
    Example:
      vsd site build --make --open
      vsd site build riverside harbour --out public
      vsd site build --root sites --out public
    """
    from vsd_analytics.site_index.collect_reports import gather, projects_below, sources_of, write_index
    from vsd_analytics.site_index.floor_weeks import catalogue
    from vsd_analytics.site_index.page import render_index
    from vsd_analytics.site_index.site_comparison import compare_sites

    named = [*folders, *(projects_below(root) if root is not None else [])]
    sources = sources_of(named or [project.root])
    if out is None and len(sources) > 1:
        raise UsageError("several projects need a folder for their index", fix="--out public")
    for source in sources:
        if (source.folder / "vsd.toml").is_file():
            inner = project.inside(source.folder)
            write_missing_json(inner)
            if is_made:
                make_missing(inner)
    target = folder_of_files(out) if out is not None else sources[0].reports
    collected = gather(sources, target)
    index = catalogue(collected.entries)
    problems = (*collected.problems, *index.problems)
    if not collected.entries:
        for problem in problems:
            project.say(render_error(problem, word="warning"))
        raise VsdError(
            "there is no report to list",
            code="E510",
            why=f"no report with its JSON file was found in {', '.join(str(s.reports) for s in sources)}",
            fix="vsd site build --make, or vsd report --week last --format html,json",
        )
    path = write_index(target, render_index(index))
    n_weeks = len(index.earlier) + (index.latest is not None)
    if as_json:
        printed = [{k: v for k, v in p.as_dict().items() if k != "ok"} for p in problems]
        compared = compare_sites(index.floors, index.latest) if index.latest is not None else None
        emit_json(
            {
                "ok": True,
                "path": str(path),
                "floors": len(index.floors),
                "weeks": n_weeks,
                "comparison": None if compared is None else compared.as_dict(),
                "problems": printed,
            }
        )
    else:
        counted = (
            f"{count(len(index.floors), 'floor')}, {count(n_weeks, 'week')}, {count(len(collected.entries), 'report')}"
        )
        click.echo(f"{path}   {path.stat().st_size / 1000:.0f} KB   {counted}")
        for problem in problems:
            project.say(render_error(problem, word="warning"))
    if is_opened:
        click.launch(str(path))
    return 1 if problems else 0


def write_missing_json(project: Project) -> list[Path]:
    """Write the JSON files of pages that have none, where the records still give the same page to the last byte.

    Any other page is listed without figures: a JSON file of other data than the page would contradict it.

    Args:
        project: A project with a vsd.toml.

    Returns:
        The JSON files written.
    """
    from vsd_analytics.site_index.read_reports import STEM, files_in, kind_of

    folder = project.root / "reports"
    names = files_in(folder)
    lacking = [n.removesuffix(".html") for n in names if kind_of(n) == "report" and n.endswith(".html")]
    written = []
    for stem in (s for s in lacking if f"{s}.json" not in names):
        match = STEM.fullmatch(stem)
        try:
            json_file = _json_of(project, stem, floor_id=match["floor"] if match else None)
        except VsdError:
            continue  # its records are gone, or its floor: named with the other pages without figures
        if json_file is not None:
            written.append(json_file)
            project.say(f"{json_file.name}: the figures of {stem}.html")
    return written


def _json_of(project: Project, stem: str, *, floor_id: str | None) -> Path | None:
    from vsd_analytics.cli.report import make_reports
    from vsd_analytics.cli.report_formats import ReportFiles
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
    """Write page and JSON file of every stored week and floor without a JSON file, up to the last whole week.

    An existing page is not overwritten, and gets no JSON file when nothing is stored of its week any more.

    Args:
        project: A project with a vsd.toml.

    Returns:
        The files written.
    """
    from vsd_analytics.cli.ranges import last_monday
    from vsd_analytics.warehouse.stored_days import stored_stretches

    written, whole = [], last_monday(project)
    for extent in stored_stretches(project.site):
        monday = extent.first_day - timedelta(days=extent.first_day.weekday())
        while monday <= min(extent.last_day, whole):
            iso = monday.isocalendar()
            written += write_week(project, f"{iso.year}-W{iso.week:02d}")
            monday += timedelta(weeks=1)
    return written


def write_week(project: Project, week: str) -> list[Path]:
    """Write page and JSON file of each floor that has no JSON file of a week yet, into the project's reports.

    The question of each page written is stored, so that it can be answered and later weeks do not ask it again.

    Args:
        project: A project with a vsd.toml.
        week: ISO week, such as 2026-W46.

    Returns:
        The files written: a page before its JSON file.
    """
    from vsd_analytics.cli.report import make_reports, remember_questions
    from vsd_analytics.cli.report_formats import ReportFiles
    from vsd_analytics.store.durable import publish

    folder = project.root / "reports"
    folder.mkdir(exist_ok=True)
    floors = [f.floor_id for f in project.site.floors]
    written = []
    for floor_id in floors:
        stem = week if len(floors) == 1 else f"{week}-{floor_id}"
        page, json_file = folder / f"{stem}.html", folder / f"{stem}.json"
        if json_file.exists():
            continue
        try:
            (report,) = make_reports(project, week=week, floor_id=floor_id)
        except ReportError as error:  # shared before, and changed by too little since
            project.say(render_error(error, word="warning"))
            continue
        if page.exists() and report.state == "no_data":
            continue
        files = ReportFiles(report, project.site, is_only=len(floors) == 1)
        if not page.exists():
            publish(page, files.of("html")[page.name])
            written.append(page)
            remember_questions(project, [report])
        publish(json_file, files.of("json")[json_file.name])
        written.append(json_file)
    return written
