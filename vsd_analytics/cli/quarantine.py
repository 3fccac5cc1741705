"""`vsd quarantine list|replay`: records that could not be used, and how to try them again."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.file_options import renames_of
from vsd_analytics.cli.ingest_output import stored_dict, warn_of_erased
from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import count, emit_json, plain, render_error
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from vsd_analytics.ingest.intake.quarantine_writer import ReasonSummary
    from vsd_analytics.ingest.intake.replay import ReplayResult
    from vsd_analytics.store.quarantine import QuarantineEntry

_SOURCES_SHOWN = 3
_TEXT_CHARS = 160

reason_option = click.option("--reason", metavar="REASON", help="Records of this reason only.")
source_option = click.option("--source", metavar="TEXT", help="Sources whose name contains TEXT only.")


@click.group()
def quarantine() -> None:
    """List the records that could not be used, and try them again.

    \b
    Example:
      vsd quarantine list
      vsd quarantine replay --dry-run
    """


@quarantine.command("list")
@reason_option
@source_option
@click.option(
    "--limit", type=click.IntRange(0, 10_000), default=1, show_default=True, metavar="N", help="Examples per reason."
)
@json_option
@pass_project
def list_(project: Project, /, reason: str | None, source: str | None, limit: int, as_json: bool) -> int:
    """List what is in quarantine by reason: how many, where from, an example, what to do.

    Exit code 1 when there is something.

    \b
    Example:
      vsd quarantine list
      vsd quarantine list --reason unknown-camera --limit 5
    """
    from vsd_analytics.ingest.intake.quarantine_writer import summarise

    summaries = summarise(project.site.root / "quarantine", reason=reason, source=source, n_examples=limit)
    if as_json:
        emit_json({"reasons": [_summary_dict(s, _fix(project, s)) for s in summaries]})
    else:
        for summary in summaries:
            _print_summary(summary, _fix(project, summary))
        if not summaries:
            click.echo("nothing is in quarantine" + (" that fits" if reason or source else ""))
    return 1 if summaries else 0


@quarantine.command()
@reason_option
@source_option
@click.option("--camera", metavar="ID", help="Camera of records that name none.")
@click.option(
    "--map", "renames", metavar="OURS=THEIRS", multiple=True, help="Column renames, instead of those of the ingest."
)
@click.option("--columns", metavar="NAMES", help="Column names of a headerless table, instead of those of the ingest.")
@click.option("--period", "period_s", type=float, metavar="SECONDS", help="Sampling period, instead of the ingest's.")
@click.option("--dry-run", is_flag=True, help="Try everything, write nothing.")
@json_option
@pass_project
def replay(
    project: Project,
    /,
    reason: str | None,
    source: str | None,
    camera: str | None,
    renames: tuple[str, ...],
    columns: str | None,
    period_s: float | None,
    dry_run: bool,
    as_json: bool,
) -> int:
    """Try the records in quarantine again, after you fixed vsd.toml or the mapping.

    Good ones are stored, each once, and leave quarantine; bad ones stay with the reason they have now. Times are
    checked against the instant each record was quarantined at, or against --now if given. Exit code 0 when all are
    gone, 1 when some remain.

    \b
    Example:
      vsd quarantine replay --reason unknown-camera --dry-run
      vsd quarantine replay --map ts=time_utc
    """
    from vsd_analytics.ingest.intake.replay import replay as replay_entries
    from vsd_analytics.ingest.reading.adapter import IngestOptions

    if period_s is not None and not 0 < period_s < 1e6:
        raise UsageError("--period must be greater than 0")
    options = IngestOptions(
        camera=camera,
        map=renames_of(renames),
        columns=None if columns is None else tuple(c.strip() for c in columns.split(",")),
        period_s=period_s,
    )
    now = None if project.now_text is None else project.now
    result = replay_entries(project.site, reason=reason, source=source, options=options, now=now, is_dry_run=dry_run)
    if as_json:
        emit_json(_replay_dict(result, is_dry_run=dry_run))
    else:
        _print_replay(project, result, is_dry_run=dry_run)
    return 1 if result.n_left else 0


def _fix(project: Project, summary: ReasonSummary) -> str | None:
    from vsd_analytics.ingest.reading.reasons import fix_of

    first = summary.first
    if first is None:
        return fix_of(summary.reason)
    return fix_of(
        summary.reason,
        format=first.format,
        mapping=first.options,
        sources=project.site.sources,
        cameras=project.site.cameras,
        row=first.row,
    )


def _summary_dict(summary: ReasonSummary, fix: str | None) -> dict[str, Any]:
    return {
        "reason": summary.reason,
        "kept": summary.n_stored,
        "counted_not_kept": summary.n_not_kept,
        "replayable": summary.n_replayable,
        "sources": dict(summary.sources.most_common()),
        "fix": fix,
        "mend": fix,
        "examples": [
            {
                "source": e.source,
                "line": e.line,
                "at": None if e.at is None else e.at.isoformat(),
                "detail": e.detail,
                "text": e.text,
                "replayable": e.can_be_replayed,
            }
            for e in summary.examples
        ],
    }


def _print_summary(summary: ReasonSummary, fix: str | None) -> None:
    counted = f", and {summary.n_not_kept:,} counted but not stored" if summary.n_not_kept else ""
    line = f"{summary.reason}: {summary.n_stored:,} stored{counted}; {summary.n_replayable:,} can be replayed"
    click.echo(plain(line))
    for name, n in summary.sources.most_common(_SOURCES_SHOWN):
        click.echo(f"    {n:>9,}  {_line(name)}")
    if len(summary.sources) > _SOURCES_SHOWN:
        click.echo(f"               and {len(summary.sources) - _SOURCES_SHOWN:,} more sources")
    for entry in summary.examples:
        _print_example(entry)
    if fix is not None:
        click.echo(f"     fix: {plain(fix)}")


def _print_example(entry: QuarantineEntry) -> None:
    click.echo(f"      --> {_line(entry.source)}, line {entry.line}")
    if entry.text:
        click.echo(f"       |  {_line(entry.text)}")
    click.echo(f"      why: {_line(entry.detail)}")


def _line(text: str) -> str:
    text = plain(text.replace("\n", " "))
    return text if len(text) <= _TEXT_CHARS else text[: _TEXT_CHARS - 1] + "…"


def _replay_dict(result: ReplayResult, *, is_dry_run: bool) -> dict[str, Any]:
    return {
        "dry_run": is_dry_run,
        "tried": result.n_chosen - sum(result.n_not_replayable.values()),
        "fixed": result.n_solved,
        "mended": result.n_solved,
        "records": dict(result.n_records),
        "left_out": dict(result.n_dropped),
        "still_bad": dict(result.n_bad),
        "not_replayable": dict(result.n_not_replayable),
        "counted_not_kept": dict(result.n_not_kept),
        "errors": [e.as_dict() for e in result.errors],
        "stored": stored_dict(result.fold),
        "waited_in_spool": result.waiting.n_new,
    }


def _print_replay(project: Project, result: ReplayResult, *, is_dry_run: bool) -> None:
    from vsd_analytics.ingest.intake.quarantine_writer import ReasonSummary, summarise
    from vsd_analytics.store.erasures import ERASED

    left = {s.reason: s for s in summarise(project.site.root / "quarantine", n_examples=0)} if result.n_bad else {}
    _print_counts("left out", result.n_dropped, "")
    warn_of_erased(result.n_dropped[ERASED] + result.fold.n_erased)
    for reason, n in sorted(result.n_bad.items()):
        click.echo(plain(f"    still bad: {n:,} {reason}"))
        if fix := _fix(project, left.get(reason, ReasonSummary(reason))):
            click.echo(f"         fix: {plain(fix)}")
    _print_counts("cannot be replayed", result.n_not_replayable, "; fix and ingest their file again")
    _print_counts("counted, not stored", result.n_not_kept, "; ingest their file again")
    for error in result.errors:
        click.echo(render_error(error, word="warning"), err=True)
    if n_waiting := result.waiting.n_new:
        click.echo(f"    {count(n_waiting, 'record')} that waited in the spool were stored first")
    n_records, n_new = sum(result.n_records.values()), result.fold.n_new
    counts = f"{result.n_solved:,} of {result.n_chosen:,} are good now, {count(n_records, 'record')}"
    new = "" if is_dry_run or not n_records else f", {n_new:,} of them new to the store"
    if n_new > n_records:  # another process put records into the spool meanwhile
        new = f"; the store gained {n_new:,}, with those that others sent meanwhile"
    click.echo(f"{counts}{new}; {result.n_left:,} remain")
    if is_dry_run:
        click.echo("nothing was written")


def _print_counts(words: str, counts: Mapping[str, int], fix: str) -> None:
    for reason, n in sorted(counts.items()):
        click.echo(plain(f"    {words}: {n:,} {reason}{fix}"))
