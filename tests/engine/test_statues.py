"""Mannequins: boxes that come back for hours at one spot while others walk."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from vsd_analytics.engine.people import People
from vsd_analytics.engine.statues import statues

HOURS = 3
HALF = np.array([20.0, 60.0])


def scene(*, jitter: float, presence: float = 0.9, walkers: int = 3, hours: float = HOURS) -> tuple[People, NDArray]:
    """Return one at (400, 300) who stays, and walkers; a frame every 10 s."""
    rng = np.random.default_rng(5)
    frame, boxes = [], []
    n_frames = int(hours * 360)
    for number in range(n_frames):
        if rng.random() < presence:
            middle = np.array([400, 300]) + rng.normal(0, jitter * 120, 2)
            boxes.append(np.r_[middle - HALF, middle + HALF])
            frame.append(number)
        for _ in range(walkers):
            if rng.random() < 0.5:
                middle = rng.uniform([50, 100], [1200, 600])
                boxes.append(np.r_[middle - HALF, middle + HALF])
                frame.append(number)
    n = len(frame)
    nobody = np.full(n, None, dtype=object)
    joints = np.full((n, 25, 2), np.nan)
    people = People(np.array(frame), nobody, np.array(boxes, float).reshape(-1, 4), joints, np.arange(n_frames))
    return people, np.arange(n_frames) * 10_000


def test_somebody_who_never_moves_while_others_walk_is_a_statue() -> None:
    people, ts_ms = scene(jitter=0.01)
    (statue,) = statues(people, ts_ms=ts_ms)
    np.testing.assert_allclose(statue.box, [380, 240, 420, 360], atol=2)
    assert statue.presence == pytest.approx(0.9, abs=0.03)


@pytest.mark.parametrize(
    "seen",
    [
        {"jitter": 0.2},  # somebody at a counter
        {"jitter": 0.01, "presence": 0.3},  # people who stop at one spot
        {"jitter": 0.01, "hours": 1.5},  # not long enough to know
        {"jitter": 0.01, "walkers": 0},  # nobody else, so nobody knows
    ],
)
def test_who_moves_or_goes_or_is_alone_is_no_statue(seen: dict) -> None:
    people, ts_ms = scene(**seen)
    assert statues(people, ts_ms=ts_ms) == []
