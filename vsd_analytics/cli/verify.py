"""`vsd verify`: prove that a store is undamaged, or name what is damaged and what to do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json, progress, render_error
from vsd_analytics.cli.project import Project, pass_project
from vsd_analytics.config.project import FILE as CONFIG
from vsd_analytics.errors import VsdError, Where
from vsd_analytics.site.instants import parse_range

if TYPE_CHECKING:
    from vsd_analytics.store.verify_files import StoreFault
    from vsd_analytics.warehouse.verify_facts import Verification


@click.command()
@click.option(
    "--range", "days", metavar="DAYS", help="Local days: 2026-11-09..2026-11-15, 2026-W46 (default: everything stored)."
)
@click.option(
    "--facts/--no-facts", "with_facts", default=True, help="Check the computed facts as well, or the store alone."
)
@json_option
@pass_project
def verify(project: Project, /, days: str | None, with_facts: bool, as_json: bool) -> int:
    """Check the whole store: every byte, every row, every name. Nothing is changed.

    Each file is read and compared with the hash in its name, so a single flipped bit shows; rows must lie in the hour
    of their file, sorted, no record twice; files that do not belong there are named; facts and the counts of door
    counters must be undamaged. Exit code 1 when something needs you.

    \b
    Example:
      vsd verify
      vsd verify --range 2026-W46 --no-facts
    """
    from vsd_analytics.warehouse.verify_facts import verify as verify_store

    first, last = _hours(project, days) if days is not None else (None, None)
    is_quiet = project.quiet or as_json
    with progress(None, total=None, label="verifying", unit="B", quiet=is_quiet) as bar:
        verification = verify_store(
            project.site, first_hour=first, last_hour=last, with_facts=with_facts, on_bytes=bar.update
        )
    if as_json:
        emit_json(_as_dict(project, verification))
    else:
        _print(project, verification)
    return 0 if verification.is_whole else 1


def _hours(project: Project, days: str) -> tuple[int, int]:
    """Return first and last UTC hour number of a range of local days."""
    from datetime import datetime, time, timedelta

    first, last = parse_range(days)
    start, end = (
        datetime.combine(day, time(), tzinfo=project.site.zone).timestamp() for day in (first, last + timedelta(days=1))
    )
    return int(start // 3600), int((end - 1) // 3600)


def _print(project: Project, verification: Verification) -> None:
    for check in verification.checks:
        word = "wrong" if check.name == CONFIG else "damaged"
        state = f"{len(check.damages):,} {word}" if check.damages else "ok"
        click.echo(f"{state:12} {check.name:10} {check.n:>12,} {check.things}: {check.promise}")
    if verification.n_fresh is not None:
        stale = (
            f", {verification.n_stale:,} stale, {verification.n_missing:,} not computed"
            if verification.n_stale or verification.n_missing
            else ""
        )
        click.echo(
            f"{'note' if stale else 'ok':12} {'build':10} {verification.n_fresh:>12,} hours have fresh facts{stale}"
        )
    alike: dict[tuple[str, str], list[StoreFault]] = {}
    for finding in verification.notes:
        alike.setdefault((finding.code, finding.what), []).append(finding)
    for first, *others in alike.values():
        click.echo(render_error(_error(project, first), word="note"), err=True)
        if others:
            click.echo(f"  and {len(others):,} more files like it: vsd verify --json names each", err=True)
    for finding in verification.damages:
        word = "damaged" if finding.path.name != CONFIG else "error"  # the store is whole, and vsd.toml does not fit
        click.echo(render_error(_error(project, finding), word=word), err=True)
    n = len(verification.damages)
    click.echo("the store is whole" if not n else f"{n:,} {'thing needs' if n == 1 else 'things need'} you")


def _error(project: Project, finding: StoreFault) -> VsdError:
    place = finding.path.relative_to(project.root) if finding.path.is_relative_to(project.root) else finding.path
    return VsdError(finding.what, code=finding.code, where=Where(str(place)), why=finding.why, fix=finding.fix)


def _as_dict(project: Project, verification: Verification) -> dict[str, Any]:
    return {
        "ok": verification.is_whole,
        "checks": [
            {"name": c.name, "n": c.n, "things": c.things, "promise": c.promise, "damaged": len(c.damages)}
            for c in verification.checks
        ],
        "findings": [
            {
                "check": c.name,
                "is_note": f.is_note,
                "code": f.code,
                "path": str(_error(project, f).where.file),  # type: ignore[union-attr]
                "message": f.what,
                "why": f.why,
                "fix": f.fix,
                "mend": f.fix,
            }
            for c in verification.checks
            for f in c.findings
        ],
        "facts": {"fresh": verification.n_fresh, "stale": verification.n_stale, "missing": verification.n_missing},
    }
