"""The person records of a part of a floor, as arrays in the order of people's paths."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import date, timedelta
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, Final, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.warehouse.dimensions import QUARTER_MS
from vsd_analytics.warehouse.graphs import least_connected
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.whatif.arrays import Bools, Floats, Ints, in_order
from vsd_analytics.whatif.frame_pairs import FramePairs

Box: TypeAlias = tuple[float, float, float, float]
"""Least x, least y, largest x, largest y, floor metres."""
ALONE: Final = -1
"""Company of a person who walks with nobody."""
MAX_GAP_INTERVALS: Final = 2.5
"""Records of one person are joined by a straight line up to this many frame intervals (`gap_intervals` of episodes)."""

_CAMERAS: Final = "select camera_id from cameras where floor_id = $floor order by camera_id"
_QUARTERS: Final = """
select calendar.quarter, calendar.local_date, site_days.site_day
from calendar
inner join site_days on calendar.quarter = site_days.quarter
where calendar.is_open and calendar.local_date between $first and $last
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


@dataclass(frozen=True, eq=False)
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
        joins_next: Whether a record and the next one are of one person without a gap, shape (n_records - 1,).
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
    joins_next: Bools
    camera_ids: tuple[str, ...]
    interval_s: float

    @cached_property
    def frames(self) -> FramePairs:
        """Return what finds the records of a frame."""
        return FramePairs(self.frame)

    @cached_property
    def frames_of_cameras(self) -> tuple[tuple[Floats, Ints], ...]:
        """Return the instants of each camera's frames, in order, and the frames."""
        first = self.frames.order[self.frames.is_first]
        times = []
        for camera in range(len(self.camera_ids)):
            own = first[self.camera[first] == camera]
            own = own[np.argsort(self.t_s[own], kind="stable")]
            times.append((self.t_s[own], self.frame[own]))
        return tuple(times)

    @cached_property
    def day_numbers(self) -> tuple[Ints, Ints]:
        """Return the local days with records, in order, and the number of each record's among them."""
        first = int(self.day.min()) if self.day.size else 0
        is_day = np.bincount(self.day - first) > 0
        return np.flatnonzero(is_day) + first, (np.cumsum(is_day) - 1)[self.day - first]

    def days(self) -> Iterator[slice]:
        """Yield runs of records that share no person, no frame and no local day with others: days, one by one.

        Where people are there at midnight, days stay together.
        """
        last = np.maximum.accumulate(self.day)
        first = np.minimum.accumulate(self.day[::-1])[::-1]
        cuts = np.flatnonzero((last[:-1] < first[1:]) & (self.track[:-1] != self.track[1:])) + 1
        for begin, end in pairwise([0, *cuts.tolist(), self.track.size]):
            yield slice(begin, end)

    def part(self, rows: Ints) -> FloorRecords:
        """Return some records, in order; those join that did and follow each other still."""
        joins = (np.diff(rows) == 1) & self.joins_next[rows[:-1]]
        return replace(self, **{name: getattr(self, name)[rows] for name in _COLUMNS}, joins_next=joins)

    def passing(self, box: Box) -> Ints:
        """Return the rows of the records in a part of the floor, and of both ends of the steps that may touch it."""
        left, low, right, high = box
        x, y = self.x_m, self.y_m
        is_in = (x >= left) & (x <= right) & (y >= low) & (y <= high)
        misses = [np.maximum(v[1:], v[:-1]) < least for v, least in ((x, left), (y, low))]
        misses += [np.minimum(v[1:], v[:-1]) > most for v, most in ((x, right), (y, high))]
        steps = self.joins_next & ~np.logical_or.reduce(misses)
        is_in[:-1] |= steps
        is_in[1:] |= steps
        return np.flatnonzero(is_in)

    def within(self, box: Box) -> FloorRecords:
        """Return the records of a part of the floor; nothing is known of what lies outside of it."""
        rows = np.flatnonzero(_is_in(np.round(1000 * self.x_m), np.round(1000 * self.y_m), box))
        if rows.size == self.track.size:
            return self
        return _joined({name: getattr(self, name)[rows] for name in _COLUMNS}, self.camera_ids)


_COLUMNS: Final = ("track", "camera", "t_s", "x_m", "y_m", "weight_s", "is_owned", "company", "day", "frame")


