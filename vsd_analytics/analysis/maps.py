"""Maps of a floor as arrays: how risky each place is (M18)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import ndimage

from vsd_analytics.analysis.floor_days import Floats, FloorDays, Grid
from vsd_analytics.site import Floor
from vsd_analytics.stats.hotspots import TRUNCATE
from vsd_analytics.warehouse.warehouse import Warehouse

CELL_M: Final = 0.5
SIGMA_M: Final = 1.0
MIN_EXPOSURE_H: Final = 0.25


@dataclass(frozen=True, slots=True, eq=False)
class RiskMap:
    """Share of person-time in violation by cell (M18).

    Attributes:
        grid: The cells, of 0.5 m; None where nothing can be shown.
        share: 0 to 1, shape of the grid; NaN where fewer than 0.25 person-hours were spent.
        exposure_h: Person-hours per cell, same shape, not smoothed.
        reason: Why there is no map; None with one.
    """

    grid: Grid | None
    share: Floats | None
    exposure_h: Floats | None
    reason: str | None


def risk_map(warehouse: Warehouse, *, floor: Floor) -> RiskMap:
    """Return smoothed person-time in violation over smoothed person-time, cell by cell, over a warehouse's range.

    Both are sums over the camera-days that take part (`floor_days`), smoothed by the same Gaussian of 1 m; the
    numerator is a part of the denominator everywhere, so the share lies between 0 and 1.
    """
    data = FloorDays(warehouse, floor, cell_m=CELL_M)
    days = slice(0, data.n_days)
    why = data.why_unknown(days) or data.why_no_grid
    if data.grid is None:
        return RiskMap(None, None, None, why or "nothing was recorded in opening hours")
    cube = data.cube(days)
    exposure_h, violation_h = cube.exposure_h.sum(axis=0), cube.violation_h.sum(axis=0)
    near, risky = (
        ndimage.gaussian_filter(values, SIGMA_M / CELL_M, mode="constant", truncate=TRUNCATE)
        for values in (exposure_h, violation_h)
    )
    is_known = (near >= MIN_EXPOSURE_H) & (exposure_h > 0)
    share = np.divide(risky, near, out=np.full(near.shape, np.nan), where=is_known)
    return RiskMap(data.grid, np.minimum(share, 1.0), exposure_h, None)
