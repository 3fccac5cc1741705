"""What fixtures hide of the floor in a camera's picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from vsd_analytics.geometry.homography import projection
from vsd_analytics.site.model import Calibration, Camera, Fixture

NEAR_M = 0.3
"""Parts of a fixture nearer to the camera than this are cut off: at distance 0 the projection divides by 0."""
FAR_PX = 1e5

Array = NDArray[np.float64]


def hidden(camera: Camera, *, calibration: Calibration, fixtures: Sequence[Fixture]) -> shapely.Geometry:
    """Return the part of a picture in which fixtures of known height hide the floor, in pixels.

    A line of sight that meets a fixture meets it before the floor behind it, so its whole outline hides floor.

    Args:
        camera: A camera with a picture size.
        calibration: The one in force.
        fixtures: The fixtures of its floor; those without a height hide nothing.

    Returns:
        A polygon or several; empty where nothing is known to hide any floor.
    """
    assert camera.picture_px is not None
    matrix = projection(calibration.homography, picture_px=camera.picture_px)
    if matrix is None:
        return shapely.Polygon()
    faces = [
        face
        for f in fixtures
        if f.height_m is not None
        for corners in _faces(np.array(f.polygon, dtype=np.float64), f.height_m)
        if (face := _project(matrix, corners)) is not None
    ]
    frame = shapely.box(0, 0, *camera.picture_px)
    return shapely.union_all(faces).intersection(frame) if faces else shapely.Polygon()


def _faces(ring: Array, height_m: float) -> list[Array]:
    """Return the top and the sides of a prism as rings of (x, y, z)."""
    low = np.column_stack([ring, np.zeros(len(ring))])
    top = np.column_stack([ring, np.full(len(ring), height_m)])
    after = np.roll(np.arange(len(ring)), -1)
    return [top, *(np.array([low[i], low[j], top[j], top[i]]) for i, j in enumerate(after))]


def _project(matrix: Array, corners: Array) -> shapely.Geometry | None:
    """Return a flat ring as seen, cut off near the camera; None when all of it is behind the camera."""
    seen = np.column_stack([corners, np.ones(len(corners))]) @ matrix.T
    visible = []
    for here, after in zip(seen, np.roll(seen, -1, axis=0), strict=True):
        if here[2] >= NEAR_M:
            visible.append(here)
        if (here[2] >= NEAR_M) != (after[2] >= NEAR_M):
            share = (NEAR_M - here[2]) / (after[2] - here[2])
            visible.append(here + share * (after - here))
    if len(visible) < 3:
        return None
    points = np.array(visible)
    return shapely.Polygon(np.clip(points[:, :2] / points[:, 2:], -FAR_PX, FAR_PX)).buffer(0)
