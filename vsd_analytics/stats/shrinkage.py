"""Rates of several places pulled towards their common mean: small ones more, as they know less (empirical Bayes).

On the log scale l_j = ln r_j with variances v_j; mean m and variance tau^2 between k places by the moments of
DerSimonian & Laird (Controlled Clinical Trials 7, 1986). Place j becomes m + (1 - b_j) (l_j - m) with

    b_j = (k-3)/(k-1)  v_j / (v_j + tau^2),
    variance (1 - b_j) v_j + b_j^2 var(m) + 2/(k-1) b_j^2 (l_j - m)^2,

which allows for tau^2 not being known (Morris, Journal of the American Statistical Association 78, 1983): without it
intervals of 3 to 12 places held 85 to 94 % in simulation, with it 94.5 to 98 %. The v_j are day-clustered, so that a
place is not taken to know more than its days tell, as it would be by a Poisson count.

Among places of which a few may be of another kind, `pull_limited` takes m and tau^2 from the others and pulls nobody by
more than if it lay one s_j = sqrt(v_j + tau^2) away (limited translation, Efron & Morris, Journal of the American
Statistical Association 67, 1972): b_j is multiplied by min(1, s_j / |l_j - m|). What is far away may not belong to
the others, and would be pulled out of its own range.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.stats.quantiles import t_quantile, z_quantile

MIN_PLACES: Final = 4  # fewer say nothing of how places differ


@dataclass(frozen=True, slots=True)
class Pulled:
    """A rate pulled towards the mean of all.

    Attributes:
        value: The rate, in the unit it came in.
        lo, hi: Its interval.
        weight: Weight of its own rate in the shrunken one, 0 to 1.
    """

    value: float
    lo: float
    hi: float
    weight: float


def between_places(logs: npt.NDArray[np.float64], v: npt.NDArray[np.float64]) -> tuple[float, float]:
    """Return the mean of log rates and their variance between places.

    Args:
        logs: ln r_j, shape (n_places,).
        v: Their variances, same shape, above 0.
    """
    precision = 1 / v
    fixed = float(precision @ logs / precision.sum())
    spread = float(precision @ (logs - fixed) ** 2) - (len(logs) - 1)
    tau2 = max(0.0, spread / float(precision.sum() - (precision @ precision) / precision.sum()))
    return float(((1 / (v + tau2)) @ logs) / (1 / (v + tau2)).sum()), tau2


def pull(rates: npt.ArrayLike, lo: npt.ArrayLike, hi: npt.ArrayLike, *, confidence: float) -> tuple[Pulled, ...] | None:
    """Return each rate pulled towards the mean of all.

    Args:
        rates: Rates, above 0, shape (n_places,).
        lo: Lower ends of their intervals, same shape.
        hi: Upper ends, same shape. ln(hi / lo) / 2 z is taken as the standard error of ln r: with Student's t in the
            interval that is a little too much, and pulls a little more.
        confidence: Of the intervals, and of those returned.

    Returns:
        In the order given; None with fewer than `MIN_PLACES`.
    """
    logs, low, high = (np.log(np.asarray(x, dtype=np.float64)) for x in (rates, lo, hi))
    if len(logs) < MIN_PLACES:
        return None
    z = z_quantile(confidence=confidence)
    v = np.maximum(((high - low) / 2 / z) ** 2, 1e-12)
    mean, tau2 = between_places(logs, v)
    k, away = len(logs), logs - mean
    pulled = (k - 3) / (k - 1) * v / (v + tau2)
    unsure = 1 / float((1 / (v + tau2)).sum()) + 2 / (k - 1) * away**2
    half = z * np.sqrt((1 - pulled) * v + pulled**2 * unsure)
    log_rate = mean + (1 - pulled) * away
    return tuple(
        Pulled(math.exp(r), math.exp(r - h), math.exp(r + h), float(w))
        for r, h, w in zip(log_rate, half, 1 - pulled, strict=True)
    )


def pull_limited(
    logs: npt.ArrayLike, variances: npt.ArrayLike, df: npt.ArrayLike, *, tau: float, confidence: float
) -> tuple[Pulled, ...]:
    """Return each ratio pulled towards 1, the ratio of a usual place, by no more than one that is one s_j away.

    Args:
        logs: Log ratios, shape (n_places,); of three and fewer none is pulled.
        variances: Their variances, same shape, above 0.
        df: Degrees of freedom of the variances, same shape; the intervals have their Student's t.
        tau: Usual standard deviation between places, log scale.
        confidence: Of the intervals.
    """
    away, v, own_df = (np.asarray(a, dtype=np.float64) for a in (logs, variances, df))
    k, s2 = len(away), v + tau**2
    others = max(k - 1, 1)
    pulled = max(k - 3, 0) / others * v / s2 * np.minimum(1.0, np.sqrt(s2) / np.maximum(np.abs(away), 1e-12))
    unsure = 1 / float((1 / s2).sum()) + 2 / others * away**2
    t = np.array([t_quantile(d, confidence=confidence) for d in own_df.tolist()])
    half = t * np.sqrt((1 - pulled) * v + pulled**2 * unsure)
    return tuple(
        Pulled(math.exp(r), math.exp(r - h), math.exp(r + h), float(w))
        for r, h, w in zip((1 - pulled) * away, half, 1 - pulled, strict=True)
    )
