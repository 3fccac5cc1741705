"""Making a calibration: the matrix file, its entry in the camera's history, its error and a picture to check it by."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from vsd_analytics.errors import CalibrationError, UsageError
from vsd_analytics.geometry.calibration_files import PointPair, load_calibration, read_matrix, read_points
from vsd_analytics.geometry.calibration_picture import draw_overlay
from vsd_analytics.geometry.stated_errors import ENOUGH_POINTS, beside, position_error_m
from vsd_analytics.site.cameras_by_name import camera_called
from vsd_analytics.site.model import Calibration, Camera, Site

FOLDER = "calibration"
WORST_M = 0.30
"""A point off by more than this deserves a second look."""
MIN_POINTS = 4


@dataclass(frozen=True, slots=True)
class Calibrated:
    """What `calibrate` did.

    Attributes:
        camera_id: The camera.
        file: The matrix file, relative to the project folder where it lies below it.
        overlay: The picture with the floor grid, relative to the project folder.
        calibration_id: Id of the matrix.
        n_points: Number of points; 0 for a given matrix.
        error_m: Root mean square distance on the floor between points and where they are mapped; None for a matrix.
        worst_m: The largest of these distances.
        worst_point: Its 1-based number in the file.
        is_in_force: Whether the project now uses it; if not, `warnings` says what to write into vsd.toml.
        warnings: (code, sentence) of what deserves a second look.
    """

    camera_id: str
    file: Path
    overlay: Path
    calibration_id: str
    n_points: int
    error_m: float | None
    worst_m: float | None
    worst_point: int | None
    is_in_force: bool
    warnings: tuple[tuple[str, str], ...]


def calibrate(
    site: Site,
    *,
    camera_id: str,
    matrix: Path | None = None,
    points: Path | None = None,
    valid_from: datetime | None = None,
) -> Calibrated:
    """Put a calibration into force, or look again at the one that is.

    Writes `calibration/<camera>.txt` (`calibration/<camera>-<UTC instant>.txt` with `valid_from`), its entry in
    `calibration/<camera>.toml`, and `calibration/<camera>-overlay.png`.

    Args:
        site: The site.
        camera_id: One of its cameras.
        matrix: 3x3 matrix file, pixels to metres.
        points: CSV of u, v, x, y. With neither, the latest calibration of the camera is checked.
        valid_from: Instant from which it holds; None = since ever.

    Raises:
        UsageError: No such camera, or nothing to calibrate from (E101).
        CalibrationError: The file cannot be used (E401 to E406).
    """
    camera = camera_called(site, camera_id)
    same = next((c for c in camera.calibrations if c.valid_from == valid_from), None)
    given = matrix or points
    if given is None:
        stored, needed = _latest(camera), None
        pairs = _pairs(stored.source)
    else:
        pairs = () if given == matrix else read_points(given)
        calibration = load_calibration(given, kind="points" if pairs else "homography", valid_from=valid_from)
        is_same_file = same is not None and same.source is not None and same.source.resolve() == given.resolve()
        stored, needed = (same, None) if same and is_same_file else _store(site, camera, calibration, replaced=same)
        if pairs and calibration.error_m is not None and stored.source is not None:
            error_m = position_error_m(calibration.error_m, len(pairs))
            state_error(stored.source, calibration_id=stored.calibration_id, error_m=error_m)
    overlay = site.root / FOLDER / f"{camera_id}-overlay.png"
    _publish(overlay, draw_overlay(camera, homography=stored.homography, points=pairs))
    errors = errors_m(stored.homography, pairs)
    worst = max(range(len(errors)), key=errors.__getitem__, default=None)
    is_changed = same is not None and given is not None and same.calibration_id != stored.calibration_id
    return Calibrated(
        camera_id=camera_id,
        file=_relative(stored.source, site),
        overlay=_relative(overlay, site),
        calibration_id=stored.calibration_id,
        n_points=len(pairs),
        error_m=(sum(e * e for e in errors) / len(errors)) ** 0.5 if errors else None,
        worst_m=None if worst is None else errors[worst],
        worst_point=None if worst is None else worst + 1,
        is_in_force=needed is None,
        warnings=tuple(_warnings(errors, replaced=same if is_changed else None, needed=needed)),
    )


def errors_m(homography: Sequence[Sequence[float]], points: Sequence[PointPair]) -> list[float]:
    """Return, per point, the distance in metres between (x, y) and where (u, v) is mapped."""
    import numpy as np

    from vsd_analytics.geometry.homography import to_floor

    if not points:
        return []
    pairs = np.asarray(points)
    off = to_floor(homography, pairs[:, :2]) - pairs[:, 2:]
    return [float(e) for e in np.hypot(off[:, 0], off[:, 1])]


def _latest(camera: Camera) -> Calibration:
    if camera.calibrations:
        return camera.calibrations[-1]
    raise UsageError(
        f"camera {camera.camera_id!r} has no calibration yet",
        why="it takes at least four spots known both in the picture (u,v, pixels) and on the floor (x,y, metres)",
        fix=f"vsd calibrate {camera.camera_id} --points points.csv   (first line u,v,x,y), or --matrix FILE",
    )


def _pairs(path: Path | None) -> tuple[PointPair, ...]:
    """Return the points of a calibration file, () when it holds a matrix."""
    if path is None:
        return ()
    try:
        read_matrix(path)
    except CalibrationError:
        return read_points(path)
    return ()


def _store(
    site: Site, camera: Camera, fitted: Calibration, *, replaced: Calibration | None
) -> tuple[Calibration, str | None]:
    """Write the matrix and its history entry; return it as read back, and the line vsd.toml needs, if any."""
    import numpy as np

    stamp = "" if fitted.valid_from is None else f"-{fitted.valid_from.astimezone(UTC):%Y%m%dT%H%M%SZ}"
    target = site.root / FOLDER / f"{camera.camera_id}{stamp}.txt"
    text = io.StringIO()
    np.savetxt(text, np.asarray(fitted.homography), fmt="%.12g")
    _publish(target, text.getvalue().encode())
    stored = load_calibration(target, kind="homography", valid_from=fitted.valid_from)
    line = f'homography = "{_relative(target, site).as_posix()}"'
    if replaced is None:
        history = site.root / FOLDER / f"{camera.camera_id}.toml"
        before = history.read_text(encoding="utf-8") if history.exists() else ""
        since = "" if fitted.valid_from is None else f"from = {fitted.valid_from.astimezone(UTC).isoformat()}\n"
        gap = "\n" if before.strip() else ""
        _publish(history, f"{before}{gap}[[calibration]]\n{line}\n{since}".encode())
        return stored, None
    is_named = replaced.source is not None and replaced.source.resolve() == target.resolve()
    return stored, None if is_named else line


def state_error(matrix: Path, *, calibration_id: str, error_m: float | None) -> None:
    """Write the error of a position beside a matrix, where it is known and not 0."""
    import json

    if error_m:
        content = {"calibration_id": calibration_id, "error_m": round(error_m, 4)}
        _publish(beside(matrix, "points"), json.dumps(content).encode() + b"\n")


def _warnings(errors: Sequence[float], *, replaced: Calibration | None, needed: str | None) -> list[tuple[str, str]]:
    warnings = []
    if errors and len(errors) < ENOUGH_POINTS:
        reason = "four always fit, so nothing is checked" if len(errors) == MIN_POINTS else "so few hide their errors"
        warnings.append(("W401", f"{len(errors)} points: {reason}; measure {ENOUGH_POINTS} or more"))
    if errors and max(errors) > WORST_M:
        worst, off_cm = max(range(len(errors)), key=errors.__getitem__) + 1, max(errors) * 100
        warnings.append(("W402", f"point {worst} is off by {off_cm:.0f} cm: check it in the picture and on the floor"))
    if needed is not None:
        source = replaced.source.name if replaced is not None and replaced.source is not None else "another file"
        warnings.append(("W403", f"not in force yet: the project names {source}; write instead: {needed}"))
    elif replaced is not None:
        warnings.append(
            ("W404", "the calibration before is gone, also for old records; was the camera moved? use --from")
        )
    return warnings


def _publish(path: Path, data: bytes) -> None:
    from vsd_analytics.store.durable import publish

    publish(path, data)


def _relative(path: Path | None, site: Site) -> Path:
    path = path or site.root
    return path.relative_to(site.root) if path.is_relative_to(site.root) else path
