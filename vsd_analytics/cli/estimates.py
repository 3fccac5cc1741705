"""Estimates as commands print them: a number with its limits as text and as JSON, or why there is none."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from vsd_analytics.wording.reasons import reason_text

if TYPE_CHECKING:
    from vsd_analytics.answer import Reason, State
    from vsd_analytics.stats.estimates import RateEstimate
    from vsd_analytics.stats.groups import ShareEstimate
    from vsd_analytics.stats.track_links import LinkedShare


def with_limits(
    value: float | None, lo: float | None, hi: float | None, shown: Callable[[float], str], *, missing: str = "–"
) -> str:
    """Return a number as `shown` writes it, with its limits where it has both: 12 (8 to 17); or `missing`."""
    if value is None:
        return missing
    return shown(value) if lo is None or hi is None else f"{shown(value)} ({shown(lo)} to {shown(hi)})"


def share_text(of: ShareEstimate | LinkedShare, *, missing: str = "–") -> str:
    """Return a share in whole percent with its limits, or `missing`."""
    return with_limits(of.value, of.lo, of.hi, "{:.0%}".format, missing=missing)


def rate_text(of: RateEstimate, digits: int = 3) -> str:
    """Return a rate with its limits, or why there is none."""
    return with_limits(of.value, of.lo, of.hi, f"{{:.{digits}g}}".format, missing=reason_text(of.reason))


def rate_dict(of: RateEstimate) -> dict[str, Any]:
    """Return a rate as the JSON output has it."""
    return {"value": of.value, "lo": of.lo, "hi": of.hi, "state": of.state, "reason": of.reason}


def share_dict(of: ShareEstimate | LinkedShare) -> dict[str, Any]:
    """Return a share as the JSON output has it."""
    return {"value": of.value, "lo": of.lo, "hi": of.hi, "reason": of.reason}


def why_none(state: State, reason: Reason | None) -> str:
    """Return in words that a figure has no result, and why."""
    return f"{'not enough data' if state == 'not_enough_data' else 'not measurable'}: {reason_text(reason)}"
