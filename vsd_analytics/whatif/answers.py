"""Predictions of layout edits as answers, with a sentence for each: whom it touches, what is claimed, by which rule."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.figures.room_levels import IATA_LEVELS, LEVELS, ROOM_M2, iata_level_of
from vsd_analytics.figures.values import known
from vsd_analytics.site.layout import DoorEdit, Edit, FixtureEdit, OpeningEdit
from vsd_analytics.site.model import Site
from vsd_analytics.whatif.best_place import choices
from vsd_analytics.whatif.doors import PredictedSeconds, rule
from vsd_analytics.whatif.fixture_edits import AROUND, AROUND_M, NOBODY_M, FixtureEffect, PredictedPlace
from vsd_analytics.whatif.free_ways import WIDEST_M
from vsd_analytics.whatif.opening_edits import OpeningEffect
from vsd_analytics.whatif.place_times import floor_key
from vsd_analytics.whatif.prediction import Effect, LayoutEffects, OneWayTraffic
from vsd_analytics.whatif.ranges import NO_CHANGE, PredictedChange

_REMARK: Final = Column("name", "fact")
"""What remarks on a row begin with: the number of the edit, since two edits may have one name."""
EDITS: Final = (
    Column("number", "key"),
    _REMARK,
    Column("edit_kind", "fact", "edit_kind"),
    Column("edit_name", "fact"),
    Column("edit_outcome", "fact", "edit_outcome"),
    Column("n_near", "count"),
    Column("n_touched", "count"),
    Column("touched_share", "share", "share", tells=("n_near", "n_touched")),
    Column("n_standing", "count"),
    Column("n_no_way", "count"),
)
"""Columns of `whatif`: people by track id."""
PLACES: Final = (
    Column("number", "key"),
    Column("place_id", "key"),
    Column("name", "place"),
    Column("predicted_change", "rate", "change"),
    Column("direction", "fact", "direction"),
    Column("close_min_per_open_h", "rate", "min", audience="operator"),
    Column("predicted_lo", "rate", "change"),
    Column("predicted_hi", "rate", "change"),
    Column("n_stays_leave", "count"),
    Column("n_stays_come", "count"),
    Column("close_time_share", "share", "share", audience="operator"),
    Column("peak_people", "people", "people_in_view", audience="operator"),
    Column("room_m2", "rate", "m2", audience="operator"),
    Column("new_room_m2", "rate", "m2", audience="operator"),
    Column("room_level", "fact", audience="operator"),
    Column("new_room_level", "fact", audience="operator"),
    Column("iata_level", "fact", "iata_level", audience="operator"),
)
"""Columns of `whatif_places`."""
WAYS: Final = (
    Column("number", "key"),
    Column("way", "key"),
    Column("way_name", "fact"),
    Column("free_m", "fact", "m", digits=2),
    Column("under_m", "fact", "m", digits=2),
    Column("n_people", "count"),
)
"""Columns of `whatif_ways`."""
DOORS: Final = (
    Column("number", "key"),
    _REMARK,
    Column("edit_name", "fact"),
    Column("n_people", "count"),
    Column("one_way_share", "share", "share", tells=("n_people",)),
    Column("queue_share", "share", "share", tells=("n_people",)),
    Column("close_s_per_person", "seconds", "s", tells=("n_people",)),
    Column("predicted_close_s", "seconds", "s", tells=("n_people",)),
)
"""Columns of `whatif_doors`."""
STAYS: Final = (
    Column("number", "key"),
    _REMARK,
    Column("edit_name", "fact"),
    Column("n_stays", "count"),
    Column("n_stays_moved", "count"),
    Column("stay_min", "rate", "min", tells=("n_stays",)),
    Column("close_share", "share", "share", tells=("n_stays",)),
)
"""Columns of `whatif_stays`."""
NAMED_SHARE: Final = 0.05
"""Areas that lose or get less of the stays than this are in the table only."""


def whatif_answers(predicted: LayoutEffects, site: Site, *, around: str) -> tuple[Answer, ...]:
    """Return what edits of a layout do, as tables.

    `whatif`: each edit, whom it touches, and its sentence as a note. `whatif_choices`: places of one fixture, compared.
    `whatif_places`: time too close recorded, and the range of its change, around the edit, in areas and on the floor.
    `whatif_ways`, `whatif_doors`, `whatif_stays`: ways beside a fixture, ways of another width, people who stay at a
    fixture that is moved.

    Args:
        predicted: The prediction.
        site: The site.
        around: What the floor around an edit is called.
    """
    floor_id = predicted.edits.floor_id
    holds = HoldsFor(
        site.site_id,
        floor_id,
        predicted.first,
        predicted.last,
        settings=site.settings.settings_id(),
        inputs=predicted.inputs,
    )
    numbered = list(enumerate(zip(predicted.edits.edits, predicted.effects, strict=True), start=1))
    rows = [_edit(number, edit, effect) for number, (edit, effect) in numbered]
    notes = tuple((number - 1, _sentence(edit, effect, site)) for number, (edit, effect) in numbered)
    names = {a.area_id: a.name for a in site.areas} | {AROUND: around}
    names[floor_key(floor_id)] = next(f.name for f in site.floors if f.floor_id == floor_id)
    queues = {a.area_id for a in site.areas if a.is_queue}
    tables: dict[str, tuple[tuple[Column, ...], list[Row]]] = {
        "whatif_places": (PLACES, [r for n, (_, e) in numbered for r in _places(n, e, predicted, names, queues)]),
        "whatif_ways": (WAYS, [r for n, (_, e) in numbered for r in _ways(n, e)]),
        "whatif_doors": (DOORS, [_door(n, edit, e) for n, (edit, e) in numbered if isinstance(e, PredictedSeconds)]),
        "whatif_stays": (STAYS, [r for n, (edit, e) in numbered for r in _stays(n, edit, e)]),
    }
    several = choices(predicted, site, holds)
    return (
        Answer("whatif", EDITS, tuple(rows), holds, notes=notes),
        *(() if several is None else (several,)),
        *(Answer(name, columns, tuple(rows), holds) for name, (columns, rows) in tables.items() if rows),
    )


def _edit(number: int, edit: Edit, effect: Effect) -> Row:
    n_near, n_touched, n_standing, n_no_way = _people(effect)
    return {
        "number": number,
        "name": str(number),
        "edit_kind": _kind(edit),
        "edit_name": edit.name if not isinstance(edit, OpeningEdit) else None,
        "edit_outcome": _outcome(effect),
        "n_near": Value(n_near),
        "n_touched": Value(n_touched),
        "touched_share": known(n_touched / n_near if n_near else None, Reason("whatif.nobody_near")),
        "n_standing": Value(n_standing),
        "n_no_way": Value(n_no_way),
    }


def _people(effect: Effect) -> tuple[int, int, int, int]:
    """Return people near an edit, those it touches, those of them who stand there, and those without a way around."""
    match effect:
        case FixtureEffect():
            return effect.n_near, effect.n_touched, effect.n_standing, effect.n_no_way
        case PredictedSeconds():
            return effect.traffic.n_people, effect.traffic.n_people, 0, 0
        case OneWayTraffic():
            return effect.n_people, effect.n_against, 0, 0
        case OpeningEffect():
            return effect.n_people, effect.n_closed, 0, 0


def _kind(edit: Edit) -> str:
    match edit:
        case FixtureEdit(new_polygon=None):
            return "remove"
        case FixtureEdit(old_polygon=None):
            return "add"
        case FixtureEdit():
            return "move"
        case DoorEdit():
            return "width"
        case OpeningEdit():
            return "opening"
        case _:
            return "one_way"


def _outcome(effect: Effect) -> str:
    if isinstance(effect, OneWayTraffic) or effect.refusal is not None:
        return "refused"
    if isinstance(effect, FixtureEffect) and all(place.change is None for place in effect.places):
        return "refused"
    return "ratio" if isinstance(effect, PredictedSeconds) else "range"


def _places(
    number: int, effect: Effect, predicted: LayoutEffects, names: dict[str, str], queues: set[str]
) -> Iterator[Row]:
    if isinstance(effect, OpeningEffect):
        key = floor_key(predicted.edits.floor_id)
        if key in predicted.places:
            place = PredictedPlace(key, predicted.places[key], effect.change, effect.refusal)
            yield _place(number, place, predicted, names, queues, is_directed=True)
    elif isinstance(effect, FixtureEffect):
        for place in effect.places:
            yield _place(number, place, predicted, names, queues)


def _place(
    number: int, place: PredictedPlace, predicted: LayoutEffects, names: dict[str, str], queues: set[str], *,
    is_directed: bool = False,
) -> Row:  # fmt: skip
    time, change = place.recorded, place.change
    why = place.refusal or Reason("whatif.little_here")
    rate = time.min_per_open_h(predicted.open_h)
    room = [m2 / time.peak_people if time.peak_people > 0 else None for m2 in place.free_m2 or (0.0, 0.0)]
    is_known = place.free_m2 is not None
    nobody = Reason("nobody.seen")
    return {
        "number": number,
        "place_id": place.place_id,
        "name": names.get(place.place_id, place.place_id),
        "predicted_change": Value.missing(why) if change is None else Value(change.value, change.lo, change.hi),
        "direction": _direction(change, is_directed=is_directed),
        "close_min_per_open_h": known(rate, Reason("level.unrecorded")),
        "predicted_lo": Value.missing(why) if change is None else Value(change.lo),
        "predicted_hi": Value.missing(why) if change is None else Value(change.hi),
        "n_stays_leave": known(None if place.stays is None else place.stays.n_leave, Reason("whatif.no_stays_move")),
        "n_stays_come": known(None if place.stays is None else place.stays.n_come, Reason("whatif.no_stays_move")),
        "close_time_share": known(time.total_close_s / time.exposure_s if time.exposure_s else None, nobody),
        "peak_people": Value(time.peak_people),
        "room_m2": known(room[0] if is_known else None, Reason("whatif.same_room")),
        "new_room_m2": known(room[1] if is_known else None, Reason("whatif.same_room")),
        "room_level": _level(room[0]) if is_known else None,
        "new_room_level": _level(room[1]) if is_known else None,
        "iata_level": _iata(room[1]) if is_known and place.place_id in queues else None,
    }


def _direction(change: PredictedChange | None, *, is_directed: bool = False) -> str | None:
    """Return which direction is claimed: one where the edit allows it and the range excludes no change."""
    if change is None:
        return None
    if is_directed and change.lo * change.hi > 0:
        return "rise" if change.lo > 0 else "fall"
    return "no_change" if max(abs(change.lo), abs(change.hi)) <= NO_CHANGE else "no_direction"


def _level(room_m2: float | None) -> str | None:
    """Return Fruin's level of service of walkways: A (most room) to F; None where nobody is."""
    return None if room_m2 is None else LEVELS[sum(room_m2 < least for least in ROOM_M2)]


