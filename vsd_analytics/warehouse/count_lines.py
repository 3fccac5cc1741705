"""The relations `count_lines` and `line_parts`: where counting lines lie, and which camera counts on which part of one.

A line is given to as few cameras as possible: a border between two cameras on a line is a place at which a person may
be counted twice or not at all.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pyarrow as pa

from vsd_analytics.settings import OWNER_CELL_M
from vsd_analytics.site.lines import Line
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.warehouse.owner_spans import FOREVER_MS, OwnerSpan, camera_life, day_start_ms, in_force, owner_spans

STEP_M = OWNER_CELL_M / 2
"""A line is cut into steps of this length, to ask for each who sees it."""

SIDES_M = 1.0
"""A camera that sees so far around a line sees people on both sides of it."""

_LINES = pa.schema(
    [
        ("floor_id", pa.string()),
        ("from_ms", pa.int64()),
        ("to_ms", pa.int64()),
        ("line_id", pa.string()),
        ("line_no", pa.int32()),
        ("ax_mm", pa.int64()),
        ("ay_mm", pa.int64()),
        ("bx_mm", pa.int64()),
        ("by_mm", pa.int64()),
        ("length_mm", pa.float64()),
    ]
)
_PARTS = pa.schema(
    [
        ("floor_id", pa.string()),
        ("from_ms", pa.int64()),
        ("to_ms", pa.int64()),
        ("line_id", pa.string()),
        ("camera_id", pa.string()),
        ("start_mm", pa.float64()),
        ("end_mm", pa.float64()),
    ]
)


def line_rows(site: Site) -> list[tuple[Any, ...]]:
    """Return the rows of `count_lines`: a line that cameras count each, its life (UTC milliseconds), its ends (mm)."""
    rows = []
    for number, line in enumerate(site.lines):
        if line.is_by_counter:
            continue
        ends = _ends_mm(line)
        rows.append(
            (line.floor_id, *line_life_ms(site, line), line.line_id, number, *ends[0], *ends[1], math.dist(*ends))
        )
    return rows


def part_rows(site: Site) -> list[tuple[Any, ...]]:
    """Return the rows of `line_parts`: a camera each, and where along a line it counts (mm from its first point).

    One camera counts on the whole line where one sees all of it: of several the one that owns most of it. Else each
    step of the line goes to the camera that owns its place, or whose view is nearest. Where no camera of the floor has
    a known view, each counts all that it sends.
    """
    rows = []
    lines = [line for line in site.lines if not line.is_by_counter]
    spans = owner_spans(site) if lines else []
    for line in lines:
        first_ms, end_ms = line_life_ms(site, line)
        for span in (s for s in spans if s.floor_id == line.floor_id):
            from_ms, to_ms = max(first_ms, span.from_ms), min(end_ms, span.to_ms)
            if from_ms < to_ms:
                parts = _parts(_ends_mm(line), _cameras(site, span), span.cells)
                rows += [(line.floor_id, from_ms, to_ms, line.line_id, *part) for part in parts]
    return rows


def count_lines(site: Site) -> pa.Table:
    """Return the relation `count_lines`."""
    return _table(_LINES, line_rows(site))


def line_parts(site: Site) -> pa.Table:
    """Return the relation `line_parts`."""
    return _table(_PARTS, part_rows(site))


def _ends_mm(line: Line) -> tuple[tuple[int, int], tuple[int, int]]:
    assert line.points is not None  # only lines of counters may lack them
    (ax, ay), (bx, by) = line.points
    return (round(ax * 1000), round(ay * 1000)), (round(bx * 1000), round(by * 1000))


def line_life_ms(site: Site, line: Line) -> tuple[int, int]:
    """Return the UTC milliseconds from and up to which a line counts."""
    return (
        -FOREVER_MS if line.first_day is None else day_start_ms(site, line.first_day),
        FOREVER_MS if line.end_day is None else day_start_ms(site, line.end_day),
    )


def _cameras(site: Site, span: OwnerSpan) -> tuple[Camera, ...]:
    """Return the cameras of a span's floor that are there in it, each with the calibration in force."""
    there = (c for c in site.cameras if c.floor_id == span.floor_id)
    lives = ((c, camera_life(site, c)) for c in there)
    return tuple(replace(c, calibrations=in_force(c, span.from_ms)) for c, (a, z) in lives if a <= span.from_ms < z)


@lru_cache(maxsize=256)
def _parts(
    ends_mm: tuple[tuple[int, int], tuple[int, int]],
    cameras: tuple[Camera, ...],
    cells: Sequence[tuple[str, int, int]],
) -> tuple[tuple[str, float, float], ...]:
    """Return camera, start and end (millimetres along the line) of the parts of a line."""
    import shapely

    from vsd_analytics.geometry.camera_views import view_polygon

    length_mm = math.dist(*ends_mm)
    known = {c.camera_id: view_polygon(c, calibration=next(iter(c.calibrations), None)) for c in cameras}
    views = {name: view for name, view in known.items() if view is not None and not view.is_empty}
    if len(cameras) < 2 or not views:
        return tuple((c.camera_id, 0.0, length_mm) for c in cameras)
    n_steps = max(1, int(np.ceil(length_mm / 1000 / STEP_M)))
    middles = np.linspace(*ends_mm, 2 * n_steps + 1)[1::2] / 1000
    owner_of = {(cx, cy): name for name, cx, cy in cells}
    at_cells = np.floor(middles / OWNER_CELL_M).astype(int).tolist()
    names = list(views)
    far_m = np.stack([shapely.distance(shapely.points(middles), views[name]) for name in names])
    nearest = [names[k] for k in np.argmin(far_m, axis=0)]
    chosen = [owner_of.get((cx, cy), near) for (cx, cy), near in zip(at_cells, nearest, strict=True)]
    line = shapely.LineString(np.array(ends_mm) / 1000)
    for margin_m in (SIDES_M, 0.0):
        if whole := [name for name in names if views[name].buffer(-margin_m).covers(line)]:
            chosen = [max(whole, key=chosen.count)] * n_steps
            break
    edges_mm = np.linspace(0.0, length_mm, n_steps + 1).tolist()
    starts = [k for k in range(n_steps) if k == 0 or chosen[k] != chosen[k - 1]]
    return tuple((chosen[k], edges_mm[k], edges_mm[end]) for k, end in zip(starts, [*starts[1:], n_steps], strict=True))


def _table(schema: pa.Schema, rows: list[tuple[Any, ...]]) -> pa.Table:
    columns = list(zip(*rows, strict=True)) if rows else [()] * len(schema)
    return pa.table([pa.array(c, type=f.type) for c, f in zip(columns, schema, strict=True)], schema=schema)
