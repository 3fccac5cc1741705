"""The floor and its areas over any days as an answer: violations per open hour, share of the time too close."""

from __future__ import annotations

from typing import Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Row
from vsd_analytics.figures import close_time, rates
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.values import measured
from vsd_analytics.site.model import Area, Floor

PLACES: Final = (
    Column("floor_id", "key"),
    Column("kind", "key"),
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("violations_per_open_h", "rate", "per_open_hour", "M0"),
    Column("close_time_share", "share", "share", "M6"),
)
"""Columns of `place_rates`."""


def place_rates(period: Period, *, rest: str) -> Answer:
    """Return `place_rates`: M0 and M6 of the floor, of each area and of the rest of the floor, for the operator.

    Args:
        period: The days; areas only where its places are known.
        rest: Name of the rest of the floor.
    """
    data = period.data
    places: list[Floor | Area | None] = [data.floor]
    if period.why_no_places is None and data.areas:
        places += [*data.areas, None]
    settings = data.site.settings.settings_id()
    holds = HoldsFor(data.site.site_id, data.floor.floor_id, period.first, period.last, settings=settings)
    return Answer("place_rates", PLACES, tuple(_row(period, where, rest) for where in places), holds)


def _row(period: Period, where: Floor | Area | None, rest: str) -> Row:
    area_id = where.area_id if isinstance(where, Area) else None
    is_floor = isinstance(where, Floor)
    return {
        "floor_id": period.data.floor.floor_id,
        "kind": "floor" if is_floor else "rest" if where is None else "area",
        "area_id": area_id,
        "name": rest if where is None else where.name,
        "violations_per_open_h": measured(
            rates.violation_rate_level(period, period.whole if is_floor else period.area(area_id))
        ),
        "close_time_share": measured(close_time.close_time_share(period, close_time.close_time(period, where))),
    }
