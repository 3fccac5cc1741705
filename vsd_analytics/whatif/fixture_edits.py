"""A fixture that is added, moved or removed: whom it touches, what stays free, how time too close may change there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, TypeAlias

import numpy as np
import shapely

from vsd_analytics.answer import Reason
from vsd_analytics.site.layout import FixtureEdit
from vsd_analytics.site.model import Fixture, Point
from vsd_analytics.whatif.arrays import Bools, Floats, Ints, n_different
from vsd_analytics.whatif.closeness import (
    distances,
    n_close_after,
    n_close_recorded,
    near_strangers,
    nearest_strangers,
    stepped_aside,
)
from vsd_analytics.whatif.detours import APPROACH_M, CLEARANCE_M, Detours, detours, inside_of
from vsd_analytics.whatif.floor_records import Box, FloorRecords
from vsd_analytics.whatif.free_ways import FreeWay, free_ways
from vsd_analytics.whatif.place_times import PlaceTime, recorded_place
from vsd_analytics.whatif.ranges import MIN_CLOSE_S, NO_CHANGE, PredictedChange, predicted_change, spread
from vsd_analytics.whatif.retiming import BEYOND_M, StepAside, halves, step_aside
from vsd_analytics.whatif.stays import STAY_M, MovedStays, Stays, moved_stays

AROUND_M: Final = 4.0
"""How far from a fixture its effect was measured."""
NOBODY_M: Final = 2.0
"""An edit that nobody comes nearer to than this changes nothing."""
LEAST_DISTANCE_M: Final = 1.5
"""At 1 m the models contradict each other; ranges were measured at 2 m."""
MODELS: Final = ((CLEARANCE_M, APPROACH_M), (0.2, 1.5), (0.5, 3.5))
"""Clearance and approach of each way in which people may pass; each is tried with and without the site's step aside."""
TOUCHED_SD: Final = 0.2
"""Standard deviation of the change beside the models', times the share of the people near whom a fixture touches: in
scenes of another simulator, people who go around it slow down, and bring others closer."""
MOST_WITHOUT_WAY: Final = 0.05
"""Share of the people touched who may be without a way around; they are replayed as recorded."""
Model: TypeAlias = tuple[Floats, Floats, Bools]
"""Where those who may be concerned are, x and y, and who of them is too close."""
Move: TypeAlias = tuple[Ints, Floats, Floats]
"""Rows of those who walk elsewhere, and their x and y."""
AROUND: Final = "around"
"""Key of the floor within `AROUND_M` of the edit."""


@dataclass(frozen=True, slots=True)
class PredictedPlace:
    """How the time too close in a place may change.

    Attributes:
        place_id: `AROUND`, the id of an area, or the key of the floor.
        recorded: What was recorded there.
        change: Its range; None where none is given.
        refusal: Why not.
        free_m2: Floor without fixtures before and after; None where the edit changes none of it.
        stays: What stays that move with the fixture do to it, part of `change`; None where they do nothing.
    """

    place_id: str
    recorded: PlaceTime
    change: PredictedChange | None
    refusal: Reason | None
    free_m2: tuple[float, float] | None = None
    stays: MovedStays | None = None


@dataclass(frozen=True, slots=True)
class FixtureEffect:
    """What a fixture edit does.

    Attributes:
        n_near: Tracks within `AROUND_M` of the new place, or of the old one of what is removed.
        n_touched: Of these, those whose path it blocks.
        n_standing, n_no_way: Of these, those who stand there, and those with no way around.
        ways: Ways beside it.
        places: Time too close around it and in the areas there.
        stays: At its old place; None where it is added.
        aside: The site's step aside.
        refusal: Why no change is given anywhere; None where one is.
        touched_by_day: Those whose path it blocks, by local day (`date.toordinal`).
    """

    n_near: int
    n_touched: int
    n_standing: int
    n_no_way: int
    ways: tuple[FreeWay, ...]
    places: tuple[PredictedPlace, ...]
    stays: Stays | None
    aside: StepAside | None
    refusal: Reason | None
    touched_by_day: Mapping[int, int] = field(default_factory=dict)


