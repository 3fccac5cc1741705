"""The camera from nothing but the people it sees: horizon, focal length, tilt, roll, height.

Upright people of about one height give the horizon and the direction of gravity: the farther up in the picture the
feet, the shorter the body (Lv, Zhao and Nevatia, Camera calibration from video of a walking human, 2006). They leave
the focal length and the place of the axis in the picture nearly open: many pairs of both make the same bodies. People
who walk close that gap, because they are as fast across the picture as towards it. What remains open is decided by
what lenses usually are.

The result has the greatest posterior probability. Residuals are robust (Cauchy), so children, sitting people and cut
boxes have little weight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from vsd_analytics.engine.camera_model import CameraModel, away
from vsd_analytics.engine.people import Array
from vsd_analytics.engine.sightings import Sightings, Steps, steps, thinned

BODY_SD: Final = 0.05
"""Heights of adults, relative: 1.63 +- .07 and 1.77 +- .07 m together."""
POSTURE_SD: Final = 0.03
"""One person's height over a walk, relative."""
MARK_PX: Final = 2.0
MARK_SHARE: Final = 0.01
"""Error of a mark: in pixels, and as a share of the body's length in the picture, as detectors have it."""
LEAST_GAIN: Final = 0.1
"""A body that is longer by 1 % in the picture is higher by at least a tenth of that."""
LEAN_SD: Final = 0.08
"""How far a body leans sideways, in body lengths."""
SPEED_SD: Final = 0.35
"""Logarithm of walking speeds of people."""
FOCAL_WIDTHS, FOCAL_SD = 0.9, 0.3
"""Usual focal length in picture widths, a horizontal view of 58 degrees, and the sd of its logarithm."""
ROLL_SD: Final = 0.05
"""Radians: cameras are put up nearly level."""
CENTRE_SD: Final = 0.06
"""Of the axis above or below the middle of the picture, in picture heights."""
HEIGHT_M, HEIGHT_SD = 4.0, 1.0
"""Usual height of a camera and the sd of its logarithm: says almost nothing."""
UNTRACKED_PEOPLE: Final = 150
"""Parts of walks count at most like so many persons: without track ids one person has several."""
MIN_WALKERS: Final = 8
STRETCH_M: Final = 1.2
"""A stretch of a walk is long enough to measure when half of them are longer than this."""
_STARTS: Final = tuple(product(np.log([0.6, 1.0, 1.6]), np.radians([8.0, 20.0, 35.0, 55.0])))
DEPTH, _SPEED = 5, 6
"""Places in the vector of the depth of a body, and of the mean logarithm of walked lengths, which is fitted beside."""
_SCALE: Final = (0.1, 0.05, 0.05, 0.1, 0.05, 0.05)
_BOUNDS: Final = ((-1.5, 0.0, -0.5, -1.0, -0.4, -0.1), (1.5, 1.5, 0.5, 4.0, 0.4, 0.5))
"""Focal length .22 to 4.5 widths, tilt 0 to 86 degrees, roll 29 degrees, height .4 to 55 m."""
_FAR: Final = 20.0
"""Residual of what the camera cannot have seen."""
_ROUNDS: Final = 3
"""Each round chooses the walkers again, by the camera of the last one."""
_FIRST_STEPS, _FINISHED, _STEPS = 8, 3, 60
"""Every start goes a few steps; the best ones go on to the end."""


@dataclass(frozen=True, slots=True)
class Fitted:
    """A camera that explains what was seen.

    Attributes:
        camera: The camera.
        vector: log(focal length / width), tilt, roll, log(height), axis below the middle / height of the
            picture, depth of a body in metres.
        covariance: Of `vector`, from the curvature of the posterior, shape (6, 6).
        size_px: Width and height of the picture.
        seen: All sightings.
        scatter: Robust relative sd of the heights that the camera makes of them.
        n_walkers: People whose speeds took part.
    """

    camera: CameraModel
    vector: Array
    covariance: Array
    size_px: tuple[int, int]
    seen: Sightings
    scatter: float
    n_walkers: int


def camera_of(vector: Array, size_px: tuple[int, int]) -> CameraModel:
    """Return the camera that a vector of parameters means; see `Fitted.vector`."""
    width, height = size_px
    log_focal, tilt, roll, log_height, off = (float(value) for value in vector[:DEPTH])
    centre = (width / 2, height / 2 + off * height)
    return CameraModel(float(np.exp(log_focal)) * width, tilt, roll, float(np.exp(log_height)), centre)


def axes_of(camera: CameraModel, seen: Sightings, depth_m: float) -> Array:
    """Return where the vertical axis of each person meets the plane of the lower mark, camera axes, shape (n, 3)."""
    low = camera.on_plane(seen.low, seen.body.low_m)
    return low + depth_m * away(low, camera)


