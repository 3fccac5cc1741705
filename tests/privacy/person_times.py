"""A reader who collects every number that tells person-time, and solves for that of places with few people.

The unknowns are person-hours by week, point of the floor, day and hour; the last point is one person who stands alone.
Times as they are, counts over rates per person-hour, time too close over its share, squares of the planner and of the
maps of exposure become rows, as in `hidden_counts`. The time of fewer than five people is revealed when the greatest
value of it is within `NEAR` of the least.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from itertools import product
from typing import Any

import numpy as np
from privacy.hidden_counts import BELOW, CLOSE_H, HOURS, N_DAYS, PLACES, POINTS, Key, World, monday
from report import ingested_worlds as worlds
from scipy import sparse
from scipy.optimize import linprog

from vsd_analytics.planner.cell_counts import SQUARE_M, grid_of
from vsd_analytics.planner.planner_data import PlannerData

ALONE = len(POINTS)
NEAR = 0.01
NEAR_H = 1e-3
"""Times by hour that differ by less are the same, as a camera's time is rounded to frames."""
WHERE = (*POINTS, worlds.ALONE)
OF = (*POINTS.values(), (None, 0))
"""Place and camera of each point."""
Weights = Mapping[Key, float]


@dataclass
class Times:
    """What a reader knows of person-hours: rows of weights with their limits, and where each came from."""

    rows: list[tuple[Weights, float, float, str]] = field(default_factory=list)

    def about(self, keys: Sequence[Key], value: float | None, source: str, *, digits: int = 6) -> None:
        if value is not None:
            self.rounded(dict.fromkeys(keys, 1.0), value, source, digits=digits)

    def rounded(self, weights: Weights, value: float, source: str, *, digits: int = 6) -> None:
        slack = abs(value) * 10.0 ** (1 - digits) + 1e-6
        self.rows.append((weights, value - slack, value + slack, source))


def pairs_of(world: World) -> Mapping[Key, int]:
    """Return the pairs of people by point, day and hour."""
    return world.n if world.pairs is None else world.pairs


def truth(world: World) -> dict[Key, float]:
    """Return the person-hours of every point, day and hour."""
    hours = {key: 2 * CLOSE_H * n for key, n in pairs_of(world).items()}
    for week, day, hour in product(range(world.n_weeks), range(N_DAYS), range(*HOURS)):
        is_lost = (week, 0, day) in world.lost
        hours[week, ALONE, day, hour] = 0.0 if is_lost else 1 - world.cut_h.get((week, 0, day, hour), 0.0)
    return hours


def keys_of(
    week: int, *, place: str | bool | None = True, days: Sequence[int] = range(N_DAYS), hour: int | None = None
) -> list[Key]:
    """Return the unknowns of a week: of a place (True: all), some days, an hour."""
    points = [p for p, (area, _) in enumerate(OF) if place is True or area == place]
    return [(week, p, d, h) for p, d, h in product(points, days, range(*HOURS) if hour is None else [hour])]


def read_json(known: Times, world: World, week: int, told: Mapping[str, Any], *, through: int = N_DAYS - 1) -> None:
    """Add the numbers of a report's JSON, of a week or of its days so far."""
    source, days = f"{told['week']['iso']} to day {through}", range(through + 1)
    level = told["level"]
    _read_row(known, keys_of(week, days=days), level, level["violations"], f"{source} level")
    for row in told["areas"]:
        keys = keys_of(week, place=row["area_id"], days=days)
        _read_row(known, keys, row, row["counted"], f"{source} {row['area_id']}")
    for row in told["answers"].get("areas", {"rows": ()})["rows"]:
        known.about(keys_of(week, place=row["area_id"], days=days), row["exposure_h"], f"{source} M15")
    for cell in told["when"]["cells"]:
        day = (date.fromisoformat(cell["day"]) - monday(week)).days
        share, n = cell["close_time_share"], cell["violations"]
        if day in days and share and n:
            keys = keys_of(week, days=[day], hour=cell["hour"])
            known.about(keys, 2 * CLOSE_H * n / share, f"{source} when {day} {cell['hour']}", digits=5)
    for row in told["figures"]["M16"]["rows"] or () if "M16" in told["figures"] else ():
        weights = {
            key: share * 3600 / hours
            for p, share in _in_square(row["x_m"], row["y_m"]).items()
            if (hours := world.x_h(week, OF[p][1], days))
            for key in keys_of(week, days=days)
            if key[1] == p
        }
        known.rounded(weights, row["value"], f"{source} M16 {row['x_m']} {row['y_m']}")


def _in_square(x_m: float, y_m: float) -> dict[int, float]:
    """Return which part of each point's people stands in a square of a metre."""
    found = {}
    for p, (x, y) in enumerate(WHERE):
        people = [x] if p == ALONE else [x, x + 1.5]
        inside = [abs(at + 1e-6 - x_m) <= SQUARE_M / 2 and abs(y + 1e-6 - y_m) <= SQUARE_M / 2 for at in people]
        if any(inside):
            found[p] = sum(inside) / len(inside)
    return found


