"""The map of a week: violations per m2 per open hour, smoothed, in bands over the floor plan or a camera picture."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import timedelta

import numpy as np
from numpy.typing import NDArray

from vsd_analytics import geometry
from vsd_analytics.report import bands as heat
from vsd_analytics.report.model import AreaRow, Extent, FloorMap, MapArea, MapBand, MapImage, MapSpot, Polygon
from vsd_analytics.report.pictures import picture_image, plan_image
from vsd_analytics.report.floorplan import nice_metres
from vsd_analytics.report.weekdata import WeekData

MARGIN_M = 1.0
CELLS_MAX = 4_000_000


def floor_maps(data: WeekData, *, areas: Sequence[AreaRow], is_ranked: bool) -> tuple[FloorMap, ...]:
    """Return the maps of a floor: one over its plan or bare floor, or the picture of its only calibrated camera.

    Density of a cell = sum over cameras of (violations there / the camera's recorded open hours) / cell area, smoothed
    by a Gaussian of `smoothing_m`.

    Args:
        data: The week.
        areas: Areas in order of rank, for the numbered spots.
        is_ranked: False in weeks too incomplete to rank: no spots.
    """
    grid = _Grid(data)
    if grid.extent is None:
        return ()
    settings = data.site.settings
    density = grid.density()
    polygons = heat.heat_bands(density, cell_m=settings.cell_m, origin_m=grid.origin, steps=settings.heat_steps)
    pictured = _picture_map(data, polygons)
    if data.floor.plan is None and pictured is not None:
        return (pictured,)
    bounds = grid.extent
    unseen = geometry.unseen(data.floor, cameras=data.cameras, bounds=bounds)
    image = None
    if data.floor.plan is not None and (plan := geometry.plan_bounds(data.floor)) is not None:
        uri, _ = plan_image(data.floor.plan)
        image = MapImage(data_uri=uri, extent=plan)
    return (
        FloorMap(
            kind="plan" if image else "floor",
            title=data.floor.name,
            extent=bounds,
            image=image,
            bands=polygons,
            unseen=tuple(_polygon(p) for p in unseen or ()),
            areas=tuple(
                MapArea(area_id=a.area_id, name=a.name, ring=a.polygon)
                for a in data.site.areas
                if a.floor_id == data.floor.floor_id
            ),
            spots=_spots(data, grid, density, areas) if is_ranked else (),
            scale_bar_m=nice_metres(bounds[2] - bounds[0]),
        ),
    )


class _Grid:
    """Violations of the week on the floor grid."""

    def __init__(self, data: WeekData) -> None:
        self._data = data
        self._cell_m = data.site.settings.cell_m
        self._cells = data.warehouse.frame(
            "select camera_id, cx, cy, sum(n_violations)::double as n from violation_cells "
            "where floor_id = $floor and local_date between $first and $last group by all order by all",
            {"floor": data.floor.floor_id, "first": data.monday, "last": data.sunday},
        )
        self.extent = self._extent()
        if self.extent is not None:
            x0, y0, x1, y1 = self.extent
            self._first = (int(np.floor(x0 / self._cell_m)), int(np.floor(y0 / self._cell_m)))
            self._shape = (
                int(np.ceil(y1 / self._cell_m)) - self._first[1],
                int(np.ceil(x1 / self._cell_m)) - self._first[0],
            )
            self.origin = (self._first[0] * self._cell_m, self._first[1] * self._cell_m)

    def density(self) -> NDArray[np.float64]:
        """Return violations per m2 per open hour, shape (n_y, n_x), smoothed."""
        from scipy.ndimage import gaussian_filter

        recorded = self._data.current.groupby("camera_id")["recorded_open_s"].sum() / 3600
        grid = np.zeros(self._shape)
        x = self._cells["cx"].to_numpy() - self._first[0]
        y = self._cells["cy"].to_numpy() - self._first[1]
        hours = self._cells["camera_id"].map(recorded).to_numpy(dtype="float64")
        inside = (x >= 0) & (y >= 0) & (x < self._shape[1]) & (y < self._shape[0]) & (hours > 0)
        np.add.at(grid, (y[inside], x[inside]), self._cells["n"].to_numpy()[inside] / hours[inside])
        smooth = gaussian_filter(
            grid / self._cell_m**2, self._data.site.settings.smoothing_m / self._cell_m, mode="constant"
        )
        return np.asarray(smooth, dtype="float64")

    def cell_of(self, x_m: float, y_m: float) -> tuple[int, int]:
        """Return row and column of a floor position."""
        return int(np.floor(y_m / self._cell_m)) - self._first[1], int(np.floor(x_m / self._cell_m)) - self._first[0]

    def centre(self, row: int, column: int) -> tuple[float, float]:
        """Return the floor position of a cell's middle."""
        return (column + self._first[0] + 0.5) * self._cell_m, (row + self._first[1] + 0.5) * self._cell_m

    def _extent(self) -> Extent | None:
        plan = geometry.plan_bounds(self._data.floor)
        if plan is None:
            seen = self._data.warehouse.rows(
                "select min(cx) as x0, min(cy) as y0, max(cx) + 1 as x1, max(cy) + 1 as y1 from floor_cells "
                "where camera_id in (select unnest($ids))",
                {"ids": self._data.ids},
            )[0]
            if seen["x0"] is None:
                return None
            c, m = self._cell_m, MARGIN_M
            plan = (seen["x0"] * c - m, seen["y0"] * c - m, seen["x1"] * c + m, seen["y1"] * c + m)
        if (plan[2] - plan[0]) * (plan[3] - plan[1]) / self._cell_m**2 > CELLS_MAX:
            return None
        return plan


def _spots(data: WeekData, grid: _Grid, density: NDArray[np.float64], areas: Sequence[AreaRow]) -> tuple[MapSpot, ...]:
    """Return the peaks of the three busiest areas that show any band."""
    import shapely

    polygons = {a.area_id: a.polygon for a in data.site.areas}
    spots: list[MapSpot] = []
    for area in areas:
        if area.area_id is None or not area.often.value or len(spots) == 3:
            continue
        polygon = shapely.Polygon(polygons[area.area_id])
        x0, y0, x1, y1 = polygon.bounds
        (row0, column0), (row1, column1) = grid.cell_of(x0, y0), grid.cell_of(x1, y1)
        best: tuple[float, float, float] | None = None
        for row in range(max(0, row0), min(density.shape[0], row1 + 1)):
            for column in range(max(0, column0), min(density.shape[1], column1 + 1)):
                x, y = grid.centre(row, column)
                if (best is None or density[row, column] > best[0]) and polygon.covers(shapely.Point(x, y)):
                    best = (float(density[row, column]), x, y)
        if best is not None and best[0] >= data.site.settings.heat_steps[0]:
            spots.append(MapSpot(number=len(spots) + 1, name=area.name, at=best[1:], peak=best[0]))
    return tuple(spots)


def _picture_map(data: WeekData, polygons: tuple[MapBand, ...]) -> FloorMap | None:
    """Return the bands over the picture of the floor's only camera, when it is calibrated."""
    if len(data.cameras) != 1:
        return None
    camera = data.cameras[0]
    until = data.monday + timedelta(days=7)
    calibrations = [c for c in camera.calibrations if c.valid_from is None or c.valid_from.date() < until]
    if camera.picture is None or not calibrations:
        return None
    uri, size = picture_image(camera.picture)
    full = camera.picture_px or size
    return FloorMap(
        kind="picture",
        title=camera.name,
        extent=(0.0, 0.0, float(full[0]), float(full[1])),
        image=MapImage(data_uri=uri, extent=(0.0, 0.0, float(full[0]), float(full[1]))),
        bands=tuple(
            MapBand(
                lower=band.lower,
                polygons=heat.project_polygons(
                    band.polygons, homography=np.array(calibrations[-1].homography), size_px=full
                ),
            )
            for band in polygons
        ),
    )


def _polygon(shape: object) -> Polygon:
    rings = [shape.exterior, *shape.interiors]  # type: ignore[attr-defined]
    return tuple(tuple((float(x), float(y)) for x, y in list(ring.coords)[:-1]) for ring in rings)
