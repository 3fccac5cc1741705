"""Counts and times of a week by camera, cell and hour, with small counts merged (`figures.share.merged`).

Violations lie in cells of half a metre, person-time in squares of a metre; rectangles of the page are made of whole
squares, so that both are exact in them. Small counts are put together within an area or the rest of the floor, never
across: cells that summed to more than their area would tell how many came from beside it. Cells are numbered by row
from the lower left corner of the grid.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vsd_analytics.figures.hotspots import FloorHotspots
from vsd_analytics.figures.panels import Flags, positions
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.share.merged import merge_small_counts
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_map import Extent
from vsd_analytics.geometry.camera_views import view_polygon
from vsd_analytics.site.model import Area, Camera

Ints = NDArray[np.int64]
SQUARE_M: Final = 1.0
CELL_M: Final = 0.5
FINE_M: Final = 0.25
"""Cells of the report's map, in which the page draws too."""
SQUARES_MAX: Final = 100_000
"""Larger floors have no map: the page would not stay quick."""
CAMERAS_AT_ONCE: Final = 6
"""Cameras whose rows one query reads: each query reads the files of the whole week."""
HELD_BACK: Final = -1
"""Place of the cells whose area is held back: they have no counts."""
UNIT_MS: Final = 100
"""Person-time is rounded to this, unless all of it is a multiple of something larger, such as the frame interval."""


@dataclass(frozen=True, slots=True)
class CellGrid:
    """Squares of a metre that cover the floor shown.

    Attributes:
        x0, y0: Floor metres of the lower left corner, whole.
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


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Rows of a sparse table, by camera, cell and slot.

    Attributes:
        camera, cell, slot: Each below the number of cameras, cells, and open hours of the week.
        values: Columns, shape (n_kinds, n_rows).
    """

    camera: Ints
    cell: Ints
    slot: Ints
    values: Ints


def grid_of(extent: Extent) -> CellGrid | None:
    """Return the squares that cover the floor shown; None when there are too many."""
    x0, y0, x1, y1 = extent
    grid = CellGrid(math.floor(x0), math.floor(y0), math.ceil(x1) - math.floor(x0), math.ceil(y1) - math.floor(y0))
    return grid if grid.n_squares <= SQUARES_MAX else None


@dataclass(frozen=True, slots=True, eq=False)
class CellCounts:
    """Violations and person-time of a week by camera, cell and hour.

    Attributes:
        violations: By cell of half a metre.
        time: Person-time and person-time in violation by square, in `unit_ms`; each from at least so many tracks.
        unit_ms: Unit of person-time.
    """

    violations: Rows
    time: Rows
    unit_ms: int


@dataclass(frozen=True, slots=True, eq=False)
class WeekCells(CellCounts):
    """Counts and times of a week by cell, where violations are inside the cells, and the excess.

    Attributes:
        fine: Violations of the whole week by camera and cell of the report's map, which tell how those of a cell of
            half a metre lie in it: camera, cell, violations, shape (3, n).
        excess: Hotspots of the window that ends with the week (M20), whose cells are the map of excess.
    """

    fine: Ints
    excess: FloorHotspots


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CellsAsked:
    """What of a week is asked for.

    Attributes:
        slots: Which of the floor's hours are the week's open ones, rising.
        used: Camera-hours that take part, shape (n_cameras, n_slots).
        shared: Those of them that are compared with the other week, same shape; small counts stay on their side.
        extent: The floor shown; what lies outside is left out, as on the report's map.
        grid: Squares that cover it.
        mask: Tells which counts are put together.
        hidden: Areas whose counts are held back (None among them: the rest of the floor), whose violations have no
            cell; None = the floor's own count is held back, so that no violation has one.
        is_by_hour: Rows are by hour; otherwise of the whole week, and the slot of a row says whether its hours are
            compared with the other week (1) or not (0).
        untimed: Floor of which no person-time is given (`share.places`); None = of all it is.
    """

    slots: Ints
    used: Flags
    shared: Flags
    extent: Extent
    grid: CellGrid
    mask: Mask
    hidden: Sequence[Area | None] | None = ()
    is_by_hour: bool = True
    untimed: BaseGeometry | None = None


