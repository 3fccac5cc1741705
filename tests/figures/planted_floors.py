"""Floors of which every camera-day is known: the marts of a warehouse replaced by planted ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from planted_marts import plant

from vsd_analytics.settings import FLOOR_CELL_M, Settings
from vsd_analytics.site.model import Area, Camera, Floor, Site
from vsd_analytics.stats.decomposition import closeness, nearby
from vsd_analytics.warehouse.warehouse import Warehouse

LAST = date(2026, 11, 15)
SHAPE = (12, 16)
VIEW = ((0.0, 0.0), (16.0, 0.0), (16.0, 12.0), (0.0, 12.0))
QUEUE = Area("queue", "Queue", "ground", ((3, 3), (7, 3), (7, 7), (3, 7)))
OTHERS = 6.0
"""Others that a person has in view."""
Risk = Callable[[int], np.ndarray]


def square(x: float, y: float, *, radius_m: float = 1.5, ratio: float = 4.0) -> np.ndarray:
    """Return the risk of each square metre: `ratio` near a place, else 1."""
    row, column = np.mgrid[: SHAPE[0], : SHAPE[1]] + 0.5
    return np.where(np.hypot(row - y, column - x) <= radius_m, ratio, 1.0)


def site_of(root: Path, *, cameras: Sequence[Camera] = (), areas: Sequence[Area] = (QUEUE,), **settings: Any) -> Site:
    """Return a site with one floor and, unless `cameras` says otherwise, one camera that sees all of it."""
    return Site(
        "shop",
        "Shop",
        "UTC",
        root,
        floors=(Floor("ground", "Ground floor"),),
        cameras=tuple(cameras) or (Camera("cam", "Cam", "ground", hz=1.0, view=VIEW),),
        areas=tuple(areas),
        settings=Settings().with_values(settings),
    )


@contextmanager
def planted(
    site: Site,
    risk: Risk,
    *,
    n_days: int = 28,
    last: date = LAST,
    per_day: float = 1200.0,
    recorded: Callable[[str, int], float] = lambda camera, day: 1.0,
    owner: Callable[[float], str] = lambda x: "cam",
    cells_of: Callable[[np.ndarray], np.ndarray] = lambda values: values,
    knows: Callable[[str], bool] = lambda what: True,
    seed: int = 1,
    shift_m: tuple[int, int] = (0, 0),
) -> Iterator[Warehouse]:
    """Open a warehouse whose marts hold planted days.

    Args:
        site: The site.
        risk: By day 0 to n_days - 1, time in violation of each square metre over that of random mixing.
        n_days: Days, the last being `last`.
        last: Last day.
        per_day: Violations a day where the risk is 1.
        recorded: Share of a camera's day that was recorded; what was not is in no count.
        owner: Camera that counts at a floor x.
        cells_of: What to make of each day's person-hours.
        knows: "people", "distances", "violations", "places": what the engine lets be known.
        seed: Of the numbers drawn.
        shift_m: Where the floor's corner lies.
    """
    rng = np.random.default_rng(seed)
    first = last - timedelta(days=n_days - 1)
    cells: list[tuple[Any, ...]] = []
    of_hours: list[tuple[Any, ...]] = []
    hours: list[tuple[Any, ...]] = []
    crowds: list[tuple[Any, ...]] = []
    found: list[tuple[Any, ...]] = []
    for d in range(n_days):
        day = first + timedelta(days=d)
        hour_ms = int(np.datetime64(day, "ms").astype(np.int64)) + 10 * 3_600_000
        exposure = cells_of(400 / (SHAPE[0] * SHAPE[1]) * rng.gamma(25, 1 / 25, SHAPE))
        near = nearby(exposure[None], closeness(cell_m=1.0, distance_m=site.settings.distance_m))[0]
        mixed = exposure * -np.expm1(-OTHERS * near / exposure.sum())
        close = np.minimum(mixed * risk(d) * np.exp(rng.normal(0, 0.1)) * rng.gamma(50, 1 / 50, SHAPE), exposure)
        n = rng.poisson(per_day / mixed.sum() * close)
        for k, camera in enumerate(site.cameras):
            share = recorded(camera.camera_id, d)
            people, distances, violations = (knows(what) for what in ("people", "distances", "violations"))
            hours.append(
                (
                    *(camera.camera_id, k, camera.floor_id, hour_ms, 10, day, 36_000.0, 36_000.0 * share),
                    1.0 if share and people else None,
                    1 if share and distances else None,
                    1.0 if share and distances else None,
                    1 if share and violations else None,
                )
            )
            crowds.append((camera.camera_id, camera.floor_id, hour_ms, day, 1000.0, 500.0 * OTHERS, 1.0))
        for row, column in np.ndindex(SHAPE):
            camera_id = owner(column + 0.5)
            if recorded(camera_id, d) and exposure[row, column] > 0:
                x, y = column + shift_m[0], row + shift_m[1]
                person_s, k = 3600 * float(exposure[row, column]), int(n[row, column])
                close_s = 3600 * float(close[row, column])
                cells.append(("ground", camera_id, day, 2 * x, 2 * y, person_s, close_s, k))
                side = round(1 / FLOOR_CELL_M)
                of_hours.append(("ground", camera_id, hour_ms, day, side * x, side * y, person_s, close_s, k))
                found.append(("ground", day, True, 2 * x if knows("places") else None))
    made = {
        "cell_days": (
            ("floor_id", "camera_id", "local_date", "cx", "cy", "exposure_s", "violation_s", "n_violations"),
            cells,
        ),
        "cell_hours": (
            (
                *("floor_id", "camera_id", "hour_start_ms", "local_date", "cx", "cy"),
                *("exposure_open_s", "violation_open_s", "n_violations_open"),
            ),
            of_hours,
        ),
        "crowding_hours": (
            (
                *("camera_id", "floor_id", "hour_start_ms", "local_date"),
                *("person_s", "copresent_pair_s", "close_pair_s"),
            ),
            crowds,
        ),
        "camera_hours": (
            (
                *("camera_id", "camera_no", "floor_id", "hour_start_ms", "local_hour", "local_date"),
                *("open_s", "recorded_open_s", "exposure_open_s", "violation_records", "violation_s"),
                "n_violations_open",
            ),
            hours,
        ),
        "violations": (("floor_id", "local_date", "is_open", "cx"), found),
    }
    with Warehouse(site, first, last) as warehouse:
        for name, (columns, rows) in made.items():
            values = zip(*rows, strict=True) if rows else [()] * len(columns)
            plant(warehouse, name, pa.table(dict(zip(columns, map(list, values), strict=True))))
        side = f"/ {round(1 / FLOOR_CELL_M)}"
        squares = f"select * replace (cx {side} as cx, cy {side} as cy) from cell_hours where exposure_open_s > 0"
        plant(warehouse, "square_hours", warehouse.con.sql(squares).to_arrow_table())
        yield warehouse
