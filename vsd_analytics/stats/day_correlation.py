"""How much a day resembles the open day before it, and what that does to the interval of a week's rate.

If the effects of successive days are an AR(1) series with lag-1 correlation r, the mean of D days has variance
sigma^2 / D A with A = 1 + 2 sum_k (1 - k/D) r^k, and what differs between them within the week has only
sigma^2 (1 - (A - 1)/(D - 1)). So an interval made from differences between days needs

    A / (1 - (A - 1)/(D - 1))

times the variance. r comes from the weeks before, weekdays taken out, and is pulled towards .14, the correlation
measured in a science museum, which counts as 10 days: with N days of history less one for each weekday,
(N r + 10 x .14)/(N + 10).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.stats.influence import DayCounts, Floats

PRIOR_CORRELATION: Final = 0.14
PRIOR_DAYS: Final = 10
LARGEST: Final = 0.9


def day_correlation(history: DayCounts, weekday: npt.NDArray[np.int64]) -> float:
    """Return the lag-1 correlation of days, 0 to .9.

    Args:
        history: Counts and exposure of the weeks before, days in order.
        weekday: Weekday of each of these days.
    """
    expected = np.zeros_like(history.x)
    for day in np.unique(weekday):
        then = weekday == day
        n, x = history.n[:, then].sum(axis=1), history.x[:, then].sum(axis=1)
        rate = np.divide(n, x, out=np.zeros_like(n), where=x > 0)
        expected[:, then] = rate[:, None] * history.x[:, then]
    usual = expected.sum(axis=0)
    seen = usual > 0
    residual: Floats = history.n.sum(axis=0)[seen] / usual[seen] - 1
    n_days, n_free = len(residual), len(residual) - len(np.unique(weekday[seen]))
    squares = float(residual @ residual)
    if n_free <= 0 or squares <= 0:
        return PRIOR_CORRELATION
    own = float(residual[1:] @ residual[:-1]) / squares * n_days / (n_days - 1)
    pulled = (n_free * own + PRIOR_DAYS * PRIOR_CORRELATION) / (n_free + PRIOR_DAYS)
    return min(max(pulled, 0.0), LARGEST)


def inflation(correlation: float, *, n_days: int) -> float:
    """Return what variance from differences between days is multiplied by: 1 for correlation 0.

    Args:
        correlation: Lag-1 correlation of the days, 0 to below 1.
        n_days: Days of the period, at least 2.
    """
    lags = np.arange(1, n_days)
    factor = 1 + 2 * float(((1 - lags / n_days) * correlation**lags).sum())
    return factor / (1 - (factor - 1) / (n_days - 1))
