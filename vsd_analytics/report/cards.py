"""The empty scene around a numbered spot: the camera that shows it best, cut to the spot, with the spot's own bands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from vsd_analytics.geometry import ground_resolution, to_image, view_polygon
from vsd_analytics.report import bands as heat
from vsd_analytics.report.density import floor_fixtures
from vsd_analytics.report.frame import Edges
from vsd_analytics.report.mapping import as_rings
from vsd_analytics.report.model import FloorMap, MapBand, MapFixture, MapImage, Point, Polygon, SpotPicture
from vsd_analytics.report.occlusion import hidden
from vsd_analytics.report.overlays import in_force
from vsd_analytics.report.pictures import scene_image
from vsd_analytics.report.weekdata import WeekData
from vsd_analytics.site import Calibration, Camera

WIDTH_PX: Final = 640
MAX_BYTES: Final = 7_000
ASPECT: Final = 16 / 9
SEEN_SHARE: Final = 0.5
SMALLEST_PX2: Final = 16.0
NEAR_M: Final = 1.0
"""A spot's peak may lie this far beside its band."""
MARGIN: Final = 1.35
"""The cut is so many times as wide as the bands it shows, if the picture is."""
SMALLEST_SHARE: Final = 0.45
"""No cut is narrower than this share of the picture: the room must stay recognisable."""


def spot_pictures(
    data: WeekData,
    bands: Sequence[MapBand],
    *,
    fixtures: Sequence[MapFixture] = (),
    spots: Sequence[tuple[int, Point]],
) -> tuple[SpotPicture, ...]:
    """Return the pictures of the spots that a camera with a picture and a calibration shows.

    Args:
        data: The week.
        bands: The bands of the floor's map, floor metres.
        fixtures: What they were cut by.
        spots: Number and peak of each spot, floor metres.
    """
    found = [spot_picture(data, bands, fixtures=fixtures, number=number, at=at) for number, at in spots]
    return tuple(picture for picture in found if picture is not None)


def spot_picture(
    data: WeekData, bands: Sequence[MapBand], *, fixtures: Sequence[MapFixture] = (), number: int, at: Point
) -> SpotPicture | None:
    """Return the picture of one spot.

    The camera is the one that shows the peak with most pixels per metre of floor (`ground_resolution`) among those
    with a picture and a view that holds it; before all those that show at least `SEEN_SHARE` of the spot's floor, out
    of the picture's frame and behind fixtures of known height being what is not shown.

    Args:
        data: The week.
        bands: The bands of the floor's map, floor metres.
        fixtures: What they were cut by.
        number: Number of the spot.
        at: Its peak, floor metres.

    Returns:
        None when no such camera sees it, or the spot has no band.
    """
    own = own_bands(bands, at)
    seen = [v for c in data.cameras if own and (v := _view(data, c, own[0], at)) is not None]
    best = max(seen, key=lambda v: (v.share >= SEEN_SHARE, v.px_per_m), default=None)
    if best is None:
        return None
    camera, homography, size = best.camera, np.array(best.calibration.homography), best.size
    edges = Edges(fixtures) if fixtures else None
    projected = (
        MapBand(
            lower=b.lower,
            polygons=heat.project_polygons(_curved(b, edges), homography=homography, size_px=size),
        )
        for b in own
    )
    shown = tuple(b for b in (_before(p, best.behind) for p in projected) if b.polygons)
    if not shown or camera.picture is None:
        return None
    peak = to_image(homography, [at], picture_px=size)[0]
    extent = _cut(shown, size=size, peak=(float(peak[0]), float(peak[1])))
    return SpotPicture(
        number=number,
        camera_id=camera.camera_id,
        camera_name=camera.name,
        px_per_m=best.px_per_m,
        shown=FloorMap(
            kind="picture",
            title=camera.name,
            extent=extent,
            image=MapImage(
                data_uri=scene_image(camera.picture, cut=extent, of_px=size, width_px=WIDTH_PX, max_bytes=MAX_BYTES),
                extent=extent,
            ),
            bands=tuple(_inside(b, extent) for b in shown),
        ),
    )


