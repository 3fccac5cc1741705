"""Where some cells of a floor are: their middle, outline, and the area of vsd.toml they lie in or near."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from vsd_analytics.figures.floor_days import Flags, Floats, Grid
from vsd_analytics.site.model import Area

Ring = tuple[tuple[float, float], ...]
Polygon = tuple[Ring, ...]
"""Outer ring counter-clockwise, then holes clockwise; floor metres, each corner once."""


@dataclass(frozen=True, slots=True)
class CellPlace:
    """Some cells of a floor.

    Attributes:
        x_m, y_m: Mean of their middles, by weight, floor metres.
        peak_x_m, peak_y_m: Middle of the cell with the greatest weight.
        area_id, area_name: Area of vsd.toml that has most of the weight; None for the rest of the floor.
        nearest_id, nearest_name, nearest_m: The nearest area and how far it is from the middle, when they lie in none.
        polygons: Their outline.
        area_m2: Their size.
    """

    x_m: float
    y_m: float
    peak_x_m: float
    peak_y_m: float
    area_id: str | None
    area_name: str | None
    nearest_id: str | None
    nearest_name: str | None
    nearest_m: float | None
    polygons: tuple[Polygon, ...]
    area_m2: float

    @property
    def name(self) -> str:
        """Return the area's name, or the middle in metres."""
        return self.area_name if self.area_name is not None else f"{self.x_m:.1f}, {self.y_m:.1f} m"


def place_of(grid: Grid, inside: Flags, *, weights: Floats, areas: Sequence[Area]) -> CellPlace:
    """Return where some cells are.

    Args:
        grid: The floor's cells.
        inside: Which, shape of the grid; at least one.
        weights: What counts for the middle and the area, shape of the grid; below 0 counts as 0.
        areas: Areas of the floor; a cell whose middle lies in several belongs to the first.
    """
    rows, columns = np.nonzero(inside)
    weight = np.maximum(weights[inside], 0.0)
    if not weight.sum() > 0:
        weight = np.ones(len(rows))
    x, y = grid.x_m(columns), grid.y_m(rows)
    middle = float(x @ weight / weight.sum()), float(y @ weight / weight.sum())
    shapes = [shapely.Polygon(a.polygon) for a in areas]
    free = np.ones(len(rows), dtype=np.bool_)
    shares = []
    for shape in shapes:
        own = free & shapely.contains_xy(shape, x, y)
        shares.append(float(weight[own].sum()))
        free &= ~own
    best = int(np.argmax(shares)) if shares else -1
    is_in = best >= 0 and shares[best] >= weight[free].sum() and shares[best] > 0
    near = nearest_m = None
    if shapes and not is_in:
        gaps = [float(shape.distance(shapely.Point(middle))) for shape in shapes]
        near, nearest_m = areas[int(np.argmin(gaps))], min(gaps)
    return CellPlace(
        x_m=middle[0],
        y_m=middle[1],
        peak_x_m=float(x[np.argmax(weight)]),
        peak_y_m=float(y[np.argmax(weight)]),
        area_id=areas[best].area_id if is_in else None,
        area_name=areas[best].name if is_in else None,
        nearest_id=None if near is None else near.area_id,
        nearest_name=None if near is None else near.name,
        nearest_m=nearest_m,
        polygons=tuple(map(as_rings, grid.polygons(inside))),
        area_m2=len(rows) * grid.cell_m**2,
    )


def as_rings(shape: shapely.Polygon) -> Polygon:
    """Return the outer ring of a polygon and its holes, each corner once."""
    rings = [shape.exterior, *shape.interiors]
    return tuple(tuple((float(x), float(y)) for x, y in list(ring.coords)[:-1]) for ring in rings)
