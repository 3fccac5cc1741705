"""The floor point below a person, in the picture: what a homography of the floor maps to where the person is.

The marks that a detector finds are not on the floor. Ankles are above it, so a homography puts them too far away. Off
the middle of the picture a body leans with the verticals there, and the middle of its box is not above its feet. The
camera behind the homography says by how much; for joints see `joint_places`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from vsd_analytics.engine.body import feet
from vsd_analytics.engine.camera_model import CameraModel, camera_of_homography
from vsd_analytics.engine.joint_places import below_joints
from vsd_analytics.engine.people import Array, People
from vsd_analytics.geometry.homography import camera_pose

_STEEP: Final = 0.5
"""A box leans by less than so much of its place to the point below the camera, or its bottom is not at the feet."""
_FOCAL_WIDTHS: Final = (0.2, 5.0)
_HEIGHT_M: Final = (1.0, 60.0)
_SKEW: Final = 0.05
"""A homography whose camera is another one, or whose floor axes are not at right angles and equally long by so much, is
no good photograph of a floor in metres, so marks stay as they are."""


def floor_points(people: People, *, homography: ArrayLike, picture_px: tuple[int, int] | None) -> Array:
    """Return the pixel of the floor point below each person, shape (n, 2); NaN where nothing shows it.

    Where the size of the picture is not known, or no camera explains the homography, it is the mark itself (`feet`).

    Args:
        people: As detected.
        homography: 3x3, pixels to floor metres.
        picture_px: Width and height of the picture.
    """
    marks = feet(people)
    camera = None if picture_px is None else photographer(homography, picture_px)
    if camera is None or not len(people):
        return marks
    with np.errstate(invalid="ignore", divide="ignore"):
        has_joints = np.isfinite(people.joints).any(axis=(1, 2)).reshape(-1, 1)
        points = np.where(has_joints, below_joints(people, camera), below_boxes(people.outline, camera))
    return np.where(has_joints | np.isfinite(points).all(axis=1, keepdims=True), points, marks)


def photographer(homography: ArrayLike, picture_px: tuple[int, int]) -> CameraModel | None:
    """Return the camera behind a homography; None where that is no likely one, as for points clicked badly."""
    pose, camera = camera_pose(homography, picture_px=picture_px), camera_of_homography(homography, picture_px)
    if pose is None or camera is None:
        return None
    x, y = pose[1][:, 0], pose[1][:, 1]
    skew = float(np.hypot(x @ y, (x @ x - y @ y) / 2))
    is_lens = _FOCAL_WIDTHS[0] < camera.focal_px / picture_px[0] < _FOCAL_WIDTHS[1]
    return camera if is_lens and _HEIGHT_M[0] < camera.height_m < _HEIGHT_M[1] and skew < _SKEW else None


def below_boxes(box: Array, camera: CameraModel) -> Array:
    """Return where the axis of an upright body in a box meets the bottom edge, pixels, shape (n, 2).

    The row stays: annotated boxes of known cameras end at the axis, not on its near side (docs/engine.md).
    """
    down = camera.down()
    left, top, right, bottom = ((box - np.tile(camera.centre_px, 2)) / camera.focal_px).T
    middle = (left + right) / 2
    # the foot is at x with middle = x + half (down_x - x down_z), as verticals run there
    half = (top - bottom) / 2 / (down[1] - bottom * down[2])
    is_plain = (down[1] - bottom * down[2] > 0) & (np.abs(half * down[2]) < _STEEP)
    x = np.where(is_plain, (middle - half * down[0]) / (1 - half * down[2]), np.nan)
    return np.column_stack([x, bottom]) * camera.focal_px + camera.centre_px
