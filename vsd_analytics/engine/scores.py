"""Precision, recall and F1, pooled and as mean of frames, with intervals by blocks of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

N_BLOCKS: Final = 20
"""Neighbouring frames show the same people, so the bootstrap draws blocks of time and not frames."""
N_DRAWS: Final = 2000
LEVEL: Final = 0.95
SEED: Final = 14


@dataclass(frozen=True, slots=True)
class Hits:
    """What was found of what is there, per frame; arrays of shape (n,).

    Attributes:
        hit: Found and there.
        false: Found and not there.
        missed: There and not found.
    """

    hit: NDArray[np.int64]
    false: NDArray[np.int64]
    missed: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Score:
    """A score between 0 and 1 with its interval; NaN where nothing defines it."""

    value: float
    lo: float
    hi: float


@dataclass(frozen=True, slots=True)
class Scores:
    """Precision hit/(hit+false), recall hit/(hit+missed), and F1 = 2 hit/(2 hit+false+missed)."""

    precision: Score
    recall: Score
    f1: Score


def pooled(hits: Hits) -> Scores:
    """Return the scores of all frames together; intervals are the middle 95 % of a bootstrap of `N_BLOCKS` blocks."""
    return Scores(*(_ratio(above, below) for above, below in _fractions(hits)))


def frame_mean(hits: Hits) -> Scores:
    """Return the mean over frames of each frame's scores.

    A frame in which a score is 0/0 has none: precision without anything found, recall without anything to find, F1
    without both.
    """
    shares = [(np.where(below > 0, above / np.maximum(below, 1), 0.0), below > 0) for above, below in _fractions(hits)]
    return Scores(*(_ratio(share, defined) for share, defined in shares))


def f1_of(hits: Hits) -> float:
    """Return the pooled F1 without its interval; NaN where nothing is there or found."""
    above, below = _fractions(hits)[2]
    return float(above.sum() / below.sum()) if below.sum() else float("nan")


def f1_of_frames(hits: Hits, *, counts_empty: bool = False) -> float:
    """Return the mean F1 of frames without its interval.

    Args:
        hits: Per frame.
        counts_empty: Frames with nothing there and nothing found count 0, as in the published evaluation; else they
            do not count.
    """
    above, below = _fractions(hits)[2]
    counted = (below > 0) | counts_empty
    return float((above / np.maximum(below, 1))[counted].mean()) if counted.any() else float("nan")


def _fractions(hits: Hits) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Return numerator and denominator of precision, recall and F1, per frame."""
    detected, there = hits.hit + hits.false, hits.hit + hits.missed
    return [(hits.hit, detected), (hits.hit, there), (2 * hits.hit, detected + there)]


def _ratio(above: NDArray[Any], below: NDArray[Any]) -> Score:
    """Return sum(above) / sum(below) over frames in their order, with the interval of resampled blocks."""
    if below.sum() == 0:
        return Score(np.nan, np.nan, np.nan)
    block = np.arange(len(below)) * min(N_BLOCKS, len(below)) // len(below)
    sums = np.stack([np.bincount(block, part.astype(np.float64)) for part in (above, below)], axis=1)
    n = len(sums)
    draws = np.random.default_rng(SEED).multinomial(n, np.full(n, 1 / n), N_DRAWS) @ sums
    draws = draws[draws[:, 1] > 0]
    lo, hi = np.quantile(draws[:, 0] / draws[:, 1], [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Score(float(above.sum() / below.sum()), float(lo), float(hi))
