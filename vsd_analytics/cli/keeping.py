"""`vsd purge`, `vsd export`: keeping records no longer than needed, and handing over what is kept."""

from __future__ import annotations

import re
from datetime import UTC, date, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.shared import Project, emit_json, instant, json_option, parse_range, pass_project, progress
from vsd_analytics.errors import UsageError

if TYPE_CHECKING:
    from vsd_analytics.export import Exported
    from vsd_analytics.retention import Purged

_NAMES = {"observations": "person record", "pairs": "pair record", "frames": "frame"}


@click.command()
@click.option(
    "--older-than",
    "age",
    metavar="AGE",
    help="Whole UTC days before this: 30d, a date, or retention (retention_days of vsd.toml).",
)
@click.option("--range", "span", metavar="RANGE", help="Local days or times: 2026-11-09T10:00..2026-11-09T12:00.")
@click.option("--camera", metavar="ID", help="With --range: this camera only.")
@click.option("--forget-keys", is_flag=True, help="Destroy the keys of pseudonyms of days whose records are purged.")
@click.option("--dry-run", is_flag=True, help="Say what would go, remove nothing.")
@click.option("--force", is_flag=True, help="Remove more than half of what is stored, too.")
@click.option("--reason", metavar="TEXT", help="Why, for the audit line in purge.jsonl.")
@json_option
@pass_project
def purge(
    project: Project,
    age: str | None,
    span: str | None,
    camera: str | None,
    forget_keys: bool,
    dry_run: bool,
    force: bool,
    reason: str | None,
    as_json: bool,
) -> None:
    """Remove records for good: by age, or of a camera and time. What goes is written to purge.jsonl.

    By age, the figures of removed hours are sealed first and stay; nothing more of these hours is accepted. By camera
    and time everything goes as if it had never come: the undo of a wrong ingest, or a deletion somebody asked for.

    \b
    Example:
      vsd purge --older-than 30d --dry-run
      vsd purge --older-than retention --forget-keys
      vsd purge --camera cam-1 --range 2026-11-09T10:00..2026-11-09T12:00 --reason "wrong camera named"
    """
    from vsd_analytics import retention

    if (age is None) == (span is None) and (age is not None or not forget_keys):
        raise UsageError(
            "say what shall go: either --older-than, or --range",
            mend="vsd purge --older-than 30d --dry-run, or vsd purge --camera ID --range A..B --dry-run",
        )
    if camera is not None and span is None:
        raise UsageError("--camera needs --range", mend=f"--camera {camera} --range 2026-11-09..2026-11-15")
    with progress(None, total=None, label="facts", unit="h", quiet=project.quiet or as_json) as bar:

        def plan(n_hours: int) -> None:
            bar.total = n_hours

        terms = retention.Terms(
            now=project.now,
            reason=reason,
            is_forced=force,
            is_dry_run=dry_run,
            on_wait=lambda: project.say("waiting for a report or query that reads the store"),
            on_plan=plan,
            on_hours=bar.update,
        )
        found: dict[str, Purged] = {}
        before = None if age is None else _before(project, age)
        if before is not None:
            found["older_than"] = retention.purge_older(project.site, before=before, terms=terms)
        elif span is not None:
            first_ms, after_ms = parse_span(span, project=project)
            found["range"] = retention.purge_range(
                project.site, camera_id=_camera(project, camera), first_ms=first_ms, after_ms=after_ms, terms=terms
            )
        if forget_keys:
            found["keys"] = retention.forget_keys(project.site, before=before if dry_run else None, terms=terms)
    if as_json:
        emit_json({"dry_run": dry_run, **{name: _as_dict(purged) for name, purged in found.items()}})
        return
    if before is not None:
        click.echo(f"before {before} (UTC days):")
    for purged in found.values():
        for line in _told(purged, is_dry_run=dry_run):
            click.echo(line)


@click.command()
@click.option("--range", "span", metavar="RANGE", help="Local days or times (default: everything stored).")
@click.option("--camera", metavar="ID", help="This camera only.")
@click.option(
    "--table",
    type=click.Choice(["all", "frames", "observations", "pairs"]),
    help="Which records (default: all for .jsonl, else observations).",
)
@click.option("--out", metavar="FILE", required=True, help="FILE.parquet, FILE.csv, or FILE.jsonl (frame messages).")
@json_option
@pass_project
def export(project: Project, span: str | None, camera: str | None, table: str | None, out: str, as_json: bool) -> None:
    """Write the records themselves to a file, as they are stored: for somebody who asks what is held, or to move on.

    JSON Lines are VSD frame messages, which vsd ingest reads. Positions are personal data: hand the file on with care.

    \b
    Example:
      vsd export --camera cam-1 --range 2026-11-09T10:00..2026-11-09T12:00 --out asked-for.csv
      vsd export --range 2026-11-09..2026-11-15 --out week.jsonl
    """
    from vsd_analytics import export as exporting
    from vsd_analytics.store.removal import Which

    path = Path(out)
    chosen = table or ("all" if path.suffix == ".jsonl" else "observations")
    first_ms, after_ms = (0, 2**53) if span is None else parse_span(span, project=project)
    which = Which(_camera(project, camera), first_ms, after_ms)
    done = exporting.export(project.site, which, out=path, table=None if chosen == "all" else chosen)  # type: ignore[arg-type]
    if as_json:
        told: dict[str, Any] = {"file": out, "records": dict(done.records)}
        emit_json({**told, "without_frame": done.n_unframed, "left_out": done.n_left_out})
        return
    _tell_export(project, done, out)


