"""Weeks of which every hour is known: the marts of a warehouse replaced by planted ones, one open hour a day."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from planted_marts import plant

from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Area, Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import Warehouse

MONDAY = date(2026, 11, 9)
OPEN = tuple(((9 * 60, 10 * 60),) for _ in range(7))
Rate = Callable[[str, int], float]
"""By area and day (0 = `first`): violations per person-hour."""


def area(area_id: str, x: float, *, y: float = 0.0, side: float = 4.0) -> Area:
    ring = ((x, y), (x + side, y), (x + side, y + side), (x, y + side))
    return Area(area_id, area_id.title(), "ground", ring)


AREAS = tuple(area(name, 10.0 * k) for k, name in enumerate(("queue", "door", "aisle", "fruit", "bakery", "back")))


def site_of(root: Path, *, areas: Sequence[Area] = AREAS, cameras: Sequence[str] = ("cam",), **settings: Any) -> Site:
    root.mkdir(parents=True, exist_ok=True)
    return Site(
        "shop", "Shop", "UTC", root, opening=OPEN, floors=(Floor("ground", "Ground floor"),),
        cameras=tuple(Camera(c, c, "ground", hz=1.0) for c in cameras), areas=tuple(areas),
        settings=Settings().with_values(settings),
    )  # fmt: skip


@contextmanager
def planted(
    site: Site,
    *,
    first: date,
    n_days: int,
    rate: Rate = lambda area_id, day: 1.0,
    people: Rate = lambda area_id, day: 40.0,
    around: Rate = lambda area_id, day: 1.0,
    recorded: Callable[[str, int], float] = lambda camera, day: 1.0,
    camera_of: Callable[[str], str] = lambda area_id: "cam",
    day_sd: float = 0.15,
    calibrations: Sequence[tuple[str, int, str]] = (),
    seed: int = 1,
) -> Iterator[Warehouse]:
    """Open a warehouse whose marts hold planted days.

    Args:
        site: The site; each area is counted by one camera, the ring around it too.
        first: First day.
        n_days: Days.
        rate: Violations per person-hour of an area and day; all areas share a shock of the day besides.
        people: Person-hours of an area and day.
        around: Violations per person-hour in the ring 2 to 5 m above it; it has ten person-hours a day.
        recorded: Share of a camera's day that was recorded; what was not is in no count.
        camera_of: Camera that counts in an area.
        day_sd: Of the shared shock.
        calibrations: Camera, day, calibration id: what the fact `calibrations_used` holds.
        seed: Of the numbers drawn.
    """
    rng = np.random.default_rng(seed)
    hours: list[dict[str, Any]] = []
    by_area: list[dict[str, Any]] = []
    by_cell: list[dict[str, Any]] = []
    for d in range(n_days):
        day = first + timedelta(days=d)
        start_ms = round(datetime(day.year, day.month, day.day, 9, tzinfo=UTC).timestamp() * 1000)
        shock = float(np.exp(rng.normal(0, day_sd)))
        totals = {c.camera_id: [0, 0.0] for c in site.cameras}
        for place in site.areas:
            camera = camera_of(place.area_id)
            person_h = people(place.area_id, d) * float(np.exp(rng.normal(0, 0.1)))
            n, n_ring = (
                int(rng.poisson(r(place.area_id, d) * shock * h)) for r, h in ((rate, person_h), (around, 10.0))
            )
            if not recorded(camera, d):
                continue
            at = {"floor_id": "ground", "camera_id": camera, "hour_start_ms": start_ms}
            counts = {"n_violations_open": n, "exposure_open_s": 3600 * person_h}
            by_area.append({**at, "area_id": place.area_id, **counts, "violation_open_s": 40.0 * n})
            cx, cy = int(place.polygon[2][0] * 4) - 2, int(place.polygon[2][1] * 4) + 14
            by_cell.append({**at, "cx": cx, "cy": cy, "n_violations_open": n_ring, "exposure_open_s": 36_000.0})
            totals[camera][0] += n
            totals[camera][1] += 3600 * person_h
        for k, (camera, (n_all, person_s)) in enumerate(totals.items()):
            share = recorded(camera, d)
            hours.append(
                {
                    "camera_id": camera,
                    "camera_no": k,
                    "floor_id": "ground",
                    "hour_start_ms": start_ms,
                    "local_date": day,
                    "local_hour": 9,
                    "fold": 0,
                    "open_s": 3600.0,
                    "recorded_open_s": 3600.0 * share,
                    "is_inferred": False,
                    "n_violations_open": n_all if share else None,
                    "exposure_open_s": person_s if share else None,
                    "violation_s": 40.0 * n_all if share else None,
                }
            )
    used = []
    for camera, d, calibration_id in calibrations:
        day = first + timedelta(days=d)
        ms = round(datetime(day.year, day.month, day.day, 9, tzinfo=UTC).timestamp() * 1000)
        used.append(
            {"hour": ms // 3_600_000, "camera_id": camera, "calibration_id": calibration_id, "first_ms": ms,
             "last_ms": ms + 3_599_000, "n_records": 3600}
        )  # fmt: skip
    violations = [{"camera_id": c.camera_id, "floor_id": "ground", "started_ms": 0, "x_m": 1.0} for c in site.cameras]
    made = {"camera_hours": hours, "area_hours": by_area, "cell_hours": by_cell, "violations": violations}
    with Warehouse(site, first, first + timedelta(days=n_days - 1)) as warehouse:
        for name, rows in made.items():
            plant(warehouse, name, pa.Table.from_pylist(rows))
        if used:
            warehouse.materialise("calibrations_used")
            warehouse.con.register("_planted", pa.Table.from_pylist(used))
            warehouse.con.execute("insert into calibrations_used by name select * from _planted")
        yield warehouse
