"""Rates pulled towards their mean: places of known spread, and the limits of knowing nothing and everything."""

from __future__ import annotations

import numpy as np
import pytest

from vsd_analytics.stats.shrinkage import between_places, pull, pull_limited


def limits(rates: np.ndarray, se: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    return rates * np.exp(-1.959964 * se), rates * np.exp(1.959964 * se)


def test_many_places_that_differ_by_chance_alone_get_nearly_the_mean() -> None:
    logs = np.linspace(-0.1, 0.1, 201)
    found = pull(np.exp(logs), *limits(np.exp(logs), 0.3), confidence=0.95)
    assert found is not None
    assert [p.weight for p in found] == pytest.approx([2 / 200] * 201)
    assert [np.log(p.value) for p in found] == pytest.approx(list(logs / 100), abs=1e-9)


def test_a_place_that_knows_keeps_its_rate_and_one_that_does_not_is_pulled() -> None:
    rates, se = np.array([4.0, 1.0, 1.0, 0.25, 4.0]), np.array([0.01, 0.01, 0.01, 0.01, 2.0])
    found = pull(rates, *limits(rates, se), confidence=0.95)
    assert found is not None
    assert found[0].value == pytest.approx(4.0, rel=0.01)
    assert 1.0 < found[4].value < 3.0
    assert found[4].hi / found[4].lo < np.exp(2 * 1.96 * 2.0)


def test_fewer_than_four_places_say_nothing_of_how_places_differ() -> None:
    assert pull([1.0, 2.0, 3.0], [0.5, 1.0, 2.0], [2.0, 4.0, 5.0], confidence=0.95) is None


def test_the_highest_of_many_equal_places_is_not_believed() -> None:
    """Picking the highest of twelve equal places overstates it; pulled, it hardly does."""
    rng = np.random.default_rng(4)
    naive, pulled = [], []
    for _ in range(300):
        logs = rng.normal(0, 0.2, 12)
        rates = np.exp(logs)
        found = pull(rates, *limits(rates, 0.2), confidence=0.95)
        assert found is not None
        naive.append(logs.max())
        pulled.append(max(np.log(p.value) for p in found))
    assert np.mean(naive) > 0.25
    assert np.mean(pulled) < 0.12


def test_intervals_hold_the_truth_and_are_narrower_than_those_they_came_from() -> None:
    rng = np.random.default_rng(5)
    held, narrower = [], []
    for _ in range(400):
        truth = rng.normal(0, 0.4, 10)
        se = rng.uniform(0.1, 0.6, 10)
        rates = np.exp(truth + rng.normal(0, se))
        lo, hi = limits(rates, se)
        found = pull(rates, lo, hi, confidence=0.95)
        assert found is not None
        held += [p.lo <= np.exp(t) <= p.hi for p, t in zip(found, truth, strict=True)]
        narrower.append(np.mean([np.log(p.hi / p.lo) for p in found]) < np.mean(np.log(hi / lo)))
    assert 0.935 <= np.mean(held) <= 0.975
    assert np.mean(narrower) > 0.95


def test_the_variance_between_places_is_found() -> None:
    rng = np.random.default_rng(6)
    found = [between_places(rng.normal(1.0, np.sqrt(0.25 + 0.04), 40), np.full(40, 0.04)) for _ in range(200)]
    assert np.mean([mean for mean, _ in found]) == pytest.approx(1.0, abs=0.03)
    assert np.mean([tau2 for _, tau2 in found]) == pytest.approx(0.25, abs=0.02)


def test_a_place_that_may_be_of_another_kind_keeps_the_truth_in_its_range() -> None:
    """Two of twenty differ by half: pulled without a limit, more of their ranges miss the truth."""
    rng, held, held_without = np.random.default_rng(6), [], []
    truth = np.where(np.arange(20) < 2, np.log(1.5), 0.0)
    for _ in range(200):
        df = rng.integers(4, 12, 20).astype(float)
        v = 0.15**2 * rng.chisquare(df) / df
        logs = truth + rng.normal(0, 0.15, 20)
        found = pull_limited(logs, v, df, tau=0.06, confidence=0.95)
        without = pull(np.exp(logs), *limits(np.exp(logs), np.sqrt(v)), confidence=0.95)
        assert without is not None
        held.append([np.log(p.lo) < x < np.log(p.hi) for p, x in zip(found, truth, strict=True)])
        held_without.append([np.log(p.lo) < x < np.log(p.hi) for p, x in zip(without, truth, strict=True)])
    share = np.mean(held, axis=0)
    assert share[:2].mean() > np.mean(held_without, axis=0)[:2].mean() + 0.1 > 0.6
    assert share[2:].mean() == pytest.approx(0.97, abs=0.025)


def test_within_the_limit_a_place_is_pulled_as_among_normal_ones_and_of_three_none_is() -> None:
    near, far, *_ = pull_limited([0.1, 0.8, 0.0, 0.0, 0.0], [0.04] * 5, [1e9] * 5, tau=0.2, confidence=0.95)
    assert near.weight == pytest.approx(1 - 2 / 4 * 0.04 / 0.08)
    assert far.value == pytest.approx(np.exp(0.8 - 0.25 * np.sqrt(0.08)))
    assert [p.weight for p in pull_limited([0.3, 0.0, 0.1], [0.04] * 3, [9.0] * 3, tau=0.1, confidence=0.95)] == [1] * 3
