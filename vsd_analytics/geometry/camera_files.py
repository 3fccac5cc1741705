"""Camera files: focal length, place and lens distortion of a camera as other programs write them, as a homography.

Read are OpenCV's XML and YAML and JSON with the same names (in one file, or lens and place in two, as WILDTRACK has
them), and lines `FocalLengthX = 2696.4`, as the Oxford Town Centre data set has them. The floor is z = 0 of the file's
world.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.errors import CalibrationError, Where
from vsd_analytics.geometry.calibration_files import calibration_text
from vsd_analytics.geometry.homography import as_matrix, fit_homography, to_floor

Array = NDArray[np.float64]

REACH_M: Final = 30.0
"""Distortion is fitted over the floor in the picture up to so far from the nearest of it."""
GRID: Final = (48, 27)
_NAMES: Final = {
    "lens": ("camera_matrix", "cameraMatrix", "K", "intrinsic_matrix"),
    "distortion": ("distortion_coefficients", "dist_coeffs", "distCoeffs", "dist", "D"),
    "rotation": ("rvec", "R", "rotation_matrix", "rotation"),
    "translation": ("tvec", "T", "t", "translation"),
}


@dataclass(frozen=True, slots=True)
class CameraFile:
    """A camera as a file describes it.

    Attributes:
        lens: Camera matrix, 3x3, pixels.
        distortion: Coefficients in OpenCV's order (k1, k2, p1, p2, k3, ...); empty for none.
        rotation: From the world to the camera, 3x3.
        translation: The same, metres, shape (3,).
    """

    lens: Array
    distortion: Array
    rotation: Array
    translation: Array


@dataclass(frozen=True, slots=True)
class FloorFit:
    """A homography that takes the place of a camera with its distortion.

    Attributes:
        homography: 3x3, pixels to floor metres.
        error_m: Root mean square over the floor in the picture of how far off it is; 0 without distortion.
        worst_m: The largest of that.
    """

    homography: Array
    error_m: float
    worst_m: float


def read_camera(paths: Sequence[Path], *, unit_m: float = 1.0) -> CameraFile:
    """Read a camera from one or several files.

    Args:
        paths: The files; together they have the camera matrix, the rotation and the translation.
        unit_m: Length unit of the translation, metres.

    Raises:
        CalibrationError: A file cannot be read (E406), or something is missing or has the wrong size (E407).
    """
    arrays: dict[str, Array] = {}
    for path in paths:
        arrays |= _oxford(path) or _named(path)
    missing = [what for what in ("lens", "rotation", "translation") if what not in arrays]
    if missing:
        raise _refused(paths[-1], f"there is no {missing[0]}: one of {', '.join(_NAMES[missing[0]])}")
    lens, rotation, translation = arrays["lens"], arrays["rotation"].squeeze(), arrays["translation"].ravel()
    if rotation.shape == (3,):
        import cv2

        rotation = np.asarray(cv2.Rodrigues(rotation)[0], dtype=np.float64)
    if lens.shape != (3, 3) or rotation.shape != (3, 3) or translation.shape != (3,):
        raise _refused(paths[-1], "a camera matrix is 3x3, a rotation 3x3 or 3 numbers, a translation 3 numbers")
    distortion = arrays.get("distortion", np.empty(0)).ravel()
    if not all(np.isfinite(values).all() for values in (lens, rotation, translation, distortion)):
        raise _refused(paths[-1], "a number is not finite")
    return CameraFile(lens, distortion, rotation, translation * unit_m)


def floor_fit(camera: CameraFile, *, picture_px: tuple[int, int]) -> FloorFit:
    """Return the homography from pixels to floor; with distortion, the one that fits the floor in the picture best.

    Args:
        camera: The camera.
        picture_px: Width and height of the picture.

    Raises:
        CalibrationError: The picture shows hardly any floor (E407), or the matrix cannot be inverted (E401 to E404).
    """
    import cv2

    plane = np.column_stack([camera.rotation[:, :2], camera.translation])
    exact = np.asarray(np.linalg.inv(as_matrix(camera.lens @ plane)), dtype=np.float64)
    if not camera.distortion.any():
        return FloorFit(exact, 0.0, 0.0)
    u, v = (np.linspace(0, side, n) for side, n in zip(picture_px, GRID, strict=True))
    uv = np.column_stack([axis.ravel() for axis in np.meshgrid(u, v)])
    straight = cv2.undistortPoints(uv[:, None], camera.lens, camera.distortion, P=camera.lens)[:, 0]
    xy = to_floor(exact, straight, picture_px=picture_px)
    position = -camera.rotation.T @ camera.translation
    away = np.linalg.norm(xy - position[:2], axis=1)
    near = np.flatnonzero(away < np.nanmin(away) + REACH_M) if np.isfinite(away).any() else np.empty(0, dtype=np.intp)
    if len(near) < GRID[0]:
        raise CalibrationError(
            "the picture shows hardly any floor", code="E407", why="the horizon of the camera is below most of it",
            fix="check that the floor is z = 0 of the file's world, and --unit",
        )  # fmt: skip
    # from floor to picture: a lens is off by so many pixels everywhere, and in metres the far floor would decide alone
    to_picture = fit_homography(np.column_stack([xy[near], uv[near]])).homography
    homography = np.asarray(np.linalg.inv(as_matrix(to_picture)), dtype=np.float64)
    off = np.linalg.norm(to_floor(homography, uv[near], picture_px=picture_px) - xy[near], axis=1)
    return FloorFit(homography, float(np.sqrt(np.mean(off**2))), float(off.max()))


def _oxford(path: Path) -> dict[str, Array]:
    """Return a camera of lines `Name = number`; empty for another format."""
    values = dict(re.findall(r"^(\w+)\s*=\s*([-+.\deE]+)\s*$", calibration_text(path), flags=re.MULTILINE))
    if "FocalLengthX" not in values:
        return {}
    try:
        n = {name: float(value) for name, value in values.items()}
        x, y, z, w = (n[f"Rotation{axis}"] for axis in "XYZW")
        lens = [
            (n["FocalLengthX"], n.get("Skew", 0.0), n["PrincipalPointX"]),
            (0, n["FocalLengthY"], n["PrincipalPointY"]),
            (0, 0, 1),
        ]
        translation = [n[f"Translation{axis}"] for axis in "XYZ"]
    except (KeyError, ValueError) as error:
        raise _refused(path, f"it lacks {error}") from None
    turn = np.array([
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    ])  # fmt: skip
    distortion = [n.get(f"Distortion{name}", 0.0) for name in ("K1", "K2", "P1", "P2")]
    return {
        "lens": np.array(lens),
        "rotation": turn,
        "translation": np.array(translation),
        "distortion": np.array(distortion),
    }


def _named(path: Path) -> dict[str, Array]:
    """Return what a file of OpenCV's `FileStorage` or of JSON has, by our names."""
    text, read = calibration_text(path), {}
    if path.suffix.lower() == ".json":
        try:
            content = json.loads(text)
        except ValueError as error:
            raise _refused(path, f"it is no JSON: {error}") from None
        read = {name: content[name] for names in _NAMES.values() for name in names if name in dict(content)}
    else:
        import cv2

        try:
            storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
            read = {name: _node(storage.getNode(name)) for names in _NAMES.values() for name in names}
        except (cv2.error, SystemError):
            raise _refused(path, "OpenCV cannot read it: it begins neither with <?xml nor with %YAML") from None
    try:
        return {
            what: np.asarray(read[name], dtype=np.float64)
            for what, names in _NAMES.items()
            for name in names
            if read.get(name) is not None
        }
    except (TypeError, ValueError):
        raise _refused(path, "a matrix holds something that is no number") from None


def _node(node: Any) -> Array | None:
    if node.empty():
        return None
    matrix = node.mat() if node.isMap() else None
    if matrix is not None:
        return np.asarray(matrix)
    return np.array([node.at(i).real() for i in range(node.size())]) if node.isSeq() else None


def _refused(path: Path, why: str) -> CalibrationError:
    return CalibrationError(
        f"{path.name} does not describe a camera",
        code="E407",
        where=Where(str(path)),
        why=why,
        fix="give camera matrix, rotation and translation, in one file or in several: --camera-file A --camera-file B",
    )
