"""Did a redesign work: the change of one area beside the change of areas that were left alone (M27).

theta is the ratio of rates after / before in the changed area, over the same ratio in the comparison areas taken
together, so that what moved the whole site (season, weather, crowds) cancels:

    ln theta = [ln r_tA - ln r_cA] - [ln r_tB - ln r_cB],

B before, A after, t the changed ("treated") area, c the comparison areas. The rate may be any numerator over any
denominator: person-time in violation per open hour, its share of person-time, violations per person-hour. Several
intervals know different things, and the one reported is the widest reach of all:

* **days.** i_d = (n_td - r_t x_td)/(X_t r_t) - (n_cd - r_c x_cd)/(X_c r_c) is the influence of a day on a period's log
  ratio. Days of equal weekday are paired where both periods have equally many: var = D/(D-1) sum (i_dA - i_dB)^2,
  df = D-1. Else each period gives its own, weekdays taken out of those that have them at least twice, with Welch's
  degrees of freedom. Never narrower than that of independent (Poisson) violations.
* **placebo.** Areas have weeks of their own, which days do not show. Each of K >= 4 comparison areas is treated as if
  it were the changed one; half width t_{K-2} sd sqrt(1 + 1/K) of their ln theta.
* **own weeks**, with fewer than four comparison areas: the variance of days plus tau^2 (1/W_B + 1/W_A)(1 + 1/K), W the
  weeks, tau^2 the variance of an area's own weeks beyond what days explain (`vsd_analytics.stats.own_weeks`).
* **without one.** A comparison area that takes the people who left makes a fall look larger. So the range reaches as
  far as days and own weeks do with each comparison area left out in turn; of a single one, the area by itself remains.
* **few.** Events are needed before the change only: none after it is a result, not a gap. With fewer after than are
  needed before, the range also reaches as far as the exact conditional binomial (`vsd_analytics.stats.few_events`);
  after none theta is 0, and the upper limit is that of the binomial, or of half a violation beside the placebos.
* **line.** From eight weeks before the change: the area beside its own trend, continued
  (`vsd_analytics.stats.prior_trend`), because a slow trend looks like an effect.

From ten weeks before, the comparison areas have weights (`vsd_analytics.stats.comparison_weights`). Coverage and power
by simulation: docs/statistics.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason, State, Verdict
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.comparison_weights import day_influence, influence_on_log, log_ratio, weights_of
from vsd_analytics.stats.estimates import verdict_of
from vsd_analytics.stats.few_events import dispersion, exact_limits
from vsd_analytics.stats.own_weeks import own_weeks_variance
from vsd_analytics.stats.period_days import (
    Floats,
    Ints,
    PeriodDays,
    as_if_changed,
    checked,
    of_areas,
    of_days,
    recorded,
)
from vsd_analytics.stats.prior_trend import PriorTrend, beside_the_line, prior_trend
from vsd_analytics.stats.quantiles import t_quantile, z_quantile
from vsd_analytics.stats.shrinkage import between_places

MIN_PLACEBO_AREAS: Final = 4
"""Fewer unchanged areas have no spread to compare a change with."""
MIN_SHRUNKEN_EVENTS: Final = 5
"""Areas with fewer violations have no log rate precise enough for the mean of all areas."""
MAX_UNPAIRED: Final = 0.25
"""Days are paired by weekday unless that would drop more than this share of the longer period."""
TWICE: Final = 2
"""Weekday means are taken out only where each weekday was recorded at least twice."""


@dataclass(frozen=True, slots=True)
class Shrunken:
    """The effect when the changed area was chosen for its bad figure, so that part of it would have passed by itself.

    Attributes:
        value, lo, hi: As in `BeforeAfter`, from the before-rate pulled towards the areas' mean.
        weight: What the area's own before-rate counts, 0 to 1; the rest is the mean of all areas.
    """

    value: float
    lo: float
    hi: float
    weight: float


@dataclass(frozen=True, slots=True)
class BeforeAfter:
    """What a change did to an area (M27).

    Attributes:
        value: Ratio of rates after / before relative to the comparison areas; 0.8 = 20 % less than without the change.
            None when it cannot be given.
        lo, hi: Its interval: as wide as the widest of those below reach together.
        day_lo, day_hi: From how days differ.
        placebo_lo, placebo_hi: From the spread of the placebos; None with fewer than four comparison areas.
        week_lo, week_hi: From days and the areas' own weeks; None with four comparison areas or more.
        line_lo, line_hi: Beside the area's own trend before the change, continued; None with fewer than eight weeks.
        without_lo, without_hi: As far as days and own weeks reach with any one comparison area left out; after no
            violation None and the upper limit.
        log_se, df: Standard error of ln theta from days, and its degrees of freedom.
        alone: Ratio after / before of the changed area by itself.
        comparison: Ratio after / before of the comparison areas taken together as one.
        n_before, n_after: Violations in the changed area.
        exposure_before_h, exposure_after_h: Denominator there.
        days_before, days_after: Days used.
        n_areas: Comparison areas with exposure in both periods.
        weights: Weight of each of them; None where they are taken together as one area.
        is_paired: Days of equal weekday were paired.
        placebo: theta of each comparison area, as if it were the changed one beside the others.
        trend: Before the change; None with fewer than three weeks or a week without violations.
        shrunken: None with fewer than four comparison areas.
        verdict, state, reason: As for every change; the verdict is that of `lo` and `hi`.
    """

    value: float | None
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
    is_paired: bool = False
    placebo: tuple[float, ...] = ()
    placebo_lo: float | None = None
    placebo_hi: float | None = None
    trend: PriorTrend | None = None
    shrunken: Shrunken | None = None
    verdict: Verdict = "too_little_data"
    state: State = "not_enough_data"
    reason: Reason | None = None
    day_lo: float | None = None
    day_hi: float | None = None
    week_lo: float | None = None
    week_hi: float | None = None
    line_lo: float | None = None
    line_hi: float | None = None
    without_lo: float | None = None
    without_hi: float | None = None
    weights: tuple[float, ...] | None = None


def before_after(
    before: PeriodDays,
    after: PeriodDays,
    *,
    history: PeriodDays | None = None,
    weeks_left_out: float = 0.0,
    confidence: float = 0.95,
    min_days: int = DEFAULTS.change_min_days,
    min_events: int = DEFAULTS.change_min_violations,
    min_exposure_h: float = 0.0,
) -> BeforeAfter:
    """Return the effect of a change on one area, relative to areas that were left alone (formulas: this module).

    Args:
        before: Whole weeks before the change; the caller leaves out the days around it.
        after: Whole weeks after it, with the same comparison areas in the same order.
        history: All days before the change that are known, up to the last of `before`, with the same comparison areas:
            they give trend, weights and the areas' own weeks. None = `before`.
        weeks_left_out: Weeks between the end of `before` and the start of `after`.
        confidence: Confidence level.
        min_days: Days each period needs, on which the changed and a comparison area were recorded.
        min_events: Violations the changed area, and the comparison areas together, need before. After, none of the
            changed area is a result; the comparison areas need one, as nothing is compared with none.
        min_exposure_h: Denominator the changed area needs in each period.

    Returns:
        The effect, or `theta` None with the reason.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    b, a, h = checked(before), checked(after), checked(before if history is None else history)
    if not b.n_areas == a.n_areas == h.n_areas:
        raise ValueError("all periods must have the same comparison areas")
    both = (b.comparison_x_h.sum(axis=1) > 0) & (a.comparison_x_h.sum(axis=1) > 0)
    b, a, h = (recorded(of_areas(p, both)) for p in (b, a, h))
    reason = _refusal(b, a, min_days=min_days, min_events=min_events, min_exposure_h=min_exposure_h)
    if reason is not None:
        return _counted(b, a, reason)
    pairs = _pairs(b.weekday, a.weekday)
    if pairs is not None:
        b, a = of_days(b, pairs[0]), of_days(a, pairs[1])
        reason = _refusal(b, a, min_days=min_days, min_events=min_events, min_exposure_h=min_exposure_h)
        if reason is not None:
            return _counted(b, a, reason)
    if not a.n.any():
        return _fell_to_none(b, a, h, confidence=confidence)
    weights = _weights(b, a, h)
    log_theta, log_se, df = _effect(b, a, weights, is_paired=pairs is not None)
    counts = [v for p in (b, a) for v in (p.n_events, p.n_comparison_events)]
    least = z_quantile(confidence=confidence) * math.sqrt(sum(1 / v for v in counts))
    placebo, placebo_half = _placebo(b, a, h, confidence=confidence)
    week_half = None
    if placebo_half is None:
        week_half = _with_own_weeks(b, a, h, variance=log_se**2, df=df, confidence=confidence)
    middle = weeks_left_out + (len(np.unique(a.week)) + 1) / 2
    line = beside_the_line(h, a, weights, apart_weeks=middle, confidence=confidence)
    days = _limits(log_theta, max(t_quantile(df, confidence=confidence) * log_se, least))
    others = [_limits(log_theta, half) for half in (placebo_half, week_half)] + [_limits(*(line or (0.0, None)))]
    if a.n_events < min_events:
        others.append(_exact(b, a, confidence=confidence))
    lo, hi = min(v for v, _ in (days, *others) if v is not None), max(v for _, v in (days, *others) if v is not None)
    without = _without_one(
        b, a, h, is_paired=pairs is not None, has_own_weeks=week_half is not None, confidence=confidence
    )
    if without is not None:
        lo, hi = min(lo, without[0]), max(hi, without[1])
    return replace(
        _counted(b, a, None),
        value=math.exp(log_theta), lo=lo, hi=hi, log_se=log_se, df=df, is_paired=pairs is not None,
        day_lo=days[0], day_hi=days[1], placebo=placebo, placebo_lo=others[0][0], placebo_hi=others[0][1],
        week_lo=others[1][0], week_hi=others[1][1], line_lo=others[2][0], line_hi=others[2][1],
        weights=None if weights is None else tuple(weights.tolist()),
        trend=prior_trend(h, weights, confidence=confidence),
        shrunken=_shrunken(b, a, weights, confidence=confidence),
        without_lo=without and without[0], without_hi=without and without[1], verdict=verdict_of(lo, hi),
        state="ok",
    )  # fmt: skip


