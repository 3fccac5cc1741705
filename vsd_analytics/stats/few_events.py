"""Changes of areas with few violations, and falls to none: what counts say where logs of weeks cannot.

An area had N_B violations while its comparison areas had E_B of what should move with it (their time too close), and
N_A at E_A since. Under the ratio theta and independent violations N_A of N_A + N_B is binomial with
p = theta E_A / (theta E_A + E_B): exact limits are those of Clopper & Pearson (Biometrika 26, 1934), with one side of
the whole error after no violation. Read every week, the evidence against theta is the Bayes factor of two gamma-Poisson
counts,

    e = GP(N_A; 1/2, E_B / (2 N_B), E_A) / GP(N_A; N_B + 1/2, E_B, theta E_A),

GP(n; a, b, x) = G(a + n) / (G(a) n!) (b / (b + x))^a (x / (b + x))^n. The rate before is known as far as N_B tells it;
that of the weeks since may be any. Weeks differ by more than independent violations do, so N is counted in units of the
dispersion phi, variance over mean of the weeks before, at least 1.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import betaincinv, gammaln

PRIOR_SD: Final = 0.10
PRIOR_DF: Final = 4.0
"""Own weeks of an area, as in `vsd_analytics.stats.own_weeks`: what the dispersion is pooled with."""
FARTHEST: Final = 1e4
"""Ratios are looked for up to here."""


def dispersion(n: npt.ArrayLike, expected: npt.ArrayLike) -> float:
    """Return phi: the variance of counts over their mean, at least 1, pooled with that of usual own weeks.

    Args:
        n: Violations by week (or day), shape (m,).
        expected: What they should be in proportion to, same shape.
    """
    counts, x = np.asarray(n, dtype=np.float64), np.asarray(expected, dtype=np.float64)
    mean = counts.sum() / x.sum() * x
    squares = float(((counts - mean) ** 2 / np.maximum(mean, 1e-9)).sum())
    prior = 1 + PRIOR_SD**2 * float(mean.mean())
    return max(1.0, (squares + PRIOR_DF * prior) / (len(counts) - 1 + PRIOR_DF))


def exact_limits(
    n_before: float, n_after: float, *, exposure_ratio: float, phi: float, confidence: float
) -> tuple[float, float]:
    """Return the limits of theta from the conditional binomial; after no violation 0 and a one-sided upper limit.

    Args:
        n_before: Violations before, above 0.
        n_after: Violations after.
        exposure_ratio: E_A / E_B.
        phi: Dispersion.
        confidence: Confidence level.
    """
    b, a = n_before / phi, n_after / phi
    tail = (1 - confidence) if n_after == 0 else (1 - confidence) / 2
    p_hi = float(betaincinv(a + 1, b, 1 - tail))
    p_lo = float(betaincinv(a, b + 1, tail)) if n_after else 0.0
    lo, hi = (p / (1 - p) / exposure_ratio if p < 1 else math.inf for p in (p_lo, p_hi))
    return lo, hi


def log_e(n_before: float, n_after: float, *, exposure_ratio: float, phi: float, theta: float = 1.0) -> float:
    """Return ln e against a ratio (formula: this module), with E_B = 1."""
    b, a, x = n_before / phi, n_after / phi, exposure_ratio
    return _log_gp(a, 0.5, 0.5 / max(b, 0.5), x) - _log_gp(a, b + 0.5, 1.0, theta * x)


def running_limits(
    n_before: float, n_after: float, *, exposure_ratio: float, phi: float, confidence: float
) -> tuple[float, float | None]:
    """Return the ratios that e < 1 / (1 - confidence) does not reject; no upper end where none is rejected."""
    from scipy.optimize import brentq  # takes a tenth of a second to import, and few changes are compared by counts

    def against(log_theta: float) -> float:
        log_e_value = log_e(n_before, n_after, exposure_ratio=exposure_ratio, phi=phi, theta=math.exp(log_theta))
        return log_e_value + math.log(1 - confidence)

    most = math.log(FARTHEST)
    best = math.log(max(n_after / n_before / exposure_ratio, 1 / FARTHEST))
    if against(best) >= 0:  # not reached: the likeliest ratio is never rejected
        return math.exp(best), math.exp(best)
    lo = 0.0 if n_after == 0 or against(-most) < 0 else math.exp(brentq(against, -most, best))
    hi = None if against(most) < 0 else math.exp(brentq(against, best, most))
    return lo, hi


def _log_gp(n: float, a: float, b: float, x: float) -> float:
    """Return ln GP(n; a, b, x) without the factorial, which both models share."""
    return float(gammaln(a + n) - gammaln(a)) + a * math.log(b / (b + x)) + n * math.log(x / (b + x))
