"""Stays that a moved fixture takes along: whom they leave at its old place, and whom they come close to at the new one.

People stay at a fixture because of it: once it is gone, nobody stays there, and a share of them, which the user states,
stays at its new place instead, at the same time of day and as long. All others walk as recorded.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely

from vsd_analytics.site.layout import FixtureEdit
from vsd_analytics.whatif.arrays import Floats, Ints, n_different
from vsd_analytics.whatif.closeness import n_close
from vsd_analytics.whatif.detours import CLEARANCE_M, inside_of
from vsd_analytics.whatif.floor_records import ALONE, FloorRecords
from vsd_analytics.whatif.frame_pairs import FramePairs
from vsd_analytics.whatif.place_times import PlaceTime
from vsd_analytics.whatif.ranges import MIN_CLOSE_S, PredictedChange, predicted_change, spread

STAY_M: Final = 1.5
STAY_S: Final = 10.0
STAY_M_PER_S: Final = 0.4
"""Whoever spends 10 s within 1.5 m of a fixture slower than 0.4 m/s stays at it."""
APART_M: Final = (None, CLEARANCE_M, 1.0)
"""How far from the new place people stay, by model; None: as far as from the old one."""
_CELL_M: Final = 0.25
_STAND_M: Final = 0.05
_WALKED: Final = 3
"""Records in a cell from which people stand there."""


@dataclass(frozen=True, slots=True)
class Stays:
    """People who stay at a fixture that is moved or removed.

    Attributes:
        n_people: Tracks.
        stay_s: Person-seconds that they stay.
        close_s: Of these, too close to somebody.
        n_moved: Those who would stay at its new place, by the share stated; None where none is.
    """

    n_people: int
    stay_s: float
    close_s: float
    n_moved: int | None


@dataclass(frozen=True, slots=True)
class MovedStays:
    """What stays that move do to a place.

    Attributes:
        n_leave: Tracks that stayed in it, at the old place of the fixture.
        n_come: Tracks that would stay in it, or so near that people in it come too close to them.
        change: Of its time too close, by these stays alone; None where too little time says nothing.
    """

    n_leave: int
    n_come: int
    change: PredictedChange | None


@dataclass(frozen=True, slots=True)
class _MoreTime:
    """Records whose time too close changes.

    Attributes:
        x_m, y_m: Where they are.
        day: Their days.
        more_s: Person-seconds too close, after less before.
    """

    x_m: Floats
    y_m: Floats
    day: Ints
    more_s: Floats


def people_who_stay(records: FloorRecords, edit: FixtureEdit, *, within_m: float) -> Stays:
    """Return who stays at the old place of a fixture.

    Args:
        records: People around it.
        edit: The edit.
        within_m: The distance that counts.
    """
    rows = _staying(records, edit)
    n = n_different(records.track[rows])
    moved = None if edit.follow_share is None else round(edit.follow_share * n)
    is_close = n_close(records.frames, records.x_m, records.y_m, within_m=within_m)[rows] > 0
    weight_s = records.weight_s[rows]
    return Stays(n, float(weight_s.sum()), float((weight_s * is_close).sum()), moved)


def _staying(records: FloorRecords, edit: FixtureEdit) -> Ints:
    """Return the rows of people who stay at the old place of a fixture."""
    near = inside_of(shapely.Polygon(edit.old_polygon).buffer(STAY_M), records.x_m, records.y_m)
    slow = np.zeros(near.size, np.bool_)
    way_m = np.hypot(np.diff(records.x_m), np.diff(records.y_m))
    slow[1:] = records.joins_next & (way_m < STAY_M_PER_S * np.maximum(np.diff(records.t_s), 1e-9))
    rows = np.flatnonzero(near & slow & records.is_owned)
    people, person = np.unique(records.track[rows], return_inverse=True)
    of_person = np.bincount(person.ravel(), weights=records.weight_s[rows], minlength=people.size)
    return rows[(of_person >= STAY_S)[person.ravel()]]


def moved_stays(
    old: FloorRecords, new: FloorRecords, edit: FixtureEdit, areas: Mapping[str, shapely.Polygon],
    places: Mapping[str, PlaceTime], *, within_m: float,
) -> dict[str, MovedStays]:  # fmt: skip
    """Return what the stays that leave and come do to each place, by its key; those they do not touch are left out.

    Args:
        old: People around the old place of the fixture.
        new: People around its new place.
        edit: The edit, with the share that follows.
        areas: Areas, by id, and the floor, by its key (an empty polygon = everywhere).
        places: What was recorded there, by the same keys.
        within_m: The distance that counts.
    """
    if edit.old_polygon is None or edit.new_polygon is None or edit.follow_share is None:
        return {}
    stays = _staying(old, edit)
    left = _left(old, stays, within_m)
    rows = _followers(old, stays, edit.follow_share)
    spots = list(_spots(old, rows, new, edit)) if rows.size else []
    came = list(_came(old, rows, new, spots, within_m)) if spots else []
    days = np.unique(np.r_[old.day, new.day])
    moved: dict[str, MovedStays] = {}
    for key, shape in areas.items():
        n_leave = n_different(old.track[stays[inside_of(shape, old.x_m[stays], old.y_m[stays])]])
        reach = shape if shape.is_empty else shape.buffer(within_m)
        n_come = max((n_different(old.track[rows[inside_of(reach, *spot)]]) for spot in spots), default=0)
        if key in places and (n_leave or n_come):
            time = places[key]
            more_s = [_of_days(shape, left, days) + sum(_of_days(shape, c, days) for c in one) for one in came]
            change = _change(more_s or [_of_days(shape, left, days)], time, within_m)
            moved[key] = MovedStays(n_leave, n_come, change)
    return moved


def _left(old: FloorRecords, stays: Ints, within_m: float) -> _MoreTime:
    """Return the time too close that goes with the stays: their own, and that of people close to nobody else."""
    before = n_close(old.frames, old.x_m, old.y_m, within_m=within_m) > 0
    frame = old.frame.copy()
    frame[stays] = -1 - stays
    after = n_close(FramePairs(frame), old.x_m, old.y_m, within_m=within_m) > 0
    rows = np.flatnonzero(before != after)
    weight_s = (old.weight_s * old.is_owned)[rows]
    return _MoreTime(old.x_m[rows], old.y_m[rows], old.day[rows], -weight_s)


def _followers(old: FloorRecords, stays: Ints, share: float) -> Ints:
    """Return the stays of those who go along: evenly in the order in which they came, companies whole."""
    track, company = old.track[stays], old.company[stays]
    parties, first, party = np.unique(
        np.where(company == ALONE, -2 - track, company), return_index=True, return_inverse=True
    )
    rank = np.empty(parties.size, np.int64)
    rank[np.argsort(old.t_s[stays][first], kind="stable")] = np.arange(parties.size)
    goes = np.floor((rank + 1) * share) > np.floor(rank * share)
    goes_along: Ints = stays[goes[party.ravel()]]
    return goes_along


def _spots(old: FloorRecords, rows: Ints, new: FloorRecords, edit: FixtureEdit) -> Iterator[tuple[Floats, Floats]]:
    """Yield where the stays are at the new place, for each way to stand there: only on floor where people walk."""
    from scipy.spatial import cKDTree

    before, after = shapely.Polygon(edit.old_polygon), shapely.convex_hull(shapely.Polygon(edit.new_polygon))
    shift = shapely.get_coordinates(after.centroid)[0] - shapely.get_coordinates(before.centroid)[0]
    stood, _, cell = _cells(old.x_m[rows] + shift[0], old.y_m[rows] + shift[1], _STAND_M)
    walked, n, _ = _cells(new.x_m, new.y_m, _CELL_M)
    walked = walked[(n >= _WALKED) & (shapely.distance(after, shapely.points(walked)) >= CLEARANCE_M)]
    if not walked.size:
        return
    tree = cKDTree(walked)
    for apart_m in APART_M:
        spots = stood.copy()
        wrong = shapely.distance(after, shapely.points(spots)) < CLEARANCE_M
        chosen = wrong if apart_m is None else np.ones(wrong.size, np.bool_)
        edge = after.buffer(apart_m or CLEARANCE_M).exterior
        at = shapely.line_locate_point(edge, shapely.points(spots[chosen]))
        spots[chosen] = shapely.get_coordinates(shapely.line_interpolate_point(edge, at))
        far_m, nearest = tree.query(spots)
        is_off = far_m > _CELL_M
        spots[is_off] = walked[np.asarray(nearest)[is_off]]
        yield spots[cell, 0], spots[cell, 1]


def _cells(x_m: Floats, y_m: Floats, side_m: float) -> tuple[Floats, Ints, Ints]:
    """Return the middles of the squares in which places lie, how many in each, and the square of each place."""
    if not x_m.size:
        return np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros(0, np.int64)
    column, row = (np.floor(v / side_m).astype(np.int64) for v in (x_m, y_m))
    height = int(row.max()) - int(row.min()) + 1
    key = (column - column.min()) * height + (row - row.min())
    count = np.bincount(key)  # a square for each place of the part: sorting takes ten times as long
    used = np.flatnonzero(count)
    middles = np.column_stack([used // height + column.min(), used % height + row.min()])
    return (middles + 0.5) * side_m, count[used], (np.cumsum(count > 0) - 1)[key]


def _came(
    old: FloorRecords, rows: Ints, new: FloorRecords, spots: list[tuple[Floats, Floats]], within_m: float
) -> Iterator[tuple[_MoreTime, _MoreTime]]:
    """Yield the time too close that the stays bring, for each way to stand there: their own, and that of people there.

    They are seen there by the camera that sees most of it, in its frame nearest in time.
    """
    camera = int(np.bincount(new.camera[new.is_owned]).argmax()) if new.is_owned.any() else 0
    there = np.flatnonzero(new.camera == camera)
    times_s = np.unique(new.t_s[there])
    nearest = _nearest(times_s, old.t_s[rows], within=new.interval_s / 2 + 1e-6)
    frame_there = np.searchsorted(times_s, new.t_s[there])
    meets = np.isin(frame_there, nearest)
    there, frame_there = there[meets], frame_there[meets]
    _, alone = np.unique(old.t_s[rows], return_inverse=True)
    frame = np.r_[frame_there, np.where(nearest >= 0, nearest, times_s.size + alone.ravel())]
    before = n_close(FramePairs(frame_there), new.x_m[there], new.y_m[there], within_m=within_m) > 0
    for x_m, y_m in spots:
        every_x, every_y = np.r_[new.x_m[there], x_m], np.r_[new.y_m[there], y_m]
        close = n_close(FramePairs(frame), every_x, every_y, within_m=within_m) > 0
        others = there[close[: there.size] & ~before & new.is_owned[there]]
        own_s = old.weight_s[rows] * close[there.size :]
        yield (
            _MoreTime(x_m, y_m, old.day[rows], own_s),
            _MoreTime(new.x_m[others], new.y_m[others], new.day[others], new.weight_s[others]),
        )


def _nearest(known: Floats, wanted: Floats, *, within: float) -> Ints:
    """Return the place of the nearest number in a sorted array; -1 = none is near."""
    if not known.size:
        return np.full(wanted.size, -1)
    right = np.clip(np.searchsorted(known, wanted), 0, known.size - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.where(np.abs(known[left] - wanted) <= np.abs(known[right] - wanted), left, right)
    return np.where(np.abs(known[nearest] - wanted) <= within, nearest, -1)


def _of_days(shape: shapely.Geometry, more: _MoreTime, days: Ints) -> Floats:
    """Return the person-seconds of each day in a place."""
    weights = more.more_s * inside_of(shape, more.x_m, more.y_m)
    return np.bincount(np.searchsorted(days, more.day), weights=weights, minlength=days.size).astype(np.float64)


def _change(more_s: list[Floats], time: PlaceTime, within_m: float) -> PredictedChange | None:
    total_s = time.total_close_s
    if total_s < MIN_CLOSE_S:
        return None
    by_day = more_s[0] * more_s[0].size / total_s
    sd = spread(close_s=total_s, within_m=within_m, by_day=by_day)
    return predicted_change([float(s.sum()) / total_s for s in more_s], sd)