def _limits(log_theta: float, half: float | None) -> tuple[float | None, float | None]:
    return (None, None) if half is None else (math.exp(log_theta - half), math.exp(log_theta + half))


def _refusal(b: PeriodDays, a: PeriodDays, *, min_days: int, min_events: int, min_exposure_h: float) -> Reason | None:
    if not b.n_areas:
        return Reason("logged_change.no_comparison")
    for name, period in (("before", b), ("after", a)):
        if len(period.n) < min_days:
            return Reason(f"logged_change.days_{name}", least=min_days, has=len(period.n))
        if period.x_h.sum() < min_exposure_h:
            return Reason(f"logged_change.person_hours_{name}", least=min_exposure_h, has=float(period.x_h.sum()))
        is_before, least = period is b, min_events if period is b else 1
        if is_before and (period.n_events < least or not period.n.any()):
            return Reason("logged_change.events_before", least=least, has=period.n_events)
        if period.n_comparison_events < least or not period.comparison_n.any():
            return Reason(f"logged_change.comparison_events_{name}", least=least, has=period.n_comparison_events)
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


def _weights(b: PeriodDays, a: PeriodDays, h: PeriodDays) -> Floats | None:
    """Return the weights of the comparison areas, or None where one that counts has nothing before or after."""
    weights = weights_of(h, weeks_after=len(np.unique(a.week)))
    if weights is None or any((p.comparison_n[weights > 0].sum(axis=1) == 0).any() for p in (b, a)):
        return None
    return weights


