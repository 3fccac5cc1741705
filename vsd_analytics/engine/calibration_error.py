"""How far off a camera from people may be: the spread of distances over the cameras that explain them as well."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from vsd_analytics.engine.people import Array
from vsd_analytics.geometry.homography import as_matrix, project, to_floor, to_image

N_CAMERAS: Final = 100
SEED: Final = 14
POPULATION_SD, BOX_SD = 0.04, 0.04
"""Mean height of the people seen, and how much of a body a box holds, against what is assumed, relative: no picture
shows either."""
FOOT_PX: Final = 2.0
FOOT_M: Final = 0.03
"""Error of a foot point: of the mark in pixels, and of where a foot is seen on a body in metres."""
REACH_M: Final = 80.0
FARTHEST_SD_M: Final = 99.0
"""How far the stored map reaches, and the most that it says."""
PROBE_M: Final = 2.0
"""Distance whose spread the map shows."""


def likely_cameras(vector: Array, covariance: Array, *, uses_joints: bool) -> Array:
    """Return parameters of cameras drawn from the posterior, shape (`N_CAMERAS`, 6)."""
    rng = np.random.default_rng(SEED)
    values, axes = np.linalg.eigh((covariance + covariance.T) / 2)
    drawn = vector + rng.standard_normal((N_CAMERAS, len(vector))) * np.sqrt(np.maximum(values, 0)) @ axes.T
    drawn[:, 3] += rng.normal(0, POPULATION_SD if uses_joints else np.hypot(POPULATION_SD, BOX_SD), N_CAMERAS)
    return np.asarray(drawn)


def foot_covariance(homography: Array, uv: Array, *, picture_px: tuple[int, int]) -> Array:
    """Return the covariance of floor positions from the error of foot points, square metres, shape (n, 2, 2).

    The picture's error goes through the derivative of the homography, so it grows with the square of the distance.
    """
    jacobian = floor_per_px(homography, uv, picture_px=picture_px)
    per_px = np.linalg.norm(jacobian[:, :, 0], axis=1)  # metres across one pixel: across the picture nothing is short
    pixels = np.hypot(FOOT_PX, FOOT_M / per_px)
    return np.asarray(jacobian @ np.swapaxes(jacobian, 1, 2) * (pixels**2)[:, None, None])


def floor_per_px(homography: ArrayLike, uv: Array, *, picture_px: tuple[int, int] | None) -> Array:
    """Return the derivative of floor positions by pixels, metres per pixel, shape (n, 2, 2)."""
    h = as_matrix(homography)
    xy = to_floor(h, uv, picture_px=picture_px)
    w = uv @ h[2, :2] + h[2, 2]
    return np.asarray((h[:2, :2] - xy[:, :, None] * h[2, :2]) / w[:, None, None])


def camera_sd_m(cameras: Array, a: Array, b: Array) -> Array:
    """Return the spread of distances between foot points over cameras, half of the middle 68 %, metres, shape (n,).

    Args:
        cameras: Homographies, shape (m, 3, 3).
        a: Foot points in pixels, shape (n, 2).
        b: The other ones.
    """
    lengths = np.array([np.linalg.norm(project(h, b) - project(h, a), axis=1) for h in cameras])
    low, high = np.quantile(lengths, [0.16, 0.84], axis=0)  # one absurd camera in a hundred must not count
    return np.asarray((high - low) / 2)


def distance_sd_m(homography: Array, cameras: Array, a: Array, b: Array, *, picture_px: tuple[int, int]) -> Array:
    """Return the standard deviation of distances between foot points, metres, shape (n,).

    Both errors are in it: of the camera, over the cameras drawn, and of the two foot points.

    Args:
        homography: The one in force, 3x3.
        cameras: Homographies of the cameras drawn, shape (m, 3, 3).
        a: Foot points in pixels, shape (n, 2).
        b: The other ones.
        picture_px: Width and height of the picture.
    """
    apart = to_floor(homography, b, picture_px=picture_px) - to_floor(homography, a, picture_px=picture_px)
    along = apart / np.maximum(np.linalg.norm(apart, axis=1), 1e-6)[:, None]
    feet = sum(foot_covariance(homography, uv, picture_px=picture_px) for uv in (a, b))
    return np.asarray(np.sqrt(camera_sd_m(cameras, a, b) ** 2 + np.einsum("ni,nij,nj->n", along, feet, along)))


@dataclass(frozen=True, slots=True)
class LikelyCameras:
    """What is needed to say how uncertain a distance is.

    Attributes:
        homography: The one in force, 3x3.
        likely: Homographies of other cameras that explain the people as well, shape (m, 3, 3).
        size_px: Width and height of the picture.
    """

    homography: Array
    likely: Array
    size_px: tuple[int, int]

    def distance_sd_m(self, a: Array, b: Array) -> Array:
        """Return the sd of the distances between foot points a and b, pixels, shape (n, 2)."""
        return distance_sd_m(self.homography, self.likely, a, b, picture_px=self.size_px)


def error_map(homography: Array, cameras: Array, uv: Array, *, picture_px: tuple[int, int]) -> Array:
    """Return where a distance of 2 m is how uncertain, one row per floor cell of 1 m with people.

    Args:
        homography: The one in force, 3x3.
        cameras: Homographies of the cameras drawn, shape (m, 3, 3).
        uv: Foot points of people in pixels, shape (n, 2).
        picture_px: Width and height of the picture.

    Returns:
        x and y of the cell's middle, the whole sd, and the camera's part of it, metres, shape (k, 4). An sd is the root
        mean square over a distance across the view and one along it.
    """
    xy = to_floor(homography, uv, picture_px=picture_px)
    return _map_of(np.unique(np.floor(xy[np.isfinite(xy).all(axis=1)]), axis=0) + 0.5, homography, cameras, picture_px)


def view_map(homography: Array, cameras: Array, *, picture_px: tuple[int, int]) -> Array:
    """Return the same for all floor in the picture up to `REACH_M` from below the camera, shape (k, 4).

    What cannot be computed, near the horizon, is `FARTHEST_SD_M`, and nothing is more.
    """
    side = np.arange(-REACH_M, REACH_M) + 0.5
    cells = np.column_stack([axis.ravel() for axis in np.meshgrid(side, side)])
    uv = to_image(homography, cells, picture_px=picture_px)
    with np.errstate(invalid="ignore"):
        is_inside = ((uv >= 0) & (uv <= np.array(picture_px))).all(axis=1)
    is_near = np.hypot(cells[:, 0], cells[:, 1]) < REACH_M
    error_rows = _map_of(cells[is_inside & is_near], homography, cameras, picture_px)
    sd = np.minimum(np.nan_to_num(error_rows[:, 2:], nan=FARTHEST_SD_M), FARTHEST_SD_M)
    return np.column_stack([error_rows[:, :2], sd])


def _map_of(cells: Array, homography: Array, cameras: Array, picture_px: tuple[int, int]) -> Array:
    whole, camera = [], []
    for step in ((PROBE_M / 2, 0.0), (0.0, PROBE_M / 2)):
        a, b = (to_image(homography, cells + sign * np.array(step), picture_px=picture_px) for sign in (-1, 1))
        whole.append(distance_sd_m(homography, cameras, a, b, picture_px=picture_px))
        camera.append(camera_sd_m(cameras, a, b))
    return np.column_stack([cells, *(np.sqrt(np.mean(np.square(part), axis=0)) for part in (whole, camera))])
