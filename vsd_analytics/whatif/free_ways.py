"""Ways that stay free beside a fixture: how wide, and how many people walk there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely

from vsd_analytics.site.model import Fixture, Point
from vsd_analytics.whatif.doors import passages
from vsd_analytics.whatif.floor_records import FloorRecords

WIDEST_M: Final = 4.0
"""A wider gap between two fixtures is open floor, not a way."""


@dataclass(frozen=True, slots=True)
class FreeWay:
    """A way between a fixture and another one.

    Attributes:
        name: Name of the other one.
        free_m: Clear width.
        n_people: Tracks that walked there before the edit.
        under_m: The least of the widths asked for that it falls under; None = of none.
    """

    name: str
    free_m: float
    n_people: int
    under_m: float | None


def free_ways(
    records: FloorRecords, polygon: tuple[Point, ...], others: tuple[Fixture, ...], *, widths_m: tuple[float, ...]
) -> tuple[FreeWay, ...]:
    """Return the ways beside a polygon, the narrowest first.

    Args:
        records: People around it, as recorded.
        polygon: The fixture thought of.
        others: The other fixtures of the floor; walls that are no fixture are not known.
        widths_m: Clear widths that a way should have.
    """
    shape = shapely.Polygon(polygon)
    shapes = [shapely.Polygon(f.polygon) for f in others]
    ways = []
    for k, (other, its) in enumerate(zip(others, shapes, strict=True)):
        gap = shapely.shortest_line(shape, its)
        if not 0 < gap.length <= WIDEST_M or any(gap.crosses(s) for j, s in enumerate(shapes) if j != k):
            continue
        ends = [(float(x), float(y)) for x, y in shapely.get_coordinates(gap)]
        n = np.unique(records.track[passages(records, (ends[0], ends[1]))[1]]).size
        under = [w for w in sorted(widths_m) if gap.length < w]
        ways.append(FreeWay(other.name, float(gap.length), int(n), under[0] if under else None))
    return tuple(sorted(ways, key=lambda way: way.free_m))
