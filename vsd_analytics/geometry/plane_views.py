"""Planes of a picture: which of them hold at an instant, and the floor they show."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Final

import numpy as np

from vsd_analytics.geometry.camera_views import one_ring, seen_floor
from vsd_analytics.geometry.homography import as_matrix, project

if TYPE_CHECKING:
    from shapely import Polygon
    from shapely.geometry.base import BaseGeometry

    from vsd_analytics.site.model import Calibration, Plane

SEAM_M: Final = 1.0
"""Floor between two planes up to this wide is taken as seen: what a step hides, and points that do not quite agree."""


def planes_in_force(planes: Sequence[Plane], at: datetime | None) -> tuple[Plane, ...]:
    """Return the planes at an instant, in the order of their ids in the file: of each id the latest begun.

    The first of an id has no start: it also holds before its date, as a camera's first calibration does.

    Args:
        planes: Of one camera.
        at: The instant; None = before all dates.
    """
    in_force: dict[str, Plane] = {}
    for plane in sorted(planes, key=_begins):
        begins = plane.calibration.valid_from
        if plane.plane_id not in in_force or begins is None or (at is not None and begins <= at):
            in_force[plane.plane_id] = plane
    return tuple(in_force[plane_id] for plane_id in dict.fromkeys(plane.plane_id for plane in planes))


def plane_starts(planes: Sequence[Plane]) -> list[datetime]:
    """Return the instants from which other planes hold than before, in order."""
    firsts = {id(plane) for plane in planes_in_force(planes, None)}
    return sorted({_begins(plane) for plane in planes if id(plane) not in firsts})


def floor_of_plane(plane: Plane) -> Polygon | None:
    """Return what a plane's polygon is on the floor plan; None where its corners are on both sides of the horizon."""
    import shapely

    h, corners = as_matrix(plane.calibration.homography), np.asarray(plane.polygon_px, dtype=np.float64)
    w = corners @ h[2, :2] + h[2, 2]
    if not (np.all(w > 0) or np.all(w < 0)):
        return None
    floor = shapely.Polygon(project(h, corners))  # a homography maps edges to edges
    return floor if floor.is_valid and floor.area > 0 else None


def view_with_planes(
    planes: Sequence[Plane], *, calibration: Calibration | None, picture_px: tuple[int, int] | None
) -> BaseGeometry:
    """Return the floor a camera with planes sees, in plan metres: one polygon, or several where planes lie apart.

    The images of the planes' polygons, and what the rest of the picture shows by the camera's calibration. Gaps up to
    `SEAM_M` are closed. A view is one outline, so floor within it that the camera does not see, such as that behind a
    stage, is joined to its border by a slit (`camera_views.one_ring`).

    Args:
        planes: Those in force.
        calibration: The camera's own; None = nothing else of the picture is floor.
        picture_px: Width and height of the picture; needed with a calibration.
    """
    import shapely

    floors = [floor for floor in map(floor_of_plane, planes) if floor is not None]
    if calibration is not None and picture_px is not None:
        elsewhere = shapely.union_all([shapely.Polygon(plane.polygon_px) for plane in planes])
        floors.append(seen_floor(calibration.homography, picture_px=picture_px, without=elsewhere))
    union = shapely.union_all(floors)
    closed = union.buffer(SEAM_M / 2, join_style="mitre").buffer(-SEAM_M / 2, join_style="mitre")
    parts = [part for part in shapely.get_parts(closed.union(union)) if part.geom_type == "Polygon"]
    return shapely.union_all([one_ring(part) for part in parts if part.area > SEAM_M**2 / 4])


def _begins(plane: Plane) -> datetime:
    return plane.calibration.valid_from or datetime.min.replace(tzinfo=UTC)
