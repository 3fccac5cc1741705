"""What cameras see of a floor; which of them counts where several do is in `vsd_analytics.geometry.ownership`.

The maps themselves are in `vsd_analytics.geometry.homography` and can be had from here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from vsd_analytics.geometry.homography import (
    Array,
    Fit,
    as_matrix,
    fit_homography,
    ground_resolution,
    ground_sign,
    project,
    to_floor,
    to_image,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from shapely import Polygon
    from shapely.geometry.base import BaseGeometry

    from vsd_analytics.site.model import Calibration, Camera, Floor

__all__ = [
    "Bounds",
    "Fit",
    "fit_homography",
    "ground_resolution",
    "ground_sign",
    "plan_bounds",
    "seen_floor",
    "seen_share",
    "to_floor",
    "to_image",
    "unseen",
    "view_polygon",
]

Bounds = tuple[float, float, float, float]
"""(x_min, y_min, x_max, y_max) in floor metres."""

VIEW_REACH_M = 30.0
"""Farthest that a camera is assumed to see, in metres from the nearest floor it sees."""

DISC_SEGMENTS = 16
"""Segments of a quarter of such a disc."""

SLIT_M = 0.05
"""Width of the cut that joins a hole in a view to its border: a view is one outline."""

NEAREST_TO_FARTHEST = 1000.0
"""Depth ratio at which the view is cut off before it reaches the horizon."""


def plan_bounds(floor: Floor) -> Bounds | None:
    """Return the part of the floor its plan shows, or None without a readable plan."""
    from vsd_analytics.geometry.picture_size import picture_size

    if floor.plan is None or floor.plan_m_per_px is None:
        return None
    size = picture_size(floor.plan)
    if size is None:
        return None
    x, y = floor.plan_origin_m
    return x, y, x + size[0] * floor.plan_m_per_px, y + size[1] * floor.plan_m_per_px


def view_polygon(camera: Camera, *, calibration: Calibration | None, bounds: Bounds | None = None) -> Polygon | None:
    """Return the part of the floor a camera sees.

    The camera's own `view` when it has one. Else the picture rectangle below the horizon through the homography, at
    most `VIEW_REACH_M` from the floor at the bottom centre of the picture, which is the nearest it sees. Floor in its
    `ignore_px` is not seen in either case, as far as a calibration says where it is.

    Args:
        camera: The camera.
        calibration: The one in force; None when the engine sends metres.
        bounds: Part of the floor to keep, such as the plan's.

    Returns:
        A polygon in floor metres, empty when nothing of it lies within `bounds`; None when the view is unknown
        (no `view`, and no homography or picture size).
    """
    import shapely

    if camera.view is not None:
        view = shapely.Polygon(camera.view)
    elif calibration is None or camera.picture_px is None:
        return None
    else:
        view = seen_floor(calibration.homography, picture_px=camera.picture_px)
    if (ignored := ignored_floor(camera, calibration)) is not None:
        view = one_ring(_as_polygon(shapely.make_valid(view).difference(ignored)))
    return view if bounds is None else _as_polygon(view.intersection(shapely.box(*bounds)))


def ignored_floor(camera: Camera, calibration: Calibration | None) -> BaseGeometry | None:
    """Return the floor in a camera's `ignore_px`; None where nothing is ignored, or nothing says where it is."""
    import shapely

    if not camera.ignore_px or calibration is None or camera.picture_px is None:
        return None
    ignored = shapely.union_all([shapely.Polygon(corners) for corners in camera.ignore_px])
    rest = shapely.box(0, 0, *camera.picture_px).difference(ignored)
    return seen_floor(calibration.homography, picture_px=camera.picture_px, without=rest)


def one_ring(part: Polygon) -> Polygon:
    """Return a polygon without holes: each is cut open to the border at the nearest spot."""
    import shapely

    while part.interiors:
        slit = shapely.shortest_line(part.interiors[0], part.exterior).buffer(SLIT_M / 2, cap_style="square")
        part = max(shapely.get_parts(part.difference(slit)), key=shapely.area)
    return part