def week_cells(data: WeekData, asked: CellsAsked, *, excess: FloorHotspots) -> WeekCells:
    """Return the counts and times of a week by cell, where violations are inside the cells, and the excess.

    Args:
        data: The floor.
        asked: What of the week is asked for.
        excess: The hotspots of the window that ends with the week.
    """
    cells = counts_by_cell(data, asked)
    return WeekCells(cells.violations, cells.time, cells.unit_ms, fine=_fine(data, asked), excess=excess)


def counts_by_cell(data: WeekData, asked: CellsAsked) -> CellCounts:
    """Return the violations and the person-time of a week by camera, cell and hour.

    The rows of a few cameras are read at a time: all cameras of a large floor have millions a week.
    """
    grid, n_across = asked.grid, round(1 / CELL_M)
    places = _places(data, grid, hidden=asked.hidden or ())
    none: Any = np.zeros(0, dtype=np.int64)
    nothing: Any = np.zeros((6, 0), dtype=np.int32)  # of a floor without cameras
    counted: list[tuple[Ints, Ints]] = [(nothing, none)]
    timed: list[tuple[Ints, ...]] = [(nothing, none, none, none)]
    for camera, columns in _rows_by_camera(data, asked):
        keys, n, tracks, *times = _of_camera(data, asked, camera, columns)
        is_able = (n > 0) & data.whole.cameras[camera] & (asked.hidden is not None)
        is_able &= places[keys[3] * grid.n_x * n_across + keys[2]] != HELD_BACK
        has_time = (times[0] > 0) & ~_is_on(asked.untimed, grid, *keys[2:4])
        counted.append((keys[:, is_able], n[is_able]))
        timed.append((keys[:, has_time], np.maximum(tracks, 1)[has_time], *(v[has_time] for v in times)))
    unit_ms = _unit(
        *(time_ms for _, _, *times in timed for time_ms in times)
    )  # of what is given: all would tell of hidden times
    return CellCounts(
        violations=_merged(
            np.concatenate([keys for keys, _ in counted], axis=1),
            [np.concatenate([n for _, n in counted])],
            grid=grid,
            across=n_across,
            mask=asked.mask,
            places=places,
        ),
        time=_merged(*_by_square(timed, unit_ms=unit_ms), grid=grid, across=1, mask=asked.mask, is_square=True),
        unit_ms=unit_ms,
    )


def _rows_by_camera(data: WeekData, asked: CellsAsked) -> Iterator[tuple[int, Sequence[Ints]]]:
    """Yield hour, column, row and values of the cells of each camera, in their order; cameras in order of their ids."""
    x0, y0, x1, y1 = (end / CELL_M for end in asked.extent)
    ends = {"x0": math.floor(x0), "y0": math.floor(y0), "x1": math.ceil(x1), "y1": math.ceil(y1)}
    cameras = sorted(range(len(data.ids)), key=lambda k: data.ids[k])
    for first in range(0, len(cameras), CAMERAS_AT_ONCE):
        few = cameras[first : first + CAMERAS_AT_ONCE]
        ids = [data.ids[camera] for camera in few]
        rows = data.warehouse.table(
            "select camera_id, hour_start_ms, cx, cy, n_violations, n_tracks, exposure_ms, violation_ms "
            "from planner_cells where floor_id = $floor and list_contains($cameras::varchar[], camera_id) "
            "and hour_start_ms between $from and $to and cx >= $x0 and cx < $x1 and cy >= $y0 and cy < $y1",
            {"floor": data.floor.floor_id, "cameras": ids, **_from_to(data, asked.slots), **ends},
        )
        position, columns = positions(rows["camera_id"], ids, otherwise=-1), [c.to_numpy() for c in rows.columns[1:]]
        order = _order(position, *columns[:3])
        edges = np.searchsorted(position[order], np.arange(len(few) + 1))
        for camera, (start, end) in zip(few, pairwise(edges.tolist()), strict=True):
            yield camera, [column[order[start:end]] for column in columns]


