"""Which area people enter next, from tracks that are lost on the way, and a check that needs no such links.

Areas are competing risks: of those who leave an area, each enters one of them next, or is lost before. Who is lost was
on the way for at least that long. The Aalen-Johansen estimator uses both kinds; shares of the followed alone would
favour what is near, since fewer are lost on a short way. The same holds for routes from door to door. People of one day
resemble each other, so days are the clusters of every interval.

Sources: Aalen and Johansen, Scand. J. Stat. 5 (1978); deleting one cluster at a time: Lipsitz, Dear and Zhao,
Biometrics 50 (1994); bounds by what was not followed: Manski, Am. Econ. Rev. 80 (1990).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.dwell import is_followed_enough
from vsd_analytics.stats.groups import SMALL_COUNT, ShareEstimate, logit_limits, share_by_days
from vsd_analytics.stats.quantiles import t_quantile, zero_events_limit

MIN_LEAVING: Final = 30
"""Fewer people who leave an area have no shares, as visits have no dwell time."""
MAX_UNSEEN_END: Final = 0.25
"""Share of people who may be on the way for longer than anybody was followed before their shares are unknown."""
FLOW_TOLERANCE: Final = 0.15
"""Two counts of those who come in closer than this agree, however narrow their intervals are, as by Little's law."""

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class NextAreas:
    """Where people of one place go next.

    Attributes:
        shares: Share of each kind of end; the interval also holds the case that all who outlast the curve go there,
            and that none does. `n` is how many were followed there.
        not_followed: Share of people whose track is lost on the way.
        unseen: Share that is on the way for longer than anybody was followed; None where nothing is known.
        reached: Share of all that reach each kind while they are followed, shape (n_kinds,).
        n: People who left.
        n_days: Days with any.
        reason: Why there are no shares, or no intervals.
    """

    shares: tuple[ShareEstimate, ...]
    not_followed: ShareEstimate
    unseen: float | None
    reached: Array
    n: int
    n_days: int
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class InflowCheck:
    """People who come into an area, counted there, beside those that the flows bring.

    Attributes:
        n_arrived: People seen to come in, whatever is known of where they came from.
        expected: People who leave any area times the share of them who go there.
        value: n_arrived / expected; None where either is 0.
        lo, hi: Limits of its interval, which also holds what the flows do not know; None without one.
        agrees: False where the interval leaves 1 out and the ratio is off by more than `FLOW_TOLERANCE`; None without
            an interval.
    """

    n_arrived: int
    expected: float
    value: float | None
    lo: float | None
    hi: float | None
    agrees: bool | None


@dataclass(frozen=True, slots=True, eq=False)
class Leaving:
    """People who leave one area.

    Attributes:
        seconds: From leaving to the next area, or to the end of the track, shape (n,).
        kind: Which area they enter, 0 to n_kinds - 1; -1 where the track is lost. Same shape.
        day: Day on which they leave, 0 to n_days - 1, same shape.
    """

    seconds: Array
    kind: npt.NDArray[np.int64]
    day: npt.NDArray[np.int64]

    def __post_init__(self) -> None:
        if not self.seconds.shape == self.kind.shape == self.day.shape or self.seconds.ndim != 1:
            raise ValueError("everybody who leaves needs a time, an end, and a day")
        if len(self.seconds) and (self.seconds.min() < 0 or self.day.min() < 0):
            raise ValueError("times and days are at least 0")


