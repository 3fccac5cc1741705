"""How much floor people can walk on where cameras count: what figures by square metre are divided by (M54)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import shapely
from shapely.geometry.base import BaseGeometry

from vsd_analytics.answer import Estimated, Reason, Value
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.values import measured
from vsd_analytics.geometry.camera_views import plan_bounds, view_polygon
from vsd_analytics.site.model import Camera
from vsd_analytics.warehouse.owner_spans import in_force

VIEW_UNKNOWN: Final = Reason("crowding.view_unknown")
OF_M2: Final = 100.0
"""Floor that violations are counted on: a rate for one square metre would have three noughts."""


def fixtures_of(period: Period) -> BaseGeometry:
    """Return the fixtures of the floor at the end of a period as one shape."""
    data, (_, end_ms) = period.data, period.span_ms
    at = data.local(end_ms - 1)
    own = (f for f in data.site.fixtures if f.floor_id == data.floor.floor_id and f.is_there(at))
    return shapely.union_all([shapely.Polygon(f.polygon) for f in own])


def view_of(period: Period, camera: Camera) -> BaseGeometry | None:
    """Return what a camera sees of the floor's plan at the end of a period; None where that is unknown."""
    calibration = next(iter(in_force(camera, period.span_ms[1] - 1)), None)
    return view_polygon(camera, calibration=calibration, bounds=plan_bounds(period.data.floor))


def walkable_m2(period: Period) -> Mapping[str | None, float]:
    """Return the floor that cameras see, without fixtures, by area, and (None) of the rest of the floor.

    A square metre in several areas belongs to the first of them, as people there do. The sizes add up to the floor.
    They are of the end of the period, over the cameras that were there in it. Empty where what one sees is unknown.
    """
    views = [view_of(period, c) for c in period.data.cameras if c.is_there(period.first, period.last)]
    seen = [view for view in views if view is not None]
    if len(seen) < len(views) or not seen:
        return {}
    left = shapely.union_all(seen).difference(fixtures_of(period))
    sizes: dict[str | None, float] = {}
    for area in period.data.areas:
        polygon = shapely.Polygon(area.polygon)
        sizes[area.area_id] = left.intersection(polygon).area
        left = left.difference(polygon)
    return sizes | {None: left.area}


def per_floor(estimate: Estimated | None, floor_m2: float | None, *, of_m2: float = 1.0) -> Value:
    """Return what an estimate makes of each `of_m2` square metres (M54); its interval is that of the estimate.

    Args:
        estimate: The estimate of a place; None = there is none.
        floor_m2: The walkable floor of the place; None = unknown.
        of_m2: Square metres it is given for.
    """
    whole = measured(estimate)
    if whole.value is None:
        return whole
    if not floor_m2:
        return Value.missing(VIEW_UNKNOWN, "not_measurable")
    value, lo, hi = (None if n is None else n / floor_m2 * of_m2 for n in (whole.value, whole.lo, whole.hi))
    return Value(value, lo, hi, whole.state, whole.reason)
