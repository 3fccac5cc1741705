"""What the days of the weeks before say of the days of a period, beyond their weekdays, and what intervals make of it.

**A day resembles the open day before it.** If the effects of successive days are an AR(1) series with lag-1
correlation r, the mean of D days has variance sigma^2 / D A with A = 1 + 2 sum_k (1 - k/D) r^k, and what differs
between them within the week has only sigma^2 (1 - (A - 1)/(D - 1)). So an interval made from differences between days
needs

    A / (1 - (A - 1)/(D - 1))

times the variance. r comes from the weeks before, weekdays taken out, and is pulled towards .14, the correlation
measured in a science museum, which counts as 10 days: with N days of history less one for each weekday,
(N r + 10 x .14)/(N + 10).

**A few days may have much more than the others** (coach parties). A week without such a day is too low and looks calm,
so the true rate lies above its interval too often. Johnson (JASA 73, 1978) moves the t of a mean by its skewness g:

    upper end: t + g (2 t^2 + 1) / (6 sqrt(D)) standard errors,

g from the weeks before, pulled towards 0, which counts as 10 days: N g / (N + 10). The lower end stays: what a skewed
week could lose there is known less well.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.stats.influence import DayCounts, Floats

PRIOR_CORRELATION: Final = 0.14
PRIOR_DAYS: Final = 10
LARGEST: Final = 0.9
LEAST_DAYS_A_WEEKDAY: Final = 2
"""Residuals from the mean of two days are symmetric whatever the days are."""


def day_correlation(history: DayCounts, weekday: npt.NDArray[np.int64]) -> float:
    """Return the lag-1 correlation of days, 0 to .9.

    Args:
        history: Counts and exposure of the weeks before, days in order.
        weekday: Weekday of each of these days.
    """
    residual, n_weekdays = _residuals(history, weekday)
    n_days, n_free = len(residual), len(residual) - n_weekdays
    squares = float(residual @ residual)
    if n_free <= 0 or squares <= 0:
        return PRIOR_CORRELATION
    own = float(residual[1:] @ residual[:-1]) / squares * n_days / (n_days - 1)
    pulled = (n_free * own + PRIOR_DAYS * PRIOR_CORRELATION) / (n_free + PRIOR_DAYS)
    return min(max(pulled, 0.0), LARGEST)


def day_skewness(history: DayCounts, weekday: npt.NDArray[np.int64]) -> float:
    """Return the skewness of days, at least 0: mean cubed residual over the 3/2 power of the mean squared one.

    A residual from the mean of m days has (1 - 2/m)/sqrt(1 - 1/m) of the skewness of a day, which is divided out.

    Args:
        history: Counts and exposure of the weeks before.
        weekday: Weekday of each of these days.
    """
    residual, n_weekdays = _residuals(history, weekday)
    squares = float(residual @ residual)
    if squares <= 0 or len(residual) <= LEAST_DAYS_A_WEEKDAY * n_weekdays:
        return 0.0
    n_days, n_free = len(residual), len(residual) - n_weekdays
    part = n_weekdays / n_days
    own = float((residual**3).mean()) / math.pow(squares / n_days, 1.5) * math.sqrt(1 - part) / (1 - 2 * part)
    return max(n_free * own / (n_free + PRIOR_DAYS), 0.0)


def _residuals(history: DayCounts, weekday: npt.NDArray[np.int64]) -> tuple[Floats, int]:
    """Return count over the weekday's usual count less 1, by day that has a usual count, and the number of weekdays."""
    expected = np.zeros_like(history.x)
    for day in np.unique(weekday):
        then = weekday == day
        n, x = history.n[:, then].sum(axis=1), history.x[:, then].sum(axis=1)
        rate = np.divide(n, x, out=np.zeros_like(n), where=x > 0)
        expected[:, then] = rate[:, None] * history.x[:, then]
    usual = expected.sum(axis=0)
    seen = usual > 0
    return history.n.sum(axis=0)[seen] / usual[seen] - 1, len(np.unique(weekday[seen]))


def inflation(correlation: float, *, n_days: int) -> float:
    """Return what variance from differences between days is multiplied by: 1 for correlation 0.

    Args:
        correlation: Lag-1 correlation of the days, 0 to below 1.
        n_days: Days of the period, at least 2.
    """
    lags = np.arange(1, n_days)
    factor = 1 + 2 * float(((1 - lags / n_days) * correlation**lags).sum())
    return factor / (1 - (factor - 1) / (n_days - 1))


def skewed(t: float, *, skewness: float, n_days: int) -> float:
    """Return how many standard errors above the mean of skewed days its upper end lies: t where they are symmetric.

    Args:
        t: Quantile of Student's t.
        skewness: Of a day.
        n_days: Days of the period.
    """
    return t + skewness * (2 * t * t + 1) / (6 * math.sqrt(n_days))
