r"""Which of several sites differ from the others: a funnel with limits that know how sites usually differ.

Of log ratios y_j with variances v_j the middle m and the usual variance between sites tau^2 solve

    sum_j psi(z_j) / s_j = 0,   sum_j psi(z_j)^2 = (k - 1) beta,   z_j = (y_j - m) / s_j,   s_j^2 = v_j + tau^2,

with psi(z) = z cut off at +-1.5 and beta = E psi^2 of a normal z (Huber's Proposal 2), so that a few sites that differ
do not widen the limits which are to find them; Spiegelhalter cuts the z off too (Funnel plots for comparing
institutional performance, Statistics in Medicine 24, 2005). tau^2 is pooled with .10^2 on 4 degrees of freedom, as
`own_weeks` pools what areas have of their own.

Site j differs when its t = |y_j - m| / s_j on Satterthwaite's degrees of freedom is beyond chance, by Holm's step-down
over all k sites (Scandinavian Journal of Statistics 6, 1979). It works at 4 %, so that at most 5 % of pages name any
site that does not differ, although variances are estimated from few weeks (tests/stats/prove_sites.py).
Sites that were named leave m and tau^2, and the others are looked at once more, as long as at most a quarter is named.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import erf, stdtr

from vsd_analytics.stats.own_weeks import PRIOR_DF, PRIOR_SD
from vsd_analytics.stats.shrinkage import MIN_PLACES

Floats = npt.NDArray[np.float64]

CUT: Final = 1.5
BETA: Final = float(
    erf(CUT / math.sqrt(2))
    - 2 * CUT * math.exp(-(CUT**2) / 2) / math.sqrt(2 * math.pi)
    + CUT**2 * (1 - erf(CUT / math.sqrt(2)))
)
"""E min(z^2, CUT^2) of a standard normal z, .778."""
LARGEST_TAU: Final = 3.0
NAMED_SHARE: Final = 0.25
"""The middle and the usual variance are of the others as long as no more than this share is named."""
ERROR: Final = 0.04
"""Chance to name any site that does not differ."""
ROUNDS: Final = 30
CLOSE_ENOUGH: Final = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class Funnel:
    """Where the sites lie.

    Attributes:
        middle: m, the log ratio of a usual site.
        tau: Usual standard deviation between sites, log scale.
        p: Two-sided p value of each site, shape (n_sites,).
        differs: Sites that really differ, same shape.
    """

    middle: float
    tau: float
    p: Floats
    differs: npt.NDArray[np.bool_]


def funnel(logs: npt.ArrayLike, variances: npt.ArrayLike, df: npt.ArrayLike) -> Funnel | None:
    """Return which sites differ (formulas: this module).

    Args:
        logs: Log ratios, shape (n_sites,).
        variances: Their variances from days and weeks, same shape, above 0.
        df: Degrees of freedom of the variances, same shape.

    Returns:
        None with fewer than 4 sites: they do not tell how sites usually differ.
    """
    y, v, own_df = (np.asarray(a, dtype=np.float64) for a in (logs, variances, df))
    if len(y) < MIN_PLACES:
        return None
    differs = np.zeros(len(y), dtype=np.bool_)
    while True:
        middle, tau2, tau_df = usual(y[~differs], v[~differs])
        s2 = v + tau2
        p: Floats = 2 * stdtr(s2**2 / (v**2 / own_df + tau2**2 / tau_df), -np.abs(y - middle) / np.sqrt(s2))
        rejected = ~differs & _holm(np.where(differs, 2.0, p), n=int((~differs).sum()))
        if not rejected.any():
            return Funnel(middle, math.sqrt(tau2), p, differs)
        if (differs | rejected).sum() > NAMED_SHARE * len(y):
            return Funnel(middle, math.sqrt(tau2), p, differs | rejected)
        differs = differs | rejected


def usual(y: Floats, v: Floats) -> tuple[float, float, float]:
    """Return m, tau^2 and its degrees of freedom of sites of which a few may differ.

    Args:
        y: Log ratios, shape (n_sites,).
        v: Their variances, same shape.
    """
    from scipy.optimize import brentq  # takes a tenth of a second to import, and only many sites ask

    n = len(y)

    def excess(tau: float) -> float:
        z = (y - _middle(y, v + tau**2)) / np.sqrt(v + tau**2)
        return float((np.clip(z, -CUT, CUT) ** 2).sum()) - (n - 1) * BETA

    tau = float(brentq(excess, 0.0, LARGEST_TAU)) if excess(0.0) > 0 > excess(LARGEST_TAU) else 0.0
    if excess(LARGEST_TAU) >= 0:
        tau = LARGEST_TAU
    tau2 = ((n - 1) * tau**2 + PRIOR_DF * PRIOR_SD**2) / (n - 1 + PRIOR_DF)
    return _middle(y, v + tau2), tau2, n - 1 + PRIOR_DF


def _middle(y: Floats, s2: Floats) -> float:
    """Return Huber's mean of y."""
    s, middle = np.sqrt(s2), float(np.median(y))
    for _ in range(ROUNDS):
        z = (y - middle) / s
        inside = np.abs(z) < CUT
        if not inside.any():
            break
        step = float((np.clip(z, -CUT, CUT) / s).sum() / (inside / s2).sum())
        middle += step
        if abs(step) < CLOSE_ENOUGH:
            break
    return middle


def _holm(p: Floats, *, n: int) -> npt.NDArray[np.bool_]:
    """Return which of the n smallest p values pass Holm's step-down."""
    order = np.argsort(p, kind="stable")[:n]
    fails = p[order] * (n - np.arange(n)) > ERROR
    passed = int(np.argmax(fails)) if fails.any() else n
    rejected = np.zeros(len(p), dtype=np.bool_)
    rejected[order[:passed]] = True
    return rejected
