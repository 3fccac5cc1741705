"""The picture a calibration is checked by: the floor's 1 m grid on the camera picture."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from vsd_analytics.geometry.calibration_files import PointPair
from vsd_analytics.site.model import Camera

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

BLANK_PX = (1920, 1080)
LARGEST_PX = 8000
STRONG_EVERY_M = 5

_GRID, _STRONG, _GIVEN, _MAPPED, _HALO = (200, 140, 0), (140, 70, 0), (0, 200, 0), (0, 0, 230), (255, 255, 255)  # BGR


def draw_overlay(camera: Camera, *, homography: Sequence[Sequence[float]], points: Sequence[PointPair]) -> bytes:
    """Draw the floor's 1 m grid on the camera picture, and each point with an arrow to where it should be.

    Every fifth line is stronger and labelled in metres. A green ring is where a point was clicked, the red arrow ends
    where its floor position falls in the picture.

    Args:
        camera: Its picture, else a blank one of its size, is drawn on.
        homography: 3x3, pixels to metres.
        points: Point pairs, may be empty.

    Returns:
        The bytes of a PNG.
    """
    import cv2
    import numpy as np

    from vsd_analytics.geometry.camera_views import seen_floor
    from vsd_analytics.geometry.homography import to_image

    canvas = _canvas(camera, points)
    size = (canvas.shape[1], canvas.shape[0])
    view = seen_floor(homography, picture_px=size)
    if not view.is_empty:
        low, high = np.floor(view.bounds[:2]).astype(int), np.ceil(view.bounds[2:]).astype(int)
        for axis in (0, 1):
            along = np.arange(low[1 - axis], high[1 - axis] + 0.01, 0.1)
            for metre in range(low[axis], high[axis] + 1):
                line = (np.full_like(along, metre), along)
                floor = np.column_stack(line if axis == 0 else line[::-1])
                strong = metre % STRONG_EVERY_M == 0
                shown = to_image(homography, floor, picture_px=size)
                _draw_line(canvas, shown, label=f"{'xy'[axis]} {metre}" if strong else None)
    for number, (u, v, x, y) in enumerate(points, start=1):
        given = (round(u), round(v))
        cv2.circle(canvas, given, 7, _GIVEN, 2, cv2.LINE_AA)
        there = to_image(homography, [(x, y)], picture_px=size)[0]
        if np.all(np.isfinite(there)) and np.all(np.abs(there) < 1e5):
            cv2.arrowedLine(canvas, given, (round(there[0]), round(there[1])), _MAPPED, 2, cv2.LINE_AA, tipLength=0.3)
        _draw_text(canvas, str(number), (given[0] + 9, given[1] - 9), _GIVEN)
    is_written, data = cv2.imencode(".png", canvas)
    assert is_written
    return bytes(data)


def _canvas(camera: Camera, points: Sequence[PointPair]) -> NDArray[np.uint8]:
    """Return the camera picture at the size its homography is for, or a blank one."""
    import cv2
    import numpy as np

    size = camera.picture_px
    if camera.picture is not None:
        # as stored: the size and the pixels of a calibration know nothing of a photo's orientation tag
        picture: Any = cv2.imread(str(camera.picture), cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)
        if picture is not None:
            is_sized = size is None or picture.shape[1::-1] == size
            return np.asarray(picture if is_sized else cv2.resize(picture, size), dtype=np.uint8)
    if size is None and points:
        size = (max(round(max(p[0] for p in points) * 1.1), 320), max(round(max(p[1] for p in points) * 1.1), 240))
    width, height = size or BLANK_PX
    return np.full((min(height, LARGEST_PX), min(width, LARGEST_PX), 3), 245, dtype=np.uint8)


def _draw_line(canvas: Any, uv: NDArray[np.float64], *, label: str | None) -> None:
    """Draw the part of a line that lies in the picture, strong and named where a label is given."""
    import cv2
    import numpy as np

    limit = np.array([canvas.shape[1], canvas.shape[0]], dtype=float)
    inside = np.all((uv > -limit) & (uv < 2 * limit), axis=1)  # NaN, at or above the horizon, is not inside
    colour, width = (_STRONG, 2) if label else (_GRID, 1)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], inside, [False])).astype(int)))
    for start, stop in edges.reshape(-1, 2):
        cv2.polylines(canvas, [np.round(uv[start:stop]).astype(np.int32)], False, colour, width, cv2.LINE_AA)
    seen = np.flatnonzero(np.all((uv > 20) & (uv < limit - 60), axis=1))
    if label and len(seen):
        u, v = uv[seen[len(seen) // 2]]
        _draw_text(canvas, label, (round(u) + 4, round(v) - 4), _STRONG)


def _draw_text(canvas: Any, text: str, at: tuple[int, int], colour: tuple[int, int, int]) -> None:
    import cv2

    scale = max(0.45, canvas.shape[1] / 2000)  # readable when the picture is shown 1000 pixels wide
    for shade, width in ((_HALO, 4), (colour, 1)):
        cv2.putText(canvas, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, shade, width, cv2.LINE_AA)
