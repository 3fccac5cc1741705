"""Polygons of `vsd.toml` and of calibration files: simple ones, of a size that can be counted in cells."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from vsd_analytics.config.reader import TableReader
from vsd_analytics.site.model import Point

BOX_MAX_M2: Final = 250_000.0
"""Polygons are counted in cells of 0.25 m: beyond, the unit is wrong, or memory ends."""


def is_simple(table: TableReader, key: str, points: Sequence[Point]) -> bool:
    """Tell whether corners make a simple polygon with an area; note it (E128) where they do not."""
    from shapely import Polygon
    from shapely.validation import explain_validity

    shape = Polygon(points)
    if shape.is_valid and shape.area > 0:
        return True
    table.fault(
        key,
        f"{table.label} {key} crosses or touches itself, or has no area",
        code="E128",
        why=explain_validity(shape).replace("[", " at (").replace("]", ")").replace("Valid Geometry", "no area"),
        fix="list the corners once, in the order in which you would walk around it",
    )
    return False
