"""The made-up shop's cameras: pinhole cameras under the ceiling, their homographies and views."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin, tan

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.simulate.shop import FloatArray

WIDTH_PX = 1280
HEIGHT_PX = 720
NOISE_SD_M = 0.05
"""Standard deviation of each coordinate an engine reports, independent by frame and camera."""


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """A camera without lens distortion.

    Attributes:
        camera_id: Identifier.
        name: Display name.
        x_m: Floor x of its mount.
        y_m: Floor y of its mount.
        height_m: Height of its mount.
        yaw_deg: Direction it looks in, degrees from floor x towards floor y.
        tilt_deg: How far below the horizontal it looks.
        view_deg: Vertical angle of view.
    """

    camera_id: str
    name: str
    x_m: float
    y_m: float
    height_m: float
    yaw_deg: float
    tilt_deg: float = 40.0
    view_deg: float = 52.0

    @property
    def projection(self) -> FloatArray:
        """Return the 3x4 matrix P from floor metres (x, y, height, 1) to pixels: (u w, v w, w) = P (x, y, z, 1)."""
        yaw, tilt = radians(self.yaw_deg), radians(self.tilt_deg)
        ahead = np.array([cos(yaw) * cos(tilt), sin(yaw) * cos(tilt), -sin(tilt)])
        right = np.array([sin(yaw), -cos(yaw), 0.0])
        rotation = np.stack([right, np.cross(ahead, right), ahead])
        focal_px = HEIGHT_PX / 2 / tan(radians(self.view_deg) / 2)
        intrinsic = np.array([[focal_px, 0, WIDTH_PX / 2], [0, focal_px, HEIGHT_PX / 2], [0, 0, 1]])
        mount = np.array([self.x_m, self.y_m, self.height_m])
        projection: FloatArray = intrinsic @ np.column_stack([rotation, -rotation @ mount])
        return projection

    @property
    def homography(self) -> FloatArray:
        """Return the 3x3 matrix from pixels to floor metres, lower right entry 1."""
        inverse = np.linalg.inv(self.projection[:, [0, 1, 3]])
        homography: FloatArray = inverse / inverse[2, 2]
        return homography

    def sees(self, x_m: FloatArray, y_m: FloatArray) -> NDArray[np.bool_]:
        """Tell which floor positions lie inside the picture; nothing hides anything."""
        u, v, depth = self.project(x_m, y_m, np.zeros_like(x_m))
        return (depth > 0) & (u >= 0) & (u < WIDTH_PX) & (v >= 0) & (v < HEIGHT_PX)

    def project(self, x_m: FloatArray, y_m: FloatArray, z_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return pixel u, pixel v and depth in metres of points of the room; only depth > 0 is before the camera."""
        points = np.stack([x_m, y_m, z_m, np.ones_like(x_m)])
        image: FloatArray = np.tensordot(self.projection, points, axes=1)
        uw, vw, w = image[0], image[1], image[2]
        safe = np.where(np.abs(w) < 1e-9, 1e-9, w)
        return uw / safe, vw / safe, w


CAMERAS: tuple[PinholeCamera, ...] = (
    PinholeCamera("cam-1", "Entrance", 23.8, 8.9, 3.2, -147.0),
    PinholeCamera("cam-2", "Checkouts", 0.3, 7.6, 3.2, -17.0),
    PinholeCamera("cam-3", "Aisles", 18.2, 15.3, 3.2, -137.0),
    PinholeCamera("cam-4", "Pharmacy", 1.7, 15.7, 3.2, -52.0),
)
