"""Calibration files: a 3x3 matrix as text, or pairs of picture and floor points as CSV.

Reading them is here; making them, with a picture that shows how good they are, is in `vsd_analytics.config.calibrate`.
"""

from __future__ import annotations

import csv
import hashlib
import math
import struct
from datetime import datetime
from pathlib import Path

from vsd_analytics.errors import CalibrationError, Where
from vsd_analytics.geometry.stated_errors import ErrorCells, read_stated
from vsd_analytics.site.model import Calibration

Matrix = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
PointPair = tuple[float, float, float, float]
"""(u, v, x, y): picture pixels and floor metres of the same spot."""

POINT_COLUMNS = ("u", "v", "x", "y")
SINGULAR = 1e-12


def calibration_id(matrix: Matrix) -> str:
    """Return 8 hexadecimal digits of the BLAKE2 hash of the nine numbers, row by row as little-endian doubles."""
    numbers = [value for row in matrix for value in row]
    return hashlib.blake2b(struct.pack("<9d", *numbers), digest_size=4).hexdigest()


def read_matrix(path: Path) -> Matrix:
    """Read a homography from picture pixels to floor metres.

    Args:
        path: Text with nine numbers in three rows, separated by blanks or commas; lines after # are comments.

    Raises:
        CalibrationError: Not nine finite numbers in three rows (E403), or a matrix that cannot be inverted (E404).
    """
    rows: list[list[float]] = []
    for number, line in enumerate(calibration_text(path).splitlines(), start=1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            row = []
        if len(row) != 3 or not all(math.isfinite(value) for value in row):
            raise CalibrationError(
                f"{path.name} is not a 3x3 matrix",
                code="E403",
                where=Where(str(path), number, line.strip()[:200]),
                why="each row needs three numbers",
                fix=_MATRIX_FIX,
            )
        rows.append(row)
    if len(rows) != 3:
        raise CalibrationError(
            f"{path.name} is not a 3x3 matrix",
            code="E403",
            where=Where(str(path)),
            why=f"it has {len(rows)} rows of numbers instead of 3",
            fix=_MATRIX_FIX,
        )
    matrix = (
        (rows[0][0], rows[0][1], rows[0][2]),
        (rows[1][0], rows[1][1], rows[1][2]),
        (rows[2][0], rows[2][1], rows[2][2]),
    )
    if not is_invertible(matrix):
        raise CalibrationError(
            f"the matrix in {path.name} cannot be inverted",
            code="E404",
            where=Where(str(path)),
            why="it maps the whole picture to one line or point of the floor",
            fix="export the 3x3 matrix from picture pixels to floor metres again, or use points = ...",
        )
    return matrix


_MATRIX_FIX = "write three rows of three numbers: the homography from picture pixels to floor metres"


def is_invertible(matrix: Matrix) -> bool:
    """Tell whether |det| exceeds `SINGULAR` after every row, then every column, is scaled to length 1.

    The scaling makes the answer independent of the units of picture and floor.
    """
    columns = [list(column) for column in zip(*[_unit(list(row)) for row in matrix], strict=True)]
    (a, d, g), (b, e, h), (c, f, i) = (_unit(column) for column in columns)
    return abs(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)) > SINGULAR


def _unit(values: list[float]) -> list[float]:
    length = math.hypot(*values)
    return [v / length for v in values] if 0 < length < math.inf else [0.0] * len(values)


def read_points(path: Path) -> tuple[PointPair, ...]:
    """Read pairs of picture and floor points.

    Args:
        path: CSV with the columns u, v (picture pixels), x, y (floor metres) in any order, others are ignored;
            without a header the first four columns are u, v, x, y.

    Raises:
        CalibrationError: A column is missing, a value is not a finite number, or a line is no CSV (E405).
    """
    lines = [
        line
        for line in enumerate(calibration_text(path).splitlines(), start=1)
        if line[1].strip() and not line[1].lstrip().startswith("#")
    ]
    rows: list[list[str]] = []
    try:
        rows += csv.reader(line for _, line in lines)
    except csv.Error as error:
        number, line = lines[len(rows)]
        raise CalibrationError(
            f"{path.name} cannot be read as a table of points",
            code="E405",
            where=Where(str(path), number, line[:200]),
            why=str(error),
            fix="write u,v,x,y as plain numbers, such as 512,633.5,4.20,7.15",
        ) from None
    order = list(range(4))
    if rows and not _numbers(rows[0], order):
        header = [name.strip().lower() for name in rows[0]]
        missing = [name for name in POINT_COLUMNS if name not in header]
        if missing:
            raise CalibrationError(
                f"{path.name} has no column {', '.join(missing)}",
                code="E405",
                where=Where(str(path), lines[0][0], lines[0][1][:200]),
                fix="the first line must be u,v,x,y: picture pixels right and down, floor metres right and up",
            )
        order = [header.index(name) for name in POINT_COLUMNS]
        lines, rows = lines[1:], rows[1:]
    points = []
    for (number, line), row in zip(lines, rows, strict=False):
        values = _numbers(row, order)
        if values is None:
            raise CalibrationError(
                f"{path.name} has a point that is not four numbers",
                code="E405",
                where=Where(str(path), number, line[:200]),
                fix="write u,v,x,y as plain numbers, such as 512,633.5,4.20,7.15",
            )
        points.append(values)
    return tuple(points)


def _numbers(row: list[str], order: list[int]) -> PointPair | None:
    try:
        u, v, x, y = (float(row[position]) for position in order)
    except (ValueError, IndexError):
        return None
    return (u, v, x, y) if all(math.isfinite(value) for value in (u, v, x, y)) else None


def calibration_text(path: Path) -> str:
    """Return the text of a file; CalibrationError E406 when it cannot be read."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        fix = "check the path; it must be a plain text file"
        raise CalibrationError(f"cannot read {path}", code="E406", where=Where(str(path)), why=why, fix=fix) from None


def load_calibration(path: Path, *, kind: str, valid_from: datetime | None) -> Calibration:
    """Read one calibration.

    Args:
        path: The file.
        kind: "homography" (matrix) or "points" (CSV).
        valid_from: UTC instant from which it is valid; None = always.

    Raises:
        CalibrationError: The file cannot be used (E401 to E406).
    """
    if kind == "points":
        from vsd_analytics.geometry.homography import fit_homography

        fit = fit_homography(read_points(path))
        return Calibration(fit.homography, valid_from, calibration_id(fit.homography), fit.rmse_m, path)
    matrix = read_matrix(path)
    name = calibration_id(matrix)
    return Calibration(matrix, valid_from, name, *_stated(path, name))


def _stated(path: Path, name: str) -> tuple[float | None, Path, ErrorCells]:
    error_m, cells = read_stated(path, calibration_id=name)
    return error_m, path, cells
