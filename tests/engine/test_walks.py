"""What a tracker knows of walks: the same forward and backward in time, and what past and future say together."""

from __future__ import annotations

import numpy as np
import pytest

from vsd_analytics.engine.walks import WALK_M_S, Walks, joined, surprise

NOISE = np.eye(2)[None] * 0.04


def walked(xy: np.ndarray, step_s: float) -> tuple[Walks, float]:  # type: ignore[type-arg]
    """Return the walk after all sightings, and -2 log of their density but for the first."""
    walk, total = Walks.begun(xy[:1], NOISE), 0.0
    for at in xy[1:, None]:
        walk = walk.after(np.array([step_s]))
        total += float(surprise(at - walk.state[:, :2], walk.covariance[:, :2, :2] + NOISE)[0])
        walk = walk.seen(at, NOISE)
    return walk, total


def test_two_short_steps_are_one_long_step() -> None:
    walk = walked(np.array([(0.0, 0), (1, 0.5), (2, 0.8)]), 1.0)[0]
    long = walk.after(np.array([1.5]))
    short = walk.after(np.array([0.5])).after(np.array([1.0]))
    assert short.state == pytest.approx(long.state)
    assert short.covariance == pytest.approx(long.covariance)


def test_velocities_stay_those_of_people_however_long_nobody_looks() -> None:
    walk = Walks.begun(np.zeros((1, 2)), NOISE).after(np.array([1000.0]))
    assert walk.covariance[0, 2, 2] == pytest.approx(WALK_M_S**2)


@pytest.mark.parametrize("cut", [1, 2, 4, 5])
def test_a_walk_cut_anywhere_is_as_likely_as_the_whole(cut: int) -> None:
    xy = np.array([(0, 0), (1.2, 0.1), (2.5, 0.0), (3.5, 0.4), (4.9, 0.6), (6.0, 0.5)], dtype=float)
    step = 0.7
    whole = walked(xy, step)[1]
    past, before = walked(xy[:cut], step)
    after = walked(xy[cut:], step)[1]
    future = walked(xy[cut:][::-1], step)[0].backward()
    assert before + after + joined(past.after(np.array([step])), future)[0] == pytest.approx(whole, abs=1e-6)
