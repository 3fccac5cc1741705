"""The made-up shop's cameras: pinhole cameras under the ceiling, their homographies, views and pictures."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin, tan

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.simulate.shop import DEPTH_M, DOOR, WIDTH_M, FloatArray, Rect, Shop

WIDTH_PX = 1280
HEIGHT_PX = 720
NOISE_SD_M = 0.05
"""Standard deviation of each coordinate an engine reports, independent by frame and camera."""


@dataclass(frozen=True, slots=True)
class PinholeCamera:
    """A camera without lens distortion.

    Attributes:
        camera_id: Identifier.
        name: Display name.
        x_m: Floor x of its mount.
        y_m: Floor y of its mount.
        height_m: Height of its mount.
        yaw_deg: Direction it looks in, degrees from floor x towards floor y.
        tilt_deg: How far below the horizontal it looks.
        view_deg: Vertical angle of view.
    """

    camera_id: str
    name: str
    x_m: float
    y_m: float
    height_m: float
    yaw_deg: float
    tilt_deg: float = 40.0
    view_deg: float = 52.0

    @property
    def projection(self) -> FloatArray:
        """Return the 3x4 matrix P from floor metres (x, y, height, 1) to pixels: (u w, v w, w) = P (x, y, z, 1)."""
        yaw, tilt = radians(self.yaw_deg), radians(self.tilt_deg)
        ahead = np.array([cos(yaw) * cos(tilt), sin(yaw) * cos(tilt), -sin(tilt)])
        right = np.array([sin(yaw), -cos(yaw), 0.0])
        rotation = np.stack([right, np.cross(ahead, right), ahead])
        focal_px = HEIGHT_PX / 2 / tan(radians(self.view_deg) / 2)
        intrinsic = np.array([[focal_px, 0, WIDTH_PX / 2], [0, focal_px, HEIGHT_PX / 2], [0, 0, 1]])
        mount = np.array([self.x_m, self.y_m, self.height_m])
        projection: FloatArray = intrinsic @ np.column_stack([rotation, -rotation @ mount])
        return projection

    @property
    def homography(self) -> FloatArray:
        """Return the 3x3 matrix from pixels to floor metres, lower right entry 1."""
        inverse = np.linalg.inv(self.projection[:, [0, 1, 3]])
        homography: FloatArray = inverse / inverse[2, 2]
        return homography

    def sees(self, x_m: FloatArray, y_m: FloatArray) -> NDArray[np.bool_]:
        """Tell which floor positions lie inside the picture; nothing hides anything."""
        u, v, depth = self.project(x_m, y_m, np.zeros_like(x_m))
        return (depth > 0) & (u >= 0) & (u < WIDTH_PX) & (v >= 0) & (v < HEIGHT_PX)

    def project(self, x_m: FloatArray, y_m: FloatArray, z_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return pixel u, pixel v and depth in metres of points of the room; only depth > 0 is before the camera."""
        points = np.stack([x_m, y_m, z_m, np.ones_like(x_m)])
        image: FloatArray = np.tensordot(self.projection, points, axes=1)
        uw, vw, w = image[0], image[1], image[2]
        safe = np.where(np.abs(w) < 1e-9, 1e-9, w)
        return uw / safe, vw / safe, w


CAMERAS: tuple[PinholeCamera, ...] = (
    PinholeCamera("cam-1", "Entrance", 23.8, 8.9, 3.2, -147.0),
    PinholeCamera("cam-2", "Checkouts", 0.3, 7.6, 3.2, -17.0),
    PinholeCamera("cam-3", "Aisles", 18.2, 15.3, 3.2, -137.0),
    PinholeCamera("cam-4", "Pharmacy", 1.7, 15.7, 3.2, -52.0),
)


def seen_by_any(x_m: FloatArray, y_m: FloatArray) -> NDArray[np.bool_]:
    """Tell which floor positions at least one camera sees."""
    seen: NDArray[np.bool_] = np.logical_or.reduce([camera.sees(x_m, y_m) for camera in CAMERAS])
    return seen


_COLOURS = {
    "room": (196, 200, 204),
    "shelf": (150, 164, 176),
    "till": (128, 136, 150),
    "counter": (150, 150, 140),
    "display": (90, 130, 200),
    "trolleys": (120, 120, 120),
}


