"""The person records of a part of a floor, as arrays in the order of people's paths."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta
from typing import Any, Final, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from vsd_analytics.warehouse.dimensions import QUARTER_MS
from vsd_analytics.warehouse.warehouse import Warehouse

Floats: TypeAlias = NDArray[np.float64]
Ints: TypeAlias = NDArray[np.int64]
Bools: TypeAlias = NDArray[np.bool_]
Box: TypeAlias = tuple[float, float, float, float]
"""Least x, least y, largest x, largest y, floor metres."""
ALONE: Final = -1
"""Company of a person who walks with nobody."""
MAX_GAP_INTERVALS: Final = 2.5
"""Records of one person are joined by a straight line up to this many frame intervals (`gap_intervals` of episodes)."""

_RECORDS: Final = """
select
    located.camera_id, located.track_id, located.ts_ms, located.x_mm, located.y_mm, located.weight_ms,
    located.is_owned, site_days.site_day, calendar.local_date
from located
inner join calendar on located.ts_ms // $quarter_ms = calendar.quarter
inner join site_days on located.ts_ms // $quarter_ms = site_days.quarter
inner join cameras on located.camera_id = cameras.camera_id
where
    cameras.floor_id = $floor and calendar.local_date between $first and $last and calendar.is_open
    and located.x_mm between $left and $right and located.y_mm between $low and $high
"""
_COMPANIONS: Final = """
select pair_days.camera_id, pair_days.site_day, pair_days.track_a, pair_days.track_b
from pair_days
inner join track_days as a
    on pair_days.camera_id = a.camera_id and pair_days.site_day = a.site_day and pair_days.track_a = a.track_id
inner join track_days as b
    on pair_days.camera_id = b.camera_id and pair_days.site_day = b.site_day and pair_days.track_b = b.track_id
cross join params
where
    2 * pair_days.near_share >= 1
    and pair_days.n_records >= params.together_min_records
    and pair_days.n_records >= params.together_share * least(a.n_records, b.n_records)
    and pair_days.site_day between $first and $last
