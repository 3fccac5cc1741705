"""Classes of squares by hour, read by a solver beside all exact sums: they tell no time of few people in a square."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from privacy.squares_solver import few, known

from vsd_analytics.figures.share import squares
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.share.squares import ClassSteps, SquareClasses, SquareTimes

STEPS = ClassSteps(time_ms=(2.0, 4.0, 8.0, 16.0, 32.0), close_ms=(3.0, 12.0))
MASK = Mask(5)
N_SQUARES, N_UNITS, N_HOURS = 5, 8, 4


def made_up(seed: int) -> tuple[SquareTimes, Any, Any]:
    """Return a small floor, what other rules let leave of it, and which hours have a count."""
    rng = np.random.default_rng(seed)
    square = np.sort(np.concatenate([np.arange(N_SQUARES), rng.integers(N_SQUARES, size=N_UNITS - N_SQUARES)]))
    visited = rng.random((N_UNITS, N_HOURS)) < rng.uniform(0.2, 0.9)
    time_ms = np.where(visited, rng.integers(1, 30, (N_UNITS, N_HOURS)), 0)
    times = SquareTimes(
        time_ms=time_ms,
        close_ms=np.rint(time_ms * rng.random((N_UNITS, N_HOURS))).astype(np.int64),
        square=square,
        area=rng.integers(2, size=N_SQUARES)[square],
        n_people=rng.integers(2, 9, (N_SQUARES, N_HOURS)),
        recorded_h=rng.choice([1.0, 0.5], N_HOURS),
        hour_of_day=rng.integers(2, size=N_HOURS),
    )
    return times, np.broadcast_to(rng.random(N_HOURS) < 0.9, times.n_people.shape), rng.random(N_HOURS) < 0.8


def test_classes_tell_no_time_of_few_people_that_sums_alone_do_not_tell() -> None:
    n_given = n_few = 0
    for seed in range(60):
        times, given, counted = made_up(seed)
        found = squares.square_classes(times, STEPS, MASK, given=given, counted=counted)
        nothing = SquareClasses(time=np.zeros_like(found.time), close=np.zeros_like(found.close))
        told = known(times, found, STEPS, MASK, counted=counted) if found.time.any() else []
        assert set(told) <= set(known(times, nothing, STEPS, MASK, counted=counted) if told else []), seed
        n_given += int((found.time > 0).sum())
        n_few += int(few(times, MASK).sum())
    assert n_given > 50
    assert n_few > 300


def tight() -> tuple[SquareTimes, Any, Any]:
    """Return two hours in which every class that could be given has no room: the hidden time is what is left."""
    time_ms = np.array([[16, 16], [32, 3], [16, 16], [16, 16]])
    times = SquareTimes(
        time_ms=time_ms,
        close_ms=np.zeros_like(time_ms),
        square=np.arange(4),
        area=np.zeros(4, dtype=np.int64),
        n_people=np.array([[9, 9], [9, 2], [9, 9], [9, 9]]),
        recorded_h=np.ones(2),
        hour_of_day=np.array([9, 10]),
    )
    return times, np.ones((4, 2), dtype=np.bool_), np.ones(2, dtype=np.bool_)


def test_a_class_that_would_tell_a_hidden_time_is_not_given(monkeypatch: pytest.MonkeyPatch) -> None:
    """All classes are at their lower ends, so the hidden square has what they leave."""
    times, given, counted = tight()
    found = squares.square_classes(times, STEPS, MASK, given=given, counted=counted)
    monkeypatch.setattr(squares, "_stuck", lambda times, *_: np.zeros(times.n_people.shape, dtype=np.bool_))
    without = squares.square_classes(times, STEPS, MASK, given=given, counted=counted)
    assert known(times, without, STEPS, MASK, counted=counted) == [("time", 1, 1)]
    assert known(times, found, STEPS, MASK, counted=counted) == []


def test_few_people_have_no_class_and_no_ring_and_nobody_has_one_beyond_what_other_rules_give() -> None:
    for seed in range(60):
        times, given, counted = made_up(seed)
        found = squares.square_classes(times, STEPS, MASK, given=given, counted=counted)
        assert not found.time[few(times, MASK) | ~given].any()
        assert not found.close[:, ~counted].any()
        assert not found.close[found.time == 0].any()
        per_h = times.by_square(times.time_ms) / times.recorded_h
        low = np.array([0.0, *STEPS.time_ms])[found.time]
        high = np.array([np.inf, *STEPS.time_ms[1:], np.inf])[found.time]
        assert (low <= per_h).all()
        assert (per_h < high).all()


def test_the_operator_gets_every_class() -> None:
    times, given, counted = tight()
    assert (squares.square_classes(times, STEPS, Mask(0), given=given, counted=counted).time > 0).all()
