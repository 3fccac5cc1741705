"""Homographies between camera picture and floor plane.

A homography H maps pixels to metres: (x, y, w) = H (u, v, 1), floor position (x/w, y/w). Its w is proportional to one
over the depth of the floor point, changes sign at the horizon, and has on the ground in front of the camera the sign
it has at the bottom centre of the picture (Hartley and Zisserman, Multiple View Geometry, 2nd ed., 8.6). Points on
the other side are not on the floor: they are NaN here, never a wrong place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vsd_analytics.errors import CalibrationError

Array = NDArray[np.float64]

NOMINAL_BOTTOM_PX = (1000.0, 2000.0)
"""Replaces the bottom centre of a picture of unknown size: below the horizon of any camera that looks ahead, and
above the inverted horizon of one that looks straight down within about 25 degrees."""

DEGENERATE_SHARE = 0.01
"""Points whose spread across is less than this share of their spread along lie on a line."""

OPEN_SHARE = 1e-4
"""Equations of centred points weaker than this share of the strongest fix nothing."""

MIN_POINTS = 4


@dataclass(frozen=True, slots=True)
class Fit:
    """A homography made from point pairs.

    Attributes:
        homography: 3x3, rows, pixels to metres, last entry 1 unless it is 0.
        rmse_m: Root mean square over the points of the distance between where they are and where they are mapped.
        errors_m: That distance for each point, shape (n,).
    """

    homography: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
    rmse_m: float
    errors_m: Array


def ground_sign(homography: ArrayLike, *, picture_px: tuple[int, int] | None = None) -> float:
    """Return the sign (1.0 or -1.0) that w = h31 u + h32 v + h33 has on the floor in front of the camera.

    It is the sign at the bottom centre of the picture, or at `NOMINAL_BOTTOM_PX` when the size is unknown.

    Args:
        homography: 3x3, pixels to metres.
        picture_px: Width and height of the picture.
    """
    h = as_matrix(homography)
    u, v = (picture_px[0] / 2, float(picture_px[1])) if picture_px else NOMINAL_BOTTOM_PX
    return -1.0 if h[2, 0] * u + h[2, 1] * v + h[2, 2] < 0 else 1.0


def to_floor(homography: ArrayLike, uv: ArrayLike, *, picture_px: tuple[int, int] | None = None) -> Array:
    """Map picture points to the floor: (x/w, y/w) with (x, y, w) = H (u, v, 1).

    Args:
        homography: 3x3, pixels to metres.
        uv: Pixels, shape (n, 2); points outside the picture are mapped too.
        picture_px: Width and height of the picture; decides which side of the horizon is floor (`ground_sign`).

    Returns:
        Metres, shape (n, 2); NaN for points at or above the horizon and for NaN.
    """
    h = as_matrix(homography)
    return project(h, uv, sign=ground_sign(h, picture_px=picture_px))


def to_image(homography: ArrayLike, xy: ArrayLike, *, picture_px: tuple[int, int] | None = None) -> Array:
    """Map floor points to the picture, the inverse of `to_floor`.

    Args:
        homography: 3x3, pixels to metres.
        xy: Metres, shape (n, 2).
        picture_px: Width and height of the picture.

    Returns:
        Pixels, shape (n, 2); NaN for points at or behind the plane of the camera.
    """
    h = as_matrix(homography)
    # H (u, v, 1) = w (x, y, 1), so the third entry of H^-1 (x, y, 1) is 1/w and has the sign of w
    return project(_inverse(h), xy, sign=ground_sign(h, picture_px=picture_px))


def ground_resolution(homography: ArrayLike, xy: ArrayLike, *, picture_px: tuple[int, int] | None = None) -> Array:
    """Return how finely the picture shows the floor: sqrt |det J| of the map from metres to pixels.

    With G = H^-1 and w' the third entry of G (x, y, 1): det J = det G / w'^3.

    Args:
        homography: 3x3, pixels to metres.
        xy: Metres, shape (n, 2).
        picture_px: Width and height of the picture.

    Returns:
        Pixels per metre (geometric mean over directions), shape (n,); NaN at or behind the plane of the camera.
    """
    h = as_matrix(homography)
    g = _inverse(h)
    w = _points(xy) @ g[2, :2] + g[2, 2]
    w = np.where(w * ground_sign(h, picture_px=picture_px) > 0, np.abs(w), np.nan)
    return np.asarray(np.sqrt(np.abs(np.linalg.det(g)) / w**3))


def projection(homography: ArrayLike, *, picture_px: tuple[int, int]) -> Array | None:
    """Return the whole camera behind a homography: the 3x4 matrix P from floor metres and height to pixels.

    (u w, v w, w) = P (x, y, z, 1), w the depth in metres.

    Args:
        homography: 3x3, pixels to metres.
        picture_px: Width and height of the picture.

    Returns:
        None when no such lens makes this homography (`camera_pose`).
    """
    camera = camera_pose(homography, picture_px=picture_px)
    if camera is None:
        return None
    focal_px, pose = camera
    lens = np.array([[focal_px, 0, picture_px[0] / 2], [0, focal_px, picture_px[1] / 2], [0, 0, 1]])
    return np.asarray(lens @ pose)


def camera_pose(homography: ArrayLike, *, picture_px: tuple[int, int]) -> tuple[float, Array] | None:
    """Return the lens and the place of the camera behind a homography.

    A homography fixes both when the lens has square pixels and its axis meets the middle of the picture: with G = H^-1
    shifted to that middle, its first two columns are diag(f, f, 1) times two orthogonal vectors of equal length, two
    equations for 1/f^2, solved by least squares (Zhang, A flexible new technique for camera calibration, 2000, section
    3.1). Of the two normals of the floor, the one with the camera above it is taken.

    Args:
        homography: 3x3, pixels to metres.
        picture_px: Width and height of the picture.

    Returns:
        The focal length in pixels, and the 3x4 matrix from floor metres and height (x, y, z, 1) to camera axes: metres
        right, down, ahead. None when no such lens makes this homography, as for a camera that looks straight down.
    """
    h = as_matrix(homography)
    to_middle = np.array([[1.0, 0.0, -picture_px[0] / 2], [0.0, 1.0, -picture_px[1] / 2], [0.0, 0.0, 1.0]])
    g = to_middle @ _inverse(h) * ground_sign(h, picture_px=picture_px)
    (a, b), (c, d), (e, k) = g[:, :2]
    ahead = np.array([a * b + c * d, a * a + c * c - b * b - d * d])
    rest = np.array([e * k, e * e - k * k])
    inverse_f2 = -float(ahead @ rest) / max(float(ahead @ ahead), np.finfo(float).tiny)
    if not inverse_f2 > 0:
        return None
    focal_px = 1 / np.sqrt(inverse_f2)
    pose = np.diag([1 / focal_px, 1 / focal_px, 1.0]) @ g
    pose /= np.sqrt(np.linalg.norm(pose[:, 0]) * np.linalg.norm(pose[:, 1]))
    up = np.cross(pose[:, 0], pose[:, 1])
    if -up @ pose[:, 2] < 0:
        up = -up
    return float(focal_px), np.column_stack([pose[:, :2], up, pose[:, 2]])


def fit_homography(points: Sequence[tuple[float, float, float, float]] | ArrayLike) -> Fit:
    """Return the homography with the least squared error on the floor over pairs of picture and floor points.

    `cv2.findHomography` works in single precision, so pixels and metres are centred and scaled first.

    Args:
        points: (u, v, x, y) per point, pixels and metres, shape (n, 4), n >= 4.

    Raises:
        CalibrationError: Fewer than four different points (E401); points that lie on a line, in the picture or on the
            floor, or that no view from one side of the floor can show (E402).
    """
    import cv2

    pairs = np.unique(np.asarray(points, dtype=np.float64).reshape(-1, 4), axis=0)
    uv, xy = pairs[:, :2], pairs[:, 2:]
    if min(len(np.unique(uv, axis=0)), len(np.unique(xy, axis=0))) < MIN_POINTS:
        raise CalibrationError(
            f"{len(pairs)} different points are too few for a calibration",
            code="E401",
            why="four points fix it, a fifth and sixth show how good it is",
            fix="add points spread over the floor: u,v in the picture and x,y on the floor plan",
        )
    for side, where in ((uv, "in the picture"), (xy, "on the floor")):
        spread = np.linalg.svd(side - side.mean(axis=0), compute_uv=False)
        if spread[1] < DEGENERATE_SHARE * spread[0]:
            raise _degenerate(f"the points lie on one line {where}")
    from_uv, from_xy = _centring(uv), _centring(xy)
    near_uv, near_xy = project(from_uv, uv), project(from_xy, xy)
    fitted, _ = cv2.findHomography(near_uv, near_xy, 0)
    if fitted is None or np.linalg.cond(fitted) > 1e8 or _freedom(near_uv, near_xy) > 0:
        raise _degenerate("three of the four points lie on one line")
    h = _inverse(from_xy) @ fitted @ from_uv
    h = h / (h[2, 2] if abs(h[2, 2]) > 1e-12 * np.abs(h).max() else np.abs(h).max())
    w = uv @ h[2, :2] + h[2, 2]
    if not (np.all(w > 0) or np.all(w < 0)):
        raise _degenerate("the points lie on both sides of the horizon they define")
    given = np.asarray(points, dtype=np.float64).reshape(-1, 4)
    errors = np.hypot(*(project(h, given[:, :2]) - given[:, 2:]).T)
    (a, b, c), (d, e, f), (g, i, j) = h.tolist()
    return Fit(((a, b, c), (d, e, f), (g, i, j)), float(np.sqrt(np.mean(errors**2))), errors)


def _freedom(uv: Array, xy: Array) -> int:
    """Return how many of a homography's eight numbers the point pairs leave open.

    That is 8 minus the rank of the linear equations x (g u + h v + 1) = a u + b v + c and the same for y.
    """
    zero, one = np.zeros((len(uv), 3)), np.ones((len(uv), 1))
    at = np.hstack([uv, one])
    equations = np.vstack([np.hstack([at, zero, -xy[:, :1] * at]), np.hstack([zero, at, -xy[:, 1:] * at])])
    strengths = np.linalg.svd(equations, compute_uv=False)[:8]
    return int(np.sum(strengths < OPEN_SHARE * strengths[0]))


def as_matrix(homography: ArrayLike) -> Array:
    """Return a homography as a 3x3 array."""
    return np.asarray(homography, dtype=np.float64).reshape(3, 3)


def _inverse(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _points(points: ArrayLike) -> Array:
    return np.asarray(points, dtype=np.float64).reshape(-1, 2)


def project(matrix: Array, points: ArrayLike, *, sign: float = 0.0) -> Array:
    """Apply a 3x3 projective map to (n, 2) points; with a sign, points whose third coordinate has another are NaN."""
    mapped = _points(points) @ matrix[:, :2].T + matrix[:, 2]
    w = mapped[:, 2:]
    w = np.where(w * sign > 0, w, np.nan) if sign else w
    return np.asarray(mapped[:, :2] / w)


def _centring(points: Array) -> Array:
    """Return the similarity that moves points to mean 0 and root mean square distance sqrt 2."""
    middle = points.mean(axis=0)
    scale = np.sqrt(2.0) / np.sqrt(np.mean(np.sum((points - middle) ** 2, axis=1)))
    return np.array([[scale, 0.0, -scale * middle[0]], [0.0, scale, -scale * middle[1]], [0.0, 0.0, 1.0]])


def _degenerate(why: str) -> CalibrationError:
    return CalibrationError(
        "these points cannot fix a calibration",
        code="E402",
        why=why,
        fix="choose points far apart, not three of four on a line, and check that u,v (picture) and x,y (floor) of "
        "each row are the same spot",
    )