def _iata(room_m2: float | None) -> str | None:
    return None if room_m2 is None else IATA_LEVELS[iata_level_of(1 / room_m2)]


def _ways(number: int, effect: Effect) -> Iterator[Row]:
    if isinstance(effect, FixtureEffect):
        for k, way in enumerate(effect.ways, start=1):
            yield {
                "number": number, "way": k, "way_name": way.name, "free_m": way.free_m, "under_m": way.under_m,
                "n_people": Value(way.n_people),
            }  # fmt: skip


def _door(number: int, edit: Edit, effect: PredictedSeconds) -> Row:
    traffic = effect.traffic
    nobody = Reason("nobody.seen")
    has = traffic.n_people > 0
    return {
        "number": number,
        "name": str(number),
        "edit_name": edit.name if isinstance(edit, DoorEdit) else "",
        "n_people": Value(traffic.n_people),
        "one_way_share": known(traffic.one_way_share if has else None, nobody),
        "queue_share": known(traffic.crowded_share if has else None, nobody),
        "close_s_per_person": known(traffic.close_s_per_person if has else None, nobody),
        "predicted_close_s": Value.missing(effect.refusal, "not_measurable")
        if effect.value is None
        else Value(effect.value, effect.lo, effect.hi),
    }


def _stays(number: int, edit: Edit, effect: Effect) -> Iterator[Row]:
    if isinstance(edit, FixtureEdit) and isinstance(effect, FixtureEffect) and effect.stays is not None:
        stays = effect.stays
        yield {
            "number": number,
            "name": str(number),
            "edit_name": edit.name,
            "n_stays": Value(stays.n_people),
            "n_stays_moved": known(stays.n_moved, Reason("whatif.no_stay_share")),
            "stay_min": Value(stays.stay_s / 60),
            "close_share": known(stays.close_s / stays.stay_s if stays.stay_s else None, Reason("nobody.seen")),
        }


