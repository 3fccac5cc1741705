"""`floor_cells` and `cell_tracks`: what happened in each cell, counted in tables that have a place for every cell.

In an hour a camera sees people in most cells of its view. So cells are numbered without sorting, where that needs no
more room than a few numbers for each record.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vsd_analytics.warehouse.accelerated.columns import greatest, grouped_by, least, one_of_each, picked, run_of, take
from vsd_analytics.warehouse.accelerated.site_tables import BucketRuns, SiteTables, is_close, numbered
from vsd_analytics.warehouse.held import NULL, Columns, Held, Ints

_ROOM = 4
"""Numbers a record may take of a table with every cell; where it is more, records are sorted."""
_COUNTED_AT_ONCE = 30_000
_KEYS = ("hour", "camera_id", "bucket_quarter", "cx", "cy")
_OF_PERSON = ("x_mm", "y_mm", "_frame")
_OF_PAIR = ("x_a_mm", "y_a_mm", "x_b_mm", "y_b_mm", "_frame")


@dataclass(frozen=True, slots=True)
class _Places:
    """Where some records are, in order of camera and instant, or of hour, camera and instant.

    Attributes:
        runs: Their runs of one camera and time bucket.
        cx, cy: Cell of each record.
    """

    runs: BucketRuns
    cx: Ints
    cy: Ints

    @classmethod
    def of(cls, x: Ints, y: Ints, side_mm: int, frame: Ints, instants: Columns, site: SiteTables) -> _Places:
        """Return where records are, given places, side of a cell and the row of `instants` of each."""
        return cls(BucketRuns.of(frame, instants, site), x // side_mm, y // side_mm)


def floor_cells(held: Held, site: SiteTables) -> Columns:
    """Return `facts/floor_cells`."""
    located, persons, pairs, instants = (held[r] for r in ("located", "in_violation", "pairs", "instants"))
    stood, close = (
        take(records, records["is_owned"] & (records["x_mm"] != NULL), *_OF_PERSON) for records in (located, persons)
    )
    is_met = is_close(pairs, site) & pairs["is_owned"]
    met = take(pairs, is_met & (pairs["x_a_mm"] != NULL) & (pairs["x_b_mm"] != NULL), *_OF_PAIR)
    side_mm = int(site.params["cell_mm"])
    places = [
        _Places.of(records["x_mm"], records["y_mm"], side_mm, records["_frame"], instants, site)
        for records in (stood, close)
    ]
    x, y = (met[f"{c}_a_mm"] + met[f"{c}_b_mm"] for c in "xy")  # twice that of the middle
    places.append(_Places.of(x, y, 2 * side_mm, met["_frame"], instants, site))
    numbers, cells_of, n = _numbered(places)
    counts = [np.bincount(records, minlength=n) for records in numbers]
    used = np.flatnonzero(counts[0] + counts[1] + counts[2])  # some people are in pairs only
    weight_ms = instants["weight_ms"]
    times = [
        _added(weight_ms, records["_frame"], at, n_of)
        for records, at, n_of in zip((stood, close), numbers, counts, strict=False)
    ]
    return {
        **cells_of(used),
        "person_records": counts[0][used],
        "exposure_ms": times[0][used],
        "violation_persons": counts[1][used],
        "violation_ms": times[1][used],
        "violation_records": counts[2][used],
    }


def cell_tracks(held: Held, site: SiteTables) -> Columns:
    """Return `facts/cell_tracks`."""
    located = held["located"]
    is_named = located["is_owned"] & (located["x_mm"] != NULL) & (located["track_id"] >= 0)
    stood = take(located, is_named, *_OF_PERSON, "track_id")
    side_mm = int(site.params["cell_mm"])
    places = _Places.of(stood["x_mm"], stood["y_mm"], side_mm, stood["_frame"], held["instants"], site)
    (number,), cells_of, n = _numbered([places])
    n_of_cell = _n_tracks(number, stood["track_id"], places.runs.starts, n, site.n_tracks)
    used = np.flatnonzero(n_of_cell)
    return {**cells_of(used), "n_tracks": n_of_cell[used]}


def _added(weight_ms: Ints, frame: Ints, cell: Ints, n_of: Ints) -> Ints:
    """Return the sum of the weights in each cell.

    Most frames count as long as the first one, so only what others differ from it is added up record by record.

    Args:
        weight_ms: Weight of each frame.
        frame: Frame of each record.
        cell: Cell of each record.
        n_of: Number of records of each cell.
    """
    usual = int(weight_ms[0]) if len(weight_ms) else 0
    total_ms = usual * n_of
    is_other = weight_ms != usual
    if is_other.any():
        others = np.flatnonzero(picked(is_other, frame))
        np.add.at(total_ms, cell[others], weight_ms[frame[others]] - usual)
    return total_ms


def _numbered(places: list[_Places]) -> tuple[list[Ints], Callable[[Ints], Columns], int]:
    """Return the number of the cell of each record, what tells hour, camera, bucket and place of cells, and how many.

    Numbers are in order of the fact.
    """
    groups, cameras, buckets = numbered([records.runs for records in places])
    if not len(cameras):
        return [cameras] * len(places), lambda _: dict.fromkeys(_KEYS, cameras), 0
    n_cameras = int(cameras.max()) + 1
    (x0, n_x), (y0, n_y) = (_extents(places, c, n_cameras) for c in ("cx", "cy"))
    height = int(n_y.max())  # one for all cameras, so that records need not look it up
    n_cells = n_x[cameras] * height
    ends = np.cumsum(n_cells)
    if ends[-1] > _ROOM * sum(len(records.cx) for records in places):
        return _sorted(places, groups, cameras, buckets)
    first = ends - n_cells
    at_zero = first - x0[cameras] * height - y0[cameras]
    numbers = []
    for records, group in zip(places, groups, strict=True):
        number = np.multiply(records.cx, height, dtype=np.int64)
        number += records.cy
        number += records.runs.each(at_zero[group])
        numbers.append(number)

    def cells_of(used: Ints) -> Columns:
        n_used = np.diff(np.searchsorted(used, ends), prepend=0)
        camera, bucket, at = (np.repeat(records, n_used) for records in (cameras, buckets, at_zero))
        x = (used - np.repeat(first, n_used)) // height + x0[camera]
        return _cells(camera, bucket, x, used - at - x * height)

    return numbers, cells_of, int(ends[-1])


def _cells(camera: Ints, bucket: Ints, cx: Ints, cy: Ints) -> Columns:
    return dict(zip(_KEYS, (bucket // 4, camera, bucket, cx, cy), strict=True))


def _extents(places: list[_Places], column: str, n_cameras: int) -> tuple[Ints, Ints]:
    """Return the least cell of each camera along one axis, and how many there are up to the greatest."""
    low, high = np.full(n_cameras, 2**40, dtype=np.int64), np.full(n_cameras, -(2**40), dtype=np.int64)
    for records in places:
        np.minimum.at(low, records.runs.camera_id, least(getattr(records, column), records.runs.starts))
        np.maximum.at(high, records.runs.camera_id, greatest(getattr(records, column), records.runs.starts))
    return low, np.maximum(high - low + 1, 0)


def _sorted(
    places: list[_Places], groups: list[Ints], cameras: Ints, buckets: Ints
) -> tuple[list[Ints], Callable[[Ints], Columns], int]:
    """Do what `_numbered` does, with numbers for those cells only that have records."""
    group = np.concatenate([records.runs.each(own) for records, own in zip(places, groups, strict=True)])
    cx, cy = (np.concatenate([getattr(records, c) for records in places]) for c in ("cx", "cy"))
    order, starts = grouped_by(group, cx, cy)
    number = np.empty(len(order), dtype=np.int64)
    number[order] = run_of(starts, len(order))
    at = order[starts]
    cells = _cells(cameras[group[at]], buckets[group[at]], cx[at], cy[at])
    return (
        np.split(number, np.cumsum([len(records.cx) for records in places])[:-1]),
        lambda used: take(cells, used),
        len(at),
    )


def _n_tracks(cell: Ints, track: Ints, starts: Ints, n_cells: int, n_tracks: int) -> Ints:
    """Return how many different tracks have a record in each cell.

    Runs of records of a camera and bucket have cells of their own. So a few runs are counted at a time, in tables that
    fit into the caches.

    Args:
        cell: Number of the cell of each record.
        track: Its track.
        starts: First row of each run.
        n_cells: Number of cells.
        n_tracks: Number of tracks.
    """
    at = np.unique(np.searchsorted(starts, np.arange(0, len(cell), _COUNTED_AT_ONCE)))
    edges = [*starts[at[at < len(starts)]].tolist(), len(cell)]
    counts = np.zeros(n_cells, dtype=np.int64)
    for first, after in pairwise(edges):
        cells, own = cell[first:after], track[first:after]
        np.add.at(counts, cells[one_of_each(cells * np.int64(n_tracks) + own)], 1)
    return counts
