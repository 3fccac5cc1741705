"""The floor point below a person, in the picture: what a homography of the floor maps to where the person is.

The marks that a detector finds are not on the floor. Ankles are above it, so a homography puts them too far away. Off
the middle of the picture a body leans with the verticals there, and the middle of its box is not above its feet. The
camera behind the homography says by how much.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from vsd_analytics.engine.body import feet
from vsd_analytics.engine.camera_model import CameraModel, away, camera_of_homography
from vsd_analytics.engine.people import MID_HIP, NECK, Array, People
from vsd_analytics.engine.sightings import JOINTS
from vsd_analytics.geometry.homography import camera_pose

TOE_M, HEEL_M = 0.02, 0.03
"""Heights of the marks on a shoe; ankles are at `JOINTS.low_m`."""
_LEFT: Final = (14, 19, 20, 21)
_RIGHT: Final = (11, 22, 23, 24)
"""Ankle, big toe, small toe, heel."""
_MARK_M: Final = (JOINTS.low_m, TOE_M, TOE_M, HEEL_M)
TRUNK_M: Final = 0.5
"""A trunk farther beside its feet is a wrong joint."""
_STEEP: Final = 0.5
"""A box leans by less than so much of its place to the point below the camera, or its bottom is not at the feet."""
_FOCAL_WIDTHS: Final = (0.2, 5.0)
_HEIGHT_M: Final = (1.0, 60.0)
_SKEW: Final = 0.05
"""A homography whose camera is another one, or whose floor axes are not at right angles and equally long by so much, is
no good photograph of a floor in metres, so marks stay as they are."""


def floor_points(people: People, *, homography: ArrayLike, picture_px: tuple[int, int] | None) -> Array:
    """Return the pixel of the floor point below each person, shape (n, 2); NaN where there is no foot.

    Where the size of the picture is not known, or no camera explains the homography, it is the mark itself (`feet`).

    Args:
        people: As detected.
        homography: 3x3, pixels to floor metres.
        picture_px: Width and height of the picture.
    """
    marks = feet(people)
    camera = None if picture_px is None else _photographer(homography, picture_px)
    if camera is None or not len(people):
        return marks
    with np.errstate(invalid="ignore", divide="ignore"):
        has_joints = np.isfinite(people.joints).reshape(len(people), -1).any(axis=1, keepdims=True)
        found = np.where(has_joints, _below_joints(people, camera), _below_boxes(people, camera))
    return np.where(np.isfinite(found).all(axis=1, keepdims=True), found, marks)


def _photographer(homography: ArrayLike, picture_px: tuple[int, int]) -> CameraModel | None:
    """Return the camera behind a homography; None where that is no likely one, as for points clicked badly."""
    pose, camera = camera_pose(homography, picture_px=picture_px), camera_of_homography(homography, picture_px)
    if pose is None or camera is None:
        return None
    x, y = pose[1][:, 0], pose[1][:, 1]
    skew = float(np.hypot(x @ y, (x @ x - y @ y) / 2))
    is_lens = _FOCAL_WIDTHS[0] < camera.focal_px / picture_px[0] < _FOCAL_WIDTHS[1]
    return camera if is_lens and _HEIGHT_M[0] < camera.height_m < _HEIGHT_M[1] and skew < _SKEW else None


def _below_joints(people: People, camera: CameraModel) -> Array:
    """Return the floor point below the trunk, as far away as the feet.

    Half of each foot's place is the ankle's and half that of toes and heel. That is .11 m from the heel of a foot of
    .26 m, where the weight of somebody who stands falls.
    """
    each = [
        np.stack([_below(camera, people.joints[:, i], m) for i, m in zip(foot, _MARK_M, strict=True)])
        for foot in (_LEFT, _RIGHT)
    ]
    feet_ = [_mean(np.stack([foot[0], _mean(foot[1:])])) for foot in each]
    low = _mean(np.stack(feet_))
    view = away(low, camera)
    side = np.cross(camera.down(), view)
    off = []
    for joint in (NECK, MID_HIP):
        ray = camera.rays(people.joints[:, joint])
        off.append(np.sum(ray * side, axis=1) / np.sum(ray * view, axis=1) * np.sum(low * view, axis=1))
    beside = _mean(np.stack(off)[:, :, None])
    beside = np.where(np.abs(beside) < TRUNK_M, beside, 0.0)  # NaN is not
    return _in_picture(low + beside * side, camera)


def _below_boxes(people: People, camera: CameraModel) -> Array:
    """Return where the axis of an upright body in a box meets the bottom edge.

    The row stays: annotated boxes of known cameras end at the axis, not on its near side (docs/engine.md).
    """
    box, down = people.outline, camera.down()
    left, top, right, bottom = ((box - np.tile(camera.centre_px, 2)) / camera.focal_px).T
    middle = (left + right) / 2
    # the foot is at x with middle = x + half (down_x - x down_z), as verticals run there
    half = (top - bottom) / 2 / (down[1] - bottom * down[2])
    is_plain = (down[1] - bottom * down[2] > 0) & (np.abs(half * down[2]) < _STEEP)
    x = np.where(is_plain, (middle - half * down[0]) / (1 - half * down[2]), np.nan)
    return np.column_stack([x, bottom]) * camera.focal_px + camera.centre_px


def _below(camera: CameraModel, uv: Array, height_m: float) -> Array:
    """Return the floor points below marks at a height, in camera axes, shape (n, 3)."""
    return np.asarray(camera.on_plane(uv, height_m) + height_m * camera.down())


def _in_picture(points: Array, camera: CameraModel) -> Array:
    return np.asarray(points[:, :2] / points[:, 2:] * camera.focal_px + camera.centre_px)


def _mean(values: Array) -> Array:
    """Return the mean over the first axis of what is known, NaN for none."""
    known = np.isfinite(values)
    n = known.sum(axis=0)
    return np.asarray(np.where(n > 0, np.where(known, values, 0.0).sum(axis=0) / np.maximum(n, 1), np.nan))