def _effect(b: PeriodDays, a: PeriodDays, weights: Floats | None, *, is_paired: bool) -> tuple[float, float, float]:
    """Return ln theta, its standard error from days, and degrees of freedom."""
    log_theta = log_ratio(a, weights) - log_ratio(b, weights)
    if is_paired:
        apart = day_influence(a, weights) - day_influence(b, weights)
        n_days = len(apart)
        return log_theta, math.sqrt(n_days / (n_days - 1) * float(apart @ apart)), n_days - 1
    (var_b, df_b), (var_a, df_a) = (_variance(day_influence(p, weights), p.weekday) for p in (b, a))
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


def _placebo(
    b: PeriodDays, a: PeriodDays, h: PeriodDays, *, confidence: float
) -> tuple[tuple[float, ...], float | None]:
    """Return theta of each comparison area beside the others, and the half width of ln theta from their spread."""
    logs: list[float] = []
    for area in range(b.n_areas if b.n_areas > 1 else 0):
        b_area, a_area, h_area = (as_if_changed(p, area) for p in (b, a, h))
        if all(p.n.any() and p.comparison_n.any() for p in (b_area, a_area)):
            weights = _weights(b_area, a_area, h_area)
            logs.append(log_ratio(a_area, weights) - log_ratio(b_area, weights))
    thetas, n = tuple(math.exp(v) for v in logs), len(logs)
    if n < MIN_PLACEBO_AREAS:
        return thetas, None
    return thetas, t_quantile(n - 2, confidence=confidence) * float(np.std(logs, ddof=1)) * math.sqrt(1 + 1 / n)


