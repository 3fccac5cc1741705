"""Estimates as commands print them: a number with its limits, or why there is none."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from vsd_analytics.answer import Reason, State


def with_limits(
    value: float | None, lo: float | None, hi: float | None, shown: Callable[[float], str], *, missing: str = "–"
) -> str:
    """Return a number as `shown` writes it, with its limits where it has both: 12 (8 to 17); or `missing`."""
    if value is None:
        return missing
    return shown(value) if lo is None or hi is None else f"{shown(value)} ({shown(lo)} to {shown(hi)})"


def why_none(state: State, reason: Reason | None) -> str:
    """Return in words that a figure has no result, and why."""
    return f"{'not enough data' if state == 'not_enough_data' else 'not measurable'}: {reason_text(reason)}"
