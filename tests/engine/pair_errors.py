"""How good places on the floor are, by the pairs of people they make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.safe_space import pairs_of_frames

Array = NDArray[np.float64]
CLOSE_M, FAR_M, LEAST_M = 2.0, 6.0, 0.3


@dataclass(frozen=True)
class PairErrors:
    """Pooled F1 of pairs under 2 m; median absolute error and bias of distances from 0.3 to 6 m."""

    f1: float
    error: float
    bias: float


def pair_errors(true_m: Array, found_m: Array) -> PairErrors:
    true, found = true_m < CLOSE_M, found_m < CLOSE_M
    known = (true_m > LEAST_M) & (true_m < FAR_M) & np.isfinite(found_m)
    off = found_m[known] / true_m[known] - 1
    f1 = 2 * np.sum(true & found) / (np.sum(true) + np.sum(found))
    return PairErrors(float(f1), float(np.median(np.abs(off))), float(np.median(off)))


def distances(frame: NDArray[np.int64], xy: Array) -> Array:
    """Return the distances of all pairs within frames."""
    a, b = pairs_of_frames(frame)
    return np.asarray(np.linalg.norm(xy[a] - xy[b], axis=1))
