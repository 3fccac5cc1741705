"""One verdict may be read every week: the e-value is the Bayes factor it says it is, and false ones stay rare."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import integrate, stats

from vsd_analytics.stats.running_verdict import EFFECT_VARIANCE, log_e_values, running_verdict

REFERENCE = [0.11, -0.05, 0.20, 0.02, -0.13, 0.07, 0.01, -0.02]
WEEKS = [-0.31, -0.12, -0.40, -0.22]


def bayes_factor(reference: list[float], weeks: list[float]) -> float:
    """Return the e-value by numeric integration over the effect: noncentral t against t."""
    m, n = len(reference), len(weeks)
    t, _ = stats.ttest_ind(weeks, reference)
    root = math.sqrt(m * n / (m + n))

    def weighted(delta: float) -> float:
        return float(stats.nct.pdf(t, m + n - 2, delta * root) * stats.norm.pdf(delta, 0, math.sqrt(EFFECT_VARIANCE)))

    total, _ = integrate.quad(weighted, -20, 20, epsabs=1e-13, epsrel=1e-11, limit=400, points=[t / root])
    return total / float(stats.t.pdf(t, m + n - 2))


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_the_e_value_equals_the_bayes_factor_by_numeric_integration(n: int) -> None:
    found = running_verdict(REFERENCE, WEEKS[:n])
    assert found.e_value == pytest.approx(bayes_factor(REFERENCE, WEEKS[:n]), rel=1e-6)
    assert len(found.e_by_week) == n


def test_the_bayes_factor_itself_follows_from_integrating_over_mean_and_sd() -> None:
    """The noncentral t of the other test is what remains when the unknown mean and sd are integrated out."""
    x, y = np.array(REFERENCE[:3]), np.array(WEEKS[:2])

    def likelihood(delta: float) -> float:
        def inner(log_sd: float) -> float:
            sd = math.exp(log_sd)
            z = np.concatenate([x, y - delta * sd])
            n = len(z)
            return math.exp(
                -((z - z.mean()) ** 2).sum() / 2 / sd**2 - (n - 1) * log_sd
            )  # mean integrated in closed form

        return integrate.quad(inner, -8, 3, epsabs=0, epsrel=1e-9, limit=300)[0]

    top = integrate.quad(
        lambda d: likelihood(d) * stats.norm.pdf(d, 0, math.sqrt(EFFECT_VARIANCE)), -16, 16, epsrel=1e-8, limit=300
    )[0]
    found = running_verdict(x, y, min_reference_weeks=3)
    assert found.e_value == pytest.approx(top / likelihood(0.0), rel=1e-6)


def test_the_running_interval_holds_exactly_the_effects_that_are_not_rejected() -> None:
    found = running_verdict(REFERENCE, WEEKS)
    assert found.lo is not None
    assert found.hi is not None
    for end in (found.lo, found.hi):
        moved = [w - math.log(end) for w in WEEKS]
        assert running_verdict(REFERENCE, moved).e_value == pytest.approx(20, rel=1e-6)


def test_two_weeks_of_any_effect_exclude_nothing_after_few_reference_weeks() -> None:
    found = running_verdict(REFERENCE[:4], [-9.0])
    assert found.state == "ok"
    assert (found.lo, found.hi) == (None, None)
    assert found.verdict not in ("clear_fall", "clear_rise")


def test_the_range_reaches_as_far_as_without_any_one_comparison_area_and_the_verdict_is_that_of_all() -> None:
    taken_up = ([0.10, -0.06, 0.18, 0.0, -0.1, 0.05], [-2.0, -1.9, -2.1])
    plain = ([0.02, -0.02, 0.05, 0.01, -0.05, 0.03], [-1.6, -1.5, -1.65])  # without the area that took the crowd up
    more = ([0.12, -0.07, 0.20, 0.02, -0.12, 0.06], [-2.2, -2.0, -2.3])
    found = running_verdict(*taken_up, without=[more, plain])
    alone, without_1, without_0 = (running_verdict(*y) for y in (taken_up, plain, more))
    assert found.lo == min(v.lo for v in (alone, without_1, without_0) if v.lo is not None)
    assert found.hi == max(v.hi for v in (alone, without_1, without_0) if v.hi is not None)
    assert (found.all_lo, found.all_hi, found.e_by_week) == (alone.lo, alone.hi, alone.e_by_week)
    assert found.all_hi is not None
    assert without_1.value is not None
    assert without_1.value > found.all_hi
    assert (found.rests_on, found.value) == (1, without_1.value)
    assert found.unclear_without is None


def test_a_fall_that_one_comparison_area_makes_is_not_clear_and_says_so() -> None:
    found = running_verdict(REFERENCE, [-0.5, -0.45, -0.52, -0.5], without=[(REFERENCE, [-0.1, 0.1, -0.05, 0.0])])
    assert found.e_value is not None
    assert found.e_value > 20
    assert (found.verdict, found.unclear_without) == ("cannot_tell", 0)
    assert found.hi is not None
    assert found.hi > 1, "its range is not cut off at no change"
    too_short = running_verdict(REFERENCE, WEEKS, without=[(REFERENCE[:3], WEEKS)])
    assert (too_short.lo, too_short.hi, too_short.without) == (too_short.all_lo, too_short.all_hi, (None,))


def test_a_clear_fall_stands_out_from_the_comparison_areas_own_shifts() -> None:
    fell = [-0.5, -0.45, -0.52, -0.5]
    beside = [running_verdict(REFERENCE, fell, spread=[half] * 4) for half in (0.0, 0.3, 0.6)]
    assert [found.verdict for found in beside] == ["clear_fall", "clear_fall", "cannot_tell"]
    assert len({found.e_value for found in beside}) == 1
    assert [found.clear_since is None for found in beside] == [False, False, True]
    assert beside[2].hi == pytest.approx(math.exp(np.mean(fell) - np.mean(REFERENCE) + 0.6))
    assert beside[2].spread_hi == beside[2].hi


def test_a_clear_fall_is_dated_by_the_first_week_that_shows_it() -> None:
    found = running_verdict(REFERENCE, [0.0, -0.5, -0.45, -0.52, -0.48, -0.5])
    assert found.verdict == "clear_fall"
    first = next(k for k, e in enumerate(found.e_by_week, start=1) if e >= 20)
    assert found.clear_since == first > 1


def test_units_of_the_log_ratio_do_not_matter_and_neither_does_its_level() -> None:
    plain = running_verdict(REFERENCE, WEEKS)
    other = running_verdict(np.array(REFERENCE) * 3 + 7, np.array(WEEKS) * 3 + 7)
    assert other.e_by_week == pytest.approx(plain.e_by_week, rel=1e-9)


def test_missing_weeks_are_left_out_and_only_the_last_twelve_before_count() -> None:
    long = [9.0, *REFERENCE, math.nan, *REFERENCE[:4]]
    found = running_verdict(long, [*WEEKS, math.nan])
    assert found == running_verdict([*REFERENCE, *REFERENCE[:4]], WEEKS)
    assert (found.n_reference, found.n_weeks) == (12, 4)


@pytest.mark.parametrize(
    ("reference", "weeks", "code"), [(REFERENCE[:3], WEEKS, "reference_weeks"), (REFERENCE, [math.nan], "week_after")]
)
def test_too_few_weeks_are_refused_with_their_number(reference: list[float], weeks: list[float], code: str) -> None:
    found = running_verdict(reference, weeks)
    assert (found.value, found.verdict, found.state) == (None, "too_little_data", "not_enough_data")
    assert found.reason is not None
    assert found.reason.code == f"logged_change.{code}"


def test_reading_half_a_year_long_says_clear_of_nothing_in_at_most_one_of_twenty_changes() -> None:
    rng = np.random.default_rng(1)
    for m in (4, 12):
        y, after = rng.normal(0, 0.2, (20_000, m)), rng.normal(0, 0.2, (20_000, 26))
        squares = ((y - y.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
        log_e = log_e_values(m, y.mean(axis=1), squares, after)
        ever = np.mean(log_e.max(axis=1) >= math.log(20))
        assert 0.005 < ever < 0.05


@pytest.mark.parametrize("m", [4, 8, 12])
def test_the_mean_of_an_e_value_is_one_when_nothing_changes(m: int) -> None:
    df, k = m - 1, m / (m + 1)

    def weighted(t: float) -> float:
        shift = t / math.sqrt(k)  # with squares = df the variance is 1
        return math.exp(log_e_values(m, 0.0, float(df), [shift])[0]) * float(stats.t.pdf(t, df))

    assert 2 * integrate.quad(weighted, 0, math.inf, limit=500)[0] == pytest.approx(1, rel=1e-6)


def test_the_arithmetic_for_many_changes_is_that_of_one() -> None:
    rng = np.random.default_rng(2)
    y, after = rng.normal(0, 0.1, (5, 6)), rng.normal(-0.1, 0.1, (5, 9))
    many = log_e_values(6, y.mean(axis=1), ((y - y.mean(axis=1, keepdims=True)) ** 2).sum(axis=1), after)
    for k in range(5):
        assert np.exp(many[k]) == pytest.approx(running_verdict(y[k], after[k]).e_by_week, rel=1e-9)


def test_weeks_that_are_all_alike_are_clear_and_no_error() -> None:
    assert running_verdict([0.0] * 6, [0.0] * 3).e_value == pytest.approx((1 + 2 * EFFECT_VARIANCE) ** -0.5)
    assert running_verdict([0.0] * 6, [-1.0] * 3).verdict == "clear_fall"
