"""What to ask about the room at a spot: a rule table over its shape, its name, and the fixtures around it (brief, 4.3).

The first rule that holds gives the question; `ask` of the area in `vsd.toml` comes before all but a camera that was
down. Questions are about the room, never about people.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vsd_analytics.report.words.catalogue import say
from vsd_analytics.site.model import Area, Fixture

NEAR_M: Final = 2.0
"""Fixtures this near to a spot belong to it."""
LONG: Final = 2.5
"""A spot at least this many times as long as wide is shaped like a queue."""
END_M: Final = 1.5
"""Two shelves whose ends are this near to a spot make it the end of an aisle."""

# Words in an area's name -> the key of the question to ask about it; the last fits every name.
BY_NAME: Final = (
    (("queue", "checkout", "till", "counter", "desk"), "queue"),
    (("entrance", "door", "exit", "lobby", "foyer"), "entrance"),
    (("aisle", "corridor", "passage"), "one_way"),
    (("",), "spread"),
)


def by_name(name: str) -> str:
    """Return the key of the question an area's name suggests."""
    return next(key for words, key in BY_NAME if any(w in name.casefold() for w in words))


def ask(
    name: str,
    shape: BaseGeometry | None,
    *,
    area: Area | None,
    fixtures: Sequence[Fixture],
    when: str = "",
) -> str:
    """Return the question about a spot.

    Args:
        name: What the spot is called.
        shape: Its floor, metres; None = unknown, then only its name decides.
        area: The area of `vsd.toml` it lies in.
        fixtures: Those of its floor.
        when: Set behind the question, such as ", above all on Saturday around 13:00"; empty for nothing.
    """
    if area is not None and area.ask:
        return area.ask
    near = [] if shape is None else [f for f in fixtures if Polygon(f.polygon).distance(shape) <= NEAR_M]
    movable = [f for f in near if f.is_movable]
    is_queue = shape is not None and is_long(shape) and any(f.kind == "till" for f in near)
    if is_queue or by_name(name) == "queue":
        return say("ask.queue", area=name, when=when)
    if movable:
        nearest = min(movable, key=lambda f: Polygon(f.polygon).distance(shape))
        return say("ask.movable", fixture=nearest.name, area=name)
    if shape is not None and is_aisle_end(shape, near):
        return say("ask.one_way", area=name, when=when)
    return say(f"ask.{by_name(name)}", area=name, when=when)


def is_long(shape: BaseGeometry) -> bool:
    """Tell whether the smallest rectangle around a shape, turned as need be, is at least 2.5 times as long as wide."""
    short, long = _sides(shape)
    return long >= LONG * short > 0


def is_aisle_end(shape: BaseGeometry, fixtures: Sequence[Fixture]) -> bool:
    """Tell whether two long shelves end near a shape that is not between them for most of their length."""
    ends = []
    for fixture in fixtures:
        polygon = Polygon(fixture.polygon)
        short, long = _sides(polygon)
        is_beside = shape.buffer(END_M).intersection(polygon).area < 0.5 * polygon.area
        if fixture.kind == "shelf" and long >= LONG * short and polygon.distance(shape) <= END_M and is_beside:
            ends.append(fixture)
    return len(ends) >= 2


def _sides(shape: BaseGeometry) -> tuple[float, float]:
    box = shape.minimum_rotated_rectangle
    if not isinstance(box, Polygon):
        return 0.0, 0.0
    x, y = box.exterior.coords.xy
    a, b = ((x[i + 1] - x[i]) ** 2 + (y[i + 1] - y[i]) ** 2 for i in (0, 1))
    return min(a, b) ** 0.5, max(a, b) ** 0.5
