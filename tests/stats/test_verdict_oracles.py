"""Weeks, neighbouring days and families: each estimator beside its formula in plain Python, scipy or by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from statistics import mean, median

import numpy as np
import pytest
from day_worlds import AREAS, OFFICE, WEEKDAYS_OFFICE, Variation, World, step
from scipy import stats

from vsd_analytics.stats.changes import compare_encounter_rates, compare_exposure, compare_violation_rates
from vsd_analytics.stats.earlier_days import day_correlation, inflation
from vsd_analytics.stats.estimates import ChangeEstimate
from vsd_analytics.stats.false_alarms import FalseAlarms, false_alarm_rate, together, wilson
from vsd_analytics.stats.family import judge_family, p_value, pull_changes, q_values
from vsd_analytics.stats.influence import as_counts
from vsd_analytics.stats.rates import encounter_rate, violation_rate
from vsd_analytics.stats.weekly_steps import mean_square, step_variance, weekly_steps

A, B, X = [40, 44, 37, 52, 27], [30, 41, 26, 47, 16], [10.0] * 5
WEEKS = [[180, 210, 190, 205, 195, 200, 170, 220, 185, 198, 207, 192]]


def test_a_level_by_hand() -> None:
    # 200 violations in 50 h; usual share of a day 40; residuals 0, 4, -3, 12, -13 -> squares 338
    level = violation_rate([A], [X])
    assert level.value == 4.0
    variance = 5 / 4 * 338 / 200**2
    # correlation .14: 1 + 2 (4/5 .14 + 3/5 .0196 + 2/5 .002744 + 1/5 .00038416)
    mean_factor = 1 + 2 * (0.8 * 0.14 + 0.6 * 0.0196 + 0.4 * 0.002744 + 0.2 * 0.00038416)
    variance *= mean_factor / (1 - (mean_factor - 1) / 4)
    assert level.log_se == pytest.approx(math.sqrt(variance), rel=1e-9)
    half = 2.7764451051977934 * math.sqrt(variance)  # Student's t at .975 on 4 degrees of freedom
    assert (level.lo, level.hi) == pytest.approx((4 * math.exp(-half), 4 * math.exp(half)), rel=1e-6)
    per_person_h = encounter_rate(A, X)
    assert (per_person_h.lo, per_person_h.hi) == pytest.approx((level.lo, level.hi))


def test_a_change_without_history_by_hand() -> None:
    # shares of days: A .2 .22 .185 .26 .135, B .1875 .25625 .1625 .29375 .1
    gaps = [30 / 160 - 0.2, 41 / 160 - 0.22, 26 / 160 - 0.185, 47 / 160 - 0.26, 16 / 160 - 0.135]
    by_days = 5 / 4 * sum(gap**2 for gap in gaps)
    noise = 1 / 200 + 1 / 160
    by_weeks = by_days + max(2.6 * (by_days - noise), 2 * 0.08**2)
    halves = [2.7764451051977934 * math.sqrt(by_days), 2.4469118511449692 * math.sqrt(by_weeks)]  # t on 4 and on 6
    found = compare_violation_rates([A], [X], [B], [X])
    assert found.value == 0.8
    assert (found.lo, found.hi) == pytest.approx((0.8 * math.exp(-max(halves)), 0.8 * math.exp(max(halves))), rel=1e-6)
    assert (compare_encounter_rates(A, X, B, X).lo, compare_exposure([A], [X], [B], [X]).lo) == pytest.approx(
        (found.lo, found.lo)
    )


def past_weeks(totals: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return weeks of these totals whose days have the shares of A."""
    n = np.array(totals, dtype=float)[:, None, None] * np.array(A) / 200
    return n, np.full(n.shape, 10.0)


def test_a_change_with_twelve_weeks_is_as_wide_as_its_weekly_steps_by_hand() -> None:
    n, x = past_weeks(WEEKS[0])
    totals = [*WEEKS[0], 200]
    steps = [math.log(totals[i + 1] / totals[i]) for i in range(12)]
    cap = (3 * median(abs(d) for d in steps) / stats.norm.ppf(0.75)) ** 2
    variance, df = mean(min(d * d, cap) for d in steps), 2 * 144 / 35
    found = compare_violation_rates([A], [X], [[0.8 * v for v in A]], [X], history_n=n, history_x_h=x)
    half = stats.t.ppf(0.975, df) * math.sqrt(variance)
    assert found.df == pytest.approx(df)
    assert (found.lo, found.hi) == pytest.approx((0.8 * math.exp(-half), 0.8 * math.exp(half)), rel=1e-6)


def test_steps_lead_from_week_to_week_and_over_weeks_not_recorded() -> None:
    n, x = past_weeks([100, 200, 400])
    of = as_counts([A], [X])
    assert weekly_steps(n, x, of=of) == pytest.approx([math.log(2), math.log(2), math.log(0.5)])
    x[1, 0, 3] = 0
    assert weekly_steps(n, x, of=of) == pytest.approx([math.log(4), math.log(0.5)])
    assert len(weekly_steps(np.repeat(n, 6, axis=0), np.full((18, 1, 5), 10.0), of=of)) == 12


