"""Did a redesign work: the change of one area beside the change of areas that were left alone.

theta is the ratio of rates (violations per person-hour) after / before in the changed area, over the same ratio in the
comparison areas taken together, so that what moved the whole site (season, weather, crowds) cancels:

    ln theta = [ln r_tA - ln r_cA] - [ln r_tB - ln r_cB],

B before, A after, t the changed ("treated") area, c the comparison areas. The day is the unit, as everywhere: with the
influence of a day on one period's log ratio, i_d = (n_td - r_t x_td)/(X_t r_t) - (n_cd - r_c x_cd)/(X_c r_c), the
variance comes from how days differ. Days of equal weekday are paired where both periods have equally many
(var = D/(D-1) sum (i_dA - i_dB)^2, df = D-1); else each period gives its own, weekdays taken out of those that have
them at least twice, with Welch's degrees of freedom. Days may agree by luck: the interval is never narrower than that
of independent (Poisson) violations. Coverage and power by simulation: docs/statistics.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.result import Reason, State, Verdict
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.estimates import verdict_of
from vsd_analytics.stats.quantiles import t_quantile, z_quantile
from vsd_analytics.stats.shrinkage import between_places

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

MIN_PLACEBO_AREAS: Final = 4
"""Fewer areas that were left alone have no spread to compare a change with."""
MIN_TREND_WEEKS: Final = 3
"""Two weeks always lie on a line."""
MIN_SHRUNKEN_EVENTS: Final = 5
"""Areas with fewer violations have no log rate precise enough for the mean of all areas."""
MAX_UNPAIRED: Final = 0.25
"""Days are paired by weekday unless that would drop more than this share of the longer period."""
TWICE: Final = 2
"""Weekday means are taken out only where each weekday was recorded at least twice."""


@dataclass(frozen=True, slots=True, eq=False)
class PeriodDays:
    """One period, day by day.

    Attributes:
        n: Violations in the changed area, shape (n_days,).
        x_h: Person-hours there, same shape; 0 or NaN = not recorded.
        comparison_n: Violations in each comparison area, shape (n_areas, n_days).
        comparison_x_h: Person-hours there, same shape; 0 or NaN = not recorded.
        weekday: Weekday of each day, shape (n_days,), any integers.
        week: Number of the week each day lies in, same shape.
    """

    n: Floats
    x_h: Floats
    comparison_n: Floats
    comparison_x_h: Floats
    weekday: Ints
    week: Ints


@dataclass(frozen=True, slots=True)
class PriorTrend:
    """How the ratio of the changed area to the comparison areas moved per week before the change.

    Attributes:
        per_week: Relative change per week, exp(slope) - 1.
        lo, hi: Its interval.
        n_weeks: Weeks it was fitted over.
        is_flat: The interval holds 0, so that the comparison areas are a credible comparison.
    """

    per_week: float
    lo: float
    hi: float
    n_weeks: int
    is_flat: bool


@dataclass(frozen=True, slots=True)
class Shrunken:
    """The effect when the changed area was chosen for its bad figure, so that part of it would have passed by itself.

    Attributes:
        theta, lo, hi: As in `BeforeAfter`, from the before-rate pulled towards the areas' mean.
        weight: What the area's own before-rate counts, 0 to 1; the rest is the mean of all areas.
    """

    theta: float
    lo: float
    hi: float
    weight: float


@dataclass(frozen=True, slots=True)
class BeforeAfter:
    """What a change did to an area (M27).

    Attributes:
        theta: Ratio of rates after / before relative to the comparison areas; 0.8 = 20 % fewer violations per
            person-hour than without the change. None when it cannot be given.
        lo, hi: Its interval.
        log_se, df: Standard error of ln theta and its degrees of freedom.
        alone: Ratio after / before of the changed area by itself.
        comparison: Ratio after / before of the comparison areas taken together.
        n_before, n_after: Violations in the changed area.
        exposure_before_h, exposure_after_h: Person-hours there.
        days_before, days_after: Days used.
        n_areas: Comparison areas with exposure in both periods.
        is_paired: Days of equal weekday were paired.
        placebo: theta of each comparison area, as if it were the changed one beside the others.
        placebo_lo, placebo_hi: Interval of theta from the spread of the placebos instead of days; None with fewer than
            four comparison areas.
        trend: Before the change; None with fewer than three weeks or a week without violations.
        shrunken: None with fewer than four comparison areas.
        verdict, state, reason: As for every change.
    """

    theta: float | None
    lo: float | None
    hi: float | None
    log_se: float | None
    df: float | None
    alone: float | None
    comparison: float | None
    n_before: float
    n_after: float
    exposure_before_h: float
    exposure_after_h: float
    days_before: int
    days_after: int
    n_areas: int
    is_paired: bool
    placebo: tuple[float, ...]
    placebo_lo: float | None
    placebo_hi: float | None
    trend: PriorTrend | None
    shrunken: Shrunken | None
    verdict: Verdict
    state: State
    reason: Reason | None


def before_after(
    before: PeriodDays,
    after: PeriodDays,
    *,
    history: PeriodDays | None = None,
    confidence: float = 0.95,
    min_days: int = DEFAULTS.change_min_days,
    min_events: int = DEFAULTS.change_min_violations,
    min_exposure_h: float = 0.0,
) -> BeforeAfter:
    """Return the effect of a change on one area, relative to areas that were left alone (formulas: this module).

    Args:
        before: Whole weeks before the change; the caller leaves out the days around it.
        after: Whole weeks after it, with the same comparison areas in the same order.
        history: Days before the change whose trend is computed, with the same comparison areas; None = `before`.
        confidence: Confidence level.
        min_days: Days each period needs, on which the changed and a comparison area were recorded.
        min_events: Violations the changed area, and the comparison areas together, need in each period.
        min_exposure_h: Person-hours the changed area needs in each period.

    Returns:
        The effect, or `theta` None with the reason.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    b, a, h = _checked(before), _checked(after), _checked(before if history is None else history)
    if not b.comparison_n.shape[0] == a.comparison_n.shape[0] == h.comparison_n.shape[0]:
        raise ValueError("all periods must have the same comparison areas")
    both = (b.comparison_x_h.sum(axis=1) > 0) & (a.comparison_x_h.sum(axis=1) > 0)
    b, a, h = (_recorded(_areas(p, both)) for p in (b, a, h))
    reason = _refusal(b, a, min_days=min_days, min_events=min_events, min_exposure_h=min_exposure_h)
    if reason is not None:
        return _result(b, a, reason=reason)
    pairs = _pairs(b.weekday, a.weekday)
    is_paired = pairs is not None
    if pairs is not None:
        b, a = _days(b, pairs[0]), _days(a, pairs[1])
        reason = _refusal(b, a, min_days=min_days, min_events=min_events, min_exposure_h=min_exposure_h)
        if reason is not None:
            return _result(b, a, reason=reason)
    log_theta, log_se, df = _effect(b, a, is_paired=is_paired)
    counts = [v for p in (b, a) for v in (p.n.sum(), p.comparison_n.sum())]
    least = z_quantile(confidence=confidence) * math.sqrt(sum(1 / v for v in counts))
    half = max(t_quantile(df, confidence=confidence) * log_se, least)
    lo, hi = math.exp(log_theta - half), math.exp(log_theta + half)
    placebo, placebo_half = _placebo(b, a, confidence=confidence)
    return _result(
        b,
        a,
        theta=math.exp(log_theta),
        lo=lo,
        hi=hi,
        log_se=log_se,
        df=df,
        is_paired=is_paired,
        placebo=placebo,
        placebo_lo=None if placebo_half is None else math.exp(log_theta - placebo_half),
        placebo_hi=None if placebo_half is None else math.exp(log_theta + placebo_half),
        trend=_trend(h, confidence=confidence),
        shrunken=_shrunken(b, a, confidence=confidence),
        verdict=verdict_of(lo, hi),
        state="ok",
        reason=None,
    )