def _with_own_weeks(
    b: PeriodDays, a: PeriodDays, h: PeriodDays, *, variance: float, df: float, confidence: float
) -> float:
    """Return the half width of ln theta from the variance of days and that of the areas' own weeks (Satterthwaite)."""
    tau2, tau_df = own_weeks_variance(h)
    weeks = sum(1 / len(np.unique(p.week)) for p in (b, a))
    own = tau2 * weeks * (1 + 1 / b.n_areas)
    total = variance + own
    return t_quantile(total**2 / (variance**2 / df + own**2 / tau_df), confidence=confidence) * math.sqrt(total)


def _without_one(
    b: PeriodDays, a: PeriodDays, h: PeriodDays, *, is_paired: bool, has_own_weeks: bool, confidence: float
) -> tuple[float, float] | None:
    """Return the lowest and the highest limit by days, and own weeks, with any one comparison area left out."""
    ends: list[tuple[float, float]] = []
    for area in range(b.n_areas):
        left = np.arange(b.n_areas) != area
        b_left, a_left, h_left = (of_areas(p, left) for p in (b, a, h))
        if left.any() and not (b_left.comparison_n.any() and a_left.comparison_n.any()):
            continue
        log_theta, log_se, df = _effect(b_left, a_left, _weights(b_left, a_left, h_left), is_paired=is_paired)
        half = t_quantile(df, confidence=confidence) * log_se
        if has_own_weeks and left.any():
            more = _with_own_weeks(b_left, a_left, h_left, variance=log_se**2, df=df, confidence=confidence)
            half = max(half, more)
        ends.append((math.exp(log_theta - half), math.exp(log_theta + half)))
    return (min(lo for lo, _ in ends), max(hi for _, hi in ends)) if ends else None


def _exact(b: PeriodDays, a: PeriodDays, *, confidence: float) -> tuple[float, float]:
    """Return the limits of theta by counts: those of the conditional binomial, days counted in their dispersion."""
    phi = dispersion(b.n if b.events is None else b.events, b.x_h)
    ratio = _exposure_ratio(b, a)
    return exact_limits(b.n_events, a.n_events, exposure_ratio=ratio, phi=phi, confidence=confidence)


def _exposure_ratio(b: PeriodDays, a: PeriodDays) -> float:
    """Return what should move with the changed area, after over before: hours, and the comparison areas' rate."""
    beside = 1.0
    if b.n_areas:
        before, after = (p.comparison_n.sum() / p.comparison_x_h.sum() for p in (b, a))
        beside = after / before
    return float(a.x_h.sum() / b.x_h.sum() * beside)


