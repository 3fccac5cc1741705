"""The floor point below a skeleton, and which skeletons are no bodies.

The feet say where somebody is. Where they are hidden, the lowest joints that are seen do: knees or hips, at their usual
height above the floor. A skeleton of a detector may also be nobody, or have the legs of the person beside. So the body
above a place must have about the height that is usual by this camera.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.camera_model import CameraModel, away
from vsd_analytics.engine.people import HIPS, MID_HIP, NECK, SHOULDERS, Array, People
from vsd_analytics.engine.sightings import JOINTS, NECK_ALONE

TOE_M, HEEL_M = 0.02, 0.03
"""Heights of the marks on a shoe; ankles are at `JOINTS.low_m`."""
KNEE_M, HIP_M = 0.49, 0.91
"""Knees and hips: .285 and .530 of 1.70 m (Drillis and Contini 1966), and 1 cm of sole."""
_LEFT: Final = (14, 19, 20, 21)
_RIGHT: Final = (11, 22, 23, 24)
"""Ankle, big toe, small toe, heel."""
_MARK_M: Final = (JOINTS.low_m, TOE_M, TOE_M, HEEL_M)
KNEES: Final = (10, 13)
_ABOVE: Final = (
    ((NECK,), NECK_ALONE.high_m),
    (SHOULDERS, NECK_ALONE.high_m),
    ((*HIPS, MID_HIP), HIP_M),
    (KNEES, KNEE_M),
)
"""What shows how high a body is, the best first."""
TRUNK_M: Final = 0.5
"""A trunk farther beside its feet is a wrong joint."""
HEIGHT_SD: Final = 0.1
"""Heights of knees and hips of people of all ages, relative."""
FARTHEST_SD_M: Final = 0.5
"""Knees and hips whose height leaves a place more uncertain than this, along the view, give none."""
USUAL: Final = (0.45, 1.6)
"""Heights of bodies, against the median of all by the same camera: from sitting children on."""
STRIDE_M: Final = 0.2
"""How far a foot is from below the body; seen from steeply above, that changes how high the body seems."""


def below_joints(people: People, camera: CameraModel) -> Array:
    """Return the floor point below each skeleton in pixels, shape (n, 2); NaN where it shows no place.

    A place is as far away as the feet, and below the trunk. It needs a body of a usual height above it.
    Where feet are missing or have no such body, knees or hips give the place.
    """
    places = [
        _feet(people, camera),
        _below_middle(people, camera, KNEES, KNEE_M),
        _below_middle(people, camera, (*HIPS, MID_HIP), HIP_M),
    ]
    heights = [_body(people, camera, place, z) for place, z in zip(places, (0.0, KNEE_M, HIP_M), strict=True)]
    with np.errstate(invalid="ignore"):
        usual = np.nanmedian(heights[0]) if np.isfinite(heights[0]).any() else 1.0
        chosen = np.full((len(people), 3), np.nan)
        for place, height in zip(places, heights, strict=True):
            slack = STRIDE_M * camera.height_m / _level_m(place, camera) / NECK_ALONE.high_m
            is_body = (height > USUAL[0] * usual - slack) & (height < USUAL[1] * usual + slack)
            chosen = np.where(np.isfinite(chosen) | ~is_body[:, None], chosen, place)
    return _in_picture(_below_trunk(people, camera, chosen), camera)


def has_feet(people: People) -> NDArray[np.bool_]:
    """Return which skeletons have a joint of a foot, shape (n,)."""
    known = np.isfinite(people.joints[:, [*_LEFT, *_RIGHT]])
    return np.asarray(known.any(axis=(1, 2)), dtype=np.bool_)


def _feet(people: People, camera: CameraModel) -> Array:
    """Return the place of the feet in camera axes, shape (n, 3).

    Half of each foot's place is the ankle's and half that of toes and heel. That is .11 m from the heel of a foot of
    .26 m, where the weight of somebody who stands falls.
    """
    each = [
        np.stack([_below(camera, people.joints[:, i], m) for i, m in zip(foot, _MARK_M, strict=True)])
        for foot in (_LEFT, _RIGHT)
    ]
    return _mean(np.stack([_mean(np.stack([foot[0], _mean(foot[1:])])) for foot in each]))


def _below_middle(people: People, camera: CameraModel, joints: tuple[int, ...], height_m: float) -> Array:
    """Return the floor below the mean of joints at a height, in camera axes, shape (n, 3).

    NaN where the height of a body leaves it too uncertain.
    """
    place = _mean(np.stack([_below(camera, people.joints[:, i], height_m) for i in joints]))
    sd_m = HEIGHT_SD * height_m * _level_m(place, camera) / max(camera.height_m - height_m, 1e-6)
    return np.where(sd_m[:, None] < FARTHEST_SD_M, place, np.nan)


def _level_m(place: Array, camera: CameraModel) -> Array:
    """Return how far places are from the floor point below the camera, shape (n,)."""
    return np.asarray(np.linalg.norm(place - camera.height_m * camera.down(), axis=1))


def _body(people: People, camera: CameraModel, place: Array, from_m: float) -> Array:
    """Return how far the body reaches above a height over its place, against what is usual, shape (n,); NaN without."""
    down, relative_height = camera.down(), np.full(len(place), np.nan)
    for joints, height_m in _ABOVE:
        row = _mean(np.stack([people.joints[:, i, 1] for i in joints]))
        slope = (row - camera.centre_px[1]) / camera.focal_px
        # the point place - k down has the row of the joint: (y - k down_y) / (z - k down_z) = slope
        reach_m = (place[:, 1] - slope * place[:, 2]) / (down[1] - slope * down[2]) - from_m
        if height_m > from_m:
            relative_height = np.where(np.isfinite(relative_height), relative_height, reach_m / (height_m - from_m))
    return relative_height


def _below_trunk(people: People, camera: CameraModel, place: Array) -> Array:
    """Return places moved to the side, below neck and middle of the hips, in camera axes, shape (n, 3)."""
    view = away(place, camera)
    side = np.cross(camera.down(), view)
    off = []
    for joint in (NECK, MID_HIP):
        ray = camera.rays(people.joints[:, joint])
        off.append(np.sum(ray * side, axis=1) / np.sum(ray * view, axis=1) * np.sum(place * view, axis=1))
    beside = _mean(np.stack(off)[:, :, None])
    return np.asarray(place + np.where(np.abs(beside) < TRUNK_M, beside, 0.0) * side)  # NaN is not


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
