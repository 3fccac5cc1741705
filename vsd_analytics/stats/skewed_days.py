"""Days that are skewed, as where coach parties come: how far above a rate its interval must reach.

A week without a coach has days that agree and a rate that is too low: Student's t then misses the truth from above.
Bootstrap t (Hall, The Bootstrap and Edgeworth Expansion, 1992, ch. 3): days are drawn from those of the weeks before
and of the period, each over the mean of its weekday; t* = (ln mean* - ln mean) / se*, and the upper end of the interval
uses minus the lower quantile of t*, where that is farther than t. The draws are fixed, so equal days give equal ranges.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.stats.influence import DayCounts

Floats = npt.NDArray[np.float64]
N_DRAWS: Final = 499
SEED: Final = 0
MIN_DAYS: Final = 21
"""Days that all cameras recorded, from which on their skewness is looked at."""
MOST: Final = 6.0
"""Standard errors above a rate, at most: twice and a half of t with six degrees of freedom."""


def upper_quantile(
    counts: DayCounts, past: DayCounts, weekday: npt.NDArray[np.int64], past_weekday: npt.NDArray[np.int64],
    *, confidence: float,
) -> float:  # fmt: skip
    """Return how many standard errors above a rate its interval must reach for skewed days; 0 with too few of them.

    Args:
        counts: The period.
        past: The weeks before, of the same cameras.
        weekday: Of the days of the period.
        past_weekday: Of those before.
        confidence: Confidence level.
    """
    n, x = (np.concatenate(pair, axis=1) for pair in ((past.n, counts.n), (past.x, counts.x)))
    days = np.concatenate([past_weekday, weekday])
    is_whole = (x > 0).all(axis=0)
    rate, days = n[:, is_whole].sum(axis=0) / x[:, is_whole].sum(axis=0), days[is_whole]
    usual = {int(d): float(rate[days == d].mean()) for d in np.unique(days)}
    beside = np.array([usual[int(d)] for d in days])
    if len(rate) < MIN_DAYS or not (beside > 0).all():
        return 0.0
    relative = rate / beside
    n_days = int((counts.x > 0).all(axis=0).sum())
    if n_days <= 1:
        return 0.0
    drawn = relative[_draws(len(relative), n_days)]
    mean = drawn.mean(axis=1)
    known = mean > 0
    se = drawn[known].std(axis=1, ddof=1) / np.sqrt(n_days) / mean[known]
    t = np.log(mean[known] / relative.mean()) / np.maximum(se, 1e-9)
    return float(min(MOST, max(0.0, -np.quantile(t, (1 - confidence) / 2))))


@lru_cache(maxsize=64)
def _draws(n: int, n_days: int) -> npt.NDArray[np.int64]:
    return np.random.default_rng(SEED).integers(0, n, (N_DRAWS, n_days))