def _read_row(known: Times, keys: list[Key], row: Mapping[str, Any], n: float | None, source: str) -> None:
    known.about(keys, row["exposure_h"], f"{source} time")
    rate, share = row["encounter_rate"], row["close_time_share"]
    if n and rate and rate["value"]:
        known.about(keys, n / rate["value"], f"{source} M7", digits=5)
    if n and share and share["value"]:
        known.about(keys, 2 * CLOSE_H * n / share["value"], f"{source} M6", digits=5)


def read_planner(known: Times, world: World, week: int, data: PlannerData) -> None:
    """Add the numbers of a week's planner; the time of an hour or square as exact where it is, as a reader would guess.

    Hours of few people have equal parts of their sum, which is what a reader knows of them.
    """
    panel, source, hours = data.week.panel, f"week {week} planner", truth(world)
    times = panel.exposure_ms[0].sum(axis=0) / 3_600_000
    together, total_h = [], 0.0
    for day, hour, is_counted, time_h in zip(
        panel.day.tolist(), panel.hour.tolist(), panel.is_counted[0], times, strict=True
    ):
        keys = keys_of(week, days=[day], hour=hour) if day < N_DAYS else []
        if keys and is_counted and abs(sum(hours[key] for key in keys) - time_h) < NEAR_H:
            known.about(keys, float(time_h), f"{source} hour", digits=4)
        elif keys and is_counted:
            together += keys
            total_h += float(time_h)
    if together and total_h:
        known.about(together, total_h, f"{source} hours of few people together", digits=4)
    cells, grid = data.week.cells, None if data.shown is None else grid_of(data.shown.extent)
    if cells is None or grid is None or not data.week.is_ranked:
        return
    rows = cells.time
    for camera, cell in {(int(c), int(s)) for c, s in zip(rows.camera, rows.cell, strict=True)}:
        given = rows.values[0][(rows.camera == camera) & (rows.cell == cell)].sum() * cells.unit_ms / 3_600_000
        x_m, y_m = grid.x0 + cell % grid.n_x + 0.5, grid.y0 + cell // grid.n_x + 0.5
        parts = {p: share for p, share in _in_square(x_m, y_m).items() if OF[p][1] == camera}
        weights = {key: parts[key[1]] for key in keys_of(week) if key[1] in parts}
        if weights and abs(sum(w * hours[key] for key, w in weights.items()) - given) < cells.unit_ms / 7_200_000:
            known.rounded(weights, float(given), f"{source} square {x_m} {y_m}", digits=4)


def few_people(world: World) -> dict[str, list[Key]]:
    """Return the floors and places of weeks, and the hours of the floor, in which fewer than five people were.

    Of several days, it is the people of the day with most of them.
    """

    def n_people(week: int, day: int, place: str | bool | None = True, hours: Sequence[int] = range(*HOURS)) -> int:
        pairs = (
            n
            for (w, p, d, h), n in pairs_of(world).items()
            if (w, d) == (week, day) and h in hours and (place is True or OF[p][0] == place)
        )
        return 2 * sum(pairs) + (place in (True, None) and (week, 0, day) not in world.lost)

    found = {}
    for week, place in product(range(world.n_weeks), (True, *PLACES)):
        if 0 < max(n_people(week, day, place) for day in range(N_DAYS)) < BELOW:
            found[f"week {week}, person-time of {place}"] = keys_of(week, place=place)
    for week, day, hour in product(range(world.n_weeks), range(N_DAYS), range(*HOURS)):
        if 0 < n_people(week, day, hours=[hour]) < BELOW:
            found[f"week {week}, person-time of day {day}, hour {hour}"] = keys_of(week, days=[day], hour=hour)
    return found


def broken(known: Times, world: World) -> list[str]:
    """Return the rows that the world itself does not fulfil: mistakes of the reader."""
    hours = truth(world)
    sums = [(sum(w * hours[key] for key, w in row.items()), low, high, source) for row, low, high, source in known.rows]
    return [f"{source}: {n} is not in {low} to {high}" for n, low, high, source in sums if not low <= n <= high]


def worked_out(known: Times, world: World) -> dict[str, float]:
    """Return the hidden person-times whose value a reader finds."""
    if not known.rows:
        return {}
    hours = truth(world)
    index = {key: i for i, key in enumerate(hours)}
    of_rows = [(i, index[key], w) for i, (row, *_) in enumerate(known.rows) for key, w in row.items()]
    rows, columns, weights = (list(values) for values in zip(*of_rows, strict=True))
    matrix = sparse.csr_array((weights, (rows, columns)), shape=(len(known.rows), len(index)))
    low, high = (np.array([row[i] for row in known.rows]) for i in (1, 2))
    found = {}
    for name, keys in few_people(world).items():
        c = np.zeros(len(index))
        c[[index[key] for key in keys]] = 1.0
        ends = [
            linprog(sign * c, A_ub=sparse.vstack((matrix, -matrix)), b_ub=np.concatenate((high, -low)), bounds=(0, 200))
            for sign in (1, -1)
        ]
        least, most = (sign * end.fun if end.x is not None else np.nan for sign, end in zip((1, -1), ends, strict=True))
        time_h = sum(hours[key] for key in keys)
        if not most - least > NEAR * time_h:
            found[name] = time_h
    return found
