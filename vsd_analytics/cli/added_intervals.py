"""What became of a file of intervals, printed: of `vsd context add` and `vsd counts add`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import click

from vsd_analytics.cli.output import count, emit_json, plain

if TYPE_CHECKING:
    from vsd_analytics.config.interval_rows import AddedIntervals

_SHOWN: Final = 10


def print_added(
    name: str, added: AddedIntervals, *, described: Mapping[str, Any], as_json: bool, is_believed: bool = False
) -> int:
    """Print how many intervals were added, what looks wrong, and the first lines that were not added.

    Returns the exit code: 1 with such lines, or with a warning of what nobody said is right.

    Args:
        name: What they were added to.
        added: What became of the file.
        described: What the JSON object says of the series beside it.
        as_json: Print a JSON object with all lines that were not added.
        is_believed: The user said that what looks wrong is right.
    """
    if as_json:
        refused = [{"line": row.line, "why": row.why, "fix": row.fix} for row in added.refused]
        numbers = {"n_new": added.n_new, "n_known": added.n_known, "n_replaced": added.n_replaced}
        warned = [{"code": "W232", "what": w.what, "why": w.why, "fix": w.fix} for w in added.warnings]
        emit_json({**described, **numbers, "refused": refused, "warnings": warned})
        return 1 if added.refused or (added.warnings and not is_believed) else 0
    known = f", {added.n_known:,} were there already" if added.n_known else ""
    replaced = f", {added.n_replaced:,} of them replaced" if added.n_replaced else ""
    click.echo(f"{name}: {count(added.n_new, 'interval')} added{replaced}{known}")
    for warning in added.warnings:
        text = f"warning[W232]: {warning.what}\n  why: {warning.why}\n  fix: {warning.fix}\n more: vsd explain W232"
        click.echo(plain(text), err=True)
    for row in added.refused[:_SHOWN]:
        click.echo(plain(f"line {row.line} not added: {row.why} (fix: {row.fix})"), err=True)
    if len(added.refused) > _SHOWN:
        click.echo(f"{len(added.refused) - _SHOWN:,} more lines not added: --json lists all", err=True)
    return 1 if added.refused or (added.warnings and not is_believed) else 0
