"""How many weeks a change must be watched until a given effect shows, from how the area's weeks differ.

The weeks before the change are known: m log ratios of the area beside the comparison areas with sum of squares Q. What
is not known is drawn, as the right Haar prior of the running verdict has it: sigma^2 = Q / chi^2_(m-1), weeks still to
come before the change, and weeks after it, N(mu + ln theta, sigma^2). The power after n weeks is the share of draws in
which the e-value (`vsd_analytics.stats.running_verdict`) has reached 1/(1 - confidence) in the effect's direction, and
the estimate lies farther from no effect than the spread of the comparison areas' own shifts
(`vsd_analytics.stats.placebos`), whose weeks are drawn with the standard deviation that each has beside their mean.
With fewer than four areas that spread is wide: beside one area only falls of more than 71 % are ever clear. The draws
have a fixed seed: the same weeks give the same plan.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.stats.comparison_weights import day_influence, weekly_log_rates, weekly_log_ratios
from vsd_analytics.stats.period_days import Floats, Ints, PeriodDays, of_days
from vsd_analytics.stats.placebos import spread_half_width
from vsd_analytics.stats.running_verdict import MAX_REFERENCE_WEEKS, MIN_REFERENCE_WEEKS, log_e_values

DRAWS: Final = 4000
SEED: Final = 11
MIN_SEEN: Final = 2
"""Areas that tell how areas differ beside their mean."""
PREDICTED: Final = (0.025, 0.975)
"""Quantiles of the estimate a plan predicts."""


@dataclass(frozen=True, slots=True)
class Variation:
    """How the weekly log ratio of an area beside its comparison areas differs from week to week.

    Attributes:
        log_ratios: Of the weeks known, oldest first, at most twelve.
        sd: Standard deviation of a week.
        sd_days: The part that differences between days explain.
        sd_weeks: The part beyond: sd^2 = sd_days^2 + sd_weeks^2 where that is positive, else 0.
        areas_sd: Standard deviation of a week of each comparison area beside their mean; empty = only the evidence of
            the area itself counts.
    """

    log_ratios: tuple[float, ...]
    sd: float
    sd_days: float
    sd_weeks: float
    areas_sd: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class WeeksNeeded:
    """One way to run an experiment.

    Attributes:
        weeks_before: Reference weeks, those known already included.
        weeks_to_wait: Of these, weeks still to come before the change is made.
        weeks_after: Weeks after the change; None where the longest allowed is not enough.
        power: Chance of a clear verdict by then.
        theta_lo, theta_hi: Where the estimate of the effect will lie in 95 of 100 cases, if the effect is as planned.
    """

    weeks_before: int
    weeks_to_wait: int
    weeks_after: int | None
    power: float
    theta_lo: float
    theta_hi: float


def variation_of(history: PeriodDays, weights: Floats | None) -> Variation | None:
    """Return how an area's weeks differ, or None with fewer than four weeks with something counted.

    Args:
        history: The days before, whole weeks.
        weights: Of the comparison areas; None = taken together as one.
    """
    weeks, y = weekly_log_ratios(history, weights)
    known = np.isfinite(y)
    weeks, y = weeks[known][-MAX_REFERENCE_WEEKS:], y[known][-MAX_REFERENCE_WEEKS:]
    if len(y) < MIN_REFERENCE_WEEKS:
        return None
    variance = float(np.var(y, ddof=1))
    by_days = min(variance, _by_days(history, weeks.tolist(), weights))
    parts = math.sqrt(variance), math.sqrt(by_days), math.sqrt(variance - by_days)
    return Variation(tuple(y.tolist()), *parts, areas_sd=_areas_sd(history, weeks))


def weeks_needed(
    variation: Variation,
    theta: float,
    *,
    power: float = 0.8,
    weeks_max: int = 26,
    weeks_before: int | None = None,
    confidence: float = 0.95,
) -> WeeksNeeded:
    """Return the weeks after a change until its effect is clear with a given power.

    Args:
        variation: Of the weeks known.
        theta: The effect looked for: 0.85 = 15 % less. Above 0, not 1.
        power: Chance of a clear verdict asked for.
        weeks_max: Weeks after the change that one is ready to wait.
        weeks_before: Reference weeks; None = those known.
        confidence: Of the verdict.

    Raises:
        ValueError: No effect, or fewer reference weeks than are known.
    """
    known = len(variation.log_ratios)
    m = known if weeks_before is None else weeks_before
    if theta <= 0 or theta == 1 or m < known:
        raise ValueError("an experiment needs an effect, and at least the weeks that are known")
    reached, estimates = _draws(variation, math.log(theta), m, weeks_max, confidence)
    enough = np.flatnonzero(reached >= power)
    n = int(enough[0]) + 1 if len(enough) else None
    at = (n or weeks_max) - 1
    lo, hi = np.exp(np.quantile(estimates[:, at], PREDICTED)).tolist()
    return WeeksNeeded(m, m - known, n, float(reached[at]), lo, hi)


def choices(
    variation: Variation, theta: float, *, power: float = 0.8, weeks_max: int = 26, confidence: float = 0.95
) -> tuple[WeeksNeeded, ...]:
    """Return what waiting before the change would save after it: reference weeks from those known to twelve."""
    known = len(variation.log_ratios)
    return tuple(
        weeks_needed(variation, theta, power=power, weeks_max=weeks_max, weeks_before=m, confidence=confidence)
        for m in sorted({known, *range(known + 2, MAX_REFERENCE_WEEKS + 1, 2), max(known, MAX_REFERENCE_WEEKS)})
    )


def _draws(
    variation: Variation, log_theta: float, n_reference: int, weeks_max: int, confidence: float
) -> tuple[npt.NDArray[np.float64], Floats]:
    """Return the power after each week, and estimates of ln theta, shape (draws, weeks)."""
    rng = np.random.default_rng(SEED)
    known = len(variation.log_ratios)
    squares = variation.sd**2 * (known - 1)
    sigma = np.sqrt(squares / rng.chisquare(known - 1, DRAWS))
    coming = n_reference - known
    if coming:
        # the mean of the weeks known is 0 without loss; theirs and the coming ones' mean and squares
        mu = sigma * rng.normal(size=DRAWS) / math.sqrt(known)
        new = mu[:, None] + sigma[:, None] * rng.normal(size=(DRAWS, coming))
        mean = new.sum(axis=1) / n_reference
        total = squares + (new**2).sum(axis=1) - n_reference * mean**2
    else:
        mu, mean, total = sigma * rng.normal(size=DRAWS) / math.sqrt(known), np.zeros(DRAWS), np.full(DRAWS, squares)
    weeks = mu[:, None] + log_theta + sigma[:, None] * rng.normal(size=(DRAWS, weeks_max))
    log_e = log_e_values(n_reference, mean, total, weeks)
    estimates = np.cumsum(weeks, axis=1) / np.arange(1, weeks_max + 1) - mean[:, None]
    is_clear = (log_e >= -math.log(1 - confidence)) & (np.sign(estimates) == np.sign(log_theta))
    if variation.areas_sd:
        scale = sigma / variation.sd if variation.sd else np.ones(DRAWS)
        is_clear &= np.abs(estimates) > _spread(variation.areas_sd, estimates, scale, n_reference, confidence, rng)
    return np.asarray(np.maximum.accumulate(is_clear, axis=1).mean(axis=0)), estimates


def _spread(
    areas_sd: tuple[float, ...],
    estimates: Floats,
    scale: Floats,
    n_reference: int,
    confidence: float,
    rng: np.random.Generator,
) -> Floats:
    """Return draws of how far an estimate must lie from no effect to stand out, shape (draws, weeks)."""
    n_areas, n_weeks = len(areas_sd), estimates.shape[1]
    sd = scale[:, None, None] * np.array(areas_sd)[None, :, None]
    before = rng.normal(size=(DRAWS, n_areas, 1)) / math.sqrt(n_reference)
    since = np.cumsum(rng.normal(size=(DRAWS, n_areas, n_weeks)), axis=2) / np.arange(1, n_weeks + 1)
    shifts = sd * (since - before)
    return spread_half_width(estimates + np.median(shifts, axis=1), shifts, confidence=confidence)


def _areas_sd(history: PeriodDays, weeks: Ints) -> tuple[float, ...]:
    """Return the standard deviation of a week of each comparison area beside their mean, of areas seen every week."""
    week, _, others = weekly_log_rates(history)
    others = others[:, np.isin(week, weeks)]
    seen = others[np.isfinite(others).all(axis=1)]
    if len(seen) < MIN_SEEN:
        return (0.0,) * len(others)
    apart = seen - seen.mean(axis=0)
    own = apart.std(axis=1, ddof=1) / math.sqrt(1 - 1 / len(seen))
    return tuple(own.tolist()) + (float(own.mean()),) * (len(others) - len(seen))


def _by_days(history: PeriodDays, weeks: list[int], weights: Floats | None) -> float:
    """Return the variance of a week's log ratio that differences between days explain, weekday means taken out."""
    by_week = [of_days(history, history.week == week) for week in weeks]
    by_day = [day_influence(p, weights) for p in by_week]
    weekday = np.concatenate([p.weekday for p in by_week])
    influence = np.concatenate(by_day)
    n_days = np.concatenate([np.full(len(i), len(i), dtype=np.float64) for i in by_day])
    for day in np.unique(weekday):
        influence[weekday == day] -= influence[weekday == day].mean()
    factor = np.divide(n_days, n_days - 1, out=np.zeros_like(n_days), where=n_days > 1)
    return float((factor * influence**2).sum()) / (len(weeks) - 1)
