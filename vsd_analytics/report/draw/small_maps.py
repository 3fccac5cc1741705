"""Small drawings of a floor, as inline SVG: heat, difference, footsteps, views of cameras, and the scene of a spot.

Each can be shown several times beside another, so none has labels to read; names are in titles, text alternatives and
tables. It shows the plan of the page's map again, which costs no bytes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import cycle
from typing import Final

import shapely
from markupsafe import Markup

from vsd_analytics.figures.week.model_map import (
    ChangeMaps,
    FloorMap,
    Footsteps,
    MapArea,
    MapBand,
    MapFixture,
    MapViews,
    SpotPicture,
)
from vsd_analytics.figures.week.results import Rules
from vsd_analytics.geometry.scale_bar import nice_length_m
from vsd_analytics.report.draw import floor_frame as draw
from vsd_analytics.report.draw.floor_frame import Frame
from vsd_analytics.report.draw.floor_plan import MAP_MAX_HEIGHT, MAP_WIDTH
from vsd_analytics.report.draw.svg import (
    ACCENT,
    BAR,
    CHANGE_LIGHT,
    INK,
    RAMP_LIGHT,
    WHITE,
    Look,
    centred,
    drawing,
    el,
    straight_path,
)
from vsd_analytics.wording import format as fmt

MINI_WIDTH: Final = 480
MINI_MAX_HEIGHT: Final = 450
VIEW_FONT: Final = 17
NUMBER_FONT: Final = 22
SCENE_WIDTH: Final = 640
SCENE_FONT: Final = 32
SIGN: Final = 9.0
"""Half the length of a minus, SVG units."""
SIGN_MIN: Final = 4.5


def mini_heat(
    floor: FloorMap,
    bands: Sequence[MapBand],
    *,
    name: str,
    steps: Sequence[float],
    label: str,
    gone: Sequence[MapFixture] = (),
) -> Markup:
    """Draw bands on the floor of a map.

    Args:
        floor: The map whose plan, fixtures and unseen floor are shown.
        bands: What is drawn on it.
        name: What the ids of the drawing start with.
        steps: Lower ends of all bands.
        label: Text alternative.
        gone: Fixtures that were moved away; outlined.
    """
    frame = mini_frame(floor)
    drawn = [*draw.heat(bands, frame, steps=steps, edges=draw.edges_of(floor)), *draw.places_left(gone, frame)]
    return mini(floor, frame, drawn, name, label)


def moved_away(floor: FloorMap, shown: ChangeMaps) -> tuple[MapFixture, ...]:
    """Return the fixtures of the week before that are there no longer."""
    return tuple(f for f in shown.fixtures_before or () if f not in floor.fixtures)


def mini_change(
    floor: FloorMap, shown: ChangeMaps, *, name: str, label: str, numbers: Mapping[str, str] | None = None
) -> Markup:
    """Draw floor with fewer and with more violations, each patch with its sign, unless its area's number has it.

    Args:
        floor: The map whose plan, fixtures and unseen floor are shown.
        shown: The difference.
        name: What the ids of the drawing start with.
        label: Text alternative.
        numbers: What is written on each area, by its id; the area is outlined.
    """
    frame, edges = mini_frame(floor), draw.edges_of(floor)
    drawn: list[Markup] = []
    for kind, bands in (("fewer", shown.fewer), ("more", shown.more)):
        for band in bands:
            step = shown.steps.index(band.lower)
            path = draw.outline(band.polygons, frame, edges=edges)
            style = f"{kind[0]}{step + 1}d"
            drawn.append(el("path", class_=style, fill=CHANGE_LIGHT[kind][step], fill_rule="evenodd", d=path))
    named = [a for a in floor.areas if a.area_id in (numbers or {})]
    taken: list[shapely.Geometry] = []
    for kind, bands in (("fewer", shown.fewer), ("more", shown.more)):
        sign = "+" if kind == "more" else fmt.MINUS
        signed = [shapely.Polygon(frame.ring(a.ring)) for a in named if (numbers or {})[a.area_id].startswith(sign)]
        signs, places = _signs(bands, frame, strong=shown.steps[1], is_plus=kind == "more", said=signed)
        drawn += signs
        taken += places
    gone = moved_away(floor, shown)
    drawn += draw.places_left(gone, frame)
    taken += [shapely.Polygon(frame.ring(f.ring)) for f in (*gone, *floor.fixtures)]
    above = [draw.area_outline(a.ring, frame) for a in named] + _numbers(named, numbers or {}, taken, frame)
    return mini(floor, frame, drawn, name, label, above=above)


def mini_footsteps(floor: FloorMap, steps: Footsteps, *, name: str, label: str) -> Markup:
    """Draw a dot in each cell people walked in; arguments as for `mini_heat`.

    One path of dashes with round ends: a cell of 0.25 m is about 5 units wide, and its dot 60 % of that.
    """
    frame = mini_frame(floor)
    side = steps.cell_m * frame.scale
    moves = []
    for cy, cx, n in steps.runs:
        x, y = frame.at(((cx + 0.5) * steps.cell_m, (cy + 0.5) * steps.cell_m))
        moves.append(f"M{x:.1f} {y:.1f}h{max((n - 1) * side, 0) + 0.1:.1f}")
    dots = el(
        "path",
        class_="fs",
        fill="none",
        stroke=INK,
        stroke_opacity=0.62,
        stroke_width=round(0.6 * side, 2),
        stroke_linecap="round",
        stroke_dasharray=f"0 {side:.3f}",
        d="".join(moves),
    )
    return mini(floor, frame, [dots], name, label)


def mini_views(floor: FloorMap, views: MapViews, *, name: str, label: str) -> Markup:
    """Draw what each camera sees and, stronger, what several do; arguments as for `mini_heat`."""
    frame = mini_frame(floor)
    drawn = []
    if views.shared:
        path = straight_path(frame.rings(views.shared))
        drawn.append(el("path", class_="vs", fill=ACCENT, fill_opacity=0.2, fill_rule="evenodd", d=path))
    look: Look = {"fill": ACCENT, "fill_opacity": 0.05, "stroke": ACCENT, "stroke_width": 1.6}
    for view, dash in zip(views.cameras, cycle((None, "7 3", "2 3", "9 3 2 3")), strict=False):
        path = straight_path(frame.rings(view.polygons))
        drawn.append(el("path", class_="vo", **look, stroke_dasharray=dash, fill_rule="evenodd", d=path))
    for view in views.cameras:
        x, y = frame.at(view.at)
        drawn.append(centred(view.label, x, y, class_="vl halo", fill=ACCENT, size=VIEW_FONT, weight=700))
    return mini(floor, frame, drawn, name, label, is_over=True)


def scene(picture: SpotPicture, floor: FloorMap, *, rules: Rules, name: str, label: str) -> Markup:
    """Draw the surroundings of a spot, with its bands and a scale bar.

    In a camera's picture the bar holds at the spot, as far from the camera as that.

    Args:
        picture: The picture, or the part of the floor.
        floor: The map the spot is numbered on: its plan, fixtures and unseen floor.
        rules: For the steps and the unit of distances.
        name: What the ids of the drawing start with.
        label: Text alternative.
    """
    shown = picture.shown
    frame = Frame(shown, width=SCENE_WIDTH, height=SCENE_WIDTH)
    is_picture = shown.kind == "picture"
    body = _scene_picture(shown, frame, rules) if is_picture else _scene_floor(shown, floor, frame, rules, name)
    parts = [body, _bar(picture.across_m, frame, rules)]
    return drawing(parts, (frame.width, frame.height), class_="map-pic" if is_picture else "map-spot", label=label)


def _scene_picture(shown: FloorMap, frame: Frame, rules: Rules) -> Markup:
    image = [] if shown.image is None else [draw.image(shown.image, frame)]
    colour = {lower: min(i, 4) for i, lower in enumerate(rules.heat_steps)}
    look: Look = {"fill_opacity": 0.66, "stroke": WHITE, "stroke_width": 1.4, "fill_rule": "evenodd"}
    bands = []
    for band in shown.bands:
        step, path = colour.get(band.lower, 4), straight_path(frame.rings(band.polygons))
        bands.append(el("path", class_=f"c{step + 1}", fill=RAMP_LIGHT[step], **look, d=path))
    return Markup("").join([*image, *bands])


def _scene_floor(shown: FloorMap, floor: FloorMap, frame: Frame, rules: Rules, name: str) -> Markup:
    hatch, clip = f"{name}-hat", f"{name}-clip"
    heat = draw.heat(shown.bands, frame, steps=rules.heat_steps, edges=draw.edges_of(floor))
    below = [draw.unseen(floor.unseen, frame, hatch=hatch)] if floor.unseen else []
    plan = _plan(floor, frame)
    fixtures = draw.fixtures(floor.fixtures, frame, size=SCENE_FONT)
    layers = Markup("").join([*heat, *below, *plan, *fixtures]) or Markup("<g/>")
    inside = el("g", layers, clip_path=f"url(#{clip})")
    return draw.hatch_defs(frame, hatch=hatch, clip=clip) + draw.ground(frame) + inside


def _bar(across_m: float, frame: Frame, rules: Rules) -> Markup:
    """Draw a scale bar into the lower right corner, on a ground of its own."""
    length_m = nice_length_m(across_m, unit=rules.distance_unit)
    label = fmt.distance(length_m, rules.distance_unit)
    long, high = length_m / across_m * frame.width, 1.5 * SCENE_FONT
    text = draw.text_width(label, SCENE_FONT)
    wide = long + text + 34
    x, y = frame.width - wide, frame.height - high
    end, line = frame.width - 12, frame.height - 0.44 * high
    path = f"M{end - long:.1f} {line - 8:.1f}v8h{long:.1f}v-8"
    return Markup("").join(
        [
            el("rect", class_="bg", fill=WHITE, x=round(x), y=round(y), width=round(wide) + 1, height=round(high) + 1),
            el("path", class_="sc", fill="none", stroke=INK, stroke_width=3, d=path),
            el("text", label, class_="bt", fill=INK, font_size=SCENE_FONT, x=round(x + 10), y=round(line + 4)),
        ]
    )


def mini_frame(floor: FloorMap) -> Frame:
    """Return the frame of a small drawing."""
    return Frame(floor, width=MINI_WIDTH, height=MINI_MAX_HEIGHT)


def mini(
    floor: FloorMap,
    frame: Frame,
    drawn: Iterable[Markup],
    name: str,
    label: str,
    *,
    is_over: bool = False,
    above: Iterable[Markup] = (),
) -> Markup:
    """Put a drawing between the floor and the fixtures on it; `is_over` and `above` put one over the fixtures."""
    hatch, clip = f"{name}-hat", f"{name}-clip"
    below = [draw.unseen(floor.unseen, frame, hatch=hatch)] if floor.unseen else []
    fixed = [*_plan(floor, frame), *draw.fixtures(floor.fixtures, frame, is_named=False)]
    layers = [*below, *fixed, *drawn] if is_over else [*drawn, *below, *fixed]
    layers += above
    body = (
        draw.hatch_defs(frame, hatch=hatch, clip=clip, step=7)
        + draw.ground(frame)
        + el("g", Markup("").join(layers) or Markup("<g/>"), clip_path=f"url(#{clip})")
        + el("rect", class_="fr", fill="none", stroke=BAR, stroke_width=1, **frame.whole)
    )
    return drawing([body], (frame.width + 2, frame.height + 2), class_="mini", label=label, corner=(-1, -1))


def _plan(floor: FloorMap, frame: Frame) -> list[Markup]:
    """Return the plan, or the page's own drawing of it again."""
    if floor.image is None:
        return []
    page = Frame(floor, width=MAP_WIDTH, height=MAP_MAX_HEIGHT)
    scale = frame.scale / page.scale
    x, y = frame.at((page.x0, page.y1))
    move = f"translate({x:.1f} {y:.1f}) " if abs(x) + abs(y) >= 0.05 else ""
    return [el("use", href="#plan0", transform=f"{move}scale({scale:.4f})")]


