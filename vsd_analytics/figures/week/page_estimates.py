"""Answers of the analysis room as estimates of the report, without what is too small to print."""

from __future__ import annotations

from vsd_analytics.answer import State
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.stats.before_after import BeforeAfter
from vsd_analytics.stats.estimates import ChangeEstimate, RateEstimate
from vsd_analytics.stats.net_effect import NetEffect
from vsd_analytics.stats.running_verdict import RunningVerdict


def level(rate: RateEstimate | None, *, mask: Mask) -> Estimate | None:
    """Return a rate as an estimate; None for none. A small count takes the rate with it.

    Args:
        rate: A rate of the analysis room.
        mask: Tells which counts are small.
    """
    if rate is None:
        return None
    if mask.hides(rate.n_events):
        return Estimate(value=None, state="not_enough_data", reason=mask.why)
    if rate.value is None:
        return Estimate(value=None, state=_missing(rate.state), reason=rate.reason)
    return Estimate(value=rate.value, lo=rate.lo, hi=rate.hi, reason=rate.reason if rate.lo is None else None)


def change(ratio: ChangeEstimate | BeforeAfter | RunningVerdict | NetEffect) -> Estimate:
    """Return a ratio as an estimate that has a change and no level; only the running one has a verdict."""
    verdict = ratio.verdict if isinstance(ratio, RunningVerdict) else None
    if ratio.value is None:
        return Estimate(value=None, verdict=verdict, state=_missing(ratio.state), reason=ratio.reason)
    return Estimate(
        value=None,
        change=ratio.value - 1,
        change_lo=None if ratio.lo is None else ratio.lo - 1,
        change_hi=None if ratio.hi is None else ratio.hi - 1,
        verdict=verdict,
        reason=ratio.reason if ratio.lo is None else None,
    )


def _missing(state: State) -> State:
    return state if state != "ok" else "not_enough_data"
