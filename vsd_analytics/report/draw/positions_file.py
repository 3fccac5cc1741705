"""Positions of a file as the product understands them, on the plan or the camera's picture: `vsd check --picture`.

A newcomer sees at a glance what no number tells: a mirrored axis, another origin, heads in place of feet.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import pandas as pd
from markupsafe import Markup

from vsd_analytics.errors import ReportError
from vsd_analytics.geometry.embedded_pictures import data_uri, plan_image
from vsd_analytics.geometry.picture_size import picture_size
from vsd_analytics.geometry.scale_bar import nice_metres
from vsd_analytics.report.draw.svg import ACCENT, FIXTURE, FIXTURE_EDGE, INK, MORE, MUTED, RULE, WHITE, el

if TYPE_CHECKING:
    from vsd_analytics.ingest.checks.sample import Sample
    from vsd_analytics.site.model import Camera, Floor, Site

WIDTH, HEIGHT_MAX, PAD, HEAD = 900.0, 900.0, 60.0, 70.0
POINTS_MAX: Final = 4000
WAYS_MAX: Final = 8
PICTURE_MAX_BYTES: Final = 4_000_000
TICKS: Final = 6
_KINDS: Final = {".png": "png", ".jpg": "jpeg", ".jpeg": "jpeg"}


@dataclass(frozen=True)
class _Sheet:
    """Maps places to the drawing: metres with y up, or pixels of a picture with v down."""

    left: float
    right: float
    low: float
    high: float
    is_metric: bool

    @property
    def scale(self) -> float:
        return min(WIDTH / (self.right - self.left), HEIGHT_MAX / (self.high - self.low))

    @property
    def size(self) -> tuple[float, float]:
        return (self.right - self.left) * self.scale, (self.high - self.low) * self.scale

    def at(self, x: float, y: float) -> tuple[float, float]:
        up = self.high - y if self.is_metric else y - self.low
        return PAD + (x - self.left) * self.scale, HEAD + up * self.scale


def draw_positions(site: Site, sample: Sample, *, file_name: str) -> str:
    """Draw the first positions of a file over plan, fixtures and areas, or over the camera's picture.

    Args:
        site: The site.
        sample: The first records; the camera with most of them is drawn, with those on its floor.
        file_name: Words of the title, taken literally.

    Returns:
        An SVG drawing that needs no other file.

    Raises:
        ReportError: E501, no record has a position.
    """
    names = {name: c for c in site.cameras for name in (c.camera_id, *c.engine_ids)}
    is_metric = sample.has_floor
    is_drawn = ~np.isnan(sample.places).any(axis=1)
    n_of_camera = Counter(sample.camera.names[no] for no in sample.camera.no[is_drawn & sample.camera.is_in(names)])
    if not n_of_camera:
        raise ReportError(
            f"no picture of {file_name} can be drawn",
            code="E501",
            why="none of its first records has a position of a camera of vsd.toml",
            fix="look at what vsd check says of it",
        )
    first = names[min(n_of_camera, key=lambda name: (-n_of_camera[name], name))]
    floor = next(f for f in site.floors if f.floor_id == first.floor_id)
    shown_names = [n for n, c in names.items() if (c.floor_id == first.floor_id if is_metric else c is first)]
    x, y = sample.places.T
    places = pd.DataFrame({"x": x, "y": y, "track_no": sample.track.no, "ts_ms": sample.ts_ms})
    places = places[is_drawn & sample.camera.is_in(shown_names)]
    sheet = _sheet(places, floor, first, is_metric=is_metric)
    drawn = _ground(sheet, site, floor, first) + _people(sheet, places)
    width, height = (side + more for side, more in zip(sheet.size, (2 * PAD, HEAD + PAD), strict=True))
    where = f"plan of {floor.name}" if is_metric else f"picture of {first.name}"
    title = f"{len(places):,} positions of {file_name}, on the {where}"
    shown = [el("rect", fill=WHITE, width=width, height=height), _text(title, PAD, 26, size=18, fill=INK)]
    shown.append(_text(_legend(sheet), PAD, 50))
    clip = el("clipPath", el("rect", x=PAD, y=HEAD, width=sheet.size[0], height=sheet.size[1]), id="frame")
    shown += [el("defs", clip), el("g", Markup("").join(drawn), clip_path="url(#frame)"), *_axes(sheet)]
    drawing = el(
        "svg",
        Markup("").join(shown),
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {width:.0f} {height:.0f}",
        font_family="sans-serif",
    )
    return f"{drawing}\n"


def _legend(sheet: _Sheet) -> str:
    ways = "Lines: the longest ways, each with a ring at its start."
    if sheet.is_metric:
        return f"x grows to the right, y upwards, in metres. Dots: where people stood. {ways}"
    return f"u grows to the right, v downwards, in pixels. Dots: the points read as feet. {ways}"


def _sheet(places: pd.DataFrame, floor: Floor, camera: Camera, *, is_metric: bool) -> _Sheet:
    low, high = places[["x", "y"]].quantile(0.01), places[["x", "y"]].quantile(0.99)
    boxes = [(low["x"], high["x"], low["y"], high["y"])]
    size = picture_size(floor.plan) if is_metric and floor.plan is not None else camera.picture_px
    if size is not None and (scale := floor.plan_m_per_px if is_metric else 1.0) is not None:
        x, y = floor.plan_origin_m if is_metric else (0.0, 0.0)
        boxes.append((x, x + size[0] * scale, y, y + size[1] * scale))
    left, right, bottom, top = (float(side([box[i] for box in boxes])) for i, side in enumerate((min, max, min, max)))
    more = 0.02 * max(right - left, top - bottom, 1.0)
    return _Sheet(left - more, right + more, bottom - more, top + more, is_metric)


def _ground(sheet: _Sheet, site: Site, floor: Floor, camera: Camera) -> list[Markup]:
    path = floor.plan if sheet.is_metric else camera.picture
    size, uri = (None, None) if path is None else (picture_size(path), _embedded(path))
    drawn = []
    if size is not None and uri is not None:
        scale = (floor.plan_m_per_px if sheet.is_metric else 1.0) or 1.0
        x, y = floor.plan_origin_m if sheet.is_metric else (0.0, 0.0)
        at = sheet.at(x, y + size[1] * scale if sheet.is_metric else y)
        width, height = (side * scale * sheet.scale for side in size)
        drawn.append(el("image", href=uri, x=at[0], y=at[1], width=width, height=height, preserveAspectRatio="none"))
    if sheet.is_metric:
        for fixture in (f for f in site.fixtures if f.floor_id == floor.floor_id):
            drawn.append(_ring(sheet, fixture.polygon, fill=FIXTURE, stroke=FIXTURE_EDGE))
            drawn.append(_name(sheet, fixture.polygon, fixture.name))
        for area in (a for a in site.areas if a.floor_id == floor.floor_id):
            drawn.append(_ring(sheet, area.polygon, fill="none", stroke=ACCENT, dashes="6 4"))
            drawn.append(_name(sheet, area.polygon, area.name))
    return drawn


def _embedded(path: Path) -> str | None:
    """Return a picture as it is, as a data URI; None where it cannot be shown, which other commands report."""
    try:
        if path.suffix.lower() == ".svg":
            return plan_image(path, max_bytes=PICTURE_MAX_BYTES)[0]
        data = path.read_bytes()
    except (ReportError, OSError):
        return None
    kind = _KINDS.get(path.suffix.lower())
    return None if kind is None or len(data) > PICTURE_MAX_BYTES else data_uri(data, kind=kind)


def _people(sheet: _Sheet, places: pd.DataFrame) -> list[Markup]:
    every = places.iloc[np.linspace(0, len(places) - 1, min(len(places), POINTS_MAX)).astype(int)]
    spots = [sheet.at(x, y) for x, y in zip(every["x"], every["y"], strict=True)]
    drawn = [el("circle", cx=x, cy=y, r=2.2, fill=MORE, fill_opacity="0.35") for x, y in spots]
    ways = places[places["track_no"] >= 0].sort_values("ts_ms", kind="stable").groupby("track_no")
    spans = (ways[["x", "y"]].max() - ways[["x", "y"]].min()).sum(axis=1).sort_values(ascending=False, kind="stable")
    for track in spans.head(WAYS_MAX).index:
        way = ways.get_group(track)
        points = [sheet.at(x, y) for x, y in zip(way["x"], way["y"], strict=True)]
        drawn.append(el("polyline", points=_points(points), fill="none", stroke=INK, stroke_width=1.2))
        drawn.append(el("circle", cx=points[0][0], cy=points[0][1], r=4, fill=WHITE, stroke=INK))
    return drawn


def _axes(sheet: _Sheet) -> list[Markup]:
    x0, y0 = PAD, HEAD
    width, height = sheet.size
    drawn = [el("rect", x=x0, y=y0, width=width, height=height, fill="none", stroke=MUTED)]
    step = nice_metres(max(sheet.right - sheet.left, sheet.high - sheet.low) / TICKS * 4)
    unit = " m" if sheet.is_metric else " px"
    for value in _ticks(sheet.left, sheet.right, step):
        x, _ = sheet.at(value, sheet.low)
        drawn.append(el("line", x1=x, x2=x, y1=y0 + height, y2=y0 + height + 6, stroke=MUTED))
        drawn.append(_text(f"{value:g}{unit}", x, y0 + height + 22, anchor="middle"))
    for value in _ticks(sheet.low, sheet.high, step):
        _, y = sheet.at(sheet.left, value)
        drawn.append(el("line", x1=x0 - 6, x2=x0, y1=y, y2=y, stroke=MUTED))
        drawn.append(_text(f"{value:g}{unit}", x0 - 9, y + 5, anchor="end"))
    names = ("x", "y") if sheet.is_metric else ("u", "v")
    drawn.append(_text(f"{names[0]} →", x0 + width / 2, y0 + height + 44, fill=INK, size=16, anchor="middle"))
    drawn.append(_text(f"{names[1]} {'↑' if sheet.is_metric else '↓'}", 18, y0 - 8, fill=INK, size=16))
    return drawn


def _ticks(low: float, high: float, step: float) -> list[float]:
    return [n * step for n in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _ring(sheet: _Sheet, polygon: Sequence[tuple[float, float]], *, fill: str, stroke: str, dashes: str = "") -> Markup:
    points = _points(sheet.at(x, y) for x, y in polygon)
    return el("polygon", points=points, fill=fill, stroke=stroke, stroke_dasharray=dashes or None, fill_opacity="0.7")


def _points(points: Iterable[tuple[float, float]]) -> str:
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in points)


def _name(sheet: _Sheet, polygon: Sequence[tuple[float, float]], name: str) -> Markup:
    x, y = sheet.at(*(float(v) for v in np.mean(polygon, axis=0)))
    return el("text", name, x=x, y=y, fill=INK, stroke=RULE, stroke_width=0.2, font_size=13, text_anchor="middle")


def _text(text: str, x: float, y: float, *, fill: str = MUTED, size: int = 14, anchor: str = "start") -> Markup:
    return el("text", text, x=x, y=y, fill=fill, font_size=size, text_anchor=anchor)
