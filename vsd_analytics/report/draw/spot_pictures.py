"""The surroundings of a numbered spot: the empty scene of the camera that shows it best, else that part of the floor.

Either is cut to the spot and carries the spot's own bands. A camera's picture ends somewhere: a spot at its very edge
is shown on the floor, where there is something on all its sides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

from vsd_analytics.figures.cell_places import as_rings
from vsd_analytics.figures.week import bands as heat
from vsd_analytics.figures.week.data import WeekData, in_force
from vsd_analytics.figures.week.density import floor_fixtures
from vsd_analytics.figures.week.model_map import FloorMap, MapBand, MapFixture, MapImage, Point, Polygon, SpotPicture
from vsd_analytics.geometry.camera_views import view_polygon
from vsd_analytics.geometry.embedded_pictures import scene_image
from vsd_analytics.geometry.homography import ground_resolution, to_floor, to_image
from vsd_analytics.geometry.occlusion import hidden
from vsd_analytics.report.draw.floor_frame import Edges
from vsd_analytics.site.model import Calibration, Camera

WIDTH_PX: Final = 640
MAX_BYTES: Final = 7_000
ASPECT: Final = 16 / 9
SEEN_SHARE: Final = 0.5
SMALLEST_PX2: Final = 16.0
AROUND_M: Final = 3.0
"""What a camera shows of a spot is asked of the floor so near to its peak."""
NEAR_M: Final = 1.0
"""A spot's peak may lie this far beside its band."""
MARGIN: Final = 1.35
"""The cut is so many times as wide as the bands it shows, if the picture is."""
ACROSS_M: Final = 6.0
"""No cut of a picture shows less floor than this across: the room must stay recognisable."""
SMALLEST_SHARE: Final = 0.25
"""No cut is narrower than this share of the picture: it would be coarse."""
EDGE_SHARE: Final = 0.2
"""A peak nearer than this share to an edge of the cut has nothing around it there."""
FLOOR_M: Final = (11.0, 16.0)
"""Narrowest and widest cut of a floor."""
BESIDE_M: Final = 1.5
"""A cut of a floor may run so far beyond the floor's edge."""


def spot_pictures(data: WeekData, floor: FloorMap, *, spots: Sequence[tuple[int, Point]]) -> tuple[SpotPicture, ...]:
    """Return the pictures of the spots: of a camera that shows it well, else of the floor.

    Args:
        data: The week.
        floor: The floor's map.
        spots: Number and peak of each spot, floor metres.
    """
    return tuple(
        spot_picture(data, floor.bands, fixtures=floor.fixtures, number=number, at=at)
        or floor_picture(floor, number=number, at=at)
        for number, at in spots
    )


def floor_picture(floor: FloorMap, *, number: int, at: Point) -> SpotPicture:
    """Return the part of a floor around a spot, with the spot's own bands.

    As wide as `MARGIN` times the bands, within `FLOOR_M`; a spot larger than that is shown around its peak.

    Args:
        floor: The floor's map.
        number: Number of the spot.
        at: Its peak, floor metres.
    """
    own = own_bands(floor.bands, at)
    points = np.array([at, *(p for band in own for rings in band.polygons for p in rings[0])])
    low, high = points.min(axis=0), points.max(axis=0)
    wide = float(np.clip(MARGIN * max(high[0] - low[0], (high[1] - low[1]) * ASPECT), *FLOOR_M))
    tall = wide / ASPECT
    is_whole = high[0] - low[0] <= wide and high[1] - low[1] <= tall
    middle = (low + high) / 2 if is_whole else np.array(at)
    x0, y0 = (
        float(np.clip(m - side / 2, a - BESIDE_M, max(a - BESIDE_M, b + BESIDE_M - side)))
        for m, side, a, b in zip(middle, (wide, tall), floor.extent[:2], floor.extent[2:], strict=True)
    )
    extent = (round(x0, 3), round(y0, 3), round(x0 + wide, 3), round(y0 + tall, 3))
    shown = FloorMap(
        kind=floor.kind,
        title=floor.title,
        extent=extent,
        bands=own,
        spots=tuple(s for s in floor.spots if s.number == number),
    )
    return SpotPicture(number=number, across_m=round(wide, 3), shown=shown)