def next_areas(
    leaving: Leaving,
    *,
    n_kinds: int,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
) -> NextAreas:
    """Return the share of those who leave whose next area is each one.

    F_k = sum over times u of S(u-) d_ku / y_u: d_ku people enter area k after u, y_u were still followed, S is the
    Kaplan-Meier curve of all areas together. It ends where fewer than ten are followed, at S = U. These are assumed to
    go where as many went who arrived last. The limits do not need that: they are the lower one of F_k and
    the upper one of F_k + U, on the logit scale, with the variance of deleting one day at a time and the t quantile of
    D - 1 degrees of freedom.

    Args:
        leaving: The people.
        n_kinds: How many areas there are.
        confidence: Confidence level.
        min_days: Days with people who leave that an interval needs.

    Raises:
        ValueError: Shapes do not fit, or a time is negative.
    """
    n, days = len(leaving.seconds), np.unique(leaving.day)
    n_of = np.bincount(leaving.kind[leaving.kind >= 0], minlength=n_kinds)
    if n < MIN_LEAVING or not n_of.any():
        few = Reason("flow.few", least=MIN_LEAVING, has=n) if n < MIN_LEAVING else Reason("flow.all_lost", n=n)
        nothing = tuple(ShareEstimate(None, None, None, int(k), n, len(days), "not_enough_data", few) for k in n_of)
        return NextAreas(nothing, _lost(leaving, confidence, min_days), None, np.zeros(n_kinds), n, len(days), few)
    curve = _Arrivals.of(leaving, n_kinds)
    reached = curve.reached(np.ones(n))
    unseen = max(0.0, 1 - float(reached.sum()))
    short = None
    if unseen > MAX_UNSEEN_END:
        short = Reason("flow.unseen", share=unseen)
        shares = tuple(ShareEstimate(None, None, None, int(k), n, len(days), "not_enough_data", short) for k in n_of)
    else:
        short = Reason("flow.days", least=min_days, has=len(days)) if len(days) < min_days else None
        shares = _shares(curve, leaving, days, reached, unseen, n_of, short, confidence)
    return NextAreas(shares, _lost(leaving, confidence, min_days), unseen, reached, n, len(days), short)


def inflow_checks(
    leaving: Sequence[Leaving],
    arrived: npt.ArrayLike,
    *,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
) -> tuple[InflowCheck, ...]:
    """Return, for each area, those who come in beside those that the flows bring; right shares make the sums agree.

    expected_k = sum over areas a of n_a F_ak, with all that outlast a curve, and all who leave an area of which too
    little is known, as what may come on top. Limits of arrived / expected: deleting one day at a time, on the log
    scale. Where tracks are lost for a reason that has to do with where people go, or people come and go where no area
    is, the two differ. They can also be wrong alike.

    Args:
        leaving: People who leave each area; `kind` counts these areas.
        arrived: People seen to come into each by day, shape (n_areas, n_days).
        confidence: Confidence level.
        min_days: Days that an interval needs.
    """
    came = np.asarray(arrived, dtype=np.float64)
    n_areas, n_days = came.shape
    all_days = np.ones(n_days)
    curves = [_Arrivals.of(a, n_areas) if len(a.seconds) >= MIN_LEAVING else None for a in leaving]

    def brought(is_used: Array) -> tuple[Array, float]:
        sure, maybe = np.zeros(n_areas), 0.0
        for people, curve in zip(leaving, curves, strict=True):
            weight = is_used[people.day]
            n = float(weight.sum())
            reached = curve.reached(weight) if curve is not None and n else np.zeros(n_areas)
            sure += n * reached
            maybe += n * (1 - float(reached.sum()))
        return sure, max(maybe, 0.0)

    sure, maybe = brought(all_days)
    total = came.sum(axis=1)
    of_day = came.sum(axis=0)
    for people in leaving:
        of_day = of_day + np.bincount(people.day, minlength=n_days)
    used = np.flatnonzero(of_day)
    wide = np.full(n_areas, math.inf)
    if len(used) >= min_days:
        logs = np.array([_log_ratio(total - came[:, d], brought(all_days - (np.arange(n_days) == d))[0]) for d in used])
        half = t_quantile(len(used) - 1, confidence=confidence)
        wide = half * np.sqrt((len(used) - 1) / len(used) * ((logs - logs.mean(axis=0)) ** 2).sum(axis=0))
    return tuple(_check(float(total[k]), float(sure[k]), maybe, float(wide[k])) for k in range(n_areas))


def _log_ratio(top: Array, bottom: Array) -> Array:
    is_known = (bottom > 0) & (top > 0)
    ratio = np.divide(top, bottom, out=np.ones(len(top)), where=is_known)
    return np.where(is_known, np.log(ratio), np.nan)


def _check(n_arrived: float, expected: float, maybe: float, wide: float) -> InflowCheck:
    if not n_arrived or not expected:
        return InflowCheck(round(n_arrived), expected, None, None, None, None)
    ratio = n_arrived / expected
    if not math.isfinite(wide):
        return InflowCheck(round(n_arrived), expected, ratio, None, None, None)
    lo, hi = n_arrived / (expected + maybe) / math.exp(wide), ratio * math.exp(wide)
    return InflowCheck(round(n_arrived), expected, ratio, lo, hi, lo <= 1 <= hi or abs(ratio - 1) <= FLOW_TOLERANCE)