def own_bands(bands: Sequence[MapBand], at: Point) -> tuple[MapBand, ...]:
    """Return the bands of one spot: the weakest band's polygon at its peak, and what lies inside it of stronger ones.

    Args:
        bands: Weakest first.
        at: The peak; within `NEAR_M` of a polygon it is taken as that one's.
    """
    peak = shapely.Point(at)
    whole = None
    own = []
    for band in bands:
        shapes = [(rings, shapely.Polygon(rings[0], rings[1:]).buffer(0)) for rings in band.polygons]
        if whole is None:
            near = min(shapes, key=lambda item: item[1].distance(peak), default=None)
            if near is None or near[1].distance(peak) > NEAR_M:
                continue
            whole = near[1].buffer(1e-6)
            kept = [near[0]]
        else:
            kept = [rings for rings, shape in shapes if whole.contains(shape.representative_point())]
        if kept:
            own.append(MapBand(lower=band.lower, polygons=tuple(kept)))
    return tuple(own)


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """How a camera shows a spot: pixels per metre at its peak, and the share of its floor that is to be seen."""

    camera: Camera
    calibration: Calibration
    size: tuple[int, int]
    behind: shapely.Geometry
    px_per_m: float
    share: float


def _view(data: WeekData, camera: Camera, band: MapBand, at: Point) -> _View | None:
    """Return how a camera's picture shows a spot; None when it does not."""
    calibration, size = in_force(data, camera), camera.picture_px
    if calibration is None or camera.picture is None or size is None:
        return None
    view = view_polygon(camera, calibration=calibration)
    fine = float(ground_resolution(calibration.homography, [at], picture_px=size)[0])
    if view is None or not view.intersects(shapely.Point(at)) or not np.isfinite(fine):
        return None
    behind = hidden(camera, calibration=calibration, fixtures=floor_fixtures(data))
    free = shapely.box(0, 0, *size).difference(behind)
    floor = _points(band)
    uv = to_image(calibration.homography, floor, picture_px=size)
    seen = shapely.contains_xy(free, uv[:, 0], uv[:, 1]) & shapely.contains_xy(view, floor[:, 0], floor[:, 1])
    return _View(camera, calibration, size, behind, fine, float(seen.mean())) if seen.any() else None


def _points(band: MapBand) -> NDArray[np.float64]:
    """Return points spread over a band's floor, shape (n, 2)."""
    shape = shapely.union_all([shapely.Polygon(r[0], r[1:]).buffer(0) for r in band.polygons])
    x0, y0, x1, y1 = shape.bounds
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(x0, x1, 40), np.linspace(y0, y1, 40)))
    inside = shapely.contains_xy(shape, x, y)
    return np.column_stack([x[inside], y[inside]])


def _before(band: MapBand, behind: shapely.Geometry) -> MapBand:
    """Return a band in a picture without what fixtures hide."""
    if behind.is_empty:
        return band
    kept = []
    for rings in band.polygons:
        seen = shapely.Polygon(rings[0], rings[1:]).buffer(0).difference(behind)
        kept += [as_rings(p) for p in shapely.get_parts(seen) if p.geom_type == "Polygon" and p.area >= SMALLEST_PX2]
    return MapBand(lower=band.lower, polygons=tuple(kept))


def _curved(band: MapBand, edges: Edges | None) -> list[Polygon]:
    """Return a band's polygons as the page draws them: curves, with straight edges along fixtures."""
    return [
        tuple(heat.sampled(r, sharp=edges.holds(r) if edges is not None else [False] * len(r)) for r in rings)
        for rings in band.polygons
    ]


def _cut(bands: Sequence[MapBand], *, size: tuple[int, int], peak: Point) -> tuple[float, float, float, float]:
    """Return the part of the picture to show: around the bands, of a fixed shape, inside the picture."""
    width, height = size
    points = np.array([p for band in bands for rings in band.polygons for p in rings[0]])
    low, high = points.min(axis=0), points.max(axis=0)
    wide = max(SMALLEST_SHARE * width, MARGIN * (high[0] - low[0]), MARGIN * (high[1] - low[1]) * ASPECT)
    wide = min(wide, width, height * ASPECT)
    tall = wide / ASPECT
    is_whole = high[0] - low[0] <= wide and high[1] - low[1] <= tall
    middle = (low + high) / 2 if is_whole else np.array(peak)
    x = float(np.clip(middle[0] - wide / 2, 0, width - wide))
    y = float(np.clip(middle[1] - tall / 2, 0, height - tall))
    return round(x), round(y), round(x) + round(wide), round(y) + round(tall)


def _inside(band: MapBand, extent: tuple[float, float, float, float]) -> MapBand:
    """Return a band without what lies outside the cut."""
    frame = shapely.box(*extent).buffer(40)
    kept = []
    for rings in band.polygons:
        cut = shapely.Polygon(rings[0], rings[1:]).buffer(0).intersection(frame)
        for part in shapely.get_parts(cut):
            if part.geom_type == "Polygon" and part.area >= 4:
                ends = (part.exterior, *part.interiors)
                kept.append(tuple(tuple((round(a, 1), round(b, 1)) for a, b in r.coords[:-1]) for r in ends))
    return MapBand(lower=band.lower, polygons=tuple(kept))
