"""What a reader learns from outputs beside the report: the planner's numbers, and the card of each day.

The planner's page holds hours of the whole floor, the figures of places and sums of cells. Cells are read as what
merging allows: of a place that is not held back, the sum is exact; where nothing is given, fewer than five were
counted; where something is, at least one was, and no more than what is given. The card gives a day to a step (`rough`),
which `tests/figures/test_today.py` shows to be all that it says of violations.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
from privacy import hidden_counts as hidden
from privacy import person_times
from privacy.hidden_counts import BELOW, HOURS, N_DAYS, POINTS, Known, World

from vsd_analytics.errors import ReportError, UsageError
from vsd_analytics.figures.maps import SIGMA_M, cell_maps
from vsd_analytics.figures.share.counts import rough
from vsd_analytics.planner.cell_counts import CELL_M, SQUARE_M, grid_of
from vsd_analytics.planner.planner_data import PlannerData, PlannerWeek, planner_pages
from vsd_analytics.stats.hotspots import smoothed
from vsd_analytics.warehouse.warehouse import open_warehouse

PAIR_M = (0.76, 0.01)
"""From a point to the middle of the two people of its violations."""


def read_planner(
    known: Known,
    world: World,
    week: int,
    hidden_hours: Collection[tuple[int, int]],
    *,
    times: person_times.Times | None = None,
) -> bool:
    """Add the numbers of a week's planner, and tell whether there is one.

    Args:
        known: What is known so far.
        world: What was counted.
        week: Which.
        hidden_hours: Days and hours that the report hides.
        times: What is known of person-time so far.
    """
    try:
        [data] = planner_pages(world.site, hidden.monday(week))
    except (ReportError, UsageError):
        return False
    source = f"week {week} planner"
    _read_hours(known, week, data.week, hidden_hours, source)
    for k, place in enumerate(data.places):
        if k not in data.week.hidden:
            e, key = place.violation_rate, True if k == 0 else None if place.area is None else place.area.area_id
            told: dict[str, float | None] = {"value": e.value, "previous": e.previous, "change": e.change}
            hidden._rate(known, world, week, key, told, f"{source} {place.place_id}")
    _read_cells(known, week, data, source)
    if times is not None:
        person_times.read_planner(times, world, week, data)
    return True


def _read_hours(
    known: Known, week: int, told: PlannerWeek, hidden_hours: Collection[tuple[int, int]], source: str
) -> None:
    if 0 in told.hidden:
        assert not told.panel.n.any()
        return
    together, total = [], 0
    for day, hour, is_counted, n in zip(
        told.panel.day.tolist(), told.panel.hour.tolist(), told.panel.is_counted[0], told.panel.n[0, 0], strict=True
    ):
        if not is_counted or day >= N_DAYS:
            continue
        keys = hidden.keys_of(week, day=day, hour=hour)
        if (day, hour) in hidden_hours:
            together += keys
            total += int(n)
        else:
            known.exact(keys, int(n), f"{source} hour {day} {hour}")
    if together:
        known.exact(together, total, f"{source} hidden hours together")


def _read_cells(known: Known, week: int, data: PlannerData, source: str) -> None:
    cells, grid = data.week.cells, None if data.shown is None else grid_of(data.shown.extent)
    if cells is None or grid is None or 0 in data.week.hidden or not data.week.is_ranked:
        return
    across = round(1 / CELL_M)
    rows = cells.violations
    given = np.zeros(len(POINTS), dtype=np.int64)
    for p, ((x, y), (_, camera)) in enumerate(POINTS.items()):
        cx, cy = ((v + d) // CELL_M for v, d in zip((x, y), PAIR_M, strict=True))
        cell = (cy - grid.y0 * across) * grid.n_x * across + cx - grid.x0 * across
        given[p] = rows.values[0][(rows.camera == camera) & (rows.cell == cell)].sum()
    assert given.sum() == rows.values[0].sum(), "all cells are those of points"
    held = {
        None if row.area is None else row.area.area_id for k, row in enumerate(data.places) if k in data.week.hidden
    }
    groups: dict[str | None, list[int]] = {}
    for p, (place, _) in enumerate(POINTS.values()):
        groups.setdefault("hidden" if place in held else place, []).append(p)
    for name, of_place in groups.items():
        if name == "hidden":
            assert not given[of_place].any(), "cells of places that are held back have no counts"
            continue
        keys = {p: [key for key in hidden.keys_of(week) if key[1] == p] for p in of_place}
        if given[of_place].any():
            known.exact([key for p in of_place for key in keys[p]], int(given[of_place].sum()), f"{source} cells")
        for p in of_place:
            low, high = (1, int(given[p])) if given[p] else (0, BELOW - 1)
            known.between(dict.fromkeys(keys[p], 1.0), low, high, f"{source} cell of {p}")


def read_smoothed_maps(known: Known, world: World, week: int, figures: Mapping[str, Any]) -> int:
    """Add the squares of M18 and M19 of a week, for a reader who knows all that these divide by; return how many.

    Violations at a point put two people's time too close into their squares; smoothed, it is a sum over points.

    Args:
        known: What is known so far.
        world: What was counted.
        week: Which.
        figures: `figures` of the JSON file.
    """
    first, last = hidden.monday(week), hidden.monday(week) + timedelta(days=6)
    with open_warehouse(world.site, first, last) as warehouse:
        maps = cell_maps(warehouse, floor=world.site.floors[0], cell_m=SQUARE_M, first=first, last=last)
    grid = maps.risk.grid
    assert grid is not None
    assert maps.risk.exposure_h is not None
    assert maps.excess.expected_h is not None
    divided_by = {"M18": maps.risk.exposure_h, "M19": maps.excess.expected_h}
    of_point = []
    for x, y in POINTS:
        one_h = np.zeros(grid.shape)
        for s in (0, 1.5):
            at = int((y + 1e-6) // SQUARE_M) - grid.cy, int((x + s + 1e-6) // SQUARE_M) - grid.cx
            if 0 <= at[0] < grid.shape[0] and 0 <= at[1] < grid.shape[1]:  # else nobody stood there all week
                one_h[at] += hidden.CLOSE_H
        of_point.append(smoothed(one_h, SIGMA_M / SQUARE_M))
    n_read = 0
    for metric, hours in divided_by.items():
        near = smoothed(hours, SIGMA_M / SQUARE_M)
        for row in figures[metric]["rows"] or ():
            at = int(row["y_m"] // SQUARE_M) - grid.cy, int(row["x_m"] // SQUARE_M) - grid.cx
            if not (metric == "M18" and row["value"] >= 1):
                weights = {key: float(of_point[key[1]][at]) for key in hidden.keys_of(week)}
                source = f"week {week} {metric} {row['x_m']} {row['y_m']}"
                known.rounded(weights, row["value"] * float(near[at]), source, digits=5)
                n_read += 1
    return n_read


def read_cards(known: Known, world: World, week: int, *, first: World) -> None:
    """Add what cards say of the days of a week; nothing of those that changed since the week `first` left."""
    for day in range(N_DAYS):
        keys = hidden.keys_of(week, day=day)
        n = world.sum(keys)
        if n != first.sum(keys):
            continue
        step = rough(n, below=BELOW)
        if all((week, camera, day) in world.lost for camera in range(2)):
            continue
        low, high = (1, BELOW - 1) if step is None else (0, 0)
        if step:
            low, high = max(BELOW, step - BELOW), step + BELOW - 1
        known.between(dict.fromkeys(keys, 1.0), low, high, f"week {week} card of day {day}")


def read_duckdb(known: Known, world: World, path: Path) -> int:
    """Add the counts of a DuckDB file of weeks, and return how many there were."""
    tables = {
        "areas": "select week, area_id, violations from areas",
        "weeks": "select week, violations from weeks",
        "hours": "select week, local_date, local_hour, violations from hours",
    }
    n_read = 0
    with duckdb.connect(str(path), read_only=True) as con:
        for table, query in tables.items():
            for iso, *at, n in con.execute(query).fetchall():
                week = (date.fromisoformat(f"{iso}-1") - hidden.FIRST).days // 7
                if n is None or not 0 <= week < world.n_weeks:
                    continue
                keys = hidden.keys_of(week)
                if table == "areas":
                    keys = hidden.keys_of(week, place=None if at[0] == "rest" else at[0])
                elif table == "hours":
                    keys = hidden.keys_of(week, day=(at[0] - hidden.monday(week)).days, hour=at[1])
                    if at[1] not in range(*HOURS):
                        continue
                known.exact(keys, n, f"week {week} duckdb {table}")
                n_read += 1
    return n_read
