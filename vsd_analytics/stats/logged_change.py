"""A logged change from the weeks of a floor: its running verdict, and which areas took up what it lost.

The changed area is compared with the comparison areas taken together, week by week, by `running_verdict`: by logs of
weekly rates where every week has violations and a week before had ten on average, else by their counts
(`few_events`), for which no violation at all is a result like any other. Which of both is used follows from the weeks
before, but for a week without any after them, which chance hardly ever gives where ten are usual.

A fall may have moved. With q_k the ratio of mean rates of another place k, since over before, and q the median of the
comparison areas' ratios but its own, k took up, or gave away, (q_k - q) times its rate before. The median, as an area
that took people up must not make the others look as if they had fallen.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.stats import few_events
from vsd_analytics.stats.estimates import verdict_of
from vsd_analytics.stats.period_days import Bools, Floats
from vsd_analytics.stats.placebos import mean_shifts, spread_half_width
from vsd_analytics.stats.running_verdict import (
    LAST_WEEKS,
    MAX_REFERENCE_WEEKS,
    MOST_LOG_E,
    RunningVerdict,
    as_far_as,
    no_verdict,
    running_verdict,
    too_few_weeks,
)

MIN_A_WEEK: Final = 10.0
"""Violations a week before the change from which on logs of weeks are compared."""


@dataclass(frozen=True, slots=True, eq=False)
class AreaWeeks:
    """Weeks of areas; the first is the changed one.

    Attributes:
        time_h: Person-time in violation, or another time, shape (n_areas, n_weeks).
        open_h: Recorded open hours, same shape; 0 = the week says nothing of the area.
        n: Violations the time is made of, same shape.
    """

    time_h: Floats
    open_h: Floats
    n: Floats

    def of(self, areas: Sequence[int]) -> AreaWeeks:
        """Return some of the areas, in that order."""
        at = list(areas)
        return AreaWeeks(self.time_h[at], self.open_h[at], self.n[at])

    def at(self, weeks: Bools) -> AreaWeeks:
        """Return some of the weeks."""
        return AreaWeeks(self.time_h[:, weeks], self.open_h[:, weeks], self.n[:, weeks])

    @property
    def is_known(self) -> Bools:
        """Return which weeks say something of the changed area and of what it is compared with."""
        is_beside = (self.open_h[1:].sum(axis=0) > 0) & (self.time_h[1:].sum(axis=0) > 0)
        return np.asarray((self.open_h[0] > 0) & (is_beside | (len(self.time_h) == 1)))

    @property
    def beside(self) -> Floats:
        """Return the weekly rate of the comparison areas together; 1 without any."""
        if len(self.time_h) == 1:
            return np.ones(self.time_h.shape[1])
        return np.asarray(self.time_h[1:].sum(axis=0) / self.open_h[1:].sum(axis=0))


def verdict_of_weeks(before: AreaWeeks, after: AreaWeeks, *, confidence: float = 0.95) -> RunningVerdict:
    """Return the verdict on a change after the weeks read so far.

    Args:
        before: The weeks before the change, oldest first. The last twelve that are known count.
        after: The weeks since, with the same areas.
        confidence: 1 - 1/e at which the verdict is clear.
    """
    known_b = np.flatnonzero(before.is_known)[-MAX_REFERENCE_WEEKS:]
    b, a = before.at(np.isin(np.arange(before.n.shape[1]), known_b)), after.at(after.is_known)
    m, n = b.n.shape[1], a.n.shape[1]
    if (reason := too_few_weeks(m, n)) is not None:
        return no_verdict(reason, m, n)
    if not b.n[0].any():
        return no_verdict(Reason("logged_change.events_before", least=1, has=0), m, n)
    each = range(1, len(b.n))
    kept = [[0, *(j for j in each if j != k)] for k in each]
    half = _spread(b, a, confidence=confidence) if each else None
    if not is_few(b, a):
        logs = [(_log_ratios(b.of(areas)), _log_ratios(a.of(areas))) for areas in kept]
        return running_verdict(
            _log_ratios(b), _log_ratios(a), without=logs if each else (), spread=half, confidence=confidence
        )
    parts = [
        _counted(b.of(areas), a.of(areas), confidence=confidence)
        for areas in kept
        if b.of(areas).is_known.all() and a.of(areas).is_known.all()
    ]
    whole = _counted(b, a, confidence=confidence)
    half_event = 0.5 / float(b.n[0].sum()) / _exposure_ratios(b, a)[-1]
    verdict = as_far_as(whole, parts, None if half is None else float(half[-1]), least=float(half_event))
    is_shown = [e >= 1 / (1 - confidence) for e in verdict.e_by_week]
    return replace(verdict, clear_since=is_shown.index(True) + 1 if any(is_shown) else None)


def is_few(before: AreaWeeks, after: AreaWeeks) -> bool:
    """Tell whether counts must be compared, as a week has nothing to take the log of, or few violations are usual."""
    is_none = not (before.time_h[0].all() and after.time_h[0].all())
    return is_none or float(before.n[0].mean()) < MIN_A_WEEK


def _log_ratios(weeks: AreaWeeks) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        log_ratios = np.log(weeks.time_h[0] / weeks.open_h[0]) - np.log(weeks.beside)
    return np.asarray(np.where(np.isfinite(log_ratios), log_ratios, np.nan), dtype=np.float64)


def _counted(b: AreaWeeks, a: AreaWeeks, *, confidence: float) -> RunningVerdict:
    """Return the verdict by counts, beside all comparison areas given."""
    phi = few_events.dispersion(b.n[0], b.open_h[0] * b.beside)
    n_before, so_far, ratios = float(b.n[0].sum()), np.cumsum(a.n[0]), _exposure_ratios(b, a)
    e = [
        math.exp(min(MOST_LOG_E, few_events.log_e(n_before, float(n), exposure_ratio=float(x), phi=phi)))
        for n, x in zip(so_far, ratios, strict=True)
    ]
    at = {"exposure_ratio": float(ratios[-1]), "phi": phi, "confidence": confidence}
    lo, hi = few_events.running_limits(n_before, float(so_far[-1]), **at)
    theta = float(so_far[-1]) / n_before / float(ratios[-1])
    last = a.at(np.arange(a.n.shape[1]) >= a.n.shape[1] - LAST_WEEKS)
    last_value = float(last.n[0].sum()) / n_before / float(_exposure_ratios(b, last)[-1])
    return RunningVerdict(
        value=theta, lo=lo, hi=hi, e_value=e[-1], e_by_week=tuple(e), clear_since=None, n_reference=b.n.shape[1],
        n_weeks=a.n.shape[1], verdict=verdict_of(lo, hi), state="ok", reason=None, all_value=theta, all_lo=lo,
        all_hi=hi, last_value=last_value, is_counted=True,
    )  # fmt: skip


def _exposure_ratios(b: AreaWeeks, a: AreaWeeks) -> Floats:
    """Return what should move with the changed area, since over before, after each week."""
    before, since = (w.open_h[0] * w.beside for w in (b, a))
    return np.asarray(np.cumsum(since) / before.sum(), dtype=np.float64)


def _spread(b: AreaWeeks, a: AreaWeeks, *, confidence: float) -> Floats:
    """Return how far a shift must lie from those of the comparison areas to stand out, after each week."""
    shifts = mean_shifts(_log_rates(b), _log_rates(a))
    return spread_half_width(shifts[0], shifts[1:], confidence=confidence)


def _log_rates(weeks: AreaWeeks) -> Floats:
    """Return weekly log rates; a week without a violation counts as half of one, an unknown one as the mean week."""
    least = 0.5 * weeks.time_h.sum(axis=1, keepdims=True) / np.maximum(weeks.n.sum(axis=1, keepdims=True), 1.0)
    least = np.where(least > 0, least, 0.5 * weeks.time_h.sum() / max(float(weeks.n.sum()), 1.0))
    known = weeks.open_h > 0
    logs = np.log(np.maximum(weeks.time_h, least) / np.where(known, weeks.open_h, 1.0))
    mean = np.where(known, logs, 0.0).sum(axis=1, keepdims=True) / np.maximum(known.sum(axis=1, keepdims=True), 1)
    return np.asarray(np.where(known, logs, mean), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class TakenUp:
    """What other places took up of what a changed area lost, beside the comparison areas.

    Attributes:
        lost_h: What the changed area lost a week, beside the comparison areas; below 0 where it has more.
        taken_h: What each other place took up a week, in the order given; below 0 what it lost.
        share: The two that took up most, over `lost_h`; None where nothing was lost.
    """

    lost_h: float
    taken_h: tuple[float, ...]
    share: float | None


def taken_up(before: AreaWeeks, after: AreaWeeks, comparison: Sequence[int]) -> TakenUp:
    """Return what each place of a floor took up since a change (formula: this module).

    The two largest count for `share`: the sum over all places would be that of their chance.

    Args:
        before: Weeks of the changed area and of all other places.
        after: Weeks since, of the same.
        comparison: Rows of those that were left alone.
    """
    was, now = (_mean_rates(weeks) for weeks in (before, after))

    def beside(k: int) -> float:
        rows = [j for j in comparison if j != k and was[j] > 0]
        return float(np.median(now[rows] / was[rows])) if rows else 1.0

    change = [float(now[k] - was[k] * beside(k)) * _hours(after, k) for k in range(len(was))]
    lost, taken = -change[0], change[1:]
    most = sum(sorted((max(0.0, t) for t in taken), reverse=True)[:2])
    return TakenUp(lost, tuple(taken), most / lost if lost > 0 else None)


def _mean_rates(weeks: AreaWeeks) -> Floats:
    hours = weeks.open_h.sum(axis=1)
    time_h = np.where(weeks.open_h > 0, weeks.time_h, 0.0).sum(axis=1)
    return np.asarray(np.divide(time_h, hours, out=np.zeros(len(hours)), where=hours > 0), dtype=np.float64)


def _hours(weeks: AreaWeeks, k: int) -> float:
    known = weeks.open_h[k] > 0
    return float(weeks.open_h[k][known].mean()) if known.any() else 0.0