def heights_m(camera: CameraModel, seen: Sightings, depth_m: float) -> tuple[Array, Array]:
    """Return how high the upper mark of each person is above the floor, and how far it leans to the side, metres."""
    body, down = seen.body, camera.down()
    axes = axes_of(camera, seen, depth_m)
    foot = axes + depth_m * (1 if camera.height_m > body.high_m else -1) * away(axes, camera)
    # the point foot - k down has the row of the upper mark: (y - k down_y) / (z - k down_z) = slope
    slope = (seen.high[:, 1] - camera.centre_px[1]) / camera.focal_px
    k = (foot[:, 1] - slope * foot[:, 2]) / (down[1] - slope * down[2])
    top = foot - k[:, None] * down
    lean = (seen.high[:, 0] - camera.centre_px[0]) / camera.focal_px * top[:, 2] - top[:, 0]
    return body.low_m + k, lean


def floor_xy(camera: CameraModel, points: Array) -> Array:
    """Return the floor position of points in camera axes, metres, shape (n, 2)."""
    return np.asarray(points @ np.column_stack(camera.floor_axes()))


def fit_camera(seen: Sightings, *, size_px: tuple[int, int]) -> Fitted | None:
    """Return the most probable camera.

    Args:
        seen: Sightings of people.
        size_px: Width and height of the picture.

    Returns:
        None where no camera explains them.
    """
    some = thinned(seen)
    posture = _Posture(some, size_px)
    starts = [start for first in _STARTS if (start := posture.start(*first)) is not None]
    tries = sorted((posture.fit(start, most=_FIRST_STEPS) for start in starts), key=lambda result: result.cost)
    if not tries:
        return None
    solution = min((posture.fit(tried.x, most=_STEPS) for tried in tries[:_FINISHED]), key=lambda result: result.cost)
    n_walkers = 0
    # links between frames lose those who walk fast across the picture, so without track ids speeds would mislead
    walks = _stretches(seen, camera_of(solution.x, size_px), solution.x[DEPTH]) if seen.has_tracks else None
    for _ in range(_ROUNDS if walks is not None else 0):
        assert walks is not None
        speed = _Speed(seen, walks, solution.x, size_px)
        if speed.n_walkers < MIN_WALKERS:
            break
        n_walkers = speed.n_walkers
        solution = least_squares(
            lambda p, speed=speed: np.concatenate([posture.residuals(p), speed.residuals(p)]),  # type: ignore[misc]
            np.append(solution.x[:_SPEED], speed.usual),
            x_scale=(*_SCALE, 0.1),
            bounds=([*_BOUNDS[0], -np.inf], [*_BOUNDS[1], np.inf]),
            max_nfev=_STEPS,
        )
    camera = camera_of(solution.x, size_px)
    heights = heights_m(camera, some, solution.x[DEPTH])[0]
    off = np.log(np.where(heights > 0, heights, np.nan) / seen.body.high_m)
    scatter = float(np.nanmedian(np.abs(off - np.nanmedian(off))) * 1.4826)
    curvature = solution.jac.T @ solution.jac
    covariance = np.linalg.pinv(curvature, hermitian=True)[:_SPEED, :_SPEED]
    return Fitted(camera, solution.x[:_SPEED], covariance, size_px, seen, scatter, n_walkers)


