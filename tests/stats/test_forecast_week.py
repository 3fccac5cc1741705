"""The forecast of a week: what it is made of, what it refuses, and that it beats the seasonal naive one."""

from __future__ import annotations

import numpy as np
import prove_forecast as prove
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate, stats

from vsd_analytics.stats.forecast import chances, forecast_week, score_forecast
from vsd_analytics.wording.reasons import reason_text

SLOTS = 168
ONES = np.ones(SLOTS)


def weeks_of(n_weeks: int, *, seed: int = 1, mean: float = 40.0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.poisson(mean * (1 + np.arange(SLOTS) % 24 / 12), (n_weeks, SLOTS)).astype(float)


def test_weeks_that_are_all_alike_are_forecast_as_they_were() -> None:
    week = 10.0 + np.arange(SLOTS) % 24
    made = forecast_week(np.tile(week, (6, 1)), np.ones((6, SLOTS)), is_count=False)
    assert made.state == "ok"
    assert made.mean == pytest.approx(week)
    assert made.lo == pytest.approx(week)
    assert made.naive == pytest.approx(week)
    assert made.level == pytest.approx(1.0)


def test_at_level_one_an_hour_is_its_median() -> None:
    """Weeks are permutations of one another within each pair of slots, so all levels are 1."""
    rng = np.random.default_rng(3)
    half = rng.gamma(5, 10, (8, SLOTS // 2))
    n = np.concatenate([half, 200 - half], axis=1)
    made = forecast_week(n, np.ones_like(n), is_count=False)
    assert made.mean == pytest.approx(np.median(n, axis=0))


def test_late_weeks_lift_the_forecast() -> None:
    n = np.tile(20.0 + np.arange(SLOTS) % 24, (8, 1))
    n[-3:] *= 1.5
    made = forecast_week(n, np.ones_like(n), is_count=False)
    assert 1.2 < made.level < 1.5
    assert (made.mean > 1.2 * n[0]).all()


def test_a_missing_hour_is_not_zero() -> None:
    """Taking hours away at random leaves the forecast where it is; calling them 0 would halve it."""
    n, rng = weeks_of(8), np.random.default_rng(2)
    whole = forecast_week(n, np.ones_like(n), is_count=True)
    x_h = (rng.random(n.shape) > 0.3).astype(float)
    holey = forecast_week(np.where(x_h > 0, n, np.nan), x_h, is_count=True)
    told = ~np.isnan(holey.mean)
    assert np.median(np.abs(holey.mean[told] / whole.mean[told] - 1)) < 0.05
    assert np.mean(holey.mean[told] / whole.mean[told]) == pytest.approx(1, abs=0.02)


def test_what_was_counted_in_a_missing_hour_does_not_matter() -> None:
    n = weeks_of(8)
    x_h = np.ones_like(n)
    x_h[2, 30:60] = 0
    other = n.copy()
    other[2, 30:60] = 9_999
    a, b = (forecast_week(v, x_h, is_count=True) for v in (n, other))
    assert np.array_equal(a.mean, b.mean, equal_nan=True)
    assert np.array_equal(a.hi, b.hi, equal_nan=True)


def test_fewer_than_four_weeks_are_refused_with_the_rule() -> None:
    n = weeks_of(8)
    x_h = np.ones_like(n)
    x_h[:5] = 0
    made = forecast_week(n, x_h, is_count=True)
    assert (made.state, reason_text(made.reason)) == ("not_enough_data", "a forecast needs 4 recorded weeks, has 3")
    assert np.isnan(made.mean).all()
    assert score_forecast(made, n[0], ONES).state == "not_enough_data"
    assert chances(n, x_h).reason == made.reason


def test_an_hour_recorded_in_three_weeks_only_is_not_forecast() -> None:
    n = weeks_of(8)
    x_h = np.ones_like(n)
    x_h[3:, 50] = 0
    made = forecast_week(n, x_h, is_count=True)
    assert np.flatnonzero(np.isnan(made.mean)).tolist() == [50]
    assert made.n_weeks[50] == 3


def test_closed_hours_are_not_forecast() -> None:
    n = weeks_of(8)
    open_h = ONES.copy()
    open_h[24:48] = 0
    made = forecast_week(n, np.ones_like(n), is_count=True, open_h=open_h)
    assert np.isnan(made.mean[24:48]).all()
    assert np.isnan(made.naive[24:48]).all()
    assert not np.isnan(made.mean[:24]).any()


def test_only_the_last_eight_recorded_weeks_of_an_hour_count() -> None:
    late = np.tile(20.0 + np.arange(SLOTS) % 24, (8, 1))
    n = np.concatenate([late[:, ::-1], late])
    made = forecast_week(n, np.ones_like(n), is_count=False)
    assert made.n_weeks.max() == 8
    assert made.mean == pytest.approx(late[0])


def test_clocks_put_back_or_forward_change_no_rate() -> None:
    """A slot of two hours counts twice as much in twice the time; one of no hour is missing."""
    n = np.tile(30.0 + np.arange(SLOTS) % 24, (6, 1))
    x_h = np.ones_like(n)
    n[2, 146], x_h[2, 146] = 2 * n[2, 146], 2.0  # Sunday 02, twice
    n[4, 146], x_h[4, 146] = 0.0, 0.0
    made = forecast_week(n, x_h, is_count=False)
    assert made.mean == pytest.approx(n[0])
    assert made.n_weeks[146] == 5


def test_an_hour_half_open_has_a_wider_range_per_hour() -> None:
    n = weeks_of(8, mean=10)
    half = ONES.copy()
    half[30] = 0.5
    whole_hour, half_hour = (forecast_week(n, np.ones_like(n), is_count=True, open_h=h) for h in (ONES, half))
    assert half_hour.mean[30] == whole_hour.mean[30]
    assert half_hour.hi[30] - half_hour.lo[30] > whole_hour.hi[30] - whole_hour.lo[30]


@settings(max_examples=20, deadline=None)
@given(factor=st.floats(0.01, 100))
def test_the_unit_of_an_amount_does_not_matter(factor: float) -> None:
    n = np.random.default_rng(5).gamma(4, 5, (7, SLOTS))
    a, b = (forecast_week(n * f, np.ones_like(n), is_count=False) for f in (1.0, factor))
    assert b.mean == pytest.approx(a.mean * factor, rel=1e-6)
    assert b.lo == pytest.approx(a.lo * factor, rel=1e-4, abs=1e-9)


def test_rare_counts_are_forecast_by_their_mean_not_by_a_median_of_zero() -> None:
    n = np.zeros((8, SLOTS))
    n[::4] = 1.0
    made = forecast_week(n, np.ones_like(n), is_count=True)
    assert (made.mean > 0.1).all()


def test_the_chance_of_any_is_that_of_a_gamma_poisson() -> None:
    rng = np.random.default_rng(8)
    rates = rng.gamma(2, 0.1, SLOTS)
    n = rng.poisson(rates, (8, SLOTS)).astype(float)
    made = chances(n, np.ones_like(n))
    total, weeks = n.sum(axis=0), 8.0
    m = total.sum() / (weeks * SLOTS)
    v = ((weeks * (total / weeks - m) ** 2).sum() - m * (SLOTS - 1)) / (weeks * (SLOTS - 1))
    for slot in (0, 17, 100):
        law = stats.gamma(m * m / v + total[slot], scale=1 / (m / v + weeks))
        none, _ = integrate.quad(lambda r, law=law: np.exp(-r) * law.pdf(r), 0, 20)
        assert made.chance[slot] == pytest.approx(1 - none, rel=1e-6)
        assert made.rate[slot] == pytest.approx(law.mean())


def test_what_was_never_seen_has_a_small_chance_and_not_none() -> None:
    made = chances(np.zeros((8, SLOTS)), np.ones((8, SLOTS)))
    assert made.state == "ok"
    assert (made.chance > 0).all()
    assert made.chance.max() < 0.01


def test_a_score_is_what_its_formula_says() -> None:
    n = np.tile([[10.0], [14.0]], (3, SLOTS))
    n = n.reshape(6, SLOTS)
    made = forecast_week(n, np.ones_like(n), is_count=False)
    now, x_h = np.full(SLOTS, 12.0), ONES.copy()
    now[:3], x_h[3] = 60.0, 0.0
    score = score_forecast(made, now, x_h)
    kept = x_h > 0
    error = np.abs(now - made.mean)[kept]
    assert made.scale == pytest.approx(4.0)
    assert score.n_hours == 167
    assert score.wape == pytest.approx(error.sum() / now[kept].sum())
    assert score.mase == pytest.approx(error.mean() / 4)
    assert score.mase_naive == pytest.approx(np.abs(now - 14.0)[kept].mean() / 4)
    inside = ((now >= made.lo) & (now <= made.hi))[kept].mean()
    assert score.hit_rate == pytest.approx(inside)
    assert 0 < inside < 1


def test_a_week_without_data_has_no_score() -> None:
    made = forecast_week(weeks_of(8), np.ones((8, SLOTS)), is_count=True)
    score = score_forecast(made, np.zeros(SLOTS), np.zeros(SLOTS))
    assert (score.wape, score.state, score.n_hours) == (None, "not_enough_data", 0)


@pytest.mark.simulation
@pytest.mark.parametrize("which", [0, 1], ids=["people", "violations"])
def test_a_year_of_forecasts_beats_the_seasonal_naive_one_and_the_plain_median(which: int) -> None:
    found = [row for seed in (1, 2) for row in prove.run_forecasts(seed, world=prove.WORLDS[0], which=which)]
    mean = {key: float(np.mean([row[key] for row in found])) for key in found[0]}
    assert mean["MASE"] < 0.9 * mean["MASE naive"]
    assert mean["MASE"] < mean["MASE median"]
    assert 0.74 < mean["hit"] < 0.9


def test_shapes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="168"):
        forecast_week(np.ones((4, 24)), np.ones((4, 24)), is_count=True)
    with pytest.raises(ValueError, match="negative"):
        forecast_week(-np.ones((4, SLOTS)), np.ones((4, SLOTS)), is_count=True)
