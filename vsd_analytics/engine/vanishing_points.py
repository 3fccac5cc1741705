"""Focal length, tilt and roll of a camera from the straight lines of one picture.

Floors, shelves and walls have edges in three directions at right angles (Coughlan and Yuille, Manhattan World, ICCV
1999). Each direction has a vanishing point. Two of them fix the focal length and the horizon when the axis goes through
the middle of the picture (Caprile and Torre 1990). Nothing in lines says how long a metre is: the height of the
camera has to be measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from vsd_analytics.engine.camera_model import CameraModel
from vsd_analytics.engine.people import Array
from vsd_analytics.errors import CalibrationError, Where

SHORTEST_SHARE: Final = 0.03
"""Segments shorter than this share of the picture's width point anywhere."""
MOST_SEGMENTS: Final = 400
N_GUESSES: Final = 6000
SEED: Final = 14
WITHIN_RAD: Final = float(np.radians(2.0))
"""A segment belongs to a vanishing point that its direction misses by less."""
USUAL_FOCAL: Final = 0.9
FOCAL_SD: Final = float(np.log(1.35))
"""Focal lengths in picture widths and their spread, as for people (`calibration_fit`)."""
FOCAL_RANGE: Final = (0.4, 3.0)
MIN_SEGMENTS: Final = 30
MIN_SHARE: Final = 0.5
"""Less of the segments' length in three directions is no room with right angles."""
MAX_TILT_SD_RAD: Final = float(np.radians(1.5))
"""Directions that vary more were found in too few edges."""
MIN_TILT_RAD, MAX_ROLL_RAD = (float(np.radians(degrees)) for degrees in (4.0, 15.0))
"""Cameras that watch a floor look down, and hang nearly upright: else lines of the floor could pass for a wall's."""


@dataclass(frozen=True, slots=True)
class FromLines:
    """A camera found from lines.

    Attributes:
        camera: The camera; its height is the given one.
        size_px: Width and height of the picture.
        n_segments: Segments long enough to count.
        share: Of their length, how much points to one of three vanishing points.
        tilt_sd_rad: Spread of the tilt, from how far segments miss their vanishing points.
    """

    camera: CameraModel
    size_px: tuple[int, int]
    n_segments: int
    share: float
    tilt_sd_rad: float


def camera_from_lines(picture: Path, *, height_m: float) -> FromLines:
    """Return the camera that took a picture of a place with right angles.

    Args:
        picture: The picture, as large as those that the engine sees.
        height_m: Of the lens above the floor.

    Raises:
        CalibrationError: It is no picture (E406), or its lines show no camera (E413).
    """
    grey: Any = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
    if grey is None:
        raise CalibrationError(
            f"cannot read {picture}", code="E406", where=Where(str(picture)), fix="give a PNG or JPG of the camera"
        )
    size = (int(grey.shape[1]), int(grey.shape[0]))
    return camera_from_segments(line_segments(grey), size_px=size, height_m=height_m)


def line_segments(grey: NDArray[np.uint8]) -> Array:
    """Return the longest straight edges of a grey picture as u, v of both ends, shape (n, 4)."""
    detected = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(grey)[0]
    segments = np.empty((0, 4)) if detected is None else np.asarray(detected, dtype=np.float64).reshape(-1, 4)
    length = _lengths(segments)
    order = np.argsort(-length, kind="stable")[:MOST_SEGMENTS]
    return np.asarray(segments[order[length[order] >= SHORTEST_SHARE * grey.shape[1]]])


def camera_from_segments(segments: Array, *, size_px: tuple[int, int], height_m: float) -> FromLines:
    """Return the camera whose three vanishing points explain most of the segments' length.

    Pairs of segments give guesses of two vanishing points; the best guess is refined by robust least squares over focal
    length and rotation. The usual focal length has a small weight, for pictures that leave it open.

    Args:
        segments: u, v of both ends, pixels, shape (n, 4).
        size_px: Width and height of the picture.
        height_m: Of the lens above the floor.

    Raises:
        CalibrationError: No camera explains them (E413).
    """
    if len(segments) < MIN_SEGMENTS:
        raise _no_camera(f"it has {len(segments)} long straight edges, and {MIN_SEGMENTS} are needed")
    width, centre = float(size_px[0]), np.array(size_px) / 2
    ends = (segments.reshape(-1, 2, 2) - centre) / width  # in picture widths around the axis
    length = _lengths(segments) / width
    start = _best_guess(ends, length)
    if start is None:
        raise _no_camera("no two directions of its edges are at right angles for a usual lens")
    fit = _refined(start, ends, length)
    misses = _misses(ends, *_axes(fit.x))
    share = float(length[misses.min(axis=0) < WITHIN_RAD].sum() / length.sum())
    if share < MIN_SHARE:
        raise _no_camera(f"only {share:.0%} of the length of its edges lies in three directions at right angles")
    tilt, roll = _tilt_and_roll(_axes(fit.x)[1])
    if tilt < MIN_TILT_RAD:
        raise _no_camera("the camera would look straight ahead")
    tilt_sd = float(np.sqrt(np.trace(np.linalg.pinv(fit.jac.T @ fit.jac)[1:, 1:])))
    if not tilt_sd <= MAX_TILT_SD_RAD:
        raise _no_camera(f"its edges leave the directions open by {np.degrees(tilt_sd):.1f} degrees")
    camera = CameraModel(float(np.exp(fit.x[0])) * width, tilt, roll, height_m, (float(centre[0]), float(centre[1])))
    return FromLines(camera, size_px, len(segments), share, tilt_sd)


