"""Pictures of what the engine found: skeletons or boxes, safe spaces, and a line between people too close.

Colour and sign say the same, so a picture can be read in grey: whoever is too close to somebody has a solid outline
around a hatched safe space, everybody else a dashed one. The colours are two of Okabe and Ito's, which colour-blind
people tell apart.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.detections import Detections
from vsd_analytics.engine.frame_pictures import FramePictures, Picture, fitted
from vsd_analytics.engine.people import MID_HIP, NECK, NOSE, Array
from vsd_analytics.engine.seen import Seen
from vsd_analytics.errors import UsageError

BONES: Final = (
    *((NOSE, NECK), (NOSE, 15), (15, 17), (NOSE, 16), (16, 18), (NECK, MID_HIP)),
    *((NECK, 2), (2, 3), (3, 4), (NECK, 5), (5, 6), (6, 7)),
    *((MID_HIP, 9), (9, 10), (10, 11), (MID_HIP, 12), (12, 13), (13, 14)),
    *((11, 24), (11, 22), (22, 23), (14, 21), (14, 19), (19, 20)),
)
"""Joints of BODY_25 that a line joins."""

_CLOSE, _APART, _NOWHERE = (0, 94, 213), (178, 114, 0), (120, 120, 120)  # BGR
_WHITE, _INK, _GROUND = (255, 255, 255), (25, 25, 25), 238
_FILL: Final = 0.28
_RING, _DASH = 60, 3  # points of an outline, and parts of it that make a dash or a gap
_SUBPIXEL: Final = 4  # coordinates go to OpenCV in sixteenths of a pixel
_QUALITY: Final = 90


@dataclass(frozen=True, slots=True)
class OverlayLook:
    """What is written on the pictures.

    Attributes:
        size_px: Width and height.
        distance_m: Nearer than this is too close.
        distance: Writes a distance in metres in the site's unit.
    """

    size_px: tuple[int, int]
    distance_m: float
    distance: Callable[[float], str]


def overlay_names(parts: Sequence[tuple[Seen, NDArray[np.int64]]]) -> list[str]:
    """Return the file name of each frame: its number, as an image sequence needs it for a video."""
    numbers = [number for seen, _ in parts for number in seen.people.frames.tolist()]
    return [f"frame-{number:08d}.jpg" for number in numbers]


def write_overlay(
    folder: Path,
    parts: Sequence[tuple[Seen, NDArray[np.int64]]],
    *,
    pictures: FramePictures,
    source: Path | None,
    look: OverlayLook,
) -> int:
    """Write one picture for each frame, one at a time; return how many have the camera's picture as their ground.

    Args:
        folder: Where to; it is made.
        parts: What was found, and the UTC milliseconds of its frames.
        pictures: The camera's pictures.
        source: Where they come from, for messages.
        look: What is written on them.

    Raises:
        UsageError: A picture is there already (E101); nothing is written then.
        InputError: The camera's pictures have other proportions (E202).
    """
    refuse_existing(folder, overlay_names(parts))
    folder.mkdir(parents=True, exist_ok=True)
    names, n_pictured = iter(overlay_names(parts)), 0
    for seen, ts_ms in parts:
        people = seen.people
        begins = np.searchsorted(people.frame, people.frames)
        ends = np.searchsorted(people.frame, people.frames, side="right")
        close = np.flatnonzero(seen.distance_m < look.distance_m)
        pair_begins, pair_ends = (
            np.searchsorted(people.frame[seen.a[close]], people.frames, side=side) for side in ("left", "right")
        )
        for i, number in enumerate(people.frames.tolist()):
            picture = pictures.of_frame(number)
            n_pictured += picture is not None
            canvas = _ground(look.size_px)
            if picture is not None:
                canvas = fitted(picture, look.size_px, source=source or folder)
            pairs = close[pair_begins[i] : pair_ends[i]]
            canvas = draw_frame(canvas, seen, np.arange(begins[i], ends[i]), pairs, look=look)
            when = datetime.fromtimestamp(int(ts_ms[i]) / 1000, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
            _caption(canvas, seen, number, when, n_people=int(ends[i] - begins[i]), n_pairs=len(pairs), look=look)
            (folder / next(names)).write_bytes(jpeg(canvas))
    return n_pictured


def refuse_existing(folder: Path, names: Sequence[str]) -> None:
    """Raise UsageError (E101) where a folder is no folder, or has one of the files already."""
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"--overlay: {folder} is no folder", fix="--overlay overlay/")
    existing = {p.name for p in folder.iterdir()} & set(names) if folder.is_dir() else set()
    if existing:
        raise UsageError(
            f"{folder} has {len(existing):,} of these pictures already, such as {min(existing)}",
            why="pictures are not written over",
            fix="give another folder, or delete this one first",
        )


def draw_frame(
    canvas: Picture, seen: Seen, rows: NDArray[np.intp], pairs: NDArray[np.intp], *, look: OverlayLook
) -> Picture:
    """Return the picture of a frame with its people drawn on it.

    Args:
        canvas: The ground, of the size in `look`.
        seen: What was found in all frames.
        rows: Persons of the frame.
        pairs: Pairs of the frame that are too close.
        look: What is written.
    """
    too_close = set(seen.a[pairs].tolist()) | set(seen.b[pairs].tolist())
    scale = max(1.0, look.size_px[1] / 1080)
    rings = np.empty((len(rows), 0, 2)) if seen.spaces is None else seen.spaces.ellipses(rows, n_points=_RING)
    for is_close in (False, True):  # whoever is too close is drawn above the others
        chosen = [i for i, row in enumerate(rows.tolist()) if (row in too_close) == is_close]
        canvas = _safe_spaces(canvas, [rings[i] for i in chosen], is_close=is_close, scale=scale)
    for row in rows.tolist():
        has_place = bool(np.isfinite(seen.uv[row]).all()) and (seen.xy is None or bool(np.isfinite(seen.xy[row]).all()))
        colour = _CLOSE if row in too_close else _APART if has_place else _NOWHERE
        _person(canvas, seen, row, colour, scale=scale)
    for pair in pairs.tolist():
        _line(canvas, seen, pair, look=look, scale=scale)
    return canvas


def draw_detections(picture: Picture, people: Detections) -> bytes:
    """Return a picture as JPEG with boxes, joints and scores of what a detector found in it."""
    canvas = picture.copy()
    scale = max(1.0, picture.shape[0] / 1080)
    for box, joints, score in zip(people.box, people.joints, people.score.tolist(), strict=True):
        _figure(canvas, np.full_like(joints, np.nan), box, _APART, scale=scale)
        if np.isfinite(joints).any():
            _figure(canvas, joints, box, _CLOSE, scale=scale)
        size = round(16 * scale)
        _plate(canvas, f"{score:.2f}", (float(box[0]), float(box[1]) - size), _APART, size=size, is_left=True)
    return jpeg(canvas)


def jpeg(canvas: Picture) -> bytes:
    """Return a picture as the bytes of a JPEG file."""
    is_written, data = cv2.imencode(".jpg", canvas, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    assert is_written
    return bytes(data)


def _ground(size_px: tuple[int, int]) -> Picture:
    return np.full((size_px[1], size_px[0], 3), _GROUND, dtype=np.uint8)


def _safe_spaces(canvas: Picture, rings: list[Array], *, is_close: bool, scale: float) -> Picture:
    """Fill ellipses translucently; hatch and outline those of people too close, dash the outline of the others."""
    shapes = [ring for ring in (_drawable(ring, canvas) for ring in rings) if len(ring) > 2]
    if not shapes:
        return canvas
    colour = _CLOSE if is_close else _APART
    mask = np.zeros(canvas.shape[:2], dtype=np.uint8)
    for ring in shapes:
        cv2.fillPoly(mask, [_fixed(ring)], 255, cv2.LINE_AA, _SUBPIXEL)
    left, top, width, height = cv2.boundingRect(mask)
    part = np.s_[top : top + height, left : left + width]
    alpha = mask[part].astype(np.float64) * (_FILL / 255)
    if is_close:
        v, u = np.ogrid[top : top + height, left : left + width]
        alpha = np.where((u + v) % round(12 * scale) < 3 * scale, alpha * 2.2, alpha)
    canvas[part] = np.round(canvas[part] * (1 - alpha[..., None]) + np.array(colour) * alpha[..., None])
    for ring in shapes:
        dashes = [_fixed(dash) for dash in ([np.vstack([ring, ring[:1]])] if is_close else _dashes(ring))]
        for shade, width in ((_WHITE, 5), (colour, 3 if is_close else 2)):  # white below, for dark ground
            cv2.polylines(canvas, dashes, False, shade, round(width * scale), cv2.LINE_AA, _SUBPIXEL)
    return canvas


def _dashes(ring: Array) -> list[Array]:
    """Return every other part of a ring."""
    return [ring[i : i + _DASH + 1] for i in range(0, len(ring), 2 * _DASH)]


def _person(canvas: Picture, seen: Seen, row: int, colour: tuple[int, int, int], *, scale: float) -> None:
    _figure(canvas, seen.people.joints[row], seen.people.box[row], colour, scale=scale)
    if np.isfinite(seen.uv[row]).all():
        at = _fixed(seen.uv[row]).tolist()
        for shade, radius in ((_WHITE, 6), (colour, 4)):
            cv2.circle(canvas, at, round(radius * scale * 16), shade, cv2.FILLED, cv2.LINE_AA, _SUBPIXEL)


def _figure(canvas: Picture, joints: Array, box: Array, colour: tuple[int, int, int], *, scale: float) -> None:
    """Draw the bones of somebody, or the box where no joint is known."""
    is_known = np.asarray(np.isfinite(joints).all(axis=1), dtype=np.bool_)
    if is_known.any():
        bones = [_fixed(joints[list(bone)]) for bone in BONES if is_known[list(bone)].all()]
        for shade, width in ((_WHITE, 5), (colour, 2)):
            cv2.polylines(canvas, bones, False, shade, round(width * scale), cv2.LINE_AA, _SUBPIXEL)
        for at in _fixed(joints[is_known]).tolist():
            cv2.circle(canvas, at, round(3 * scale * 16), colour, cv2.FILLED, cv2.LINE_AA, _SUBPIXEL)
    else:
        low, high = _fixed(box.reshape(2, 2)).tolist()
        for shade, width in ((_WHITE, 4), (colour, 2)):
            cv2.rectangle(canvas, low, high, shade, round(width * scale), cv2.LINE_AA, _SUBPIXEL)


def _line(canvas: Picture, seen: Seen, pair: int, *, look: OverlayLook, scale: float) -> None:
    """Draw a line between the feet of two people too close, with their distance; `~` where it is approximate."""
    ends = seen.uv[[seen.a[pair], seen.b[pair]]]
    if not np.isfinite(ends).all():
        return
    start, end = _fixed(ends).tolist()
    for shade, width in ((_WHITE, 8), (_CLOSE, 4)):
        cv2.line(canvas, start, end, shade, round(width * scale), cv2.LINE_AA, _SUBPIXEL)
    text = look.distance(round(float(seen.distance_m[pair]), 1))
    text = f"~{text}" if seen.quality == "relative" else text
    size, (u, v) = round(20 * scale), ends.mean(axis=0)
    if np.ptp(ends[:, 0]) < 5 * size and np.ptp(ends[:, 1]) < 2 * size:
        v = ends[:, 1].max() + size * 1.3  # a short line would lie below its own plate
    _plate(canvas, text, (u, v), _CLOSE, size=size)


def _caption(
    canvas: Picture, seen: Seen, number: int, when: str, *, n_people: int, n_pairs: int, look: OverlayLook
) -> None:
    """Write frame, time and what was found into the upper left corner."""
    scale = max(0.6, look.size_px[1] / 1080)
    people = "1 person" if n_people == 1 else f"{n_people} persons"
    pairs = "nobody" if n_pairs == 0 else "1 pair" if n_pairs == 1 else f"{n_pairs} pairs"
    summary = f"{people}, {pairs} closer than {look.distance(look.distance_m)}"
    first = f"frame {number}" if seen.people.ts_ms is None else when
    size = round(20 * scale)
    for line, text in enumerate((f"{first}   {summary}", seen.engine)):
        _plate(canvas, text, (size * 0.7, size * (1.2 + 1.9 * line)), _INK, size=size - 2 * line, is_left=True)


def _plate(
    canvas: Picture,
    text: str,
    at: tuple[float, ...],
    colour: tuple[int, int, int],
    *,
    size: int,
    is_left: bool = False,
) -> None:
    """Write a text in white on a plate of colour, around a point or right of it, inside the picture."""
    height, width = canvas.shape[:2]
    font, scale, weight = cv2.FONT_HERSHEY_DUPLEX, size / 30, max(1, round(size / 20))
    (wide, tall), _ = cv2.getTextSize(text, font, scale, weight)
    pad = round(size * 0.4)
    left = round(at[0]) if is_left else round(at[0] - wide / 2)
    left = min(max(left, pad), max(width - wide - pad, pad))
    middle = min(max(round(at[1]), size), height - size)
    half = tall // 2 + pad
    cv2.rectangle(canvas, (left - pad, middle - half), (left + wide + pad, middle + half), colour, cv2.FILLED)
    cv2.putText(canvas, text, (left, middle + tall // 2), font, scale, _WHITE, weight, cv2.LINE_AA)


def _drawable(ring: Array, canvas: Picture) -> Array:
    """Return the points of a ring in front of the camera, near enough for whole numbers; none where it is not seen."""
    height, width = canvas.shape[:2]
    known = ring[np.isfinite(ring).all(axis=1)]
    low, high = np.array([-2.0 * width, -2.0 * height]), np.array([3.0 * width, 3.0 * height])
    return np.clip(known, low, high)


def _fixed(points: Array) -> NDArray[np.int32]:
    return np.asarray(np.round(points * 2**_SUBPIXEL), dtype=np.int32)
