"""Who is too close: as counted pair by pair, and after some records moved as counted anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.whatif.walkers import walkers
from vsd_analytics.whatif import frame_pairs
from vsd_analytics.whatif.arrays import in_order, n_different
from vsd_analytics.whatif.closeness import (
    is_close_to_any,
    n_close,
    n_close_after,
    n_close_recorded,
    near_strangers,
    nearest_strangers,
    stepped_aside,
)
from vsd_analytics.whatif.frame_pairs import FramePairs


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
    monkeypatch.setattr(frame_pairs, "_PAIRS_AT_ONCE", at_once)
    frame, x, y = crowd(1)
    assert n_close(FramePairs(frame), x, y, within_m=2.0).tolist() == by_hand(frame, x, y, 2.0)


@pytest.mark.parametrize("seed", range(4))
def test_counts_after_a_move_are_those_of_all_pairs_anew(seed: int) -> None:
    frame, x, y = crowd(seed)
    moved = np.random.default_rng(seed + 9).choice(frame.size, 60, replace=False)
    new_x, new_y = x.copy(), y.copy()
    new_x[moved] += np.random.default_rng(seed + 3).uniform(-3, 3, moved.size)
    before = n_close(FramePairs(frame), x, y, within_m=2.0)
    after = n_close_after(before, FramePairs(frame), (x, y), moved, (new_x, new_y), within_m=2.0)
    assert after.tolist() == n_close(FramePairs(frame), new_x, new_y, within_m=2.0).tolist()
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
    x, y = stepped_aside(nearest_strangers(pairs, places, places), places, places, strength=0.5, reach_m=2.0)
    assert x.tolist() == pytest.approx([-0.25, 0.05, 2.05])
    assert y.tolist() == [0, 0, 0]


def test_people_step_back_no_farther_than_to_the_distance_they_kept() -> None:
    places = np.array([0.0, 1.0, 10.0, 11.0]), np.zeros(4)
    others = np.array([0.0, 1.0, 10.0, 11.0]), np.zeros(4)
    nearest = np.array([0, 2]), np.array([1, 3])
    x, _ = stepped_aside(nearest, places, others, strength=0.5, reach_m=np.array([1.0, 1.6]))
    assert x.tolist() == pytest.approx([0.0, 1.0, 9.7, 11.0])


def test_a_day_at_a_time_gives_the_counts_of_all_days_together() -> None:
    rng = np.random.default_rng(2)
    ways = [((0.0, y), (9.0, y), 86400.0 * (k % 3) + rng.integers(0, 40)) for k, y in enumerate(rng.uniform(0, 4, 60))]
    records = walkers(*sorted(ways, key=lambda way: way[2]))
    records = replace(records, day=(records.t_s // 86400).astype(np.int64))
    assert len(list(records.days())) == 3
    together = n_close(records.frames, records.x_m, records.y_m, within_m=2.0)
    assert n_close_recorded(records, within_m=2.0).tolist() == together.tolist()
    assert together.any()


def test_somebody_who_is_there_at_midnight_keeps_two_days_together() -> None:
    records = walkers(((0.0, 0.0), (9.0, 0.0), 86395.0), ((0.0, 1.0), (9.0, 1.0), 86402.0))
    records = replace(records, day=(records.t_s // 86400).astype(np.int64))
    assert list(records.days()) == [slice(0, records.track.size)]


@pytest.mark.parametrize("far", [1, 2**60])
def test_rows_come_in_order_and_equal_ones_as_they_were(far: int) -> None:
    keys = np.random.default_rng(5).integers(-4, 4, 50) * far
    assert in_order(keys).tolist() == np.argsort(keys, kind="stable").tolist()
    assert n_different(np.sort(keys)) == len(set(keys.tolist()))
    assert (in_order(keys[:0]).size, n_different(keys[:0])) == (0, 0)
