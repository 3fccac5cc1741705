"""Where names of areas and of small fixtures are written on a map: clear of each other and of the map's edge."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from vsd_analytics.figures.week.model_map import MapArea, MapFixture
from vsd_analytics.report.draw.floor_frame import Frame, name_box, text_width

Box = tuple[float, float, float, float]
"""Left, top, right, bottom, SVG units."""
GAP: Final = 3.0
EDGE: Final = 0.5
"""Areas drawn side by side may share this much, SVG units."""


@dataclass(frozen=True, slots=True)
class AreaName:
    """A name that has room.

    Attributes:
        text: The name.
        x: Left end, SVG units.
        y: Its baseline.
        sizes: The sizes of letters in which it has room.
        is_fixture: It is a fixture's.
    """

    text: str
    x: float
    y: float
    sizes: frozenset[float]
    is_fixture: bool = False

    def box(self, size: float) -> Box:
        """Return what it fills in letters of this size."""
        return (self.x, self.y - size, self.x + text_width(self.text, size), self.y + 0.25 * size)


def area_names(
    areas: Sequence[MapArea | MapFixture], fixtures: Sequence[MapFixture], frame: Frame, *, sizes: Mapping[float, float]
) -> list[AreaName]:
    """Place the name of each area above it, inside it or below it; without room it has none.

    There is room where no other name is and no area beside it, which the name would seem to be of. A place with room
    in all sizes wins; else the first with room in the smallest.

    Args:
        areas: The areas, and fixtures too small for their names; of two that need the same place, the first has it.
        fixtures: Fixtures whose names are written, each where it has room in itself.
        frame: The frame of the map.
        sizes: Sizes in which the areas' names may be drawn, smallest first, and the fixtures' names beside each.
    """
    taken: dict[float, list[Box]] = {
        size: [box for f in fixtures if (box := name_box(f, frame, beside)) is not None]
        for size, beside in sizes.items()
    }
    placed = []
    outlines = [_around(area, frame) for area in areas]
    for area, own in zip(areas, outlines, strict=True):
        beside = [other for other in outlines if not _meet(other, own)]
        choices = [_with_room(place, frame, taken, beside) for place in _places(area, own, frame, min(sizes))]
        choices = [c for c in choices if min(sizes) in c.sizes]
        best = max(choices, key=lambda c: len(c.sizes), default=None)
        if best is None:
            continue
        placed.append(best)
        for size in best.sizes:
            taken[size].append(best.box(size))
    return placed


def _places(area: MapArea | MapFixture, own: Box, frame: Frame, size: float) -> Iterator[AreaName]:
    """Yield where a name may be: above its area, inside its top or bottom, below it; first at its left end."""
    left, top, right, bottom = own
    if left >= frame.width or top >= frame.height or right <= 0 or bottom <= 0:
        return
    left, right, top = max(GAP, left), min(frame.width - GAP, right), max(0.0, top)
    inside = 4.0 if left > GAP else 0.0
    for x, inward in ((left, inside), (right - text_width(area.name, size), -inside)):
        for y, shift in ((top - 6, 0.0), (top + size + 4, inward), (bottom - 7, inward), (bottom + size + 2, 0.0)):
            yield AreaName(area.name, max(GAP, x + shift), y, frozenset(), isinstance(area, MapFixture))


def _with_room(name: AreaName, frame: Frame, taken: Mapping[float, Sequence[Box]], beside: Sequence[Box]) -> AreaName:
    """Return the name with the sizes in which nothing else is there."""

    def has_room(size: float) -> bool:
        box = name.box(size)
        is_on_map = box[1] >= 0 and box[2] <= frame.width and box[3] <= frame.height
        return is_on_map and not any(_meet(box, other) for other in (*taken[size], *beside))

    return replace(name, sizes=frozenset(s for s in taken if has_room(s)))


def _around(area: MapArea | MapFixture, frame: Frame) -> Box:
    x, y = zip(*frame.ring(area.ring), strict=True)
    return min(x), min(y), max(x), max(y)


def _meet(a: Box, b: Box) -> bool:
    """Tell whether two boxes share more than an edge."""
    return a[0] < b[2] - EDGE and b[0] < a[2] - EDGE and a[1] < b[3] - EDGE and b[1] < a[3] - EDGE
