"""The steadiness of a site's days: an analysis of variance as oracle, and when the past has no say."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vsd_analytics.stats.changes import compare_encounter_rates, compare_exposure, compare_violation_rates
from vsd_analytics.stats.influence import as_counts
from vsd_analytics.stats.steadiness import pooled, usual_variance

N_WEEKS, N_DAYS = 5, 5
HOURS = np.full((1, N_DAYS), 10.0)
history = arrays(np.int64, (N_WEEKS, 1, N_DAYS), elements=st.integers(20, 400))


def steady(seed: int, *, sd: float, weeks: int = N_WEEKS, mean: float = 600.0) -> np.ndarray:
    """Draw weeks of one camera whose days differ by a gamma factor of mean 1 and `sd`."""
    rng = np.random.default_rng(seed)
    return rng.poisson(mean * rng.gamma(1 / sd**2, sd**2, (weeks, 1, N_DAYS))).astype(float)


@given(history)
@settings(max_examples=30)
def test_usual_variance_is_the_interaction_of_a_two_way_analysis_of_variance(n: np.ndarray) -> None:
    shares = n[:, 0] / n[:, 0].sum(axis=1, keepdims=True)
    week, day = np.divmod(np.arange(N_WEEKS * N_DAYS), N_DAYS)
    design = np.column_stack([week[:, None] == np.arange(N_WEEKS), day[:, None] == np.arange(1, N_DAYS)]).astype(float)
    effects, _, rank, _ = np.linalg.lstsq(design, shares.ravel(), rcond=None)
    left = shares.ravel() - design @ effects
    df = len(left) - rank
    found = usual_variance(n, np.broadcast_to(HOURS, n.shape), of=as_counts(n[0], HOURS))
    assert found is not None
    assert found[1] == df == (N_WEEKS - 1) * (N_DAYS - 1)
    assert found[0] == pytest.approx(2 * N_DAYS * (left @ left) / df, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("factor", [0.1, 1.0, 30.0])
def test_a_busier_past_is_as_steady_as_a_quiet_one(factor: float) -> None:
    n, hours = steady(1, sd=0.1), np.broadcast_to(HOURS, (N_WEEKS, 1, N_DAYS))
    of = as_counts(n[0], HOURS)
    assert usual_variance(n * factor, hours, of=of) == pytest.approx(usual_variance(n, hours, of=of))


def test_weeks_with_a_missing_day_say_nothing() -> None:
    n, hours = steady(2, sd=0.1), np.broadcast_to(HOURS, (N_WEEKS, 1, N_DAYS)).copy()
    of = as_counts(n[0], HOURS)
    hours[0, 0, 3] = 0
    four = usual_variance(n, hours, of=of)
    assert four == usual_variance(n[1:], hours[1:], of=of)
    hours[1, 0, 3] = np.nan
    assert usual_variance(n, hours, of=of) is None


def test_the_past_counts_as_much_as_the_weeks_compared_at_most() -> None:
    assert pooled(0.02, 4, usual=(0.01, 16)) == pytest.approx(((4 * 0.02 + 4 * 0.01) / 8, 8))
    assert pooled(0.02, 6, usual=(0.01, 3)) == pytest.approx(((6 * 0.02 + 3 * 0.01) / 9, 9))


def test_weeks_less_steady_than_ever_are_judged_by_themselves() -> None:
    assert pooled(0.05, 4, usual=(0.01, 16)) == (0.05, 4)
    assert pooled(0.05, 4, usual=(0.0, 16)) == (0.05, 4)


def test_a_steady_past_narrows_a_change_and_moves_nothing_else() -> None:
    past, hours = steady(3, sd=0.05, weeks=12), np.broadcast_to(HOURS, (12, 1, N_DAYS))
    a, b = steady(4, sd=0.05, weeks=2)
    alone = compare_violation_rates(a, HOURS, b, HOURS)
    informed = compare_violation_rates(a, HOURS, b, HOURS, history_n=past, history_x_h=hours)
    assert (informed.value, informed.n_a, informed.n_days) == (alone.value, alone.n_a, alone.n_days)
    assert informed.hi / informed.lo < alone.hi / alone.lo


def test_all_three_changes_use_the_past_alike() -> None:
    past, hours = steady(5, sd=0.05), np.broadcast_to(HOURS, (N_WEEKS, 1, N_DAYS))
    a, b = steady(6, sd=0.05, weeks=2)
    violation_rate = compare_violation_rates(a, HOURS, b, HOURS, history_n=past, history_x_h=hours)
    encounter_rate = compare_encounter_rates(
        a[0], HOURS[0], b[0], HOURS[0], history_n=past[:, 0], history_exposure_h=hours[:, 0]
    )
    people = compare_exposure(a, HOURS, b, HOURS, history_h=past, history_x_h=hours)
    assert (violation_rate.lo, violation_rate.hi) == pytest.approx((encounter_rate.lo, encounter_rate.hi))
    assert (violation_rate.lo, violation_rate.hi) == pytest.approx((people.lo, people.hi))


def test_a_camera_that_missed_a_day_is_judged_by_weeks_over_the_camera_days_it_has() -> None:
    past, hours = np.repeat(steady(7, sd=0.05), 2, axis=1), np.full((N_WEEKS, 2, N_DAYS), 10.0)
    x = np.full((2, N_DAYS), 10.0)
    x[1, 2] = 0
    a, b = past[0], past[1]
    known = compare_violation_rates(a, x, b, x, history_n=past, history_x_h=hours)
    blanked = compare_violation_rates(a, x, b, x, history_n=past, history_x_h=np.where(x > 0, hours, 0.0))
    assert known == blanked
    assert known.lo != compare_violation_rates(a, x, b, x).lo
