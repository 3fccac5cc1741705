"""What every drawing of a floor shares: its frame, ground, bands, plan and fixtures, as inline SVG."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final

from markupsafe import Markup

from vsd_analytics.figures.week.model_map import FloorMap, MapBand, MapFixture, MapImage, Point, Polygon, Ring
from vsd_analytics.report.draw.svg import (
    FIXTURE,
    FIXTURE_EDGE,
    HATCH,
    INK,
    MUTED,
    RAMP_LIGHT,
    WALL,
    WHITE,
    Look,
    centred,
    el,
    hatch_pattern,
    smooth_path,
    straight_path,
)

if TYPE_CHECKING:
    import shapely

FONT: Final = 15
FONT_FIXTURE: Final = 15
FONT_PHONE: Final = 34
"""Size of names on a phone, where the page's style sets them larger: those without the room are left out there."""
WALL_WIDTH_M: Final = 0.5
"""A wall this thin is drawn solid; a wider one is a closed room."""
ON_EDGE_M: Final = 0.002
"""A band's corner this near to a fixture's edge was made by it."""
ROOM: Final = "#f1ede3"
DOTS_APART: Final = 9
"""SVG units between the dots of uncertain floor."""
_NARROW, _SLIM, _WIDE = frozenset("ijl.,:;'|! "), frozenset("frtI()-"), frozenset("mwMW@%")


class Frame:
    """Maps the unit of a drawing to SVG units.

    Args:
        shown: What is drawn; metres with y up, or pixels with y down on a picture.
        width: Largest width, SVG units.
        height: Largest height.
    """

    def __init__(self, shown: FloorMap, *, width: float, height: float) -> None:
        x0, y0, x1, y1 = shown.extent
        self.is_metric = shown.kind != "picture"
        self.scale = min(width / max(x1 - x0, 1e-9), height / max(y1 - y0, 1e-9))
        self.x0, self.y0, self.y1 = x0, y0, y1
        self.width = max(1, round((x1 - x0) * self.scale))
        self.height = max(1, round((y1 - y0) * self.scale))

    @property
    def whole(self) -> dict[str, float]:
        """Return the attributes of a rectangle that is all of it."""
        return {"x": 0, "y": 0, "width": self.width, "height": self.height}

    def at(self, point: Point) -> Point:
        """Return a point in SVG units."""
        y = self.y1 - point[1] if self.is_metric else point[1] - self.y0
        return (point[0] - self.x0) * self.scale, y * self.scale

    def ring(self, ring: Ring) -> list[Point]:
        """Return a ring in SVG units."""
        return [self.at(p) for p in ring]

    def rings(self, polygons: Iterable[Polygon]) -> list[list[Point]]:
        """Return all rings of polygons in SVG units."""
        return [self.ring(r) for polygon in polygons for r in polygon]


def hatch_defs(frame: Frame, *, hatch: str, clip: str, step: float = 9) -> Markup:
    """Return the pattern of floor no camera sees, and the clip of the frame.

    Args:
        frame: The frame.
        hatch: Id of the pattern.
        clip: Id of the clip.
        step: From line to line, SVG units.
    """
    pattern = hatch_pattern(hatch, step=step, stroke_width=round(step * 0.155, 1), class_="hl")
    return el("defs", pattern + el("clipPath", el("rect", **frame.whole), id=clip))


def dot_defs(*, dots: str, is_picture: bool) -> Markup:
    """Return the pattern of floor whose distances are too uncertain.

    On a picture, which may be bright or dark, they are white with a dark edge.
    """
    look = {"fill": WHITE, "stroke": INK, "stroke_width": 0.7} if is_picture else {"class_": "dd", "fill": HATCH}
    dot = el("circle", **look, cx=DOTS_APART / 2, cy=DOTS_APART / 2, r=2.0 if is_picture else 1.4)
    return el("defs", el("pattern", dot, id=dots, width=DOTS_APART, height=DOTS_APART, patternUnits="userSpaceOnUse"))


