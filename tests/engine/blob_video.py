"""A video of painted people whose places are planned, so that a detector's truth is exact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.camera_model import CameraModel

Array = NDArray[np.float64]
SIZE = (320, 240)
CAMERA = CameraModel(focal_px=300.0, tilt_rad=0.6, roll_rad=0.0, height_m=5.0, centre_px=(160.0, 120.0))
HEIGHT_M = 1.7
COLOURS = [(230, 20, 20), (20, 230, 20), (20, 20, 230), (230, 230, 20)]
GROUND = 120


@dataclass(frozen=True)
class Walk:
    """Where somebody is: floor metres of each second; None = away."""

    at: Callable[[float], tuple[float, float] | None]


def box_of(xy: tuple[float, float]) -> tuple[int, int, int, int]:
    """Return the box of somebody in the picture, whole pixels."""
    right, ahead = CAMERA.floor_axes()
    foot = CAMERA.height_m * CAMERA.down() + xy[0] * right + xy[1] * ahead
    head = foot - HEIGHT_M * CAMERA.down()
    (u, bottom), (top_u, top) = (p[:2] / p[2] * CAMERA.focal_px + CAMERA.centre_px for p in (foot, head))
    half = 0.18 * (bottom - top)
    middle = (u + top_u) / 2
    return round(middle - half), round(top), round(middle + half), round(bottom)


def write_blob_video(path: Path, walks: list[Walk], *, seconds: float, fps: float) -> Path:
    """Write a lossless video; frame k shows everybody as at k / fps."""
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), fps, SIZE)
    assert video.isOpened()
    for k in range(round(seconds * fps)):
        video.write(painted(walks, k / fps))
    video.release()
    return path


def painted(walks: list[Walk], time_s: float) -> NDArray[np.uint8]:
    picture = np.full((SIZE[1], SIZE[0], 3), GROUND, dtype=np.uint8)
    for walk, colour in zip(walks, COLOURS, strict=False):
        at = walk.at(time_s)
        if at is not None:
            left, top, right, bottom = box_of(at)
            picture[top:bottom, left:right] = colour[::-1]
    return picture
