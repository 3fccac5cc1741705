"""How long violations last (M10), how close people come (M11), and close contacts (M12).

Durations are those of violations, episodes of at least `episode_min_s`: of shorter ones an engine that looks seldom
loses many (docs/statistics.md), and their median would be the engine's, not the place's. A violation that begins or
ends with the life of one of its tracks was seen in part only; where that is so of more than a fifth, all durations are
"at least".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason, State
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.groups import ShareEstimate, share_by_days
from vsd_analytics.stats.quantiles import t_quantile

MIN_VIOLATIONS: Final = 30
"""Fewer have no durations and no distances (catalogue, M10 and M11)."""
CUT_SHARE: Final = 0.2
"""Where more violations were seen in part only, durations are "at least"."""
N_BOOT: Final = 999
"""Draws of the bootstrap: more change an interval by less than its rounding."""
CONTACT_WINDOW_S: Final = 86_400.0
"""A close contact is 15 minutes (`contact_s`) within 24 hours: operational definition of the CDC, 2020."""
LONG_LIVED_SHARE: Final = 0.5
"""Share of violation time that ids must have that can be followed for `contact_s`."""


@dataclass(frozen=True, slots=True)
class QuantileEstimate:
    """A quantile of durations with its interval from how days differ.

    Attributes:
        q: Which, 0 to 1.
        value: The quantile, seconds; None without enough violations.
        lo, hi: Limits of its interval; None without one.
    """

    q: float
    value: float | None
    lo: float | None
    hi: float | None


@dataclass(frozen=True, slots=True)
class Durations:
    """How long violations last (M10).

    Attributes:
        median, p90: Quantiles of their durations.
        long_share: Share that lasts at least `sustained_s`.
        n: Violations: the denominator.
        n_days: Days with any.
        cut_share: Share that was seen in part only; None when not known.
        is_at_least: Every duration is "at least", because more than `CUT_SHARE` were seen in part only.
        state, reason: "ok" when the figures have values and intervals.
    """

    median: QuantileEstimate
    p90: QuantileEstimate
    long_share: ShareEstimate
    n: int
    n_days: int
    cut_share: float | None
    is_at_least: bool
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class DistanceShare:
    """How much of the person-time in violation was spent so far from the nearest other person.

    Attributes:
        from_m, to_m: Distance, lower end inclusive.
        person_s: Person-seconds.
        share: Of all person-seconds in violation, 0 to 1; None when there is not enough.
    """

    from_m: float
    to_m: float
    person_s: float
    share: float | None


@dataclass(frozen=True, slots=True)
class Distances:
    """Distances to the nearest person, weighted by time (M11).

    Attributes:
        shares: Every class, nearest first.
        person_s: Person-seconds in violation: the denominator.
        state, reason: "ok", or why there are no shares.
    """

    shares: tuple[DistanceShare, ...]
    person_s: float
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class CloseContacts:
    """Pairs of people who were in violation for 15 minutes within 24 hours (M12).

    Attributes:
        n: Such pairs, at least: people whose id changes are missed; None when not measurable.
        n_pairs: Pairs with any violation record.
        long_lived_share: Share of violation time in pairs whose ids can both be followed for 15 minutes; None without.
        state, reason: "ok" where ids live long enough; else why not.
    """

    n: int | None
    n_pairs: int
    long_lived_share: float | None
    state: State
    reason: Reason | None


def durations(
    duration_s: npt.ArrayLike,
    day: npt.ArrayLike,
    is_cut: npt.ArrayLike | None,
    *,
    seed: int,
    n_days: int | None = None,
    n_boot: int = N_BOOT,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
    sustained_s: float = DEFAULTS.sustained_s,
) -> Durations:
    """Return median, 90 % quantile and share of long violations, with intervals from how days differ.

    Quantiles: value exp(+-t_{D-1} se), se the standard deviation of ln quantile over `n_boot` draws of D days out of
    the D days with replacement (block bootstrap), times sqrt(D / (D-1)). Percentiles of the draws themselves are too
    narrow for a week. The share: `share_by_days`.

    Args:
        duration_s: Duration of each violation, shape (n,).
        day: Day of each, whole numbers, same shape.
        is_cut: Whether it begins or ends with the life of one of its tracks, same shape; None = not known.
        seed: Of the bootstrap.
        n_days: Recorded days, those without violations included; None = those with any.
        n_boot: Draws.
        confidence: Confidence level.
        min_days: Days with violations an interval needs.
        sustained_s: Length from which a violation is long.
    """
    seconds, of_day = np.asarray(duration_s, dtype=np.float64), np.asarray(day, dtype=np.int64)
    days, code = np.unique(of_day, return_inverse=True)
    with_any, n = len(days), len(seconds)
    cut_share = None if is_cut is None or not n else float(np.asarray(is_cut, dtype=np.bool_).mean())
    at_least = cut_share is not None and cut_share > CUT_SHARE
    if n < MIN_VIOLATIONS:
        reason = Reason("violations.few", least=MIN_VIOLATIONS, has=n)
        unknown = ShareEstimate(None, None, None, 0, n, with_any, "not_enough_data", reason)
        return Durations(
            *_without_interval(None, None), unknown, n, with_any, cut_share, at_least, "not_enough_data", reason
        )
    per_day = np.bincount(code, minlength=with_any)
    long_per_day = np.bincount(code, weights=seconds >= sustained_s, minlength=with_any)
    share = share_by_days(long_per_day, per_day, confidence=confidence, min_days=min_days)
    order = np.argsort(seconds, kind="stable")
    ranked, code = seconds[order], code[order]
    quantiles = [_quantile(ranked, q) for q in (0.5, 0.9)]
    if with_any < min_days:
        reason = Reason("violations.days", least=min_days, has=with_any)
        return Durations(
            *_without_interval(*quantiles), share, n, with_any, cut_share, at_least, "not_enough_data", reason
        )
    total = max(with_any, n_days or 0)
    drawn = np.random.default_rng(seed).integers(0, total, size=(n_boot, total))
    times = np.stack([np.bincount(days, minlength=total)[:with_any] for days in drawn])
    draws = quantiles_of_draws(ranked, code, times, (0.5, 0.9))
    se = np.nanstd(np.log(draws), axis=0, ddof=1) * math.sqrt(with_any / (with_any - 1))
    half = t_quantile(with_any - 1, confidence=confidence) * se
    median, p90 = (
        QuantileEstimate(q, v, v * math.exp(-h), v * math.exp(h))
        for q, v, h in zip((0.5, 0.9), quantiles, half.tolist(), strict=True)
    )
    return Durations(median, p90, share, n, with_any, cut_share, at_least, "ok", None)


def distance_shares(
    distance_mm: npt.ArrayLike, person_s: npt.ArrayLike, *, distance_m: float, n_violations: int | None
) -> Distances:
    """Return which share of the person-time in violation is how close to the nearest person.

    Args:
        distance_mm: Distance to the nearest person, shape (n,).
        person_s: Person-seconds at that distance, same shape.
        distance_m: The legal distance: only what is strictly closer is a violation.
        n_violations: Violations counted; None when they cannot be (no track ids).
    """
    mm, seconds = np.asarray(distance_mm, dtype=np.int64), np.asarray(person_s, dtype=np.float64)
    limit_mm = round(distance_m * 1000)
    edges = [*(e for e in (0, 500, 1000, 1500) if e < limit_mm), limit_mm]
    total_s = float(seconds[mm < limit_mm].sum())
    state: State = "ok"
    reason: Reason | None = None
    if n_violations is not None and n_violations < MIN_VIOLATIONS:
        state, reason = "not_enough_data", Reason("violations.few", least=MIN_VIOLATIONS, has=n_violations)
    elif total_s <= 0:
        state, reason = "not_enough_data", Reason("nobody.in_violation")
    shares = []
    for low, high in pairwise(edges):
        own_s = float(seconds[(mm >= low) & (mm < high)].sum())
        shares.append(DistanceShare(low / 1000, high / 1000, own_s, own_s / total_s if reason is None else None))
    return Distances(tuple(shares), total_s, state, reason)


def close_contacts(
    pair: npt.ArrayLike,
    started_s: npt.ArrayLike,
    duration_s: npt.ArrayLike,
    is_long_lived: npt.ArrayLike,
    *,
    contact_s: float = DEFAULTS.contact_s,
) -> CloseContacts:
    """Return how many pairs were in violation for `contact_s` within 24 hours: a lower bound.

    A pair counts when the durations of its episodes that begin within 24 hours before the end of one of them sum to
    `contact_s`. Episodes of any length count.

    Args:
        pair: Pair of each episode, whole numbers, shape (n,).
        started_s: Its start, seconds, same shape.
        duration_s: Its duration, same shape.
        is_long_lived: Whether both ids can be followed for `contact_s`, same shape.
        contact_s: Seconds of a close contact.
    """
    of_pair, start, last = (np.asarray(v, dtype=np.float64) for v in (pair, started_s, duration_s))
    lives = np.asarray(is_long_lived, dtype=np.bool_)
    if not len(of_pair):
        return CloseContacts(None, 0, None, "not_enough_data", Reason("violations.no_record"))
    order = np.lexsort((start, of_pair))
    of_pair, start, last, lives = of_pair[order], start[order] - start.min(), last[order], lives[order]
    n_pairs, share = len(np.unique(of_pair)), float(last[lives].sum() / last.sum())
    if share < LONG_LIVED_SHARE:
        reason = Reason("contacts.short_ids", share=share, minutes=contact_s / 60, least=LONG_LIVED_SHARE)
        return CloseContacts(None, n_pairs, share, "not_measurable", reason)
    reach = float(start.max() + last.max() + 2 * CONTACT_WINDOW_S)
    key = np.unique(of_pair, return_inverse=True)[1] * reach
    begin = np.searchsorted(key + start, key + np.maximum(start + last - CONTACT_WINDOW_S, 0.0), side="left")
    summed = np.concatenate(([0.0], np.cumsum(last)))
    within = summed[1:] - summed[np.minimum(begin, np.arange(len(of_pair)))]
    n = len(np.unique(of_pair[within >= contact_s]))
    return CloseContacts(n, n_pairs, share, "ok", Reason("contacts.at_least"))


def _without_interval(median_s: float | None, p90_s: float | None) -> tuple[QuantileEstimate, QuantileEstimate]:
    return QuantileEstimate(0.5, median_s, None, None), QuantileEstimate(0.9, p90_s, None, None)


def _quantile(ranked: npt.NDArray[np.float64], q: float) -> float:
    """Return the smallest value that at least a share q is at most."""
    return float(ranked[min(int(np.searchsorted(np.arange(1, len(ranked) + 1), q * len(ranked))), len(ranked) - 1)])


def quantiles_of_draws(
    ranked: npt.NDArray[np.float64], day: npt.NDArray[np.int64], times: npt.NDArray[np.int64], shares: tuple[float, ...]
) -> npt.NDArray[np.float64]:
    """Return the smallest value that at least each share is at most, by draw: shape (n_draws, n_shares).

    All draws halve their range of ranks together, so that a draw costs days * log(n), not n.

    Args:
        ranked: Values in rising order, shape (n,).
        day: Day of each, shape (n,).
        times: How often each day was drawn, shape (n_draws, n_days).
        shares: Quantiles asked for; NaN where a draw holds no value.
    """
    until = np.zeros((len(ranked) + 1, times.shape[1]), dtype=np.int64)  # values of each day among the first so many
    np.cumsum(day[:, None] == np.arange(times.shape[1]), axis=0, out=until[1:])
    n_drawn = times @ until[-1]
    quantiles = np.full((len(times), len(shares)), np.nan)
    for k, share in enumerate(shares):
        low, high = np.zeros(len(times), dtype=np.int64), np.full(len(times), len(ranked) - 1, dtype=np.int64)
        while (low < high).any():
            middle = (low + high) // 2
            is_reached = np.einsum("ij,ij->i", times, until[middle + 1]) >= share * n_drawn
            low, high = np.where(is_reached, low, middle + 1), np.where(is_reached, middle, high)
        quantiles[:, k] = np.where(n_drawn > 0, ranked[high], np.nan)
    return quantiles
