"""What `vsd ingest` and `vsd check` print of each file and of all files together."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.card import card_as_dict, local_time, print_card
from vsd_analytics.cli.output import count, plain, render_error
from vsd_analytics.cli.project import Project
from vsd_analytics.errors import VsdError, Where

if TYPE_CHECKING:
    from vsd_analytics.ingest.intake.pipeline import IngestResult, SourceResult
    from vsd_analytics.schema import TableName
    from vsd_analytics.store.store import FoldResult


_CODE = re.compile(r"^W\d{3}: ")


def print_source(project: Project, source: SourceResult, *, has_card: bool = False) -> None:
    """Print what came of one file: records, their times, notes, warnings, quarantined records by reason, the error.

    Args:
        project: For its zone.
        source: The file.
        has_card: Print also what was understood of it.
    """
    from vsd_analytics.ingest.reading.reasons import UNKNOWN_FIELD, fix_of

    n = source.n_records
    if not source.error or n:
        names: tuple[tuple[TableName, str], ...] = (
            ("observations", "person record"),
            ("pairs", "pair record"),
            ("frames", "frame"),
        )
        parts = [count(n[table], name) for table, name in names if n[table]]
        profile = "" if source.card is None or source.card.profile is None else f" by profile {source.card.profile}"
        click.echo(plain(f"{source.source}  [{source.format}]{profile}  {', '.join(parts) or 'no records'}"))
        if source.first_ms is not None and source.last_ms is not None:
            first, last = (local_time(project, ms) for ms in (source.first_ms, source.last_ms))
            click.echo(f"    from {first} to {last}")
    if has_card and source.card is not None:
        print_card(project, source.card)
    for reason, n_records in sorted(source.n_dropped.items()):
        click.echo(f"    left out: {n_records:,} {reason}{'s' if n_records != 1 and reason == UNKNOWN_FIELD else ''}")
    for note in source.notes:
        if note.startswith("info:"):
            click.echo(plain(f"    {note.removeprefix('info:').strip()}"))
        else:
            code, _, text = note.partition(": ") if _CODE.match(note) else ("W209", "", note)
            click.echo(plain(f"warning[{code}]: {text}\n more: vsd explain {code}"), err=True)
    for seen in () if source.card is None else source.card.warnings:
        if has_card or source.is_new_shape or not seen.is_note:
            warning = VsdError(seen.what, code=seen.code, where=Where(source.source), why=seen.why, fix=seen.fix)
            click.echo(render_error(warning, word="warning"), err=True)
    for reason, n_records in sorted(source.n_rejected.items()):
        example = source.examples[reason]
        warning = VsdError(
            f"{count(n_records, 'record')} quarantined: {reason}",
            code="W210",
            where=Where(source.source, example.line, example.text or None),
            why=example.detail[:300],
            fix=fix_of(
                reason,
                format=source.format,
                mapping=source.mapping,
                sources=project.site.sources,
                cameras=project.site.cameras,
                row=example.row,
            ),
        )
        click.echo(render_error(warning, word="warning"), err=True)
    if source.error is not None:
        click.echo(render_error(source.error), err=True)


def print_total(result: IngestResult, *, is_dry_run: bool) -> None:
    """Print how many records of all files are new, were known, or went to quarantine."""
    from vsd_analytics.store.store import TableCounts

    if is_dry_run:
        counts = sum(result.counted.tables.values(), TableCounts())
        parts = [f"{count(counts.n_second, 'second sighting')} would be left out"] if counts.n_second else []
        parts += [f"{count(counts.n_known, 'record')} would come twice"] if counts.n_known else []
        if parts:
            click.echo(f"{count(counts.n_new, 'different record')}; {', '.join(parts)}")
        click.echo("nothing was written")
        return
    warn_of_full_disk(result.fold)
    _warn_of_sealed(result.fold)
    warn_of_erased(result.fold.n_erased)
    tables = result.fold.tables
    n_new = result.fold.n_new
    n_known = sum(c.n_known for c in tables.values())
    n_second = sum(c.n_second for c in tables.values())
    n_ready = result.fold.n_to_hand_on
    parts = [f"{count(n_ready, 'record')} to hand on" if n_ready else f"{count(n_new, 'new record')} stored"]
    parts += [f"{n_known:,} {'was' if n_known == 1 else 'were'} known already"] if n_known else []
    parts += [f"{count(n_second, 'second sighting')} left out"] if n_second else []
    parts += [f"{result.n_rejected:,} quarantined"] if result.n_rejected else []
    # commands that run at the same time share the spool: whoever folds first stores the records of all
    n_folded = sum(c.n_new + c.n_known + c.n_second + c.n_sealed + c.n_erased for c in tables.values())
    n_others = n_folded - sum(sum(source.n_records.values()) for source in result.sources)
    if not n_ready and n_others > 0:
        parts.append(f"with {count(n_others, 'record')} that waited or came from other commands")
    elif not n_ready and n_others < 0:
        parts.append(f"{count(-n_others, 'record')} of these files stored by another command meanwhile")
    click.echo(", ".join(parts))


def warn_of_full_disk(fold: FoldResult) -> None:
    """Warn (W304) when the fold had to use up the ballast of the store."""
    if fold.is_ballast_spent:
        warning = VsdError(
            "the disk is full: the ballast of the store was given up to put acknowledged records in their place",
            code="W304",
            fix="free some space soon (df -h); the ballast comes back by itself",
        )
        click.echo(render_error(warning, word="warning"), err=True)


def warn_of_erased(n_records: int) -> None:
    """Warn (W312) of records that came again after they were erased on request, and are not stored."""
    if n_records:
        warning = VsdError(
            f"{count(n_records, 'record')} left out: deleted on request before",
            code="W312",
            why="vsd purge with --camera, --range and --reason keeps its records out",
            fix="nothing; if that purge was a mistake, repeat it with --lift and bring the records again",
        )
        click.echo(render_error(warning, word="warning"), err=True)


def _warn_of_sealed(fold: FoldResult) -> None:
    from vsd_analytics.ingest.reading.reasons import FIXES
    from vsd_analytics.store.seals import SEALED

    if fold.n_sealed:
        warning = VsdError(
            f"{count(fold.n_sealed, 'record')} quarantined: {SEALED}",
            code="W210",
            why="a purge sealed their hours after they were read",
            fix=FIXES[SEALED],
        )
        click.echo(render_error(warning, word="warning"), err=True)


def stored_dict(fold: FoldResult) -> dict[str, dict[str, int]]:
    """Return what a fold did with the records of each table, as `--json` prints it."""
    return {
        t: {
            "new": c.n_new,
            "known": c.n_known,
            "second_sightings": c.n_second,
            "sealed": c.n_sealed,
            "erased": c.n_erased,
        }
        for t, c in fold.tables.items()
    }


def result_as_dict(project: Project, result: IngestResult, *, is_dry_run: bool) -> dict[str, Any]:
    """Return the object that `--json` prints."""
    return {
        "ok": not any(s.error for s in result.sources),
        "dry_run": is_dry_run,
        "sources": [
            {
                "source": s.source,
                "import_id": s.import_id or None,
                "format": s.format,
                "records": dict(s.n_records),
                "quarantined": dict(s.n_rejected),
                "examples": {
                    reason: {"line": e.line, "detail": e.detail, "text": e.text} for reason, e in s.examples.items()
                },
                "left_out": dict(s.n_dropped),
                "notes": s.notes,
                "first": None if s.first_ms is None else local_time(project, s.first_ms).replace(" ", "T"),
                "last": None if s.last_ms is None else local_time(project, s.last_ms).replace(" ", "T"),
                "error": None if s.error is None else s.error.as_dict(),
                "card": None if s.card is None else card_as_dict(project, s.card),
            }
            for s in result.sources
        ],
        "counted": {
            t: {"new": c.n_new, "known": c.n_known, "second_sightings": c.n_second}
            for t, c in result.counted.tables.items()
        },
        "stored": stored_dict(result.fold),
        "is_ballast_spent": result.fold.is_ballast_spent,
    }