def test_prior_fades_as_own_steps_come() -> None:
    assert step_variance(np.zeros(0), day_variance=0.02, noise=0.01) == pytest.approx((0.02 + 2.6 * 0.01, 6))
    own_df = 2 * 4 / 5  # two steps: half of the prior's 6 degrees of freedom are left
    both = (own_df * 0.04 + 3 * 0.046) / (own_df + 3)
    found = step_variance(np.array([0.2, -0.2]), day_variance=0.02, noise=0.01)
    assert found == pytest.approx((both, own_df + 3))
    assert step_variance(np.full(4, 0.2), day_variance=9.0, noise=0.0) == pytest.approx((0.04, 2 * 16 / 11))


def test_calm_days_do_not_prove_calm_weeks() -> None:
    assert step_variance(np.zeros(0), day_variance=0.001, noise=0.001)[0] == pytest.approx(0.001 + 2 * 0.08**2)
    four_weeks = step_variance(np.zeros(0), day_variance=0.001, noise=0.001, n_days=28)
    assert four_weeks[0] == pytest.approx(0.001 + 2 * 0.08**2 / 4)


def test_one_week_in_which_something_changed_does_not_widen_all_that_follow() -> None:
    calm = np.array([0.05, -0.04, 0.06, -0.05, 0.04, -0.06, 0.05, -0.05])
    shaken = np.append(calm, -0.5)
    assert mean_square(shaken) < (shaken**2).mean() / 3


def test_correlation_of_days_is_that_of_the_series_pulled_towards_the_prior() -> None:
    rng = np.random.default_rng(1)
    n = rng.poisson(500, 28).astype(float)
    weekday = np.tile(np.arange(7), 4)
    left = n / np.array([n[weekday == w].mean() for w in weekday]) - 1
    own = (left[1:] @ left[:-1]) / (left @ left) * 28 / 27
    history = as_counts(n, np.full(28, 9.0))
    assert day_correlation(history, weekday) == pytest.approx(max(0.0, (21 * own + 1.4) / 31))
    one_week = as_counts(n[:7], np.full(7, 9.0))
    assert day_correlation(one_week, weekday[:7]) == 0.14


@pytest.mark.parametrize(("r", "n_days"), [(0.0, 5), (0.14, 7), (0.6, 6)])
def test_inflation_is_that_of_the_matrix_of_correlations(r: float, n_days: int) -> None:
    matrix = r ** np.abs(np.subtract.outer(np.arange(n_days), np.arange(n_days)))
    center = np.eye(n_days) - 1 / n_days
    assert inflation(r, n_days=n_days) == pytest.approx(
        matrix.sum() / n_days / (np.trace(center @ matrix) / (n_days - 1))
    )


def change(theta: float, se: float, df: float = 8.0) -> ChangeEstimate:
    """Return a change with a Student interval."""
    half = stats.t.ppf(0.975, df) * se
    lo, hi = theta * math.exp(-half), theta * math.exp(half)
    verdict = "clear_fall" if hi < 1 else "clear_rise" if lo > 1 else "cannot_tell"
    return ChangeEstimate(
        theta, lo, hi, 4.0, 4 * theta, 200, 200 * theta, 50, 50, 5, df, se, verdict, "ok", None, False
    )


def test_p_values_are_student_s() -> None:
    assert p_value(change(0.7, 0.1), confidence=0.95) == pytest.approx(2 * stats.t.sf(-math.log(0.7) / 0.1, 8))
    assert p_value(change(1.0, 0.1), confidence=0.95) == 1.0


def test_a_change_with_poisson_limits_has_a_small_p_value_only_when_it_is_clear() -> None:
    gone = compare_violation_rates([[20, 22, 25, 28, 35]], [X], [[0, 0, 1, 0, 1]], [X])
    few = compare_violation_rates([[2, 2, 1, 1, 2]], [X], [[0, 1, 1, 0, 1]], [X])
    assert gone.verdict == "clear_fall"
    assert (p_value(gone, confidence=0.95) or 1) < 1e-3
    assert few.verdict == "too_little_data"
    assert p_value(few, confidence=0.95) is None


def test_q_values_are_those_of_scipy() -> None:
    p = [0.001, 0.3, 0.012, 0.04, 0.7]
    assert q_values([p[0], None, *p[1:]]) == pytest.approx(
        [(q := stats.false_discovery_control(p, method="by"))[0], None, *q[1:]]
    )
    assert q_values([None]) == [None]


