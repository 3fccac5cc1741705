"""Levels: oracles derived another way, invariances, guards."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from vsd_analytics.stats.earlier_days import day_skewness
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.stats.influence import as_counts, as_history, equal_weights, small_sample
from vsd_analytics.stats.quantiles import poisson_limits, t_quantile, z_quantile, zero_events_limit
from vsd_analytics.stats.rates import encounter_rate, violation_rate
from vsd_analytics.wording.reasons import reason_text

HOURS = np.array([[13.0] * 6 + [8.0]] * 3)
WEEK = np.arange(7)

counts = arrays(np.int64, (3, 7), elements=st.integers(5, 200))
hours = arrays(np.float64, (3, 7), elements=st.floats(1, 24))


def same(one: RateEstimate, other: RateEstimate) -> None:
    for name in one.__slots__:
        mine, theirs = getattr(one, name), getattr(other, name)
        is_number = isinstance(theirs, float)
        assert mine == (pytest.approx(theirs, rel=1e-9, abs=1e-9) if is_number else theirs), name


def brute_force_inflation(r: float, n_days: int) -> float:
    """Variance of the mean of an AR(1) over what differs between its days, from the matrix of correlations."""
    correlations = np.array([[r ** abs(i - j) for j in range(n_days)] for i in range(n_days)])
    of_mean = correlations.sum() / n_days**2
    between = (np.trace(correlations) - n_days * of_mean) / (n_days - 1)
    return n_days * of_mean / between


def brute_force_m0(n: np.ndarray, x: np.ndarray) -> tuple[float, float, float]:
    """The sum over cameras of rates, written with loops: rate, lo, hi of cameras that all recorded all days."""
    n_cameras, n_days = n.shape
    rate = sum(n[c].sum() / x[c].sum() for c in range(n_cameras))
    variance = 0.0
    for d in range(n_days):
        day = 0.0
        for c in range(n_cameras):
            r_c = n[c].sum() / x[c].sum()
            day += np.sqrt(n_days / (n_days - 1)) * (n[c, d] - r_c * x[c, d]) / x[c].sum()
        variance += day**2
    variance *= brute_force_inflation(0.14, n_days)
    factor = np.exp(stats.t.ppf(0.975, n_days - 1) * np.sqrt(variance) / rate)
    return rate, rate / factor, rate * factor


@given(counts, hours)
@settings(max_examples=60, deadline=None)
def test_violation_rate_equals_the_house_plans_formula_when_all_cameras_recorded(n: np.ndarray, x: np.ndarray) -> None:
    estimate = violation_rate(n, x)
    assert (estimate.value, estimate.lo, estimate.hi) == pytest.approx(brute_force_m0(n, x), rel=1e-9)
    assert estimate.df == pytest.approx(6)
    assert estimate.is_conservative


@given(counts, hours)
@settings(max_examples=60, deadline=None)
def test_encounter_rate_equals_the_ratio_estimator_of_r3(n: np.ndarray, x: np.ndarray) -> None:
    n_d, x_d = n[0], x[0] * 10
    estimate = encounter_rate(n_d, x_d)
    rate = n_d.sum() / x_d.sum()
    var_log = brute_force_inflation(0.14, 7) * 7 / 6 * ((n_d - rate * x_d) ** 2).sum() / x_d.sum() ** 2 / rate**2
    factor = np.exp(stats.t.ppf(0.975, 6) * np.sqrt(var_log))
    assert estimate.value == pytest.approx(rate)
    if n_d.sum() >= 30:
        assert (estimate.lo, estimate.hi) == pytest.approx((rate / factor, rate * factor))


@pytest.mark.parametrize("down", [(), (0, 1), (1, 2, 3, 4)])
def test_standard_error_is_near_the_delete_one_day_jackknife(down: tuple[int, ...]) -> None:
    rng = np.random.default_rng(5)
    ratios = []
    for _ in range(50):
        x = np.full((3, 28), 12.0)
        x[0, list(down)] = np.nan
        n = rng.poisson(60 * rng.gamma(16, 1 / 16, 28) * np.ones((3, 1)))
        logs = []
        for day in range(28):
            keep = np.arange(28) != day
            recorded = ~np.isnan(x[:, keep])
            totals = np.where(recorded, n[:, keep], 0).sum(axis=1) / np.nansum(x[:, keep], axis=1)
            logs.append(np.log(totals.sum()))
        jackknife = np.sqrt(27 / 28 * ((logs - np.mean(logs)) ** 2).sum())
        ratios.append(violation_rate(n, x).log_se / jackknife)
    # the jackknife takes days as independent
    assert np.median(ratios) / np.sqrt(brute_force_inflation(0.14, 28)) == pytest.approx(1, abs=0.04)


@given(counts, hours, st.permutations(range(7)), st.permutations(range(3)))
@settings(max_examples=40, deadline=None)
def test_order_of_days_and_cameras_changes_nothing(
    n: np.ndarray, x: np.ndarray, days: list[int], cameras: list[int]
) -> None:
    x = x.copy()
    x[1, 2:4] = 0
    one, other = violation_rate(n, x), violation_rate(n[cameras][:, days], x[cameras][:, days])
    assert (one.value, one.lo, one.hi, one.df) == pytest.approx((other.value, other.lo, other.hi, other.df))


@given(counts, hours, st.floats(0.01, 100))
@settings(max_examples=40, deadline=None)
def test_unit_of_exposure_scales_rate_and_limits_alike(n: np.ndarray, x: np.ndarray, scale: float) -> None:
    one, other = violation_rate(n, x), violation_rate(n, x * scale)
    assert (one.value, one.lo, one.hi) == pytest.approx(tuple(scale * v for v in (other.value, other.lo, other.hi)))


@given(counts, hours, st.sampled_from([0.0, np.nan]))
@settings(max_examples=40, deadline=None)
def test_camera_without_recorded_hour_is_left_out_and_named(n: np.ndarray, x: np.ndarray, empty: float) -> None:
    with_dead = violation_rate(np.insert(n, 1, 99, axis=0), np.insert(x, 1, empty, axis=0))
    alone = violation_rate(n, x)
    assert with_dead.left_out == (1,)
    assert (with_dead.value, with_dead.lo, with_dead.hi, with_dead.n_events) == pytest.approx(
        (alone.value, alone.lo, alone.hi, alone.n_events)
    )


@given(counts, hours)
@settings(max_examples=40, deadline=None)
def test_an_unrecorded_day_is_not_a_day_without_violations(n: np.ndarray, x: np.ndarray) -> None:
    more = violation_rate(np.insert(n, 3, 0, axis=1), np.insert(x, 3, np.nan, axis=1))
    same(more, violation_rate(n, x))
    empty_night = violation_rate(np.insert(n, 3, 0, axis=1), np.insert(x, 3, 12.0, axis=1))
    assert empty_night.value < more.value


def test_empty_night_does_not_change_the_risk() -> None:
    n, x = np.array([8, 9, 12, 10, 7, 11, 9]), np.array([9.0, 10, 11, 10, 8, 12, 9])
    same(encounter_rate(np.append(n, 0), np.append(x, 0.0)), encounter_rate(n, x))


def test_camera_down_half_the_week_does_not_move_the_expectation() -> None:
    rng = np.random.default_rng(3)
    up, down = [], []
    x_down = HOURS.copy()
    x_down[0, :4] = 0
    for _ in range(1500):
        n = rng.poisson(HOURS * np.array([[3.0], [2.0], [1.0]]) * rng.gamma(25, 1 / 25, 7))
        up.append(violation_rate(n, HOURS).value)
        down.append(violation_rate(np.where(x_down > 0, n, 0), x_down).value)
    assert np.mean(up) == pytest.approx(6, rel=0.01)
    assert np.mean(down) == pytest.approx(6, rel=0.01)


def test_missing_days_widen_the_interval_but_keep_it_usable() -> None:
    n = np.array([[40, 44, 37, 52, 61, 80, 30], [20, 25, 18, 30, 33, 41, 15]])
    x = HOURS[:2].copy()
    whole = violation_rate(n, x)
    x[1, 1:] = 0
    one_day = violation_rate(n, x)
    assert one_day.state == "ok"
    assert whole.log_se < one_day.log_se < 3 * whole.log_se
    assert one_day.df > 2


def test_weekday_differences_leave_the_interval_with_four_weeks_of_history() -> None:
    profile = np.array([20, 22, 25, 28, 35, 60, 15])
    rng = np.random.default_rng(8)
    past = rng.poisson(np.tile(profile, (3, 4)))
    now = rng.poisson(np.tile(profile, (3, 1)))
    known = {"weekday": WEEK, "history_weekday": np.tile(WEEK, 4), "history_x_h": np.tile(HOURS, 4)}
    informed, plain = violation_rate(now, HOURS, history_n=past, **known), violation_rate(now, HOURS)
    assert informed.value == plain.value
    assert not informed.is_conservative
    assert informed.hi / informed.lo < (plain.hi / plain.lo) ** 0.5
    three = {"weekday": WEEK, "history_weekday": np.tile(WEEK, 3), "history_x_h": np.tile(HOURS, 3)}
    short = violation_rate(now, HOURS, history_n=past[:, :21], **three)
    assert (short.df, short.is_conservative) == (plain.df, True), "three weeks are no profile"


def test_interval_reaches_to_the_usual_rate_with_the_weekdays_a_camera_missed() -> None:
    profile = np.array([20, 22, 25, 28, 35, 60, 15])
    past, x = np.tile(profile, (3, 4)), HOURS.copy()
    x[2, 5] = 0
    estimate = violation_rate(
        np.tile(profile, (3, 1)), x, weekday=WEEK, history_weekday=np.tile(WEEK, 4), history_n=past,
        history_x_h=np.tile(HOURS, 4),
    )  # fmt: skip
    assert estimate.is_conservative
    assert estimate.lo == pytest.approx(2 * 205 / 86 + 145 / 73)
    assert estimate.hi == pytest.approx(3 * 205 / 86)


def test_interval_reaches_down_to_the_usual_rate_when_a_quiet_weekday_was_missed() -> None:
    counts = np.array([3, 22, 25, 28, 35, 60, 15])
    past, x = np.tile(counts, (3, 4)), HOURS.copy()
    x[2, 0] = 0
    estimate = violation_rate(
        np.tile(counts, (3, 1)), x, weekday=WEEK, history_weekday=np.tile(WEEK, 4), history_n=past,
        history_x_h=np.tile(HOURS, 4),
    )  # fmt: skip
    usual = 3 * counts.sum() / HOURS[0].sum()
    assert estimate.value is not None
    assert estimate.value > usual
    assert (estimate.lo, estimate.hi) == (pytest.approx(usual), pytest.approx(estimate.value))


@pytest.mark.parametrize(("n_missing", "is_conservative"), [(1, False), (2, True)])
def test_weekday_profile_needs_all_but_one_of_its_weeks_recorded(n_missing: int, is_conservative: bool) -> None:
    past_x = np.tile(HOURS, 4)
    past_x[0, [5, 12][:n_missing]] = 0
    rng = np.random.default_rng(10)
    estimate = violation_rate(
        rng.poisson(30, (3, 7)), HOURS, weekday=WEEK, history_n=rng.poisson(30, (3, 28)), history_x_h=past_x,
        history_weekday=np.tile(WEEK, 4),
    )  # fmt: skip
    assert estimate.is_conservative == is_conservative


def test_history_read_backwards_changes_nothing() -> None:
    rng = np.random.default_rng(9)
    past, now, order = rng.poisson(30, (3, 28)), rng.poisson(30, (3, 7)), np.arange(28)[::-1]
    weekdays, hours = np.tile(WEEK, 4), np.tile(HOURS, 4)
    one = violation_rate(now, HOURS, weekday=WEEK, history_n=past, history_x_h=hours, history_weekday=weekdays)
    other = violation_rate(
        now, HOURS, weekday=WEEK, history_n=past[:, order], history_x_h=hours[:, order],
        history_weekday=weekdays[order],
    )  # fmt: skip
    assert one.log_se == pytest.approx(other.log_se)


def test_no_violation_gives_the_rule_of_three() -> None:
    x = HOURS.copy()
    x[1, :2] = 0
    estimate = violation_rate(np.zeros((3, 7)), x)
    assert (estimate.value, estimate.lo, estimate.state) == (0, 0, "ok")
    assert estimate.hi == pytest.approx(3 / (86 - 26))
    assert encounter_rate(np.zeros(7), np.full(7, 30.0)).hi == pytest.approx(3 / 210)


def test_too_few_days_or_violations_give_the_rate_without_an_interval() -> None:
    few_days = violation_rate([[20, 30, 25, 22]], [[13.0] * 4])
    assert (few_days.state, few_days.lo, few_days.hi) == ("not_enough_data", None, None)
    assert few_days.value == pytest.approx(97 / 52)
    assert "5 recorded days, has 4" in reason_text(few_days.reason)
    few_events = violation_rate([[1, 0, 0, 2, 0, 1, 0]], HOURS[:1])
    assert few_events.value == pytest.approx(4 / 86)
    assert few_events.lo is None
    assert "5 violations, has 4" in reason_text(few_events.reason)


def test_nothing_recorded_is_not_zero() -> None:
    estimate = violation_rate(np.zeros((2, 7)), np.full((2, 7), np.nan))
    assert (estimate.value, estimate.state, estimate.left_out) == (None, "not_enough_data", (0, 1))


def test_risk_needs_positions_and_exposure() -> None:
    assert encounter_rate([3] * 7, None).state == "not_measurable"
    thin = encounter_rate([3] * 7, [2.5] * 7)
    assert (thin.value, thin.state) == (None, "not_enough_data")
    assert "20 person-hours, has 17.5" in reason_text(thin.reason)


def test_few_violations_spread_evenly_by_luck_do_not_look_certain() -> None:
    estimate = violation_rate([[1] * 7], [[10.0] * 7])
    assert estimate.log_se == pytest.approx(0, abs=1e-12)
    assert np.log(estimate.hi / estimate.value) == pytest.approx(1.96 / np.sqrt(7), rel=1e-3)


@pytest.mark.parametrize(
    ("n", "x"),
    [
        ([[1, 2]], [[1.0, 2.0, 3.0]]),
        ([[1, -2]], [[1.0, 2.0]]),
        ([[1, np.nan]], [[1.0, 2.0]]),
        ([[1, 2]], [[1.0, -2.0]]),
        ([[1, 2]], [[1.0, np.inf]]),
    ],
)
def test_impossible_numbers_are_refused(n: list[list[float]], x: list[list[float]]) -> None:
    with pytest.raises(ValueError, match="must"):
        violation_rate(n, x)


def test_small_sample_correction_is_unbiased_where_a_day_moves_all_cameras() -> None:
    rng = np.random.default_rng(11)
    recorded = np.ones((4, 7))
    recorded[0, 2:] = 0
    recorded[1, 5:] = 0
    shares = np.array([0.3, 0.3, 0.3, 0.1])
    weights = recorded / recorded.sum(axis=1, keepdims=True)
    k, df = small_sample(weights, shares=shares, noise=shares**2 / 1e6)
    day = rng.normal(size=(20000, 1, 7))
    means = (day * weights).sum(axis=2)
    influence = (shares[:, None] * weights * (day - means[:, :, None])).sum(axis=1)
    estimates = k * (influence**2).sum(axis=1)
    assert estimates.mean() == pytest.approx((means @ shares).var(), rel=0.12)
    assert df == pytest.approx(2 * estimates.mean() ** 2 / estimates.var(), rel=0.06)


def test_equal_weights_give_the_textbook_correction() -> None:
    counts_ = as_counts(np.ones((2, 9)), np.ones((2, 9)))
    assert small_sample(equal_weights(counts_), shares=np.array([0.5, 0.5]), noise=np.array([0.1, 0.2])) == (
        pytest.approx(9 / 8),
        pytest.approx(8),
    )


@given(st.floats(1, 60), st.floats(0.5, 0.999))
@settings(max_examples=40, deadline=None)
def test_quantiles_equal_scipys_distributions(df: float, confidence: float) -> None:
    assert t_quantile(df, confidence=confidence) == pytest.approx(stats.t.ppf((1 + confidence) / 2, df))
    assert z_quantile(confidence=confidence) == pytest.approx(stats.norm.ppf((1 + confidence) / 2))


@pytest.mark.parametrize("n", [0, 1, 4, 30])
def test_poisson_limits_leave_the_stated_tails(n: int) -> None:
    lo, hi = poisson_limits(n, confidence=0.95)
    assert stats.poisson.cdf(n, hi) == pytest.approx(0.025)
    assert lo == 0 if n == 0 else stats.poisson.sf(n - 1, lo) == pytest.approx(0.025)


def test_rule_of_three_is_three_at_95_percent() -> None:
    assert zero_events_limit(confidence=0.95) == 3.0
    assert zero_events_limit(confidence=0.99) > 4.6


def test_small_sample_correction_covers_a_thin_camera_whose_violations_come_independently() -> None:
    noise = np.array([0.01, 0.0001])
    weights = np.array([[0.5, 0.5, 0, 0, 0, 0, 0], [1 / 7] * 7])
    k, _ = small_sample(weights, shares=np.array([0.1, 0.9]), noise=noise)
    assert k == pytest.approx(noise.sum() / (noise * [1 / 2, 6 / 7]).sum())


def test_interval_with_history_equals_its_formula_written_with_loops() -> None:
    rng = np.random.default_rng(12)
    profile = np.array([20, 22, 25, 28, 35, 60, 15])
    past, past_x, x = rng.poisson(np.tile(profile, 5)), rng.uniform(6, 13, 35), rng.uniform(6, 13, 7)
    n = rng.poisson(profile)
    estimate = violation_rate(n, x, weekday=WEEK, history_n=past, history_x_h=past_x, history_weekday=np.tile(WEEK, 5))
    usual = [sum(past[w::7]) / sum(past_x[w::7]) for w in range(7)]
    expected = [x[w] * usual[w] / sum(x[v] * usual[v] for v in range(7)) for w in range(7)]
    total, second, third = sum(n), sum(q**2 for q in expected), sum(q**3 for q in expected)
    var = sum(((n[w] - total * expected[w]) / total) ** 2 / (1 + x[w] / sum(past_x[w::7])) for w in range(7))
    k = max(second / (second - 2 * third + second**2), 1 / (1 - second))
    left = [past[i] / (past_x[i] * usual[i % 7]) - 1 for i in range(35)]
    own = sum(left[i] * left[i + 1] for i in range(34)) / sum(e**2 for e in left) * 35 / 34
    widened = brute_force_inflation(max(0.0, (28 * own + 10 * 0.14) / 38), 7)
    assert estimate.log_se == pytest.approx(np.sqrt(widened * k * var))
    spread = np.linalg.svd(np.diag(expected) - np.outer(expected, expected), compute_uv=False) ** 2
    assert estimate.df == pytest.approx(spread.sum() ** 2 / (spread**2).sum())
    t, centred = stats.t.ppf(0.975, estimate.df), np.sqrt(1 - 7 / 35) / (1 - 14 / 35)
    skewness = max(0.0, 28 * np.mean(np.power(left, 3)) / np.mean(np.square(left)) ** 1.5 * centred / 38)
    assert estimate.lo == pytest.approx(estimate.value * np.exp(-t * estimate.log_se))
    upper = t + skewness * (2 * t**2 + 1) / (6 * np.sqrt(7))
    assert estimate.hi == pytest.approx(estimate.value * np.exp(upper * estimate.log_se))
    assert not estimate.is_conservative


def test_weeks_before_with_a_few_very_busy_days_move_the_upper_end_only() -> None:
    rng = np.random.default_rng(5)
    now, steady = rng.poisson(100, 7), rng.poisson(100, 28)
    lumpy = steady.copy()
    lumpy[[3, 16]] *= 5
    settings = {"weekday": WEEK, "history_x_h": np.full(28, 10.0), "history_weekday": np.tile(WEEK, 4)}
    calm, coaches = (violation_rate(now, np.full(7, 10.0), history_n=h, **settings) for h in (steady, lumpy))
    reach = [np.log(e.hi / e.value) / np.log(e.value / e.lo) for e in (calm, coaches)]
    assert reach[0] < 1.2
    assert reach[1] > 1.5


@given(st.integers(4, 8), st.integers(0, 2**32 - 1))
def test_the_skewness_of_days_is_that_of_the_draws(weeks: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = np.array([0.8, 0.9, 1.0, 1.1, 1.3, 1.6, 0.5])
    counts = np.concatenate([1e6 * shape * rng.gamma(4, 0.25, 7) for _ in range(weeks)])
    weekday = np.tile(WEEK, weeks)
    history = as_history(counts, np.full(7 * weeks, 10.0), of=as_counts(counts[:7], np.full(7, 10.0)))
    usual = counts.reshape(weeks, 7).mean(axis=0)
    residual = counts / np.tile(usual, weeks) - 1
    n_free = 7 * weeks - 7
    plain = (residual**3).mean() / (residual**2).mean() ** 1.5
    unbiased = plain / ((1 - 2 / weeks) / np.sqrt(1 - 1 / weeks))
    assert day_skewness(history, weekday) == pytest.approx(max(0.0, n_free * unbiased / (n_free + 10)))
    assert day_skewness(replace(history, n=history.n * 7, x=history.x * 7), weekday) == pytest.approx(
        day_skewness(history, weekday)
    )
    two_weeks = as_history(counts[:14], np.full(14, 10.0), of=as_counts(counts[:7], np.full(7, 10.0)))
    assert day_skewness(two_weeks, weekday[:14]) == 0


@given(
    arrays(np.float64, (2, 9), elements=st.sampled_from([0.0, 1.0, 7.0, 3e3, 1e7, 1e12])),
    arrays(np.float64, (2, 9), elements=st.sampled_from([0.0, 1e-9, 1e-3, 1.0, 24.0, 1e6])),
    st.booleans(),
)
def test_an_interval_is_finite_or_there_is_none_however_large_or_tiny_the_numbers(
    n: np.ndarray, x_h: np.ndarray, has_history: bool
) -> None:
    history = {"history_n": np.tile(n, (1, 4)), "history_x_h": np.full((2, 36), 12.0)} if has_history else {}
    days = {"weekday": np.arange(9) % 7, "history_weekday": np.arange(36) % 7} if has_history else {}
    found = violation_rate(n, x_h, **history, **days)
    assert found.hi is None or (np.isfinite(found.hi) and found.lo is not None and found.lo <= found.hi)
    assert found.reason is None or reason_text(found.reason)