def _sentence(edit: Edit, effect: Effect, site: Site) -> Reason:
    """Return the sentence of an edit: what it touches, what is claimed and by which rule, or why nothing is."""
    n_near, n_touched, _, n_no_way = _people(effect)
    share = n_touched / n_near if n_near else 0.0
    people = {"n": n_touched, "of": n_near, "share": share}
    distance_m = float(site.settings.distance_m)
    match edit, effect:
        case FixtureEdit(), FixtureEffect():
            name = edit.name
            if effect.refusal is not None and edit.new_polygon is None:
                return Reason("whatif.said_removed", name=name, n=n_near, around_m=AROUND_M, why=effect.refusal)
            ways, stays = _said_ways(effect), _said_stays(effect, site)
            change = next(place.change for place in effect.places if place.place_id == AROUND)
            if change is None:
                why = effect.refusal or Reason("whatif.little_here")
                return Reason(
                    "whatif.said_blocked", name=name, around_m=AROUND_M, ways=ways, why=why, stays=stays, **people
                )  # fmt: skip
            if _direction(change) == "no_change":
                return Reason("whatif.said_nobody", name=name, reach_m=NOBODY_M, ways=ways, most=NO_CHANGE, stays=stays)
            return Reason(
                "whatif.said_around", name=name, around_m=AROUND_M, ways=ways, lo=change.lo, hi=change.hi,
                distance_m=distance_m, stays=stays, no_way=n_no_way, **people,
            )  # fmt: skip
        case DoorEdit(), PredictedSeconds():
            if effect.refusal is not None:
                return Reason("whatif.said_door_refused", name=edit.name, n=n_near, why=effect.refusal)
            return Reason(
                f"whatif.said_{edit.kind}", name=edit.name, n=n_near, now_s=effect.traffic.close_s_per_person,
                then_s=effect.value or 0.0, lo_s=effect.lo or 0.0, hi_s=effect.hi or 0.0, distance_m=distance_m,
                old_m=edit.width_m, new_m=edit.new_width_m, factor=rule(edit.kind, distance_m)[1],
            )  # fmt: skip
        case OpeningEdit(), OpeningEffect():
            if effect.refusal is not None:
                return Reason("whatif.said_hours_refused", why=effect.refusal, **people)
            change = effect.change
            assert change is not None
            return Reason("whatif.said_hours", lo=change.lo, hi=change.hi, follow=edit.follow_share or 0.0, **people)
        case _:
            name = edit.name if not isinstance(edit, OpeningEdit) else ""
            return Reason("whatif.said_one_way", name=name, **people)


