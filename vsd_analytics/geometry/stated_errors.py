"""What a calibration states about its own error, in a JSON file beside its matrix.

`cam-1-from-people.json` lies beside `cam-1.txt` and has a map: how uncertain a distance of 2 m is, cell by cell of 1 m.
`cam-1-from-points.json` has one number: how far off a position is, by points or by what a lens distortion leaves. Each
names the matrix that it belongs to.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, Final, Literal

ErrorCells = tuple[tuple[float, float, float], ...]
"""x and y of the middle of a floor cell of 1 m, and the sd of a distance of 2 m there, metres."""
Source = Literal["people", "points"]

FREE_POINTS: Final = 4
"""Four points always fit."""
ENOUGH_POINTS: Final = 6
"""With fewer, the residuals say too little about the error."""


def beside(matrix: Path, source: Source) -> Path:
    """Return where the stated error of a matrix file is."""
    return matrix.with_name(f"{matrix.stem}-from-{source}.json")


def position_error_m(rmse_m: float, n_points: int) -> float | None:
    """Return the error of a position from the residuals of points, metres: eight numbers were fitted to two each.

    None with fewer than six points.
    """
    if n_points < ENOUGH_POINTS:
        return None
    return rmse_m * math.sqrt(n_points / (n_points - FREE_POINTS))


def read_content(path: Path, *, calibration_id: str) -> dict[str, Any]:
    """Return the content of a stated error; empty where there is none that belongs to a matrix."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) and content.get("calibration_id") == calibration_id else {}


def read_stated(matrix: Path, *, calibration_id: str) -> tuple[float | None, ErrorCells]:
    """Return the error of a position that a matrix file's calibration states and its map; None and () without."""
    points = read_content(beside(matrix, "points"), calibration_id=calibration_id).get("error_m")
    error_m = float(points) if isinstance(points, int | float) and math.isfinite(points) and points >= 0 else None
    people = read_content(beside(matrix, "people"), calibration_id=calibration_id)
    try:
        cells = tuple((float(x), float(y), float(sd)) for x, y, sd, *_ in people["map"])
    except (KeyError, TypeError, ValueError):
        return error_m, ()
    return error_m, cells if all(math.isfinite(value) for cell in cells for value in cell) else ()
