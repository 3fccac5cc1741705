"""Pinhole cameras with a known place, as homographies: the planted truth of these tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SIZE = (1280, 720)


def look(
    *,
    at: tuple[float, float] = (0.0, 0.0),
    pan_deg: float = 0.0,
    tilt_deg: float = 40.0,
    height_m: float = 4.0,
    f_px: float = 900.0,
) -> NDArray[np.float64]:
    """Return the homography pixels -> metres of a camera above `at`, looking along pan (0 = +y), down by tilt."""
    t, p = np.radians(tilt_deg), np.radians(pan_deg)
    right = np.array([np.cos(p), np.sin(p), 0.0])
    ahead = np.array([-np.sin(p) * np.cos(t), np.cos(p) * np.cos(t), -np.sin(t)])
    rotation = np.stack([right, np.cross(ahead, right), ahead])  # rows: picture right, picture down, into the scene
    k = np.array([[f_px, 0, SIZE[0] / 2], [0, f_px, SIZE[1] / 2], [0, 0, 1]])
    to_pixels = k @ np.column_stack([rotation[:, 0], rotation[:, 1], -rotation @ np.array([*at, height_m])])
    return np.asarray(np.linalg.inv(to_pixels))
