"""Days with and without a change in turn (a switchback experiment): the effect, its test and its interval.

Days come in pairs of one weekday in two successive weeks. A coin decides for each pair which of its days has the
change. With y = violation time per open hour of the area over that of its comparison areas, pair i gives

    d_i = ln y_i(with) - ln y_i(without),    ln theta = mean d_i.

If the change multiplies a day by theta and nothing else, the coins alone give each d_i - ln theta its sign. Hence a
mean of d over any set A of pairs is as likely to lie above ln theta as below it, and the sorted means over all
2^n - 1 sets cut the line into 2^n parts of equal probability (typical values, Hartigan 1969,
https://doi.org/10.1080/01621459.1969.10501057). The interval of ln theta goes from the K-th smallest to the K-th
largest of them, K = floor(alpha/2 2^n); it holds exactly the ln theta which the randomisation test (Fisher) of two
one-sided levels alpha/2 does not reject. Season, weekdays and days that resemble each other cannot make it wrong, since
it rests on the coins.

Where 2^n is above 20,000, 19,999 sets are drawn with a fixed seed; the test holds its level for drawn sets, too
(Hemerik & Goeman 2018, https://doi.org/10.1007/s11749-017-0571-1). Where a day has no violation, ln y does not exist:
ln theta of a set is then ln(sum y(with) / sum y(without)), for all sets.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason, State, Verdict
from vsd_analytics.stats.estimates import verdict_of
from vsd_analytics.stats.period_days import Bools, Floats

MOST_SETS: Final = 20_000
"""Assignments up to which all of them are tried."""
POWER_SETS: Final = 2000
"""The same in each of the draws that give the power."""
DRAWS: Final = 1000
SEED: Final = 11
MIN_PAIRS: Final = 7
"""Pairs of days that a test needs: a week of each."""
ROUNDING: Final = 1e-12
"""How far a mean of d is from 0 by rounding, where days are alike."""
AT_ONCE: Final = 100
"""Worlds whose sets are in memory at once."""


@dataclass(frozen=True, slots=True)
class SwitchbackEffect:
    """What days with a change differ by from days without.

    Attributes:
        value, lo, hi: Ratio of with over without and its interval; None where there is none.
        p_value: Two-sided, of the randomisation test of no effect.
        n_pairs: Pairs of days read.
        is_exact: All assignments were tried.
        is_by_totals: A day had no violation, so the ratio is that of totals.
        verdict: What the interval allows to say.
        state, reason: Why there is no effect.
    """

    value: float | None
    lo: float | None
    hi: float | None
    p_value: float | None
    n_pairs: int
    is_exact: bool = True
    is_by_totals: bool = False
    verdict: Verdict = "too_little_data"
    state: State = "ok"
    reason: Reason | None = None


@dataclass(frozen=True, slots=True)
class SwitchbackPower:
    """What a test of days in turn will show if the effect is as planned.

    Attributes:
        power: Chance of a clear verdict in the effect's direction.
        theta_lo, theta_hi: Where the ratio will be measured in 95 of 100 cases.
    """

    power: float
    theta_lo: float
    theta_hi: float


def coins(n_pairs: int, *, seed: int) -> Bools:
    """Return for each pair whether its first day has the change; the same seed gives the same days."""
    return np.asarray(np.random.default_rng(seed).random(n_pairs) < 1 / 2)


def pairs_needed(confidence: float) -> int:
    """Return the fewest pairs of days from which an interval of this confidence has two ends, 7 at least."""
    return max(MIN_PAIRS, math.ceil(math.log2(2 / (1 - confidence)) - 1e-9))


def switchback_effect(y: Floats, *, confidence: float = 0.95, about_same_share: float = 0.05) -> SwitchbackEffect:
    """Return the effect of a change that was there on one day of each pair.

    Args:
        y: Violation time per open hour, over that of the comparison areas, shape (n_pairs, 2): with, without.
        confidence: Of the interval.
        about_same_share: Changes up to this share do not matter.
    """
    n = len(y)
    least = pairs_needed(confidence)
    if n < least:
        reason = Reason("switchback.few_days", least=2 * least, has=2 * n)
        return SwitchbackEffect(None, None, None, None, n, state="not_enough_data", reason=reason)
    if not (y > 0).any():
        reason = Reason("switchback.no_violation", days=2 * n)
        return SwitchbackEffect(None, None, None, None, n, state="not_enough_data", reason=reason)
    (log_theta,), (log_lo,), (log_hi,), (p,) = log_effects(y[None], confidence=confidence)
    value, lo, hi = (float(np.exp(v)) if v < np.inf else None for v in (log_theta, log_lo, log_hi))
    verdict = verdict_of(lo, hi, about_same_share=about_same_share)
    is_exact, is_by_totals = 2**n <= MOST_SETS, bool((y == 0).any())
    return SwitchbackEffect(
        value, lo, hi, float(p), n, is_exact, is_by_totals, verdict,
        state="not_enough_data" if value is None else "ok",
        reason=Reason("switchback.none_without") if value is None else None,
    )  # fmt: skip


def switchback_power(
    past: Floats, theta: float, *, n_pairs: int, confidence: float = 0.95, seed: int = SEED
) -> SwitchbackPower:
    """Return the power of a test of days in turn, from pairs of days before the change.

    Each of 1000 draws takes pairs of the past with replacement, tosses their coins, and multiplies the days with the
    change by theta.

    Args:
        past: y of two days of one weekday in successive weeks without a change, shape (n_past, 2).
        theta: The effect looked for: 0.7 = 30 % less.
        n_pairs: Pairs of days of the test.
        confidence: Of the interval.
        seed: Of the draws.
    """
    rng = np.random.default_rng(seed)
    y = rng.permuted(past[rng.integers(0, len(past), (DRAWS, n_pairs))], axis=2)
    y[:, :, 0] *= theta
    log_theta, lo, hi, _ = log_effects(y, confidence=confidence, most=POWER_SETS)
    is_clear = hi < 0 if theta < 1 else lo > 0
    known = log_theta[np.isfinite(log_theta)]
    ends = np.exp(np.quantile(known, (0.025, 0.975))).tolist() if len(known) else (theta, theta)
    return SwitchbackPower(float(is_clear.mean()), *ends)


def log_effects(y: Floats, *, confidence: float, most: int = MOST_SETS) -> tuple[Floats, Floats, Floats, Floats]:
    """Return ln theta, its limits and the p-value of many tests at once, each of shape (n_tests,).

    Args:
        y: With and without, shape (n_tests, n_pairs, 2), each test of `pairs_needed` pairs at least.
        confidence: Of the intervals.
        most: Assignments up to which all are tried.
    """
    sets = _sets(y.shape[1], most)
    parts = [_of(y[k : k + AT_ONCE], sets, confidence=confidence) for k in range(0, len(y), AT_ONCE)]
    value, lo, hi, p = (np.concatenate(column) for column in zip(*parts, strict=True))
    return value, lo, hi, p


def _of(y: Floats, sets: Floats, *, confidence: float) -> tuple[Floats, Floats, Floats, Floats]:
    n_parts = len(sets) + 1
    k = math.floor((1 - confidence) / 2 * n_parts + 1e-9)
    is_whole = (y > 0).all(axis=(1, 2))
    low, high = (np.empty((len(y), len(sets))) for _ in range(2))
    value = np.empty(len(y))
    if is_whole.any():
        d = np.log(y[is_whole, :, 0]) - np.log(y[is_whole, :, 1])
        low[is_whole] = high[is_whole] = d @ sets.T / sets.sum(axis=1)
        value[is_whole] = d.mean(axis=1)
    if not is_whole.all():
        sums = y[~is_whole].transpose(0, 2, 1) @ sets.T
        # a set without any violation tells nothing: it counts on both sides
        low[~is_whole], high[~is_whole] = _log_ratio(sums, none=-np.inf), _log_ratio(sums, none=np.inf)
        value[~is_whole] = _log_ratio(y[~is_whole].sum(axis=1)[..., None], none=np.inf)[:, 0]
    lo = np.partition(low, k - 1, axis=1)[:, k - 1]
    hi = np.partition(high, len(sets) - k, axis=1)[:, len(sets) - k]
    below, above = (low <= ROUNDING).sum(axis=1) + 1, (high >= -ROUNDING).sum(axis=1) + 1
    return value, lo, hi, np.minimum(1.0, 2 * np.minimum(below, above) / n_parts)


def _log_ratio(sums: Floats, *, none: float) -> Floats:
    """Return ln of with over without, sums of shape (n_tests, 2, n_sets); `none` where both are 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.log(sums[:, 0]) - np.log(sums[:, 1])
    return np.where(np.isnan(ratio), none, ratio)


@lru_cache(maxsize=2)
def _sets(n_pairs: int, most: int) -> Floats:
    """Return sets of pairs, none empty, shape (n_sets, n_pairs): all, or as many drawn as `most` allows."""
    if 2**n_pairs <= most:
        number = np.arange(1, 2**n_pairs)
        return np.asarray(number[:, None] >> np.arange(n_pairs) & 1, dtype=np.float64)
    drawn = np.random.default_rng(SEED).integers(0, 2, (most - 1, n_pairs)).astype(np.float64)
    return drawn[drawn.any(axis=1)]
