"""How many others a person meets: quantiles of whole numbers, with intervals from how days differ."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason, State
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.durations import N_BOOT, quantiles_of_draws
from vsd_analytics.stats.quantiles import t_quantile

QUANTILES: Final = (0.5, 0.9)
MIN_TRACKS: Final = 30
"""With fewer people a 90 % quantile is the number of one of the three highest."""


@dataclass(frozen=True, slots=True)
class CountQuantile:
    """A quantile of whole numbers.

    Attributes:
        q: Which, 0 to 1.
        value: The smallest number that at least a share q does not exceed; None without enough people.
        lo, hi: Limits of its interval, at least 0; None without one. Both equal the value where all days agree.
    """

    q: float
    value: float | None
    lo: float | None
    hi: float | None


@dataclass(frozen=True, slots=True)
class CountQuantiles:
    """Median and 90 % quantile of a number that each person has.

    Attributes:
        quantiles: In the order of `QUANTILES`.
        n: People.
        n_days: Days with any.
        state, reason: "ok" when they have an interval; else why not.
    """

    quantiles: tuple[CountQuantile, ...]
    n: int
    n_days: int
    state: State
    reason: Reason | None


def count_quantiles(
    number: npt.ArrayLike,
    day: npt.ArrayLike,
    *,
    seed: int,
    n_boot: int = N_BOOT,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
) -> CountQuantiles:
    """Return median and 90 % quantile of whole numbers, with limits value +- t_{D-1} se.

    se is the standard deviation of the quantile over `n_boot` draws of D days out of the D days with replacement (block
    bootstrap), times sqrt(D / (D-1)). It is not taken of logarithms, as that of durations is: a number may be 0.

    Args:
        number: Number of each person, shape (n,).
        day: Day of each, whole numbers, same shape.
        seed: Of the bootstrap.
        n_boot: Draws.
        confidence: Confidence level.
        min_days: Days an interval needs.
    """
    values, of_day = np.asarray(number, dtype=np.float64), np.asarray(day, dtype=np.int64)
    days, code = np.unique(of_day, return_inverse=True)
    n, n_days = len(values), len(days)
    if n < MIN_TRACKS:
        reason = Reason("met.few", least=MIN_TRACKS, has=n)
        none = tuple(CountQuantile(q, None, None, None) for q in QUANTILES)
        return CountQuantiles(none, n, n_days, "not_enough_data", reason)
    order = np.argsort(values, kind="stable")
    ranked, code = values[order], code[order]
    quantiles = quantiles_of_draws(ranked, code, np.ones((1, n_days), dtype=np.int64), QUANTILES)[0].tolist()
    if n_days < min_days:
        reason = Reason("level.days", least=min_days, has=n_days)
        alone = tuple(CountQuantile(q, v, None, None) for q, v in zip(QUANTILES, quantiles, strict=True))
        return CountQuantiles(alone, n, n_days, "not_enough_data", reason)
    drawn = np.random.default_rng(seed).integers(0, n_days, size=(n_boot, n_days))
    times = np.stack([np.bincount(chosen, minlength=n_days) for chosen in drawn])
    draws = quantiles_of_draws(ranked, code, times, QUANTILES)
    se = np.std(draws, axis=0, ddof=1) * math.sqrt(n_days / (n_days - 1))
    half = (t_quantile(n_days - 1, confidence=confidence) * se).tolist()
    limits = zip(QUANTILES, quantiles, half, strict=True)
    return CountQuantiles(
        tuple(CountQuantile(q, v, max(0.0, v - h), v + h) for q, v, h in limits), n, n_days, "ok", None
    )