def fixture_effect(
    records: FloorRecords, edit: FixtureEdit, others: tuple[Fixture, ...], areas: Mapping[str, shapely.Polygon],
    places: Mapping[str, PlaceTime], *, within_m: float, widths_m: tuple[float, ...], stays: Stays | None = None,
) -> FixtureEffect:  # fmt: skip
    """Return what a fixture edit does to the people recorded around it.

    Args:
        records: People of the first of `boxes_around`.
        edit: The edit.
        others: The other fixtures of the floor.
        areas: Areas, by id, and the floor, by its key (`place_times.floor_key`; an empty polygon = everywhere).
        places: What was recorded there, by the same keys.
        within_m: The distance that counts.
        widths_m: Clear widths that a way should have.
        stays: People at its old place (`people_who_stay`); None where it is added.
    """
    before = n_close_recorded(records, within_m=within_m)
    is_close = before > 0
    place = shapely.Polygon(edit.new_polygon or edit.old_polygon)
    around = shapely.convex_hull(place).buffer(AROUND_M)
    rows = records.passing(around.bounds)  # no way leads farther aside than this, and no way beside the fixture is
    near = records.part(rows)
    inside = inside_of(around, near.x_m, near.y_m)
    taken = shapely.union_all([shapely.Polygon(f.polygon) for f in others]) if others else None
    free_m2 = _free_m2(around, taken, edit)
    here = {AROUND: recorded_place(near, inside, is_close[rows])}
    here |= {key: places[key] for key, shape in areas.items() if key in places and _meets(shape, around)}
    shapes = {AROUND: around, **areas}
    n_near = n_different(near.track[inside])
    refusal: Reason | None = Reason("whatif.removed")
    models: list[Model] = []
    main, aside, met_rows = None, None, rows[:0]
    if edit.new_polygon is not None:
        pushed = (
            detours(near, edit.new_polygon, solid=taken, clearance_m=clearance_m, approach_m=approach_m)
            for clearance_m, approach_m in MODELS
        )
        main = next(pushed)
        refusal = _why_no_range(main, here[AROUND], within_m)
        if refusal is None and main.touched.size:
            aside = step_aside(records, halves(records), within_m=within_m)
            moves = [(rows[d.rows], d.x_m[d.rows], d.y_m[d.rows]) for d in (main, *pushed)]
            met_rows = _of_frames(records, np.concatenate([moved for moved, _, _ in moves]))
            moves = [(np.searchsorted(met_rows, moved), x_m, y_m) for moved, x_m, y_m in moves]
            models = list(_models(records.part(met_rows), moves, before[met_rows], aside, within_m))
    if refusal is None:
        is_near = bool(inside_of(place.buffer(NOBODY_M), near.x_m, near.y_m).any())
        touched_share = main.touched.size / max(n_near, 1) if main is not None else 0.0
        changes = _changes(
            records, is_close, met_rows, shapes, here, models, is_near=is_near, touched_share=touched_share,
            within_m=within_m,
        )  # fmt: skip
    else:
        changes = dict.fromkeys(here)
    predicted = tuple(
        PredictedPlace(key, time, changes[key], refusal, free_m2 if key == AROUND else None)
        for key, time in here.items()
    )
    ways = () if edit.new_polygon is None else free_ways(near, edit.new_polygon, others, widths_m=widths_m)
    n_touched, n_standing, n_no_way = (0, 0, 0) if main is None else (main.touched.size, main.n_standing, main.n_no_way)
    by_day = {} if main is None else _by_day(near, main.touched)
    return FixtureEffect(n_near, n_touched, n_standing, n_no_way, ways, predicted, stays, aside, refusal, by_day)


def _by_day(near: FloorRecords, people: Ints) -> dict[int, int]:
    """Return how many of some people came on each local day; who stays past midnight came on the day before."""
    first = near.day[np.searchsorted(near.track, people)]
    days, n = np.unique(first, return_counts=True)
    return dict(zip(days.tolist(), n.tolist(), strict=True))