def _order(*keys: Ints) -> Ints:
    """Return the order of rows by some columns: by one number of them all, which takes a fraction of the time."""
    ranks = [key - key.min(initial=np.iinfo(key.dtype).max) for key in keys]
    ranks[1] //= max(1, int(np.gcd.reduce(ranks[1])))  # hours, in milliseconds
    return np.argsort(np.ravel_multi_index(ranks, [int(rank.max(initial=0)) + 1 for rank in ranks]), kind="stable")


def _of_camera(data: WeekData, asked: CellsAsked, camera: int, columns: Sequence[Any]) -> tuple[Ints, ...]:
    """Return the rows of a camera: keys as for `_merged`, violations, tracks, person-time and that in violation."""
    slots, grid, n_across = asked.slots, asked.grid, round(1 / CELL_M)
    hour_ms, x, y = columns[:3]
    start_ms = data.hours.start_ms[slots]
    slot = np.minimum(np.searchsorted(start_ms, hour_ms), len(slots) - 1).astype(np.int32)
    taken = asked.used[camera, slot] & (start_ms[slot] == hour_ms)
    slot, x, y, *values = (v[taken] for v in (slot, x - grid.x0 * n_across, y - grid.y0 * n_across, *columns[3:]))
    day, side = data.hours.day[slots].astype(np.int32)[slot], asked.shared[camera, slot]
    if not asked.is_by_hour:
        day, slot = np.zeros_like(slot), side.astype(np.int32)
    return np.stack((np.full_like(slot, camera), slot, x, y, day, side)), *values