def uncertain(polygons: Sequence[Polygon], frame: Frame, *, dots: str) -> Markup:
    """Draw floor whose distances are too uncertain to colour it."""
    path = straight_path(frame.rings(polygons))
    return el("path", class_="un", fill=f"url(#{dots})", fill_rule="evenodd", d=path)


def ground(frame: Frame) -> Markup:
    """Draw bare floor."""
    return el("rect", class_="fl", fill=WHITE, **frame.whole)


def unseen(polygons: Sequence[Polygon], frame: Frame, *, hatch: str) -> Markup:
    """Draw floor no camera sees."""
    path = straight_path(frame.rings(polygons))
    return el("path", class_="nv", fill=f"url(#{hatch})", fill_rule="evenodd", d=path)


def image(shown: MapImage, frame: Frame, *, name: str | None = None) -> Markup:
    """Draw the plan or picture.

    Args:
        shown: The picture.
        frame: The frame.
        name: Id by which small drawings of the page show it again.
    """
    x0, y0, x1, y1 = shown.extent
    left, top = frame.at((x0, y1 if frame.is_metric else y0))
    return el(
        "image",
        id=name,
        class_=("planpic paper" if shown.is_opaque else "planpic") if frame.is_metric else "scene",
        href=shown.data_uri,
        x=round(left, 1),
        y=round(top, 1),
        width=round((x1 - x0) * frame.scale, 1),
        height=round((y1 - y0) * frame.scale, 1),
        preserveAspectRatio="none",
    )


def heat(bands: Sequence[MapBand], frame: Frame, *, steps: Sequence[float], edges: Edges | None = None) -> list[Markup]:
    """Draw bands, weakest first, each in the colour of its step.

    Args:
        bands: The bands.
        frame: The frame.
        steps: Lower ends of all bands there are.
        edges: The fixtures' edges: outlines keep the corners they have there.
    """
    colour = {lower: min(i, 4) for i, lower in enumerate(steps)}
    drawn = []
    for i, band in enumerate(bands):
        step = colour.get(band.lower, min(i, 4))
        path = outline(band.polygons, frame, edges=edges)
        drawn.append(el("path", class_=f"c{step + 1}", fill=RAMP_LIGHT[step], fill_rule="evenodd", d=path))
    return drawn


def outline(polygons: Iterable[Polygon], frame: Frame, *, edges: Edges | None = None) -> str:
    """Return the path of smooth polygons, with straight edges along fixtures."""
    rings = [r for polygon in polygons for r in polygon]
    sharp = [edges.holds(r) for r in rings] if edges is not None else None
    return smooth_path([frame.ring(r) for r in rings], sharp=sharp)


class Edges:
    """The edges of fixtures.

    Args:
        fixtures: The fixtures of a map, at least one.
    """

    def __init__(self, fixtures: Sequence[MapFixture]) -> None:
        import shapely

        self._lines: shapely.Geometry = shapely.union_all([shapely.Polygon(f.ring) for f in fixtures]).boundary
        shapely.prepare(self._lines)

    def holds(self, ring: Ring) -> list[bool]:
        """Tell which points of a ring lie on an edge."""
        import shapely

        return [bool(b) for b in shapely.dwithin(self._lines, shapely.points(ring), ON_EDGE_M)]


def edges_of(shown: FloorMap) -> Edges | None:
    """Return the edges of a map's fixtures; None without any."""
    return Edges(shown.fixtures) if shown.fixtures else None


def fixtures(
    shown: Sequence[MapFixture], frame: Frame, *, is_named: bool = True, size: int = FONT_FIXTURE
) -> list[Markup]:
    """Draw fixtures: shelves and tills filled, movable ones dashed, thin walls solid, rooms with a strong outline.

    Args:
        shown: The fixtures, in floor metres.
        frame: The frame.
        is_named: Write the name into each that has the room for it, along its longer side.
        size: Of the names, SVG units.
    """
    order = {"wall": 0}
    drawn = [_fixture(f, frame) for f in sorted(shown, key=lambda f: order.get(f.kind, 1))]
    return drawn + ([label for f in shown if (label := _name(f, frame, size)) is not None] if is_named else [])


