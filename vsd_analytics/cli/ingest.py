"""`vsd ingest`: read engine output into the store."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.card import print_card
from vsd_analytics.cli.file_options import file_options, ingest_options, with_standard_input
from vsd_analytics.cli.ingest_output import print_source, print_total, result_as_dict
from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import count, emit_json, plain, progress
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    from vsd_analytics.ingest.intake.pipeline import SourceResult


@click.command()
@click.argument("files", nargs=-1, metavar="[FILES...]")
@file_options
@click.option("--watch", "folder", metavar="DIR", help="Ingest every file that appears in DIR, until stopped.")
@click.option("--dry-run", is_flag=True, help="Read and check everything, write nothing.")
@click.option(
    "--yes", "is_sure", is_flag=True, help="Store files although something about them is almost surely wrong."
)
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

    Before the first file of a new kind of table, the command prints what it understood. A file that is almost surely
    understood wrongly (millimetres as metres, several cameras as one) is not stored, unless --yes is given.

    With --watch the command runs until it is stopped (SIGTERM or Ctrl-C): each file that appears in the folder is
    ingested once it no longer changes, then moved to DIR/done, or to DIR/failed with the reason beside it. Names that
    begin with a dot or end in .part or .tmp are ignored: write a file under such a name, then rename it.

    \b
    Example:
      vsd ingest frames.jsonl
      vsd ingest day1.csv.gz --format positions --columns ts,track_id,x_m,y_m --camera cam-1 --period 1
      vsd ingest export.csv --map ts=time --map x_m=x --map y_m=y --dry-run
      zcat day1.csv.gz | vsd ingest - --map ts=time
      vsd ingest --watch /srv/engine-out
    """
    if folder is not None:
        if files or dry_run:
            raise UsageError("--watch DIR takes neither FILES nor --dry-run", fix="vsd ingest --watch DIR")
        return _watch(project, Path(folder), given, as_json=as_json)
    if not files:
        raise UsageError(
            "Missing argument 'FILES...'", why="neither FILES nor --watch DIR were given", fix="vsd ingest FILES..."
        )
    return read_files(project, files, given, is_dry_run=dry_run, as_json=as_json)


def read_files(
    project: Project,
    files: tuple[str, ...],
    given: dict[str, Any],
    *,
    is_dry_run: bool,
    as_json: bool,
    read_as: list[str] | None = None,
) -> int:
    """Read files into the store, or only check them, print the result and return the exit code.

    The formats of files that could be read, and are not almost surely understood wrongly, are added to `read_as`.
    """
    from vsd_analytics.ingest.formats.recognise import refuse_streams
    from vsd_analytics.ingest.intake.pipeline import ingest as ingest_files

    refuse_streams(files)
    options = ingest_options(project, given)
    is_quiet = project.quiet or as_json

    def show_card(source: SourceResult) -> None:
        if source.card is not None and source.is_new_shape:
            click.echo(plain(source.source))
            print_card(project, source.card)

    with (
        with_standard_input(files, project.site.settings) as (paths, shown),
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
            on_card=None if is_quiet or is_dry_run else show_card,
            shown=shown,
        )
    if as_json:
        emit_json(result_as_dict(project, result, is_dry_run=is_dry_run))
    else:
        for source in result.sources:
            print_source(project, source, has_card=is_dry_run)
        print_total(result, is_dry_run=is_dry_run)
    if read_as is not None:
        is_right = [s for s in result.sources if not s.error and s.card is not None and not s.card.sure_warnings]
        read_as += [s.format for s in is_right if s.n_records]
    if any(s.error for s in result.sources):
        return 2
    has_notes = any(not n.startswith("info:") for s in result.sources for n in s.notes)
    has_warnings = any(
        is_dry_run or not d.is_note for s in result.sources if s.card is not None for d in s.card.warnings
    )
    return 1 if result.n_rejected or has_notes or has_warnings or result.fold.is_ballast_spent else 0


def _watch(project: Project, folder: Path, given: dict[str, Any], *, as_json: bool) -> int:
    from vsd_analytics.cli.exit_codes import stop_signals
    from vsd_analytics.live.watch import watch

    with stop_signals() as stopped:
        project.say(f"watching {folder}; Ctrl-C ends it")
        status = watch(
            project.site,
            folder,
            ingest_options(project, given),
            clock=project.clock,
            sleep=stopped.wait,
            stop=stopped.is_set,
            on_source=None if project.quiet or as_json else lambda source: print_source(project, source),
            report=project.say,
        )
    if as_json:
        emit_json(status.as_dict(now=project.clock()))
    else:
        project.say(f"{count(status.n_done, 'file')} ingested, {status.n_failed:,} failed, {status.n_open:,} open")
    return 0


def _size(path: Path) -> int:
    from vsd_analytics.ingest.reading.adapter import Source

    try:
        return Source(path).size_bytes
    except OSError:
        return 0
