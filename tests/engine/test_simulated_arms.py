"""Simulated arms: they swing as published, and the trunk hides the far one from the side."""

from __future__ import annotations

import numpy as np
import pytest
from engine.simulated_arms import (
    ELBOWS_AND_WRISTS,
    FOREARM,
    HANGS,
    HOLDS,
    SHOULDER,
    SWINGS,
    UPPER_ARM,
    arms_of,
    behind_trunk,
    elbows_and_wrists,
)


def angles_deg(joints: np.ndarray, right: bool) -> tuple[float, float]:  # type: ignore[type-arg]
    """Return how far an upper arm is forward, and how far its elbow is bent."""
    at = 0 if right else 2
    upper = joints[at] - np.array(SHOULDER) * ((-1, 1, 1) if right else 1)
    lower = joints[at + 1] - joints[at]
    bend = np.arccos(upper @ lower / np.linalg.norm(upper) / np.linalg.norm(lower))
    return float(np.degrees(np.arctan2(upper[1], -upper[2]))), float(np.degrees(bend))


@pytest.mark.parametrize(("swing", "right", "left"), [(1.0, (-24, 20), (8, 44)), (-1.0, (8, 44), (-24, 20))])
def test_arms_swing_against_the_legs(swing: float, right: tuple[float, float], left: tuple[float, float]) -> None:
    (joints,) = elbows_and_wrists(np.tile(SWINGS, (1, 2, 1)), np.array([swing]))
    assert angles_deg(joints, right=True) == pytest.approx(right, abs=0.5)
    assert angles_deg(joints, right=False) == pytest.approx(left, abs=0.5)


def test_arms_are_as_long_however_they_are_bent() -> None:
    rng = np.random.default_rng(1)
    for angles in arms_of(200, rng):
        joints = elbows_and_wrists(angles, rng.uniform(-1, 1, 200))
        assert joints.shape[1] == len(ELBOWS_AND_WRISTS)
        for at, side in ((0, -1), (2, 1)):
            upper = joints[:, at] - np.array(SHOULDER) * (side, 1, 1)
            np.testing.assert_allclose(np.linalg.norm(upper, axis=1), UPPER_ARM)
            np.testing.assert_allclose(np.linalg.norm(joints[:, at + 1] - joints[:, at], axis=1), FOREARM)


def test_the_trunk_hides_the_far_arm_from_the_side_and_no_arm_from_the_front() -> None:
    joints = elbows_and_wrists(np.tile(HANGS, (1, 2, 1)), np.zeros(1))
    left, front, above = [(-5.0, 0.0, 1.5)], [(0.0, 5.0, 1.5)], [(-0.3, 0.0, 4.0)]
    assert behind_trunk(joints, np.array(left)).tolist() == [[False, False, True, True]]
    assert not behind_trunk(joints, np.array(front)).any()
    assert not behind_trunk(joints, np.array(above)).any()


def test_the_trunk_hides_from_behind_what_a_hand_holds() -> None:
    joints = elbows_and_wrists(np.tile(HOLDS, (1, 2, 1)), np.zeros(1))
    assert behind_trunk(joints, np.array([(0.0, -5.0, 1.5)])).tolist() == [[False, True, False, True]]
    assert not behind_trunk(joints, np.array([(0.0, 5.0, 1.5)])).any()
