"""Hours of the week: cameras that are down, spread, shrunk rates, peaks and their ties."""

from __future__ import annotations

import numpy as np
import prove_forecast as prove
import pytest

from vsd_analytics.answer import Reason
from vsd_analytics.stats.hour_of_week import as_weeks, peaks, recorded_hours, slot_rates, spread

SLOTS = 168
OPEN = np.ones((4, SLOTS))


def test_with_all_cameras_up_counts_are_added_over_the_recorded_time() -> None:
    n = np.random.default_rng(1).poisson(9, (3, 4, SLOTS)).astype(float)
    weeks = recorded_hours(n, np.ones_like(n), OPEN, min_share=0.5)
    assert np.array_equal(weeks.n, n.sum(axis=0))
    assert weeks.x_h == pytest.approx(OPEN)


def test_a_camera_that_is_down_does_not_lower_the_rate() -> None:
    n = np.stack([np.full((4, SLOTS), 30.0), np.full((4, SLOTS), 10.0)])
    x_h = np.ones_like(n)
    x_h[1, 2, 40:80] = 0
    weeks = recorded_hours(n, x_h, OPEN, min_share=0.5)
    assert weeks.rate == pytest.approx(np.full((4, SLOTS), 40.0))
    assert weeks.x_h[2, 50] == pytest.approx(0.75)


def test_without_the_camera_that_counts_most_the_hour_is_missing() -> None:
    n = np.stack([np.full((4, SLOTS), 30.0), np.full((4, SLOTS), 10.0)])
    x_h = np.ones_like(n)
    x_h[0, 2, 40:80] = 0
    weeks = recorded_hours(n, x_h, OPEN, min_share=0.5)
    assert (weeks.x_h[2, 40:80] == 0).all()
    assert np.isnan(weeks.rate[2, 40:80]).all()


def test_hours_recorded_for_less_than_half_and_unknown_counts_are_missing() -> None:
    n, x_h = np.full((1, 4, SLOTS), 5.0), np.ones((1, 4, SLOTS))
    x_h[0, 0, 0], x_h[0, 1, 0], n[0, 2, 0] = 0.49, 0.5, np.nan
    rate = recorded_hours(n, x_h, OPEN, min_share=0.5).rate[:, 0]
    assert np.isnan(rate[[0, 2]]).all()
    assert rate[[1, 3]] == pytest.approx([10, 5])


def test_a_camera_that_never_recorded_is_left_out() -> None:
    n = np.stack([np.full((4, SLOTS), 30.0), np.full((4, SLOTS), np.nan)])
    x_h = np.stack([OPEN, 0 * OPEN])
    assert recorded_hours(n, x_h, OPEN, min_share=0.5).rate == pytest.approx(30 * OPEN)


@pytest.mark.parametrize("dispersion", [0.0, 0.05, 0.3])
def test_the_spread_of_counts_is_found(dispersion: float) -> None:
    rng = np.random.default_rng(4)
    mean = np.tile(20 + 5 * (np.arange(SLOTS) % 24), (8, 1)).astype(float)
    factor = rng.gamma(1 / dispersion, dispersion, mean.shape) if dispersion else 1.0
    weeks = as_weeks(rng.poisson(mean * factor), np.ones_like(mean))
    assert spread(weeks, is_count=True).dispersion == pytest.approx(dispersion, rel=0.2, abs=0.003)


def test_the_spread_of_amounts_is_found() -> None:
    rng = np.random.default_rng(4)
    mean = np.tile(2 + 5 * (np.arange(SLOTS) % 24), (12, 1)).astype(float)
    people = rng.poisson(4 * mean * rng.gamma(20, 1 / 20, mean.shape)) / 4
    found = spread(as_weeks(people, np.ones_like(mean)), is_count=False)
    assert found.dispersion == pytest.approx(0.05, rel=0.25)
    assert found.noise == pytest.approx(0.25, abs=0.35)


def test_without_more_spread_than_chance_rates_are_the_textbook_gamma_poisson() -> None:
    """Every slot the same counts in each week: no dispersion from week to week."""
    totals = np.random.default_rng(6).poisson(np.random.default_rng(7).gamma(3, 2, SLOTS)).astype(float)
    n = np.tile(totals, (4, 1))
    made = slot_rates(n, np.ones_like(n))
    m = totals.mean()
    v = ((4 * (totals - m) ** 2).sum() - m * (SLOTS - 1)) / (4 * (SLOTS - 1))
    assert made.rate == pytest.approx((m * m / v + 4 * totals) / (m / v + 4))
    assert ((made.lo < made.rate) & (made.rate < made.hi)).all()


def test_a_rate_from_little_exposure_is_pulled_most() -> None:
    rng = np.random.default_rng(9)
    n, x = rng.poisson(8, (4, SLOTS)).astype(float), np.full((4, SLOTS), 4.0)
    n[:, 20], x[:, 20] = [1, 1, 1, 1], 0.1  # a raw rate of 10, five times that of the others
    made = slot_rates(n, x)
    assert made.raw[20] == pytest.approx(10)
    assert made.rate[20] < 6


def test_an_hour_recorded_in_two_of_four_weeks_has_no_rate() -> None:
    x = np.ones((4, SLOTS))
    x[:2, 5] = 0
    made = slot_rates(np.full((4, SLOTS), 3.0), x)
    assert np.flatnonzero(np.isnan(made.rate)).tolist() == [5]
    assert slot_rates(np.zeros((4, SLOTS)), 0 * x).state == "not_enough_data"


def test_the_peak_is_reported_with_the_hours_it_cannot_be_distinguished_from() -> None:
    n = np.full((4, SLOTS), 10.0)
    n[:, 60], n[:, 61], n[:, 90] = 200, 195, 60
    found = peaks(slot_rates(n, np.ones_like(n)))
    assert [24 * p.weekday + p.hour for p in found.top] == [60, 61, 90]
    assert found.tied == ((2, 13),)
    assert found.top[0].n == 800


def test_a_peak_needs_events_and_data() -> None:
    few = np.zeros((4, SLOTS))
    few[0, :4] = 1
    assert peaks(slot_rates(few, np.ones_like(few))).reason == Reason("violations.few", least=5.0, has=4.0)
    assert peaks(slot_rates(few, 0 * few)).state == "not_enough_data"


@pytest.mark.simulation
def test_intervals_of_hours_hold_the_truth_and_beat_poissons() -> None:
    busy, quiet = ([r for seed in range(3) for r in prove.run_profiles(seed, world=prove.WORLDS[k])] for k in (0, -1))
    held, naive = (np.mean([row[key] for row in busy]) for key in ("held", "held naive"))
    assert 0.91 < held < 0.99
    assert naive < 0.8
    error, raw = (np.mean([row[key] for row in quiet]) for key in ("error", "error raw"))
    assert error < 0.9 * raw
