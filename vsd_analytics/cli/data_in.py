"""`vsd ingest`, `vsd check`, `vsd build`: from files to facts."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.shared import (
    F,
    Project,
    emit_json,
    instant,
    json_option,
    pass_project,
    plain,
    progress,
    render_error,
)
from vsd_analytics.errors import UsageError, VsdError, Where

if TYPE_CHECKING:
    from vsd_analytics.ingest.adapter import IngestOptions
    from vsd_analytics.ingest.pipeline import IngestResult, SourceResult
    from vsd_analytics.schema import TableName
    from vsd_analytics.store import FoldResult

_CODE = re.compile(r"^W\d{3}: ")


def _file_options(command: F) -> F:
    options: list[Callable[[Any], Any]] = [
        click.option(
            "--format",
            "kind",
            metavar="NAME",
            help="frames, table, positions, pairs, smart-social-distancing, motchallenge, wildtrack; else detected.",
        ),
        click.option("--camera", metavar="ID", help="Camera of records that name none."),
        click.option(
            "--columns", metavar="NAMES", help="Headerless table: our names in the file's order; _ for one to ignore."
        ),
        click.option(
            "--map",
            "renames",
            metavar="OURS=THEIRS",
            multiple=True,
            help="Column renames; repeat or separate by commas.",
        ),
        click.option(
            "--period",
            "period_s",
            type=float,
            metavar="SECONDS",
            help="Sampling period: records of one period are one frame.",
        ),
        click.option("--fps", type=float, metavar="N", help="Frames per second, for files with frame numbers."),
        click.option("--start", metavar="INSTANT", help="Time of the first frame, for files with frame numbers."),
        click.option(
            "--first-frame",
            type=float,
            metavar="N",
            help="Number of the frame that stands at --start (default: the format's first).",
        ),
        click.option(
            "--coordinates", type=click.Choice(["floor", "image"]), help="Which of a format's coordinates to use."
        ),
        click.option(
            "--method",
            type=click.Choice(["center-points", "four-corner"]),
            default="center-points",
            show_default=True,
            help="smart-social-distancing: its distance method.",
        ),
        click.option(
            "--resolution",
            metavar="WxH",
            default="640x480",
            show_default=True,
            help="smart-social-distancing: resolution boxes were logged at.",
        ),
        click.option(
            "--threshold",
            "threshold_m",
            type=float,
            default=1.5,
            show_default=True,
            metavar="METRES",
            help="smart-social-distancing: its distance limit.",
        ),
        click.option(
            "--per-camera", is_flag=True, help="wildtrack: each view's boxes as a camera of its own, C1 to C7."
        ),
        click.option("--engine", metavar="NAME", help="Engine name and version, where the files do not say."),
    ]
    for option in reversed(options):
        command = option(command)
    return command


@click.command()
@click.argument("files", nargs=-1, metavar="[FILES...]")
@_file_options
@click.option("--watch", "folder", metavar="DIR", help="Ingest every file that appears in DIR, until stopped.")
@click.option("--dry-run", is_flag=True, help="Read and check everything, write nothing.")
@json_option
@pass_project
def ingest(
    project: Project,
    /,
    files: tuple[str, ...],
    folder: str | None,
    dry_run: bool,
    as_json: bool,
    **given: Any,
) -> int:
    """Read engine output into the store. Records already stored are recognised; bad ones are quarantined.

    With --watch the command runs until it is stopped (SIGTERM or Ctrl-C): each file that appears in the folder is
    ingested once it stands still, then moved to DIR/done, or to DIR/failed with the reason beside it. Names that begin
    with a dot or end in .part or .tmp are left alone, so that a file can be written under one and then renamed.

    \b
    Example:
      vsd ingest frames.jsonl
      vsd ingest day1.csv.gz --format positions --columns ts,track_id,x_m,y_m --camera cam-1 --period 1
      vsd ingest export.csv --map ts=time --map x_m=x --map y_m=y --dry-run
      vsd ingest --watch /srv/engine-out
    """
    if folder is not None:
        if files or dry_run:
            raise UsageError("--watch DIR takes neither FILES nor --dry-run", mend="vsd ingest --watch DIR")
        return _watch(project, Path(folder), given, as_json=as_json)
    if not files:
        raise UsageError(
            "Missing argument 'FILES...'", why="neither FILES nor --watch DIR were given", mend="vsd ingest FILES..."
        )
    return _read(project, files, given, is_dry_run=dry_run, as_json=as_json)


@click.command()
@click.argument("files", nargs=-1, required=True, metavar="FILES...")
@_file_options
@json_option
@pass_project
def check(project: Project, /, files: tuple[str, ...], as_json: bool, **given: Any) -> int:
    """Validate files and change nothing: format, columns, times, cameras, numbers.

    \b
    Example:
      vsd check export/*.csv
    """
    return _read(project, files, given, is_dry_run=True, as_json=as_json)


@click.command()
@json_option
@pass_project
def build(project: Project, /, as_json: bool) -> int:
    """Compute the facts that are stale, and say why each was. Figures and reports do this by themselves.

    \b
    Example:
      vsd build
    """
    from vsd_analytics.store import Store
    from vsd_analytics.warehouse.build import build as build_facts

    site = project.site
    folded = Store(site.root / "store", site_id=site.site_id, ballast_mb=site.settings.ballast_mb).fold()
    _warn_of_full_disk(folded)
    with progress(None, total=None, label="facts", unit="h", quiet=project.quiet) as bar:

        def plan(n_hours: int) -> None:
            bar.total = n_hours

        result = build_facts(site, on_plan=plan, on_hours=bar.update)
    if as_json:
        emit_json({"n_fresh": result.n_fresh, "n_built": result.n_built, "reasons": dict(result.reasons)})
        return int(folded.is_ballast_spent)
    for reason, n in sorted(result.reasons.items()):
        click.echo(f"{n:>8,} hours  {reason}")
    click.echo(f"{result.n_built:,} hours computed, {result.n_fresh:,} were fresh")
    return int(folded.is_ballast_spent)


def _read(project: Project, files: tuple[str, ...], given: dict[str, Any], *, is_dry_run: bool, as_json: bool) -> int:
    from vsd_analytics.ingest.pipeline import ingest as ingest_files

    options = _options(project, given)
    paths = [Path(f) for f in files]
    is_quiet = project.quiet or as_json
    with (
        progress(None, total=sum(map(_size, paths)), label="reading", unit="B", quiet=is_quiet) as reading,
        progress(None, total=None, label="storing", unit=" records", quiet=is_quiet) as storing,
    ):
        result = ingest_files(
            project.site,
            paths,
            options,
            now=project.now,
            is_dry_run=is_dry_run,
            on_bytes=reading.update,
            on_rows=storing.update,
        )
    if as_json:
        emit_json(_as_dict(project, result, is_dry_run=is_dry_run))
    else:
        for source in result.sources:
            _tell_source(project, source)
        _tell_total(result, is_dry_run=is_dry_run)
    if any(s.error for s in result.sources):
        return 2
    warned = any(not n.startswith("info:") for s in result.sources for n in s.notes)
    return 1 if result.n_rejected or warned or result.fold.is_ballast_spent else 0


def _watch(project: Project, folder: Path, given: dict[str, Any], *, as_json: bool) -> int:
    import signal
    import threading
    from datetime import UTC, datetime

    from vsd_analytics.live.watch import watch

    stopped = threading.Event()

    def clock() -> datetime:
        return project.now if project.now_text is not None else datetime.now(tz=UTC)

    before = {s: signal.signal(s, lambda *_: stopped.set()) for s in (signal.SIGTERM, signal.SIGINT)}
    try:
        project.say(f"watching {folder}; Ctrl-C ends it")
        status = watch(
            project.site,
            folder,
            _options(project, given),
            clock=clock,
            sleep=stopped.wait,
            stop=stopped.is_set,
            on_source=None if project.quiet or as_json else lambda source: _tell_source(project, source),
            tell=project.say,
        )
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    if as_json:
        emit_json(status.as_dict(now=clock()))
    else:
        project.say(f"{_count(status.n_done, 'file')} ingested, {status.n_failed:,} failed, {status.n_open:,} open")
    return 0


def _size(path: Path) -> int:
    from vsd_analytics.ingest.adapter import Source

    try:
        return Source(path).size_bytes
    except OSError:
        return 0


def _options(project: Project, given: dict[str, Any]) -> IngestOptions:
    from vsd_analytics.ingest.adapter import IngestOptions

    renames = renames_of(given["renames"])
    size = re.fullmatch(r"(\d{1,5})x(\d{1,5})", given["resolution"])
    if size is None:
        raise UsageError(f"--resolution {given['resolution']!r} is not WIDTHxHEIGHT", mend="--resolution 640x480")
    for name in ("period_s", "fps", "threshold_m"):
        if given[name] is not None and not 0 < given[name] < 1e6:
            raise UsageError(f"--{name.removesuffix('_s').removesuffix('_m')} must be greater than 0")
    if given["first_frame"] is not None and not abs(given["first_frame"]) < 1e15:
        raise UsageError("--first-frame must be a number of a frame")
    if given["per_camera"] and given["camera"] is not None:
        raise UsageError("--per-camera names the cameras C1 to C7 itself", mend="leave out --camera")
    start = None
    if given["start"] is not None:
        start = round(instant(given["start"], zone=project.site.timezone, what="--start").timestamp() * 1000)
    columns = given["columns"]
    return IngestOptions(
        format=given["kind"],
        camera=given["camera"],
        columns=None if columns is None else tuple(c.strip() for c in columns.split(",")),
        map=renames,
        period_s=given["period_s"],
        fps=given["fps"],
        start=start,
        first_frame=given["first_frame"],
        coordinates=given["coordinates"],
        method=given["method"],
        resolution_px=(int(size[1]), int(size[2])),
        threshold_m=given["threshold_m"],
        engine=given["engine"],
        per_camera=given["per_camera"],
    )


def renames_of(given: Sequence[str]) -> dict[str, str]:
    """Return the column renames of `--map`, ours to theirs.

    Raises:
        UsageError: E101, one is not OURS=THEIRS, or no column of ours is called so.
    """
    from vsd_analytics.config.reader import nearest
    from vsd_analytics.ingest.columns import KNOWN

    renames = {}
    for text in (part for r in given for part in r.split(",")):
        ours, equals, theirs = text.partition("=")
        if not equals or not ours.strip() or not theirs.strip():
            raise UsageError(f"--map {text!r} is not OURS=THEIRS", mend="--map ts=time")
        if ours.strip() not in KNOWN:
            near = nearest(ours.strip(), KNOWN)
            raise UsageError(
                f"--map {text!r}: no column of ours is called {ours.strip()!r}",
                why=f"ours: {', '.join(KNOWN)}",
                mend=f"--map {near or 'ts'}={theirs.strip()}",
            )
        renames[ours.strip()] = theirs.strip()
    return renames


def _tell_source(project: Project, source: SourceResult) -> None:
    from vsd_analytics.ingest.reasons import MENDS

    n = source.n_records
    if not source.error or n:
        names: tuple[tuple[TableName, str], ...] = (
            ("observations", "person record"),
            ("pairs", "pair record"),
            ("frames", "frame"),
        )
        parts = [_count(n[table], name) for table, name in names if n[table]]
        click.echo(plain(f"{source.source}  [{source.format}]  {', '.join(parts) or 'no records'}"))
        if source.first_ms is not None and source.last_ms is not None:
            first, last = (_local(project, ms) for ms in (source.first_ms, source.last_ms))
            click.echo(f"    from {first} to {last}")
    for reason, count in sorted(source.n_dropped.items()):
        click.echo(f"    left out: {count:,} {reason}{'s' if count != 1 and reason == 'unknown field' else ''}")
    for note in source.notes:
        if note.startswith("info:"):
            click.echo(plain(f"    {note.removeprefix('info:').strip()}"))
        else:
            code, _, text = note.partition(": ") if _CODE.match(note) else ("W209", "", note)
            click.echo(plain(f"warning[{code}]: {text}\n more: vsd explain {code}"), err=True)
    for reason, count in sorted(source.n_rejected.items()):
        example = source.examples[reason]
        warning = VsdError(
            f"{_count(count, 'record')} quarantined: {reason}",
            code="W210",
            where=Where(source.source, example.line, example.text or None),
            why=example.detail[:300],
            mend=MENDS.get(reason),
        )
        click.echo(render_error(warning, word="warning"), err=True)
    if source.error is not None:
        click.echo(render_error(source.error), err=True)


def _count(n: int, noun: str) -> str:
    return f"{n:,} {noun}{'' if n == 1 else 's'}"


def _local(project: Project, ms: int) -> str:
    from datetime import datetime

    return datetime.fromtimestamp(ms / 1000, tz=project.site.zone).isoformat(sep=" ", timespec="seconds")


def _tell_total(result: IngestResult, *, is_dry_run: bool) -> None:
    if is_dry_run:
        click.echo("nothing was written")
        return
    _warn_of_full_disk(result.fold)
    tables = result.fold.tables
    n_new = sum(c.n_new for c in tables.values())
    n_known = sum(c.n_known for c in tables.values())
    n_second = sum(c.n_second for c in tables.values())
    said = [f"{_count(n_new, 'new record')} stored"]
    said += [f"{n_known:,} {'was' if n_known == 1 else 'were'} known already"] if n_known else []
    said += [f"{_count(n_second, 'second sighting')} left out"] if n_second else []
    said += [f"{result.n_rejected:,} quarantined"] if result.n_rejected else []
    click.echo(", ".join(said))


def _warn_of_full_disk(fold: FoldResult) -> None:
    if fold.is_ballast_spent:
        warning = VsdError(
            "the disk is full: the ballast of the store was given up to put acknowledged records in their place",
            code="W304",
            mend="free some space soon (df -h); the ballast comes back by itself",
        )
        click.echo(render_error(warning, word="warning"), err=True)


def _as_dict(project: Project, result: IngestResult, *, is_dry_run: bool) -> dict[str, Any]:
    return {
        "ok": not any(s.error for s in result.sources),
        "dry_run": is_dry_run,
        "sources": [
            {
                "source": s.source,
                "format": s.format,
                "records": dict(s.n_records),
                "quarantined": dict(s.n_rejected),
                "examples": {
                    reason: {"line": e.line, "detail": e.detail, "text": e.text} for reason, e in s.examples.items()
                },
                "left_out": dict(s.n_dropped),
                "notes": s.notes,
                "first": None if s.first_ms is None else _local(project, s.first_ms).replace(" ", "T"),
                "last": None if s.last_ms is None else _local(project, s.last_ms).replace(" ", "T"),
                "error": None if s.error is None else s.error.as_dict(),
            }
            for s in result.sources
        ],
        "stored": {
            t: {"new": c.n_new, "known": c.n_known, "second_sightings": c.n_second}
            for t, c in result.fold.tables.items()
        },
        "is_ballast_spent": result.fold.is_ballast_spent,
    }
