"""`floor_cells`: what happened in each cell of the floor, counted in tables that have a place for every cell.

In an hour a camera sees people in most cells of its view. So cells are numbered without sorting, where that needs no
more room than a few numbers for each record.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vsd_analytics.warehouse.accelerated.columns import greatest, grouped_by, least, one_of_each, run_of
from vsd_analytics.warehouse.accelerated.site_tables import BucketRuns, SiteTables, numbered
from vsd_analytics.warehouse.held import NULL, Bools, Columns, Held, Ints

_ROOM = 4
"""Numbers a record may take of a table with every cell; where it is more, records are sorted."""
_COUNTED_AT_ONCE = 30_000


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
    def of(cls, records: Columns, cx: Ints, cy: Ints, site: SiteTables) -> _Places:
        """Return where records are, given camera and instant of each and its cell."""
        return cls(BucketRuns.of(records["camera_id"], records["ts_ms"], site), cx, cy)


def floor_cells(held: Held, site: SiteTables) -> Columns:
    """Return `facts/floor_cells`."""
    located, persons, pairs = held["located"], held["in_violation"], held["pairs"]
    cell_mm = int(site.params["cell_mm"])
    stood = _chosen(located, located["is_owned"] & (located["x_mm"] != NULL))
    close = _chosen(persons, persons["is_owned"] & (persons["x_mm"] != NULL))
    is_met = (pairs["distance_mm"] < site.params["distance_mm"]) & pairs["is_owned"]
    met = _chosen(pairs, is_met & (pairs["x_a_mm"] != NULL) & (pairs["x_b_mm"] != NULL))
    people = [_Places.of(of, of["x_mm"] // cell_mm, of["y_mm"] // cell_mm, site) for of in (stood, close)]
    cx, cy = ((met[f"{c}_a_mm"] + met[f"{c}_b_mm"]) // (2 * cell_mm) for c in "xy")
    numbers, cells = _numbered([*people, _Places.of(met, cx, cy, site)])
    n = len(cells["cx"])
    counts = [np.bincount(of, minlength=n) for of in numbers]
    found = {
        "hour": cells["bucket_quarter"] // 4,
        **cells,
        "person_records": counts[0],
        "exposure_ms": _added(stood["weight_ms"], numbers[0], n),
        "violation_persons": counts[1],
        "violation_ms": _added(close["weight_ms"], numbers[1], n),
        "violation_records": counts[2],
        "n_tracks": _n_tracks(numbers[0], stood["track_id"], people[0].runs.starts, n, site.n_tracks),
    }
    used = np.flatnonzero(counts[0] + counts[1] + counts[2])
    return found if len(used) == n else {name: values[used] for name, values in found.items()}


def _chosen(columns: Columns, is_chosen: Bools) -> Columns:
    """Return some rows of the columns that are read here; all rows as they are."""
    read = [c for c in columns if c.endswith("_mm") or c in ("camera_id", "ts_ms", "track_id", "weight_ms")]
    if is_chosen.all():
        return {c: columns[c] for c in read}
    rows = np.flatnonzero(is_chosen)
    return {c: columns[c][rows] for c in read}


def _added(values: Ints, at: Ints, n: int) -> Ints:
    found = np.zeros(n, dtype=np.int64)
    np.add.at(found, at, values)
    return found


def _numbered(places: list[_Places]) -> tuple[list[Ints], Columns]:
    """Return the number of the cell of each record, and camera, bucket and place of all cells, in order of the fact."""
    groups, cameras, buckets = numbered([of.runs for of in places])
    if not len(cameras):
        return [of.cx for of in places], dict.fromkeys(("camera_id", "bucket_quarter", "cx", "cy"), cameras)
    n_cameras = int(cameras.max()) + 1
    (x0, n_x), (y0, n_y) = (_extents(places, c, n_cameras) for c in ("cx", "cy"))
    height = int(n_y.max())  # one for all cameras, so that records need not look it up
    n_cells = n_x[cameras] * height
    ends = np.cumsum(n_cells)
    if ends[-1] > _ROOM * sum(len(of.cx) for of in places):
        return _sorted(places, groups, cameras, buckets)
    first = ends - n_cells
    at_zero = first - x0[cameras] * height - y0[cameras]
    numbers = []
    for of, group in zip(places, groups, strict=True):
        number = of.cx * height
        number += of.cy
        number += of.runs.each(at_zero[group])
        numbers.append(number)
    group = np.repeat(np.arange(len(cameras)), n_cells)
    camera = cameras[group]
    x, y = np.divmod(np.arange(ends[-1]) - first[group], height)
    return numbers, {"camera_id": camera, "bucket_quarter": buckets[group], "cx": x + x0[camera], "cy": y + y0[camera]}


def _extents(places: list[_Places], column: str, n_cameras: int) -> tuple[Ints, Ints]:
    """Return the least cell of each camera along one axis, and how many there are up to the greatest."""
    low, high = np.full(n_cameras, 2**40, dtype=np.int64), np.full(n_cameras, -(2**40), dtype=np.int64)
    for of in places:
        np.minimum.at(low, of.runs.camera_id, least(getattr(of, column), of.runs.starts))
        np.maximum.at(high, of.runs.camera_id, greatest(getattr(of, column), of.runs.starts))
    return low, np.maximum(high - low + 1, 0)


def _sorted(places: list[_Places], groups: list[Ints], cameras: Ints, buckets: Ints) -> tuple[list[Ints], Columns]:
    """Do what `_numbered` does, with numbers for those cells only that have records."""
    group = np.concatenate([of.runs.each(own) for of, own in zip(places, groups, strict=True)])
    cx, cy = (np.concatenate([getattr(of, c) for of in places]) for c in ("cx", "cy"))
    order, starts = grouped_by(group, cx, cy)
    number = np.empty(len(order), dtype=np.int64)
    number[order] = run_of(starts, len(order))
    at = order[starts]
    cells = {"camera_id": cameras[group[at]], "bucket_quarter": buckets[group[at]], "cx": cx[at], "cy": cy[at]}
    return np.split(number, np.cumsum([len(of.cx) for of in places])[:-1]), cells


def _n_tracks(cell: Ints, track: Ints, starts: Ints, n_cells: int, n_tracks: int) -> Ints:
    """Return how many different tracks have a record in each cell.

    Runs of records of a camera and bucket have cells of their own. So a few runs are counted at a time, in tables that
    fit into the caches.

    Args:
        cell: Number of the cell of each record.
        track: Its track, negative where it has none.
        starts: First row of each run.
        n_cells: Number of cells.
        n_tracks: Number of tracks.
    """
    at = np.unique(np.searchsorted(starts, np.arange(0, len(cell), _COUNTED_AT_ONCE)))
    edges = [*starts[at[at < len(starts)]].tolist(), len(cell)]
    found = np.zeros(n_cells, dtype=np.int64)
    for first, after in pairwise(edges):
        of, own = cell[first:after], track[first:after]
        if own.min() < 0:
            of, own = of[own >= 0], own[own >= 0]
        np.add.at(found, of[one_of_each(of * np.int64(n_tracks) + own)], 1)
    return found
