"""The numbers of the page in the order in which its script reads them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from vsd_analytics.planner import cell_counts
from vsd_analytics.planner.hour_counts import HourPanel
from vsd_analytics.planner.logged_changes import ChangeSide
from vsd_analytics.planner.pack import packed, planes, sparse, varints
from vsd_analytics.planner.planner_data import PlannerData, PlannerWeek

ORIGIN: Final = 1_000_000
"""Added to cell numbers that may be negative."""


@dataclass(frozen=True, slots=True)
class PackedNumbers:
    """The numbers of the page as text.

    Attributes:
        hours: What the page needs to open: hours, counts by place, where people can walk.
        cells: What lies where, of both weeks and of logged changes: many times as long, and read after the first draw.
    """

    hours: str
    cells: str


def packed_numbers(data: PlannerData) -> PackedNumbers:
    """Return the numbers in the order in which the script reads them."""
    hours: list[bytes] = []
    cells: list[bytes] = []
    grid = None if data.shown is None else cell_counts.grid_of(data.shown.extent)
    for week in (data.week, data.before):
        if week is not None:
            hours += _panel_bytes(week.panel)
            if week.cells is not None:
                cells += _cell_bytes(week, grid)
    if data.history.day.size:
        hours += _panel_bytes(data.history)
    if grid is not None:
        hours += _walkable_bytes(data)
        hours += [] if data.seen is None else [_runs(data.seen)]
    for change in data.changes:
        for side in (change.before, change.after):
            if side is not None:
                cells += _part(_side_bytes(side, grid))
    return PackedNumbers(packed(hours), packed(cells))


def _side_bytes(side: ChangeSide, grid: cell_counts.CellGrid | None) -> list[bytes]:
    parts = [varints(v) for v in (side.recorded_ms, side.n, side.exposure_ms, side.close_ms)]
    if side.violations is not None and side.time is not None and grid is not None:
        across = round(cell_counts.SQUARE_M / cell_counts.CELL_M)
        parts += sparse(side.violations.camera * grid.n_squares * across**2 + side.violations.cell,
                        *side.violations.values)  # fmt: skip
        parts += sparse(side.time.camera * grid.n_squares + side.time.cell, *side.time.values)
    return parts


def _panel_bytes(panel: HourPanel) -> list[bytes]:
    """Return hours, counts and times; times in the largest unit that all are a multiple of, such as 0.2 s."""
    numbers = (panel.day, panel.weekday, panel.hour, panel.fold, 2 * panel.recorded_ms + panel.is_counted)
    unit_ms = max(1, int(np.gcd.reduce(np.concatenate((panel.exposure_ms, panel.close_ms), axis=None))))
    times = (planes(v // unit_ms) for v in (panel.exposure_ms, panel.close_ms))
    counts = (*(varints(v) for v in numbers), planes(panel.n))
    return [varints([panel.day.size]), *counts, varints([unit_ms]), *times]


def _cell_bytes(week: PlannerWeek, grid: cell_counts.CellGrid | None) -> list[bytes]:
    assert week.cells is not None
    assert grid is not None
    across = round(cell_counts.SQUARE_M / cell_counts.CELL_M)
    per_square = round(cell_counts.SQUARE_M / cell_counts.FINE_M) ** 2

    cells = week.cells
    grid_m, tested = cells.excess.grid, cells.excess.cells
    if grid_m is None or tested is None:
        excess = [varints([0, 0, ORIGIN, ORIGIN])]
    else:
        n_y, n_x = grid_m.shape
        whole = np.nan_to_num(np.rint(tested.ratio * 100) + 1, nan=0.0)
        excess = [varints([n_x, n_y, ORIGIN + grid_m.cx, ORIGIN + grid_m.cy]), varints(whole)]
    return [
        *_table(cells.violations, grid.n_squares * across**2),
        *_part(sparse(cells.fine[0] * grid.n_squares * per_square + cells.fine[1], cells.fine[2])),
        *_table(cells.time, grid.n_squares, varints([cells.unit_ms])),
        *_part(excess),
    ]


def _table(rows: cell_counts.Rows, n_cells: int, *head: bytes) -> list[bytes]:
    """Return two parts: the sums of each camera and cell, and their hours.

    The whole week is drawn from the sums alone, so a page opens without reading a row for each hour.
    """
    key, first, size = np.unique(rows.camera * n_cells + rows.cell, return_index=True, return_counts=True)
    sums = np.add.reduceat(rows.values, first, axis=1) if key.size else rows.values
    gaps = np.diff(rows.slot, prepend=0)
    gaps[first] = rows.slot[first]
    return [
        *_part([*head, *sparse(key, *sums)]),
        *_part([varints(size), varints(gaps), *(planes(v) for v in rows.values)]),
    ]


def _part(parts: list[bytes]) -> list[bytes]:
    """Return bytes with how many they are before them, so that the script reads them when it needs them."""
    return [varints([sum(map(len, parts))]), *parts]


def _walkable_bytes(data: PlannerData) -> list[bytes]:
    """Return which cells are free, open steps, cells near free floor, and each blocked cell's nearest free one."""
    from scipy.ndimage import binary_dilation, distance_transform_edt

    floor = data.walkable
    if floor is None:
        return [varints([0])]
    free = floor.is_free
    near = binary_dilation(free, iterations=2, structure=np.ones((3, 3), dtype=np.bool_))
    rows, columns = distance_transform_edt(~free, return_distances=False, return_indices=True)
    home = (rows * free.shape[1] + columns)[~free]
    return [varints([1]), *(_runs(v) for v in (free, floor.to_right, floor.upwards, near)), varints(home)]


def _runs(flags: Any) -> bytes:
    """Return flags as run lengths; the first run is of false values."""
    flat = np.concatenate([[False], np.asarray(flags).ravel()])
    changes = np.flatnonzero(flat[1:] != flat[:-1])
    return varints(np.diff(np.concatenate([[0], changes, [flat.size - 1]])))
