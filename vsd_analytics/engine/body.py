"""Where a person is in the picture, and how long a part of the body is there (Aghaei et al. 2021, section 3.3)."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import FEET, HEAD, MID_HIP, NECK, Array, People

Part = Literal["torso", "leg", "arm", "box"]
PART_M: Final[dict[Part, float]] = {"torso": 0.60, "leg": 0.85, "arm": 0.70, "box": 1.70}
"""Population lengths in metres, as the paper takes them."""
MIN_JOINTS: Final = 13
"""Joints a skeleton needs to be valid."""

_CHAINS: Final[dict[str, tuple[tuple[int, ...], ...]]] = {
    "torso": ((NECK, MID_HIP),),
    "leg": ((12, 13, 14), (9, 10, 11)),
    "arm": ((5, 6, 7), (2, 3, 4)),
}
"""Joints along a part. The paper's legs go on to the toe; the length 0.85 m is that from hip to ankle."""
_MIDDLE: Final = (*HEAD, NECK, MID_HIP)


def ground_points(people: People) -> Array:
    """Return the foot point of each person in pixels, shape (n, 2); NaN where it is unknown.

    u is the mean of the head, neck and torso joints, v the mean of the foot joints. Persons without joints take the
    middle of the bottom edge of their box.
    """
    box = people.outline
    u = _mean(people.joints[:, _MIDDLE, 0])
    v = _mean(people.joints[:, FEET, 1])
    has_joints = np.isfinite(people.joints).any(axis=(1, 2))
    u = np.where(np.isfinite(u), u, (box[:, 0] + box[:, 2]) / 2)
    return np.column_stack([u, np.where(has_joints, v, box[:, 3])])


def feet(people: People) -> Array:
    """Return the middle of the foot joints that are known, else of the bottom edge of the box, pixels, shape (n, 2).

    Unlike `ground_points` it takes nothing from the head, which is above another spot of the floor in a tilted view.
    """
    box = people.outline
    known = np.column_stack([_mean(people.joints[:, FEET, axis]) for axis in (0, 1)])
    has_joints = np.isfinite(people.joints).any(axis=(1, 2))
    middle = np.column_stack([(box[:, 0] + box[:, 2]) / 2, box[:, 3]])
    return np.where(np.expand_dims(has_joints, 1), known, middle)


def is_valid(people: People) -> NDArray[np.bool_]:
    """Return which persons count, shape (n,): skeletons with a foot and 13 joints, or boxes without any joint."""
    known = np.asarray(np.isfinite(people.joints).all(axis=2), dtype=np.bool_)
    has_foot = known[:, FEET].any(axis=1)
    is_box = ~known.any(axis=1) & np.isfinite(people.box).all(axis=1)
    return np.asarray(is_box | (has_foot & (known.sum(axis=1) >= MIN_JOINTS)))


def part_px(people: People, part: Part) -> Array:
    """Return the length of a part of the body in pixels, shape (n,); NaN where a joint of it is missing.

    A leg or arm is the longer of the two sides, which is the less foreshortened one. The box is its height.
    """
    if part == "box":
        outline = people.outline
        return np.asarray(outline[:, 3] - outline[:, 1])
    lengths = np.stack([_chain_px(people.joints[:, chain]) for chain in _CHAINS[part]])
    return np.asarray(np.fmax.reduce(lengths))


def _chain_px(joints: Array) -> Array:
    return np.asarray(np.linalg.norm(np.diff(joints, axis=1), axis=2).sum(axis=1))


def _mean(values: Array) -> Array:
    """Return the mean of what is known in each row, NaN for none."""
    n = np.isfinite(values).sum(axis=1)
    total = np.nansum(values, axis=1)
    return np.asarray(np.where(n > 0, total / np.maximum(n, 1), np.nan))