def _lengths(segments: Array) -> Array:
    return np.asarray(np.hypot(segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]))


def _axes(vector: Array) -> tuple[float, Array]:
    """Return focal length in picture widths, and three directions at right angles in camera axes (columns)."""
    return float(np.exp(vector[0])), np.asarray(Rotation.from_rotvec(vector[1:]).as_matrix())


def _tilt_and_roll(axes: Array) -> tuple[float, float]:
    """Return tilt and roll of a camera that sees three directions at right angles, one of them the vertical.

    Of the three, only the vertical leads down in the picture and away from a camera that looks down.
    """
    of_down = axes[:, int(np.argmax(axes[1] * axes[2]))]
    x, y, z = of_down * np.sign(of_down[1])
    return float(np.arcsin(np.clip(z, -1, 1))), float(np.arctan2(x, y))


def _misses(ends: Array, focal: float, axes: Array) -> Array:
    """Return by how much each segment's direction misses each vanishing point, radians, shape (3, n)."""
    points = (axes * np.array([[focal], [focal], [1.0]])).T  # homogeneous, so that a point may lie at infinity
    middle, along = ends.mean(axis=1), ends[:, 1] - ends[:, 0]
    to_point = points[:, None, :2] - points[:, None, 2:] * middle
    cross = along[:, 0] * to_point[..., 1] - along[:, 1] * to_point[..., 0]
    return np.asarray(np.arctan2(np.abs(cross), np.abs(np.sum(along * to_point, axis=2))))


def _best_guess(ends: Array, length: Array) -> Array | None:
    """Return focal length (log) and rotation vector of the guess that explains most length."""
    rng = np.random.default_rng(SEED)
    first_end, second_end = (np.column_stack([ends[:, k], np.ones(len(ends))]) for k in (0, 1))
    lines = np.cross(first_end, second_end)
    chosen = rng.choice(len(ends), size=(N_GUESSES, 4), p=length / length.sum())
    first, second = (np.cross(lines[chosen[:, k]], lines[chosen[:, k + 1]]) for k in (0, 2))
    with np.errstate(divide="ignore", invalid="ignore"):
        square = -np.sum(first[:, :2] * second[:, :2], axis=1) / (first[:, 2] * second[:, 2])
    usual = USUAL_FOCAL**2
    is_open = ~np.isfinite(square)  # a vanishing point at infinity fixes no focal length
    focal = np.sqrt(np.where(is_open, usual, np.maximum(square, 0)))
    best: Array | None = None
    best_score = 0.0
    for k in np.flatnonzero((focal > FOCAL_RANGE[0]) & (focal < FOCAL_RANGE[1])):
        down = np.array([1 / focal[k], 1 / focal[k], 1.0])
        a, b = _unit(first[k] * down), _unit(second[k] * down)
        if not np.isfinite([a, b]).all() or abs(a @ b) > 0.05:
            continue
        across = _unit(b - (a @ b) * a)
        axes = np.column_stack([a, across, np.cross(a, across)])
        tilt, roll = _tilt_and_roll(axes)
        if tilt < MIN_TILT_RAD or abs(roll) > MAX_ROLL_RAD:
            continue
        near = _misses(ends, float(focal[k]), axes).min(axis=0)
        prior = (np.log(focal[k] / USUAL_FOCAL) / FOCAL_SD) ** 2
        score = float(length @ np.maximum(0, 1 - (near / WITHIN_RAD) ** 2)) / length.sum() - 0.01 * prior
        if score > best_score:
            best, best_score = np.r_[np.log(focal[k]), Rotation.from_matrix(axes).as_rotvec()], score
    return best


def _refined(start: Array, ends: Array, length: Array) -> Any:
    weight = np.sqrt(length / length.mean()) / (WITHIN_RAD / 4)
    of_point = np.argmin(_misses(ends, *_axes(start)), axis=0)

    def off(vector: Array) -> Array:
        misses = _misses(ends, *_axes(vector))[of_point, np.arange(len(ends))]
        robust = misses * weight / np.sqrt(1 + (misses / WITHIN_RAD) ** 2)
        return np.asarray(np.r_[robust, (vector[0] - np.log(USUAL_FOCAL)) / FOCAL_SD])

    solution: Any = least_squares(off, start, loss="soft_l1")
    return solution


def _unit(vector: Array) -> Array:
    with np.errstate(invalid="ignore"):  # two segments on one line meet nowhere
        return np.asarray(vector / np.linalg.norm(vector))


def _no_camera(why: str) -> CalibrationError:
    return CalibrationError(
        "the lines of this picture show no camera",
        code="E413",
        why=why,
        fix="give a picture with long straight edges of floor, shelves and walls; or --from-people, or --draw",
    )
