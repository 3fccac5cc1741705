"""How long people wait in a queue, and how many leave before its end, from tracks that may be cut.

Whoever enters a queue is served or leaves: two competing ends. Somebody who left would never have been served later, so
leavers are no censored observations, as they would be for the Kaplan-Meier estimator. Tracks that are lost inside are.
The Aalen-Johansen estimator gives the share served, and the share who left, within each time. Waits of one day resemble
each other, so intervals come from leaving out one day at a time.

Sources: Aalen and Johansen, Scand. J. Stat. 5 (1978); competing risks: Putter, Fiocco and Geskus, Stat. Med. 26 (2007);
jackknife over clusters: Lipsitz, Dear and Zhao, Biometrics 50 (1994); abandonment of queues: Mandelbaum and Zeltyn, in
Advances in Services Innovations (2007).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason, State
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.durations import QuantileEstimate
from vsd_analytics.stats.dwell import MAX_UNSEEN_END, MIN_FOLLOWED, MIN_VISITS
from vsd_analytics.stats.groups import ShareEstimate
from vsd_analytics.stats.quantiles import t_quantile, zero_events_limit

CUT: Final = 0
SERVED: Final = 1
LEFT: Final = 2
MIN_SERVED: Final = 10
"""Waiting times of fewer people are those of single persons."""

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class WaitTimes:
    """Waiting times of a queue.

    Attributes:
        median, p90: Quantiles of the time until service of those who are served. A quantile without value lies beyond
            what was followed; without upper limit, that limit does.
        left_share: Share of those who enter that leave before the end; `n` is not known, 0.
        n_entered: Entries that were seen.
        n_served, n_left, n_cut: How they were seen to end; a cut track ends inside.
        n_days: Days with any.
        state, reason: "ok" when there are values and intervals.
    """

    median: QuantileEstimate
    p90: QuantileEstimate
    left_share: ShareEstimate
    n_entered: int
    n_served: int
    n_left: int
    n_cut: int
    n_days: int
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class CumulativeIncidence:
    """Shares of those who entered that ended in each way, by time since the entry.

    Attributes:
        time_s: Times at which anybody's wait ends or is cut, rising, shape (n_times,).
        served, left: Share served, and share who left, up to each time, shape (..., n_times).
        waiting: Share still waiting, same shape; the three sum to 1.
    """

    time_s: Array
    served: Array
    left: Array
    waiting: Array


def cumulative_incidence(wait_s: npt.ArrayLike, outcome: npt.ArrayLike, weight: npt.ArrayLike) -> CumulativeIncidence:
    """Return the Aalen-Johansen estimate: F_k(t) = sum over u <= t of S(u-) d_k(u) / y(u), k = served, left.

    d_k(u) ended in way k at u, y(u) were followed until then, S is the product of 1 - (d_served + d_left) / y.

    Args:
        wait_s: Seconds from the entry to the end of the wait, or to where the track was cut, shape (n,).
        outcome: `SERVED`, `LEFT` or `CUT`, same shape.
        weight: How often each counts, shape (..., n): one estimate for each row.
    """
    seconds, ends, weights = np.asarray(wait_s, np.float64), np.asarray(outcome), np.asarray(weight, np.float64)
    time_s, at = np.unique(seconds, return_inverse=True)
    order = np.argsort(at, kind="stable")
    starts = np.searchsorted(at[order], np.arange(len(time_s)))

    def summed(which: npt.NDArray[np.bool_]) -> Array:
        return np.asarray(np.add.reduceat((weights * which)[..., order], starts, axis=-1))

    every = summed(np.ones(len(seconds), dtype=np.bool_))
    followed: Array = every[..., ::-1].cumsum(axis=-1)[..., ::-1]

    def hazard(way: int) -> Array:
        return _per(summed(ends == way), followed)

    of_served, of_left = hazard(SERVED), hazard(LEFT)
    waiting: Array = np.cumprod(np.maximum(1 - of_served - of_left, 0.0), axis=-1).astype(np.float64)
    before = np.concatenate([np.ones_like(waiting[..., :1]), waiting[..., :-1]], axis=-1)
    return CumulativeIncidence(
        time_s, (before * of_served).cumsum(axis=-1), (before * of_left).cumsum(axis=-1), waiting
    )


def waiting(
    wait_s: npt.ArrayLike,
    outcome: npt.ArrayLike,
    day: npt.ArrayLike,
    *,
    weight: npt.ArrayLike | None = None,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
) -> WaitTimes:
    """Return waiting times of those served, and the share who leave before the end.

    With F of `cumulative_incidence` as far as enough people are followed, and U still waiting there: those are served
    or leave in proportion to the others. So the share who leave is F_left / (F_served + F_left), and a quantile q is
    the first time at which F_served reaches q of its end. Limits: logit +- t_{D-1} sqrt((D-1)/D sum_d (logit_(-d) -
    mean)^2), each day left out in turn; the lower one as if none of U left (or was served later), the upper one as if
    all of U did.

    Args:
        wait_s: Seconds from the entry to the end of the wait, or to where the track was cut, shape (n,).
        outcome: `SERVED`, `LEFT` or `CUT`, same shape.
        day: Day of the entry, any integers, same shape.
        weight: For how many entries each one counts, those of hours that were not recorded included
            (`vsd_analytics.stats.recorded_hours`), same shape; None = 1.
        confidence: Confidence level.
        min_days: Days with entries that an interval needs.

    Raises:
        ValueError: Shapes do not fit, a time or a weight is negative, or an outcome is unknown.
    """
    seconds, ends, days = np.asarray(wait_s, np.float64), np.asarray(outcome, np.int64), np.asarray(day, np.int64)
    stands_for = np.ones(len(seconds)) if weight is None else np.asarray(weight, np.float64)
    if not seconds.shape == ends.shape == days.shape == stands_for.shape or seconds.ndim != 1:
        raise ValueError("every wait needs a time, an outcome and a day, and a weight if any has one")
    if len(seconds) and stands_for.min() < 0:
        raise ValueError("a weight is at least 0")
    if len(seconds) and (seconds.min() < 0 or not np.isin(ends, (CUT, SERVED, LEFT)).all()):
        raise ValueError("a wait is at least 0, and it is served, left or cut")
    n_of = {way: int((ends == way).sum()) for way in (SERVED, LEFT, CUT)}
    n, of_day = len(seconds), np.unique(days)
    n_days = len(of_day)
    few: Reason | None = None
    if n < MIN_VISITS:
        few = Reason("waits.few", least=MIN_VISITS, has=n)
    elif n_of[SERVED] < MIN_SERVED:
        few = Reason("waits.few_served", least=MIN_SERVED, has=n_of[SERVED])
    curve, last = (None, -1) if few else _followed(seconds, ends, days, of_day, stands_for)
    if curve is not None and float(curve.waiting[0, last]) > MAX_UNSEEN_END:
        few = Reason("waits.long_unseen", share=float(curve.waiting[0, last]))
    if few is not None or curve is None:
        none = QuantileEstimate(0.5, None, None, None), QuantileEstimate(0.9, None, None, None)
        unknown = ShareEstimate(None, None, None, 0, n, n_days, "not_enough_data", few)
        return WaitTimes(*none, unknown, n, n_of[SERVED], n_of[LEFT], n_of[CUT], n_days, "not_enough_data", few)
    short = Reason("waits.days", least=min_days, has=n_days) if n_days < min_days else None
    half = math.inf if short else t_quantile(n_days - 1, confidence=confidence)
    median, p90 = (_quantile(curve, last, q, half, n=n_of[SERVED]) for q in (0.5, 0.9))
    share = _left_share(curve, last, half, n=n, n_days=n_days, confidence=confidence, reason=short)
    state: State = "ok" if short is None else "not_enough_data"
    return WaitTimes(median, p90, share, n, n_of[SERVED], n_of[LEFT], n_of[CUT], n_days, state, short)


def _followed(
    seconds: Array, ends: Ints, days: Ints, of_day: Ints, stands_for: Array
) -> tuple[CumulativeIncidence, int]:
    """Return the curves of all days and without each day, shape (1 + n_days, n_times), and where they end.

    They end as in `vsd_analytics.stats.dwell`: where few are followed, and some of these are cut.
    """
    weight = stands_for * np.concatenate([np.ones((1, len(days))), days[None, :] != of_day[:, None]])
    curve = cumulative_incidence(seconds, ends, weight)
    followed = len(seconds) - np.searchsorted(np.sort(seconds), curve.time_s)
    cut = np.sort(seconds[ends == CUT])
    n_cut_later = len(cut) - np.searchsorted(cut, curve.time_s)
    is_known = np.logical_and.accumulate((followed >= MIN_FOLLOWED) | (n_cut_later == 0))
    return curve, int(is_known.sum()) - 1


def _left_share(
    curve: CumulativeIncidence,
    last: int,
    half: float,
    *,
    n: int,
    n_days: int,
    confidence: float,
    reason: Reason | None,
) -> ShareEstimate:
    served, left, rest = (float(v[0, last]) for v in (curve.served, curve.left, curve.waiting))
    value = left / (served + left)
    if math.isinf(half):
        return ShareEstimate(value, None, None, 0, n, n_days, "not_enough_data", reason)
    least = zero_events_limit(confidence=confidence) / n
    lo = 0.0 if left == 0 else float(_limits(curve.left[:, last, None], half, n=n)[0][0])
    hi = min(1.0, rest + least)
    if left > 0:
        hi = float(_limits((curve.left + curve.waiting)[:, last, None], half, n=n)[1][0])
    return ShareEstimate(value, lo, hi, 0, n, n_days, "ok", None)


def _quantile(curve: CumulativeIncidence, last: int, q: float, half: float, *, n: int) -> QuantileEstimate:
    served, ended = curve.served[:, : last + 1], curve.served[:, last] + curve.left[:, last]
    share = _per(served, _per(curve.served[:, last], ended)[:, None])

    def first(reached: Array) -> float | None:
        at = np.flatnonzero(reached >= q - 1e-12)
        return float(curve.time_s[at[0]]) if len(at) else None

    value = first(share[0])
    if value is None or math.isinf(half):
        return QuantileEstimate(q, value, None, None)
    low, _ = _limits(_per(served, (curve.served + curve.waiting)[:, last, None]), half, n=n)
    _, high = _limits(_per(served, curve.served[:, last, None]), half, n=n)
    return QuantileEstimate(q, value, first(high), first(low))


def _per(part: Array, whole: Array) -> Array:
    """Return part / whole, 0 where the whole is 0."""
    shape = np.broadcast_shapes(part.shape, whole.shape)
    return np.asarray(np.divide(part, whole, out=np.zeros(shape), where=whole > 0), dtype=np.float64)


def _limits(share: Array, half: float, *, n: int) -> tuple[Array, Array]:
    """Return limits of shares, shape (n_times,), given those of all days and without each, (1 + n_days, n_times)."""
    inside = np.clip(share, 0.5 / n, 1 - 0.5 / n)
    logit = np.log(inside / (1 - inside))
    without = logit[1:]
    n_days = len(without)
    wide = half * np.sqrt((n_days - 1) / n_days * ((without - without.mean(axis=0)) ** 2).sum(axis=0))
    low, high = (1 / (1 + np.exp(-(logit[0] + sign * wide))) for sign in (-1, 1))
    is_end = (share[0] <= 0, share[0] >= 1)
    return np.where(is_end[0], 0.0, np.where(is_end[1], 1.0, low)), np.where(
        is_end[1], 1.0, np.where(is_end[0], 0.0, high)
    )
