"""How much a count of violations hangs on the distance measured: other thresholds, and an engine's known error."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vsd_analytics.answer import Reason, State

FULL_REACH_SD = 3.0
"""Distances farther than so many sd beyond the threshold do not cross it in one record of a thousand."""


@dataclass(frozen=True, slots=True)
class ThresholdPoint:
    """What would be counted if the legal distance were another (M26).

    Attributes:
        distance_m: The threshold.
        violation_records: Pair records nearer than it; None when unknown.
        violation_h: Person-hours with a neighbour nearer than it; None when unknown.
        share: violation_h / person-hours in view (M6), 0 to 1; None when either is unknown.
        state: "ok" when the share has a value.
        reason: Why not.
    """

    distance_m: float
    violation_records: int | None
    violation_h: float | None
    share: float | None
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class Crossings:
    """What a spread of measured distances does to a count of violation records.

    Attributes:
        distance_sd_m: Standard deviation of a measured distance.
        violation_records: Pair records measured nearer than the threshold.
        leaving: Expected number of those that were farther in truth.
        entering: Expected number of records measured farther that were nearer in truth.
        flipped_share: (leaving + entering) / pair records known; None without any.
        is_reach_full: Distances are known to three sd beyond the threshold; else `entering` is too small.
    """

    distance_sd_m: float
    violation_records: int
    leaving: float
    entering: float
    flipped_share: float | None
    is_reach_full: bool

    @property
    def expected(self) -> float:
        """Return the expected number of true violation records: violation_records - leaving + entering."""
        return self.violation_records - self.leaving + self.entering

    @property
    def lo(self) -> float:
        """Return the count if only those that leave crossed."""
        return self.violation_records - self.leaving

    @property
    def hi(self) -> float:
        """Return the count if only those that enter crossed."""
        return self.violation_records + self.entering


def crossings(
    distance_mm: ArrayLike, n: ArrayLike, *, threshold_mm: int, distance_sd_m: float, reach_mm: int
) -> Crossings:
    """Return how many records an error of the distance moves over the threshold, without simulation.

    A record measured at m was at m + sd Z in truth, Z standard normal (as if all true distances near m were equally
    common): it leaves with probability Phi((m - D) / sd), or enters with Phi((D - m) / sd). Sums over records, which
    need not be independent.

    Args:
        distance_mm: Distances measured, rounded down to whole millimetres, shape (k,).
        n: Pair records at each, shape (k,).
        threshold_mm: D; a violation is measured nearer than it.
        distance_sd_m: sd, greater than 0.
        reach_mm: Distances are known up to here.

    Raises:
        ValueError: The sd is not greater than 0.
    """
    from scipy.special import ndtr

    if not (math.isfinite(distance_sd_m) and distance_sd_m > 0):
        raise ValueError(f"distance_sd_m is {distance_sd_m}")
    measured, count = np.asarray(distance_mm, dtype=np.int64), np.asarray(n, dtype=np.float64)
    sd_mm = distance_sd_m * 1000
    beyond_sd = (measured + 0.5 - threshold_mm) / sd_mm
    flips = count * ndtr(-np.abs(beyond_sd))
    is_near = measured < threshold_mm
    total = float(count.sum())
    return Crossings(
        distance_sd_m=distance_sd_m,
        violation_records=int(count[is_near].sum()),
        leaving=float(flips[is_near].sum()),
        entering=float(flips[~is_near].sum()),
        flipped_share=float(flips.sum()) / total if total else None,
        is_reach_full=reach_mm >= threshold_mm + FULL_REACH_SD * sd_mm,
    )


def true_records(violation_records: float, *, precision: float, recall: float) -> float:
    """Return the expected number of true violation records: n precision / recall.

    Args:
        violation_records: Violation records the engine gave, n.
        precision: Share of them that are true, above 0 and at most 1.
        recall: Share of the true ones that the engine gives, above 0 and at most 1.

    Raises:
        ValueError: A share is not in (0, 1].
    """
    if not (0 < precision <= 1 and 0 < recall <= 1):
        raise ValueError(f"precision {precision} and recall {recall} must lie in (0, 1]")
    return violation_records * precision / recall
