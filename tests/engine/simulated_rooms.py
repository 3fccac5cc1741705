"""A picture of an empty room with a tiled floor, as a simulated camera sees it."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from engine.simulated_people import SIZE, Array, SimulatedCamera
from numpy.typing import NDArray


def room_picture(camera: SimulatedCamera, *, seed: int, turn_deg: float, clutter: int = 25) -> NDArray[np.uint8]:
    """Return a grey picture: tiles of 1 m, walls with doors, boxes on the floor, noise, and edges in any direction.

    `turn_deg` is how far the room is turned against the camera. Lines are bent by the camera's distortion.
    """
    rng = np.random.default_rng(seed)
    picture = np.full((SIZE[1], SIZE[0]), 190, dtype=np.uint8)
    t = np.radians(turn_deg)
    turn = np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]])

    def line(a: Array, b: Array, shade: int, width: int) -> None:
        points = a + np.linspace(0, 1, 60)[:, None] * (b - a)
        points[:, :2] = points[:, :2] @ turn.T + (0, 12)
        uv = camera.project(points)
        for p, q in pairwise(uv):
            if np.isfinite([p, q]).all() and (np.abs([p, q]) < 5000).all():
                cv2.line(
                    picture, p.round().astype(int).tolist(), q.round().astype(int).tolist(), shade, width, cv2.LINE_AA
                )

    for k in range(-12, 13):
        line(np.array([k, -12.0, 0]), np.array([k, 12.0, 0]), 150, 2)
        line(np.array([-12.0, k, 0]), np.array([12.0, k, 0]), 150, 2)
    for side in (-12.0, 12.0):
        for k in np.arange(-12, 12.1, 3):
            line(np.array([side, k, 0]), np.array([side, k, 2.6]), 60, 3)
            line(np.array([k, side, 0]), np.array([k, side, 2.6]), 60, 3)
        for z in (0.0, 2.6):
            line(np.array([side, -12, z]), np.array([side, 12, z]), 60, 3)
            line(np.array([-12, side, z]), np.array([12, side, z]), 60, 3)
    for _ in range(8):  # shelves
        x, y, w, d, h = *rng.uniform(-9, 9, 2), *rng.uniform(0.5, 3, 2), rng.uniform(0.8, 2.0)
        corners = [(x, y), (x + w, y), (x + w, y + d), (x, y + d)]
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
            line(np.array([ax, ay, 0]), np.array([ax, ay, h]), 80, 2)
            for z in (0.0, h):
                line(np.array([ax, ay, z]), np.array([bx, by, z]), 80, 2)
    for _ in range(clutter):
        a, b = rng.uniform(0, SIZE, (2, 2)).round().astype(int)
        cv2.line(picture, a.tolist(), (a + (b - a) // 5).tolist(), int(rng.integers(40, 220)), 2, cv2.LINE_AA)
    noise = rng.normal(0, 4, picture.shape)
    return np.clip(picture + noise, 0, 255).astype(np.uint8)
