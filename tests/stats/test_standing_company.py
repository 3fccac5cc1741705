"""Company of people who stand: the formula, and what it does with circles, lines and permuted people."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsd_analytics.stats.standing_company import mean_distances_mm, stands_together

RULE = {"together_mm": 1250, "reach_mm": 2000}


def called(places: np.ndarray, is_long: np.ndarray | None = None) -> set[tuple[int, int]]:
    """Return which of some people, who do not move, stand together."""
    pairs = [(i, j) for i in range(len(places)) for j in range(i + 1, len(places))]
    mm = np.array([round(1000 * float(np.hypot(*(places[i] - places[j])))) for i, j in pairs], dtype=np.int64)
    is_near = mm < RULE["reach_mm"]
    a, b = np.array(pairs, dtype=np.int64).reshape(-1, 2)[is_near].T
    is_long = np.ones(len(a), dtype=np.bool_) if is_long is None else is_long[is_near]
    found = stands_together(a, b, mm[is_near], is_long, **RULE)
    return set(zip(a[found].tolist(), b[found].tolist(), strict=True))


def by_definition(places: np.ndarray) -> set[tuple[int, int]]:
    """Return the same by the formula, pair by pair."""
    n = len(places)
    mm = np.array([[min(2000, round(1000 * float(np.hypot(*(p - q))))) for q in places] for p in places])
    near = [{i, *(k for k in range(n) if k != i and mm[i, k] <= 1250)} for i in range(n)]

    def seen_from(i: int, j: int) -> float:
        return float(np.mean([mm[k, j] for k in near[i] if k != j]))

    pairs = ((i, j) for i in range(n) for j in range(i + 1, n))
    return {(i, j) for i, j in pairs if mm[i, j] < 2000 and (seen_from(i, j) + seen_from(j, i)) / 2 <= 1250}


@given(st.integers(0, 2**32 - 1), st.integers(2, 12))
@settings(max_examples=200, deadline=None)
def test_pairs_are_those_of_the_formula(seed: int, n: int) -> None:
    places = np.random.default_rng(seed).uniform(0, 3, (n, 2)).round(3)
    assert called(places) == by_definition(places)


def test_a_circle_is_a_company_and_a_line_is_not() -> None:
    angles = np.arange(5) * 2 * np.pi / 5
    circle = 0.8 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    line = np.stack([1.1 * np.arange(5), np.zeros(5)], axis=1)
    assert {i for pair in called(circle) for i in pair} == set(range(5))
    assert called(line) == set()


def test_who_is_close_for_too_short_a_time_is_no_company() -> None:
    two = np.array([[0.0, 0.0], [1.0, 0.0]])
    assert called(two) == {(0, 1)}
    assert called(two, np.array([False])) == set()
    assert called(two[:1]) == set()


@pytest.mark.parametrize(
    ("close_ms", "seen_ms", "mean_mm"), [(10, 10, 1000), (10, 20, 1500), (10, 5, 1000), (10, 30, 1666)]
)
def test_time_apart_counts_as_reach(close_ms: int, seen_ms: int, mean_mm: int) -> None:
    mm_ms, close, seen = (np.array([v]) for v in (1000 * close_ms, close_ms, seen_ms))
    assert mean_distances_mm(mm_ms, close, seen, reach_mm=2000).tolist() == [mean_mm]
