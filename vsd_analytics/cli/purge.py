"""`vsd purge`: delete records by age, of a camera and time, or of one import."""

from __future__ import annotations

import re
from datetime import UTC, date, timedelta
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import count, emit_json, facts_progress, plain
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.cli.ranges import RECORD_NAMES, camera_id_of, parse_span
from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    from vsd_analytics.retention.purge import Purged


@click.command()
@click.option(
    "--older-than",
    "age",
    metavar="AGE",
    help="Whole UTC days before this: 30d, a date, or retention (retention_days of vsd.toml).",
)
@click.option("--range", "span", metavar="RANGE", help="Local days or times: 2026-11-09T10:00..2026-11-09T12:00.")
@click.option("--camera", metavar="ID", help="With --range: this camera only.")
@click.option("--import", "import_id", metavar="ID", help="What one import alone brought; vsd imports lists them.")
@click.option("--forget-keys", is_flag=True, help="Destroy the keys of pseudonyms of days whose records are purged.")
@click.option("--dry-run", is_flag=True, help="Print what would be deleted, delete nothing.")
@click.option("--force", is_flag=True, help="Allow to delete more than half of what is stored.")
@click.option(
    "--reason",
    metavar="TEXT",
    help="Why, for the audit line in purge.jsonl. With --range: an erasure, these records never come back.",
)
@click.option(
    "--lift", "is_lifting", is_flag=True, help="With --range and --reason of an erasure: let its records come again."
)
@json_option
@pass_project
def purge(
    project: Project,
    age: str | None,
    span: str | None,
    camera: str | None,
    import_id: str | None,
    forget_keys: bool,
    dry_run: bool,
    force: bool,
    reason: str | None,
    is_lifting: bool,
    as_json: bool,
) -> None:
    """Delete records for good: by age, of a camera and time, or of one import. purge.jsonl logs what was deleted.

    By age, the figures of the deleted hours are sealed first and remain; records of these hours are refused from then
    on; files of a watched folder that were read before then are deleted, too. By camera and time, everything is
    deleted as if it had never come. With a --reason, such as a person's request, that lasts: the same records are
    left out when a file, a node, a bucket or the quarantine brings them again; --lift ends it. Without a --reason
    they can be ingested again, corrected. Records in quarantine are deleted too, also those that may be meant because
    their camera or time is unreadable. By import, what one file alone brought is deleted; what others brought as well
    stays.

    \b
    Example:
      vsd purge --import 3f9c21ab --dry-run
      vsd purge --older-than 30d --dry-run
      vsd purge --older-than retention --forget-keys
      vsd purge --camera cam-1 --range 2026-11-09T10:00..2026-11-09T12:00 --reason "request 7"
    """
    from vsd_analytics.retention import purge, purge_import

    n_ways = sum(way is not None for way in (age, span, import_id))
    if n_ways > 1 or (not n_ways and not forget_keys):
        raise UsageError(
            "say what to delete: either --older-than, or --range, or --import",
            fix="vsd purge --older-than 30d --dry-run, or vsd purge --camera ID --range A..B --dry-run",
        )
    if camera is not None and span is None:
        raise UsageError("--camera needs --range", fix=f"--camera {camera} --range 2026-11-09..2026-11-15")
    if is_lifting and (span is None or reason is None):
        raise UsageError(
            "--lift needs the --range and the --reason of the erasure", fix="they stand in purge.jsonl, with its camera"
        )
    if reason is not None and not reason.strip():
        raise UsageError("--reason is empty", fix='--reason "request 7"')
    with facts_progress(quiet=project.quiet or as_json) as (on_plan, on_hours):
        terms = purge.Terms(
            now=project.now,
            reason=reason,
            is_forced=force,
            is_dry_run=dry_run,
            on_wait=lambda: project.say("waiting for a report or query that reads the store"),
            on_plan=on_plan,
            on_hours=on_hours,
        )
        purges: dict[str, Purged] = {}
        source = ""
        before = None if age is None else _before(project, age)
        if before is not None:
            purges["older_than"] = purge.purge_older(project.site, before=before, terms=terms)
        elif span is not None:
            first_ms, after_ms = parse_span(span, project=project)
            if is_lifting:
                purge.lift_range(
                    project.site,
                    camera_id=camera_id_of(project, camera),
                    first_ms=first_ms,
                    after_ms=after_ms,
                    terms=terms,
                )
                if as_json:
                    emit_json({"dry_run": dry_run, "lifted": 1})
                else:
                    click.echo(f"the erasure {'would be' if dry_run else 'is'} lifted: bring its records again")
                return
            purges["range"] = purge.purge_range(
                project.site, camera_id=camera_id_of(project, camera), first_ms=first_ms, after_ms=after_ms, terms=terms
            )
        elif import_id is not None:
            listed, purges["import"] = purge_import.purge_import(project.site, import_id, terms=terms)
            source = "" if listed is None else listed.source
        if forget_keys:
            purges["keys"] = purge.forget_keys(project.site, purged=before, terms=terms)
    if as_json:
        emit_json({"dry_run": dry_run, **{name: _as_dict(purged) for name, purged in purges.items()}})
        return
    if before is not None:
        click.echo(f"before {before} (UTC days):")
    if source:
        click.echo(plain(f"import of {source}:"))
    for purged in purges.values():
        for line in _lines(purged, is_dry_run=dry_run):
            click.echo(line)
    if span is not None:
        ends = "they never come back (--lift ends that)" if reason else "to keep them out for good, add --reason"
        click.echo(f"the same records, if they come again: {ends}")


