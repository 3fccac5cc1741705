"""How simulated people hold and swing their arms, and which joints of the arms their own trunk hides.

All numbers were chosen before anything was measured with them. Lengths are in heights of the body, angles in degrees.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ARMS: Final = (2, 3, 4, 5, 6, 7)
"""Shoulder, elbow and wrist, right and left, as BODY_25 counts."""
ELBOWS_AND_WRISTS: Final = (3, 4, 6, 7)
SHOULDER: Final = (0.11, 0.0, 0.82)
UPPER_ARM, FOREARM = 0.19, 0.16
OUTWARD_DEG: Final = 6.0
"""An arm that hangs leans out from the shoulder by so much, since hips are wider than the waist."""

# angles of an arm: shoulder (forward), its swing either way, elbow (bent), its swing, forearm turned inward
SWINGS: Final = (-8.0, 16.0, 32.0, 12.0, 0.0)
"""Walking: the shoulder goes from 24 degrees behind to 8 ahead and the elbow from 20 to 44 (Murray, Sepic and Barnard
1967, in Perry 1992). Kwak and others (2023) have an elbow's arc of 30 +- 10 degrees."""
SWING_SD, ELBOW_SD = 5.0, 8.0
"""Between persons."""
HOLDS: Final = (10.0, 0.0, 90.0, 0.0, 30.0)
"""One hand holds something in front of the body."""
HOLDING: Final = 0.26
"""Of people who walk: a third of the women and a fifth of the men carry a phone in a hand (Schaposnik and Unwin
2018)."""
HANGS: Final = (0.0, 0.0, 15.0, 0.0, 0.0)
FOLDED: Final = (20.0, 0.0, 100.0, 0.0, 70.0)
"""People who stand or sit: a third each with arms that hang, one hand that holds something, and folded arms. No
published shares were at hand."""

TRUNK_HALF: Final = (0.087, 0.07)
"""Half width (Drillis and Contini 1966: a chest of .174) and half depth of the trunk."""
TRUNK_LOW, TRUNK_HIGH = 0.47, 0.82
"""From the crotch to the shoulders."""


def arms_of(n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return the angles of the arms of n persons while they walk and while they stand, shape (n, 2, 5) each."""
    walk = np.tile(SWINGS, (n, 2, 1))
    walk[:, :, 1] += rng.normal(0, SWING_SD, (n, 1))
    walk[:, :, 2] += rng.normal(0, ELBOW_SD, (n, 1))
    stand = np.tile(HANGS, (n, 2, 1))
    hand, kind = rng.integers(0, 2, n), rng.integers(0, 3, n)
    holds = rng.random(n) < HOLDING
    walk[holds, hand[holds]] = HOLDS
    stand[kind == 1, hand[kind == 1]] = HOLDS
    stand[kind == 2] = FOLDED
    return walk, stand


def elbows_and_wrists(angles: Array, swing: Array) -> Array:
    """Return the joints `ELBOWS_AND_WRISTS`: to the right, ahead, up; shape (n, 4, 3).

    Args:
        angles: Of both arms, shape (n, 2, 5).
        swing: How far the right leg is ahead, -1 to 1, shape (n,). The right arm is behind then.
    """
    found = np.empty((len(angles), 4, 3))
    for arm, (side, ahead) in enumerate(((-1.0, -1.0), (1.0, 1.0))):
        shoulder, shoulder_swing, elbow, elbow_swing, inward = np.radians(angles[:, arm]).T
        forward = shoulder + ahead * swing * shoulder_swing
        bend = elbow + ahead * swing * elbow_swing
        upper = np.column_stack([np.zeros(len(angles)), np.sin(forward), -np.cos(forward)])
        bent = np.column_stack(
            [-side * np.sin(inward), np.cos(inward) * np.cos(forward), np.cos(inward) * np.sin(forward)]
        )
        lower = np.cos(bend)[:, None] * upper + np.sin(bend)[:, None] * bent
        out = side * np.radians(OUTWARD_DEG)
        lean = np.array([[np.cos(out), 0, -np.sin(out)], [0, 1, 0], [np.sin(out), 0, np.cos(out)]])
        found[:, 2 * arm] = np.array(SHOULDER) * (side, 1, 1) + UPPER_ARM * upper @ lean.T
        found[:, 2 * arm + 1] = found[:, 2 * arm] + FOREARM * lower @ lean.T
    return found


def behind_trunk(joints: Array, lens: Array) -> NDArray[np.bool_]:
    """Return which joints the trunk, an upright elliptic cylinder, hides from the lens, shape (n, m).

    Args:
        joints: To the right, ahead, up, shape (n, m, 3).
        lens: The same for the lens, shape (n, 3).
    """
    half = np.array(TRUNK_HALF)
    begin, way = lens[:, None] - np.zeros_like(joints), joints - lens[:, None]
    p, q = begin[..., :2] / half, way[..., :2] / half
    # |p + t q| = 1 where the line of sight enters and leaves the ellipse
    a, b, c = (q**2).sum(-1), (p * q).sum(-1), (p**2).sum(-1) - 1
    root = np.sqrt(np.maximum(b**2 - a * c, 0))
    levels = np.sort((np.array([TRUNK_LOW, TRUNK_HIGH]) - begin[..., 2:]) / way[..., 2:], axis=-1)
    enters = np.maximum((-b - root) / a, levels[..., 0])
    leaves = np.minimum((-b + root) / a, levels[..., 1])
    return np.asarray((b**2 > a * c) & (enters < np.minimum(leaves, 1.0)) & (leaves > 0))
