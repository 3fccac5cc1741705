"""The small tables of the site as arrays that are looked up by camera, time and place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.warehouse.accelerated.columns import grouped_by, picked, run_of, starts_of
from vsd_analytics.warehouse.held import NULL, Bools, Columns, Ints

DAY_MS = 86_400_000


class Floors:
    """Which camera counts where: `owner_cells` as one grid for each floor and span of time.

    Args:
        cameras: The relation `cameras`.
        owner_cells: The relation `owner_cells`.
        cell_mm: Side of its cells.
        n_cameras: Number of camera names.
    """

    def __init__(self, cameras: Columns, owner_cells: Columns, *, cell_mm: int, n_cameras: int) -> None:
        self._cell_mm = cell_mm
        floors = {floor: number for number, floor in enumerate(dict.fromkeys(cameras["floor_id"].tolist()))}
        self.of_camera = np.full(n_cameras, -1, dtype=np.int64)
        self.of_camera[cameras["camera_id"]] = [floors[f] for f in cameras["floor_id"].tolist()]
        cell_floor = np.array([floors.get(f, -1) for f in owner_cells["floor_id"].tolist()], dtype=np.int64)
        spans = zip(cell_floor.tolist(), owner_cells["from_ms"].tolist(), owner_cells["to_ms"].tolist(), strict=True)
        number = {span: i for i, span in enumerate(dict.fromkeys(spans))}
        spans = zip(cell_floor.tolist(), owner_cells["from_ms"].tolist(), owner_cells["to_ms"].tolist(), strict=True)
        of_cell = np.array([number[span] for span in spans], dtype=np.int64)
        self._spans = [(*span, _grid(owner_cells, of_cell == i)) for span, i in number.items() if span[0] >= 0]
        self._is_one = not self.of_camera.any()  # all cameras are on floor 0

    def owner(self, camera: NDArray[Any], ts_ms: Ints, sum_x_mm: Ints, sum_y_mm: Ints, n: int | Ints = 1) -> Ints:
        """Return the camera that counts at each place, -1 where the place is unknown or no other camera sees it.

        Args:
            camera: Camera that reports it; the place is on its floor.
            ts_ms: Instant, UTC milliseconds.
            sum_x_mm: Sum of the x of `n` people: the place is their mean. An unknown one lies far outside of all grids.
            sum_y_mm: Sum of their y.
            n: Number of people.
        """
        owners = np.full(len(camera), -1, dtype=np.int64)
        if not len(camera):
            return owners
        first_ms, last_ms = ts_ms.min(), ts_ms.max()
        spans = [span for span in self._spans if span[1] <= last_ms and span[2] > first_ms]
        if not spans:
            return owners
        side = n * self._cell_mm
        cx, cy = sum_x_mm // side, sum_y_mm // side
        for of_floor, from_ms, to_ms, (grid, x0, y0) in spans:
            at = np.clip(cx - x0, 0, grid.shape[0] - 1)
            at *= grid.shape[1]
            at += np.clip(cy - y0, 0, grid.shape[1] - 1)
            owner: Ints = grid.ravel()[at]
            if self._is_one and from_ms <= first_ms and to_ms > last_ms:
                return owner
            is_here = (self.of_camera[camera] == of_floor) & (ts_ms >= from_ms) & (ts_ms < to_ms)
            owners = np.where(is_here, owner, owners)
        return owners

    def is_owned(self, camera: NDArray[Any], ts_ms: Ints, sum_x_mm: Ints, sum_y_mm: Ints, n: int | Ints = 1) -> Bools:
        """Return whether a camera counts at each of its places itself: nobody else does, or the place is unknown."""
        if not self._spans:
            return np.ones(len(camera), dtype=np.bool_)
        owner = self.owner(camera, ts_ms, sum_x_mm, sum_y_mm, n)
        is_owned: Bools = owner < 0
        is_owned |= owner == camera
        return is_owned


NO_AREAS = -1
"""Number of a place on a floor without areas."""


def areas_of(at: Columns, cameras: Columns, area_cells: Columns, site: SiteTables) -> tuple[Ints, Sequence[str]]:
    """Return the number of the area that each place lies in, and the areas' ids.

    Numbers are in order of the ids; the rest of a floor with areas comes last, as nulls do.

    Args:
        at: Columns camera_id, ts_ms, x_mm, y_mm; the place is on the camera's floor and known.
        cameras: The relation `cameras`.
        area_cells: The relation `area_cells`.
        site: Its floors and the side of a cell.
    """
    names = sorted(set(area_cells["area_id"].tolist()))
    number = {name: k for k, name in enumerate(names)}
    floors = dict(zip(cameras["floor_id"].tolist(), site.floors.of_camera[cameras["camera_id"]].tolist(), strict=True))
    spans = list(zip(*(area_cells[c].tolist() for c in ("floor_id", "from_ms", "to_ms")), strict=True))
    each = list(dict.fromkeys(spans))
    span_of = np.array([each.index(span) for span in spans], dtype=np.int64)
    cells = {**area_cells, "number": np.array([number[a] for a in area_cells["area_id"].tolist()], dtype=np.int64)}
    floor = site.floors.of_camera[at["camera_id"]]
    side = int(site.params["cell_mm"])
    cx, cy = at["x_mm"] // side, at["y_mm"] // side
    numbers = np.full(len(cx), NO_AREAS, dtype=np.int64)
    numbers[np.isin(floor, [floors[f] for f, _, _ in set(spans) if f in floors])] = len(names)
    for k, (of_floor, from_ms, to_ms) in enumerate(each):
        rows = np.flatnonzero((floor == floors.get(of_floor, -1)) & (at["ts_ms"] >= from_ms) & (at["ts_ms"] < to_ms))
        if not len(rows) or of_floor not in floors:
            continue
        grid, x0, y0 = _grid(cells, span_of == k, "number")
        area = grid[np.clip(cx[rows] - x0, 0, grid.shape[0] - 1), np.clip(cy[rows] - y0, 0, grid.shape[1] - 1)]
        numbers[rows] = np.where(area >= 0, area, len(names))
    return numbers, names


def _grid(cells: Columns, rows: Bools, value: str = "camera_id") -> tuple[Ints, int, int]:
    """Return the owner (or another value) of each cell, -1 for none as along its edge, and its first corner's cell."""
    cx, cy = cells["cx"][rows], cells["cy"][rows]
    x0, y0 = int(cx.min()) - 1, int(cy.min()) - 1
    grid = np.full((int(cx.max()) - x0 + 2, int(cy.max()) - y0 + 2), -1, dtype=np.int64)
    grid[cx - x0, cy - y0] = cells[value][rows]
    return grid, x0, y0


