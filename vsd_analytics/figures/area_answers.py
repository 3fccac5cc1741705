"""The floor and its areas over any days as an answer: how often, how much time too close, how many people; by floor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Row
from vsd_analytics.figures import close_time, rates
from vsd_analytics.figures.floor_space import OF_M2, per_floor, walkable_m2
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.person_time import people_level
from vsd_analytics.figures.values import measured
from vsd_analytics.site.model import Area, Floor

PLACES: Final = (
    Column("floor_id", "key"),
    Column("kind", "key"),
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("violations_per_open_h", "rate", "per_open_hour", "M0"),
    Column("close_time_share", "share", "share", "M6"),
    Column("close_min_per_open_h", "rate", "minutes"),
    Column("people", "people", "people", "M5"),
    Column("floor_m2", "fact", "m2"),
    Column("violations_per_open_h_100_m2", "rate", "per_open_hour_100_m2", "M54"),
    Column("people_per_m2", "rate", "people_per_m2", "M54"),
)
"""Columns of `place_rates`."""

REST: Final = "rest"
"""`area_id` of the rest of a floor, as in the table `area_hours`."""


def place_rates(period: Period, *, rest: str) -> Answer:
    """Return `place_rates`: the floor, each area and the rest of the floor, for the operator.

    Violations per open hour (M0), share of person-time too close (M6) and person-minutes too close per open hour,
    people (M5), and both by walkable floor (M54).

    Args:
        period: The days; areas only where its places are known.
        rest: Name of the rest of the floor.
    """
    data = period.data
    places: list[Floor | Area | None] = [data.floor]
    if period.why_no_places is None and data.areas:
        places += [*data.areas, None]
    sizes_m2 = walkable_m2(period)
    settings = data.site.settings.settings_id()
    holds = HoldsFor(data.site.site_id, data.floor.floor_id, period.first, period.last, settings=settings)
    rows = tuple(_row(period, where, rest, _size_m2(where, sizes_m2)) for where in places)
    return Answer("place_rates", PLACES, rows, holds)


def _size_m2(where: Floor | Area | None, sizes_m2: Mapping[str | None, float]) -> float | None:
    if isinstance(where, Floor):
        return sum(sizes_m2.values()) or None
    return sizes_m2.get(where.area_id if isinstance(where, Area) else None)


def _row(period: Period, where: Floor | Area | None, rest: str, floor_m2: float | None) -> Row:
    area_id = where.area_id if isinstance(where, Area) else None
    is_floor = isinstance(where, Floor)
    rate = rates.violation_rate_level(period, period.whole if is_floor else period.area(area_id))
    close = close_time.close_time(period, where)
    people = people_level(period, where)
    return {
        "floor_id": period.data.floor.floor_id,
        "kind": "floor" if is_floor else "rest" if where is None else "area",
        "area_id": REST if where is None else area_id,
        "name": rest if where is None else where.name,
        "violations_per_open_h": measured(rate),
        "close_time_share": measured(close_time.close_time_share(period, close)),
        "close_min_per_open_h": measured(close_time.burden(period, close)),
        "people": measured(people),
        "floor_m2": floor_m2,
        "violations_per_open_h_100_m2": per_floor(rate, floor_m2, of_m2=OF_M2),
        "people_per_m2": per_floor(people, floor_m2),
    }