def _joined(columns: dict[str, Any], camera_ids: tuple[str, ...]) -> FloorRecords:
    """Return records, given their columns in order of paths."""
    track, t_s = columns["track"], columns["t_s"]
    is_same, steps_s = track[1:] == track[:-1], np.diff(t_s)
    interval_s = float(np.median(steps_s[is_same & (steps_s > 0)])) if (is_same & (steps_s > 0)).any() else 1.0
    joins = is_same & (steps_s <= MAX_GAP_INTERVALS * interval_s)
    return FloorRecords(**columns, joins_next=joins, camera_ids=camera_ids, interval_s=interval_s)


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
    order = np.lexsort((t_s, track))
    n = order.size

    def column(values: Any, default: Any, kind: Any) -> Any:
        return np.full(n, default, kind) if values is None else np.asarray(values, kind)[order]

    at, numbers = column(t_s, 0, np.float64), column(camera, 0, np.int64)
    instants, frame = np.unique(np.round(at * 1000).astype(np.int64), return_inverse=True)
    records = _joined(
        {
            "track": column(track, 0, np.int64),
            "camera": numbers,
            "t_s": at,
            "x_m": column(x_m, 0, np.float64),
            "y_m": column(y_m, 0, np.float64),
            "weight_s": column(weight_s, 0, np.float64),
            "is_owned": column(is_owned, True, np.bool_),
            "company": column(company, ALONE, np.int64),
            "day": column(day, 0, np.int64),
            "frame": frame.ravel() + numbers * instants.size,
        },
        camera_ids,
    )
    return replace(records, weight_s=np.full(n, records.interval_s)) if weight_s is None else records


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
    cameras = warehouse.rows(_CAMERAS, {"floor": floor_id})
    camera_ids = tuple(row["camera_id"] for row in cameras)
    quarters = warehouse.table(_QUARTERS, {"first": first, "last": last})
    since = first - timedelta(days=1)
    pieces, n_frames = [], 0
    for rows in warehouse.person_records():
        pieces.append(_piece(rows, camera_ids, quarters, box, since))
        pieces[-1]["frame"] += n_frames
        n_frames += rows.num_rows
    names, name = _names([piece.pop("track_id") for piece in pieces])
    columns = {c: np.concatenate([_EMPTY[c], *(piece.pop(c) for piece in pieces)]) for c in _EMPTY}
    numbered = partial(_numbered, since=since, n_cameras=len(camera_ids), n_names=len(names))
    track = numbered(columns["camera"], columns.pop("site_day"), name)
    unnamed = np.flatnonzero(track == ALONE)
    track[unnamed] = ALONE - 1 - unnamed
    columns["track"] = track
    if np.any(track[1:] < track[:-1]):  # somebody is in two pieces, the second of which is later
        order = in_order(track)
        for c in columns:  # one after the other: each is large
            columns[c] = columns[c][order]
    pairs = warehouse.table(_COMPANIONS, {"first": since, "last": last})
    own_day = _days(pairs["site_day"])
    own_camera = _places(pairs["camera_id"], camera_ids)
    both = [numbered(own_camera, own_day, _places(pairs[c], names)) for c in ("track_a", "track_b")]
    return _joined({**columns, "company": companies(columns["track"], *both)}, camera_ids)


_EMPTY: Final[dict[str, Any]] = {
    "camera": np.zeros(0, np.int32), "t_s": np.zeros(0), "x_m": np.zeros(0), "y_m": np.zeros(0),
    "weight_s": np.zeros(0), "is_owned": np.zeros(0, np.bool_), "day": np.zeros(0, np.int32),
    "frame": np.zeros(0, np.int64), "site_day": np.zeros(0, np.int32),
}  # fmt: skip
"""Columns of no records."""


