"""Quantiles of whole numbers with intervals of days: against numpy and against days drawn one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from vsd_analytics.stats.others_met import MIN_TRACKS, count_quantiles


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_quantiles_are_those_of_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    numbers, day = rng.poisson(4, 400), rng.integers(0, 7, 400)
    found = count_quantiles(numbers, day, seed=1)
    expected = [np.quantile(numbers, q, method="inverted_cdf") for q in (0.5, 0.9)]
    assert [q.value for q in found.quantiles] == expected
    assert found.state == "ok"


def test_the_interval_is_that_of_days_drawn_one_by_one() -> None:
    rng = np.random.default_rng(5)
    day = np.repeat(np.arange(6), 60)
    numbers = rng.poisson(np.repeat([2.0, 3.0, 5.0, 4.0, 8.0, 6.0], 60))
    found = count_quantiles(numbers, day, seed=3, n_boot=300)
    drawn = np.random.default_rng(3).integers(0, 6, size=(300, 6))
    for q, quantile in zip((0.5, 0.9), found.quantiles, strict=True):
        draws = [
            np.quantile(np.concatenate([numbers[day == d] for d in days]), q, method="inverted_cdf") for days in drawn
        ]
        half = stats.t.ppf(0.975, 5) * np.std(draws, ddof=1) * math.sqrt(6 / 5)
        assert quantile.lo == pytest.approx(max(0.0, quantile.value - half), rel=1e-6)
        assert quantile.hi == pytest.approx(quantile.value + half, rel=1e-6)
        assert half > 0.5


def test_nobody_met_is_zero_with_a_limit_that_is_not_negative() -> None:
    numbers = [0] * 90 + [1] * 10
    found = count_quantiles(numbers, list(range(5)) * 20, seed=1)
    assert found.quantiles[0].value == 0
    assert found.quantiles[0].lo == 0


def test_thirty_people_are_needed_and_five_days_for_an_interval() -> None:
    few = count_quantiles([1] * (MIN_TRACKS - 1), [0] * (MIN_TRACKS - 1), seed=1)
    assert (few.state, few.quantiles[0].value) == ("not_enough_data", None)
    four = count_quantiles([2] * MIN_TRACKS, [i % 4 for i in range(MIN_TRACKS)], seed=1)
    assert (four.state, four.quantiles[0].value, four.quantiles[0].lo) == ("not_enough_data", 2, None)
    five = count_quantiles([2] * MIN_TRACKS, [i % 5 for i in range(MIN_TRACKS)], seed=1)
    assert (five.state, five.quantiles[0].lo, five.quantiles[0].hi) == ("ok", 2, 2)
