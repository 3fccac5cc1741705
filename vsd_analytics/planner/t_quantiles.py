"""Quantiles for the browser, which has none: Student's t for any degrees of freedom from 1, and a few fixed ones."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from vsd_analytics.stats.quantiles import poisson_limits, t_quantile, z_quantile, zero_events_limit
from vsd_analytics.stats.rates import MIN_EVENTS

N_NODES: Final = 24
LARGEST_DF: Final = 60.0


def quantiles(confidence: float) -> dict[str, Any]:
    """Return what the page's formulas need at a confidence level.

    ln t as a function of u = 1/df is smooth; the page takes the polynomial through `N_NODES` Chebyshev nodes of
    u from 1/60 to 1 (barycentric formula, weights (-1)^i sin), which is right to ten digits there.

    Args:
        confidence: Between 0 and 1.

    Returns:
        `u`, `w`, `lnT`: nodes, weights and values; `z`: the normal quantile; `zero`: the rule of three.
    """
    angle = (2 * np.arange(N_NODES) + 1) * math.pi / (2 * N_NODES)
    low = 1 / LARGEST_DF
    u = low + (1 - low) * (1 + np.cos(angle)) / 2
    weights = (-1.0) ** np.arange(N_NODES) * np.sin(angle)
    return {
        "u": [float(f"{v:.17g}") for v in u],
        "w": [float(v) for v in weights],
        "lnT": [math.log(t_quantile(1 / float(v), confidence=confidence)) for v in u],
        "z": z_quantile(confidence=confidence),
        "zero": zero_events_limit(confidence=confidence),
    }


def few_events(confidence: float) -> list[tuple[float, float]]:
    """Return exact Poisson limits after 0, 1, ... violations, as far as changes use them."""
    return [poisson_limits(n, confidence=confidence) for n in range(MIN_EVENTS)]