def boxes_around(edit: FixtureEdit, *, within_m: float) -> Iterator[Box]:
    """Yield the parts of the floor whose people an edit needs.

    Around the place it is about: those whom it may move, and those to whom these may come close. Around its old place:
    those who stay there, who is close to them, and who is close to these.
    """
    yield _box(edit.new_polygon or edit.old_polygon or (), AROUND_M + 2 * within_m)
    if edit.old_polygon is not None:
        yield _box(edit.old_polygon, STAY_M + 2 * within_m)


def _box(polygon: tuple[Point, ...], margin_m: float) -> Box:
    least_x, least_y, most_x, most_y = shapely.Polygon(polygon).bounds
    return least_x - margin_m, least_y - margin_m, most_x + margin_m, most_y + margin_m


def with_moved_stays(
    effect: FixtureEffect, edit: FixtureEdit, old: FloorRecords, new: FloorRecords,
    areas: Mapping[str, shapely.Polygon], places: Mapping[str, PlaceTime], *, within_m: float,
) -> FixtureEffect:  # fmt: skip
    """Return an effect with the stays that the moved fixture takes along, by the share stated.

    A place from which stays leave is added. What changes for both reasons changes by the sum, with the root of the sum
    of the squares of both errors.

    Args:
        effect: What the fixture does at its new place.
        edit: The edit.
        old: People of the second of `boxes_around`.
        new: People of the first of `boxes_around`.
        areas: As of `fixture_effect`.
        places: As of `fixture_effect`.
        within_m: The distance that counts.
    """
    if edit.new_polygon is None or within_m < LEAST_DISTANCE_M:
        return effect
    around = shapely.convex_hull(shapely.Polygon(edit.new_polygon)).buffer(AROUND_M)
    known = {place.place_id: place for place in effect.places}
    moved = moved_stays(
        old, new, edit, {AROUND: around, **areas}, {**places, AROUND: known[AROUND].recorded}, within_m=within_m
    )
    for key, stays in moved.items():
        place = known.get(key) or PredictedPlace(key, places[key], PredictedChange(0.0, 0.0, 0.0), None)
        known[key] = replace(place, change=_sum(place.change, stays.change), stays=stays)
    return replace(effect, places=tuple(known.values()))


def _sum(one: PredictedChange | None, other: PredictedChange | None) -> PredictedChange | None:
    """Return the range of two changes together; their errors do not depend on each other."""
    if one is None or other is None:
        return None
    value = one.value + other.value
    below, above = (math.hypot(*(getattr(c, end) - c.value for c in (one, other))) for end in ("lo", "hi"))
    return PredictedChange(value, max(value - below, -1.0), value + above)


def _why_no_range(pushed: Detours, around: PlaceTime, within_m: float) -> Reason | None:
    if within_m < LEAST_DISTANCE_M:
        return Reason("whatif.short_distance", distance_m=within_m)
    if pushed.n_no_way > MOST_WITHOUT_WAY * pushed.touched.size:
        return Reason("whatif.no_way", n=pushed.n_no_way, of=int(pushed.touched.size))
    if pushed.touched.size and around.total_close_s < MIN_CLOSE_S:
        return Reason("whatif.little_time", least=MIN_CLOSE_S, has=around.total_close_s)
    return None


def _of_frames(records: FloorRecords, rows: Ints) -> Ints:
    """Return the rows of all records of the frames of some."""
    is_met = np.zeros(int(records.frame.max()) + 1, np.bool_)
    is_met[records.frame[rows]] = True
    return np.flatnonzero(is_met[records.frame])


def _models(met: FloorRecords, moves: list[Move], before: Ints, aside: StepAside, within_m: float) -> Iterator[Model]:
    """Yield where everybody is and who is too close, for each way in which people may pass."""
    for rows, *moved in moves:
        for strength in {0.0, aside.strength}:
            x_m, y_m = met.x_m.copy(), met.y_m.copy()
            x_m[rows], y_m[rows] = moved
            if strength:
                x_m[rows], y_m[rows] = _stepped_aside(met, rows, (x_m, y_m), strength, within_m)
            counts = n_close_after(before, met.frames, (met.x_m, met.y_m), rows, (x_m, y_m), within_m=within_m)
            yield x_m, y_m, counts > 0


