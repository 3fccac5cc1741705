"""The map of the page: banded heat over a floor plan, bare floor or a camera picture, as inline SVG."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from markupsafe import Markup

from vsd_analytics.figures.week.model_map import FloorMap, Point
from vsd_analytics.figures.week.results import Rules
from vsd_analytics.report.draw import floor_frame as draw
from vsd_analytics.report.draw.area_names import Box, area_names
from vsd_analytics.report.draw.floor_frame import FONT, FONT_FIXTURE, FONT_PHONE, Frame, name_box
from vsd_analytics.report.draw.svg import ACCENT, BAR, INK, MUTED, WHITE, Look, centred, drawing, el
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say

MAP_WIDTH: Final = 960
MAP_MAX_HEIGHT: Final = 900
PAD: Final = 12
_FOOT: Final = 52
MAX_FOOT_RADIUS: Final = 45
MARK_RADIUS: Final = 17
MARK_RADIUS_PHONE: Final = 30
FONT_PRINT: Final = 21
"""Size of areas' names on paper, larger than on a screen; fixtures' names are hardly larger there."""
_SIZES: Final = {float(FONT_PRINT): float(FONT_FIXTURE), float(FONT_PHONE): float(FONT_PHONE)}


def floor_map(shown: FloorMap, *, index: int, rules: Rules, label: str) -> Markup:
    """Draw a map: floor, bands, uncertain and unseen floor, plan, fixtures, areas, cameras, spots, scales.

    Args:
        shown: What to draw; metres with y up, or pixels with y down on a picture.
        index: Number of the map on the page, so that ids stay unique.
        rules: For the legal distance and the number of steps.
        label: Text alternative.
    """
    frame = Frame(shown, width=MAP_WIDTH, height=MAP_MAX_HEIGHT)
    hatch, clip = f"hat{index}", f"clip{index}"
    foot = _foot_height(frame, rules) if frame.is_metric else PAD
    parts = [draw.hatch_defs(frame, hatch=hatch, clip=clip), draw.ground(frame)]
    image = None if shown.image is None else draw.image(shown.image, frame, name=f"plan{index}")
    drawn = [] if image is None or frame.is_metric else [image]
    drawn += draw.heat(shown.bands, frame, steps=rules.heat_steps, edges=draw.edges_of(shown))
    if shown.uncertain:
        parts.insert(0, draw.dot_defs(dots=f"dot{index}", is_picture=not frame.is_metric))
        drawn.append(draw.uncertain(shown.uncertain, frame, dots=f"dot{index}"))
    if shown.unseen:
        drawn.append(draw.unseen(shown.unseen, frame, hatch=hatch))
    if image is not None and frame.is_metric:
        drawn.append(image)
    drawn += draw.fixtures(shown.fixtures, frame)
    drawn += [draw.area_outline(a.ring, frame) for a in shown.areas]
    parts.append(el("g", Markup("").join(drawn), clip_path=f"url(#{clip})"))
    parts.append(el("rect", class_="fr", fill="none", stroke=BAR, stroke_width=1.5, **frame.whole))
    labels, boxes = _area_labels(shown, frame)
    parts += labels
    for camera in shown.cameras:
        x, y = frame.at(camera.at)
        parts.append(el("circle", class_="cm", fill=ACCENT, cx=x, cy=y, r=6))
        parts.append(_text(camera.label, x, y + 22, class_="cmt", fill=ACCENT, anchor="middle"))
    parts += _spots(shown, frame, boxes)
    if frame.is_metric:
        parts += _scale(shown, frame, rules)
    kind = "map-pic" if shown.kind == "picture" else "map-floor"
    size = (frame.width + 2 * PAD, frame.height + PAD + foot)
    return drawing(parts, size, class_=kind, label=label, corner=(-PAD, -PAD))


def _text(
    text: str, x: float, y: float, *, class_: str, fill: str = MUTED, anchor: str = "start", size: int = FONT
) -> Markup:
    return el("text", text, class_=class_, fill=fill, font_size=size, text_anchor=anchor, x=round(x), y=round(y))


def _area_labels(shown: FloorMap, frame: Frame) -> tuple[list[Markup], list[tuple[Box, float]]]:
    """Name each area, and each fixture too small for its name, where there is room; others are left to the table.

    Returns:
        The names, and the boxes they fill with the radius of the marks that must keep clear of them.
    """
    small = [f for f in shown.fixtures if f.kind != "wall" and name_box(f, frame, FONT_FIXTURE) is None]
    placed = area_names([*shown.areas, *small], shown.fixtures, frame, sizes=_SIZES)
    labels = []
    for name in placed:
        style = "pt halo" if FONT_PHONE in name.sizes else "pt halo x"
        labels.append(_text(name.text, name.x, name.y, class_=style, fill=MUTED if name.is_fixture else INK))
    radius = {float(FONT_PRINT): MARK_RADIUS, float(FONT_PHONE): MARK_RADIUS_PHONE}
    return labels, [(name.box(size), float(r)) for size, r in radius.items() for name in placed if size in name.sizes]


def _spots(shown: FloorMap, frame: Frame, boxes: Sequence[tuple[Box, float]]) -> list[Markup]:
    """Draw the numbered spots: a dot at the peak, a line, and the number where it covers least."""
    peaks = [frame.at(s.at) for s in shown.spots]
    heat = [[frame.ring(polygon[0]) for polygon in band.polygons] for band in shown.bands]
    placed: list[Point] = []
    parts = []
    for spot, (x, y) in zip(shown.spots, peaks, strict=True):
        choices = []
        for k in range(48):
            angle, reach = 2 * math.pi * (k % 16) / 16, (88, 64, 116)[k // 16]
            at = (x + reach * math.cos(angle), y - reach * math.sin(angle))
            inside = 34 <= at[0] <= frame.width - 34 and 34 <= at[1] <= frame.height - 34
            clear = -sum(_touches(at, box, radius) for box, radius in boxes)
            clear -= sum(_crosses((x, y), at, box) for box, radius in boxes if radius == MARK_RADIUS)
            near = min((math.dist(at, other) for other in [*placed, *(p for p in peaks if p != (x, y))]), default=400.0)
            cool = -sum(any(_inside(at, ring) for ring in rings) for rings in heat)
            choices.append((inside, min(near, 70.0), clear, cool, round(math.sin(angle), 3), -k, at))
        at = max(choices)[-1]
        placed.append(at)
        (a, b) = round(at[0]), round(at[1])
        parts += [
            el("line", class_="mkr", stroke=WHITE, stroke_width=5, x1=round(x), y1=round(y), x2=a, y2=b),
            el("line", class_="mkl", stroke=INK, stroke_width=2, x1=round(x), y1=round(y), x2=a, y2=b),
            el("circle", class_="mk mkr", fill=INK, stroke=WHITE, stroke_width=1.5, cx=round(x), cy=round(y), r=5),
            el("circle", class_="mkr mb", fill="none", stroke=WHITE, stroke_width=3, cx=a, cy=b, r=18),
            el("circle", class_="mk mb", fill=INK, cx=a, cy=b, r=17),
            centred(str(spot.number), a, b, class_="mkt", fill=WHITE, size=19, weight=700),
        ]
    return parts


def _inside(at: Point, ring: Sequence[Point]) -> bool:
    """Tell whether a point lies in a ring (even-odd rule)."""
    x, y = at
    crossings = 0
    for (x0, y0), (x1, y1) in zip(ring, [*ring[1:], ring[0]], strict=True):
        crossings += (y0 > y) != (y1 > y) and x < (x1 - x0) * (y - y0) / (y1 - y0) + x0
    return crossings % 2 == 1


def _touches(at: Point, box: Box, radius: float) -> bool:
    dx = max(box[0] - at[0], 0.0, at[0] - box[2])
    dy = max(box[1] - at[1], 0.0, at[1] - box[3])
    return math.hypot(dx, dy) < radius + 3


def _crosses(start: Point, end: Point, box: Box) -> bool:
    """Tell whether a line runs through a box, at any of sixteen points of it."""
    on_line = ((start[0] + (end[0] - start[0]) * k / 16, start[1] + (end[1] - start[1]) * k / 16) for k in range(17))
    return any(box[0] <= a <= box[2] and box[1] <= b <= box[3] for a, b in on_line)


def _circle_radius(frame: Frame, rules: Rules) -> float:
    """Return the radius of a circle whose diameter is the legal distance."""
    return rules.distance_m * frame.scale / 2


def _foot_height(frame: Frame, rules: Rules) -> int:
    """Return the height of the strip below the map that holds scale bar and circle."""
    radius = _circle_radius(frame, rules)
    return max(_FOOT, round(2 * radius) + 24) if radius <= MAX_FOOT_RADIUS else _FOOT


def _scale(shown: FloorMap, frame: Frame, rules: Rules) -> list[Markup]:
    """Draw the scale bar and the circle of the legal distance; a large circle lies inside the map's corner."""
    y = frame.height + _foot_height(frame, rules) // 2
    radius = _circle_radius(frame, rules)
    line: Look = {"class_": "sc", "fill": "none", "stroke": INK, "stroke_width": 2}
    x, centre = radius + 3, float(y)
    if radius > MAX_FOOT_RADIUS:
        x, centre = frame.width - radius - 8, frame.height - radius - 8
    parts = [el("circle", cx=round(x, 1), cy=round(centre, 1), r=round(max(radius, 1.5), 1), **line)]
    label = say("where.across", distance=fmt.distance(rules.distance_m, rules.distance_unit))
    words = "pt i" if frame.width > 0.6 * MAP_WIDTH else "pt i nar"  # a narrow floor is not shrunk on a phone
    if radius > MAX_FOOT_RADIUS:
        parts.append(_text(label, x - radius - 10, centre + 5, class_="pt i halo", fill=INK, anchor="end"))
    else:
        if radius > 6:
            parts.append(el("path", d=f"M{x - radius:.1f} {y}h{2 * radius:.1f}", **line))
        parts.append(_text(label, x + radius + 10, y + 5, class_=words, fill=INK))
    if shown.scale_bar_m:
        width = shown.scale_bar_m * frame.scale
        right = frame.width - 1
        parts.append(el("path", d=f"M{right - width:.1f} {y - 6}v8h{width:.1f}v-8", **line))
        label = fmt.distance(shown.scale_bar_m, rules.distance_unit)
        parts.append(_text(label, right - width - 10, y + 5, class_=words, fill=INK, anchor="end"))
    return parts
