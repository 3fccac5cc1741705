"""What fixtures hide of the floor in a camera's picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from vsd_analytics.homography import projection
from vsd_analytics.site import Calibration, Camera, Fixture

NEAR_M = 0.3
"""What is nearer to the camera than this is cut off before it is projected."""
FAR_PX = 1e5

Array = NDArray[np.float64]


def hidden(camera: Camera, *, calibration: Calibration, fixtures: Sequence[Fixture]) -> shapely.Geometry:
    """Return the part of a picture in which fixtures of known height stand before the floor, pixels.

    A ray of sight that meets a fixture meets it before the floor behind it, so all of its outline hides floor.

    Args:
        camera: A camera with a picture size.
        calibration: The one in force.
        fixtures: What stands on its floor; those without a height hide nothing.

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
    """Return a flat ring as seen, cut off near the camera; None when nothing of it is before the camera."""
    seen = np.column_stack([corners, np.ones(len(corners))]) @ matrix.T
    kept = []
    for here, after in zip(seen, np.roll(seen, -1, axis=0), strict=True):
        if here[2] >= NEAR_M:
            kept.append(here)
        if (here[2] >= NEAR_M) != (after[2] >= NEAR_M):
            share = (NEAR_M - here[2]) / (after[2] - here[2])
            kept.append(here + share * (after - here))
    if len(kept) < 3:
        return None
    points = np.array(kept)
    return shapely.Polygon(np.clip(points[:, :2] / points[:, 2:], -FAR_PX, FAR_PX)).buffer(0)
