"""What the cameras of one floor counted by day and floor cell, as arrays for tests and maps.

A camera-day takes part, with its violations and its person-hours, when the camera recorded at least `min_coverage` of
the day's opening hours and both can be known; otherwise it is missing, which is not zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import shapely
from numpy.typing import ArrayLike, NDArray

from vsd_analytics.answer import Reason
from vsd_analytics.figures.slots import NO_POSITIONS
from vsd_analytics.geometry import camera_views
from vsd_analytics.site.model import Camera, Floor
from vsd_analytics.warehouse.owner_spans import in_force
from vsd_analytics.warehouse.warehouse import Warehouse

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

MART_CELL_M: Final = 0.5
"""Side of the cells of the mart `cell_days`."""
CELLS_MAX: Final = 250_000
"""Larger floors are not computed: a position far off would fill the memory."""
OWNER_SHARE: Final = 0.1
"""A cell needs the cameras that count at least this share of its person-hours."""

NO_IDS: Final = Reason("engine.no_ids")
NO_FLOOR: Final = Reason("engine.no_floor")


@dataclass(frozen=True, slots=True)
class Grid:
    """Square cells of a floor.

    Attributes:
        cell_m: Side.
        cx, cy: floor(x / cell_m), floor(y / cell_m) of the first column and row.
        shape: Rows (y) and columns (x).
    """

    cell_m: float
    cx: int
    cy: int
    shape: tuple[int, int]

    def x_m(self, column: ArrayLike) -> Floats:
        """Return the floor x of the middles of columns; a fraction lies between two."""
        return (self.cx + np.asarray(column, dtype=np.float64) + 0.5) * self.cell_m

    def y_m(self, row: ArrayLike) -> Floats:
        """Return the floor y of the middles of rows."""
        return (self.cy + np.asarray(row, dtype=np.float64) + 0.5) * self.cell_m

    def polygons(self, inside: Flags) -> tuple[shapely.Polygon, ...]:
        """Return the union of some cells as polygons in floor metres, outer rings counter-clockwise."""
        rows, columns = np.nonzero(inside)
        x, y = (self.cx + columns) * self.cell_m, (self.cy + rows) * self.cell_m
        whole = shapely.union_all(shapely.box(x, y, x + self.cell_m, y + self.cell_m))
        parts = shapely.get_parts(shapely.simplify(whole, 0).normalize())
        return tuple(shapely.orient_polygons(part) for part in parts)


@dataclass(frozen=True, slots=True, eq=False)
class Cube:
    """Some days of a floor; arrays have the shape (n_days, n_rows, n_columns).

    Attributes:
        n: Violations.
        exposure_h: Person-hours.
        violation_h: Person-hours in violation.
        is_recorded: Every camera that counts in the cell recorded that day.
    """

    n: Floats
    exposure_h: Floats
    violation_h: Floats
    is_recorded: Flags


class FloorDays:
    """The days of a warehouse's range on one floor.

    Args:
        warehouse: Its range is read.
        floor: The floor.
        cell_m: Side of the cells, a multiple of 0.5 m.

    Attributes:
        zone: Of the days.
        cameras: The floor's cameras.
        grid: The cells; None when nobody was seen, or the floor is too large.
        why_no_grid: Why the floor is too large; None otherwise.
        is_open: Days with opening hours, shape (n_days,).
        is_used: Camera-days that take part, shape (n_cameras, n_days).
        unknown: Why the violations or person-hours of a camera-day cannot be known, by camera index and day index.
    """

    def __init__(self, warehouse: Warehouse, floor: Floor, *, cell_m: float = 1.0) -> None:
        self._warehouse, self.floor, self.zone = warehouse, floor, warehouse.site.zone
        self.first, self.n_days = warehouse.first, (warehouse.last - warehouse.first).days + 1
        self.cameras: Sequence[Camera] = [c for c in warehouse.site.cameras if c.floor_id == floor.floor_id]
        self._places = {c.camera_id: k for k, c in enumerate(self.cameras)}
        self._ids = pa.array([c.camera_id for c in self.cameras], pa.string())
        self.unknown: dict[tuple[int, int], Reason] = {}
        self._seen: dict[tuple[bytes | float, ...], Floats] = {}
        self.is_open, self.is_used = self._camera_days()
        self.why_no_grid: Reason | None = None
        self._rows = self._cells(round(cell_m / MART_CELL_M))
        self.grid = self._grid(cell_m)

    def index(self, day: date) -> int:
        """Return the index of a day; below 0 or beyond the last where it is not loaded."""
        return (day - self.first).days

    def day(self, index: int) -> date:
        """Return the day of an index."""
        return self.first + timedelta(days=index)

    def camera_index(self, camera_id: str) -> int:
        """Return the place of a camera in `cameras`."""
        return self._places[camera_id]

    def span(self, first: date, last: date) -> slice:
        """Return the loaded days from `first` to `last` as a slice."""
        return slice(max(0, self.index(first)), max(0, min(self.n_days, self.index(last) + 1)))

    def why_unknown(self, days: slice) -> Reason | None:
        """Return why nothing can be counted in some days, or None if a camera-day takes part or none was recorded."""
        if self.is_used[:, days].any():
            return None
        return next((why for (_, d), why in sorted(self.unknown.items()) if days.start <= d < days.stop), None)

    def cube(self, days: slice) -> Cube:
        """Return the arrays of some days."""
        assert self.grid is not None
        camera, day, row, column, *values = self._rows
        used = (day >= days.start) & (day < days.stop) & self.is_used[camera, day]
        shape = (days.stop - days.start, *self.grid.shape)
        at = (day[used] - days.start, row[used] - self.grid.cy, column[used] - self.grid.cx)
        inside = (at[1] >= 0) & (at[2] >= 0) & (at[1] < shape[1]) & (at[2] < shape[2])
        at = (at[0][inside], at[1][inside], at[2][inside])
        totals = [np.zeros(shape) for _ in values]
        for total, value in zip(totals, values, strict=True):
            add_at(total, at, value[used][inside])
        recorded = np.repeat(self.is_used[:, days].any(axis=0), shape[1] * shape[2]).reshape(shape)
        by_camera = np.zeros((len(self.cameras), *self.grid.shape))
        add_at(by_camera, (camera[used][inside], at[1], at[2]), values[1][used][inside])
        counts = (by_camera > 0) & (by_camera >= OWNER_SHARE * by_camera.sum(axis=0))
        for k in range(len(self.cameras)):
            recorded[:, counts[k]] &= self.is_used[k, days][:, None]
        return Cube(n=totals[0], exposure_h=totals[1], violation_h=totals[2], is_recorded=recorded)

    def seen_share(self, days: slice, *, radius_m: float, cells: Flags) -> Floats | None:
        """Return how much of the disc around each cell the cameras used in some days see, shape of the grid.

        Share of the disc's area, as far as the plan reaches, that lies in the union of the views; cameras have the
        positions of their calibration at the end of the days. NaN outside `cells`.

        Returns:
            None when what some of these cameras see is unknown.
        """
        assert self.grid is not None
        site, last = self._warehouse.site, self.first + timedelta(days=days.stop)
        end_ms = round(datetime(last.year, last.month, last.day, tzinfo=site.zone).timestamp() * 1000)
        bounds = camera_views.plan_bounds(self.floor)
        used = [c for k, c in enumerate(self.cameras) if self.is_used[k, days].any()]
        views = [_view(camera, at_ms=end_ms - 1, bounds=bounds) for camera in used]
        known = [view for view in views if view is not None]
        if len(known) < len(views):
            return None
        # windows of many days share views and most cells, and discs of all cells take longer than the rest of a window
        share = self._seen.setdefault((*(view.wkb for view in known), radius_m), np.full(self.grid.shape, np.nan))
        rows, columns = np.nonzero(cells & np.isnan(share))
        x, y = self.grid.x_m(columns), self.grid.y_m(rows)
        share[rows, columns] = camera_views.seen_share(
            np.column_stack((x, y)), views=known, radius_m=radius_m, bounds=bounds
        )
        return np.where(cells, share, np.nan)

    def _camera_days(self) -> tuple[Flags, Flags]:
        """Return open days and the camera-days that take part; note why the others cannot be known."""
        rows = self._warehouse.rows(
            "select camera_id, local_date, sum(open_s)::double as open_s, sum(recorded_open_s)::double as recorded_s, "
            "bool_or(recorded_open_s > 0 and exposure_open_s is null) as no_people, "
            "bool_or(recorded_open_s > 0 and violation_records is null) as no_distances, "
            "bool_or(recorded_open_s > 0 and n_violations_open is null) as no_violations "
            "from camera_hours where floor_id = $floor group by all",
            {"floor": self.floor.floor_id},
        )
        is_open = np.zeros(self.n_days, dtype=np.bool_)
        is_used = np.zeros((len(self.cameras), self.n_days), dtype=np.bool_)
        least = self._warehouse.site.settings.min_coverage
        for row in rows:
            camera, day = self._places[row["camera_id"]], self.index(row["local_date"])
            is_open[day] |= row["open_s"] > 0
            if row["recorded_s"] > 0 and (why := self._why_unknown(row)) is not None:
                self.unknown[camera, day] = why
            else:
                is_used[camera, day] = row["recorded_s"] > 0 and row["recorded_s"] >= least * row["open_s"]
        return is_open, is_used

    @staticmethod
    def _why_unknown(row: Mapping[str, Any]) -> Reason | None:
        if row["no_people"]:
            return NO_POSITIONS
        if row["no_distances"]:
            return NO_FLOOR
        return NO_IDS if row["no_violations"] else None

    def _cells(self, n_side: int) -> tuple[Ints, Ints, Ints, Ints, Floats, Floats, Floats]:
        """Return camera and day index, row, column, violations, person-hours and those in violation."""
        table = self._warehouse.table(
            "select camera_id, local_date, floor(cy / $side)::bigint as cy, floor(cx / $side)::bigint as cx, "
            "sum(n_violations)::double as n, sum(exposure_s)::double / 3600 as exposure_h, "
            "sum(violation_s)::double / 3600 as violation_h from cell_days where floor_id = $floor "
            "group by all order by all",
            {"floor": self.floor.floor_id, "side": n_side},
        )
        camera = pc.index_in(table["camera_id"], value_set=self._ids).to_numpy().astype(np.int64)
        day = table["local_date"].to_numpy().astype("datetime64[D]") - np.datetime64(self.first)
        row, column = (table[name].to_numpy() for name in ("cy", "cx"))
        n, exposure_h, violation_h = (table[name].to_numpy() for name in ("n", "exposure_h", "violation_h"))
        return camera, day.astype(np.int64), row, column, n, exposure_h, violation_h

    def _grid(self, cell_m: float) -> Grid | None:
        """Return the cells that hold anything, as far as the plan reaches; note why when there are too many."""
        camera, day, row, column, *_ = self._rows
        used = self.is_used[camera, day]
        if not used.any():
            return None
        grid = grid_over(column[used], row[used], floor=self.floor, cell_m=cell_m)
        if isinstance(grid, Reason):
            self.why_no_grid = grid
            return None
        return grid if all(grid.shape) else None


def add_at(total: Floats, at: tuple[Ints, ...], values: Floats) -> None:
    """Add values one after the other at places of an array: the sums of `numpy.add.at`, in a fifth of its time.

    Args:
        total: The array, contiguous; it changes.
        at: Indices of each value along the axes, not negative.
        values: The values.
    """
    place = at[0]
    for size, index in zip(total.shape[1:], at[1:], strict=True):
        place = place * size + index
    np.add.at(total.reshape(-1), place, values)


def grid_over(cx: Ints, cy: Ints, *, floor: Floor, cell_m: float) -> Grid | Reason:
    """Return the cells from the least to the greatest, as far as the plan reaches, or that they are too many.

    Args:
        cx: Columns, floor(x / cell_m), at least one.
        cy: Rows, floor(y / cell_m).
        floor: The floor.
        cell_m: Side of a cell.
    """
    low, high = [int(cx.min()), int(cy.min())], [int(cx.max()), int(cy.max())]
    bounds = camera_views.plan_bounds(floor)
    if bounds is not None:
        low = [max(a, int(np.floor(b / cell_m))) for a, b in zip(low, bounds[:2], strict=True)]
        high = [min(a, int(np.ceil(b / cell_m)) - 1) for a, b in zip(high, bounds[2:], strict=True)]
    shape = (max(0, high[1] - low[1] + 1), max(0, high[0] - low[0] + 1))
    if shape[0] * shape[1] > CELLS_MAX:
        return Reason("map.large", width_m=shape[1] * cell_m, depth_m=shape[0] * cell_m)
    return Grid(cell_m, low[0], low[1], shape)


def _view(camera: Camera, *, at_ms: int, bounds: camera_views.Bounds | None) -> shapely.Polygon | None:
    calibrations = in_force(camera, at_ms)
    return camera_views.view_polygon(camera, calibration=calibrations[0] if calibrations else None, bounds=bounds)
