"""Monoloco's metres on the floor: camera axes turned level, and the spread along the view carried to distances.

Monoloco estimates how far each person is from the camera, by the size of the body. Its places are in the axes of the
camera, which looks down. Here they are turned by the camera's calibration, or by the plane on which the people's own
places lie.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from vsd_analytics.engine.body import feet
from vsd_analytics.engine.camera_model import CameraModel
from vsd_analytics.engine.monoloco_files import MonolocoPeople
from vsd_analytics.engine.people import Array
from vsd_analytics.engine.safe_space import SafeSpaces, pairs_of_frames
from vsd_analytics.engine.seen import Seen
from vsd_analytics.engine.tracker import follow, with_ids
from vsd_analytics.errors import CalibrationError
from vsd_analytics.geometry.homography import as_matrix, camera_pose

BODY_M: Final = 0.1
"""Sd of the middle of a body around where the person stands."""
MIN_PLACES: Final = 40
MAX_TILT_SD_DEG: Final = 2.0
"""A plane less certain than this would change distances along the view by more than a few per cent."""
N_BLOCKS: Final = 10
"""Blocks of time for the jackknife: neighbouring frames show the same people."""
_SPREAD: Final = 0.1  # usual relative error of Monoloco's distances


@dataclass(frozen=True, slots=True)
class LevelFloor:
    """What turns camera axes into floor metres.

    Attributes:
        turn: Floor x and y of one metre along each camera axis, shape (2, 3).
        shift: Floor x and y of the camera, shape (2,).
        homography: Pixels to floor metres, 3x3; None where no calibration gives it.
        name: Where it comes from, for the messages.
    """

    turn: Array
    shift: Array
    homography: Array | None
    name: str


def floor_of_calibration(homography: ArrayLike, *, picture_px: tuple[int, int], name: str) -> LevelFloor:
    """Return the floor of a calibrated camera.

    Args:
        homography: 3x3, pixels to floor metres.
        picture_px: Width and height of the picture.
        name: Of the calibration.

    Raises:
        CalibrationError: No camera makes this homography (E411).
    """
    focal_and_pose = camera_pose(homography, picture_px=picture_px)
    if focal_and_pose is None:
        raise CalibrationError(
            "the tilt of the camera is not known from its calibration",
            code="E411",
            why="no lens with square pixels makes this homography, as where a camera looks straight down",
            fix="vsd calibrate CAMERA --from-people PEOPLE --size WxH",
        )
    pose = focal_and_pose[1]
    axes, _, crossed = np.linalg.svd(pose[:, :3])
    rotation = axes @ crossed  # the nearest one
    return LevelFloor(rotation.T[:2], -(rotation.T @ pose[:, 3])[:2], as_matrix(homography), name)


def floor_of_people(monoloco_people: MonolocoPeople) -> LevelFloor:
    """Return the floor below a camera from the plane on which the middles of its people lie.

    Places are off along the view by a share of the distance, so the plane m fulfils x . m = 1 up to a relative error;
    m is fitted by robust least squares. Its spread is that of a jackknife over blocks of time.

    Raises:
        CalibrationError: Too few people, or people in too little of the view (E411).
    """
    known = np.isfinite(monoloco_people.xyz).all(axis=1) & (monoloco_people.xyz[:, 2] > 0)
    places, frame = monoloco_people.xyz[known], monoloco_people.people.frame[known]
    if len(places) < MIN_PLACES:
        raise _no_floor(f"{len(places)} places are too few")
    whole = _plane(places)
    blocks = np.array_split(np.unique(frame), N_BLOCKS)
    others = [places[~np.isin(frame, block)] for block in blocks if len(block)]
    downs = np.array([_unit(_plane(rest)) for rest in others if len(rest) >= MIN_PLACES // 2])
    down, n = _unit(whole), len(downs)
    tilt_sd = np.degrees(np.sqrt((n - 1) / max(n, 1) * np.sum((downs - down) ** 2))) if n > 1 else np.inf
    if not tilt_sd <= MAX_TILT_SD_DEG:
        raise _no_floor(f"their plane leaves the tilt open by {tilt_sd:.0f} degrees")
    level = CameraModel(
        1.0, float(np.arcsin(np.clip(down[2], -1, 1))), float(np.arctan2(down[0], down[1])), 1.0, (0, 0)
    )
    return LevelFloor(np.array(level.floor_axes()), np.zeros(2), None, "tilt from its people")


def locate_monoloco(
    monoloco_people: MonolocoPeople,
    floor: LevelFloor,
    *,
    within_m: float,
    distance_m: float = 2.0,
    ts_ms: NDArray[np.int64] | None = None,
) -> Seen:
    """Return where people are on the floor by Monoloco, and the pairs nearer than a distance.

    Args:
        monoloco_people: What Monoloco wrote.
        floor: What turns its places level.
        within_m: Pairs from this distance on are left out.
        distance_m: Two persons nearer than this are too close.
        ts_ms: UTC milliseconds of the frames: gives people track ids by following them. None = no ids.
    """
    people = monoloco_people.people
    xy = monoloco_people.xyz @ floor.turn.T + floor.shift
    along = (
        monoloco_people.xyz
        @ floor.turn.T
        / np.linalg.norm(monoloco_people.xyz, axis=1)[:, None]
        * monoloco_people.sd_m[:, None]
    )
    covariance = along[:, :, None] * along[:, None, :] + BODY_M**2 * np.eye(2)
    if ts_ms is not None:
        numbers = follow(xy, covariance, np.searchsorted(people.frames, people.frame), ts_ms / 1000)
        people = with_ids(people, numbers, ts_ms=ts_ms)
    a, b = pairs_of_frames(people.frame)
    apart = xy[b] - xy[a]
    distance = np.linalg.norm(apart, axis=1)
    near = distance < within_m
    a, b, apart, distance = a[near], b[near], apart[near], distance[near]
    line = apart / np.maximum(distance, 1e-6)[:, None]
    spread = np.sqrt(np.einsum("ni,nij,nj->n", line, covariance[a] + covariance[b], line))
    n_lost = int((~np.isfinite(xy).all(axis=1)).sum())
    homography, radius = floor.homography, np.full(len(people), distance_m / 2)
    return Seen(
        people=people,
        uv=feet(people),
        xy=xy,
        a=a,
        b=b,
        distance_m=distance,
        quality="body",
        engine=f"monoloco {floor.name}",
        left_out={"no place by Monoloco": n_lost} if n_lost else {},
        sd_m=spread,
        spaces=None if homography is None else SafeSpaces(homography, xy, radius, distance_m / 2),
    )


def _plane(places: Array) -> Array:
    """Return m with places @ m = 1."""
    start, *_ = np.linalg.lstsq(places, np.ones(len(places)), rcond=None)

    def off(plane: Array) -> Array:
        return np.asarray(places @ plane - 1)

    return np.asarray(least_squares(off, start, loss="cauchy", f_scale=_SPREAD).x)


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _no_floor(why: str) -> CalibrationError:
    return CalibrationError(
        "the people do not show how the camera is tilted",
        code="E411",
        why=why,
        fix="give more frames with people near and far, or calibrate: vsd calibrate CAMERA --from-people PEOPLE",
    )