def _stepped_aside(
    met: FloorRecords, rows: Ints, everybody: tuple[Floats, Floats], strength: float, within_m: float
) -> tuple[Floats, Floats]:
    """Return the places of those who were pushed after they step aside from strangers.

    They step aside from whom they came nearer to, by a share of the distance that the push took: nobody who walks as
    recorded steps aside.
    """
    places = everybody[0][rows], everybody[1][rows]
    is_with = met.track[rows], met.company[rows], met.track, met.company
    reach_m = within_m + BEYOND_M
    pairs = near_strangers(
        met.frames, np.arange(rows.size), met.frame[rows], places, everybody, is_with, within_m=reach_m
    )
    nearest = nearest_strangers(pairs, places, everybody)
    recorded = met.x_m, met.y_m
    was_m = distances(recorded, recorded, (rows[nearest[0]], nearest[1]))
    return stepped_aside(nearest, places, everybody, strength=strength, reach_m=np.minimum(was_m, reach_m))


def _changes(
    records: FloorRecords, is_close: Bools, met_rows: Ints, shapes: Mapping[str, shapely.Polygon],
    here: Mapping[str, PlaceTime], models: list[Model], *, is_near: bool, touched_share: float, within_m: float,
) -> dict[str, PredictedChange | None]:  # fmt: skip
    """Return the range of the change of time too close in each place.

    Around the edit it follows from the records. An area or the floor changes by the same person-seconds, over those
    recorded in all of it.
    """
    if not is_near:
        return dict.fromkeys(here, PredictedChange(0.0, -NO_CHANGE, NO_CHANGE))
    days, day = records.day_numbers
    rows = np.flatnonzero(is_close & records.is_owned)
    x_m, y_m, close_s, close_day = records.x_m[rows], records.y_m[rows], records.weight_s[rows], day[rows]
    met, met_close, met_day = records.part(met_rows), is_close[met_rows], day[met_rows]
    met_s = met.weight_s * met.is_owned
    changes: dict[str, PredictedChange | None] = {}
    for key, time in here.items():
        shape = shapes[key]
        own_s = close_s * inside_of(shape, x_m, y_m)
        near_s, total_s = float(own_s.sum()), time.total_close_s
        if min(near_s, total_s) < MIN_CLOSE_S:
            changes[key] = None
            continue
        of_day = np.bincount(close_day, weights=own_s, minlength=days.size)
        was_s = met_s * met_close * inside_of(shape, met.x_m, met.y_m)
        more_s: list[Floats] = [np.zeros(days.size)]
        for x, y, close in models:
            more = met_s * close * inside_of(shape, x, y) - was_s
            more_s.append(np.bincount(met_day, weights=more, minlength=days.size).astype(np.float64))
        ratio = np.divide(more_s[-1], of_day, out=np.full(days.size, np.nan), where=of_day > 0)
        sd = spread(close_s=near_s, within_m=within_m, by_day=ratio, extra_sd=TOUCHED_SD * touched_share)
        sd *= min(near_s / total_s, 1.0)
        changes[key] = predicted_change([float(s.sum()) / total_s for s in more_s[1:] or more_s], sd)
    return changes


def _meets(shape: shapely.Geometry, around: shapely.Geometry) -> bool:
    return shape.is_empty or bool(shape.intersects(around))


def _free_m2(shape: shapely.Polygon, taken: shapely.Geometry | None, edit: FixtureEdit) -> tuple[float, float]:
    areas = []
    for polygon in (edit.old_polygon, edit.new_polygon):
        full = [*([] if taken is None else [taken]), *([] if polygon is None else [shapely.Polygon(polygon)])]
        areas.append(float(shape.difference(shapely.union_all(full)).area if full else shape.area))
    return areas[0], areas[1]
