"""Tails and limits of counts that vary more than chance alone: the negative binomial, by mean and dispersion.

N is gamma-Poisson: var N = mean + dispersion mean^2; dispersion 0 is Poisson. P(N <= k) = I_p(1/dispersion,
k + 1) with p = 1 / (1 + dispersion mean), I the regularised incomplete beta function: `scipy.special.nbdtr` wants whole
parameters, `betainc` does not. Source: Johnson, Kemp, Kotz, Univariate Discrete Distributions, 3rd ed., chapter 5.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import betainc, gammainc, gammaincc

Floats = npt.NDArray[np.float64]

POISSON_BELOW: Final = 1e-8  # a dispersion below this is none: the incomplete beta loses digits there


def at_most(k: npt.ArrayLike, *, mean: npt.ArrayLike, dispersion: npt.ArrayLike) -> Floats:
    """Return P(N <= k); 0 below 0, NaN where an argument is NaN.

    Args:
        k: Whole numbers.
        mean: Expected count, at least 0.
        dispersion: (var - mean) / mean^2, at least 0.
    """
    return _tail(k, mean=mean, dispersion=dispersion, is_upper=False)


def at_least(k: npt.ArrayLike, *, mean: npt.ArrayLike, dispersion: npt.ArrayLike) -> Floats:
    """Return P(N >= k), exact in the far tail as well; 1 at 0 and below, NaN where an argument is NaN.

    Args:
        k: Whole numbers.
        mean: Expected count, at least 0.
        dispersion: (var - mean) / mean^2, at least 0.
    """
    return _tail(np.asarray(k, dtype=np.float64) - 1, mean=mean, dispersion=dispersion, is_upper=True)


def both_tails(k: npt.ArrayLike, *, mean: npt.ArrayLike, dispersion: npt.ArrayLike) -> Floats:
    """Return the two-sided tail probability min(1, 2 min(P(N <= k), P(N >= k)))."""
    low = at_most(k, mean=mean, dispersion=dispersion)
    return np.asarray(np.minimum(1.0, 2 * np.minimum(low, at_least(k, mean=mean, dispersion=dispersion))))


def quantile(share: float, *, mean: npt.ArrayLike, dispersion: npt.ArrayLike) -> Floats:
    """Return the smallest whole k with P(N <= k) >= `share`, by bisection; NaN where an argument is NaN.

    Args:
        share: Between 0 and 1.
        mean: Expected count, at least 0.
        dispersion: (var - mean) / mean^2, at least 0.
    """
    means, spreads = np.broadcast_arrays(np.asarray(mean, np.float64), np.asarray(dispersion, np.float64))
    is_known = ~np.isnan(means + spreads)
    low = np.full(means.shape, -1.0)
    high = np.ones(means.shape)
    while (short := is_known & (at_most(high, mean=means, dispersion=spreads) < share)).any():
        high = np.where(short, 2 * high, high)
    while (wide := is_known & (high - low > 1)).any():
        middle = np.where(wide, np.floor((low + high) / 2), high)
        is_enough = at_most(middle, mean=means, dispersion=spreads) >= share
        low, high = np.where(wide & ~is_enough, middle, low), np.where(wide & is_enough, middle, high)
    return np.where(is_known, high, np.nan)


def _tail(k: npt.ArrayLike, *, mean: npt.ArrayLike, dispersion: npt.ArrayLike, is_upper: bool) -> Floats:
    """Return P(N > k) or P(N <= k)."""
    counts, means, spreads = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (k, mean, dispersion)))
    from_k = np.maximum(counts, 0) + 1
    is_poisson = spreads < POISSON_BELOW
    p = 1 / (1 + spreads * means)
    shape = 1 / np.where(is_poisson, 1.0, spreads)
    if is_upper:
        tail = np.where(is_poisson, gammainc(from_k, means), betainc(from_k, shape, 1 - p))
        return np.where(counts < 0, np.where(np.isnan(means + spreads), np.nan, 1.0), tail)
    tail = np.where(is_poisson, gammaincc(from_k, means), betainc(shape, from_k, p))
    return np.where(counts < 0, np.where(np.isnan(means + spreads), np.nan, 0.0), tail)
