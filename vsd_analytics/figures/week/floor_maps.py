"""The map of a week: violations per m2 per open hour, smoothed, in bands over the floor plan or a camera picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vsd_analytics.figures.cell_places import as_rings
from vsd_analytics.figures.floor_days import MART_CELL_M
from vsd_analytics.figures.panels import Array
from vsd_analytics.figures.week import bands as heat
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.density import FloorGrid, floor_fixtures
from vsd_analytics.figures.week.model_estimate import same_fields
from vsd_analytics.figures.week.model_map import (
    Extent,
    FloorMap,
    MapArea,
    MapBand,
    MapFixture,
    MapImage,
    MapSpot,
    Polygon,
)
from vsd_analytics.figures.week.results import AreaRow
from vsd_analytics.figures.week.uncertain_floor import stated_floor
from vsd_analytics.geometry import camera_views
from vsd_analytics.geometry.embedded_pictures import has_paper, picture_image, plan_image
from vsd_analytics.geometry.scale_bar import nice_length_m
from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.site.model import Fixture

MARGIN_M = 1.0
SIDE_MIN_M = 8.0
CELLS_MAX = 4_000_000
"""Larger floors are not drawn: a position far off would fill the memory."""
SPOTS_MAX = 3
"""Numbers on a map, as many as cards."""


def floor_maps(data: WeekData, *, areas: Sequence[AreaRow], is_ranked: bool) -> tuple[FloorMap, ...]:
    """Return the maps of a floor: one over its plan or bare floor, or the picture of its only calibrated camera.

    Density of a cell = sum over cameras of (violations there / the camera's recorded open hours) / cell area, over the
    camera-hours that enter rates (in a week too incomplete to rank, over all that was recorded), smoothed by a Gaussian
    of `smoothing_m`.

    Args:
        data: The week.
        areas: Areas in order of rank, for the numbered spots.
        is_ranked: False in weeks too incomplete to rank: no spots.

    Returns:
        No map where violations have no place on the floor, or the floor is too large to draw.
    """
    extent = floor_extent(data)
    if extent is None or data.why_no_violations is not None or data.why_no_places is not None:
        return ()
    grid = FloorGrid(data, extent)
    used = data.hours.is_counted if is_ranked else data.hours.recorded_s > 0
    density = grid.density(data.this, used=used).without_small()
    if data.hidden.why_untimed is not None:  # bands would be drawn around single people
        density = np.zeros_like(density)
    polygons = grid.bands(density, steps=data.site.settings.heat_steps)
    uncertain = tuple(as_rings(p) for p in _parts(grid.uncertain.intersection(shapely.box(*extent))))
    pictured = _picture_map(data, polygons, uncertain) if data.floor.plan is None else None
    if pictured is not None:
        return (pictured,)
    image = plan_of(data)
    recording = [c for c, own in zip(data.cameras, used[:, data.week()], strict=True) if own.any()]
    unseen = camera_views.unseen(data.floor, cameras=recording, bounds=extent)
    if unseen and not (stated := stated_floor(data, recording)).is_empty:
        unseen = _parts(shapely.union_all(unseen).difference(stated))
    return (
        FloorMap(
            kind="plan" if image else "floor",
            title=data.floor.name,
            extent=extent,
            image=image,
            bands=polygons,
            unseen=tuple(as_rings(p) for p in unseen or ()),
            uncertain=uncertain,
            fixtures=map_fixtures(floor_fixtures(data)),
            areas=tuple(MapArea(area_id=a.area_id, name=a.name, ring=a.polygon) for a in data.areas),
            spots=_spots(data, grid, density, areas) if is_ranked else (),
            scale_bar_m=nice_length_m(extent[2] - extent[0], unit=data.site.settings.distance_unit),
        ),
    )


def floor_extent(data: WeekData) -> Extent | None:
    """Return the floor to draw: the plan, else what was walked on in opening hours and the areas.

    None when it is unknown or too large.
    """
    extent = camera_views.plan_bounds(data.floor)
    if extent is None:
        seen = data.warehouse.rows(
            "select min(cx) as x0, min(cy) as y0, max(cx) + 1 as x1, max(cy) + 1 as y1 from cell_days "
            "where list_contains($ids::varchar[], camera_id)",
            {"ids": data.ids},
        )[0]
        if seen["x0"] is None:
            return None
        walked = shapely.box(*(seen[k] * MART_CELL_M for k in ("x0", "y0", "x1", "y1")))
        whole = shapely.union_all([walked, *(shapely.Polygon(a.polygon) for a in data.areas)])
        extent = _at_least(whole.buffer(MARGIN_M).bounds)
    n_cells = (extent[2] - extent[0]) * (extent[3] - extent[1]) / FLOOR_CELL_M**2
    return extent if n_cells <= CELLS_MAX else None


def _at_least(bounds: Extent) -> Extent:
    """Return bounds widened around their middle to `SIDE_MIN_M`, so that a floor can always be drawn."""
    x0, y0, x1, y1 = bounds
    dx, dy = (max(0.0, SIDE_MIN_M - side) / 2 for side in (x1 - x0, y1 - y0))
    return x0 - dx, y0 - dy, x1 + dx, y1 + dy


def plan_of(data: WeekData) -> MapImage | None:
    """Return the floor's plan; None without one."""
    bounds = camera_views.plan_bounds(data.floor)
    if data.floor.plan is None or bounds is None:
        return None
    uri, _ = plan_image(data.floor.plan)
    return MapImage(data_uri=uri, extent=bounds, is_opaque=has_paper(data.floor.plan))


def map_fixtures(fixtures: Sequence[Fixture]) -> tuple[MapFixture, ...]:
    """Return fixtures for drawing."""
    return tuple(same_fields(MapFixture, f, ring=f.polygon) for f in fixtures)


def _spots(data: WeekData, grid: FloorGrid, density: Array, areas: Sequence[AreaRow]) -> tuple[MapSpot, ...]:
    """Return the peaks of the three busiest areas that show any band."""
    polygons = {a.area_id: shapely.Polygon(a.polygon) for a in data.areas}
    x, y = grid.axes()
    spots: list[MapSpot] = []
    for area in areas:
        if area.area_id is None or not area.violation_rate.value or len(spots) == SPOTS_MAX:
            continue
        inside: NDArray[np.bool_] = shapely.contains_xy(polygons[area.area_id], x[None, :], y[:, None])
        own = _heaviest_patch(np.where(inside, density, 0.0), data.site.settings.heat_steps[0])
        row, column = np.unravel_index(int(own.argmax()), own.shape)
        if own[row, column] >= data.site.settings.heat_steps[0]:
            at = (float(x[column]), float(y[row]))
            spots.append(MapSpot(number=len(spots) + 1, name=area.name, at=at, peak=float(own[row, column])))
    return tuple(spots)


def _heaviest_patch(density: Array, least: float) -> Array:
    """Return the patch of neighbouring cells of at least `least` that holds most, and 0 elsewhere.

    A number belongs at an area's own crowd, not where the edge of another reaches across the area's border.
    """
    from scipy.ndimage import label

    patches, n_patches = label(density >= least)
    sums = [float(density[patches == k].sum()) for k in range(1, n_patches + 1)]
    return np.where(patches == 1 + int(np.argmax(sums)), density, 0.0) if sums else np.zeros_like(density)


def _picture_map(data: WeekData, polygons: tuple[MapBand, ...], uncertain: tuple[Polygon, ...]) -> FloorMap | None:
    """Return the bands over the picture of the floor's only camera, when it is calibrated."""
    if len(data.cameras) != 1:
        return None
    camera = data.cameras[0]
    until = data.monday + data.span
    calibrations = [c for c in camera.calibrations if c.valid_from is None or c.valid_from.date() < until]
    if camera.picture is None or not calibrations or camera.planes:  # no one homography draws a floor of several planes
        return None
    uri, size = picture_image(camera.picture)
    full = camera.picture_px or size
    extent = (0.0, 0.0, float(full[0]), float(full[1]))
    homography = np.array(calibrations[-1].homography)
    return FloorMap(
        kind="picture",
        title=camera.name,
        extent=extent,
        image=MapImage(data_uri=uri, extent=extent),
        bands=tuple(
            MapBand(
                lower=band.lower,
                polygons=heat.project_polygons(band.polygons, homography=homography, size_px=full),
            )
            for band in polygons
        ),
        uncertain=heat.project_polygons(uncertain, homography=homography, size_px=full),
    )


def _parts(shape: BaseGeometry) -> list[shapely.Polygon]:
    return [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon" and part.area > 0]
