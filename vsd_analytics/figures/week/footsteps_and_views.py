"""What belongs beside the map of violations: where people walked, and what each camera sees."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Final

import shapely
import shapely.ops

from vsd_analytics.figures.cell_places import as_rings
from vsd_analytics.figures.week.data import WeekData, in_force
from vsd_analytics.figures.week.density import floor_fixtures
from vsd_analytics.figures.week.model_map import Extent, Footsteps, MapView, MapViews, Point, Polygon
from vsd_analytics.geometry import camera_views
from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.site.model import Calibration, Camera

MIN_TRACKS: Final = 5
"""A cell is shown when at least this many different tracks were in it."""
SMALLEST_M2: Final = 0.01
"""Smaller pieces of a view are rounding of its cut."""
LABEL_M: Final = 0.8
"""A camera's label keeps this far from the edge of its view."""


def footsteps(data: WeekData, *, extent: Extent) -> Footsteps | None:
    """Return the cells of the floor in which at least `MIN_TRACKS` tracks stood in opening hours.

    The number of tracks is the lower bound of the mart `footsteps`, so a cell may be missing, never shown with fewer.

    Args:
        data: The week.
        extent: Floor that is drawn.

    Returns:
        None where no cell has so many: the engine sends no positions, no track ids, or too few people came.
    """
    if data.this.why_few_people is not None:  # the tracks of a week are those of one person who comes every day
        return None
    cell_m = FLOOR_CELL_M
    least = data.mask.least(MIN_TRACKS)
    rows = data.warehouse.rows(
        "select cx, cy from footsteps where floor_id = $floor and local_date between $first and $last "
        "and cx >= $x0 and cx < $x1 and cy >= $y0 and cy < $y1 "
        "group by cx, cy having sum(n_tracks) >= $least order by cy, cx",
        {
            "floor": data.floor.floor_id,
            "first": data.monday,
            "last": data.sunday,
            "least": least,
            **dict(zip(("x0", "y0", "x1", "y1"), (v / cell_m for v in extent), strict=True)),
        },
    )
    runs: list[tuple[int, int, int]] = []
    for row in rows:
        cy, cx, n = runs[-1] if runs else (row["cy"], row["cx"] - 1, 0)
        if n and (cy, cx + n) == (row["cy"], row["cx"]):
            runs[-1] = (cy, cx, n + 1)
        else:
            runs.append((row["cy"], row["cx"], 1))
    return Footsteps(cell_m=cell_m, min_tracks=least, runs=tuple(runs)) if runs else None


def views(data: WeekData, *, extent: Extent, labels: Mapping[str, str]) -> MapViews | None:
    """Return what each camera sees of the floor drawn, and what two or more see.

    Args:
        data: The week; cameras have the positions of their calibration at its end.
        extent: Floor that is drawn.
        labels: Short label of each camera.

    Returns:
        None where what some camera sees is unknown, or there is no camera.
    """
    known: list[tuple[Camera, shapely.Polygon]] = []
    for camera in data.present:
        view = camera_views.view_polygon(camera, calibration=in_force(data, camera), bounds=extent)
        if view is None:
            return None
        known.append((camera, view))
    if not known:
        return None
    fixtures = shapely.union_all([shapely.Polygon(f.polygon) for f in floor_fixtures(data)])
    floor = shapely.box(*extent).difference(fixtures)
    shared = shapely.union_all([a.intersection(b) for (_, a), (_, b) in combinations(known, 2)])
    seen = shapely.union_all([view for _, view in known])
    return MapViews(
        cameras=tuple(
            MapView(
                camera_id=camera.camera_id,
                name=camera.name,
                polygons=_polygons(view),
                area_m2=float(view.intersection(floor).area),
                alone_m2=float(view.intersection(floor).difference(shared).area),
                label=labels.get(camera.camera_id, ""),
                at=_near(camera, in_force(data, camera), view),
            )
            for camera, view in known
        ),
        shared=_polygons(shared),
        floor_m2=float(floor.area),
        shared_m2=float(shared.intersection(floor).area),
        unseen_m2=float(floor.difference(seen).area),
    )


def _near(camera: Camera, calibration: Calibration | None, view: shapely.Polygon) -> Point:
    """Return the floor a camera sees at the bottom centre of its picture, or the middle of its view."""
    at = view.representative_point() if not view.is_empty else shapely.Point(0, 0)
    if calibration is not None and camera.picture_px is not None:
        width, height = camera.picture_px
        x, y = camera_views.to_floor(calibration.homography, [(width / 2, height)], picture_px=camera.picture_px)[0]
        if view.buffer(-LABEL_M).contains(shapely.Point(x, y)):
            at = shapely.Point(x, y)
        elif not (inner := view.buffer(-LABEL_M)).is_empty:
            at = shapely.ops.nearest_points(inner, shapely.Point(x, y))[0]
    return round(at.x, 2), round(at.y, 2)


def _polygons(shape: shapely.Geometry) -> tuple[Polygon, ...]:
    parts = [p for p in shapely.get_parts(shape.normalize()) if p.geom_type == "Polygon" and p.area >= SMALLEST_M2]
    return tuple(as_rings(part) for part in parts)
