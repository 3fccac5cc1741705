"""Small drawings of how people move over a floor, as inline SVG: directions cell by cell, and desire lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
import shapely.ops
from markupsafe import Markup

from vsd_analytics.figures.week.model_map import FloorMap, MapArea, Point
from vsd_analytics.report.draw import floor_frame as draw
from vsd_analytics.report.draw.floor_frame import Frame, text_width
from vsd_analytics.report.draw.small_maps import mini, mini_frame
from vsd_analytics.report.draw.svg import ACCENT, INK, el, straight_path

WIDTHS: Final = (1.0, 1.7, 2.6, 3.8)
"""Of an arrow, SVG units: each step means twice as many people."""
NAME_FONT: Final = 19
BOLD: Final = 1.15
"""About how much wider bold letters are."""
WIDEST: Final = 15.0
"""Of a desire line; a line of half the people is half as wide."""
NARROWEST: Final = 1.2
SMALLEST_SHARE: Final = 0.1
"""Of a cell: where less of it is seen and free, it has no arrow."""
BEND: Final = 0.16
"""How far a line leaves the straight way, to the right of those who walk, as a share of its length."""


@dataclass(frozen=True, slots=True)
class Arrow:
    """People who walk through one cell.

    Attributes:
        at: Its middle, floor metres.
        direction_deg: Counter-clockwise from the x axis; None where people cross it anyhow.
        is_both: They walk both ways.
        n_people: How many.
    """

    at: Point
    direction_deg: float | None
    is_both: bool
    n_people: float


@dataclass(frozen=True, slots=True)
class DesireLine:
    """People who go from one area to another.

    Attributes:
        start, end: Ids of the areas.
        per_open_h: How many an open hour.
    """

    start: str
    end: str
    per_open_h: float


def width_steps(arrows: Sequence[Arrow]) -> tuple[float, ...]:
    """Return the people from which an arrow has each width: the widest from the largest count's half on."""
    top = max((a.n_people for a in arrows), default=1.0)
    return tuple(top / 2 ** (len(WIDTHS) - 1 - k) for k in range(len(WIDTHS)))


def mini_directions(floor: FloorMap, arrows: Sequence[Arrow], *, cell_m: float, name: str, label: str) -> Markup:
    """Draw an arrow in each cell, as wide as many people walk there, two-headed for both ways, a dot for any.

    Args:
        floor: The map whose plan, fixtures and unseen floor are shown. An arrow is in the middle of what is free of its
            cell; a cell that no camera sees, or that fixtures fill, has none.
        arrows: The cells.
        cell_m: Their side.
        name: What the ids of the drawing start with.
        label: Text alternative.
    """
    frame = mini_frame(floor)
    paths = direction_paths(floor, arrows, frame, cell_m=cell_m)
    drawn = [
        el("path", class_="fs", fill="none", stroke=INK, stroke_width=width, stroke_linecap="round",
           stroke_linejoin="round", d=path)
        for width, path in zip(WIDTHS, paths, strict=True)
        if path
    ]  # fmt: skip
    return mini(floor, frame, drawn, name, label)


def mini_desire_lines(floor: FloorMap, lines: Sequence[DesireLine], *, name: str, label: str) -> Markup:
    """Draw a line from area to area, as wide as many people go there; none over floor that no camera sees.

    Args:
        floor: The map whose plan, fixtures, areas and unseen floor are shown.
        lines: Who goes where; areas that the map lacks are left out.
        name: What the ids of the drawing start with.
        label: Text alternative.
    """
    frame = mini_frame(floor)
    paths = line_paths(floor, lines, frame)
    ends = {area_id for line, _ in paths for area_id in (line.start, line.end)}
    named = [a for a in floor.areas if a.area_id in ends]
    drawn = [draw.area_outline(a.ring, frame) for a in named]
    drawn += [
        el("path", class_="vs", fill=ACCENT, fill_opacity=0.55, stroke="none", d=path) for _, path in paths if path
    ]
    drawn += [_name(a, frame) for a in named]
    return mini(floor, frame, drawn, name, label, is_over=True)


def direction_paths(
    floor: FloorMap, arrows: Sequence[Arrow], frame: Frame, *, cell_m: float, unit: float = 1.0
) -> tuple[str, ...]:
    """Return the arrows of each width of `WIDTHS`, as paths to stroke.

    Args:
        floor: The map whose fixtures and unseen floor have no arrow.
        arrows: The cells.
        frame: Where they are drawn.
        cell_m: Side of a cell.
        unit: Units of the frame in a unit of a small drawing.
    """
    taken, inside = _taken(floor), shapely.box(*floor.extent)
    steps, paths = width_steps(arrows), [""] * len(WIDTHS)
    half = 0.42 * cell_m * frame.scale
    for arrow in arrows:
        x, y = arrow.at
        cell = shapely.box(x - cell_m / 2, y - cell_m / 2, x + cell_m / 2, y + cell_m / 2)
        free = cell.intersection(inside).difference(taken)
        if free.area < SMALLEST_SHARE * cell_m**2:
            continue
        k = max(0, int(np.searchsorted(steps, arrow.n_people, side="right")) - 1)
        paths[k] += _arrow(frame.at((free.centroid.x, free.centroid.y)), arrow, half, unit)
    return tuple(paths)