def _fell_to_none(b: PeriodDays, a: PeriodDays, h: PeriodDays, *, confidence: float) -> BeforeAfter:
    """Return the effect where the changed area has nothing after: theta 0, and an upper limit."""
    placebo, half = _placebo(b, a, h, confidence=confidence)
    upper = _exact(b, a, confidence=confidence)[1]
    left = [np.arange(b.n_areas) != area for area in range(b.n_areas)]
    parts = [(of_areas(b, k), of_areas(a, k)) for k in left]
    parts = [p for p in parts if not p[0].n_areas or all(side.comparison_n.any() for side in p)]
    without = max((_exact(*p, confidence=confidence)[1] for p in parts), default=upper)
    # none has no log: half a violation is taken for it beside the placebos
    spread = None if half is None else 0.5 / b.n_events / _exposure_ratio(b, a) * math.exp(half)
    hi = max(upper, spread or 0.0, without)
    return replace(
        _counted(b, a, None), value=0.0, lo=0.0, hi=hi, placebo=placebo, day_lo=0.0, day_hi=upper, without_hi=without,
        placebo_lo=None if half is None else 0.0, placebo_hi=spread,
        trend=prior_trend(h, _weights(b, a, h), confidence=confidence), verdict=verdict_of(0.0, hi), state="ok",
    )  # fmt: skip


def _shrunken(b: PeriodDays, a: PeriodDays, weights: Floats | None, *, confidence: float) -> Shrunken | None:
    """Return the effect with the area's before-rate pulled towards the mean of all areas (empirical Bayes).

    With day-clustered variances of the areas' log rates, as in `vsd_analytics.stats.shrinkage`.
    """
    n, x_h = np.vstack([b.n, b.comparison_n]), np.vstack([b.x_h, b.comparison_x_h])
    events = n if b.events is None or b.comparison_events is None else np.vstack([b.events, b.comparison_events])
    counts = events.sum(axis=1)
    usable = (counts >= MIN_SHRUNKEN_EVENTS) & (n.sum(axis=1) > 0)
    if usable.sum() <= MIN_PLACEBO_AREAS:
        return None
    n, x_h, counts = n[usable], x_h[usable], counts[usable]
    site = influence_on_log(n.sum(axis=0), x_h.sum(axis=0))
    logs = np.log(n.sum(axis=1) / x_h.sum(axis=1))
    v = np.array([_variance(influence_on_log(n[j], x_h[j]) - site, b.weekday)[0] for j in range(len(n))])
    v = np.maximum(v, 1 / counts)
    mean, tau2 = between_places(logs, v)
    weight = tau2 / (tau2 + float(v[0]))
    pulled = (1 - weight) * (float(logs[0]) - mean)
    (var_b, df_b), (var_a, df_a) = (_variance(day_influence(p, weights), p.weekday) for p in (b, a))
    log_theta = log_ratio(a, weights) - log_ratio(b, weights) + pulled
    half = t_quantile(min(df_a, df_b), confidence=confidence) * math.sqrt(var_a + weight * var_b)
    return Shrunken(math.exp(log_theta), math.exp(log_theta - half), math.exp(log_theta + half), weight)


def _counted(b: PeriodDays, a: PeriodDays, reason: Reason | None) -> BeforeAfter:
    """Return what was counted, without an effect."""
    return BeforeAfter(
        value=None, lo=None, hi=None, log_se=None, df=None,
        alone=_change(b.n, b.x_h, a.n, a.x_h),
        comparison=_change(b.comparison_n, b.comparison_x_h, a.comparison_n, a.comparison_x_h),
        n_before=b.n_events, n_after=a.n_events,
        exposure_before_h=float(b.x_h.sum()), exposure_after_h=float(a.x_h.sum()),
        days_before=len(b.n), days_after=len(a.n), n_areas=b.n_areas, reason=reason,
    )  # fmt: skip


def _change(n_b: Floats, x_b: Floats, n_a: Floats, x_a: Floats) -> float | None:
    if min(n_b.sum(), x_b.sum(), x_a.sum()) <= 0:
        return None
    return float((n_a.sum() / x_a.sum()) / (n_b.sum() / x_b.sum()))
