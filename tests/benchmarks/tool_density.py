"""PedPy's classic density profile beside the same map from arrays: one camera and hour, as PedPy works by frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from tool_heatmaps import CELL_MM, files

LOW_M, HIGH_M = -1.0, 24.0
"""What one camera of the made-up site sees, with a metre to spare."""
_CELLS: Final = round((HIGH_M - LOW_M) * 1000 / CELL_MM)


def camera_hour(root: Path) -> Any:
    """Return the person records of the first camera in the first hour: frame, x and y in metres."""
    import pandas as pd

    rows = pd.read_parquet(files(root)[0], columns=["camera_id", "ts", "person", "x_mm", "y_mm"], partitioning=None)
    rows = rows[rows["camera_id"] == "cam-00"]
    frame = rows["ts"].astype("int64") // 1000
    return pd.DataFrame({"id": rows["person"], "frame": frame, "x": rows["x_mm"] / 1000, "y": rows["y_mm"] / 1000})


def pedpy_map(people: Any) -> NDArray[np.int64]:
    """Return person records by row from the top and column, with PedPy."""
    import pedpy

    area = pedpy.WalkableArea([(LOW_M, LOW_M), (HIGH_M, LOW_M), (HIGH_M, HIGH_M), (LOW_M, HIGH_M)])
    side_m = CELL_MM / 1000
    profiles = pedpy.compute_density_profile(
        data=people, walkable_area=area, grid_size=side_m, density_method=pedpy.DensityMethod.CLASSIC
    )
    counts: NDArray[np.int64] = np.rint(sum(profiles) * side_m**2).astype(np.int64)
    return counts


def counted_map(people: Any) -> NDArray[np.int64]:
    """Return the same counts, from whole millimetres."""
    column, row = (
        (np.rint(people[c].to_numpy() * 1000).astype(np.int64) - round(LOW_M * 1000)) // CELL_MM for c in ("x", "y")
    )
    found = np.bincount(row * _CELLS + column, minlength=_CELLS**2).reshape(_CELLS, _CELLS)
    return found[::-1]