def picture(camera: PinholeCamera, shop: Shop) -> bytes:
    """Return a PNG of the empty shop as the camera sees it: floor, walls, boxes for fixtures, far ones first."""
    import cv2

    image = np.full((HEIGHT_PX, WIDTH_PX, 3), (176, 180, 184), dtype=np.uint8)
    floor = (0.0, 0.0, WIDTH_M, DEPTH_M)
    _fill(image, camera, _face(floor, 0.0), (214, 220, 224))
    for k in range(1, int(WIDTH_M)):
        _fill(image, camera, [(k, 0, 0), (k, DEPTH_M, 0), (k + 0.015, DEPTH_M, 0), (k + 0.015, 0, 0)], (200, 206, 210))
    for k in range(1, int(DEPTH_M)):
        _fill(image, camera, [(0, k, 0), (WIDTH_M, k, 0), (WIDTH_M, k + 0.015, 0), (0, k + 0.015, 0)], (200, 206, 210))
    walls = ((0, 0, WIDTH_M, 0), (0, DEPTH_M, WIDTH_M, DEPTH_M), (0, 0, 0, DEPTH_M), (WIDTH_M, 0, WIDTH_M, DEPTH_M))
    for x0, y0, x1, y1 in walls:
        _fill(image, camera, [(x0, y0, 0), (x1, y1, 0), (x1, y1, 2.8), (x0, y0, 2.8)], (190, 194, 198))
    _fill(image, camera, [(DOOR[0], 0, 0), (DOOR[2], 0, 0), (DOOR[2], 0, 2.3), (DOOR[0], 0, 2.3)], (228, 214, 190))
    boxes = sorted(shop.fixtures, key=lambda f: -_distance(camera, f.rect))
    for fixture in boxes:
        _box(image, camera, fixture.rect, fixture.height_m, _COLOURS[fixture.kind])
    ok, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    if not ok:
        raise RuntimeError("the picture could not be encoded as PNG")
    return bytes(data)


_Corner = tuple[float, float, float]


def _face(rect: Rect, z: float) -> list[_Corner]:
    x0, y0, x1, y1 = rect
    return [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]


def _distance(camera: PinholeCamera, rect: Rect) -> float:
    """Return the distance from the mount to the nearest point of a footprint."""
    x, y = min(max(camera.x_m, rect[0]), rect[2]), min(max(camera.y_m, rect[1]), rect[3])
    return float(np.hypot(x - camera.x_m, y - camera.y_m))


def _box(
    image: NDArray[np.uint8], camera: PinholeCamera, rect: Rect, height_m: float, colour: tuple[int, int, int]
) -> None:
    x0, y0, x1, y1 = rect
    sides = []
    if camera.x_m < x0:
        sides.append(((x0, y0), (x0, y1), 0.82))
    if camera.x_m > x1:
        sides.append(((x1, y0), (x1, y1), 0.82))
    if camera.y_m < y0:
        sides.append(((x0, y0), (x1, y0), 0.7))
    if camera.y_m > y1:
        sides.append(((x0, y1), (x1, y1), 0.7))
    for a, b, shade in sides:
        dark = tuple(round(c * shade) for c in colour)
        _fill(image, camera, [(*a, 0.0), (*b, 0.0), (*b, height_m), (*a, height_m)], (dark[0], dark[1], dark[2]))
    if height_m < camera.height_m:
        _fill(image, camera, _face(rect, height_m), colour)


def _fill(
    image: NDArray[np.uint8], camera: PinholeCamera, corners: list[_Corner], colour: tuple[int, int, int]
) -> None:
    """Fill a polygon of the room, cut off 0.3 m before the camera."""
    import cv2

    points = np.array(corners, dtype=np.float64)
    depth = camera.project(points[:, 0], points[:, 1], points[:, 2])[2]
    kept = []
    for a, b, da, db in zip(points, np.roll(points, -1, axis=0), depth, np.roll(depth, -1), strict=True):
        if da >= 0.3:
            kept.append(a)
        if (da >= 0.3) != (db >= 0.3):
            kept.append(a + (b - a) * (0.3 - da) / (db - da))
    if len(kept) < 3:
        return
    cut = np.array(kept)
    u, v, _ = camera.project(cut[:, 0], cut[:, 1], cut[:, 2])
    pixels = np.stack([np.clip(u, -20000, 20000), np.clip(v, -20000, 20000)], axis=1)
    cv2.fillPoly(image, [np.round(pixels * 8).astype(np.int32)], colour, cv2.LINE_8, 3)