def test_pulled_changes_by_hand() -> None:
    # own deviations .2, -.2; Q = .04/.01 + .04/.01 = 8; tau^2 = (8 - 2) / 200 = .03; b = .01/.04
    logs, variances = pull_changes(np.array([0.1, -0.3]), np.array([0.01, 0.01]), floor=-0.1, floor_v=0.004)
    assert logs == pytest.approx([-0.1 + 0.75 * 0.2, -0.1 - 0.75 * 0.2])
    assert variances == pytest.approx([0.75 * 0.01 + 0.0625 * (0.004 + 0.04)] * 2)
    alike, _ = pull_changes(np.array([-0.09, -0.11]), np.array([0.01, 0.01]), floor=-0.1, floor_v=0.004)
    assert alike == pytest.approx([-0.1, -0.1])


def test_a_family_needs_more_than_each_alone() -> None:
    barely, calm = change(0.78, 0.1), change(1.01, 0.1)
    assert barely.verdict == "clear_fall"
    family = judge_family([(calm, [barely, *[calm] * 7]), (calm, [calm] * 8)])
    assert family[0][0].verdict == "cannot_tell"
    alone = judge_family([(change(0.5, 0.1), [change(0.5, 0.1), *[calm] * 7])])
    assert alone[0][0].verdict == "clear_fall"
    assert alone[0][1].verdict == "cannot_tell"


def test_a_change_without_an_interval_is_no_part_of_the_family() -> None:
    nothing = replace(change(1.0, 0.1), lo=None, hi=None, verdict="too_little_data", state="not_enough_data")
    clear = change(0.6, 0.1)
    with_it = judge_family([(clear, [clear, nothing, clear])])[0]
    assert with_it[1].verdict == "too_little_data"
    assert with_it[0].q_value == judge_family([(clear, [clear, clear])])[0][0].q_value


def test_areas_about_the_same_are_so_by_their_own_interval_too() -> None:
    tight, wide = change(1.0, 0.02), change(1.0, 0.2)
    judged = judge_family([(tight, [tight, wide, tight])])[0]
    assert [area.verdict for area in judged] == ["about_same", "cannot_tell", "about_same"]


def test_false_alarms_of_two_figures_count_all_their_verdicts_and_no_more_weeks_than_there_are() -> None:
    both = together([FalseAlarms(0.1, 0.0, 0.3, 26, 50), FalseAlarms(0.04, 0.0, 0.2, 20, 25)])
    assert both.value == pytest.approx(6 / 75)
    assert (both.n_weeks, both.n_verdicts) == (20, 75)
    assert (both.lo, both.hi) == wilson(both.value, n=20, confidence=0.95)


def test_wilson_is_that_of_scipy() -> None:
    known = stats.binomtest(3, 26).proportion_ci(method="wilson")
    assert wilson(3 / 26, n=26, confidence=0.95) == pytest.approx((known.low, known.high))


def test_a_site_with_three_open_days_gets_a_verdict_from_eight_steps_on() -> None:
    world = World(OFFICE, weekdays=WEEKDAYS_OFFICE[:3])
    drawn = world.draw(np.random.default_rng(3), sites=1, weeks=12, effect=step(12, at=11, ratio=0.4))
    n, x = drawn.n[0], np.broadcast_to(drawn.x_h, drawn.n.shape[1:])
    few, enough = (
        compare_violation_rates(n[10], x[10], n[11], x[11], history_n=n[k:10], history_x_h=x[k:10]) for k in (3, 2)
    )
    assert few.verdict == "too_little_data"
    assert enough.verdict == "clear_fall"


def test_false_alarms_are_counted_on_shuffled_weeks() -> None:
    drawn = World(Variation(0.1, week_sd=0.05)).draw(np.random.default_rng(4), sites=1, weeks=26)
    x = np.broadcast_to(drawn.x_h, drawn.n.shape[1:])
    found = false_alarm_rate(drawn.n[0], x)
    assert found is not None
    assert (found.n_weeks, found.n_verdicts) == (26, 50)
    assert found.lo <= found.value <= found.hi
    assert found.value <= 0.15
    assert false_alarm_rate(drawn.n[0, :9], x[:9]) is None
    stepped = drawn.n[0] * np.where(np.arange(26) < 13, 1.0, 0.3)[:, None, None]
    change_for_good = false_alarm_rate(stepped, x)
    assert change_for_good is not None
    assert change_for_good.value <= 0.15, "a change for good is shuffled away"


@pytest.mark.simulation
def test_areas_of_a_site_in_which_nothing_changes_seldom_get_a_clear_verdict() -> None:
    world = World(OFFICE, weekdays=WEEKDAYS_OFFICE, shares=AREAS)
    drawn, n_clear = world.draw(np.random.default_rng(5), sites=60, weeks=14), 0
    x = drawn.x_h[0]
    for n in drawn.n:
        floor, *areas = (
            compare_violation_rates(c[12], x, c[13], x, history_n=c[:12, None], history_x_h=np.tile(x, (12, 1, 1)))
            for c in (n.sum(axis=1), *np.moveaxis(n, 1, 0))
        )
        n_clear += sum(area.verdict.startswith("clear") for area in judge_family([(floor, areas)])[0])
    assert n_clear <= 2
