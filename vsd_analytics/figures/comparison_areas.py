"""Which areas of a floor a changed area is compared with (M27), and why the others are not."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date

import shapely

from vsd_analytics.answer import Reason
from vsd_analytics.figures.change_weeks import changed_areas
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.site.model import Area


def comparison_areas(
    data: FloorHours, area: Area, days: tuple[date, date], *, why_not: Callable[[Area], Reason | None]
) -> tuple[list[Area], dict[str, Reason]]:
    """Return the areas of the floor that serve for comparison with an area, and why the others do not.

    Args:
        data: The floor.
        area: The area; others nearer to it than `change_apart_m` are no comparison.
        days: First and last day: an area with a logged change in between is no comparison.
        why_not: Returns why the records of an area are no comparison; None where they are.
    """
    changed, shape = changed_areas(data.site, *days), shapely.Polygon(area.polygon)
    least_m = data.site.settings.change_apart_m
    chosen, left_out = [], dict[str, Reason]()
    for other in data.areas:
        apart_m = float(shape.distance(shapely.Polygon(other.polygon)))
        if other.area_id == area.area_id:
            continue
        if apart_m < least_m:
            left_out[other.area_id] = Reason("logged_change.near", apart_m=apart_m, least_m=least_m)
        elif other.area_id in changed:
            left_out[other.area_id] = Reason("logged_change.changed_too", day=str(changed[other.area_id]))
        elif (why := why_not(other)) is not None:
            left_out[other.area_id] = why
        else:
            chosen.append(other)
    return chosen, left_out


def areas_that_serve(data: FloorHours, area: Area, days: tuple[date, date]) -> tuple[list[Area], dict[str, Reason]]:
    """Return the areas that a change of an area would be compared with, and why the others do not serve.

    Without any, a change of the area can be tried, but no week will ever tell whether it worked.

    Args:
        data: The floor.
        area: The area to be changed.
        days: First and last day of the weeks before the change.
    """

    def why_not(other: Area) -> Reason | None:
        return None if data.violation_in(other.area_id).any() else Reason("logged_change.nobody_there")

    return comparison_areas(data, area, days, why_not=why_not)