def _piece(rows: pa.Table, camera_ids: tuple[str, ...], quarters: pa.Table, box: Box, since: date) -> dict[str, Any]:
    """Return the records of a part of a floor, of some hours, in order of paths: `_EMPTY`, and their track ids."""
    camera = _places(rows["camera_id"], camera_ids)
    ts_ms = rows["ts_ms"].to_numpy()
    x_mm, y_mm = (rows[c].to_numpy() for c in ("x_mm", "y_mm"))  # unknown places are NaN, which no box holds
    known = quarters["quarter"].to_numpy()
    at = np.minimum(np.searchsorted(known, ts_ms // QUARTER_MS), max(known.size - 1, 0))
    is_here = (camera >= 0) & _is_in(x_mm, y_mm, box)
    is_here &= known[at] == ts_ms // QUARTER_MS if known.size else False
    here = np.flatnonzero(is_here)
    camera, ts_ms, at = camera[here], ts_ms[here], at[here]
    site_day = _days(quarters["site_day"])[at]
    track_ids = _encoded(rows["track_id"]).take(pa.array(here))
    name = track_ids.indices.fill_null(-1).to_numpy().astype(np.int64)
    instant = camera * 2**45 + ts_ms
    if np.any(instant[1:] < instant[:-1]):
        by_time = in_order(instant)
        frame = np.empty(here.size, np.int64)
        frame[by_time] = np.cumsum(np.diff(instant[by_time], prepend=-1) != 0)
    else:
        by_time, frame = np.arange(here.size), np.cumsum(np.diff(instant, prepend=-1) != 0)
    path = _numbered(camera, site_day, name, since=since, n_cameras=len(camera_ids), n_names=len(track_ids.dictionary))
    order = by_time[in_order(path[by_time])]
    here, at = here[order], at[order]
    return {
        "camera": camera[order],
        "t_s": ts_ms[order] / 1000,
        "x_m": x_mm[here] / 1000,
        "y_m": y_mm[here] / 1000,
        "weight_s": rows["weight_ms"].to_numpy()[here] / 1000,
        "is_owned": rows["is_owned"].to_numpy()[here],
        "day": _days(quarters["local_date"])[at] + date(1970, 1, 1).toordinal(),
        "frame": frame[order],
        "site_day": site_day[order],
        "track_id": track_ids.take(pa.array(order)),
    }


def _is_in(x_mm: Any, y_mm: Any, box: Box) -> Bools:
    left, low, right, high = (round(1000 * side) for side in box)
    return np.asarray((x_mm >= left) & (x_mm <= right) & (y_mm >= low) & (y_mm <= high))


def _days(column: pa.ChunkedArray) -> Ints:
    """Return days since 1970."""
    return np.asarray(column.cast(pa.int32()).to_numpy(), np.int64)


def companies(track: Ints, one: Ints, other: Ints) -> Ints:
    """Return the number of the company of each record's person; `ALONE` without any.

    Args:
        track: Person of each record, in order, shape (n_records,).
        one: Person of each pair who stay together, shape (n_pairs,); a negative number is nobody here.
        other: The other one.
    """
    if not track.size or not one.size:
        return np.full(track.size, ALONE, np.int64)
    starts = np.flatnonzero(np.r_[True, track[1:] != track[:-1]])
    people = track[starts]
    first, second = (np.minimum(np.searchsorted(people, pair), people.size - 1) for pair in (one, other))
    here = (people[first] == one) & (people[second] == other) & (one >= 0) & (other >= 0)
    group = least_connected(first[here], second[here], people.size)
    own = np.where(np.bincount(group, minlength=people.size)[group] > 1, group, ALONE)
    return np.repeat(own, np.diff(starts, append=track.size))


def _encoded(column: pa.ChunkedArray) -> pa.DictionaryArray:
    """Return texts as numbers of different ones."""
    whole = column.combine_chunks()
    whole = whole if pa.types.is_dictionary(whole.type) else whole.cast(pa.string()).dictionary_encode()
    return whole


def _names(columns: list[pa.DictionaryArray]) -> tuple[pa.Array, Ints]:
    """Return the different texts of columns, and the number of each row's among them; -1 = null."""
    every = pa.concat_arrays([pa.array([], pa.string()), *(c.dictionary.cast(pa.string()) for c in columns)])
    encoded = every.dictionary_encode()
    of_all, first = encoded.indices.to_numpy().astype(np.int64), 0
    numbers = [np.zeros(0, np.int64)]
    for column in columns:
        own = column.indices.fill_null(-1).to_numpy()
        size = len(column.dictionary)
        numbers.append(np.append(of_all[first : first + size], -1)[own])
        first += size
    return encoded.dictionary, np.concatenate(numbers)


def _places(column: pa.ChunkedArray, known: Any) -> Ints:
    """Return the number of each text of a column among known ones; -1 = none."""
    own = _encoded(column)
    place = pc.index_in(own.dictionary.cast(pa.string()), value_set=pa.array(known, pa.string())).fill_null(-1)
    numbers: Ints = np.append(np.asarray(place.to_numpy(), np.int64), -1)[own.indices.fill_null(-1).to_numpy()]
    return numbers


def _numbered(camera: Ints, site_day: Ints, name: Ints, *, since: date, n_cameras: int, n_names: int) -> Ints:
    """Return the number of a person: a track id of one camera and site day; `ALONE` without one."""
    day = site_day.astype(np.int64) - (since - date(1970, 1, 1)).days
    return np.where((name < 0) | (camera < 0), ALONE, (day * n_cameras + camera) * n_names + name)