def _before(project: Project, age: str) -> date:
    """Return the first UTC date that stays."""
    today = project.now.astimezone(UTC).date()
    if age == "retention":
        return today - timedelta(days=int(project.site.settings.retention_days))
    if days := re.fullmatch(r"(\d{1,5})d", age):
        return today - timedelta(days=int(days[1]))
    try:
        before = date.fromisoformat(age)
    except ValueError:
        raise UsageError(
            f"--older-than {age!r} is neither an age nor a date", fix="--older-than 30d, 2026-10-01 or retention"
        ) from None
    if before > today:
        raise UsageError(f"--older-than {age}: that day has not begun", fix="--older-than 0d removes all before today")
    return before


def _lines(purged: Purged, *, is_dry_run: bool) -> list[str]:
    if purged.is_nothing:
        return ["nothing to remove"]
    would = "would be " if is_dry_run else ""
    lines = [f"{count(n, RECORD_NAMES[t])} {would}removed" for t, n in purged.records.items() if n]
    if purged.n_days:
        lines.append(f"of {count(purged.n_days, 'UTC day')}, {purged.first} to {purged.last}")
    if purged.n_staying:
        lines.append(f"{count(purged.n_staying, 'record')} of it came from elsewhere too: not removed")
    if purged.n_again:
        lines.append(f"{count(purged.n_again, 'record')} of it came from elsewhere first: not removed")
    if purged.n_sealed:
        lines.append(f"sealed facts of {count(purged.n_sealed, 'hour')} {would}written")
    if purged.n_quarantined:
        doubt = f", {purged.n_doubtful:,} as their camera or time cannot be read" if purged.n_doubtful else ""
        lines.append(f"{count(purged.n_quarantined, 'quarantined record')} {would}removed{doubt}")
    if purged.n_files:
        lines.append(f"{count(purged.n_files, 'read file')} of watched folders {would}removed")
    if purged.keys:
        ends = f"{purged.keys[0]} to {purged.keys[-1]}"
        lines.append(f"keys of {count(len(purged.keys), 'day')} {would}destroyed, {ends}")
    return lines


def _as_dict(purged: Purged) -> dict[str, Any]:
    return {
        "records": dict(purged.records),
        "utc_days": purged.n_days,
        "first": None if purged.first is None else purged.first.isoformat(),
        "last": None if purged.last is None else purged.last.isoformat(),
        "sealed_hours": purged.n_sealed,
        "quarantined": purged.n_quarantined,
        "doubtful": purged.n_doubtful,
        "read_files": purged.n_files,
        "staying": purged.n_staying,
        "belonging_to_others": purged.n_again,
        "forgotten_days": [d.isoformat() for d in purged.keys],
    }