def _lost(leaving: Leaving, confidence: float, min_days: int) -> ShareEstimate:
    n_days = int(leaving.day.max(initial=-1)) + 1
    n_leaving = np.bincount(leaving.day, minlength=n_days)
    lost = np.bincount(leaving.day[leaving.kind < 0], minlength=n_days)
    return share_by_days(lost, n_leaving, confidence=confidence, min_days=min_days)


@dataclass(frozen=True, slots=True, eq=False)
class _Arrivals:
    """People in the order in which they arrive or are lost, so that any weights give a curve in one pass.

    Attributes:
        order: Their indices: by time, of equal times those who arrive first.
        kind: Where they arrive, in that order; -1 = lost.
        is_known: The curve goes so far, same shape.
        n_kinds: How many areas there are.
    """

    order: npt.NDArray[np.int64]
    kind: npt.NDArray[np.int64]
    is_known: npt.NDArray[np.bool_]
    n_kinds: int

    @classmethod
    def of(cls, leaving: Leaving, n_kinds: int) -> _Arrivals:
        is_lost = leaving.kind < 0
        order = np.lexsort((is_lost, leaving.seconds))
        followed = np.arange(len(order), 0, -1, dtype=np.float64)
        n_lost_later = is_lost[order][::-1].cumsum()[::-1].astype(np.float64)
        return cls(order, leaving.kind[order], is_followed_enough(followed, n_lost_later), n_kinds)

    def reached(self, weight: Array) -> Array:
        """Return F_k of people with weights (1 or 0), shape (n_kinds,)."""
        return self._sums(weight)[0]

    def reached_late(self, unseen: float) -> Array:
        """Return the part of F_k of those who arrive last, twice the unseen share before, shape (n_kinds,)."""
        return self._sums(np.ones(len(self.order)), from_share=2 * unseen)[1]

    def _sums(self, weight: Array, *, from_share: float = 0.0) -> tuple[Array, Array]:
        w = weight[self.order]
        followed = w[::-1].cumsum()[::-1]
        used = self.is_known & (followed > 0) & (self.kind >= 0)
        hazard = np.divide(w, followed, out=np.zeros_like(w), where=used)
        before = np.concatenate(([1.0], np.cumprod(1 - hazard)[:-1]))
        step = before * hazard
        late = used & (before <= from_share)
        of_all, of_late = (np.bincount(self.kind[u], weights=step[u], minlength=self.n_kinds) for u in (used, late))
        return of_all.astype(np.float64), of_late.astype(np.float64)


def _shares(
    curve: _Arrivals,
    leaving: Leaving,
    days: npt.NDArray[np.int64],
    reached: Array,
    unseen: float,
    n_of: npt.NDArray[np.int64],
    short: Reason | None,
    confidence: float,
) -> tuple[ShareEstimate, ...]:
    n, n_days, n_followed = len(leaving.seconds), len(days), int(n_of.sum())
    late = curve.reached_late(unseen)
    value = reached + unseen * late / late.sum() if late.any() else reached / reached.sum()
    if short is not None:
        return tuple(
            ShareEstimate(float(v), None, None, int(k), n, n_days, "not_enough_data", short)
            for v, k in zip(value, n_of, strict=True)
        )
    without = np.array([curve.reached((leaving.day != d).astype(np.float64)) for d in days])
    half = t_quantile(n_days - 1, confidence=confidence)
    none = min(1.0, zero_events_limit(confidence=confidence) / n_followed)

    def variance(replicates: Array) -> Array:
        return np.asarray((n_days - 1) / n_days * ((replicates - replicates.mean(axis=0)) ** 2).sum(axis=0))

    unseen_without = np.maximum(0.0, 1 - without.sum(axis=1))[:, None]
    ends = ((reached, variance(without)), (reached + unseen, variance(without + unseen_without)))
    estimates = []
    for k in range(len(n_of)):
        limits: list[float] = []
        for which, (share, var) in enumerate(ends):
            p = min(float(share[k]), 1.0)
            if n_of[k] == 0:
                limits.append((0.0, min(1.0, none + unseen))[which])
            elif n_of[k] == n_followed:
                limits.append((max(0.0, 1 - none - unseen), 1.0)[which])
            else:
                least = p * (1 - p) / n_followed if n_of[k] < SMALL_COUNT else 0.0
                limits.append(logit_limits(p, max(float(var[k]), least), half)[which])
        estimates.append(ShareEstimate(float(value[k]), limits[0], limits[1], int(n_of[k]), n, n_days, "ok", None))
    return tuple(estimates)
