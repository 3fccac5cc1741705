"""Camera and stated error of a calibration from people, beside its matrix: `calibration/<camera>-from-people.json`."""

from __future__ import annotations

import json
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np

from vsd_analytics.engine.calibration_error import LikelyCameras
from vsd_analytics.engine.camera_model import CameraModel
from vsd_analytics.engine.camera_moves import Turn
from vsd_analytics.engine.people_calibration import FromPeople
from vsd_analytics.geometry.stated_errors import read_content
from vsd_analytics.store.durable import publish


@dataclass(frozen=True, slots=True)
class StatedCamera:
    """The camera of a calibration, against which later people are checked.

    Attributes:
        camera: The camera.
        depth_m: Depth of a body, as fitted.
        usual_turn: Of the people of the calibration; None where the calibration comes from something else.
    """

    camera: CameraModel
    depth_m: float
    usual_turn: Turn | None


def write_stated_error(path: Path, calibration: FromPeople, *, calibration_id: str) -> None:
    """Write camera, error map and likely cameras.

    Args:
        path: See `stated_errors.beside`.
        calibration: The calibration.
        calibration_id: Of the matrix in force, so that the file is not used with another one.
    """
    camera = calibration.camera
    content = {
        "calibration_id": calibration_id,
        "size_px": calibration.size_px,
        "focal_px": camera.focal_px,
        "tilt_deg": float(np.degrees(camera.tilt_rad)),
        "roll_deg": float(np.degrees(camera.roll_rad)),
        "height_m": camera.height_m,
        "centre_px": camera.centre_px,
        "depth_m": calibration.depth_m,
        "usual_turn_rad": list(astuple(calibration.usual_turn)),
        "homography": calibration.homography.tolist(),
        "map_columns": ["x_m", "y_m", "sd_of_2_m", "camera_part"],
        "map": calibration.view_map.round(3).tolist(),
        "likely": calibration.likely.tolist(),
    }
    publish(path, json.dumps(content).encode() + b"\n")


def read_stated_error(path: Path, *, calibration_id: str) -> LikelyCameras | None:
    """Return the error that belongs to a matrix; None without a file, or when it belongs to another matrix."""
    content = read_content(path, calibration_id=calibration_id)
    try:
        homography, likely = (np.asarray(content[key], dtype=np.float64) for key in ("homography", "likely"))
        width, height = (int(side) for side in content["size_px"])
    except (ValueError, KeyError, TypeError):
        return None
    return LikelyCameras(homography.reshape(3, 3), likely.reshape(-1, 3, 3), (width, height))


def read_stated_camera(path: Path, *, calibration_id: str) -> StatedCamera | None:
    """Return the camera that belongs to a matrix; None without a file, or when it belongs to another matrix."""
    content = read_content(path, calibration_id=calibration_id)
    try:
        focal, tilt, roll, height = (float(content[k]) for k in ("focal_px", "tilt_deg", "roll_deg", "height_m"))
        u, v = (float(value) for value in content["centre_px"])
        turn = Turn(*(float(value) for value in content["usual_turn_rad"]))
        depth_m = float(content["depth_m"])
    except (ValueError, KeyError, TypeError):
        return None
    camera = CameraModel(focal, float(np.radians(tilt)), float(np.radians(roll)), height, (u, v))
    return StatedCamera(camera, depth_m, turn)