def _checked(period: PeriodDays) -> PeriodDays:
    n, x_h = (np.asarray(v, dtype=np.float64) for v in (period.n, period.x_h))
    comparison_n, comparison_x_h = (
        np.atleast_2d(np.asarray(v, dtype=np.float64)) for v in (period.comparison_n, period.comparison_x_h)
    )
    if n.ndim != 1 or n.shape != x_h.shape or comparison_n.shape != comparison_x_h.shape:
        raise ValueError("violations and person-hours must have one shape")
    weekday, week = (np.asarray(v, dtype=np.int64) for v in (period.weekday, period.week))
    if not comparison_n.shape[1:] == weekday.shape == week.shape == n.shape:
        raise ValueError("every day needs counts of all areas, a weekday and a week")
    x_h, comparison_x_h = np.nan_to_num(x_h, nan=0.0), np.nan_to_num(comparison_x_h, nan=0.0)
    n, comparison_n = np.where(x_h > 0, n, 0.0), np.where(comparison_x_h > 0, comparison_n, 0.0)
    for values in (n, x_h, comparison_n, comparison_x_h):
        if not np.isfinite(values).all() or (values < 0).any():
            raise ValueError("counts and person-hours must be finite and not negative")
    return PeriodDays(n, x_h, comparison_n, comparison_x_h, weekday, week)


def _areas(period: PeriodDays, keep: npt.NDArray[np.bool_]) -> PeriodDays:
    rows = period.comparison_n[keep], period.comparison_x_h[keep]
    return PeriodDays(period.n, period.x_h, *rows, period.weekday, period.week)


