"""Calibrations of a camera, and the planes of its picture: keys of `[[camera]]`, and calibration/<camera>.toml."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from vsd_analytics.config.reader import DATE, Form, Mistakes, TableReader
from vsd_analytics.config.toml_lines import read_toml
from vsd_analytics.config.values import BOX_MAX_M2, is_simple, parse_instant
from vsd_analytics.errors import CalibrationError
from vsd_analytics.geometry.calibration_files import load_calibration
from vsd_analytics.site.model import Calibration, Camera, Plane

HISTORY_FOLDER = "calibration"

_KINDS = {"homography": '"calibration/cam-1.txt"', "points": '"calibration/cam-1.csv"'}
_POLYGON_PX = "[[200, 540], [900, 540], [980, 1080], [120, 1080]]"
_SPOT: Form = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
_HEIGHT: Form = {"anyOf": [{"type": "number"}, {"type": "array", "items": _SPOT, "minItems": 3, "maxItems": 3}]}
_HIGHEST_M: Final = 100.0


def read_calibrations(
    table: TableReader, camera_id: str | None, *, timezone: str
) -> tuple[tuple[Calibration, ...], tuple[Plane, ...]]:
    """Return a camera's calibrations by date, from its keys and calibration/<camera>.toml, and that file's planes."""
    in_table = _calibration(table, timezone=timezone, from_key="calibrated_from")
    calibrations = [in_table] if in_table else []
    planes: tuple[Plane, ...] = ()
    history = table.folder / HISTORY_FOLDER / f"{camera_id}.toml"
    if camera_id is not None and history.is_file():
        dated, planes = _history(history, table=table, timezone=timezone)
        calibrations += dated
    calibrations.sort(key=lambda c: (c.valid_from is not None, c.valid_from or datetime.min.replace(tzinfo=UTC)))
    for one, other in pairwise(calibrations):
        if one.valid_from == other.valid_from:
            since = one.valid_from.isoformat() if one.valid_from else "the beginning"
            table.fault(
                next((kind for kind in _KINDS if kind in table.values), "id"),
                f"{table.label} has two calibrations from {since}",
                code="E129",
                why=f"one is {_shown(one, table.folder)}, the other {_shown(other, table.folder)}",
                fix=f"keep one of the two in vsd.toml or calibration/{camera_id}.toml, or give one a later date",
            )
    return tuple(calibrations), planes


def _history(path: Path, *, table: TableReader, timezone: str) -> tuple[list[Calibration], tuple[Plane, ...]]:
    """Return the `[[calibration]]` and `[[plane]]` entries of a camera's own file; mistakes carry that file's lines."""
    name = path.relative_to(table.folder).as_posix()
    text, problem = read_toml(path, name=name)
    if problem is not None:
        table.mistakes.take([problem])
        return [], ()
    apart = Mistakes(text)
    root = TableReader(tomllib.loads(text.text), path=(), label=name, mistakes=apart, folder=table.folder)
    calibrations = []
    for entry in root.each("calibration"):
        if not _KINDS.keys() & entry.values.keys():
            entry.missing("homography", f'"calibration/{path.stem}.txt"')
        calibrations.append(_calibration(entry, timezone=timezone, from_key="from"))
        entry.close()
    entries = root.each("plane")
    planes = [_plane(entry, timezone=timezone) for entry in entries]
    _check_dates(entries, planes)
    root.close()
    table.mistakes.take(apart.all)
    return [calibration for calibration in calibrations if calibration is not None], tuple(
        p for p in planes if p is not None
    )


def _calibration(table: TableReader, *, timezone: str, from_key: str, is_plane: bool = False) -> Calibration | None:
    """Return the calibration a table names by `homography` or `points`, if any."""
    parse = partial(parse_instant, timezone=timezone)
    valid_from = table.parsed(from_key, example="2026-11-01T00:00:00+01:00", parse=parse, form=DATE)
    make = f"take this line out and make it: vsd calibrate {table.values.get('id', 'CAMERA')} --points FILE.csv"
    files = {
        kind: table.file(kind, example=example, fix=None if is_plane else make) for kind, example in _KINDS.items()
    }
    named = table.values.keys() & files.keys()
    if len(named) == 2:
        table.fault("points", f"{table.label} has both homography and points", code="E129", fix="keep one of the two")
        return None
    if not named and "calibrated_from" in table.values:
        what = f"{table.label} has calibrated_from without homography or points"
        table.fault("calibrated_from", what, code="E129", fix="name the calibration, or take this line out")
    for kind, path in files.items():
        if path is not None:
            try:
                return load_calibration(path, kind=kind, valid_from=valid_from)
            except CalibrationError as error:
                _note(table, kind, error)
    return None


def _note(table: TableReader, key: str, error: CalibrationError) -> None:
    """Note what is wrong in a calibration file at the line that names it."""
    line = f"line {error.where.line}: {error.where.text}" if error.where and error.where.line else None
    why = "; ".join(part for part in (error.why, line) if part)
    table.fault(key, f"{table.label}: {error.what}", code=error.code, why=why or None, fix=error.fix)


def _shown(calibration: Calibration, folder: Path) -> str:
    source = calibration.source or folder
    return source.relative_to(folder).as_posix() if source.is_relative_to(folder) else str(source)


# planes -------------------------------------------------------------------------------------------------------------


def _plane(entry: TableReader, *, timezone: str) -> Plane | None:
    """Return a `[[plane]]`, None after noting what is wrong with it."""
    plane_id = entry.id("id", example='"ramp"')
    corners = entry.points("polygon_px", least=3, example=_POLYGON_PX)
    if "polygon_px" not in entry.values:
        entry.missing("polygon_px", _POLYGON_PX, why="pixels; whoever has the feet in it is on this plane")
    if not _KINDS.keys() & entry.values.keys():
        entry.missing("points", '"calibration/ramp.csv"', instead="homography")
    calibration = _calibration(entry, timezone=timezone, from_key="from", is_plane=True)
    height = entry.parsed("height_m", example="0.6", parse=_height, form=_HEIGHT)
    entry.close()
    if corners is None or not is_simple(entry, "polygon_px", corners) or calibration is None or plane_id is None:
        return None
    plane = Plane(plane_id, corners, calibration, height)
    return plane if _is_on_floor(entry, plane) else None


def _height(value: Any) -> tuple[float, float, float]:
    """Return (a, b, c) of a height a + b x + c y from one height, or from three spots [x, y, height]."""
    import numpy as np

    spots = value if isinstance(value, list) else [[0, 0, value], [1, 0, value], [0, 1, value]]
    rows = [spot for spot in spots if isinstance(spot, list) and len(spot) == 3]
    is_number = [type(v) in (int, float) and abs(v) < 1e6 for row in rows for v in row]
    if len(rows) != len(spots) or len(spots) != 3 or not all(is_number):
        raise ValueError("it is neither a height in metres nor three spots [x, y, height]")
    table = np.array(rows, dtype=np.float64)
    if np.abs(table[:, 2]).max() > _HIGHEST_M:
        raise ValueError(f"a height is beyond {_HIGHEST_M:g} metres")
    x, y = table[1:, :2] - table[0, :2]
    if abs(x[0] * y[1] - x[1] * y[0]) < 1e-3 * np.linalg.norm(x) * np.linalg.norm(y) or not (x.any() and y.any()):
        raise ValueError("the three spots lie on a line")
    a, b, c = np.linalg.solve(np.column_stack([np.ones(3), table[:, :2]]), table[:, 2]).tolist()
    return a, b, c


def _is_on_floor(entry: TableReader, plane: Plane) -> bool:
    """Tell whether a plane's whole polygon is below its horizon; note it where it is not."""
    from vsd_analytics.geometry.plane_views import floor_of_plane

    floor = floor_of_plane(plane)
    if floor is not None:
        x0, y0, x1, y1 = floor.bounds
        if (x1 - x0) * (y1 - y0) <= BOX_MAX_M2:
            return True
    entry.fault(
        "polygon_px",
        f"{entry.label} polygon_px reaches the horizon of its homography",
        code="E128",
        why="at the horizon a pixel is any distance, and above it there is no floor",
        fix="draw the polygon around the floor of this plane only; check its points, too",
    )
    return False