def places_left(gone: Sequence[MapFixture], frame: Frame) -> list[Markup]:
    """Draw where fixtures stood before they were moved: a dashed outline, nothing inside."""
    dash: Look = {"class_": "gn", "fill": "none", "stroke": INK, "stroke_width": 1.6}
    dash["stroke_dasharray"] = "2 3"
    return [el("path", **dash, d=straight_path([frame.ring(f.ring)])) for f in gone]


def area_outline(ring: Ring, frame: Frame) -> Markup:
    """Draw the border of an area."""
    look: Look = {"class_": "ar", "fill": "none", "stroke": MUTED, "stroke_width": 1.4}
    return el("path", **look, stroke_dasharray="3 4", d=straight_path([frame.ring(ring)]))


def _fixture(fixture: MapFixture, frame: Frame) -> Markup:
    import shapely

    path = straight_path([frame.ring(fixture.ring)])
    shape = shapely.Polygon(fixture.ring)
    if fixture.kind == "wall":
        is_thin = shape.length > 0 and 2 * shape.area / shape.length < WALL_WIDTH_M
        if is_thin:
            return el("path", class_="fw", fill=WALL, d=path)
        return el("path", class_="fx rm", fill=ROOM, stroke=WALL, stroke_width=2.5, d=path)
    if fixture.is_movable:
        dash = "5 3"
        return el("path", class_="fx mv", fill=FIXTURE, stroke=INK, stroke_width=1.6, stroke_dasharray=dash, d=path)
    return el("path", class_="fx", fill=FIXTURE, stroke=FIXTURE_EDGE, stroke_width=1, d=path)


def text_width(text: str, size: float) -> float:
    """Return about how wide a text is, in the unit of its font's size, for the sans-serif fonts of the page."""

    def share(char: str) -> float:
        if char in _NARROW:
            return 0.27
        return 0.36 if char in _SLIM else 0.87 if char in _WIDE else 0.7 if char.isupper() else 0.56

    return size * sum(map(share, text))


def _name(fixture: MapFixture, frame: Frame, size: int) -> Markup | None:
    """Write a name inside a fixture, along x or else along y; None when it fits neither way."""
    turn = _turn(fixture, frame, size)
    if turn is None:
        return None
    style = "fn"
    if size == FONT_FIXTURE:  # a map of the page, whose names a phone sets larger
        style = "pt fn" if _turn(fixture, frame, FONT_PHONE) == turn else "pt x fn"
    x, y = _middle(fixture, frame)
    return centred(fixture.name, x, y, class_=style, fill=MUTED, size=size, turn=turn)


def name_box(fixture: MapFixture, frame: Frame, size: float) -> tuple[float, float, float, float] | None:
    """Return what a fixture's name fills in letters of this size: left, top, right, bottom; None when none is drawn."""
    turn = _turn(fixture, frame, size)
    if turn is None:
        return None
    (x, y), long, high = _middle(fixture, frame), text_width(fixture.name, size) / 2, size / 2
    wide, tall = (high, long) if turn else (long, high)
    return x - wide, y - tall, x + wide, y + tall


def _middle(fixture: MapFixture, frame: Frame) -> Point:
    import shapely

    shape = shapely.Polygon(frame.ring(fixture.ring))
    middle = shape.centroid if shape.centroid.within(shape) else shape.representative_point()
    return middle.x, middle.y


def _turn(fixture: MapFixture, frame: Frame, size: float) -> str | None:
    """Return how a name must be turned to fit into a fixture: "" along x, a rotation along y, None for neither way."""
    import shapely

    shape = shapely.Polygon(frame.ring(fixture.ring))
    x, y = _middle(fixture, frame)
    long, high = text_width(fixture.name, size) / 2 + 1, size / 2 + 1
    for wide, tall, turn in ((long, high, ""), (high, long, f"rotate(-90 {round(x)} {round(y)})")):
        if shape.contains(shapely.box(x - wide, y - tall, x + wide, y + tall)):
            return turn
    return None
