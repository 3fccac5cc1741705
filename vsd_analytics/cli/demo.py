"""`vsd demo`: a made-up shop, from engine output to a report, in seconds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import click

from vsd_analytics.cli.options import choice_option
from vsd_analytics.cli.output import progress
from vsd_analytics.cli.project import Project, pass_project

if TYPE_CHECKING:
    from pathlib import Path

WEEKS: Final = {"shop": 2, "canteen": 12}
"""Weeks made without `--weeks`. Twelve are enough to compare a change and to forecast; of the shop they take long."""


@click.command()
@click.argument("folder", default="vsd-demo", metavar="[DIR]")
@choice_option(
    "--place",
    choices=["shop", "canteen"],
    default="shop",
    help="What is made up: a shop with four cameras, or a canteen with one that is open two hours a day.",
)
@click.option(
    "--weeks",
    type=click.IntRange(1, 104),
    help="Weeks to make; 8 or more are a history. Default: 2 of the shop, 12 of the canteen.",
)
@choice_option(
    "--reports",
    choices=["last", "all"],
    default="last",
    help="Reports to write: of the last week, or of all and the site index over them.",
)
@click.option(
    "--last-week",
    default="2026-W46",
    show_default=True,
    metavar="WEEK",
    help="ISO week the made-up data end with.",
)
@click.option("--seed", type=int, default=4, show_default=True, help="Another seed makes other people.")
@click.option("--open", "is_opened", is_flag=True, help="Open the report in a browser.")
@pass_project
def demo(
    project: Project,
    folder: str,
    place: str,
    weeks: int | None,
    reports: str,
    last_week: str,
    seed: int,
    is_opened: bool,
) -> None:
    """Make a demo shop, or canteen, with made-up people and its weekly report.

    The folder is a whole project: vsd.toml, plan, calibrations, engine output, change log. Everything the report
    shows was ingested like real data. truth.json of the shop lists what was planted.

    The canteen has a counter, a till with a waiting line, and a tray return. Its twelve weeks take half a minute.
    Waiting places were marked on the floor four weeks before the end, or before the last week if there are fewer than
    eight.

    With eight weeks or more the shop has a history: a slow rise, a redesign, a change that does nothing, a week mostly
    lost and a holiday.

    \b
    Example:
      vsd demo
      vsd demo my-demo --weeks 12 --reports all
      vsd demo vsd-canteen --place canteen
    """
    import shlex
    import time
    from pathlib import Path

    from vsd_analytics.cli.site import write_week
    from vsd_analytics.errors import UsageError
    from vsd_analytics.simulate.canteen_project import write_canteen_project
    from vsd_analytics.simulate.demo import ingest_demo
    from vsd_analytics.simulate.demo_project import write_demo_project

    root = Path(folder)
    if project.folder != ".":
        raise UsageError(
            f"-C {project.folder}: the demo makes a project of its own",
            why="-C names a project that is there",
            fix=f"vsd demo {shlex.quote(str(Path(project.folder) / folder))}",
        )
    weeks = WEEKS[place] if weeks is None else weeks
    if root.exists() and (not root.is_dir() or any(root.iterdir())):
        raise UsageError(
            f"{folder} is not empty",
            code="E104",
            why="the demo writes a whole project and overwrites nothing",
            fix="vsd demo another-folder",
        )
    started = time.perf_counter()
    is_shop = place == "shop"
    write = write_demo_project if is_shop else write_canteen_project
    with progress(
        None, total=(7 if is_shop else 5) * weeks, label="people walk", unit="day", quiet=project.quiet
    ) as bar:
        truth = write(root, seed=seed, weeks=weeks, last_week=last_week, progress=lambda done, total: bar.update(1))
    written = time.perf_counter()
    counts = f"{truth.n_messages:,} frames, {truth.n_person_records:,} person records"
    made_of = f"{weeks} week{'' if weeks == 1 else 's'} of made-up people"
    what = "a shop with 4 cameras" if is_shop else "a canteen with one camera"
    click.echo(f"  Made {what} and {made_of}: {counts} in {written - started:.1f} s")
    inner = project.inside(root)
    files = sorted((root / "engine").iterdir())
    n_bytes = sum(f.stat().st_size for f in files)
    with progress(None, total=n_bytes, label="reading", unit="B", quiet=project.quiet) as bar:
        result = ingest_demo(inner.site, files, seed=seed, on_bytes=bar.update)
    n_new = sum(c.n_new for c in result.fold.tables.values())
    read = time.perf_counter()
    click.echo(f"  Read into the store: {n_new:,} records in {read - written:.1f} s")
    pages = []
    for week in truth.weeks if reports == "all" else truth.weeks[-1:]:
        pages += [root / "reports" / path.name for path in write_week(inner, week) if path.suffix == ".html"]
    click.echo(f"  Counted, mapped, written in {time.perf_counter() - read:.1f} s")
    if reports == "all":
        pages.append(root / "reports" / _index(inner).name)
    for path in pages:
        click.echo(f"  {path}   {path.stat().st_size / 1000:.0f} KB   open it in any browser")
    click.echo(f"  Next: cd {folder} && vsd coverage --week {last_week}")
    if is_shop and weeks < WEEKS["canteen"]:
        click.echo(
            "  Before and after of a change, and forecasts, need more weeks: vsd demo vsd-canteen --place canteen"
        )
    if is_opened:
        click.launch(str(pages[-1]))


def _index(project: Project) -> Path:
    from vsd_analytics.site_index.collect_reports import gather, sources_of, write_index
    from vsd_analytics.site_index.floor_weeks import catalogue
    from vsd_analytics.site_index.page import render_index

    sources = sources_of([project.root])
    return write_index(sources[0].reports, render_index(catalogue(gather(sources, sources[0].reports).entries)))