def _check_dates(entries: Sequence[TableReader], planes: Sequence[Plane | None]) -> None:
    """Note planes of one id that begin at the same instant: nothing tells which of them holds."""
    seen: set[tuple[str, datetime | None]] = set()
    for entry, plane in zip(entries, planes, strict=True):
        key = None if plane is None else (plane.plane_id, plane.calibration.valid_from)
        if plane is not None and key in seen:
            entry.fault(
                "id",
                f"two planes {plane.plane_id!r} begin at the same instant",
                code="E129",
                why="a plane that was calibrated again has one entry for each time, with different dates",
                fix='give the later one a date, such as from = "2026-11-09T06:30", or another id',
            )
        elif key is not None:
            seen.add(key)


def view_of_planes(table: TableReader, camera: Camera) -> tuple[tuple[float, float], ...] | None:
    """Return the outline of the floor that a camera with planes sees; None and a mistake where it has several parts."""
    from vsd_analytics.geometry.plane_views import planes_in_force, view_with_planes

    latest = camera.calibrations[-1] if camera.calibrations else None
    if latest is not None and camera.picture_px is None:
        return None  # unknown, as for any camera without a picture size
    starts = [p.calibration.valid_from for p in camera.planes if p.calibration.valid_from is not None]
    planes = planes_in_force(camera.planes, max(starts, default=None))
    view = view_with_planes(planes, calibration=latest, picture_px=camera.picture_px)
    if view.geom_type == "Polygon" and not view.is_empty:
        return tuple((round(x, 3), round(y, 3)) for x, y in view.exterior.coords[:-1])
    around = [[round(x, 1), round(y, 1)] for x, y in view.convex_hull.exterior.coords[:-1]]
    table.missing(
        "view",
        str(around),
        why="its planes lie apart on the plan: what it sees has no single outline; the line is around all of it",
    )
    return None
