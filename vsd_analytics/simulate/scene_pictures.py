"""Grey pictures of the made-up shop without people, as its cameras see it: floor, walls, and fixtures as boxes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.simulate.cameras import HEIGHT_PX, WIDTH_PX, PinholeCamera
from vsd_analytics.simulate.shop import DEPTH_M, DOOR, WIDTH_M, FloatArray, Rect, Shop, ShopFixture

Corner = tuple[float, float, float]
Picture = NDArray[np.uint8]

CEILING_M: Final = 2.9
BOARD_M: Final = 0.42
"""From one board of a shelf to the next."""
SHADOW_M: Final = 0.3
NEAR_M: Final = 0.3
LIGHT_M: Final = 4.0
"""From one lamp to the next, along x and y."""

_FLOOR, _LINE, _WALL, _GLASS, _FRAME = 212, 192, 168, 226, 96
_GREY: Final = {"room": 176, "shelf": 120, "till": 104, "counter": 138, "display": 128, "trolleys": 112}


def picture(camera: PinholeCamera, shop: Shop) -> bytes:
    """Return a PNG of the empty shop as the camera sees it; the same arguments give the same bytes.

    Args:
        camera: Where it looks from.
        shop: The shop as it is now.
    """
    import cv2

    image = np.full((HEIGHT_PX, WIDTH_PX), _WALL, dtype=np.uint8)
    _floor(image, camera, shop)
    _walls(image, camera)
    for number, fixture in sorted(enumerate(shop.fixtures), key=lambda item: -_distance(camera, item[1].rect)):
        _box(image, camera, fixture, np.random.default_rng(number))
    is_written, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 6])
    if not is_written:
        raise RuntimeError("the picture could not be encoded as PNG")
    return bytes(data)


def _floor(image: Picture, camera: PinholeCamera, shop: Shop) -> None:
    """Draw tiles of 1 m, brighter below lamps, with soft shadows around fixtures."""
    import cv2

    floor = np.zeros_like(image)
    _fill(floor, camera, _face((0.0, 0.0, WIDTH_M, DEPTH_M), 0.0), 255)
    shade = np.full(image.shape, 255, dtype=np.uint8)
    for fixture in shop.fixtures:
        x0, y0, x1, y1 = fixture.rect
        grown = (x0 - SHADOW_M, y0 - SHADOW_M, x1 + SHADOW_M, y1 + SHADOW_M)
        _fill(shade, camera, _face(grown, 0.0), 176)
    shade = np.asarray(cv2.GaussianBlur(shade, (0, 0), 9), dtype=np.uint8)
    tiles = np.full_like(image, _FLOOR)
    for k in range(1, int(WIDTH_M)):
        _fill(tiles, camera, [(k, 0, 0), (k, DEPTH_M, 0), (k + 0.02, DEPTH_M, 0), (k + 0.02, 0, 0)], _LINE)
    for k in range(1, int(DEPTH_M)):
        _fill(tiles, camera, [(0, k, 0), (WIDTH_M, k, 0), (WIDTH_M, k + 0.02, 0), (0, k + 0.02, 0)], _LINE)
    seen = floor > 0
    lit = tiles[seen] * (shade[seen] / 255.0) * _light(camera)[seen]
    image[seen] = np.round(lit / 3) * 3


def _light(camera: PinholeCamera) -> FloatArray:
    """Return how bright the floor behind each pixel is: 0.9 to 1, brightest below lamps."""
    import cv2

    step = 4  # the wave is far longer than a pixel
    v, u = np.mgrid[0:HEIGHT_PX:step, 0:WIDTH_PX:step].astype(np.float64) + step / 2
    h = camera.homography
    w = h[2, 0] * u + h[2, 1] * v + h[2, 2]
    w = np.where(np.abs(w) < 1e-12, 1e-12, w)
    x, y = ((h[k, 0] * u + h[k, 1] * v + h[k, 2]) / w for k in (0, 1))
    wave = np.cos(2 * np.pi * x / LIGHT_M) * np.cos(2 * np.pi * y / LIGHT_M)
    return np.asarray(cv2.resize(0.95 + 0.05 * wave, (WIDTH_PX, HEIGHT_PX)))


def _walls(image: Picture, camera: PinholeCamera) -> None:
    """Draw the four walls, a row of windows in the front one, and the glass door."""
    sides: tuple[tuple[Rect, int], ...] = (
        ((0.0, DEPTH_M, WIDTH_M, DEPTH_M), _WALL),
        ((0.0, 0.0, 0.0, DEPTH_M), _WALL - 14),
        ((WIDTH_M, 0.0, WIDTH_M, DEPTH_M), _WALL - 14),
        ((0.0, 0.0, WIDTH_M, 0.0), _WALL - 6),
    )
    for (x0, y0, x1, y1), grey in sides:
        _fill(image, camera, _wall((x0, y0), (x1, y1), 0.0, CEILING_M), grey)
        _fill(image, camera, _wall((x0, y0), (x1, y1), 0.0, 0.12), grey - 50)
    for x in np.arange(3.6, 17.0, 2.4):
        _fill(image, camera, _wall((x, 0.0), (x + 1.9, 0.0), 1.0, 2.3), _FRAME)
        _fill(image, camera, _wall((x + 0.06, 0.0), (x + 1.84, 0.0), 1.06, 2.24), _GLASS)
    middle = (DOOR[0] + DOOR[2]) / 2
    _fill(image, camera, _wall((DOOR[0] - 0.08, 0.0), (DOOR[2] + 0.08, 0.0), 0.0, 2.4), _FRAME)
    for left, right in ((DOOR[0], middle - 0.03), (middle + 0.03, DOOR[2])):
        _fill(image, camera, _wall((left, 0.0), (right, 0.0), 0.04, 2.3), _GLASS)


def _box(image: Picture, camera: PinholeCamera, fixture: ShopFixture, rng: np.random.Generator) -> None:
    """Draw the sides of a fixture that face the camera, and its top when the camera is above it."""
    grey, height_m = _GREY[fixture.kind], fixture.height_m
    for a, b, share in _facing(camera, fixture.rect):
        _fill(image, camera, _wall(a, b, 0.0, height_m), round(grey * share))
        _fill(image, camera, _wall(a, b, 0.0, 0.08), round(grey * share * 0.6))
        if fixture.kind in ("shelf", "display") and height_m > 2 * BOARD_M:
            _goods(image, camera, (a, b), height_m, rng)
    if height_m < camera.height_m:
        _fill(image, camera, _face(fixture.rect, height_m), min(255, grey + 26))
        if fixture.kind == "till":  # the belt
            x0, y0, x1, y1 = fixture.rect
            _fill(image, camera, _face((x0 + 0.12, y0 + 0.5, x1 - 0.12, y1 - 0.1), height_m), 58)


def _facing(camera: PinholeCamera, rect: Rect) -> Iterator[tuple[tuple[float, float], tuple[float, float], float]]:
    """Yield the sides of a rectangle that face the camera: two corners, and how much light they get."""
    x0, y0, x1, y1 = rect
    if camera.x_m < x0:
        yield (x0, y0), (x0, y1), 0.84
    if camera.x_m > x1:
        yield (x1, y0), (x1, y1), 0.84
    if camera.y_m < y0:
        yield (x0, y0), (x1, y0), 0.7
    if camera.y_m > y1:
        yield (x0, y1), (x1, y1), 0.7


def _goods(
    image: Picture,
    camera: PinholeCamera,
    side: tuple[tuple[float, float], tuple[float, float]],
    height_m: float,
    rng: np.random.Generator,
) -> None:
    """Fill the boards of one side of a shelf with goods of several widths, heights and greys."""
    (ax, ay), (bx, by) = side
    length = float(np.hypot(bx - ax, by - ay))
    low = 0.14
    while low + BOARD_M <= height_m:
        high = low + BOARD_M - 0.05
        _fill(image, camera, _wall((ax, ay), (bx, by), low, high), 46)
        at = 0.06
        while at < length - 0.2:
            wide = min(float(rng.uniform(0.22, 0.62)), length - 0.06 - at)
            tall = low + float(rng.uniform(0.55, 0.95)) * (high - low)
            ends = [(ax + (bx - ax) * s / length, ay + (by - ay) * s / length) for s in (at, at + wide - 0.03)]
            _fill(image, camera, _wall(ends[0], ends[1], low, tall), int(rng.integers(5, 11)) * 18)
            at += wide
        low += BOARD_M


def _face(rect: Rect, z: float) -> list[Corner]:
    x0, y0, x1, y1 = rect
    return [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]


def _wall(a: tuple[float, float], b: tuple[float, float], low: float, high: float) -> list[Corner]:
    return [(*a, low), (*b, low), (*b, high), (*a, high)]


def _distance(camera: PinholeCamera, rect: Rect) -> float:
    """Return the distance from the mount to the nearest point of a footprint."""
    x, y = min(max(camera.x_m, rect[0]), rect[2]), min(max(camera.y_m, rect[1]), rect[3])
    return float(np.hypot(x - camera.x_m, y - camera.y_m))


def _fill(image: Picture, camera: PinholeCamera, corners: list[Corner], grey: int) -> None:
    """Fill a polygon of the room, cut off just before the camera."""
    import cv2

    points = np.array(corners, dtype=np.float64)
    depth = camera.project(points[:, 0], points[:, 1], points[:, 2])[2]
    in_front: list[Any] = []
    for a, b, da, db in zip(points, np.roll(points, -1, axis=0), depth, np.roll(depth, -1), strict=True):
        if da >= NEAR_M:
            in_front.append(a)
        if (da >= NEAR_M) != (db >= NEAR_M):
            in_front.append(a + (b - a) * (NEAR_M - da) / (db - da))
    if len(in_front) < 3:
        return
    cut = np.array(in_front)
    u, v, _ = camera.project(cut[:, 0], cut[:, 1], cut[:, 2])
    pixels = np.stack([np.clip(u, -20000, 20000), np.clip(v, -20000, 20000)], axis=1)
    cv2.fillPoly(image, [np.round(pixels * 8).astype(np.int32)], (grey,), cv2.LINE_8, 3)