def seen_floor(
    homography: ArrayLike, *, picture_px: tuple[int, int], without: BaseGeometry | None = None
) -> BaseGeometry:
    """Return the floor seen in a picture: its part below the horizon, mapped, within `VIEW_REACH_M`.

    Args:
        homography: 3x3, pixels to metres.
        picture_px: Width and height of the picture.
        without: Part of the picture that shows something else; then the floor seen may have several parts.
    """
    import shapely

    h = as_matrix(homography)
    width, height = map(float, picture_px)
    sign = ground_sign(h, picture_px=picture_px)
    nearest = np.array([[width / 2, height]])
    corners = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    w_corners, w_nearest = (sign * (uv @ h[2, :2] + h[2, 2]) for uv in (corners, nearest))
    ground = _cut(corners, w_corners - w_nearest[0] / NEAREST_TO_FARTHEST)
    reach = shapely.Point(*project(h, nearest, sign=sign)[0]).buffer(VIEW_REACH_M, quad_segs=32)
    if without is None:
        return _as_polygon(shapely.Polygon(project(h, ground, sign=sign)).intersection(reach))
    rest = shapely.Polygon(ground).difference(without)
    return shapely.make_valid(shapely.transform(rest, lambda uv: project(h, uv, sign=sign))).intersection(reach)


def _cut(polygon: Array, height: Array) -> Array:
    """Return the part of a convex polygon on which `height`, linear and given at the corners, is not negative."""
    kept = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if height[i] >= 0:
            kept.append(polygon[i])
        if (height[i] >= 0) != (height[j] >= 0):
            share = height[i] / (height[i] - height[j])
            kept.append(polygon[i] + share * (polygon[j] - polygon[i]))
    return np.array(kept)


def unseen(floor: Floor, *, cameras: Iterable[Camera], bounds: Bounds) -> list[Polygon] | None:
    """Return the floor no camera sees: `bounds` minus the union of the views of the floor's cameras.

    Args:
        floor: The floor.
        cameras: Cameras of the site; those on other floors are left out.
        bounds: The part of the floor that counts, such as `plan_bounds`.

    Returns:
        Polygons, possibly with holes; None when what some camera sees is unknown.
    """
    import shapely

    views = [view_polygon(c, calibration=_latest(c), bounds=bounds) for c in cameras if c.floor_id == floor.floor_id]
    known = [view for view in views if view is not None]
    if len(known) < len(views):
        return None
    rest = shapely.box(*bounds).difference(shapely.union_all(known))
    return [part for part in shapely.get_parts(rest) if part.geom_type == "Polygon" and part.area > 0]


def seen_share(xy: ArrayLike, *, views: Sequence[Polygon], radius_m: float, bounds: Bounds | None = None) -> Array:
    """Return how much of the disc around each point lies in the union of the views.

    At the border of a view, neighbours outside it are missing, so too few pairs are found. A place whose seen share is
    below `figures.hotspot_windows.SEEN_SHARE` is not ranked by risk.

    Args:
        xy: Points in floor metres, shape (n, 2).
        views: What the cameras see.
        radius_m: Radius of the discs, such as the legal distance.
        bounds: Only the disc's part within counts, such as `plan_bounds`.

    Returns:
        Share of the disc's area, 0 to 1, shape (n,); 0 where no part of a disc lies within `bounds`.
    """
    import shapely

    points = np.asarray(xy, dtype=np.float64).reshape(-1, 2)
    disc = shapely.get_coordinates(shapely.Point(0.0, 0.0).buffer(radius_m, quad_segs=DISC_SEGMENTS))
    discs = shapely.polygons(points[:, None] + disc)
    if bounds is not None:
        discs = _clipped(discs, shapely.box(*bounds))
    whole, seen = shapely.area(discs), shapely.area(_clipped(discs, shapely.union_all(views)))
    return np.asarray(np.divide(seen, whole, out=np.zeros(len(points)), where=whole > 0))


def _clipped(shapes: NDArray[np.object_], clip: BaseGeometry) -> NDArray[np.object_]:
    """Return the part of each shape within `clip`; only those that its edge cuts are computed."""
    import shapely

    shapely.prepare(clip)
    parts, is_cut = shapes.copy(), ~shapely.covers(clip, shapes)
    parts[is_cut] = shapely.intersection(shapes[is_cut], clip)
    return parts


def _latest(camera: Camera) -> Calibration | None:
    return camera.calibrations[-1] if camera.calibrations else None


def _as_polygon(shape: object) -> Polygon:
    """Return the largest polygon of a shape, empty when it has none (a view of convex parts has one)."""
    import shapely

    parts = [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon"]
    return max(parts, key=lambda part: part.area, default=shapely.Polygon())
