"""Person-time by hour in squares of a floor, from the square metres of each camera that the weekly map sums up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import shapely

from vsd_analytics.figures.panels import Array, FloorHours, Ints, positions
from vsd_analytics.figures.share.squares import SquareTimes
from vsd_analytics.figures.week.model_map import Extent

SIDE_M: Final = 2
"""Side of a square: of smaller ones, too few have five people in an hour."""


@dataclass(frozen=True, slots=True)
class SquareGrid:
    """Squares of `SIDE_M` that cover a floor, by row from the lower left one.

    Attributes:
        x0, y0: Column and row of the lower left square, from the floor's origin.
        n_x, n_y: Squares across and up.
    """

    x0: int
    y0: int
    n_x: int
    n_y: int

    @property
    def n_squares(self) -> int:
        """Return the number of squares."""
        return self.n_x * self.n_y

    def boxes(self) -> Any:
        """Return the squares as polygons in floor metres, shape (n_squares,)."""
        y, x = (v.ravel() for v in np.mgrid[: self.n_y, : self.n_x])
        left, low = (x + self.x0) * SIDE_M, (y + self.y0) * SIDE_M
        return shapely.box(left, low, left + SIDE_M, low + SIDE_M)


def square_grid(extent: Extent) -> SquareGrid:
    """Return the squares that cover the floor shown."""
    x0, y0, x1, y1 = (v / SIDE_M for v in extent)
    left, low = math.floor(x0), math.floor(y0)
    return SquareGrid(left, low, math.ceil(x1) - left, math.ceil(y1) - low)


def square_times(
    data: FloorHours,
    slots: Ints,
    *,
    grid: SquareGrid,
    extent: Extent,
    areas: Sequence[Any],
    recorded_h: Array,
) -> SquareTimes:
    """Return the person-time of square metres by camera and hour; of hours without recorded time, nothing.

    Args:
        data: The floor.
        slots: Positions of the hours in the floor's, rising, shape (n_hours,).
        grid: The squares.
        extent: The floor shown; what lies outside is left out.
        areas: Polygons that readers know sums of, the first where two overlap; None is the rest of the floor.
        recorded_h: Recorded time of each hour, hours, shape (n_hours,).
    """
    start_ms = data.hours.start_ms[slots]
    rows = data.warehouse.table(
        "select camera_id, hour_start_ms, cx // 2 as x, cy // 2 as y, sum(exposure_ms)::bigint as time_ms, "
        "sum(violation_ms)::bigint as close_ms, max(n_tracks)::bigint as n_people from planner_cells "
        "where floor_id = $floor and hour_start_ms between $from and $to and exposure_ms > 0 "
        "and cx >= 2 * $x0 and cx < 2 * $x1 and cy >= 2 * $y0 and cy < 2 * $y1 group by all order by all",
        {
            "floor": data.floor.floor_id,
            "from": int(start_ms.min(initial=2**53)),
            "to": int(start_ms.max(initial=0)),
            **dict(zip(("x0", "y0", "x1", "y1"), extent, strict=True)),
        },
    )
    camera = positions(rows["camera_id"], data.ids, otherwise=-1)
    hour_ms, x, y, *values = (
        rows[name].to_numpy() for name in ("hour_start_ms", "x", "y", "time_ms", "close_ms", "n_people")
    )
    slot = np.minimum(np.searchsorted(start_ms, hour_ms), max(0, len(slots) - 1))
    taken = (start_ms[slot] == hour_ms) & (recorded_h[slot] > 0) if len(slots) else np.zeros(hour_ms.shape, np.bool_)
    camera, slot, x, y, *values = (v[taken] for v in (camera, slot, x, y, *values))
    square = (y // SIDE_M - grid.y0) * grid.n_x + x // SIDE_M - grid.x0
    # one number for each square metre of a camera: to sort rows of four numbers takes many times as long
    places = (square, camera + 1, x - x.min(initial=0), y - y.min(initial=0))
    key = np.ravel_multi_index(places, [int(at.max(initial=0)) + 1 for at in places])
    _, first, unit = np.unique(key, return_index=True, return_inverse=True)
    square_of, x_of, y_of = square[first], x[first], y[first]
    time_ms, close_ms = (np.zeros((len(square_of), len(slots)), dtype=np.int64) for _ in range(2))
    n_people = np.zeros((grid.n_squares, len(slots)), dtype=np.int64)
    time_ms[unit, slot], close_ms[unit, slot] = values[:2]
    np.maximum.at(n_people, (square, slot), values[2])
    area = np.zeros(len(square_of), dtype=np.int64)
    for k, polygon in reversed(list(enumerate(areas, 1))):
        if polygon is not None:
            area[shapely.contains_xy(shapely.Polygon(polygon), x_of + 0.5, y_of + 0.5)] = k
    return SquareTimes(
        time_ms=time_ms,
        close_ms=close_ms,
        square=square_of,
        area=area,
        n_people=n_people,
        recorded_h=recorded_h,
        hour_of_day=data.hours.hour[slots],
    )
