"""Two skeletons on one person, as detectors of joints make them where people are near each other."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import People
from vsd_analytics.engine.safe_space import pairs_of_frames

SAME: Final = 0.07
"""Joints that both have are nearer than this to each other, on average, in diagonals of the greater outline."""
LEAST_COMMON: Final = 3
"""Fewer common joints say nothing."""


def without_doubles(people: People) -> People:
    """Return one skeleton for each person; the others are counted as bad rows."""
    double = is_double(people)
    if not double.any():
        return people
    bad = {**people.bad, "second skeleton on the same person": int(double.sum())}
    return replace(people.rows(~double), bad=bad)


def is_double(people: People) -> NDArray[np.bool_]:
    """Return which skeletons are on somebody who has one with more joints, or an earlier one, shape (n,).

    People with track ids have none: a tracker has decided who is who.
    """
    double = np.zeros(len(people), dtype=bool)
    if not people.has_joints or all(track is not None for track in people.track):
        return double
    outline = people.outline
    length = np.hypot(outline[:, 2] - outline[:, 0], outline[:, 3] - outline[:, 1])
    middle = (outline[:, :2] + outline[:, 2:]) / 2
    n_joints = np.isfinite(people.joints).all(axis=2).sum(axis=1)
    a, b = pairs_of_frames(people.frame)
    near = np.linalg.norm(middle[a] - middle[b], axis=1) < np.maximum(length[a], length[b])
    a, b = a[near], b[near]
    apart = np.linalg.norm(people.joints[a] - people.joints[b], axis=2)
    common = np.isfinite(apart)
    n_common = common.sum(axis=1)
    mean = np.where(common, apart, 0.0).sum(axis=1) / np.maximum(n_common, 1)
    same = (n_common >= LEAST_COMMON) & (mean < SAME * np.maximum(length[a], length[b]))
    a, b = a[same], b[same]
    double[np.where(n_joints[b] > n_joints[a], a, b)] = True
    return double
