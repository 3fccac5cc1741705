"""Camera picture <-> floor plane: homographies, what cameras see, and which camera owns a cell seen by several.

A homography H maps pixels to metres: (x, y, w) = H (u, v, 1), floor position (x/w, y/w). Its w is proportional to one
over the depth of the floor point, changes sign at the horizon, and has on the ground in front of the camera the sign
it has at the bottom centre of the picture (Hartley and Zisserman, Multiple View Geometry, 2nd ed., 8.6). Points on
the other side are not on the floor: they are NaN here, never a wrong place.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vsd_analytics.errors import CalibrationError

if TYPE_CHECKING:
    from shapely import Polygon

    from vsd_analytics.site import Calibration, Camera, Floor

Array = NDArray[np.float64]
Bounds = tuple[float, float, float, float]
"""(x_min, y_min, x_max, y_max) in floor metres."""

VIEW_REACH_M = 30.0
"""No camera is taken to see farther than this from the nearest floor it sees."""

NOMINAL_BOTTOM_PX = (1000.0, 2000.0)
"""Stands for the bottom centre of a picture of unknown size: below the horizon of any camera that looks ahead, and
above the inverted horizon of one that looks straight down within about 25 degrees."""

NEAREST_TO_FARTHEST = 1000.0
"""Depth ratio at which the view is cut off before it reaches the horizon."""

DEGENERATE_SHARE = 0.01
"""Points whose spread across is less than this share of their spread along lie on a line."""

VOTE_CELLS = 5
"""Side of the square of cells that vote on the owner of their middle."""

MIN_POINTS = 4


@dataclass(frozen=True, slots=True)
class Fit:
    """A homography made from point pairs.

    Attributes:
        homography: 3x3, rows, pixels to metres, last entry 1 unless it is 0.
        rmse_m: Root mean square over the points of the distance between where they are and where they are mapped.
        errors_m: That distance for each point, shape (n,).
    """

    homography: tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]
    rmse_m: float
    errors_m: Array


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


def ground_sign(homography: ArrayLike, *, picture_px: tuple[int, int] | None = None) -> float:
    """Return the sign (1.0 or -1.0) that w = h31 u + h32 v + h33 has on the floor in front of the camera.

    It is the sign at the bottom centre of the picture, or at `NOMINAL_BOTTOM_PX` when the size is unknown.

    Args:
        homography: 3x3, pixels to metres.
        picture_px: Width and height of the picture.
    """
    h = _matrix(homography)
    u, v = (picture_px[0] / 2, float(picture_px[1])) if picture_px else NOMINAL_BOTTOM_PX
    return -1.0 if h[2, 0] * u + h[2, 1] * v + h[2, 2] < 0 else 1.0


def to_floor(homography: ArrayLike, uv: ArrayLike, *, picture_px: tuple[int, int] | None = None) -> Array:
    """Map picture points to the floor: (x/w, y/w) with (x, y, w) = H (u, v, 1).

    Args:
        homography: 3x3, pixels to metres.
        uv: Pixels, shape (n, 2); points outside the picture are mapped too.
        picture_px: Width and height of the picture; decides which side of the horizon is floor (`ground_sign`).

    Returns:
        Metres, shape (n, 2); NaN for points at or above the horizon and for NaN.
    """
    h = _matrix(homography)
    return _project(h, uv, sign=ground_sign(h, picture_px=picture_px))


def to_image(homography: ArrayLike, xy: ArrayLike, *, picture_px: tuple[int, int] | None = None) -> Array:
    """Map floor points to the picture, the inverse of `to_floor`.

    Args:
        homography: 3x3, pixels to metres.
        xy: Metres, shape (n, 2).
        picture_px: Width and height of the picture.

    Returns:
        Pixels, shape (n, 2); NaN for points at or behind the plane of the camera.
    """
    h = _matrix(homography)
    # H (u, v, 1) = w (x, y, 1), so the third entry of H^-1 (x, y, 1) is 1/w and has the sign of w
    return _project(_inverse(h), xy, sign=ground_sign(h, picture_px=picture_px))


def ground_resolution(homography: ArrayLike, xy: ArrayLike, *, picture_px: tuple[int, int] | None = None) -> Array:
    """Return how finely the picture shows the floor: sqrt |det J| of the map from metres to pixels.

    With G = H^-1 and w' the third entry of G (x, y, 1): det J = det G / w'^3.

    Args:
        homography: 3x3, pixels to metres.
        xy: Metres, shape (n, 2).
        picture_px: Width and height of the picture.

    Returns:
        Pixels per metre (geometric mean over directions), shape (n,); NaN at or behind the plane of the camera.
    """
    h = _matrix(homography)
    g = _inverse(h)
    w = _points(xy) @ g[2, :2] + g[2, 2]
    w = np.where(w * ground_sign(h, picture_px=picture_px) > 0, np.abs(w), np.nan)
    return np.asarray(np.sqrt(np.abs(np.linalg.det(g)) / w**3))


def fit_homography(points: Sequence[tuple[float, float, float, float]] | ArrayLike) -> Fit:
    """Return the homography with the least squared error on the floor over pairs of picture and floor points.

    `cv2.findHomography` works in single precision, so pixels and metres are centred and scaled first.

    Args:
        points: (u, v, x, y) per point, pixels and metres, shape (n, 4), n >= 4.

    Raises:
        CalibrationError: Fewer than four different points (E401); points that lie on a line, in the picture or on the
            floor, or that no view from one side of the floor can show (E402).
    """
    import cv2

    pairs = np.unique(np.asarray(points, dtype=np.float64).reshape(-1, 4), axis=0)
    uv, xy = pairs[:, :2], pairs[:, 2:]
    if min(len(np.unique(uv, axis=0)), len(np.unique(xy, axis=0))) < MIN_POINTS:
        raise CalibrationError(
            f"{len(pairs)} different points are too few for a calibration",
            code="E401",
            why="four points fix it, a fifth and sixth show how good it is",
            mend="add points spread over the floor: u,v in the picture and x,y on the floor plan",
        )
    for side, where in ((uv, "in the picture"), (xy, "on the floor")):
        spread = np.linalg.svd(side - side.mean(axis=0), compute_uv=False)
        if spread[1] < DEGENERATE_SHARE * spread[0]:
            raise _degenerate(f"the points lie on one line {where}")
    from_uv, from_xy = _centring(uv), _centring(xy)
    fitted, _ = cv2.findHomography(_project(from_uv, uv), _project(from_xy, xy), 0)
    if fitted is None or np.linalg.cond(fitted) > 1e8:
        raise _degenerate("three of the four points lie on one line")
    h = _inverse(from_xy) @ fitted @ from_uv
    h = h / (h[2, 2] if abs(h[2, 2]) > 1e-12 * np.abs(h).max() else np.abs(h).max())
    w = uv @ h[2, :2] + h[2, 2]
    if not (np.all(w > 0) or np.all(w < 0)):
        raise _degenerate("the points lie on both sides of the horizon they define")
    given = np.asarray(points, dtype=np.float64).reshape(-1, 4)
    errors = np.hypot(*(_project(h, given[:, :2]) - given[:, 2:]).T)
    (a, b, c), (d, e, f), (g, i, j) = h.tolist()
    return Fit(((a, b, c), (d, e, f), (g, i, j)), float(np.sqrt(np.mean(errors**2))), errors)


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

    h = _matrix(homography)
    width, height = map(float, picture_px)
    sign = ground_sign(h, picture_px=picture_px)
    nearest = np.array([[width / 2, height]])
    corners = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    w_corners, w_nearest = (sign * (uv @ h[2, :2] + h[2, 2]) for uv in (corners, nearest))
    ground = _cut(corners, w_corners - w_nearest[0] / NEAREST_TO_FARTHEST)
    reach = shapely.Point(*_project(h, nearest, sign=sign)[0]).buffer(VIEW_REACH_M, quad_segs=32)
    return _as_polygon(shapely.Polygon(_project(h, ground, sign=sign)).intersection(reach))


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


def _matrix(homography: ArrayLike) -> Array:
    return np.asarray(homography, dtype=np.float64).reshape(3, 3)


def _inverse(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _points(points: ArrayLike) -> Array:
    return np.asarray(points, dtype=np.float64).reshape(-1, 2)


def _project(matrix: Array, points: ArrayLike, *, sign: float = 0.0) -> Array:
    """Apply a 3x3 projective map; with a sign, points whose third coordinate has another are NaN."""
    mapped = _points(points) @ matrix[:, :2].T + matrix[:, 2]
    w = mapped[:, 2:]
    w = np.where(w * sign > 0, w, np.nan) if sign else w
    return np.asarray(mapped[:, :2] / w)


def _centring(points: Array) -> Array:
    """Return the similarity that moves points to mean 0 and root mean square distance sqrt 2."""
    middle = points.mean(axis=0)
    scale = np.sqrt(2.0) / np.sqrt(np.mean(np.sum((points - middle) ** 2, axis=1)))
    return np.array([[scale, 0.0, -scale * middle[0]], [0.0, scale, -scale * middle[1]], [0.0, 0.0, 1.0]])


def _degenerate(why: str) -> CalibrationError:
    return CalibrationError(
        "these points cannot fix a calibration",
        code="E402",
        why=why,
        mend="choose points far apart, not three of four on a line, and check that u,v (picture) and x,y (floor) of "
        "each row are the same spot",
    )
