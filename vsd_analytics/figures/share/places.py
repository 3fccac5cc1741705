"""The floor of places whose counts or person-time a week's report hides: nothing is given there square by square."""

from __future__ import annotations

from typing import Final

import shapely
from shapely.geometry.base import BaseGeometry

from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.times import hidden_times
from vsd_analytics.figures.week.data import WeekData

FAR_M: Final = 1e6
"""Floors reach no farther from their origin."""


def hidden_places(data: WeekData, period: Period) -> frozenset[str | None]:
    """Return the areas whose count or person-time in a week is hidden; None among them is the rest of the floor.

    Time too close tells a count, to a reader who knows how long each violation lasts.

    Args:
        data: The floor.
        period: The week.
    """
    if not data.mask.is_on:
        return frozenset()
    if period.why_few_people is not None:
        return frozenset({*(a.area_id for a in data.areas), None})
    week = data.hidden_in(period.first)
    return frozenset({*week.places.small, *week.places.others, *hidden_times(period)})


def hidden_floor(data: WeekData, period: Period) -> BaseGeometry:
    """Return the floor where a week gives nothing by square, in metres; empty where nothing is hidden.

    It is that of the places with a hidden count or time, and half the legal distance around: there stand people whose
    violations are counted in these places.

    Args:
        data: The floor.
        period: The week.
    """
    keys = hidden_places(data, period)
    drawn = {a.area_id: shapely.Polygon(a.polygon) for a in data.areas}
    shapes: list[BaseGeometry] = [polygon for key, polygon in drawn.items() if key in keys]
    if None in keys:
        every = shapely.box(-FAR_M, -FAR_M, FAR_M, FAR_M)
        shapes.append(shapely.difference(every, shapely.union_all(list(drawn.values()))))
    return shapely.union_all(shapes).buffer(data.site.settings.distance_m / 2)