def _said_ways(effect: FixtureEffect) -> Reason:
    if not effect.ways:
        return Reason("whatif.no_ways", widest_m=WIDEST_M)
    ways = tuple(
        Reason("whatif.way" if way.under_m is None else "whatif.narrow_way", name=way.name, free_m=way.free_m,
               under_m=way.under_m or 0.0)
        for way in effect.ways[:3]
    )  # fmt: skip
    return Reason("whatif.ways", ways=ways)


def _said_stays(effect: FixtureEffect, site: Site) -> Reason:
    if effect.stays is None or not effect.stays.n_people:
        return Reason("whatif.no_stays")
    n, n_moved = effect.stays.n_people, effect.stays.n_moved
    if n_moved is None:
        return Reason("whatif.stays_unknown", n=n)
    names = {a.area_id: a.name for a in site.areas}
    moves = [(names[p.place_id], p.stays) for p in effect.places if p.stays is not None and p.place_id in names]
    leave, come = (
        tuple(Reason("whatif.stays_area", name=name) for name, n_here in counts if n_here > NAMED_SHARE * total)
        for counts, total in (
            ([(name, stays.n_leave) for name, stays in moves], n),
            ([(name, stays.n_come) for name, stays in moves], n_moved),
        )
    )
    none = (Reason("whatif.no_area"),)
    return Reason(
        "whatif.stays", n=n, moved=n_moved, leave=leave or none, come=come or none,
        distance_m=float(site.settings.distance_m),
    )  # fmt: skip
