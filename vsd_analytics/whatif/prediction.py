"""What a file of edits does to the people recorded on some days: each edit answered by itself, or refused."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import date, datetime, time, timedelta
from typing import Final, TypeAlias

import numpy as np
import shapely

from vsd_analytics.config.layout_edits import edit_words
from vsd_analytics.config.predictions import LayoutPrediction, PredictedRange
from vsd_analytics.errors import UsageError
from vsd_analytics.site.layout import DoorEdit, Edit, FixtureEdit, LayoutEdits, OneWayEdit
from vsd_analytics.site.model import Point, Site
from vsd_analytics.site.places import fixtures_at
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.whatif.doors import REACH_M, PredictedSeconds, passages, predicted_seconds
from vsd_analytics.whatif.fixture_edits import FixtureEffect, boxes_around, fixture_effect, with_moved_stays
from vsd_analytics.whatif.floor_records import Box, FloorRecords, records_of
from vsd_analytics.whatif.opening_edits import OpeningEffect, opening_effect
from vsd_analytics.whatif.place_times import PlaceTime, days_alike, floor_key, open_hours, place_times
from vsd_analytics.whatif.ranges import reaching_farther
from vsd_analytics.whatif.stays import people_who_stay

RELATIONS: Final = ("located", "pair_days", "track_days", "area_hours", "camera_hours")
"""Relations that a prediction reads."""
HOUR_S: Final = 3600
_WHOLE_FLOOR: Final[Box] = (-1e6, -1e6, 1e6, 1e6)


@dataclass(frozen=True, slots=True)
class OneWayTraffic:
    """Who passes a line that would be one-way.

    Attributes:
        n_people: Tracks that pass it.
        n_against: Of these, those that pass it against the direction allowed.
    """

    n_people: int
    n_against: int


Effect: TypeAlias = FixtureEffect | PredictedSeconds | OneWayTraffic | OpeningEffect


@dataclass(frozen=True, slots=True)
class LayoutEffects:
    """What the edits of a file do.

    Attributes:
        edits: The file.
        effects: What each edit does, in its order.
        first, last: The days.
        places: What was recorded in each area, and on the floor by its key.
        open_h: Recorded open hours by camera.
        inputs: Hash of the facts.
        days_alike: Local days on which places are compared, as `date.toordinal`.
    """

    edits: LayoutEdits
    effects: tuple[Effect, ...]
    first: date
    last: date
    places: dict[str, PlaceTime]
    open_h: dict[str, float]
    inputs: str
    days_alike: tuple[int, ...] = ()


def everybody(warehouse: Warehouse, floor_id: str, first: date, last: date) -> FloorRecords:
    """Return all people of a floor, for several calls of `layout_effects`: to read them takes most of its time."""
    return records_of(warehouse, floor_id, first, last, _WHOLE_FLOOR)


def layout_effects(
    warehouse: Warehouse, edits: LayoutEdits, first: date, last: date, *, people: FloorRecords | None = None
) -> LayoutEffects:
    """Return what edits of a floor do to the people recorded there.

    Args:
        warehouse: Opened over the days, with `RELATIONS`.
        edits: The edits.
        first: First local day.
        last: Last local day, inclusive.
        people: `everybody` of these days; None = those around the edits are read.

    Raises:
        UsageError: E101, records of the days were purged, or most of them near an edit have no track id.
    """
    _check_purged(warehouse, first, last)
    floor_id = edits.floor_id
    places = place_times(warehouse, floor_id, first, last)
    open_h = open_hours(warehouse, floor_id, first, last)
    within_m = float(warehouse.site.settings.distance_m)
    boxes = [list(_boxes(edit, within_m)) for edit in edits.edits]
    every = np.array([box for of_edit in boxes for box in of_edit])
    whole = (*every[:, :2].min(axis=0).tolist(), *every[:, 2:].max(axis=0).tolist())
    records = records_of(warehouse, floor_id, first, last, whole) if people is None else people
    effects = tuple(
        _effect(warehouse.site, edit, floor_id, (first, last), places, [_people(records, box) for box in of_edit])
        for edit, of_edit in zip(edits.edits, boxes, strict=True)
    )
    alike = days_alike(warehouse, floor_id, first, last)
    return LayoutEffects(edits, effects, first, last, places, open_h, warehouse.inputs_digest, alike)


def reach_farther(predicted: LayoutEffects, by: float) -> LayoutEffects:
    """Return a prediction whose ranges reach farther on both sides, at a site whose earlier ones held too few.

    Args:
        predicted: The prediction.
        by: Share of the time too close (`scores.site_record`).
    """
    if not by:
        return predicted
    effects: list[Effect] = []
    for effect in predicted.effects:
        if isinstance(effect, FixtureEffect):
            places = (
                replace(place, change=None if place.change is None else reaching_farther(place.change, by))
                for place in effect.places
            )
            effects.append(replace(effect, places=tuple(places)))
        elif isinstance(effect, OpeningEffect) and effect.change is not None:
            effects.append(replace(effect, change=reaching_farther(effect.change, by)))
        else:
            effects.append(effect)
    return replace(predicted, effects=tuple(effects))


def _boxes(edit: Edit, within_m: float) -> Iterator[Box]:
    """Yield the parts of the floor whose people an edit needs."""
    match edit:
        case FixtureEdit():
            yield from boxes_around(edit, within_m=within_m)
        case DoorEdit():
            yield _box_of_line(edit.line, REACH_M + within_m)
        case OneWayEdit():
            yield _box_of_line(edit.line, REACH_M)
        case _:
            yield _WHOLE_FLOOR


def _effect(
    site: Site, edit: Edit, floor_id: str, days: tuple[date, date], places: dict[str, PlaceTime],
    people: list[FloorRecords],
) -> Effect:  # fmt: skip
    within_m = float(site.settings.distance_m)
    records = people[0]
    if isinstance(edit, FixtureEdit):
        others = tuple(f for f in fixtures_at(site, floor_id, days[1]) if f.fixture_id != edit.fixture_id)
        areas = {
            a.area_id: shapely.Polygon(a.polygon) for a in site.areas if a.floor_id == floor_id and a.is_there(*days)
        }
        areas[floor_key(floor_id)] = shapely.Polygon()
        stays = None if edit.old_polygon is None else people_who_stay(people[-1], edit, within_m=within_m)
        effect = fixture_effect(
            records, edit, others, areas, places, within_m=within_m, widths_m=site.settings.free_way_m, stays=stays
        )  # fmt: skip
        return with_moved_stays(effect, edit, people[-1], records, areas, places, within_m=within_m)
    if isinstance(edit, DoorEdit):
        return predicted_seconds(records, edit, within_m=within_m)
    if isinstance(edit, OneWayEdit):
        direction, rows = passages(records, edit.line)
        n_people, n_against = (np.unique(records.track[r]).size for r in (rows, rows[direction < 0]))
        return OneWayTraffic(n_people, n_against)
    opening = site.hours.on(days[0])
    if opening != site.hours.on(days[1]):
        raise UsageError(
            "the opening hours change within these days", why="a prediction needs one week of hours to change",
            fix="--range with days before or after it",
        )  # fmt: skip
    return opening_effect(records, edit, opening, zone=site.zone, within_m=within_m)


def _check_purged(warehouse: Warehouse, first: date, last: date) -> None:
    """Refuse days of which paths are gone: the weekly figures know these days, the replay does not."""
    ends = [datetime.combine(day, time(), tzinfo=warehouse.site.zone) for day in (first, last + timedelta(days=1))]
    begin, end = (int(at.timestamp()) // HOUR_S for at in ends)
    n_gone = sum(begin <= hour < end for hour in warehouse.built.sealed.hours)
    if n_gone:
        raise UsageError(
            f"the records of {n_gone} hours of these days were purged", why="a prediction replays the paths of people",
            fix="--range with later days",
        )  # fmt: skip


def _people(every: FloorRecords, box: Box) -> FloorRecords:
    """Return the records of a part of the floor; refuse those of an engine without track ids."""
    records = every.within(box)
    if 2 * int((records.track < 0).sum()) > records.track.size:
        raise UsageError(
            "most records near an edit have no track id", why="without it nobody's path is known",
            fix="let the engine follow people (track_id)",
        )  # fmt: skip
    return records


def _box_of_line(line: tuple[Point, Point], margin_m: float) -> Box:
    (ax, ay), (bx, by) = line
    return min(ax, bx) - margin_m, min(ay, by) - margin_m, max(ax, bx) + margin_m, max(ay, by) + margin_m


def receipt(predicted: LayoutEffects, *, made: date, settings: str) -> LayoutPrediction:
    """Return the receipt of a prediction.

    Args:
        predicted: What was predicted.
        made: Local day on which it is made.
        settings: Id of the settings in force.
    """
    words = json.dumps(edit_words(predicted.edits), sort_keys=True, default=str)
    refusals = {n: e.refusal.code for n, e in _numbered(predicted) if not isinstance(e, OneWayTraffic) and e.refusal}
    refusals |= {n: "whatif.one_way" for n, e in _numbered(predicted) if isinstance(e, OneWayTraffic)}
    return LayoutPrediction(
        made, predicted.edits.text, hashlib.blake2b(words.encode(), digest_size=8).hexdigest(), predicted.inputs,
        settings, predicted.first, predicted.last, predicted.edits.floor_id, tuple(_ranges(predicted)), refusals,
    )  # fmt: skip


def _ranges(predicted: LayoutEffects) -> Iterator[PredictedRange]:
    for number, effect in _numbered(predicted):
        if isinstance(effect, FixtureEffect):
            for place in effect.places:
                if place.change is not None:
                    yield PredictedRange(number, place.place_id, place.change.lo, place.change.hi)
        elif isinstance(effect, OpeningEffect) and effect.change is not None:
            yield PredictedRange(number, floor_key(predicted.edits.floor_id), effect.change.lo, effect.change.hi)


def _numbered(predicted: LayoutEffects) -> Iterator[tuple[int, Effect]]:
    return iter(enumerate(predicted.effects, start=1))