class _Posture:
    """Residuals of body heights and leans, and of what cameras usually are."""

    def __init__(self, seen: Sightings, size_px: tuple[int, int]) -> None:
        self._seen, self._size_px = seen, size_px
        self._mark_px = np.hypot(MARK_PX, MARK_SHARE * seen.length_px)
        self._lower = replace(seen, low=seen.low + np.array([0, 1]))
        self._upper = replace(seen, high=seen.high + np.array([0, 1]))
        self._person, self._of = np.unique(seen.who, return_inverse=True)
        n_rows = np.bincount(self._of)[self._of]
        # without tracks the body's own spread is in every row; with tracks once per person
        self._weight_of_mean = 1.0 if seen.has_tracks else np.sqrt(min(1.0, UNTRACKED_PEOPLE / len(self._person)))
        lean_sd = np.hypot(LEAN_SD, np.sqrt(2) * MARK_PX / seen.length_px)
        self._lean_sd = lean_sd * seen.body.high_m * np.sqrt(n_rows)
        self._within = np.sqrt(n_rows > 1)

    def start(self, log_focal: float, tilt: float) -> Array | None:
        """Return parameters with the height that bodies of usual height mean; None where many feet are in the sky."""
        first = np.array([log_focal, tilt, 0.0, np.log(HEIGHT_M), 0.0, self._seen.body.depth_m])
        heights = heights_m(camera_of(first, self._size_px), self._seen, 0.0)[0]
        seen = np.isfinite(heights) & (heights > 0)
        if seen.mean() < 0.8:
            return None
        first[3] += np.log(self._seen.body.high_m / np.median(heights[seen]))
        return np.asarray(np.clip(first, *_BOUNDS))

    def fit(self, start: Array, *, most: int) -> OptimizeResult:
        """Return the best parameters after at most so many steps."""
        return least_squares(self.residuals, start, x_scale=_SCALE, bounds=_BOUNDS, max_nfev=most)

    def residuals(self, vector: Array) -> Array:
        camera = camera_of(vector, self._size_px)
        heights, lean = heights_m(camera, self._seen, vector[DEPTH])
        off = self._off(heights)
        is_seen = np.isfinite(off)
        off = np.where(is_seen, off, 1.0)
        row_sd, body_sd = self._sds(camera, vector[DEPTH], off)
        total = np.bincount(self._of, row_sd**-2)
        mean, mean_sd = (np.bincount(self._of, value / row_sd**2) / total for value in (off, body_sd))
        within = np.where(is_seen, self._within * (off - mean[self._of]) / row_sd, _FAR)
        parts = [_cauchy(mean / np.hypot(mean_sd, total**-0.5)) * self._weight_of_mean, _cauchy(within)]
        if self._seen.has_lean:
            parts.append(_cauchy(np.where(np.isfinite(lean), lean / self._lean_sd, _FAR)))
        usual = [
            (vector[0] - np.log(FOCAL_WIDTHS)) / FOCAL_SD,
            vector[2] / ROLL_SD,
            (vector[3] - np.log(HEIGHT_M)) / HEIGHT_SD,
            vector[4] / CENTRE_SD,
            (vector[DEPTH] - self._seen.body.depth_m) / self._seen.body.depth_sd_m,
        ]
        return np.concatenate([*parts, usual])

    def _off(self, heights: Array) -> Array:
        return np.asarray(np.log(np.where(heights > 1e-3, heights, np.nan) / self._seen.body.high_m))

    def _sds(self, camera: CameraModel, depth_m: float, off: Array) -> tuple[Array, Array]:
        """Return what marks and posture may do to heights by this camera, and what differences of bodies may do.

        What varies are marks in the picture. With one sd of heights for all cameras the fit would look for a camera
        that makes little of them, such as one at the height of the heads, where a low mark makes nobody longer.
        """
        by_low, by_high = (
            np.nan_to_num(self._off(heights_m(camera, moved, depth_m)[0]) - off, nan=1.0)
            for moved in (self._lower, self._upper)
        )
        taller = np.maximum(np.abs(by_high) * self._seen.length_px, LEAST_GAIN)
        return np.hypot(POSTURE_SD * taller, self._mark_px * np.hypot(by_low, by_high)), BODY_SD * taller


class _Speed:
    """Residuals of walking speeds: each person's mean logarithm against everybody's."""

    def __init__(self, seen: Sightings, walks: Steps, vector: Array, size_px: tuple[int, int]) -> None:
        self._seen, self._size_px = seen, size_px
        length = stretch_m(camera_of(vector, size_px), seen, walks, vector[DEPTH])
        typical = np.quantile(length[np.isfinite(length)], 0.75) if np.isfinite(length).any() else np.inf
        walking = (length > 0.4 * typical) & (length < 2.5 * typical)
        self._walks = Steps(walks.begin[walking], walks.end[walking], walks.who[walking])
        self.usual = float(np.log(np.median(length[walking]))) if walking.any() else 0.0
        _, person_of_walk, size = np.unique(self._walks.who, return_inverse=True, return_counts=True)
        self._sd = SPEED_SD * np.sqrt(size[person_of_walk])  # a person counts once, however long the walk
        self.n_walkers = len(size)

    def residuals(self, vector: Array) -> Array:
        length = stretch_m(camera_of(vector, self._size_px), self._seen, self._walks, vector[DEPTH])
        off = np.log(np.where(length > 1e-3, length, np.nan)) - vector[_SPEED]
        return _cauchy(np.where(np.isfinite(off), off / SPEED_SD, _FAR)) * (SPEED_SD / self._sd)


def stretch_m(camera: CameraModel, seen: Sightings, walks: Steps, depth_m: float) -> Array:
    """Return the length of stretches on the floor, metres, shape (n,)."""
    xy = [floor_xy(camera, axes_of(camera, seen.rows(rows), depth_m)) for rows in (walks.begin, walks.end)]
    return np.asarray(np.linalg.norm(xy[1] - xy[0], axis=1))


def _stretches(seen: Sightings, camera: CameraModel, depth_m: float) -> Steps | None:
    """Return stretches of the shortest time in which half of the people get `STRETCH_M` far; None without any."""
    gaps = np.diff(np.unique(seen.frame))
    if not len(gaps):
        return None
    best, step = None, int(np.gcd.reduce(gaps))
    for doubling in range(9):
        walks = steps(seen, n_frames=step * 2**doubling)
        if len(walks.begin) < 2 * MIN_WALKERS:
            break
        best = walks
        if np.median(stretch_m(camera, seen, walks, depth_m)) > STRETCH_M:  # NaN is not
            break
    return best


def _cauchy(residual: Array) -> Array:
    """Return residuals whose squares are those of Cauchy's robust loss, log(1 + r^2)."""
    return np.asarray(np.sign(residual) * np.sqrt(np.log1p(np.minimum(residual**2, 1e6))))
