"""Before and after equals what a reader computes with a pencil, to six digits and more: each interval, and all."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import minimize

from vsd_analytics.stats.before_after import BeforeAfter, before_after
from vsd_analytics.stats.comparison_weights import synthetic_weights
from vsd_analytics.stats.own_weeks import PRIOR_DF, PRIOR_SD, own_weeks_variance
from vsd_analytics.stats.period_days import PeriodDays

EXACT = 1e-9
BEFORE = ([12, 9, 14, 11, 20, 25, 8], [10, 9, 12, 10, 15, 18, 7])
AFTER = ([7, 6, 10, 9, 12, 15, 5], [11, 9, 11, 10, 14, 19, 8])
OTHERS_BEFORE = ([[20, 18, 22, 25, 30, 41, 12], [9, 8, 12, 7, 13, 18, 6]], [[20, 20, 21, 22, 30, 35, 15], [8] * 7])
OTHERS_AFTER = ([[22, 17, 25, 23, 33, 38, 15], [8, 9, 10, 9, 15, 17, 5]], [[21, 19, 22, 21, 31, 36, 14], [8] * 7])


def period(own: tuple[list[int], list[int]], others: tuple[list[list[int]], list[list[int]]], week: int) -> PeriodDays:
    n, x_h, others_n, others_x_h = (np.array(v, dtype=float) for v in (*own, *others))
    return PeriodDays(n, x_h, others_n, others_x_h, np.arange(7), np.full(7, week))


def by_hand() -> tuple[float, float, float]:
    """Return ln theta, its standard error from days, and degrees of freedom, in plain Python."""
    influence, logs = [], []
    for own, others in ((BEFORE, OTHERS_BEFORE), (AFTER, OTHERS_AFTER)):
        n_c = [a + b for a, b in zip(*others[0], strict=True)]
        x_c = [a + b for a, b in zip(*others[1], strict=True)]
        r_t, r_c = sum(own[0]) / sum(own[1]), sum(n_c) / sum(x_c)
        logs.append(math.log(r_t) - math.log(r_c))
        influence.append(
            [
                (n - r_t * x) / (sum(own[1]) * r_t) - (m - r_c * y) / (sum(x_c) * r_c)
                for n, x, m, y in zip(*own, n_c, x_c, strict=True)
            ]
        )
    apart = [a - b for b, a in zip(*influence, strict=True)]
    return logs[1] - logs[0], math.sqrt(7 / 6 * sum(d * d for d in apart)), 6


def noisy(rng: np.random.Generator, *, weeks: int, n_areas: int, first: int = 0, rate: float = 1.0) -> PeriodDays:
    days = np.arange(7 * weeks)
    shock = np.exp(rng.normal(0, 0.3, len(days)))
    own = np.exp(rng.normal(0, 0.2, (n_areas + 1, len(days))))
    own[0] *= rate
    x_h = rng.uniform(10, 20, own.shape)
    n = rng.poisson(5 * own * shock * x_h).astype(float)
    return PeriodDays(n[0], x_h[0], n[1:], x_h[1:], days % 7, days // 7 + first)


def test_effect_and_its_interval_from_days_equal_the_computation_by_hand() -> None:
    found = before_after(period(BEFORE, OTHERS_BEFORE, 0), period(AFTER, OTHERS_AFTER, 1))
    log_theta, log_se, df = by_hand()
    least = 1.959963984540054 * math.sqrt(1 / 99 + 1 / 64 + 1 / 241 + 1 / 246)
    half = max(2.4469118511449692 * log_se, least)  # t of 6 degrees of freedom at 97.5 %
    assert found.value == pytest.approx(math.exp(log_theta), rel=EXACT)
    assert (found.log_se, found.df) == (pytest.approx(log_se, rel=EXACT), df)
    assert found.day_lo == pytest.approx(math.exp(log_theta - half), rel=EXACT)
    assert found.day_hi == pytest.approx(math.exp(log_theta + half), rel=EXACT)


def test_days_that_agree_by_luck_do_not_make_it_narrower_than_independent_violations() -> None:
    b, a = (replace(period(BEFORE, OTHERS_BEFORE, w), n=np.array(BEFORE[1], dtype=float) * 2) for w in (0, 1))
    a = replace(a, n=a.n / 2)
    found = before_after(b, a)
    assert found.log_se == pytest.approx(0, abs=1e-12)
    least = stats.norm.ppf(0.975) * math.sqrt(1 / 162 + 1 / 81 + 2 / 241)
    assert found.day_lo == pytest.approx(0.5 * math.exp(-least), rel=EXACT)


def test_periods_of_unequal_length_have_welch_degrees_of_freedom() -> None:
    rng = np.random.default_rng(1)
    b, a = noisy(rng, weeks=1, n_areas=2), noisy(rng, weeks=4, n_areas=2, first=1)
    a = replace(a, weekday=np.arange(28), week=a.week)  # no weekday twice: plain variances
    found = before_after(replace(b, weekday=np.arange(7) + 100), a)
    variances = []
    for p in (b, a):
        own = p.n / p.n.sum() - p.x_h / p.x_h.sum()
        n, x = p.comparison_n.sum(axis=0), p.comparison_x_h.sum(axis=0)
        each = own - (n / n.sum() - x / x.sum())
        variances.append((len(each) * each.var(ddof=1), len(each)))  # influences sum to 0: D/(D-1) sum i^2
    total = sum(v for v, _ in variances)
    assert not found.is_paired
    assert found.log_se == pytest.approx(math.sqrt(total), rel=EXACT)
    assert found.df == pytest.approx(total**2 / sum(v**2 / (d - 1) for v, d in variances), rel=EXACT)


def test_the_placebo_interval_equals_the_prediction_interval_of_the_placebos() -> None:
    rng = np.random.default_rng(2)
    b, a = noisy(rng, weeks=2, n_areas=5), noisy(rng, weeks=2, n_areas=5, first=2)
    found = before_after(b, a)
    logs = []
    for j in range(5):
        log = 0.0
        for p, sign in ((a, 1), (b, -1)):
            n, x = p.comparison_n.sum(axis=1), p.comparison_x_h.sum(axis=1)
            log += sign * (math.log(n[j] / x[j]) - math.log((n.sum() - n[j]) / (x.sum() - x[j])))
        logs.append(log)
    assert found.placebo == pytest.approx(np.exp(logs), rel=EXACT)
    half = stats.t.ppf(0.975, 3) * np.std(logs, ddof=1) * math.sqrt(1 + 1 / 5)
    assert found.value is not None
    assert found.placebo_lo == pytest.approx(found.value * math.exp(-half), rel=EXACT)
    assert found.placebo_hi == pytest.approx(found.value * math.exp(half), rel=EXACT)


def test_the_range_reaches_as_far_as_without_any_one_comparison_area() -> None:
    b, a = period(BEFORE, OTHERS_BEFORE, 0), period(AFTER, OTHERS_AFTER, 1)
    found = before_after(b, a)
    ends = []
    for left in (0, 1):
        others_b, others_a = ([[v[left]] for v in others] for others in (OTHERS_BEFORE, OTHERS_AFTER))
        one = before_after(period(BEFORE, others_b, 0), period(AFTER, others_a, 1))  # type: ignore[arg-type]
        assert one.value is not None
        assert one.log_se is not None
        assert one.week_lo is not None
        by_days = math.log(one.value) - 2.4469118511449692 * one.log_se
        ends.append(min(math.exp(by_days), one.week_lo))
    assert found.without_lo == pytest.approx(min(ends), rel=EXACT)
    only = before_after(b, a).alone
    alone = before_after(period(BEFORE, others_b, 0), period(AFTER, others_a, 1))  # type: ignore[arg-type]
    own = (
        [n / 99 - x / 81 for n, x in zip(*BEFORE, strict=True)],
        [n / 64 - x / 82 for n, x in zip(*AFTER, strict=True)],
    )
    se = math.sqrt(7 / 6 * sum((v - u) ** 2 for u, v in zip(*own, strict=True)))
    assert only is not None
    assert alone.without_lo == pytest.approx(only * math.exp(-2.4469118511449692 * se), rel=EXACT)


def test_with_few_comparison_areas_the_interval_knows_weeks_of_their_own() -> None:
    rng = np.random.default_rng(3)
    b, a = noisy(rng, weeks=2, n_areas=2), noisy(rng, weeks=2, n_areas=2, first=2)
    found = before_after(b, a)
    tau2, df = own_weeks_variance(b)
    assert found.log_se is not None
    assert found.df is not None
    own = tau2 * (1 / 2 + 1 / 2) * (1 + 1 / 2)
    total = found.log_se**2 + own
    both_df = total**2 / (found.log_se**4 / found.df + own**2 / df)
    half = stats.t.ppf(0.975, both_df) * math.sqrt(total)
    assert found.value is not None
    assert found.week_hi == pytest.approx(found.value * math.exp(half), rel=EXACT)
    assert found.placebo_lo is None


def test_weeks_of_their_own_are_the_two_way_residuals_less_what_days_explain() -> None:
    weeks, days = 3, np.arange(21)
    x_h = np.full((2, 21), 10.0)
    n = np.full((2, 21), 40.0)
    n[0, 7:14] *= 1.5  # one area, one week: days are all alike, so they explain nothing
    history = PeriodDays(n[0], x_h[0], n[1:], x_h[1:], days % 7, days // 7)
    y = np.log([[4, 6, 4], [4, 4, 4]])
    rest = y - y.mean(axis=1, keepdims=True) - y.mean(axis=0) + y.mean()
    df = (2 - 1) * (weeks - 1)
    expected = ((rest**2).sum() + PRIOR_DF * PRIOR_SD**2) / (df + PRIOR_DF)
    assert own_weeks_variance(history) == (pytest.approx(expected, rel=EXACT), df + PRIOR_DF)


def test_what_days_explain_is_not_taken_for_weeks_of_their_own() -> None:
    rng = np.random.default_rng(4)
    n_areas, weeks = 40, 40
    days = np.arange(7 * weeks)
    rates = np.exp(rng.normal(0, 0.3, (n_areas, len(days))))
    x_h = np.full(rates.shape, 1000.0)
    made = {}
    for sd in (0.0, 0.2):
        n = rates * x_h * np.repeat(np.exp(rng.normal(0, sd, (n_areas, weeks))), 7, axis=1)
        made[sd] = own_weeks_variance(PeriodDays(n[0], x_h[0], n[1:], x_h[1:], days % 7, days // 7))[0]
    assert math.sqrt(made[0.0]) < 0.03, "days of sd .3 make weeks of sd .11"
    assert math.sqrt(made[0.2]) == pytest.approx(0.2, abs=0.015)


def test_the_line_of_the_weeks_before_is_that_of_ordinary_regression() -> None:
    rng = np.random.default_rng(5)
    h, a = noisy(rng, weeks=9, n_areas=5), noisy(rng, weeks=2, n_areas=5, first=9)
    last = h.week >= 7
    b = PeriodDays(
        h.n[last], h.x_h[last], h.comparison_n[:, last], h.comparison_x_h[:, last], h.weekday[last], h.week[last]
    )
    found = before_after(b, a, history=h, weeks_left_out=3 / 7)
    y = np.array([_log_ratio(h, h.week == w) for w in range(9)])
    weeks = np.arange(9)
    fit = stats.linregress(weeks, y)
    trend = found.trend
    assert trend is not None
    assert trend.value == pytest.approx(math.expm1(fit.slope), rel=EXACT)
    t = stats.t.ppf(0.975, 7)
    assert trend.lo == pytest.approx(math.expm1(fit.slope - t * fit.stderr), rel=EXACT)
    assert trend.hi == pytest.approx(math.expm1(fit.slope + t * fit.stderr), rel=EXACT)
    assert trend.detectable_per_week is not None
    seen = math.log1p(trend.detectable_per_week) / fit.stderr
    assert stats.nct.sf(t, 7, seen) == pytest.approx(0.8, abs=1e-6)
    at = 8 + 3 / 7 + 1.5  # the middle of two weeks after three days
    residual = y - fit.intercept - fit.slope * weeks
    s2 = residual @ residual / 7
    half = t * math.sqrt(s2 * (1 / 2 + 1 / 9 + (at - 4) ** 2 / 60))
    log_theta = _log_ratio(a, a.week >= 0) - fit.intercept - fit.slope * at
    assert found.line_lo == pytest.approx(math.exp(log_theta - half), rel=EXACT)
    assert found.line_hi == pytest.approx(math.exp(log_theta + half), rel=EXACT)


def test_the_shrunken_effect_equals_its_formula() -> None:
    rng = np.random.default_rng(6)
    b, a = noisy(rng, weeks=1, n_areas=5), noisy(rng, weeks=1, n_areas=5, first=1)
    found = before_after(b, a)
    n, x = np.vstack([b.n, b.comparison_n]), np.vstack([b.x_h, b.comparison_x_h])

    def influence(k: np.ndarray, h: np.ndarray) -> np.ndarray:
        return np.asarray(k / k.sum() - h / h.sum())

    site = influence(n.sum(axis=0), x.sum(axis=0))
    v = np.array([max(7 / 6 * ((influence(n[j], x[j]) - site) ** 2).sum(), 1 / n[j].sum()) for j in range(6)])
    logs = np.log(n.sum(axis=1) / x.sum(axis=1))
    w = 1 / v
    fixed = (w * logs).sum() / w.sum()
    tau2 = max(0.0, ((w * (logs - fixed) ** 2).sum() - 5) / (w.sum() - (w**2).sum() / w.sum()))
    mean = (logs / (v + tau2)).sum() / (1 / (v + tau2)).sum()
    weight = tau2 / (tau2 + v[0])
    assert found.value is not None
    assert found.shrunken is not None
    assert found.shrunken.weight == pytest.approx(weight, rel=1e-7)
    expected = found.value * math.exp((1 - weight) * (logs[0] - mean))
    assert found.shrunken.value == pytest.approx(expected, rel=1e-7)
    var_b, var_a = (7 / 6 * (_day_influence(p) ** 2).sum() for p in (b, a))
    half = stats.t.ppf(0.975, 6) * math.sqrt(var_a + weight * var_b)
    assert found.shrunken.lo == pytest.approx(expected * math.exp(-half), rel=1e-7)


def test_the_interval_reported_is_the_widest_reach_of_its_parts() -> None:
    rng = np.random.default_rng(7)
    for n_areas in (2, 5):
        h, a = noisy(rng, weeks=12, n_areas=n_areas), noisy(rng, weeks=2, n_areas=n_areas, first=12)
        found = before_after(h, a, history=h)
        parts = [(f"{k}_lo", f"{k}_hi") for k in ("day", "placebo", "week", "line")]
        known = [(getattr(found, lo), getattr(found, hi)) for lo, hi in parts if getattr(found, lo) is not None]
        assert len(known) == 3
        assert found.without_lo is not None
        assert found.without_hi is not None
        known.append((found.without_lo, found.without_hi))
        assert (found.lo, found.hi) == (min(lo for lo, _ in known), max(hi for _, hi in known))


def clear_in(found: BeforeAfter, part: str) -> bool:
    return bool(getattr(found, f"{part}_hi") < 1)


def test_clear_needs_days_and_placebos() -> None:
    """Areas that differ from week to week make a clear interval of days; the placebos say that it is nothing."""
    rng = np.random.default_rng(8)
    seen = 0
    for _ in range(60):
        periods = []
        for first in (0, 1):
            p = noisy(rng, weeks=1, n_areas=6, first=first)
            own = np.exp(rng.normal(0, 0.4, 7))
            periods.append(replace(p, n=np.round(p.n * own[0]), comparison_n=np.round(p.comparison_n * own[1:, None])))
        found = before_after(*periods)
        if clear_in(found, "day") and not clear_in(found, "placebo"):
            seen += 1
            assert found.verdict != "clear_fall"
    assert seen >= 3


def test_any_rate_will_do_and_its_violations_say_how_much_is_known() -> None:
    rng = np.random.default_rng(9)
    b, a = noisy(rng, weeks=2, n_areas=4), noisy(rng, weeks=2, n_areas=4, first=2)
    hours = [
        replace(p, n=p.n / 90, comparison_n=p.comparison_n / 90, events=p.n, comparison_events=p.comparison_n)
        for p in (b, a)
    ]
    counted, timed = before_after(b, a), before_after(*hours)
    for name in ("value", "lo", "hi", "log_se", "day_lo", "placebo_hi"):
        assert getattr(timed, name) == pytest.approx(getattr(counted, name), rel=EXACT)
    assert timed.n_before == counted.n_before
    few = before_after(*(replace(p, events=p.events * 0 + 1) for p in hours))
    assert few.value is None
    assert few.reason is not None
    assert few.reason.code == "logged_change.events_before"


CHANGED = [-0.08, -0.099, 0.042, 0.142, 0.247, 0.178, 0.145, 0.155, 0.342, 0.463]
OTHERS = [
    [0.027, -0.073, 0.004, 0.31, 0.22, 0.077, 0.292, 0.234, 0.337, 0.401],
    [-0.071, 0.082, 0.047, 0.021, 0.148, 0.216, -0.004, 0.161, 0.115, 0.223],
    [-0.129, 0.009, 0.01, -0.01, -0.078, -0.006, -0.069, -0.089, 0.076, -0.051],
    [0.117, 0.058, -0.226, -0.013, -0.164, -0.063, -0.076, -0.292, -0.13, -0.146],
]


def test_weights_equal_those_of_pysyncon_and_of_a_general_solver() -> None:
    found = synthetic_weights(CHANGED, OTHERS, weeks_after=4)
    # pysyncon 1.7.0, VanillaOptimMixin.w_optimize, V = 1, the ridge as further covariates
    assert found == pytest.approx([0.447114, 0.325613, 0.199630, 0.027642], abs=1e-6)
    y, z = np.array(CHANGED) - np.mean(CHANGED), np.array(OTHERS) - np.mean(OTHERS, axis=1, keepdims=True)
    penalty = math.sqrt(4) * np.diff(z, axis=1).std(ddof=1) ** 2 * 10
    solved = minimize(
        lambda w: ((y - w @ z) ** 2).sum() + penalty * w @ w,
        np.full(4, 0.25),
        bounds=[(0, 1)] * 4,
        constraints={"type": "eq", "fun": lambda w: w.sum() - 1},
        method="SLSQP",
        options={"ftol": 1e-16, "maxiter": 1000},
    )
    assert found == pytest.approx(solved.x, abs=1e-6)


def test_weights_need_ten_weeks_and_an_effect_with_them_is_that_of_weighted_log_rates() -> None:
    rng = np.random.default_rng(10)
    h, a = noisy(rng, weeks=10, n_areas=5), noisy(rng, weeks=2, n_areas=5, first=10)
    last = h.week >= 8
    b = PeriodDays(
        h.n[last], h.x_h[last], h.comparison_n[:, last], h.comparison_x_h[:, last], h.weekday[last], h.week[last]
    )
    assert before_after(b, a).weights is None
    found = before_after(b, a, history=h)
    assert found.weights is not None
    assert sum(found.weights) == pytest.approx(1)
    w = np.array(found.weights)
    log = sum(
        sign
        * (math.log(p.n.sum() / p.x_h.sum()) - w @ np.log(p.comparison_n.sum(axis=1) / p.comparison_x_h.sum(axis=1)))
        for p, sign in ((a, 1), (b, -1))
    )
    assert found.value == pytest.approx(math.exp(log), rel=EXACT)


def _log_ratio(p: PeriodDays, days: np.ndarray) -> float:
    own = p.n[days].sum() / p.x_h[days].sum()
    return math.log(own * p.comparison_x_h[:, days].sum() / p.comparison_n[:, days].sum())


def _day_influence(p: PeriodDays) -> np.ndarray:
    n, x = p.comparison_n.sum(axis=0), p.comparison_x_h.sum(axis=0)
    return np.asarray(p.n / p.n.sum() - p.x_h / p.x_h.sum() - (n / n.sum() - x / x.sum()))