def _numbers(
    areas: Sequence[MapArea], numbers: Mapping[str, str], taken: Sequence[shapely.Geometry], frame: Frame
) -> list[Markup]:
    """Write a number on each area: in its middle or, where a sign or another number is, beside that or outside."""
    taken, drawn = list(taken), []
    whole = shapely.box(0, 0, frame.width, frame.height)
    for area in areas:
        number = numbers[area.area_id]
        wide, high = draw.text_width(number, NUMBER_FONT) / 2 + 2, NUMBER_FONT / 2
        shape = shapely.Polygon(frame.ring(area.ring))
        x0, y0, x1, y1 = shape.bounds
        middle = shape.representative_point()
        rows = (middle.y, y0 + high + 3, y1 - high - 3, y0 - high - 2, y1 + high + 2)
        columns = (middle.x, x0 + wide + 3, x1 - wide - 3)
        boxes = [shapely.box(x - wide, y - high, x + wide, y + high) for y in rows for x in columns]
        free = [b for b in boxes if whole.contains(b) and not any(b.intersects(t) for t in taken)]
        box = next(iter(free), boxes[0])
        taken.append(box)
        x, y = box.centroid.x, box.centroid.y
        drawn.append(centred(number, x, y, class_="cn halo", fill=INK, size=NUMBER_FONT, weight=700))
    return drawn


