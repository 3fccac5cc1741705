"""The numbers of the page in the order in which its script reads them."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vsd_analytics.planner import cell_counts
from vsd_analytics.planner.hour_counts import HourPanel
from vsd_analytics.planner.logged_changes import ChangeSide
from vsd_analytics.planner.planner_data import PlannerData, PlannerWeek
from vsd_analytics.planner.replay import Replay

OF_PYTHON = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;<=>?@^_`{|}~"
"""Signs of base 85 as Python writes them."""
OF_PAGE = bytes(code for code in range(ord("!"), ord("~") + 1) if chr(code) not in "\"&'<>\\`{}")
"""Those of a page, in the order of their codes: none that means something in HTML or in a script."""
TO_PAGE = bytes.maketrans(OF_PYTHON, OF_PAGE)
GZIP_BITS = 31
"""The largest window, and a gzip header, whose time is 0."""
MEMORY_LEVEL = 6
LARGEST = 2**53 - 1
"""Largest number a browser holds exactly."""


def varints(numbers: ArrayLike) -> bytes:
    """Return numbers from 0 to `LARGEST` as bytes of seven bits, the lowest first; the high bit says that more follow.

    Args:
        numbers: Whole numbers, any shape, in C order.

    Raises:
        ValueError: A number is negative or too large.
    """
    rest = np.ascontiguousarray(numbers, dtype=np.int64).ravel()
    if rest.size == 0:
        return b""
    if rest.min() < 0 or rest.max() > LARGEST:
        raise ValueError("only numbers from 0 to 2^53 - 1 can be packed")
    n_bytes = np.ones(rest.size, dtype=np.int64)
    for bits in range(7, 54, 7):
        n_bytes += rest >> bits > 0
    ends = np.cumsum(n_bytes)
    out = np.zeros(int(ends[-1]), dtype=np.uint8)
    for k in range(int(n_bytes.max())):
        has = n_bytes > k
        at = (ends - n_bytes)[has] + k
        out[at] = (rest[has] >> 7 * k & 127) | np.where(n_bytes[has] > k + 1, 128, 0)
    return out.tobytes()


def planes(numbers: ArrayLike) -> bytes:
    """Return numbers from 0 to `LARGEST` as how many planes follow, all lowest bytes, all next ones, and so on.

    Times of many units pack a tenth smaller so than as `varints`: low bytes are nearly random, and gzip codes them
    apart from high ones, which are not.

    Args:
        numbers: Whole numbers, any shape, in C order.

    Raises:
        ValueError: A number is negative or too large.
    """
    rest = np.ascontiguousarray(numbers, dtype=np.int64).ravel()
    if rest.size and (rest.min() < 0 or rest.max() > LARGEST):
        raise ValueError("only numbers from 0 to 2^53 - 1 can be packed")
    n_planes = -(-int(rest.max()).bit_length() // 8) if rest.size else 0
    return bytes([n_planes]) + b"".join((rest >> 8 * k & 255).astype(np.uint8).tobytes() for k in range(n_planes))


def sparse(key: NDArray[np.int64], *values: NDArray[np.int64]) -> list[bytes]:
    """Return rows of a sparse table as columns: how many rows, gaps between rising keys, then each column of values.

    Args:
        key: Rising, not negative.
        values: Columns as long as `key`.
    """
    return [varints([key.size]), varints(np.diff(key, prepend=0)), *(varints(v) for v in values)]


def packed(parts: Iterable[bytes]) -> str:
    """Return byte strings, one after the other, as base 85 of gzip without a time stamp.

    Base 85 is 6 % shorter than base 64. Gzip makes a new code every few thousand bytes. It prefers that to repetitions
    (`Z_FILTERED`): columns differ and hardly repeat. This is 4 % shorter.
    """
    coder = zlib.compressobj(9, zlib.DEFLATED, GZIP_BITS, MEMORY_LEVEL, zlib.Z_FILTERED)
    return base64.b85encode(coder.compress(b"".join(parts)) + coder.flush()).translate(TO_PAGE).decode()


ORIGIN: Final = 1_000_000
"""Added to cell numbers that may be negative."""


@dataclass(frozen=True, slots=True)
class PackedNumbers:
    """The numbers of the page as text.

    Attributes:
        hours: What the page needs to open: hours, counts by place, where people can walk.
        cells: What lies where, of both weeks and of logged changes: many times as long, and read after the first draw.
        replay: Squares by hour, read when somebody asks for an hour; empty where they cannot be given.
    """

    hours: str
    cells: str
    replay: str


def packed_numbers(data: PlannerData) -> PackedNumbers:
    """Return the numbers in the order in which the script reads them."""
    hours: list[bytes] = []
    cells: list[bytes] = []
    grid = None if data.shown is None else cell_counts.grid_of(data.shown.extent)
    for week in (data.week, data.before):
        if week is not None:
            hours += _panel_bytes(week.panel)
            hours += [] if week.recorded_ms is None else [varints(week.recorded_ms)]
            if week.cells is not None:
                cells += _week_bytes(week.cells, grid) if data.is_shared else _cell_bytes(week, grid)
    if data.history.day.size:
        hours += _panel_bytes(data.history)
    if grid is not None:
        hours += _walkable_bytes(data)
        hours += [] if data.seen is None else [_runs(data.seen)]
    for change in data.changes:
        for side in (change.before, change.after):
            if side is not None:
                cells += _part(_side_bytes(side, grid))
    return PackedNumbers(
        packed(hours), packed(cells), "" if data.replay is None else packed(_replay_bytes(data.replay))
    )


def _replay_bytes(replay: Replay) -> list[bytes]:
    """Return what each hour shows, then its squares with any time: of this week, and typical ones."""
    parts = [varints(replay.state), varints(replay.n_weeks)]
    for of_squares in (replay.now, replay.typical):
        by_hour = np.swapaxes(of_squares, 1, 2).reshape(2, -1)
        key = np.flatnonzero(by_hour.any(axis=0))
        parts += sparse(key, *by_hour[:, key])
    return parts


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


def _week_bytes(cells: cell_counts.WeekCells, grid: cell_counts.CellGrid | None) -> list[bytes]:
    """Return the sums of the week's cells, how violations lie in them, and the sums of the hours that are compared."""
    assert grid is not None
    across = round(cell_counts.SQUARE_M / cell_counts.CELL_M)
    per_square = round(cell_counts.SQUARE_M / cell_counts.FINE_M) ** 2
    violations, time = (
        [_sums(rows, n_cells, is_compared=only) for only in (False, True)]
        for rows, n_cells in ((cells.violations, grid.n_squares * across**2), (cells.time, grid.n_squares))
    )
    fine = sparse(cells.fine[0] * grid.n_squares * per_square + cells.fine[1], cells.fine[2])
    unit = varints([cells.unit_ms])
    parts = (violations[0], fine, [unit, *time[0]], violations[1], [unit, *time[1]])
    return [piece for part in parts for piece in _part(part)]


def _sums(rows: cell_counts.Rows, n_cells: int, *, is_compared: bool) -> list[bytes]:
    taken = rows.slot == 1 if is_compared else np.ones_like(rows.slot, dtype=np.bool_)
    key, first = np.unique((rows.camera * n_cells + rows.cell)[taken], return_index=True)
    values = rows.values[:, taken]
    return sparse(key, *(np.add.reduceat(values, first, axis=1) if key.size else values))


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
