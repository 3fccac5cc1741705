"""The three quantiles intervals are made of; all from `scipy.special`, which imports faster than `scipy.stats`."""

from __future__ import annotations

import math

from scipy.special import gammaincinv, ndtri, stdtrit


def t_quantile(df: float, *, confidence: float) -> float:
    """Return the two-sided Student t quantile: P(|T| <= t) = `confidence` on `df` degrees of freedom.

    Args:
        df: Degrees of freedom, above 0; need not be whole.
        confidence: Between 0 and 1.
    """
    return float(stdtrit(df, (1 + confidence) / 2))


def z_quantile(*, confidence: float) -> float:
    """Return the two-sided standard normal quantile: P(|Z| <= z) = `confidence`."""
    return float(ndtri((1 + confidence) / 2))


def poisson_limits(n_events: float, *, confidence: float) -> tuple[float, float]:
    """Return exact two-sided limits of a Poisson mean after `n_events` were seen, in events.

    lo solves P(N >= n | lo) = (1 - confidence)/2 and hi solves P(N <= n | hi) = (1 - confidence)/2. Source: Garwood,
    Fiducial limits for the Poisson distribution, Biometrika 28 (1936).

    Args:
        n_events: Events seen, at least 0.
        confidence: Between 0 and 1.
    """
    tail = (1 - confidence) / 2
    lo = 0.0 if n_events == 0 else float(gammaincinv(n_events, tail))
    return lo, float(gammaincinv(n_events + 1, 1 - tail))


def zero_events_limit(*, confidence: float) -> float:
    """Return the one-sided upper limit of a Poisson mean after no event, in events: the rule of three.

    -ln(1 - confidence), rounded up to a tenth: at 95 % the familiar 3.0.

    Args:
        confidence: Between 0 and 1.
    """
    return math.ceil(-10 * math.log(1 - confidence)) / 10
