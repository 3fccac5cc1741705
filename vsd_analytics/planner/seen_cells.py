"""Which cells of the page's grid each camera sees, so that floor nobody recorded is never drawn as quiet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from vsd_analytics.figures.week.model_map import Extent
from vsd_analytics.geometry.camera_views import view_polygon
from vsd_analytics.planner.cell_counts import FINE_M, SQUARE_M, CellGrid
from vsd_analytics.site.model import Camera


def seen_cells(cameras: Sequence[Camera], *, extent: Extent, grid: CellGrid) -> NDArray[np.bool_] | None:
    """Return the fine cells whose middle lies in each camera's view, shape (n_cameras, n_y, n_x).

    Args:
        cameras: The floor's cameras.
        extent: The floor shown, in metres.
        grid: Squares that cover it.

    Returns:
        None when what some camera sees is unknown.
    """
    fine = round(SQUARE_M / FINE_M)
    x = grid.x0 + (np.arange(grid.n_x * fine) + 0.5) * FINE_M
    y = grid.y0 + (np.arange(grid.n_y * fine) + 0.5) * FINE_M
    at = np.meshgrid(x, y)
    seen = []
    for camera in cameras:
        calibration = camera.calibrations[-1] if camera.calibrations else None
        view = view_polygon(camera, calibration=calibration, bounds=extent)
        if view is None:
            return None
        seen.append(shapely.contains_xy(view, *at))
    return np.stack(seen) if seen else None
