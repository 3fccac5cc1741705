"""What the error that calibrations state does to the share of time in violation (beside M26)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Final

import numpy as np

from vsd_analytics.site.model import Calibration
from vsd_analytics.warehouse.warehouse import Warehouse

Z_95: Final = 1.96
PROBE_M: Final = 2.0
"""Distance whose sd the map of a calibration from people states."""


@dataclass(frozen=True, slots=True)
class CalibrationRange:
    """The share of time in violation if all distances of a camera are off by what its calibration states, both ways.

    Attributes:
        error: Relative sd of the legal distance, by camera.
        lo: Share if distances are too short by 1.96 sd: some counted pairs were farther apart.
        hi: Share if distances are too long by 1.96 sd; None where distances are not stored that far.
    """

    error: dict[str, float]
    lo: float
    hi: float | None


def calibration_range(
    warehouse: Warehouse,
    *,
    cameras: Sequence[str],
    exposure_h: float,
    threshold_mm: int,
    known_mm: int,
    first: date,
    last: date,
) -> CalibrationRange | None:
    """Return the range, with the error of a calibration taken as one factor on all distances of its camera.

    The error of a camera is that where its time in violation was: for a calibration from people the root mean square of
    its map's sd of 2 m, weighted by person-time in violation; for one from points that of a position times the square
    root of two. A shift by the same share is the worst that an error of this size does; foot points, which scatter
    from record to record, do less.

    Args:
        warehouse: Its days.
        cameras: That count.
        exposure_h: Their person-hours in view.
        threshold_mm: The legal distance.
        known_mm: Distances are stored up to here.
        first: First local day.
        last: Last local day.

    Returns:
        None where a camera's calibration states no error, or nobody was seen.
    """
    used = {c.camera_id: c.calibrations[-1] for c in warehouse.site.cameras if c.calibrations}
    if exposure_h <= 0 or not all(camera in used for camera in cameras):
        return None
    days = {"cameras": list(cameras), "first": first, "last": last}
    cells = warehouse.rows(_CELLS, days) if any(used[camera].error_cells for camera in cameras) else []
    error: dict[str, float] = {}
    for camera in cameras:
        at = [(row["x"], row["y"], row["violation_s"]) for row in cells if row["camera_id"] == camera]
        stated = _relative_sd(used[camera], at, distance_m=threshold_mm / 1000)
        if stated is None:
            return None
        error[camera] = stated
    lo_s = hi_s = 0.0
    is_known = True
    for row in warehouse.rows(_NEAREST, days):
        off = Z_95 * error[row["camera_id"]]
        # a distance measured at m was m / (1 - off) or m / (1 + off) in truth, so the limit moves by the same factor
        lo_s += row["nearest_s"] if row["distance_mm"] < threshold_mm * max(0.0, 1 - off) else 0.0
        hi_s += row["nearest_s"] if row["distance_mm"] < threshold_mm * (1 + off) else 0.0
        is_known &= threshold_mm * (1 + off) <= known_mm
    return CalibrationRange(error, lo_s / 3600 / exposure_h, hi_s / 3600 / exposure_h if is_known else None)


def _relative_sd(
    used: Calibration, violation_cells: Sequence[tuple[int, int, float]], *, distance_m: float
) -> float | None:
    if not used.error_cells:
        return None if used.error_m is None else used.error_m * math.sqrt(2) / distance_m
    stated = {(math.floor(x), math.floor(y)): sd for x, y, sd in used.error_cells}
    known = [(stated[x, y], weight) for x, y, weight in violation_cells if (x, y) in stated and weight > 0]
    if not known:
        return None
    sd, weight = np.array(known).T
    return float(np.sqrt(np.average(np.square(sd), weights=weight))) / PROBE_M


_CELLS = """
select
    camera_id,
    floor(cx / 2)::integer as x,
    floor(cy / 2)::integer as y,
    sum(violation_s)::double as violation_s
from cell_days
where list_contains($cameras, camera_id) and local_date between $first and $last
group by all
order by all
"""
_NEAREST = """
select camera_id, distance_mm::bigint as distance_mm, sum(nearest_s)::double as nearest_s
from distances
where list_contains($cameras, camera_id) and local_date between $first and $last
group by camera_id, distance_mm
order by camera_id, distance_mm
"""
