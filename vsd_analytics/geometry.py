"""What cameras see of a floor, and which one owns a cell that several see.

The maps themselves are in `vsd_analytics.homography` and can be had from here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vsd_analytics.homography import (
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
    from shapely import Polygon

    from vsd_analytics.site import Calibration, Camera, Floor

__all__ = [
    "Bounds",
    "Fit",
    "OwnerCell",
    "fit_homography",
    "ground_resolution",
    "ground_sign",
    "owner_cells",
    "plan_bounds",
    "seen_floor",
    "to_floor",
    "to_image",
    "unseen",
    "view_polygon",
]

Bounds = tuple[float, float, float, float]
"""(x_min, y_min, x_max, y_max) in floor metres."""

VIEW_REACH_M = 30.0
"""No camera is taken to see farther than this from the nearest floor it sees."""

NEAREST_TO_FARTHEST = 1000.0
"""Depth ratio at which the view is cut off before it reaches the horizon."""

VOTE_CELLS = 5
"""Side of the square of cells that vote on the owner of their middle."""


class OwnerCell(NamedTuple):
    """A cell that several cameras see, and the one that counts there.

    Attributes:
        camera_id: The camera that counts.
        cx: floor(x / cell_m).
        cy: floor(y / cell_m).
    """

    camera_id: str
    cx: int
    cy: int


def plan_bounds(floor: Floor) -> Bounds | None:
    """Return the part of the floor its plan shows, or None without a readable plan."""
    from vsd_analytics.pictures import picture_size

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
    most `VIEW_REACH_M` from the floor at the bottom centre of the picture, which is the nearest it sees.

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
    return view if bounds is None else _as_polygon(view.intersection(shapely.box(*bounds)))


def seen_floor(homography: ArrayLike, *, picture_px: tuple[int, int]) -> Polygon:
    """Return the floor seen in a picture: its part below the horizon, mapped, within `VIEW_REACH_M`.

    Args:
        homography: 3x3, pixels to metres.
        picture_px: Width and height of the picture.
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
    return _as_polygon(shapely.Polygon(project(h, ground, sign=sign)).intersection(reach))


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


def owner_cells(cameras: Iterable[Camera], *, cell_m: float, floor: Floor | None = None) -> list[OwnerCell]:
    """Return which camera counts in each floor cell that two or more cameras see.

    It is the camera that shows the middle of the cell finest (`ground_resolution`; a camera without homography comes
    last, nearest view first), then the majority among the cells around it, so that borders are not ragged.

    Args:
        cameras: Cameras of the site, each with the latest of its calibrations. Those whose view is unknown take no
            part.
        cell_m: Side of a cell in metres.
        floor: Only this floor; None = all floors, one after the other.

    Returns:
        One row per cell and floor, by cx and cy; cells in one view only are not listed.
    """
    by_floor: dict[str, list[tuple[Camera, Polygon]]] = {}
    for camera in cameras:
        view = view_polygon(camera, calibration=_latest(camera))
        if view is not None and not view.is_empty and (floor is None or camera.floor_id == floor.floor_id):
            by_floor.setdefault(camera.floor_id, []).append((camera, view))
    return [cell for seen in by_floor.values() if len(seen) > 1 for cell in _owners(seen, cell_m=cell_m)]


def _owners(seen: Sequence[tuple[Camera, Polygon]], *, cell_m: float) -> list[OwnerCell]:
    """Return the owners of the cells of one floor that two or more of its cameras see."""
    import shapely

    views = [view for _, view in seen]
    overlaps = [one.intersection(other).bounds for one, other in combinations(views, 2) if one.intersects(other)]
    if not overlaps:
        return []
    low = np.floor(np.min(overlaps, axis=0)[:2] / cell_m).astype(np.int64)
    high = np.floor(np.max(overlaps, axis=0)[2:] / cell_m).astype(np.int64) + 1
    cx, cy = (
        grid.ravel() for grid in np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]), indexing="ij")
    )
    middles = np.column_stack((cx + 0.5, cy + 0.5)) * cell_m
    finest = np.full((len(seen), len(cx)), np.nan)
    for row, (camera, view) in enumerate(seen):
        inside = shapely.contains_xy(view, middles[:, 0], middles[:, 1])
        finest[row, inside] = _fineness(camera, view, middles[inside])
    shared = np.sum(~np.isnan(finest), axis=0) > 1
    scores = np.where(np.isnan(finest), -np.inf, finest)
    chosen = np.where(shared, np.argmax(scores, axis=0), -1)
    votes = _votes(chosen.reshape(high - low), len(seen)).reshape(len(seen), -1).astype(np.float64)
    votes[np.isnan(finest)] = -1.0  # a camera owns only what it sees
    votes[chosen, np.arange(len(chosen))] += 0.5  # a tie leaves the finest camera in place
    winner = np.argmax(votes, axis=0)
    rows = zip(winner[shared].tolist(), cx[shared].tolist(), cy[shared].tolist(), strict=True)
    return [OwnerCell(seen[i][0].camera_id, x, y) for i, x, y in rows]


def _fineness(camera: Camera, view: Polygon, xy: Array) -> Array:
    """Return pixels per metre; without a homography a negative number, the greater the nearer to the view's middle."""
    calibration = _latest(camera)
    if calibration is None:
        middle = view.centroid
        return np.asarray(-1.0 - np.hypot(xy[:, 0] - middle.x, xy[:, 1] - middle.y))
    fineness = ground_resolution(calibration.homography, xy, picture_px=camera.picture_px)
    return np.where(np.isnan(fineness), 0.0, fineness)


def _votes(chosen: NDArray[np.int64], n_cameras: int) -> NDArray[np.int64]:
    """Return, per camera, how many cells of the `VOTE_CELLS` square around each cell chose it."""
    from scipy.ndimage import convolve

    square = np.ones((VOTE_CELLS, VOTE_CELLS), dtype=np.int64)
    return np.stack([convolve((chosen == i).astype(np.int64), square, mode="constant") for i in range(n_cameras)])


def _latest(camera: Camera) -> Calibration | None:
    return camera.calibrations[-1] if camera.calibrations else None


def _as_polygon(shape: object) -> Polygon:
    """Return the largest polygon of a shape, empty when it has none (a view of convex parts has one)."""
    import shapely

    parts = [part for part in shapely.get_parts(shape) if part.geom_type == "Polygon"]
    return max(parts, key=lambda part: part.area, default=shapely.Polygon())