def parse_span(text: str, *, project: Project) -> tuple[int, int]:
    """Return first instant and end (exclusive), in UTC milliseconds, of local days or times, or of an ISO week.

    Raises:
        UsageError: E101.
    """
    zone = project.site.timezone
    first, dots, last = text.partition("..")
    if "T" in text:
        if not dots:
            raise UsageError(f"--range {text!r} has no end", mend="--range 2026-11-09T10:00..2026-11-09T12:00")
        ends = [_end(part, is_last=i == 1, zone=zone) for i, part in enumerate((first, last))]
    else:
        days = parse_range(text)
        ends = [_end(f"{d}", is_last=i == 1, zone=zone) for i, d in enumerate(days)]
    if ends[0] >= ends[1]:
        raise UsageError(f"--range {text!r} ends before it begins", mend="the earlier time stands first")
    return ends[0], ends[1]


def _end(text: str, *, is_last: bool, zone: str) -> int:
    """Return one end of a range; of a day the start, or the end where it stands last."""
    found = instant(text, zone=zone, what="--range")
    if "T" not in text and is_last:
        found = instant(f"{found.date() + timedelta(days=1)}", zone=zone, what="--range")
    return round(found.timestamp() * 1000)


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
            f"--older-than {age!r} is neither an age nor a date", mend="--older-than 30d, 2026-10-01 or retention"
        ) from None
    if before > today:
        raise UsageError(f"--older-than {age}: that day has not begun", mend="--older-than 0d removes all before today")
    return before


def _camera(project: Project, camera: str | None) -> str | None:
    """Return a camera's id, also of one that vsd.toml does not describe any more but records name."""
    if camera is None:
        return None
    known = {name: c.camera_id for c in project.site.cameras for name in (c.camera_id, *c.engine_ids)}
    if camera not in known and not re.fullmatch(r"[a-z0-9][a-z0-9_-]{0,62}", camera):
        raise UsageError(f"--camera {camera!r} is no camera", mend=f"one of {', '.join(list(known)[:20])}")
    return known.get(camera, camera)


def _told(purged: Purged, *, is_dry_run: bool) -> list[str]:
    if purged.is_nothing:
        return ["nothing to remove"]
    would = "would be " if is_dry_run else ""
    lines = [f"{_count(n, _NAMES[t])} {would}removed" for t, n in purged.records.items() if n]
    if purged.n_days:
        lines.append(f"of {_count(purged.n_days, 'UTC day')}, {purged.first} to {purged.last}")
    if purged.n_sealed:
        lines.append(f"sealed facts of {_count(purged.n_sealed, 'hour')} {would}written")
    if purged.n_quarantined:
        lines.append(f"{_count(purged.n_quarantined, 'quarantined record')} {would}removed")
    if purged.keys:
        ends = f"{purged.keys[0]} to {purged.keys[-1]}"
        lines.append(f"keys of {_count(len(purged.keys), 'day')} {would}destroyed, {ends}")
    return lines


def _as_dict(purged: Purged) -> dict[str, Any]:
    return {
        "records": dict(purged.records),
        "utc_days": purged.n_days,
        "first": None if purged.first is None else purged.first.isoformat(),
        "last": None if purged.last is None else purged.last.isoformat(),
        "sealed_hours": purged.n_sealed,
        "quarantined": purged.n_quarantined,
        "forgotten_days": [d.isoformat() for d in purged.keys],
    }


def _tell_export(project: Project, done: Exported, out: str) -> None:
    said = ", ".join(_count(n, _NAMES[t]) for t, n in done.records.items() if n)
    click.echo(f"{said or 'no records'} written to {out}")
    if done.n_unframed:
        project.say(f"{_count(done.n_unframed, 'instant')} had no frame record: read again, they will have one")
    if done.n_left_out:
        project.say(
            f"{_count(done.n_left_out, 'pair')} without track ids left out: use --table pairs and .csv for them"
        )
    if project.site.settings.pseudonyms:
        project.say("track ids in it are pseudonyms of one camera and day")


def _count(n: int, noun: str) -> str:
    return f"{n:,} {noun}{'' if n == 1 else 's'}"
