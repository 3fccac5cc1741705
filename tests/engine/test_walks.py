"""What a tracker knows of walks: the same forward and backward in time, and what past and future say together."""

from __future__ import annotations

import numpy as np
import pytest

from vsd_analytics.engine.walks import WALK_M_S, Velocities, Walks, joined, joined_velocity, surprise

NOISE = np.eye(2)[None] * 0.04
ANYWHERE = Velocities.anywhere(1)


def walked(xy: np.ndarray, step_s: float) -> tuple[Walks, float]:  # type: ignore[type-arg]
    """Return the walk after all sightings, and -2 log of their density but for the first."""
    walk, total = Walks.begun(xy[:1], NOISE, ANYWHERE), 0.0
    for at in xy[1:, None]:
        walk = walk.after(np.array([step_s]))
        total += float(surprise(at - walk.state[:, :2], walk.covariance[:, :2, :2] + NOISE)[0])
        walk = walk.seen(at, NOISE, ANYWHERE)
    return walk, total


def test_two_short_steps_are_one_long_step() -> None:
    walk = walked(np.array([(0.0, 0), (1, 0.5), (2, 0.8)]), 1.0)[0]
    long = walk.after(np.array([1.5]))
    short = walk.after(np.array([0.5])).after(np.array([1.0]))
    assert short.state == pytest.approx(long.state)
    assert short.covariance == pytest.approx(long.covariance)


def test_velocities_stay_those_of_people_however_long_nobody_looks() -> None:
    walk = Walks.begun(np.zeros((1, 2)), NOISE, ANYWHERE).after(np.array([1000.0]))
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


def test_where_everybody_walks_one_way_somebody_seen_once_is_expected_there() -> None:
    covariance = np.array([[[0.09, 0.0], [0.0, 0.04]]])
    one_way = Velocities(np.array([[1.2, -0.5]]), covariance)
    walk = Walks.begun(np.zeros((1, 2)), NOISE, one_way).after(np.array([2.0]))
    assert walk.state[0] == pytest.approx([2.4, -1.0, 1.2, -0.5])
    long = Walks.begun(np.ones((1, 2)), NOISE, ANYWHERE).seen(np.ones((1, 2)), NOISE, one_way).after(np.array([1000.0]))
    assert long.state[0, 2:] == pytest.approx([1.2, -0.5])
    assert long.covariance[0, 2:, 2:] == pytest.approx(covariance[0])


@pytest.mark.parametrize("cut", [1, 3, 5])
def test_velocity_of_past_and_future_together_is_that_of_the_whole_walk(cut: int) -> None:
    xy = np.array([(0, 0), (1.2, 0.1), (2.5, 0.0), (3.5, 0.4), (4.9, 0.6), (6.0, 0.5)], dtype=float)
    step = np.array([0.7])
    past = walked(xy[:cut], 0.7)[0].after(step)
    found = joined_velocity(past, walked(xy[cut:][::-1], 0.7)[0].backward())
    # least squares over all velocities and places at once
    n, left = len(xy), np.exp(-0.7 / 12.5)
    move = Walks(np.zeros((4, 4)), np.zeros((4, 4, 4)), Velocities.anywhere(4))
    move.state[:] = np.eye(4)
    moved = move.after(np.repeat(step, 4)).state.T
    noise = Walks(np.zeros((1, 4)), np.zeros((1, 4, 4)), ANYWHERE).after(step).covariance[0]
    assert moved[2, 2] == pytest.approx(left)
    precision, pull = np.zeros((4 * n, 4 * n)), np.zeros(4 * n)
    precision[2:4, 2:4] += np.eye(2) / WALK_M_S**2
    for i, at in enumerate(xy):
        place = slice(4 * i, 4 * i + 2)
        precision[place, place] += np.linalg.inv(NOISE[0])
        pull[place] += np.linalg.inv(NOISE[0]) @ at
        if i:
            both = np.hstack([-moved, np.eye(4)])
            precision[4 * i - 4 : 4 * i + 4, 4 * i - 4 : 4 * i + 4] += both.T @ np.linalg.inv(noise) @ both
    velocity = slice(4 * cut + 2, 4 * cut + 4)
    assert found.mean[0] == pytest.approx(np.linalg.solve(precision, pull)[velocity], abs=1e-6)
    assert found.covariance[0] == pytest.approx(np.linalg.inv(precision)[velocity, velocity], abs=1e-6)
