"""How long visits of an area last, from tracks that may be cut, and Little's law as a check that needs no track ids.

A visit counts from where its entry was seen. One whose track ends inside the area is censored: the person stayed at
least that long. The Kaplan-Meier estimator uses both kinds. A track that begins inside adds nothing to it: nobody knows
how long the person had been there. Visits of one day resemble each other, so days are the clusters of every interval.

Sources: Kaplan and Meier, J. Am. Stat. Assoc. 53 (1958); variance of clustered survival times: Ying and Wei, J.
Multivar. Anal. 50 (1994); limits of a quantile: Brookmeyer and Crowley, Biometrics 38 (1982); Little, Operations
Research 9 (1961).
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
from vsd_analytics.stats.groups import ShareEstimate
from vsd_analytics.stats.quantiles import t_quantile

MIN_VISITS: Final = 30
"""Fewer visits have no dwell time, as violations have no durations."""
MIN_FOLLOWED: Final = 10
"""The curve ends where fewer visits are still followed and some of these are cut: its last steps would be those of
single persons."""
MAX_UNSEEN_END: Final = 0.25
"""Share of visits that may outlast the curve before their mean is unknown."""
LITTLE_TOLERANCE: Final = 0.15
"""Two mean dwell times closer than this agree, however narrow their intervals are: views and borders of an area are
not known better."""

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class MeanDwell:
    """A mean dwell time with its interval from how days differ.

    Attributes:
        value: Seconds; None when unknown.
        lo, hi: Limits of its interval; None without one.
        reason: Why there is no value or no interval.
    """

    value: float | None
    lo: float | None
    hi: float | None
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class LittleCheck:
    """The mean dwell of tracks beside the one by Little's law, person-time / entries.

    Attributes:
        by_tracks: Area below the Kaplan-Meier curve. Visits that outlast it are assumed to end at the rate of those
            that lasted longer than the median; its interval reaches from none to twice of that rest.
        by_little: Person-seconds in the area / entries that were seen.
        value: by_little / by_tracks; None where either is unknown.
        lo, hi: Limits of its interval, for the same range of that rest; None without one.
        agrees: False where the interval leaves 1 out and the ratio is off by more than `LITTLE_TOLERANCE`; None
            without an interval.
    """

    by_tracks: MeanDwell
    by_little: MeanDwell
    value: float | None
    lo: float | None
    hi: float | None
    agrees: bool | None


@dataclass(frozen=True, slots=True)
class Dwell:
    """How long visits of an area last.

    Attributes:
        median, p90: Quantiles of the dwell time. A quantile without value lies beyond what was followed; without upper
            limit, that limit does.
        long_share: Share of visits that last longer than a limit, by the Kaplan-Meier curve; `n` is not known, 0.
        n_visits: Visits whose entry was seen.
        n_cut: Those whose track ends inside the area.
        n_days: Days with any.
        little: The check.
        state, reason: "ok" when there are values and intervals.
    """

    median: QuantileEstimate
    p90: QuantileEstimate
    long_share: ShareEstimate
    n_visits: int
    n_cut: int
    n_days: int
    little: LittleCheck
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class _Curve:
    """A Kaplan-Meier curve at the times at which visits end.

    Attributes:
        time_s: These times, rising, shape (n_times,).
        share: Share of visits that last longer, same shape.
        log_se: Standard error of ln share, days as clusters, same shape.
        last_s: Longest time that enough visits were followed.
    """

    time_s: Array
    share: Array
    log_se: Array
    last_s: float


def dwell(
    dwell_s: npt.ArrayLike,
    is_cut: npt.ArrayLike,
    day: npt.ArrayLike,
    *,
    person_s: npt.ArrayLike,
    long_s: float,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
) -> Dwell:
    """Return dwell times of an area: quantiles, share of long visits, and the check by Little's law.

    S(t) = product over u <= t of (1 - d_u / y_u): d_u visits end at u, y_u were followed until then. The variance of
    ln S(t) is D/(D-1) sum over days of (sum of its visits' psi)^2, with psi_i(t) = sum over u <= min(t, t_i) of d_u /
    (y_u (y_u - d_u)), minus 1 / (y_{t_i} - d_{t_i}) where visit i ends at t_i <= t. Limits of S on the scale
    ln(-ln S), of a quantile where these reach 1 - q; t quantile of D - 1 degrees of freedom. Means and their ratio:
    jackknife over days.

    Args:
        dwell_s: Time from the entry to the exit, or to the end of the track inside, seconds, shape (n,).
        is_cut: The track ends inside the area, same shape.
        day: Day of the entry, 0 to n_days - 1, same shape.
        person_s: Person-seconds in the area by day, everybody counted once, shape (n_days,).
        long_s: Dwell time from which a visit is long.
        confidence: Confidence level.
        min_days: Days with visits that an interval needs.

    Raises:
        ValueError: Shapes do not fit, or a time is negative.
    """
    seconds, cut = np.asarray(dwell_s, dtype=np.float64), np.asarray(is_cut, dtype=np.bool_)
    of_day, present_s = np.asarray(day, dtype=np.int64), np.asarray(person_s, dtype=np.float64)
    if not seconds.shape == cut.shape == of_day.shape or seconds.ndim != 1 or present_s.ndim != 1:
        raise ValueError("every visit needs a dwell time, whether it was cut, and a day")
    if len(seconds) and (seconds.min() < 0 or of_day.min() < 0 or of_day.max() >= len(present_s)):
        raise ValueError("a dwell time is at least 0, and a day has its person-time")
    n, n_cut, n_days = len(seconds), int(cut.sum()), len(np.unique(of_day))
    few: Reason | None = None
    if n < MIN_VISITS:
        few = Reason("visits.few", least=MIN_VISITS, has=n)
    elif n == n_cut:
        few = Reason("visits.all_cut", n=n)
    if few is not None:
        none = QuantileEstimate(0.5, None, None, None)
        unknown = ShareEstimate(None, None, None, 0, n, n_days, "not_enough_data", few)
        nothing = MeanDwell(None, None, None, few)
        check = LittleCheck(nothing, nothing, None, None, None, None)
        return Dwell(
            none, QuantileEstimate(0.9, None, None, None), unknown, n, n_cut, n_days, check, "not_enough_data", few
        )
    curve = _kaplan_meier(seconds, cut, of_day, n_days=n_days)
    short = Reason("visits.days", least=min_days, has=n_days) if n_days < min_days else None
    half = math.inf if short else t_quantile(n_days - 1, confidence=confidence)
    return Dwell(
        _quantile(curve, 0.5, half),
        _quantile(curve, 0.9, half),
        _share_over(curve, long_s, half, n=n, n_days=n_days, reason=short),
        n,
        n_cut,
        n_days,
        _little(seconds, cut, of_day, present_s, half, reason=short),
        "ok" if short is None else "not_enough_data",
        short,
    )


def _kaplan_meier(seconds: Array, cut: npt.NDArray[np.bool_], day: npt.NDArray[np.int64], *, n_days: int) -> _Curve:
    time_s, at = np.unique(seconds, return_inverse=True)
    n_times = len(time_s)
    ended = np.bincount(at, weights=~cut, minlength=n_times)
    followed = np.bincount(at, minlength=n_times)[::-1].cumsum()[::-1].astype(np.float64)
    share = np.cumprod(1 - ended / followed).astype(np.float64)
    _, code = np.unique(day, return_inverse=True)
    # psi summed by day: visits followed until u add d_u / (y_u (y_u - d_u)) there, and one that ends at u takes
    # 1 / (y_u - d_u) away; both are the derivative of ln(1 - d_u / y_u)
    after = np.maximum(followed - ended, 1.0)
    counts, ends = np.zeros((n_days, n_times)), np.zeros((n_days, n_times))
    np.add.at(counts, (code, at), 1.0)
    np.add.at(ends, (code, at), (~cut).astype(np.float64))
    psi = (counts[:, ::-1].cumsum(axis=1)[:, ::-1] * (ended / followed / after) - ends / after).cumsum(axis=1)
    log_se: Array = np.sqrt(n_days / max(n_days - 1, 1) * (psi**2).sum(axis=0))
    n_cut_later = np.bincount(at, weights=cut, minlength=n_times)[::-1].cumsum()[::-1]
    is_known = is_followed_enough(followed, n_cut_later)
    is_end = (ended > 0) & is_known
    return _Curve(time_s[is_end], share[is_end], log_se[is_end], float(time_s[is_known][-1]))


def is_followed_enough(followed: Array, n_cut_later: Array) -> npt.NDArray[np.bool_]:
    """Return where the curve goes on: enough visits are followed, or none of those that are is cut."""
    is_sure = (followed >= min(MIN_FOLLOWED, float(followed[0]))) | (n_cut_later == 0)
    return np.logical_and.accumulate(is_sure)


def _limits(share: Array, log_se: Array, half: float) -> tuple[Array, Array]:
    """Return the limits of S: exp(-exp(ln(-ln S) -+ half log_se / -ln S)); those of 0 are 0 and of 1 are 1."""
    inside = (share > 0) & (share < 1)
    depth = -np.log(np.where(inside, share, 0.5))
    wide = half * np.where(inside, log_se, 0.0) / depth
    low, high = (np.where(inside, np.exp(-depth * np.exp(sign * np.minimum(wide, 700))), share) for sign in (1, -1))
    return low, high


def _quantile(curve: _Curve, q: float, half: float) -> QuantileEstimate:
    def first(share: Array) -> float | None:
        reached = np.flatnonzero(share <= 1 - q + 1e-12)
        return float(curve.time_s[reached[0]]) if len(reached) else None

    value = first(curve.share)
    if value is None or math.isinf(half):
        return QuantileEstimate(q, value, None, None)
    low, high = _limits(curve.share, curve.log_se, half)
    return QuantileEstimate(q, value, first(low), first(high))


def _share_over(
    curve: _Curve, limit_s: float, half: float, *, n: int, n_days: int, reason: Reason | None
) -> ShareEstimate:
    """Return the share of visits that last longer than a limit."""

    def estimate(value: float | None, lo: float | None, hi: float | None, why: Reason | None) -> ShareEstimate:
        return ShareEstimate(value, lo, hi, 0, n, n_days, "ok" if why is None else "not_enough_data", why)

    if limit_s > curve.last_s:
        return estimate(None, None, None, Reason("visits.not_followed", seconds=curve.last_s))
    k = int(np.searchsorted(curve.time_s, limit_s, side="right")) - 1
    if k < 0:
        return estimate(1.0, None, None, reason)
    value = float(curve.share[k])
    if reason is not None or math.isinf(half):
        return estimate(value, None, None, reason)
    low, high = _limits(curve.share[k : k + 1], curve.log_se[k : k + 1], half)
    return estimate(value, float(low[0]), float(high[0]), None)


@dataclass(frozen=True, slots=True)
class _Mean:
    """A mean dwell time in two parts.

    Attributes:
        seen_s: Area below the curve as far as it goes.
        rest_s: What visits that outlast it add, if they end at the rate of those longer than the median.
        unseen: Share of visits that outlast it.
    """

    seen_s: float
    rest_s: float
    unseen: float

    @property
    def value_s(self) -> float:
        return self.seen_s + self.rest_s


def _mean_below_curve(seconds: Array, cut: npt.NDArray[np.bool_], weight: Array) -> _Mean:
    """Return the mean dwell time by the Kaplan-Meier curve.

    Args:
        seconds: Times, rising, shape (n,); of equal times, ends first.
        cut: Censored, same shape.
        weight: 1 for visits that are used, 0 for others, same shape.
    """
    followed = weight[::-1].cumsum()[::-1]
    used = is_followed_enough(followed, (weight * cut)[::-1].cumsum()[::-1]) & (followed > 0)
    ended = weight * ~cut
    hazard = np.divide(ended, followed, out=np.zeros_like(weight), where=used)
    share = np.concatenate(([1.0], np.cumprod(1 - hazard)))
    steps = np.diff(np.concatenate(([0.0], seconds)))
    late = used & (share[:-1] <= 0.5)  # noqa: PLR2004, the median
    rate = ended[late].sum() / max(float((followed * steps)[late].sum()), 1e-9)
    unseen = float(share[-1])
    rest_s = unseen / float(rate) if rate else math.inf if unseen else 0.0
    return _Mean(float((share[:-1] * steps)[used].sum()), rest_s, unseen)


def _little(
    seconds: Array,
    cut: npt.NDArray[np.bool_],
    day: npt.NDArray[np.int64],
    person_s: Array,
    half: float,
    *,
    reason: Reason | None,
) -> LittleCheck:
    order = np.lexsort((cut, seconds))
    seconds, cut, day = seconds[order], cut[order], day[order]
    n_visits = np.bincount(day, minlength=len(person_s)).astype(np.float64)
    used = np.flatnonzero((n_visits > 0) | (person_s > 0))
    mean = _mean_below_curve(seconds, cut, np.ones_like(seconds))
    little = float(person_s.sum() / n_visits.sum())
    if mean.unseen > MAX_UNSEEN_END or not math.isfinite(mean.rest_s):
        lost = MeanDwell(None, None, None, Reason("visits.long_unseen", share=mean.unseen))
        return LittleCheck(lost, MeanDwell(little, None, None, reason), None, None, None, None)
    if math.isinf(half) or mean.seen_s <= 0 or little <= 0:
        by_tracks, by_little = (MeanDwell(value, None, None, reason) for value in (mean.value_s, little))
        return LittleCheck(by_tracks, by_little, little / mean.value_s if mean.value_s > 0 else None, None, None, None)
    logs = np.log(
        [
            (
                _mean_below_curve(seconds, cut, (day != d).astype(np.float64)).value_s,
                np.delete(person_s, d).sum() / np.delete(n_visits, d).sum(),
            )
            for d in used.tolist()
        ]
    )
    logs = np.column_stack([logs, logs[:, 1] - logs[:, 0]])
    n = len(used)
    wide = half * np.sqrt((n - 1) / n * ((logs - logs.mean(axis=0)) ** 2).sum(axis=0))
    of_tracks, of_little, of_ratio = np.exp(wide).tolist()
    ratio, longest_s = little / mean.value_s, mean.seen_s + 2 * mean.rest_s
    lo, hi = little / longest_s / of_ratio, little / mean.seen_s * of_ratio
    return LittleCheck(
        MeanDwell(mean.value_s, mean.seen_s / of_tracks, longest_s * of_tracks, None),
        MeanDwell(little, little / of_little, little * of_little, None),
        ratio,
        lo,
        hi,
        lo <= 1 <= hi or abs(ratio - 1) <= LITTLE_TOLERANCE,
    )
