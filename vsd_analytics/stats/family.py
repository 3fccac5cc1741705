"""The changes of many places, judged together: one family a week.

Nine places and two figures are eighteen questions a week, near a thousand a year; at 5 % each, dozens of answers
would be false. So the floor's verdicts are the week's claim, and its areas are one family:

* **Who changed clearly** is decided by the procedure of Benjamini & Yekutieli (Annals of Statistics 29, 2001): of m
  changes with p-values p_(1) <= ... <= p_(m), the first k are clear with k the largest for which p_(k) <= k q / (m
  c_m), c_m = 1 + 1/2 + ... + 1/m. At most a share q of clear verdicts is then false on average, however areas depend
  on each other. They do: a busy week moves them all. Without c_m (Benjamini & Hochberg) false verdicts came in
  crowds.
* **By how much** is pulled towards the floor's change: with l_j = ln theta_j of variance v_j and floor l, tau^2 the
  variance of areas' own changes by moments, max(0, (sum (l_j - l)^2 / v_j - m) / sum 1/v_j), and b_j = v_j/(v_j +
  tau^2), an area is at l + (1 - b_j)(l_j - l) with variance (1 - b_j) v_j + b_j^2 v + 2/m b_j^2 (l_j - l)^2, the last
  because tau^2 is not known (as for levels: `vsd_analytics.stats.shrinkage`).

A fall or rise needs both: a small q-value and a pulled interval without 1. "About the same" needs both intervals, its
own and the pulled one, within the limits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr, stdtr

from vsd_analytics.answer import Verdict
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.estimates import ChangeEstimate, verdict_of
from vsd_analytics.stats.influence import Floats
from vsd_analytics.stats.quantiles import t_quantile, z_quantile

FALSE_SHARE: Final = 0.05  # of the clear verdicts of areas, at most this share is false on average
CLEAR: Final = frozenset({"clear_fall", "clear_rise"})
MIN_AREAS: Final = 2  # one area alone says nothing of how areas differ


@dataclass(frozen=True, slots=True)
class FamilyVerdict:
    """What may be said of one change when its family is judged together.

    Attributes:
        verdict: The verdict.
        q_value: The smallest false discovery rate at which it is clear; None without an interval.
        value: The ratio B / A pulled towards the floor's; None without an interval.
        lo, hi: Its interval; likewise.
    """

    verdict: Verdict
    q_value: float | None
    value: float | None
    lo: float | None
    hi: float | None


def judge_family(
    figures: Sequence[tuple[ChangeEstimate, Sequence[ChangeEstimate]]],
    *,
    confidence: float = DEFAULTS.confidence,
    about_same_share: float = DEFAULTS.about_same_share,
) -> tuple[tuple[FamilyVerdict, ...], ...]:
    """Return verdicts on the areas of a floor, all figures of all areas one family.

    Args:
        figures: For each figure the floor's change and those of its areas.
        confidence: That the intervals of the changes have, and those returned.
        about_same_share: As for `verdict_of`.

    Returns:
        For each figure a verdict for each area, in the order given. A change without an interval remains as it is and
        is no part of the family.
    """
    p = [p_value(area, confidence=confidence) for _, areas in figures for area in areas]
    q = iter(q_values(p))
    return tuple(
        tuple(
            _judged(area, next(q), pulled, about_same_share=about_same_share)
            for area, pulled in zip(areas, _pulled(floor, areas, confidence=confidence), strict=True)
        )
        for floor, areas in figures
    )


def p_value(change: ChangeEstimate, *, confidence: float) -> float | None:
    """Return the two-sided p-value of no change; None without an interval.

    It belongs to the interval: below 1 - confidence exactly when the interval excludes 1. Where one period has fewer
    than 5 violations, the arm of its Poisson interval towards 1 is taken as a normal's, and half a violation is added
    to both periods; such a change has a p-value of 1 unless it is clear.

    Args:
        change: The change.
        confidence: Of its interval.
    """
    if change.lo is None and change.hi is None:
        return None
    if change.df is not None and change.value and change.lo and change.hi:
        arm, quantile = math.log(change.hi / change.lo) / 2, t_quantile(change.df, confidence=confidence)
        t = abs(math.log(change.value)) / arm * quantile if arm > 0 else math.inf
        return float(2 * stdtr(change.df, -t)) if change.value != 1 else 1.0
    near = change.hi if change.verdict == "clear_fall" else change.lo if change.verdict == "clear_rise" else None
    if near is None or change.n_a is None or change.n_b is None:
        return 1.0
    log_theta = math.log((change.n_b + 0.5) / change.exposure_b_h / ((change.n_a + 0.5) / change.exposure_a_h))
    arm = max(abs(log_theta) - abs(math.log(near)), 1e-9)
    return float(2 * ndtr(-z_quantile(confidence=confidence) * (1 + abs(math.log(near)) / arm)))


def q_values(p: Sequence[float | None]) -> list[float | None]:
    """Return q-values by Benjamini & Yekutieli: the smallest false discovery rate at which each is clear.

    Args:
        p: p-values; None = not part of the family, and so is its q-value.
    """
    known = np.array([i for i, value in enumerate(p) if value is not None], dtype=np.int64)
    adjusted: list[float | None] = [None] * len(p)
    if not len(known):
        return adjusted
    values: Floats = np.array([value for value in p if value is not None], dtype=np.float64)
    m, order = len(values), np.argsort(values)
    harmonic = float((1 / np.arange(1, m + 1)).sum())
    scaled = values[order] * m * harmonic / np.arange(1, m + 1)
    smallest = np.minimum(np.minimum.accumulate(scaled[::-1])[::-1], 1.0)
    for i, q in zip(known[order].tolist(), smallest.tolist(), strict=True):
        adjusted[i] = q
    return adjusted


def pull_changes(
    logs: npt.NDArray[np.float64], v: npt.NDArray[np.float64], *, floor: float, floor_v: float
) -> tuple[Floats, Floats]:
    """Return log changes of areas pulled towards the floor's, and their variances (formulas at the top of the module).

    Args:
        logs: ln theta of each area, shape (n_areas,).
        v: Their variances, same shape, above 0.
        floor: ln theta of the floor.
        floor_v: Its variance.
    """
    own, m = logs - floor, len(logs)
    tau2 = max(0.0, (float((own**2 / v).sum()) - m) / float((1 / v).sum()))
    b = v / (v + tau2)
    return floor + (1 - b) * own, (1 - b) * v + b**2 * (floor_v + 2 / m * own**2)


def _pulled(
    floor: ChangeEstimate, areas: Sequence[ChangeEstimate], *, confidence: float
) -> list[tuple[float, float, float] | None]:
    """Return ratio and limits of each area pulled towards the floor; its own where there is nothing to pull."""
    z = z_quantile(confidence=confidence)
    able = [i for i, area in enumerate(areas) if area.value and area.lo and area.hi]
    ranges = [(a.value, a.lo, a.hi) if a.value and a.lo and a.hi else None for a in areas]
    if not floor.value or not floor.lo or not floor.hi or len(able) < MIN_AREAS:
        return ranges
    chosen = [areas[i] for i in able]
    logs = np.array([math.log(a.value or 1.0) for a in chosen])
    v, floor_v = (
        np.maximum([(math.log((c.hi or 1.0) / (c.lo or 1.0)) / 2 / z) ** 2 for c in changes], 1e-12)
        for changes in (chosen, [floor])
    )
    pulled, variance = pull_changes(logs, v, floor=math.log(floor.value), floor_v=float(floor_v[0]))
    for i, log_theta, half in zip(able, pulled.tolist(), (z * np.sqrt(variance)).tolist(), strict=True):
        ranges[i] = (math.exp(log_theta), math.exp(log_theta - half), math.exp(log_theta + half))
    return ranges


def _judged(
    change: ChangeEstimate,
    q_value: float | None,
    pulled: tuple[float, float, float] | None,
    *,
    about_same_share: float,
) -> FamilyVerdict:
    if q_value is None:
        return FamilyVerdict(change.verdict, None, None, None, None)
    if pulled is None:  # no violation in one of the periods: a ratio of 0, or none
        verdict = change.verdict if q_value <= FALSE_SHARE else "cannot_tell"
        return FamilyVerdict(verdict, q_value, change.value, change.lo, change.hi)
    theta, lo, hi = pulled
    pulled_verdict: Verdict = verdict_of(lo, hi, about_same_share=about_same_share)
    own: Verdict = verdict_of(change.lo, change.hi, about_same_share=about_same_share)
    is_said = pulled_verdict == own and (pulled_verdict not in CLEAR or q_value <= FALSE_SHARE)
    return FamilyVerdict(pulled_verdict if is_said else "cannot_tell", q_value, theta, lo, hi)