def line_paths(
    floor: FloorMap, lines: Sequence[DesireLine], frame: Frame, *, unit: float = 1.0
) -> list[tuple[DesireLine, str]]:
    """Return the lines between areas of the map, widest first, each with a path to fill; empty over unseen floor only.

    Args:
        floor: The map whose areas they join.
        lines: Who goes where; areas that the map lacks are left out.
        frame: Where they are drawn.
        unit: Units of the frame in a unit of a small drawing.
    """
    areas = {a.area_id: a for a in floor.areas}
    shown = [i for i in lines if i.start in areas and i.end in areas and i.start != i.end]
    middles = {k: _middle(a, frame) for k, a in areas.items() if any(k in (i.start, i.end) for i in shown)}
    top = max((i.per_open_h for i in shown), default=1.0)
    hidden = shapely.Polygon() if not floor.unseen else shapely.union_all(
        [shapely.Polygon(frame.ring(p[0]), [frame.ring(r) for r in p[1:]]).buffer(0) for p in floor.unseen]
    )  # fmt: skip
    paths = []
    for line in sorted(shown, key=lambda i: -i.per_open_h):
        wide = max(NARROWEST, WIDEST * line.per_open_h / top) * unit
        shape = _curve(middles[line.start], middles[line.end], wide, unit).difference(hidden)
        rings = [list(p.exterior.coords) for p in shapely.get_parts(shape) if isinstance(p, shapely.Polygon)]
        paths.append((line, straight_path(rings)))
    return paths


def _arrow(at: Point, arrow: Arrow, half: float, unit: float) -> str:
    x, y = at
    digits = 1 if unit == 1 else 0

    def point(dx: float, dy: float) -> str:
        return f"{x + dx:.{digits}f} {y + dy:.{digits}f}"

    if arrow.direction_deg is None:
        r = 1.2 * unit
        return f"M{point(-r, 0)}a{r:.1f} {r:.1f} 0 1 0 {2 * r:.1f} 0a{r:.1f} {r:.1f} 0 1 0-{2 * r:.1f} 0"
    angle = math.radians(arrow.direction_deg)
    dx, dy = half * math.cos(angle), -half * math.sin(angle)  # y grows downwards in SVG

    def head(sign: int, towards: float) -> str:
        sides = [
            (sign * dx - 0.75 * half * math.cos(towards + turn), sign * dy + 0.75 * half * math.sin(towards + turn))
            for turn in (0.5, -0.5)
        ]
        return f"M{point(*sides[0])}L{point(sign * dx, sign * dy)}L{point(*sides[1])}"

    path = f"M{point(-dx, -dy)}L{point(dx, dy)}" + head(1, angle)
    return path + head(-1, angle + math.pi) if arrow.is_both else path


def _curve(start: Point, end: Point, wide: float, unit: float) -> shapely.Polygon:
    """Return a bent line with a head at its end, SVG units: it begins and ends beside the middles of the areas."""
    a, b = np.array(start), np.array(end)
    along = b - a
    right = np.array([-along[1], along[0]]) * BEND  # to the right of who walks along, as y grows downwards
    t = np.linspace(0.0, 1.0, 25)[:, None]
    points = (1 - t) ** 2 * a + 2 * t * (1 - t) * ((a + b) / 2 + 2 * right) + t**2 * b
    length = float(np.linalg.norm(along))
    away = min(16.0 * unit, 0.2 * length)
    way = shapely.LineString(points)
    head = min(max(9.0 * unit, 1.5 * wide), 0.35 * length)
    body = shapely.ops.substring(way, away, max(way.length - away - head, away + 0.1))
    neck = np.array(body.coords[-1])
    tip = np.array(way.interpolate(way.length - away).coords[0])
    side = np.array([-(tip - neck)[1], (tip - neck)[0]])
    side = side / max(float(np.linalg.norm(side)), 1e-9) * max(4.0 * unit, 0.95 * wide)
    triangle = shapely.Polygon([neck + side, tip, neck - side])
    return shapely.union_all([body.buffer(wide / 2, cap_style="flat"), triangle])


def _taken(floor: FloorMap) -> shapely.Geometry:
    """Return the floor that no camera sees, and what fixtures stand on."""
    unseen = [shapely.Polygon(p[0], p[1:]).buffer(0) for p in floor.unseen]
    return shapely.union_all([*unseen, *(shapely.Polygon(f.ring).buffer(0) for f in floor.fixtures)])


def _middle(area: MapArea, frame: Frame) -> Point:
    shape = shapely.Polygon(frame.ring(area.ring)).intersection(shapely.box(0, 0, frame.width, frame.height))
    point = shape.representative_point() if not shape.is_empty else shapely.Point(frame.ring(area.ring)[0])
    return point.x, point.y


def _name(area: MapArea, frame: Frame) -> Markup:
    """Write the name of an area above it, or below where there is no room, whole within the frame."""
    ring = frame.ring(area.ring)
    top, bottom = min(y for _, y in ring), max(y for _, y in ring)
    half = BOLD * text_width(area.name, NAME_FONT) / 2 + 4
    x = (max(0.0, min(x for x, _ in ring)) + min(float(frame.width), max(x for x, _ in ring))) / 2
    y = top - 7 if top > NAME_FONT + 7 else min(bottom + NAME_FONT, frame.height - 4)
    return el(
        "text", area.name, class_="cn halo", fill=INK, font_size=NAME_FONT, font_weight=700, text_anchor="middle",
        x=round(min(max(x, half), max(frame.width - half, half))), y=round(y),
    )  # fmt: skip