def _days(period: PeriodDays, keep: npt.NDArray[np.bool_] | Ints) -> PeriodDays:
    return PeriodDays(
        period.n[keep],
        period.x_h[keep],
        period.comparison_n[:, keep],
        period.comparison_x_h[:, keep],
        period.weekday[keep],
        period.week[keep],
    )


def _recorded(period: PeriodDays) -> PeriodDays:
    """Return the days on which the changed area and any comparison area have exposure."""
    return _days(period, (period.x_h > 0) & (period.comparison_x_h.sum(axis=0) > 0))


def _refusal(b: PeriodDays, a: PeriodDays, *, min_days: int, min_events: int, min_exposure_h: float) -> Reason | None:
    if not b.comparison_n.shape[0]:
        return Reason("redesign.no_comparison")
    for name, period in (("before", b), ("after", a)):
        if len(period.n) < min_days:
            return Reason(f"redesign.days_{name}", least=min_days, has=len(period.n))
        if period.x_h.sum() < min_exposure_h:
            return Reason(f"redesign.person_hours_{name}", least=min_exposure_h, has=float(period.x_h.sum()))
        if period.n.sum() < min_events:
            return Reason(f"redesign.events_{name}", least=min_events, has=float(period.n.sum()))
        if period.comparison_n.sum() < min_events:
            n = float(period.comparison_n.sum())
            return Reason(f"redesign.comparison_events_{name}", least=min_events, has=n)
    return None


def _pairs(b: Ints, a: Ints) -> tuple[Ints, Ints] | None:
    """Return the days of both periods in pairs of equal weekday, or None where pairing would lose over a quarter."""
    left: list[int] = []
    right: list[int] = []
    for weekday in np.unique(np.concatenate([b, a])):
        of_b, of_a = np.flatnonzero(b == weekday), np.flatnonzero(a == weekday)
        count = min(len(of_b), len(of_a))
        left += of_b[:count].tolist()
        right += of_a[:count].tolist()
    if len(left) < (1 - MAX_UNPAIRED) * max(len(b), len(a)):
        return None
    return np.array(left, dtype=np.int64), np.array(right, dtype=np.int64)


def _ratio(period: PeriodDays) -> float:
    """Return ln r_t - ln r_c of a period."""
    return math.log(period.n.sum() / period.x_h.sum()) - math.log(
        period.comparison_n.sum() / period.comparison_x_h.sum()
    )


def _influence(n: Floats, x_h: Floats) -> Floats:
    total = n.sum()
    return np.asarray((n - total / x_h.sum() * x_h) / total, dtype=np.float64)


def _by_day(period: PeriodDays) -> Floats:
    """Return the influence of each day on the log ratio of a period."""
    comparison = _influence(period.comparison_n.sum(axis=0), period.comparison_x_h.sum(axis=0))
    return np.asarray(_influence(period.n, period.x_h) - comparison, dtype=np.float64)


def _effect(b: PeriodDays, a: PeriodDays, *, is_paired: bool) -> tuple[float, float, float]:
    """Return ln theta, its standard error and degrees of freedom."""
    log_theta = _ratio(a) - _ratio(b)
    if is_paired:
        apart = _by_day(a) - _by_day(b)
        n_days = len(apart)
        return log_theta, math.sqrt(n_days / (n_days - 1) * float(apart @ apart)), n_days - 1
    (var_b, df_b), (var_a, df_a) = (_variance(_by_day(p), p.weekday) for p in (b, a))
    total = var_a + var_b
    if total == 0:
        return log_theta, 0.0, df_a + df_b
    return log_theta, math.sqrt(total), total**2 / (var_a**2 / df_a + var_b**2 / df_b)


def _variance(by_day: Floats, weekday: Ints) -> tuple[float, float]:
    """Return the variance of a sum of days' influences, weekdays taken out where each is there twice, and its df."""
    days, of_day, counts = np.unique(weekday, return_inverse=True, return_counts=True)
    n_days = len(by_day)
    if counts.min() < TWICE:
        return n_days / (n_days - 1) * float(by_day @ by_day), n_days - 1
    mean = np.bincount(of_day, weights=by_day) / counts
    rest = by_day - mean[of_day]
    factor = (counts / (counts - 1))[of_day]
    return float((factor * rest) @ rest), n_days - len(days)


