"""What a detector found in one picture: boxes of people, scores, and joints where the model has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import N_JOINTS, SKELETONS, Array, joints_of

JOINT_SCORE = 0.3
"""Joints that a network is less sure of are missing: published decoders of MoveNet and of COCO-17 draw from here on."""


@dataclass(frozen=True, slots=True)
class Detections:
    """People of one picture; one row for each.

    Attributes:
        box: Left, top, right, bottom in pixels, shape (n, 4).
        score: Between 0 and 1, shape (n,).
        joints: x, y in pixels in the order of BODY_25, NaN where missing, shape (n, 25, 2).
    """

    box: Array
    score: Array
    joints: Array

    def __len__(self) -> int:
        return len(self.score)

    @classmethod
    def of(cls, box: Array, score: Array, joints: Array | None = None) -> Detections:
        """Return detections of any number of people; joints None = the model has none."""
        n = len(score)
        empty = np.full((n, N_JOINTS, 2), np.nan)
        return cls(
            np.asarray(box, dtype=np.float64).reshape(n, 4),
            np.asarray(score, dtype=np.float64).reshape(n),
            empty if joints is None else np.asarray(joints, dtype=np.float64).reshape(n, N_JOINTS, 2),
        )

    def rows(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> Detections:
        """Return some of the people."""
        return Detections(self.box[chosen], self.score[chosen], self.joints[chosen])

    def mapped(self, scale: tuple[float, float], offset: tuple[float, float]) -> Detections:
        """Return the same people with every pixel (u, v) at (u, v) * scale + offset."""
        return Detections(
            self.box * np.tile(scale, 2) + np.tile(offset, 2), self.score, self.joints * scale + np.array(offset)
        )


def joined(parts: Sequence[Detections]) -> Detections:
    """Return the people of several parts of a picture."""
    if not parts:
        return Detections.of(np.empty((0, 4)), np.empty(0))
    return Detections(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("box", "score", "joints")))


def body_joints(points: Array, confidence: Array) -> Array:
    """Return joints of any known skeleton in the order of BODY_25, shape (n, 25, 2).

    Args:
        points: Pixels, shape (n, k, 2) with k of `people.SKELETONS`, such as COCO's 17.
        confidence: Shape (n, k); joints below `JOINT_SCORE` are missing.
    """
    order = SKELETONS[points.shape[1]]
    sure = np.where(confidence >= JOINT_SCORE, confidence, 0.0)
    turned = [joints_of(one, sure_of, order=order) for one, sure_of in zip(points, sure, strict=True)]
    return np.array(turned, dtype=np.float64).reshape(-1, N_JOINTS, 2)
