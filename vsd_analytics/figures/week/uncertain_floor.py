"""Floor on which distances are too uncertain to say anything, by what the calibrations from people state."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import shapely
from shapely.geometry.base import BaseGeometry

from vsd_analytics.figures.week.data import WeekData, in_force
from vsd_analytics.geometry.camera_views import view_polygon
from vsd_analytics.site.model import Camera

LIMIT_SHARE: Final = 0.5
"""A distance whose sd is above half the legal distance cannot tell who is too close."""
CELL_M: Final = 1.0


def limit_m(data: WeekData) -> float:
    """Return the standard deviation of a distance above which floor is not coloured, metres."""
    return LIMIT_SHARE * data.site.settings.distance_m


def uncertain_floor(data: WeekData, cameras: Iterable[Camera]) -> BaseGeometry:
    """Return the floor where every camera that sees it states an sd of a distance above `limit_m`.

    A camera whose calibration states no error leaves nothing out: its error is unknown, not large.

    Args:
        data: The week.
        cameras: Cameras of the floor that count.
    """
    used = [(camera, in_force(data, camera)) for camera in cameras]
    cells = [cell for _, calibration in used if calibration is not None for cell in calibration.error_cells]
    unsure = [_square(x, y) for x, y, sd in cells if sd > limit_m(data)]
    if not unsure:
        return shapely.Polygon()
    known: list[BaseGeometry] = [_square(x, y) for x, y, sd in cells if sd <= limit_m(data)]
    others = [view_polygon(c, calibration=own) for c, own in used if own is None or not own.error_cells]
    known += [view for view in others if view is not None]
    return shapely.union_all(unsure).difference(shapely.union_all(known))


def stated_floor(data: WeekData, cameras: Iterable[Camera]) -> BaseGeometry:
    """Return the floor that some cameras see by their calibrations from people, however far away.

    `camera_views` ends a view where a pixel is too coarse; such a calibration tells how uncertain it is instead.
    """
    calibrations = [used for camera in cameras if (used := in_force(data, camera)) is not None]
    return shapely.union_all([_square(x, y) for used in calibrations for x, y, _ in used.error_cells])


def _square(x: float, y: float) -> shapely.Polygon:
    half = CELL_M / 2
    return shapely.box(x - half, y - half, x + half, y + half)