def _placebo(b: PeriodDays, a: PeriodDays, *, confidence: float) -> tuple[tuple[float, ...], float | None]:
    """Return theta of each comparison area beside the others, and the half width of ln theta from their spread."""
    thetas: list[float] = []
    for area in range(b.comparison_n.shape[0]):
        others = np.arange(b.comparison_n.shape[0]) != area
        fake = [
            PeriodDays(p.comparison_n[area], p.comparison_x_h[area], p.comparison_n[others], p.comparison_x_h[others],
                   p.weekday, p.week)
            for p in (b, a)
        ]  # fmt: skip
        if all(p.n.sum() > 0 and p.comparison_n.sum() > 0 for p in fake):
            thetas.append(_ratio(fake[1]) - _ratio(fake[0]))
    changes = tuple(math.exp(t) for t in thetas)
    if len(thetas) < MIN_PLACEBO_AREAS:
        return changes, None
    n = len(thetas)
    return changes, t_quantile(n - 2, confidence=confidence) * float(np.std(thetas, ddof=1)) * math.sqrt(1 + 1 / n)


def _trend(b: PeriodDays, *, confidence: float) -> PriorTrend | None:
    """Return the slope of the weekly log ratio before the change, by least squares."""
    weeks = np.unique(b.week)
    if len(weeks) < MIN_TREND_WEEKS:
        return None
    parts = [_days(b, b.week == week) for week in weeks]
    if any(p.n.sum() == 0 or p.comparison_n.sum() == 0 for p in parts):
        return None
    y = np.array([_ratio(p) for p in parts])
    at = weeks - weeks.mean()
    slope = float(at @ y / (at @ at))
    rest = y - y.mean() - slope * at
    df = len(weeks) - 2
    half = t_quantile(df, confidence=confidence) * math.sqrt(float(rest @ rest) / df / float(at @ at))
    lo, hi = slope - half, slope + half
    return PriorTrend(math.expm1(slope), math.expm1(lo), math.expm1(hi), len(weeks), is_flat=lo <= 0 <= hi)


def _shrunken(b: PeriodDays, a: PeriodDays, *, confidence: float) -> Shrunken | None:
    """Return the effect with the area's before-rate pulled towards the mean of all areas (empirical Bayes).

    With day-clustered variances of the areas' log rates, as in `vsd_analytics.stats.shrinkage`.
    """
    n, x_h = np.vstack([b.n, b.comparison_n]), np.vstack([b.x_h, b.comparison_x_h])
    usable = n.sum(axis=1) >= MIN_SHRUNKEN_EVENTS
    if usable.sum() <= MIN_PLACEBO_AREAS:
        return None
    n, x_h = n[usable], x_h[usable]
    site = _influence(n.sum(axis=0), x_h.sum(axis=0))
    logs = np.log(n.sum(axis=1) / x_h.sum(axis=1))
    v = np.array([_variance(_influence(n[j], x_h[j]) - site, b.weekday)[0] for j in range(len(n))])
    v = np.maximum(v, 1 / n.sum(axis=1))
    mean, tau2 = between_places(logs, v)
    weight = tau2 / (tau2 + float(v[0]))
    pulled = (1 - weight) * (float(logs[0]) - mean)
    (var_b, df_b), (var_a, df_a) = (_variance(_by_day(p), p.weekday) for p in (b, a))
    log_theta = _ratio(a) - _ratio(b) + pulled
    half = t_quantile(min(df_a, df_b), confidence=confidence) * math.sqrt(var_a + weight * var_b)
    return Shrunken(math.exp(log_theta), math.exp(log_theta - half), math.exp(log_theta + half), weight)


def _result(
    b: PeriodDays,
    a: PeriodDays,
    *,
    reason: Reason | None,
    theta: float | None = None,
    lo: float | None = None,
    hi: float | None = None,
    log_se: float | None = None,
    df: float | None = None,
    is_paired: bool = False,
    placebo: tuple[float, ...] = (),
    placebo_lo: float | None = None,
    placebo_hi: float | None = None,
    trend: PriorTrend | None = None,
    shrunken: Shrunken | None = None,
    verdict: Verdict = "too_little_data",
    state: State = "not_enough_data",
) -> BeforeAfter:
    return BeforeAfter(
        theta=theta, lo=lo, hi=hi, log_se=log_se, df=df,
        alone=_change(b.n, b.x_h, a.n, a.x_h),
        comparison=_change(b.comparison_n, b.comparison_x_h, a.comparison_n, a.comparison_x_h),
        n_before=float(b.n.sum()), n_after=float(a.n.sum()),
        exposure_before_h=float(b.x_h.sum()), exposure_after_h=float(a.x_h.sum()),
        days_before=len(b.n), days_after=len(a.n), n_areas=b.comparison_n.shape[0], is_paired=is_paired,
        placebo=placebo, placebo_lo=placebo_lo, placebo_hi=placebo_hi, trend=trend, shrunken=shrunken,
        verdict=verdict, state=state, reason=reason,
    )  # fmt: skip


def _change(n_b: Floats, x_b: Floats, n_a: Floats, x_a: Floats) -> float | None:
    if min(n_b.sum(), x_b.sum(), x_a.sum()) <= 0:
        return None
    return float((n_a.sum() / x_a.sum()) / (n_b.sum() / x_b.sum()))
