"""Which camera counts where several cover the same floor: a map made of calibrations and views alone, of no record."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.geometry.camera_views import view_polygon
from vsd_analytics.geometry.homography import Array, ground_resolution

if TYPE_CHECKING:
    from shapely import Polygon

    from vsd_analytics.site.model import Camera, Floor

VOTE_CELLS = 5
"""Side of the square of cells that vote on the owner of their middle."""

PAIR_REACH_M = 1.0
"""Two people 2 m apart are this far from their midpoint: a camera that sees so far around it sees both."""

CUT_FEET_M = 2.0
"""Engines send boxes that the picture's edge cuts off, with feet up to about this far outside the view."""


class OwnerCell(NamedTuple):
    """A cell that several cameras cover, and the one that counts there.

    Attributes:
        camera_id: The camera that counts.
        cx: floor(x / cell_m).
        cy: floor(y / cell_m).
    """

    camera_id: str
    cx: int
    cy: int


def owner_cells(cameras: Iterable[Camera], *, cell_m: float, floor: Floor | None = None) -> list[OwnerCell]:
    """Return which camera counts in each floor cell from which two or more cameras may report people.

    A camera may report people up to `CUT_FEET_M` outside its view, where the edge of its picture cuts them off. The
    cameras of a cell are ranked, by its middle m:

    1. by how well they cover it: all within `PAIR_REACH_M` of m in view (so that both people of a pair with midpoint m
       are), only m in view, or m just outside;
    2. by `ground_resolution` at m; a camera without homography comes last, nearest middle of view first. Just outside,
       the nearest view comes first;
    3. among the cameras that cover the cell equally well, the one that most cells in view in the square of `VOTE_CELLS`
       around it chose by 1 and 2 is the owner, so that borders are short; a tie leaves the choice.

    Args:
        cameras: Cameras of the site, each with the latest of its calibrations. Those whose view is unknown take no
            part.
        cell_m: Side of a cell in metres.
        floor: Only this floor; None = all floors, one after the other.

    Returns:
        One row per cell and floor, by cx and cy; cells from which one camera at most may report are not listed.
    """
    by_floor: dict[str, list[tuple[Camera, Polygon]]] = {}
    for camera in cameras:
        calibration = camera.calibrations[-1] if camera.calibrations else None
        view = view_polygon(camera, calibration=calibration)
        if view is not None and not view.is_empty and (floor is None or camera.floor_id == floor.floor_id):
            by_floor.setdefault(camera.floor_id, []).append((camera, view))
    return [cell for seen in by_floor.values() if len(seen) > 1 for cell in _owners(seen, cell_m=cell_m)]


def _owners(seen: Sequence[tuple[Camera, Polygon]], *, cell_m: float) -> list[OwnerCell]:
    """Return the owners of the cells of one floor from which two or more of its cameras may report."""
    reach = [view.buffer(CUT_FEET_M) for _, view in seen]
    overlaps = [one.intersection(other).bounds for one, other in combinations(reach, 2) if one.intersects(other)]
    if not overlaps:
        return []
    low = np.floor(np.min(overlaps, axis=0)[:2] / cell_m).astype(np.int64)
    high = np.floor(np.max(overlaps, axis=0)[2:] / cell_m).astype(np.int64) + 1
    cx, cy = (
        grid.ravel() for grid in np.meshgrid(np.arange(low[0], high[0]), np.arange(low[1], high[1]), indexing="ij")
    )
    middles = np.column_stack((cx + 0.5, cy + 0.5)) * cell_m
    cover = np.stack([_cover(view, middles) for _, view in seen])
    shared = np.sum(cover > 0, axis=0) > 1
    is_best = (cover == cover.max(axis=0)) & shared
    merit = np.full(cover.shape, -np.inf)
    for row, (camera, view) in enumerate(seen):
        merit[row, is_best[row]] = _merit(camera, view, middles[is_best[row]], is_outside=cover[row, is_best[row]] == 1)
    chosen = np.where(shared, np.argmax(merit, axis=0), -1)
    voting = np.where(cover.max(axis=0) > 1, chosen, -1)
    votes = _votes(voting.reshape(high - low), len(seen)).reshape(len(seen), -1).astype(np.float64)
    votes[~is_best] = -1.0
    votes[chosen, np.arange(len(chosen))] += 0.5
    owner = np.argmax(votes, axis=0)
    rows = zip(owner[shared].tolist(), cx[shared].tolist(), cy[shared].tolist(), strict=True)
    return [OwnerCell(seen[i][0].camera_id, x, y) for i, x, y in rows]


def _cover(view: Polygon, xy: Array) -> NDArray[np.int64]:
    """Return how well a view covers points: 3 with all around, 2 the point, 1 just outside, 0 not at all."""
    import shapely

    rings = (view.buffer(CUT_FEET_M), view, view.buffer(-PAIR_REACH_M))
    return np.asarray(sum(shapely.contains_xy(ring, xy[:, 0], xy[:, 1]).astype(np.int64) for ring in rings))


def _merit(camera: Camera, view: Polygon, xy: Array, *, is_outside: NDArray[np.bool_]) -> Array:
    """Return pixels per metre; negative metres from the view outside, and from its middle without homography."""
    import shapely

    if camera.calibrations:
        fineness = ground_resolution(camera.calibrations[-1].homography, xy, picture_px=camera.picture_px)
        inside = np.where(np.isnan(fineness), 0.0, fineness)
    else:
        middle = view.centroid
        inside = -1.0 - np.hypot(xy[:, 0] - middle.x, xy[:, 1] - middle.y)
    return np.where(is_outside, -shapely.distance(shapely.points(xy), view), inside)


def _votes(chosen: NDArray[np.int64], n_cameras: int) -> NDArray[np.int64]:
    """Return, per camera, how many cells of the `VOTE_CELLS` square around each cell chose it; -1 chooses none."""
    # Added up along both sides: importing scipy.ndimage for its convolve takes longer than the sums.
    height, width = chosen.shape
    padded = np.pad(chosen, VOTE_CELLS // 2, constant_values=-1)
    own = np.stack([padded == i for i in range(n_cameras)]).astype(np.int64)
    rows = np.sum([own[:, k : k + height] for k in range(VOTE_CELLS)], axis=0)
    return np.asarray(np.sum([rows[:, :, k : k + width] for k in range(VOTE_CELLS)], axis=0))