def _by_square(timed: Sequence[Sequence[Ints]], *, unit_ms: int) -> tuple[Ints, list[Ints]]:
    """Return keys and values of squares, as `_merged` takes them, from those of the half-metre cells of each camera.

    Args:
        timed: Of each camera keys, tracks, person-time and person-time in violation, in milliseconds.
        unit_ms: Unit of the times returned. They are rounded in the order given, from one camera to the next.
    """
    n_across, before_ms = round(1 / CELL_M), [0, 0]
    parts = []
    for keys, tracks, *times in timed:
        rounded = [_rounded(column, unit_ms, before_ms=before) for column, before in zip(times, before_ms, strict=True)]
        before_ms = [before + int(column.sum()) for column, before in zip(times, before_ms, strict=True)]
        squares = np.concatenate((keys[:2], keys[2:4] // n_across, keys[4:]))
        order = np.lexsort(squares[1:4])
        squares = squares[:, order]
        is_first = np.append(True, np.any(squares[1:4, 1:] != squares[1:4, :-1], axis=0))[: order.size]
        starts = np.flatnonzero(is_first)
        most = np.maximum.reduceat(tracks[order], starts) if starts.size else tracks[:0]
        sums = [np.add.reduceat(column[order], starts) if starts.size else column[:0] for column in rounded]
        parts.append((squares[:, starts], most, *sums))
    keys, *values = (np.concatenate(column, axis=-1) for column in zip(*parts, strict=True))
    return keys, values


def _is_on(floor: BaseGeometry | None, grid: CellGrid, x: Ints, y: Ints) -> Flags:
    """Return which cells of half a metre, by column and row of the grid, have floor in common with some floor."""
    if floor is None or floor.is_empty:
        return np.zeros(x.shape, dtype=np.bool_)
    n_across = grid.n_x * round(1 / CELL_M)
    cells, inverse = np.unique(y.astype(np.int64) * n_across + x, return_inverse=True)
    left, low = grid.x0 + cells % n_across * CELL_M, grid.y0 + cells // n_across * CELL_M
    boxes = shapely.box(left, low, left + CELL_M, low + CELL_M)
    return np.asarray(shapely.relate_pattern(boxes, floor, "T********"))[inverse]


def _from_to(data: WeekData, slots: Ints) -> dict[str, int]:
    """Return the UTC instants of the first and the last of some hours; no hour lies between those of none."""
    start_ms = data.hours.start_ms[slots]
    return {"from": int(start_ms[0]), "to": int(start_ms[-1])} if slots.size else {"from": 1, "to": 0}


def _fine(data: WeekData, asked: CellsAsked) -> Ints:
    """Return the week's violations by camera and cell of the report's map."""
    slots, grid = asked.slots, asked.grid
    rows = data.warehouse.table(
        "select camera_id, hour_start_ms, cx::bigint as cx, cy::bigint as cy, count(*)::bigint as n from violations "
        "where floor_id = $floor and hour_start_ms between $from and $to and is_open and cx is not null "
        "group by all order by all",
        {"floor": data.floor.floor_id, **_from_to(data, slots)},
    )
    camera = positions(rows["camera_id"], data.ids, otherwise=-1)
    start_ms = data.hours.start_ms[slots]
    slot = np.minimum(np.searchsorted(start_ms, rows["hour_start_ms"].to_numpy()), len(slots) - 1)
    x, y = rows["cx"].to_numpy(), rows["cy"].to_numpy()
    x0, y0, x1, y1 = (end / FINE_M for end in asked.extent)
    taken = asked.used[camera, slot] & (asked.hidden is not None) & data.whole.cameras[camera]
    taken &= (x >= math.floor(x0)) & (x < math.ceil(x1)) & (y >= math.floor(y0)) & (y < math.ceil(y1))
    across = round(SQUARE_M / FINE_M)
    x, y = x[taken] - grid.x0 * across, y[taken] - grid.y0 * across
    side = round(CELL_M / FINE_M)
    half = (y // side) * grid.n_x * (across // side) + x // side
    cell = y * grid.n_x * across + x
    place = _places(data, grid, hidden=asked.hidden or ())[half]
    order = np.lexsort((cell, half, camera[taken], place))
    keys = np.stack((camera[taken], half, cell, place))[:, order]
    is_first = np.append(True, np.any(keys[:, 1:] != keys[:, :-1], axis=0))[: keys.shape[1]]
    n = np.bincount(np.cumsum(is_first) - 1, weights=rows["n"].to_numpy()[taken][order]).astype(np.int64)
    keys = keys[:, is_first]
    is_shown = keys[3] != HELD_BACK
    keys, n = keys[:, is_shown], n[is_shown]
    given = merge_small_counts(
        n[None], groups=(_runs(*keys[[3, 0, 1]]), _runs(*keys[[3, 0]]), keys[3]), mask=asked.mask
    ).values[0]
    kept = np.flatnonzero(given)
    kept = kept[np.lexsort((keys[2][kept], keys[0][kept]))]
    return np.stack((keys[0][kept], keys[2][kept], given[kept]))


def _merged(
    keys: Ints,
    values: list[Ints],
    *,
    grid: CellGrid,
    across: int,
    mask: Mask,
    places: Ints | None = None,
    is_square: bool = False,
) -> Rows:
    """Merge rows until none is small: first with the next row in time, then with the next square.

    The order of squares runs along rows of the floor, to and fro, so that merged squares are neighbours.

    Args:
        keys: Camera, slot, column and row of the cell of half a metre, day, compared or not; one column per row.
        values: Counts or times there; the first decides what is small.
        grid: The squares.
        across: Cells along a side of a square.
        mask: Tells which counts are small.
        places: Place of each cell of half a metre; small counts stay in theirs. None: one place.
        is_square: Add the cells up to squares. The first of `values` must be tracks; a square has at least as many as
            its busiest cell. Tracks are not returned.
    """
    camera, slot, x, y, day, side = keys
    square_x, square_y = x // across, y // across
    if is_square:
        x, y, across = square_x, square_y, 1
    n_x = grid.n_x * across
    walk = square_y * grid.n_x + np.where(square_y % 2 == 0, square_x, grid.n_x - 1 - square_x)
    cell = y * n_x + x
    place = np.zeros_like(cell) if places is None else places[cell]
    order = np.lexsort((x, y, slot, side, day, walk, camera, place))
    camera, slot, cell, walk, day, side, place = (v[order] for v in (camera, slot, cell, walk, day, side, place))
    # one row per camera, cell and hour: half-metre rows that share a square are added up
    is_first = np.append(True, np.any([v[1:] != v[:-1] for v in (camera, slot, cell)], axis=0))[: camera.size]
    row = np.cumsum(is_first) - 1
    summed = np.zeros((len(values), int(is_first.sum())), dtype=np.int64)
    for k, (total, value) in enumerate(zip(summed, values, strict=True)):
        (np.maximum if is_square and k == 0 else np.add).at(total, row, value[order])
    camera, slot, cell, walk, day, side, place = (v[is_first] for v in (camera, slot, cell, walk, day, side, place))
    of_camera = _runs(place, camera)
    of_square = _runs(of_camera, walk)
    of_day = _runs(of_square, day)
    groups = (_runs(of_day, side), of_day, of_square, of_camera, *(() if places is None else (place,)))
    given = merge_small_counts(summed, groups=groups, mask=mask).values[int(is_square) :]
    kept = np.flatnonzero(given.any(axis=0))
    kept = kept[np.lexsort((slot[kept], cell[kept], camera[kept]))]
    return Rows(camera[kept], cell[kept], slot[kept], given[:, kept])


def _places(data: WeekData, grid: CellGrid, *, hidden: Sequence[Area | None]) -> Ints:
    """Return the place each cell of half a metre lies in, shape (n_cells,): 0 the rest, areas from 1, `HELD_BACK`.

    A cell on the border of what is held back belongs to it; any other lies where its middle does.
    """
    n_x, n_y = (round(n / CELL_M) for n in (grid.n_x, grid.n_y))
    y, x = (v.ravel() * CELL_M for v in np.mgrid[:n_y, :n_x])
    cells = shapely.box(grid.x0 + x, grid.y0 + y, grid.x0 + x + CELL_M, grid.y0 + y + CELL_M)
    polygons = [shapely.Polygon(a.polygon) for a in data.areas]
    place = np.zeros(len(cells), dtype=np.int64)
    for k, polygon in reversed(list(enumerate(polygons, 1))):
        place[shapely.contains_xy(polygon, grid.x0 + x + CELL_M / 2, grid.y0 + y + CELL_M / 2)] = k
    held = [p for a, p in zip(data.areas, polygons, strict=True) if a in hidden]
    if held:
        place[shapely.area(shapely.intersection(cells, shapely.union_all(held))) > 0] = HELD_BACK
    if None in hidden:
        place[shapely.area(shapely.difference(cells, shapely.union_all(polygons))) > 0] = HELD_BACK
    return place


def _runs(*values: Ints) -> Ints:
    """Return a number for each run of equal values."""
    return np.cumsum(np.append(False, np.any([v[1:] != v[:-1] for v in values], axis=0)))[: values[0].size]


def _unit(*times_ms: Ints) -> int:
    """Return the largest unit all times are multiples of, at least `UNIT_MS`."""
    common = math.gcd(*(int(np.gcd.reduce(t)) for t in times_ms if t.size))
    return max(common, UNIT_MS)


def _rounded(times_ms: Ints, unit_ms: int, *, before_ms: int) -> Ints:
    """Return times in units, rounded so that running sums, which go on after others, are right to half a unit."""
    sums = before_ms + np.cumsum(times_ms)
    return np.diff((sums + unit_ms // 2) // unit_ms, prepend=(before_ms + unit_ms // 2) // unit_ms)


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
