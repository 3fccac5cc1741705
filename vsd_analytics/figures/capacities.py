"""Capacity of areas and floors: for how much of the time it is used, and by how many people exceeded (M41).

Only places with `capacity` in vsd.toml. The number of people on a floor is that of the people in view: floor that no
camera sees is not in it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from vsd_analytics.answer import Answer, Column, Reason, Row, Value
from vsd_analytics.figures.neighbours import RoomLevel
from vsd_analytics.figures.people_present import Presence, unknown_hours_notes
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.room_levels import IATA_LEVELS, LEVELS, density_edges, iata_level_of, level_of
from vsd_analytics.figures.share.times import hidden_times
from vsd_analytics.figures.visits import timeless
from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.site.model import Area, Floor

BUSY: Final = 0.6
"""Share of a capacity from which a place counts as well used."""
_AREA: Final = """
select count(*) as n_cells
from area_cells
where area_id = $area and from_ms < $end and to_ms >= $end
"""
COLUMNS: Final = (
    Column("floor_id", "key"),
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("capacity", "fact", "people"),
    Column("people", "people", "people", "M41", digits=2, per="recorded_open_h"),
    Column("busy_share", "share", "share", "M41", per="recorded_open_h"),
    Column("full_share", "share", "share", "M41", per="recorded_open_h"),
    Column("over_share", "share", "share", "M41", per="recorded_open_h"),
    Column("surplus_people", "people", "people", "M41", digits=2, per="recorded_open_h"),
    *(Column(f"room_{level.lower()}_share", "share", "share", "M41") for level in LEVELS),
    *(Column(f"iata_{level}_share", "share", "share", "M41") for level in IATA_LEVELS),
    Column("area_m2", "fact", "m2"),
    Column("recorded_open_h", "fact", "h"),
    Column("recorded_share", "share", "share"),
    Column("silent_cameras", "fact"),
    Column("unrecorded_hours", "fact", "hour_of_day"),
)
"""Columns of `capacity`."""
_TIMES: Final = tuple(c.name for c in COLUMNS if c.figure)
NO_ROOM: Final = Reason("room.no_area")
NO_QUEUE: Final = Reason("room.no_queue")


def capacity(period: Period) -> Answer:
    """Return how each place of a floor with a capacity was used: the floor first, areas in the order of vsd.toml.

    Columns: mean number of people; share of recorded open time with at least `BUSY` of the capacity, with at least all
    of it, and with more; mean number of people beyond it, which is person-hours of surplus per recorded open hour; for
    areas the share of person-time at each of Fruin's levels of service A to F, by people / area, and for areas with
    `queue = true` at each of IATA's levels of a queue (M41). For the floor `area_id` is null.
    """
    asked: list[Area | Floor] = [period.data.floor, *period.data.areas]
    hidden = hidden_times(period)
    rows = tuple(
        timeless(_row(period, place, place.capacity), hidden.get(place.area_id), _TIMES)
        if isinstance(place, Area)
        else _row(period, place, place.capacity)
        for place in asked
        if place.capacity is not None
    )
    nothing = None if rows else Reason("capacity.not_asked")
    notes = tuple((k, n) for k, row in enumerate(rows) for n in unknown_hours_notes(row))
    return Answer("capacity", COLUMNS, rows, period.holds_for, (), notes, nothing)


def _row(period: Period, place: Area | Floor, limit: int) -> Row:
    present = Presence(period, place)
    area_m2 = _area_m2(period, place) if isinstance(place, Area) else None
    room = {level.level: Value.of(level.share) for level in _room(present, area_m2)} if area_m2 else {}
    queue = _queue_room(present, area_m2) if area_m2 and isinstance(place, Area) and place.is_queue else {}
    no_queue = Value.missing(NO_QUEUE, "not_measurable")
    people = present.mean()
    return {
        "floor_id": period.data.floor.floor_id,
        "area_id": place.area_id if isinstance(place, Area) else None,
        "name": place.name,
        "capacity": limit,
        "people": Value.of(people),
        "busy_share": Value.of(present.time_share(BUSY * limit)),
        "full_share": Value.of(present.time_share(limit)),
        "over_share": Value.of(present.time_share_above(limit)),
        "surplus_people": Value.of(present.beyond(limit)),
        **{f"room_{k.lower()}_share": room.get(k, Value.missing(NO_ROOM, "not_measurable")) for k in LEVELS},
        **{f"iata_{level}_share": queue.get(level, no_queue) for level in IATA_LEVELS},
        "area_m2": area_m2,
        "recorded_open_h": people.exposure_h,
        "recorded_share": Value(present.recorded_share),
        "silent_cameras": present.silent_cameras,
        "unrecorded_hours": present.unrecorded_hours,
    }


def _room(present: Presence, area_m2: float) -> tuple[RoomLevel, ...]:
    """Return person-time by the density of the whole area: people / area."""
    levels = np.array([level_of(n / area_m2) for n in present.numbers.tolist()])
    edges = density_edges()
    return tuple(RoomLevel(level, *edges[k], present.person_time_share(levels == k)) for k, level in enumerate(LEVELS))


def _queue_room(present: Presence, area_m2: float) -> dict[str, Value]:
    """Return the share of person-time at each of IATA's levels, by people / area."""
    levels = np.array([iata_level_of(n / area_m2) for n in present.numbers.tolist()])
    return {name: Value.of(present.person_time_share(levels == k)) for k, name in enumerate(IATA_LEVELS)}


def _area_m2(period: Period, area: Area) -> float:
    """Return the area of the cells that count for it at the end of the period."""
    values = {"area": area.area_id, "end": period.span_ms[1] - 1}
    return float(period.data.warehouse.rows(_AREA, values)[0]["n_cells"]) * FLOOR_CELL_M**2