class DayIntervals:
    """The fact `camera_days`, looked up by camera and instant.

    Args:
        camera_days: The fact.
        n_cameras: Number of camera names.
    """

    def __init__(self, camera_days: Columns, *, n_cameras: int) -> None:
        days = camera_days["utc_day"]
        self._first = int(days.min()) if len(days) else 0
        n_days = int(days.max()) - self._first + 1 if len(days) else 0
        at = (camera_days["camera_id"], days - self._first)
        self._interval_ms = np.full((n_cameras, n_days + 1), NULL, dtype=np.int64)
        self._has_heartbeat = np.zeros((n_cameras, n_days + 1), dtype=np.bool_)
        self._interval_ms[at] = camera_days["interval_ms"]
        self._has_heartbeat[at] = camera_days["has_heartbeat"]

    def interval_ms(self, camera: NDArray[Any], ts_ms: Ints) -> Ints:
        """Return the frame interval of each camera's day, NULL for a day without one."""
        return picked(self._interval_ms.ravel(), self._place(camera, ts_ms))

    def of_frames(self, camera: NDArray[Any], ts_ms: Ints) -> tuple[Ints, Bools]:
        """Return the frame interval of each camera's day, and whether the camera reported frames on it."""
        place = self._place(camera, ts_ms)
        return picked(self._interval_ms.ravel(), place), picked(self._has_heartbeat.ravel(), place)

    def _place(self, camera: NDArray[Any], ts_ms: Ints) -> Ints:
        n_columns = self._interval_ms.shape[1]
        day = ts_ms // DAY_MS - self._first
        day[(day < 0) | (day >= n_columns)] = n_columns - 1  # the column after the last day holds no day
        day += camera * np.int64(n_columns)
        return day