def spot_picture(
    data: WeekData, bands: Sequence[MapBand], *, fixtures: Sequence[MapFixture] = (), number: int, at: Point
) -> SpotPicture | None:
    """Return the picture of one spot.

    The camera is the one that shows the peak with most pixels per metre of floor (`ground_resolution`) among those
    with a picture and a view that holds it, and that show at least `SEEN_SHARE` of the spot's floor within `AROUND_M`;
    floor outside the picture's frame, or behind fixtures of known height, counts as not shown.

    Args:
        data: The week.
        bands: The bands of the floor's map, floor metres.
        fixtures: What they were cut by.
        number: Number of the spot.
        at: Its peak, floor metres.

    Returns:
        None when no such camera sees at least that share of it, it lies at the edge of the picture (`EDGE_SHARE`), or
        it has no band.
    """
    own = own_bands(bands, at)
    seen = [v for c in data.cameras if own and (v := _view(data, c, own[0], at)) is not None]
    best = max((v for v in seen if v.share >= SEEN_SHARE), key=lambda v: v.px_per_m, default=None)
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
    m_per_px = _m_per_px(homography, (float(peak[0]), float(peak[1])), size=size)
    extent = _cut(shown, size=size, peak=(float(peak[0]), float(peak[1])), least_px=ACROSS_M / m_per_px)
    if not _is_inside((float(peak[0]), float(peak[1])), extent):
        return None
    return SpotPicture(
        number=number,
        camera_id=camera.camera_id,
        camera_name=camera.name,
        px_per_m=best.px_per_m,
        across_m=(extent[2] - extent[0]) * m_per_px,
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
    """How a camera shows a spot: pixels per metre at its peak, and the share of its floor that it shows."""

    camera: Camera
    calibration: Calibration
    size: tuple[int, int]
    behind: shapely.Geometry
    px_per_m: float
    share: float


def _view(data: WeekData, camera: Camera, band: MapBand, at: Point) -> _View | None:
    """Return how a camera's picture shows a spot; None when it does not."""
    calibration, size = in_force(data, camera), camera.picture_px
    if calibration is None or camera.planes or camera.picture is None or size is None:  # planes: no one homography
        return None
    view = view_polygon(camera, calibration=calibration)
    fine = float(ground_resolution(calibration.homography, [at], picture_px=size)[0])
    if view is None or not view.intersects(shapely.Point(at)) or not np.isfinite(fine):
        return None
    behind = hidden(camera, calibration=calibration, fixtures=floor_fixtures(data))
    free = shapely.box(0, 0, *size).difference(behind)
    floor = _points(band, around=at)
    uv = to_image(calibration.homography, floor, picture_px=size)
    seen = shapely.contains_xy(free, uv[:, 0], uv[:, 1]) & shapely.contains_xy(view, floor[:, 0], floor[:, 1])
    return _View(camera, calibration, size, behind, fine, float(seen.mean())) if seen.any() else None


def _points(band: MapBand, *, around: Point) -> NDArray[np.float64]:
    """Return points spread over a band's floor near a peak, shape (n, 2); a band may run on into the next spot."""
    shape = shapely.union_all([shapely.Polygon(r[0], r[1:]).buffer(0) for r in band.polygons])
    shape = shape.intersection(shapely.Point(around).buffer(AROUND_M))
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


def _m_per_px(homography: NDArray[np.float64], at: Point, *, size: tuple[int, int]) -> float:
    """Return how much floor a pixel of the picture's row through a point of it spans, metres."""
    left, right = to_floor(homography, [(at[0] - 0.5, at[1]), (at[0] + 0.5, at[1])], picture_px=size)
    return float(np.hypot(*(right - left)))


def _is_inside(peak: Point, extent: tuple[float, float, float, float]) -> bool:
    """Tell whether a peak has enough of the cut on all its sides."""
    x0, y0, x1, y1 = extent
    shares = (peak[0] - x0) / (x1 - x0), (peak[1] - y0) / (y1 - y0)
    return all(EDGE_SHARE <= s <= 1 - EDGE_SHARE for s in shares)


def _cut(
    bands: Sequence[MapBand], *, size: tuple[int, int], peak: Point, least_px: float
) -> tuple[float, float, float, float]:
    """Return the part of the picture to show: around the bands, of a fixed shape, inside the picture."""
    width, height = size
    points = np.array([p for band in bands for rings in band.polygons for p in rings[0]])
    low, high = points.min(axis=0), points.max(axis=0)
    wide = max(SMALLEST_SHARE * width, least_px, MARGIN * (high[0] - low[0]), MARGIN * (high[1] - low[1]) * ASPECT)
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
