"""Capacity of areas and floors: for how much of the time it is used, and by how many people exceeded (M41).

Only places with `capacity` in vsd.toml. The number of people on a floor is that of the people in view: floor that no
camera sees is not in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.figures.neighbours import LEVELS, RoomLevel, density_edges, level_of
from vsd_analytics.figures.people_present import Presence
from vsd_analytics.figures.periods import Period
from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.site.model import Area, Floor
from vsd_analytics.stats.estimates import RateEstimate

BUSY: Final = 0.6
"""Share of a capacity from which a place counts as well used."""
_AREA: Final = """
select count(*) as n_cells
from area_cells
where area_id = $area and from_ms < $end and to_ms >= $end
"""


@dataclass(frozen=True, slots=True)
class CapacityUse:
    """How a place with a capacity was used in a period.

    Attributes:
        place: An area or the floor.
        capacity: People it is meant for at once.
        people: Mean number of people.
        busy, full, over: Share of recorded open time with at least `BUSY` of its capacity, with at least all of it,
            and with more.
        surplus: Mean number of people beyond the capacity: person-hours of surplus per recorded open hour.
        area_m2: Its area; None of a floor.
        room: Person-time at Fruin's levels of service, by the floor for each person; empty for a floor.
        recorded_share: Share of the opening hours in which all its cameras recorded.
        silent_cameras: Cameras that see it and recorded nothing.
        unrecorded_hours: Open hours of the day that were never recorded: the figures are of the other hours.
    """

    place: Area | Floor
    capacity: int
    people: RateEstimate
    busy: RateEstimate
    full: RateEstimate
    over: RateEstimate
    surplus: RateEstimate
    area_m2: float | None
    room: tuple[RoomLevel, ...]
    recorded_share: float
    silent_cameras: tuple[str, ...]
    unrecorded_hours: tuple[int, ...]


def capacities(period: Period) -> tuple[CapacityUse, ...]:
    """Return how each place of a floor with a capacity was used: the floor first, areas in the order of vsd.toml."""
    asked: list[Area | Floor] = [period.data.floor, *period.data.areas]
    return tuple(_use(period, place, place.capacity) for place in asked if place.capacity is not None)


def _use(period: Period, place: Area | Floor, capacity: int) -> CapacityUse:
    present = Presence(period, place)
    area_m2 = _area_m2(period, place) if isinstance(place, Area) else None
    return CapacityUse(
        place,
        capacity,
        present.mean(),
        present.time_share(BUSY * capacity),
        present.time_share(capacity),
        present.time_share_above(capacity),
        present.beyond(capacity),
        area_m2,
        _room(present, area_m2) if area_m2 else (),
        present.recorded_share,
        present.silent_cameras,
        present.unrecorded_hours,
    )


def _room(present: Presence, area_m2: float) -> tuple[RoomLevel, ...]:
    """Return person-time by the density of the whole area: people / area."""
    levels = np.array([level_of(n / area_m2) for n in present.numbers.tolist()])
    edges = density_edges()
    return tuple(RoomLevel(level, *edges[k], present.person_time_share(levels == k)) for k, level in enumerate(LEVELS))


def _area_m2(period: Period, area: Area) -> float:
    """Return the area of the cells that count for it at the end of the period."""
    values = {"area": area.area_id, "end": period.span_ms[1] - 1}
    return float(period.data.warehouse.rows(_AREA, values)[0]["n_cells"]) * FLOOR_CELL_M**2