@dataclass(frozen=True, slots=True)
class SiteTables:
    """What all relations of a batch look up.

    Attributes:
        params: The settings that SQL reads, by name.
        n_cameras: Number of camera names.
        n_tracks: Number of track names.
        floors: Which camera counts where.
        days: Frame intervals.
        only_counts: No fact of the batch asks who is who. So people have no numbers in their frame and come in any
            order there, and `pairs` has those closer than `distance_m` only.
    """

    params: Mapping[str, Any]
    n_cameras: int
    n_tracks: int
    floors: Floors
    days: DayIntervals
    only_counts: bool = False


def gap_ms(interval_ms: Ints, least_ms: int, site: SiteTables) -> Ints:
    """Return the longest gap that a run bridges: `least_ms`, at least `gap_half_intervals` frame intervals."""
    return np.maximum(least_ms, int(site.params["gap_half_intervals"]) * interval_ms // 2)


def is_close(pairs: Columns, site: SiteTables) -> Bools:
    """Return whether each pair is closer than `distance_m`: in a batch that only counts, all are."""
    if site.only_counts:
        return np.ones(len(pairs["_a"]), dtype=np.bool_)
    are_close: Bools = pairs["distance_mm"] < site.params["distance_mm"]
    return are_close


def bucket_of(ts_ms: Ints, site: SiteTables) -> Ints:
    """Return the first quarter-hour of the time bucket that each instant lies in."""
    quarters = int(site.params["bucket_quarters"])
    bucket: Ints = ts_ms // (900_000 * quarters) * quarters
    return bucket


@dataclass(frozen=True, slots=True)
class BucketRuns:
    """Runs of records of one camera and time bucket, given records of a camera and hour in order of their frames.

    Attributes:
        n: Number of records.
        starts: First record of each run.
        camera_id, bucket: Camera and first quarter of the time bucket, of each run.
    """

    n: int
    starts: Ints
    camera_id: Ints
    bucket: Ints

    @classmethod
    def of(cls, frame: Ints, instants: Columns, site: SiteTables) -> BucketRuns:
        """Return the runs of records, given the row of `instants` of each."""
        starts = starts_of(frame)
        camera, ts_ms = (instants[c][frame[starts]] for c in ("camera_id", "ts_ms"))
        bucket = bucket_of(ts_ms, site)
        runs = starts_of(camera, bucket)
        return cls(len(frame), starts[runs], camera[runs].astype(np.int64), bucket[runs])

    def each(self, of_run: Ints) -> Ints:
        """Return a number of each record, given one of each run."""
        return np.repeat(of_run, np.diff(self.starts, append=self.n))


def numbered(runs: Sequence[BucketRuns]) -> tuple[list[Ints], Ints, Ints]:
    """Return the number of camera and bucket of each run, and the camera and bucket of each number.

    Numbers are in order of hour, camera and quarter.
    """
    camera, bucket = (
        np.concatenate([getattr(bucket_runs, c) for bucket_runs in runs]) for c in ("camera_id", "bucket")
    )
    order, starts = grouped_by(bucket // 4, camera, bucket)
    number = np.empty(len(order), dtype=np.int64)
    number[order] = run_of(starts, len(order))
    at = order[starts]
    return np.split(number, np.cumsum([len(bucket_runs.starts) for bucket_runs in runs])[:-1]), camera[at], bucket[at]
