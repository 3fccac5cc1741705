"""Places compared: no best one among places that are alike, the best one where it is, and what is left out."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from vsd_analytics.whatif.best_place import ComparedPlace, compared_places

WEEK = np.array([1.0, 0.9, 0.9, 1.0, 1.3, 1.8, 0.5])


def days(rng: np.random.Generator, levels: np.ndarray, n_days: int) -> np.ndarray:
    """Return people in the way at places by day: days differ for all places, and each place has chance of its own."""
    day = WEEK[np.arange(n_days) % 7] * rng.lognormal(0, 0.2, n_days)
    own = rng.lognormal(0, 0.15, (levels.size, n_days))
    return rng.poisson(levels[:, None] * day * own)


def found(levels: np.ndarray, n_days: int, n_searches: int, seed: int) -> list[tuple[ComparedPlace, ...]]:
    rng = np.random.default_rng(seed)
    narrow = [False] * levels.size
    return [compared_places(days(rng, levels, n_days), narrow) for _ in range(n_searches)]


@pytest.mark.parametrize("n_days", [5, 14])
@pytest.mark.parametrize("levels", [[100] * 2, [100] * 6, [8] * 6, [100, 100, 300, 300, 300, 300]])
def test_places_that_are_alike_have_no_best_one(levels: list[int], n_days: int) -> None:
    searches = found(np.array(levels), n_days, 1000, seed=len(levels) + levels[-1] + n_days)
    assert (
        sum(any(place.standing == "best" for place in places) for places in searches) <= 60
    )  # 5 %, and 1.4 sd of 1000


def test_ranges_of_all_places_hold_together() -> None:
    levels = np.array([60, 80, 100, 120])
    truth = levels * WEEK.mean() * np.exp(0.2**2 / 2) * np.exp(0.15**2 / 2)
    searches = found(levels, 14, 400, seed=3)
    held = [all(p.lo <= t <= p.hi for p, t in zip(places, truth, strict=True)) for places in searches]
    assert np.mean(held) >= 0.93


def test_the_best_place_is_found_where_it_is_and_no_other() -> None:
    levels = np.array([100, 70, 100, 110, 130, 100])
    best = Counter(k for places in found(levels, 14, 300, seed=5) for k, p in enumerate(places) if p.standing == "best")
    assert best[1] >= 0.9 * best.total() > 100
    assert best.total() - best[1] <= 3


def test_a_place_that_leaves_too_narrow_a_way_is_listed_and_not_compared() -> None:
    n = np.array([[1] * 7, [10, 11, 9, 10, 11, 9, 10], [20, 22, 21, 20, 22, 21, 20]])
    places = compared_places(n, [True, False, False])
    assert [place.standing for place in places] == ["narrow", "best", "more"]
    assert [place.more for place in places] == [pytest.approx(-9), 0, pytest.approx(10.857, abs=1e-3)]
    assert [p.standing for p in compared_places(n, [True, True, True])] == ["narrow"] * 3
    assert [p.standing for p in compared_places(n, [True, False, True])] == ["narrow", "only", "narrow"]


def test_few_days_show_nothing() -> None:
    places = compared_places(np.array([[1, 1, 1, 1], [50, 50, 50, 50]]), [False, False])
    assert [place.standing for place in places] == ["lowest", "no_difference"]
    assert np.isnan([place.hi for place in places]).all()
    assert compared_places(np.zeros((2, 0), np.int64), [False, False])[0].per_day == 0
