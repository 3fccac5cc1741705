"""How far areas move that nobody changed: the spread beside which the shift of a changed area must stand out.

Placebo in space (Conley & Taber, Review of Economics and Statistics 93, 2011; Abadie, Diamond & Hainmueller, JASA 105,
2010). u_k is the log shift of comparison area k, after over before, over the weeks of the changed area. Its own shift
beside them is a draw like theirs where nothing was done, so it stands out beyond

    t sd sqrt(1 + 1/K),   sd^2 = ((K - 1) s^2 + d sd_0^2) / df,   df = K - 1 + d,   d = max(0, 4 - K),

s^2 the variance of the u_k, t the two-sided quantile on df degrees of freedom at a fifth of the error (99 % for 95 %):
the comparison is made again every week, of areas some of which feel far more than others. An area that took up the
people who left moves the other way; so shifts the other way count, from the median of all, no farther than the farthest
of those that go the way of the changed area. With fewer than four areas a prior makes up for the degrees of freedom
that are missing: a site that falls by 30 % and whose areas feel it with a log sd of .4 has shifts of sd .15.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.stats.period_days import Floats
from vsd_analytics.stats.quantiles import t_quantile

PRIOR_SD: Final = 0.15
MIN_AREAS: Final = 4
"""From so many comparison areas on their own shifts are all that counts."""
SHARE_OF_ERROR: Final = 0.2


def spread_half_width(changed: npt.ArrayLike, shifts: npt.ArrayLike, *, confidence: float = 0.95) -> Floats:
    """Return how far a shift must lie from that of the comparison areas to stand out from theirs.

    Args:
        changed: Log shift of the changed area after each reading, shape (..., n_readings).
        shifts: Log shifts of the comparison areas, shape (..., n_areas, n_readings).
        confidence: Of the verdict.

    Returns:
        Half widths on the log scale, shape of `changed`.
    """
    u = np.asarray(shifts, dtype=np.float64)
    n_areas = u.shape[-2]
    apart = u - np.median(u, axis=-2, keepdims=True)
    way = np.sign(np.asarray(changed, dtype=np.float64)[..., None, :] - np.median(u, axis=-2, keepdims=True))
    farthest = np.max(np.where(apart * way > 0, np.abs(apart), 0.0), axis=-2, keepdims=True)
    apart = np.where(apart * way < 0, -way * np.minimum(np.abs(apart), farthest), apart)
    missing = max(0, MIN_AREAS - n_areas)
    df = n_areas - 1 + missing
    squares = ((apart - apart.mean(axis=-2, keepdims=True)) ** 2).sum(axis=-2) + missing * PRIOR_SD**2
    quantile = t_quantile(df, confidence=1 - SHARE_OF_ERROR * (1 - confidence))
    return np.asarray(quantile * np.sqrt(squares / df * (1 + 1 / n_areas)), dtype=np.float64)


def mean_shifts(before: npt.ArrayLike, after: npt.ArrayLike) -> Floats:
    """Return the shift of weekly log rates after each week since: mean of the weeks so far less mean of those before.

    Args:
        before: Log rates, shape (..., m).
        after: Log rates, shape (..., n).

    Returns:
        Shape (..., n).
    """
    b, a = np.asarray(before, dtype=np.float64), np.asarray(after, dtype=np.float64)
    so_far = np.cumsum(a, axis=-1) / np.arange(1, a.shape[-1] + 1)
    return np.asarray(so_far - b.mean(axis=-1, keepdims=True), dtype=np.float64)
