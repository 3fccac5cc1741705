"""A pinhole camera above a floor, as five numbers, and what it makes of foot and head points.

Camera axes: x right, y down, z into the scene. The floor's origin is below the camera; floor x runs right and y ahead.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import ArrayLike

from vsd_analytics.engine.people import Array
from vsd_analytics.geometry.homography import camera_pose


@dataclass(frozen=True, slots=True)
class CameraModel:
    """A camera without lens distortion and with square pixels.

    Attributes:
        focal_px: Focal length.
        tilt_rad: Angle of the axis below level.
        roll_rad: Clockwise turn of the picture around the axis.
        height_m: Of the lens above the floor.
        centre_px: Where the axis meets the picture, (u, v).
    """

    focal_px: float
    tilt_rad: float
    roll_rad: float
    height_m: float
    centre_px: tuple[float, float]

    def down(self) -> Array:
        """Return the direction of gravity in camera axes, length 1."""
        level = np.cos(self.tilt_rad)
        return np.array([np.sin(self.roll_rad) * level, np.cos(self.roll_rad) * level, np.sin(self.tilt_rad)])

    def floor_axes(self) -> tuple[Array, Array]:
        """Return the floor's x (right) and y (ahead) in camera axes."""
        down = self.down()
        ahead = np.array([0.0, 0.0, 1.0]) - down[2] * down
        ahead /= np.linalg.norm(ahead)
        return np.cross(down, ahead), ahead

    def rays(self, uv: Array) -> Array:
        """Return the direction of each pixel in camera axes, z = 1, shape (n, 3)."""
        return np.column_stack([(uv - self.centre_px) / self.focal_px, np.ones(len(uv))])

    def on_plane(self, uv: Array, z_m: float) -> Array:
        """Return where the rays of pixels meet the level plane `z_m` above the floor, camera axes, shape (n, 3).

        NaN for rays that never do.
        """
        rays = self.rays(uv)
        sinks = rays @ self.down()
        drop = self.height_m - z_m
        scale = np.where(sinks * np.sign(drop) > 1e-6, drop / np.where(sinks == 0, np.nan, sinks), np.nan)
        return np.asarray(rays * scale[:, None])

    def homography(self) -> Array:
        """Return the 3x3 map from pixels to floor metres."""
        right, ahead = self.floor_axes()
        lens = np.array([[self.focal_px, 0, self.centre_px[0]], [0, self.focal_px, self.centre_px[1]], [0, 0, 1]])
        to_picture = lens @ np.column_stack([right, ahead, self.height_m * self.down()])
        return np.asarray(np.linalg.inv(to_picture))

    def numbers(self) -> tuple[float, ...]:
        """Return focal length, tilt, roll and height."""
        return astuple(self)[:4]


def camera_of_homography(homography: ArrayLike, size_px: tuple[int, int]) -> CameraModel | None:
    """Return the camera above a floor that a homography means, with its axis through the middle of the picture.

    A camera that looks straight down or level leaves its focal length open (`camera_pose`).

    Args:
        homography: 3x3, pixels to floor metres.
        size_px: Width and height of the picture.

    Returns:
        None where no focal length fits.
    """
    focal_and_pose = camera_pose(homography, picture_px=size_px)
    if focal_and_pose is None:
        return None
    focal_px, pose = focal_and_pose
    down = -pose[:, 2]
    tilt, roll = np.arcsin(np.clip(down[2], -1, 1)), np.arctan2(down[0], down[1])
    centre = (size_px[0] / 2, size_px[1] / 2)
    return CameraModel(focal_px, float(tilt), float(roll), float(down @ pose[:, 3]), centre)


def away(points: Array, camera: CameraModel) -> Array:
    """Return the level direction from the camera to points in camera axes, length 1, shape (n, 3)."""
    down = camera.down()
    level = points - (points @ down)[:, None] * down
    return np.asarray(level / np.linalg.norm(level, axis=1, keepdims=True))
