"""Changes: oracles derived another way, invariances, verdicts, guards."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from vsd_analytics.stats.changes import compare_encounter_rates, compare_exposure, compare_violation_rates, split_change
from vsd_analytics.stats.estimates import verdict_of
from vsd_analytics.stats.rates import violation_rate
from vsd_analytics.wording.reasons import reason_text

HOURS = np.array([[13.0] * 6 + [8.0]] * 2)
PROFILE = np.array([20, 22, 25, 28, 35, 60, 15])

counts = arrays(np.int64, (2, 7), elements=st.integers(5, 200))
hours = arrays(np.float64, (2, 7), elements=st.floats(1, 24))


def brute_force_change(n_a: np.ndarray, n_b: np.ndarray, x: np.ndarray) -> tuple[float, float, float]:
    """The paired change with the prior of weekly steps, by loops, for cameras that all recorded all days."""
    influences, rates = [], []
    for n in (n_a, n_b):
        rate = sum(n[c].sum() / x[c].sum() for c in range(len(n)))
        rates.append(rate)
        influences.append(
            [
                sum((n[c, d] - n[c].sum() / x[c].sum() * x[c, d]) / x[c].sum() for c in range(len(n))) / rate
                for d in range(n.shape[1])
            ]
        )
    n_days = n_a.shape[1]
    variance = n_days / (n_days - 1) * sum((b - a) ** 2 for a, b in zip(*influences, strict=True))
    noise = 0.0
    for n, rate in zip((n_a, n_b), rates, strict=True):
        noise += sum((n[c].sum() / x[c].sum() / rate) ** 2 / n[c].sum() for c in range(len(n)))
    by_weeks = variance + max(2.6 * (variance - noise), 2 * 0.08**2)
    halves = (stats.t.ppf(0.975, n_days - 1) * np.sqrt(variance), stats.t.ppf(0.975, 6) * np.sqrt(by_weeks))
    factor = np.exp(max(halves))
    theta = rates[1] / rates[0]
    return theta, theta / factor, theta * factor


@given(counts, counts, hours)
@settings(max_examples=60, deadline=None)
def test_change_equals_the_house_plans_formula_when_all_cameras_recorded(
    n_a: np.ndarray, n_b: np.ndarray, x: np.ndarray
) -> None:
    change = compare_violation_rates(n_a, x, n_b, x)
    assert (change.value, change.lo, change.hi) == pytest.approx(brute_force_change(n_a, n_b, x), rel=1e-9)
    assert change.df == pytest.approx(6)


@given(counts, counts, hours)
@settings(max_examples=40, deadline=None)
def test_swapping_the_periods_inverts_the_change(n_a: np.ndarray, n_b: np.ndarray, x: np.ndarray) -> None:
    x = x.copy()
    x[0, 1:3] = 0
    there, back = compare_violation_rates(n_a, x, n_b, x), compare_violation_rates(n_b, x, n_a, x)
    assert (there.value, there.lo, there.hi) == pytest.approx((1 / back.value, 1 / back.hi, 1 / back.lo))


@given(counts, counts, hours, st.permutations(range(7)))
@settings(max_examples=40, deadline=None)
def test_order_of_pairs_changes_nothing(n_a: np.ndarray, n_b: np.ndarray, x: np.ndarray, order: list[int]) -> None:
    one = compare_violation_rates(n_a, x, n_b, x)
    other = compare_violation_rates(n_a[:, order], x[:, order], n_b[:, order], x[:, order])
    assert (one.value, one.lo, one.hi) == pytest.approx((other.value, other.lo, other.hi))


def test_camera_days_recorded_in_one_period_only_are_not_compared() -> None:
    x_a, x_b = HOURS.copy(), HOURS.copy()
    x_a[0, 2], x_b[1, 5] = np.nan, 0
    n_a, n_b = np.array([PROFILE, PROFILE]), np.array([PROFILE + 3, PROFILE + 2])
    both = HOURS.copy()
    both[0, 2] = both[1, 5] = 0
    one, other = compare_violation_rates(n_a, x_a, n_b, x_b), compare_violation_rates(n_a, both, n_b, both)
    assert one == other
    assert (one.n_a, one.exposure_a_h) == (2 * PROFILE.sum() - 25 - 60, 2 * 86 - 26)


def test_camera_without_common_hours_is_left_out_of_both() -> None:
    x_b = HOURS.copy()
    x_b[1] = 0
    n = np.array([PROFILE, PROFILE * 9])
    change = compare_violation_rates(n, HOURS, n, x_b)
    assert change.left_out == (1,)
    assert (change.value, change.n_a) == (1, PROFILE.sum())


def test_weekday_profile_cancels_when_weekdays_are_paired() -> None:
    change = compare_violation_rates([PROFILE * 20], HOURS[:1], [PROFILE * 10], HOURS[:1])
    assert change.value == pytest.approx(0.5)
    assert change.log_se == pytest.approx(math.sqrt(2) * 0.08, abs=1e-12), (
        "only weeks may differ: the prior of weekly steps"
    )
    assert change.verdict == "clear_fall"


def test_few_days_or_violations_are_too_little_data() -> None:
    short = compare_violation_rates([PROFILE[:4]], HOURS[:1, :4], [PROFILE[:4]], HOURS[:1, :4])
    assert (short.verdict, short.state, short.lo) == ("too_little_data", "not_enough_data", None)
    assert short.value == 1
    assert "5 pairs of days recorded in both, has 4" in reason_text(short.reason)
    rare = compare_violation_rates([[1, 0, 0, 0, 1, 0, 0]], HOURS[:1], [[0, 1, 1, 1, 0, 1, 0]], HOURS[:1])
    assert (rare.verdict, rare.value) == ("too_little_data", 2)


def test_many_violations_to_none_is_a_clear_fall_and_few_to_none_is_not() -> None:
    none = [[0] * 7]
    fall = compare_violation_rates([PROFILE], HOURS[:1], none, HOURS[:1])
    assert (fall.verdict, fall.value, fall.lo, fall.is_conservative) == ("clear_fall", 0, 0, True)
    assert 3 / PROFILE.sum() < fall.hi < 0.05
    few = compare_violation_rates([[1, 1, 1, 1, 1, 1, 0]], HOURS[:1], none, HOURS[:1])
    assert (few.verdict, few.lo, few.hi) == ("too_little_data", None, None)


def test_none_to_many_violations_is_a_clear_rise_without_upper_limit() -> None:
    rise = compare_violation_rates([[0] * 7], HOURS[:1], [PROFILE], HOURS[:1])
    assert (rise.verdict, rise.value, rise.change, rise.hi) == ("clear_rise", None, None, None)
    assert rise.lo > 10


def test_no_violation_in_either_period_is_too_little_data() -> None:
    nothing = compare_violation_rates(np.zeros((2, 7)), HOURS, np.zeros((2, 7)), HOURS)
    assert (nothing.verdict, nothing.value, nothing.rate_a) == ("too_little_data", None, 0)


def test_nothing_recorded_in_common_is_too_little_data() -> None:
    nothing = compare_violation_rates(np.ones((2, 7)), HOURS, np.ones((2, 7)), np.zeros((2, 7)))
    assert (nothing.verdict, nothing.rate_a, nothing.n_days) == ("too_little_data", None, 0)


def test_cameras_that_recorded_one_day_each_are_too_little_data() -> None:
    n, x = np.eye(5) * 20, np.eye(5) * 10
    assert compare_violation_rates(n, x, n, x).verdict == "too_little_data"


def test_risk_needs_positions_and_exposure_in_both_periods() -> None:
    n, people = [5] * 7, [30.0] * 7
    assert compare_encounter_rates(n, None, n, people).state == "not_measurable"
    thin = compare_encounter_rates(n, people, n, [2.0] * 7)
    assert (thin.verdict, thin.state) == ("too_little_data", "not_enough_data")
    assert "20 person-hours in each period, has 14.0" in reason_text(thin.reason)


def test_more_people_at_the_same_risk_explain_the_whole_rise() -> None:
    rng = np.random.default_rng(2)
    people = PROFILE * 10.0 * rng.uniform(0.98, 1.02, 7)
    n = np.round(people * 2)
    per_open_h = compare_violation_rates(n, HOURS[0], n * 1.5, HOURS[0])
    crowd = compare_exposure(people, HOURS[0], people * 1.5, HOURS[0])
    encounter_rate = compare_encounter_rates(n, people, n * 1.5, people * 1.5)
    split = split_change(violation_rate=per_open_h, people=crowd, encounter_rate=encounter_rate)
    assert (per_open_h.verdict, crowd.verdict, encounter_rate.verdict) == ("clear_rise", "clear_rise", "cannot_tell")
    assert split.people_share == pytest.approx(1)
    assert split.rest == pytest.approx(1)
    assert crowd.rate_a == pytest.approx(people.sum() / 86)


def test_split_multiplies_back_to_the_whole_change() -> None:
    rng = np.random.default_rng(4)
    n_a, n_b = rng.poisson(PROFILE * 20), rng.poisson(PROFILE * 25)
    people_a, people_b = PROFILE * rng.gamma(50, 0.2, 7), PROFILE * rng.gamma(50, 0.22, 7)
    split = split_change(
        violation_rate=compare_violation_rates(n_a, HOURS[0], n_b, HOURS[0]),
        people=compare_exposure(people_a, HOURS[0], people_b, HOURS[0]),
        encounter_rate=compare_encounter_rates(n_a, people_a, n_b, people_b),
    )
    assert split.people.value * split.encounter_rate.value * split.rest == pytest.approx(split.violation_rate.value)
    assert split.rest == pytest.approx(1)


def test_split_of_an_unclear_change_names_no_share() -> None:
    same = compare_violation_rates([PROFILE], HOURS[:1], [PROFILE[::-1]], HOURS[:1])
    assert same.verdict == "cannot_tell"
    assert split_change(violation_rate=same, people=same, encounter_rate=same).people_share is None


@pytest.mark.parametrize(
    ("lo", "hi", "verdict"),
    [
        (0.8, 0.99, "clear_fall"),
        (1.01, 1.2, "clear_rise"),
        (0.9, 1.0, "about_same"),
        (1.0, 1.1, "about_same"),
        (0.85, 1.15, "about_same"),
        (0.84, 1.05, "cannot_tell"),
        (0.95, 1.16, "cannot_tell"),
        (None, 1.05, "cannot_tell"),
        (0.95, None, "cannot_tell"),
        (1.5, None, "clear_rise"),
        (None, None, "too_little_data"),
    ],
)
def test_verdict_is_clear_only_when_the_interval_excludes_no_change(
    lo: float | None, hi: float | None, verdict: str
) -> None:
    assert verdict_of(lo, hi) == verdict


def test_one_sided_limits_split_the_error_between_the_two_periods() -> None:
    before = violation_rate([PROFILE], HOURS[:1], confidence=0.975)
    change = compare_violation_rates([PROFILE], HOURS[:1], [[0, 0, 1, 0, 0, 1, 0]], HOURS[:1])
    upper = stats.chi2.ppf(1 - 0.0125, 2 * 2 + 2) / 2 / 86
    lower = stats.chi2.ppf(0.0125, 2 * 2) / 2 / 86
    assert (change.lo, change.hi) == pytest.approx((lower / before.hi, upper / before.lo))
