"""Who is too close: as counted pair by pair, and after some records moved as counted anew."""

from __future__ import annotations

import numpy as np
import pytest

from vsd_analytics.whatif import closeness
from vsd_analytics.whatif.closeness import (
    FramePairs,
    is_close_to_any,
    n_close,
    n_close_after,
    near_strangers,
    stepped_aside,
)


def crowd(seed: int, n: int = 300) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.integers(0, 40, n), rng.uniform(0, 6, n), rng.uniform(0, 6, n)


def by_hand(frame: np.ndarray, x: np.ndarray, y: np.ndarray, within: float) -> list[int]:
    return [
        sum(frame[i] == frame[j] and i != j and np.hypot(x[i] - x[j], y[i] - y[j]) < within for j in range(frame.size))
        for i in range(frame.size)
    ]


@pytest.mark.parametrize("at_once", [4_000_000, 50])
def test_counts_are_those_of_every_pair(monkeypatch: pytest.MonkeyPatch, at_once: int) -> None:
    monkeypatch.setattr(closeness, "_PAIRS_AT_ONCE", at_once)
    frame, x, y = crowd(1)
    assert n_close(frame, x, y, within_m=2.0).tolist() == by_hand(frame, x, y, 2.0)


@pytest.mark.parametrize("seed", range(4))
def test_counts_after_a_move_are_those_of_all_pairs_anew(seed: int) -> None:
    frame, x, y = crowd(seed)
    moved = np.random.default_rng(seed + 9).choice(frame.size, 60, replace=False)
    new_x, new_y = x.copy(), y.copy()
    new_x[moved] += np.random.default_rng(seed + 3).uniform(-3, 3, moved.size)
    before = n_close(frame, x, y, within_m=2.0)
    after = n_close_after(before, frame, x, y, moved, new_x, new_y, within_m=2.0)
    assert after.tolist() == n_close(frame, new_x, new_y, within_m=2.0).tolist()
    assert after.tolist() != before.tolist()


def test_companions_are_no_strangers_and_nobody_steps_aside_for_them() -> None:
    places = np.array([0.0, 0.6, 1.5]), np.zeros(3)
    track, company = np.array([0, 1, 2]), np.array([7, 7, -1])
    frame = np.zeros(3, np.int64)
    pairs = near_strangers(
        FramePairs(frame), np.arange(3), frame, places, places, (track, company, track, company), within_m=2.0
    )
    assert set(zip(pairs[0].tolist(), pairs[1].tolist(), strict=True)) == {(0, 2), (1, 2), (2, 0), (2, 1)}
    assert is_close_to_any(pairs, places, places, within_m=1.0).tolist() == [False, True, True]
    x, y = stepped_aside(pairs, places, places, strength=0.5, reach_m=2.0)
    assert x.tolist() == pytest.approx([-0.25, 0.05, 2.05])
    assert y.tolist() == [0, 0, 0]