"""
"""Pairs close for most of the shorter life. Those who walk together by the rule of M9 are among them; that rule asks
both lives, and so misses companions of whom one is seen longer, whom a replay must not part."""


@dataclass(frozen=True, slots=True)
class FloorRecords:
    """Person records in opening hours, sorted by person and time; all arrays of shape (n_records,).

    Attributes:
        track: Person: number of the track id of one camera and site day.
        camera: Number of the camera in `camera_ids`.
        t_s: Seconds since 1970, UTC.
        x_m, y_m: Floor metres.
        weight_s: Person-time of the record, seconds.
        is_owned: This camera counts the place; others see it too.
        company: Number of the people whom the person stays with; `ALONE` without any.
        day: Local day, as `date.toordinal`.
        frame: Number of the camera's frame: records of one frame were seen at once.
        camera_ids: Ids of the cameras.
        interval_s: Median time between a person's records, seconds.
    """

    track: Ints
    camera: Ints
    t_s: Floats
    x_m: Floats
    y_m: Floats
    weight_s: Floats
    is_owned: Bools
    company: Ints
    day: Ints
    frame: Ints
    camera_ids: tuple[str, ...]
    interval_s: float

    @property
    def joins_next(self) -> Bools:
        """Return whether a record and the next one are of one person without a gap, shape (n_records - 1,)."""
        is_same = self.track[1:] == self.track[:-1]
        return np.asarray(is_same & (np.diff(self.t_s) <= MAX_GAP_INTERVALS * self.interval_s))


def floor_records(
    *, track: Any, camera: Any, t_s: Any, x_m: Any, y_m: Any, weight_s: Any = None, is_owned: Any = None,
    company: Any = None, day: Any = None, camera_ids: tuple[str, ...] = ("",),
) -> FloorRecords:  # fmt: skip
    """Return records in the order of paths.

    Args:
        track: As the attribute, in any order, as all others.
        camera: As the attribute.
        t_s: As the attribute.
        x_m: As the attribute.
        y_m: As the attribute.
        weight_s: None = the median interval.
        is_owned: None = all.
        company: None = nobody walks with anybody.
        day: None = one day.
        camera_ids: Ids of the cameras.
    """
    track, camera = np.asarray(track, np.int64), np.asarray(camera, np.int64)
    order = np.lexsort((t_s, track))
    n = order.size
    track, camera, t_s = track[order], camera[order], np.asarray(t_s, np.float64)[order]
    steps = np.diff(t_s)[track[1:] == track[:-1]]
    steps = steps[steps > 0]
    interval_s = float(np.median(steps)) if steps.size else 1.0

    def column(values: Any, default: Any, kind: Any) -> Any:
        return np.full(n, default, kind) if values is None else np.asarray(values, kind)[order]

    instants, frame = np.unique(np.round(t_s * 1000).astype(np.int64), return_inverse=True)
    return FloorRecords(
        track=track, camera=camera, t_s=t_s, x_m=column(x_m, 0, np.float64), y_m=column(y_m, 0, np.float64),
        weight_s=column(weight_s, interval_s, np.float64), is_owned=column(is_owned, True, np.bool_),
        company=column(company, ALONE, np.int64), day=column(day, 0, np.int64),
        frame=frame.ravel() + camera * instants.size, camera_ids=camera_ids, interval_s=interval_s,
    )  # fmt: skip


def records_of(warehouse: Warehouse, floor_id: str, first: date, last: date, box: Box) -> FloorRecords:
    """Return the records of a part of a floor in opening hours.

    A record without a track id is a person of its own, who walks nowhere.

    Args:
        warehouse: Its days.
        floor_id: The floor.
        first: First local day.
        last: Last local day, inclusive.
        box: The part.
    """
    left, low, right, high = (round(1000 * side) for side in box)
    asked = {"floor": floor_id, "first": first, "last": last}
    rows = warehouse.table(
        _RECORDS, asked | {"left": left, "low": low, "right": right, "high": high, "quarter_ms": QUARTER_MS}
    )
    columns = {n: rows[n].to_numpy() for n in ("ts_ms", "x_mm", "y_mm", "weight_ms", "is_owned")}
    camera_ids, camera = _codes(rows["camera_id"])
    names, name = _codes(rows["track_id"])
    site_day = rows["site_day"].cast(pa.int32()).to_numpy().astype(np.int64)
    track = _numbered(camera, site_day, name, n_names=len(names))
    unnamed = np.flatnonzero(track == ALONE)
    track[unnamed] = ALONE - 1 - unnamed
    pairs = warehouse.table(_COMPANIONS, {"first": first - timedelta(days=1), "last": last})
    own_day = pairs["site_day"].cast(pa.int32()).to_numpy().astype(np.int64)
    own_camera = _places(pairs["camera_id"], camera_ids)
    both = [
        _numbered(own_camera, own_day, _places(pairs[c], names), n_names=len(names)) for c in ("track_a", "track_b")
    ]
    return floor_records(
        track=track, camera=camera, t_s=columns["ts_ms"] / 1000, x_m=columns["x_mm"] / 1000,
        y_m=columns["y_mm"] / 1000, weight_s=columns["weight_ms"] / 1000, is_owned=columns["is_owned"],
        company=companies(track, *both), camera_ids=camera_ids,
        day=rows["local_date"].cast(pa.int32()).to_numpy().astype(np.int64) + date(1970, 1, 1).toordinal(),
    )  # fmt: skip


def companies(track: Ints, one: Ints, other: Ints) -> Ints:
    """Return the number of the company of each record's person; `ALONE` without any.

    Args:
        track: Person of each record, shape (n_records,).
        one: Person of each pair who stay together, shape (n_pairs,); a negative number is nobody here.
        other: The other one.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    people, at = np.unique(track, return_inverse=True)
    first, second = (np.minimum(np.searchsorted(people, pair), people.size - 1) for pair in (one, other))
    if not people.size or not first.size:
        return np.full(track.size, ALONE, np.int64)
    here = (people[first] == one) & (people[second] == other) & (one >= 0) & (other >= 0)
    links = coo_matrix((np.ones(int(here.sum())), (first[here], second[here])), shape=(people.size, people.size))
    group = connected_components(links, directed=False)[1].astype(np.int64)
    return np.where(np.bincount(group)[group] > 1, group, ALONE)[at.ravel()]


def _codes(column: pa.ChunkedArray) -> tuple[tuple[str, ...], Ints]:
    """Return the different texts of a column, and the number of each row's among them; -1 = null."""
    encoded = column.cast(pa.string()).combine_chunks().dictionary_encode()
    numbers = encoded.indices.fill_null(-1).to_numpy(zero_copy_only=False)
    return tuple(encoded.dictionary.to_pylist()), numbers.astype(np.int64)


def _places(column: pa.ChunkedArray, known: tuple[str, ...]) -> Ints:
    """Return the number of each text of a column among known ones; -1 = none."""
    positions = pc.index_in(column.cast(pa.string()), value_set=pa.array(known, pa.string())).fill_null(-1)
    return np.asarray(positions.to_numpy(), np.int64)


def _numbered(camera: Ints, site_day: Ints, name: Ints, *, n_names: int) -> Ints:
    """Return the number of a person: a track id of one camera and site day; `ALONE` without one."""
    number = (camera * 4_000_000 + site_day) * max(n_names, 1) + name
    return np.where((name < 0) | (camera < 0), ALONE, number)
