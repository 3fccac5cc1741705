"""Marts by cell with numpy: the rows of their queries, a day at a time, summed an hour of a camera at a time.

The facts behind them have a row for almost every record. A query groups millions of them by five keys, and holds all of
its days. Here the cells of one camera and hour are a small picture, in which every row has its place.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from datetime import date
from itertools import pairwise
from typing import Any, Final

import numpy as np
import pyarrow as pa

from vsd_analytics.warehouse.held import Ints

Ask = Callable[[str, dict[str, Any]], pa.Table]
CELL_MARTS: Final = ("cell_days", "cell_hours", "footsteps", "planner_cells")
"""Marts that are computed here."""
_COARSE_MM: Final = 500
"""Side of the cells of `planner_cells` and `cell_days`."""
_PLACES: Final = (
    "with places as (select camera_id, row_number() over (order by floor_id, camera_id) - 1 as place from cameras)"
)
_LARGEST: Final = 4
"""Places of a picture for each row. A larger picture, as of one position far off, is never made."""


class _CellRows:
    """Rows of cells, by group: a camera, or a floor.

    Attributes:
        group, x, y: Of each row, of one length.
        values: Numbers of each row.
    """

    def __init__(self, group: Ints, x: Ints, y: Ints, *values: Ints) -> None:
        self.group, self.x, self.y, self.values = group, x, y, values

    def within(self, side_mm: int, *, cell_mm: int) -> _CellRows:
        """Return the rows with the larger cells that theirs lie in, given the sides of these and of theirs."""
        x, y = (at.astype(np.int64) * cell_mm // side_mm for at in (self.x, self.y))
        return _CellRows(self.group, x, y, *self.values)

    def where(self, kept: Any) -> _CellRows:
        """Return some of the rows: a slice, or a flag of each."""
        return _CellRows(self.group[kept], self.x[kept], self.y[kept], *(v[kept] for v in self.values))

    def with_values(self, *values: Ints | int) -> _CellRows:
        """Return the rows with other numbers; one number is that of every row."""
        n = len(self.group)
        return _CellRows(self.group, self.x, self.y, *(np.full(n, v) if isinstance(v, int) else v for v in values))


def needs_violations(names: Collection[str]) -> bool:
    """Return whether some of `CELL_MARTS` count violations, so that the mart `violations` is read for each day."""
    return not {"cell_days", "cell_hours", "planner_cells"}.isdisjoint(names)


def cell_marts(ask: Ask, day: date, names: Collection[str]) -> Iterator[tuple[str, pa.Table]]:
    """Yield marts of `CELL_MARTS` by name, each with its rows of a local day in the order of its query.

    Args:
        ask: Returns the rows of a query of a warehouse that holds the day.
        day: The day.
        names: The marts.
    """
    cameras = ask("select floor_id, camera_id from cameras order by floor_id, camera_id", {})
    cell_mm = int(ask("select cell_mm from params", {})["cell_mm"][0].as_py())
    quarters = ask(
        "select quarter, hour_start_ms, is_open from calendar where local_date = $day order by quarter", {"day": day}
    )
    starts, slot_of = np.unique(quarters["hour_start_ms"].to_numpy(), return_inverse=True)
    slot_of = np.where(quarters["is_open"].to_numpy(zero_copy_only=False), slot_of, -1)
    hours = _HourlyFacts(ask, quarters["quarter"].to_numpy(), slot_of, len(starts))
    stood = hours.rows("floor_cells", "exposure_ms", "violation_ms")
    needs_tracks = not {"footsteps", "planner_cells"}.isdisjoint(names)
    walked = hours.rows("cell_tracks", "n_tracks") if needs_tracks else [_none(1)] * len(starts)
    met = _violations(ask, day, starts) if needs_violations(names) else [_none(0)] * len(starts)
    fine, coarse = [], []
    for cells, tracks, violations in zip(stood, walked, met, strict=True) if needs_violations(names) else ():
        cell_rows = summed([cells.with_values(*cells.values, 0), violations.with_values(0, 0, 1)], n_sums=3)
        counted = cell_rows.within(_COARSE_MM, cell_mm=cell_mm).with_values(*cell_rows.values, 1, 0)
        walked_in = tracks.within(_COARSE_MM, cell_mm=cell_mm).with_values(0, 0, 0, 0, *tracks.values)
        fine.append(cell_rows)
        coarse.append(summed([counted, walked_in], n_sums=4))
    table = _MartTables(cameras, day, starts)
    if "cell_hours" in names:
        exposure, violation, n = table.values(fine)
        seconds = {"exposure_open_s": exposure / 1000.0, "violation_open_s": violation / 1000.0}
        yield "cell_hours", table.of(fine, {**seconds, "n_violations_open": n}, by_hour=True)
    if "planner_cells" in names:
        exposure, violation, n, _, n_tracks = table.values(coarse)
        columns = {"exposure_ms": exposure, "violation_ms": violation, "n_tracks": n_tracks, "n_violations": n}
        yield "planner_cells", table.of(coarse, columns, by_hour=True)
    if "cell_days" in names:
        whole = summed([rows.where(rows.values[3] > 0) for rows in coarse], n_sums=4)
        exposure, violation, n, *_ = whole.values
        seconds = {"exposure_s": exposure / 1000.0, "violation_s": violation / 1000.0}
        yield "cell_days", table.of([whole], {**seconds, "n_violations": n})
    if "footsteps" in names:
        busiest = summed(walked, n_sums=0)
        floors = np.unique(cameras["floor_id"].to_numpy(zero_copy_only=False), return_inverse=True)[1]
        whole = summed([_CellRows(floors[busiest.group], busiest.x, busiest.y, *busiest.values)], n_sums=1)
        whole = whole.where(whole.values[0] > 0)
        yield "footsteps", table.of([whole], {"n_tracks": whole.values[0]}, is_floor=True)


class _HourlyFacts:
    """Rows of facts by local hour of a day, those of open quarter-hours."""

    def __init__(self, ask: Ask, quarters: Ints, slot_of: Ints, n_hours: int) -> None:
        self._ask, self._slot_of, self._n_hours = ask, slot_of, n_hours
        self._first, self._last = int(quarters[0]), int(quarters[-1])

    def rows(self, fact: str, *values: str) -> list[_CellRows]:
        """Return the rows of each hour by group: cameras in order of floor and id."""
        rows = self._ask(
            f"{_PLACES} select place, bucket_quarter, cx, cy, {', '.join(values)} "
            f"from {fact} inner join places using (camera_id) "
            "where hour between $first and $last and bucket_quarter between $from and $to",
            {"first": self._first // 4, "last": self._last // 4, "from": self._first, "to": self._last},
        )
        place, quarter, *columns = (column.to_numpy() for column in rows.columns)
        slot = self._slot_of[quarter - self._first]
        key = slot * (1 + int(place.max(initial=0))) + place
        if (key[1:] < key[:-1]).any():
            order = np.argsort(key, kind="stable")
            slot, place, *columns = (v[order] for v in (slot, place, *columns))
        edges = np.searchsorted(slot, np.arange(self._n_hours + 1))
        every = _CellRows(place, *columns)
        return [every.where(slice(a, b)) for a, b in pairwise(edges)]


def _violations(ask: Ask, day: date, starts: Ints) -> list[_CellRows]:
    """Return a row for each violation that began in an open hour, by hour."""
    rows = ask(
        f"{_PLACES} select hour_start_ms, place, cx, cy from violations inner join places using (camera_id) "
        "where local_date = $day and is_open and cx is not null order by all",
        {"day": day},
    )
    start, *columns = (column.to_numpy() for column in rows.columns)
    edges = [*np.searchsorted(start, starts), len(start)]
    return [_CellRows(*columns).where(slice(a, b)) for a, b in pairwise(edges)]


def _none(n_values: int) -> _CellRows:
    nothing = np.zeros(0, dtype=np.int64)
    return _CellRows(nothing, nothing, nothing, *[nothing] * n_values)


def summed(parts: Sequence[_CellRows], *, n_sums: int) -> _CellRows:
    """Return one row for each group and cell, by group, row and column of the floor.

    Args:
        parts: Rows with the same number of values, each in order of groups; at least one part.
        n_sums: So many values are added up. The others keep their greatest, at least 0.
    """
    groups = np.unique(np.concatenate([p.group[np.flatnonzero(np.diff(p.group, prepend=-1))] for p in parts]))
    first, after = (np.array([np.searchsorted(p.group, groups, side) for p in parts]).T for side in ("left", "right"))
    cells = []
    for group, starts, ends in zip(groups.tolist(), first.tolist(), after.tolist(), strict=True):
        own = [part.where(slice(a, b)) for part, a, b in zip(parts, starts, ends, strict=True) if a < b]
        x, y, *values = (
            _joined(columns) for columns in zip(*((rows.x, rows.y, *rows.values) for rows in own), strict=True)
        )
        cells.append(_of_group(group, x, y, values, n_sums))
    return _CellRows(*map(_joined, zip(*cells, strict=True))) if cells else _none(len(parts[0].values))


def _joined(arrays: Sequence[Ints]) -> Ints:
    return arrays[0] if len(arrays) == 1 else np.concatenate(arrays)


def _of_group(group: int, x: Ints, y: Ints, values: Sequence[Ints], n_sums: int) -> tuple[Ints, ...]:
    """Return group, column, row and values of each cell of one group."""
    low_x, low_y = int(x.min()), int(y.min())
    across, up = int(x.max()) - low_x + 1, int(y.max()) - low_y + 1
    at = (y.astype(np.int64) - low_y) * across + (x - low_x)
    if across * up > _LARGEST * len(x) + 10_000:
        cells, at = np.unique(at, return_inverse=True)
        n_places, used = len(cells), np.arange(len(cells))
    else:
        n_places = across * up
        cells = used = np.flatnonzero(np.bincount(at, minlength=n_places))
    cell_values = []
    for k, value in enumerate(values):
        if k < n_sums:
            of_cells = np.bincount(at, weights=value, minlength=n_places)
        else:
            of_cells = np.zeros(n_places, dtype=np.int64)
            np.maximum.at(of_cells, at, value)
        cell_values.append(of_cells[used].astype(np.int64))
    return np.full(len(cells), group), low_x + cells % across, low_y + cells // across, *cell_values


class _MartTables:
    """Makes the tables of a day."""

    def __init__(self, cameras: pa.Table, day: date, starts: Ints) -> None:
        self._cameras, self._day, self._starts = cameras, day, starts

    @staticmethod
    def values(hours: Sequence[_CellRows]) -> list[Ints]:
        """Return the values of the rows of all hours, one after the other."""
        return [np.concatenate(parts) for parts in zip(*(rows.values for rows in hours), strict=True)]

    def of(
        self, hours: Sequence[_CellRows], values: dict[str, Any], *, by_hour: bool = False, is_floor: bool = False
    ) -> pa.Table:
        """Return a mart.

        Args:
            hours: Its rows of each hour, or of the whole day.
            values: Its last columns, of all rows.
            by_hour: It has the hour as a column.
            is_floor: Groups are floors instead of cameras.
        """
        group, x, y = (np.concatenate([getattr(rows, name) for rows in hours]) for name in ("group", "x", "y"))
        columns: dict[str, Any] = {}
        if is_floor:
            columns["floor_id"] = self._cameras["floor_id"].unique().take(pa.array(group))
        else:
            columns |= {name: self._cameras[name].take(pa.array(group)) for name in ("floor_id", "camera_id")}
        if by_hour:
            columns["hour_start_ms"] = np.repeat(self._starts, [len(rows.group) for rows in hours])
        columns["local_date"] = pa.array(np.full(len(group), np.datetime64(self._day, "D")))
        columns |= {"cx": x.astype(np.int32), "cy": y.astype(np.int32), **values}
        return pa.table(columns)