def _signs(
    bands: Sequence[MapBand], frame: Frame, *, strong: float, is_plus: bool, said: Sequence[shapely.Geometry] = ()
) -> tuple[list[Markup], list[shapely.Geometry]]:
    """Draw a sign in the middle of the widest part of each patch's strongest colour; return them and their places.

    None is drawn in `said`, areas whose number has the sign.
    """
    if not bands:
        return [], []
    places: list[shapely.Geometry] = []
    pieces = [(s, i) for i, band in enumerate(bands) for s in _shapes(band, frame)]
    drawn = []
    for patch in _shapes(bands[0], frame):
        inside = [(i, s.area, k) for k, (s, i) in enumerate(pieces) if patch.buffer(0.5).contains(s)]
        step, _, k = max(inside)
        circle = shapely.maximum_inscribed_circle(pieces[k][0], tolerance=0.5)
        (x, y), radius = circle.coords[0], circle.length
        if any(area.contains(shapely.Point(x, y)) for area in said):
            continue
        half = min(SIGN, max(SIGN_MIN, 0.62 * radius))
        places.append(shapely.box(x - half, y - half, x + half, y + half))
        path = f"M{x - half:.1f} {y:.1f}h{2 * half:.1f}"
        if is_plus:
            path += f"M{x:.1f} {y - half:.1f}v{2 * half:.1f}"
        style, ink = ("sg on2", WHITE) if bands[step].lower >= strong else ("sg", INK)
        drawn.append(el("path", class_=style, fill="none", stroke=ink, stroke_width=3.4 if half > 6 else 2.4, d=path))
    return drawn, places


def _shapes(band: MapBand, frame: Frame) -> list[shapely.Polygon]:
    shapes = [shapely.Polygon(frame.ring(p[0]), [frame.ring(r) for r in p[1:]]).buffer(0) for p in band.polygons]
    return [part for shape in shapes for part in shapely.get_parts(shape) if part.area > 0]
