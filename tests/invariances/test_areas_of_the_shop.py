"""Four cameras that overlap and know nothing of one another count what one pair of eyes would, area by area."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa
import pytest
from warehouse.small_projects import open_days

from vsd_analytics.schema import SCHEMAS
from vsd_analytics.simulate.cameras import CAMERAS, HEIGHT_PX, NOISE_SD_M, WIDTH_PX
from vsd_analytics.simulate.frame_messages import track_ids
from vsd_analytics.simulate.people import SimulatedDay, simulate_day
from vsd_analytics.simulate.shop import AREA_RECTS, AREAS
from vsd_analytics.simulate.truth import in_view, violations
from vsd_analytics.site.model import Calibration, Camera, Floor, Site
from vsd_analytics.store.store import Store

ZONE = ZoneInfo("Europe/Rome")
OPENS, CLOSES = datetime(2026, 11, 14, 15, tzinfo=ZONE), datetime(2026, 11, 14, 20, tzinfo=ZONE)


def shop(root: Path) -> Site:
    """Return the shop's site with its four calibrated cameras and its areas."""
    cameras = [
        Camera(
            c.camera_id,
            c.name,
            "ground",
            (Calibration(tuple(map(tuple, c.homography.tolist())), None, c.camera_id),),
            picture_px=(WIDTH_PX, HEIGHT_PX),
            hz=0.5,
        )
        for c in CAMERAS
    ]
    return Site(
        "shop", "Shop", "Europe/Rome", root, floors=(Floor("ground", "Ground"),), cameras=tuple(cameras), areas=AREAS
    )


def seen(day: SimulatedDay) -> pa.Table:
    """Return what the cameras report of a day: 5 cm of noise, ids of their own that end where a view ends."""
    tables = []
    for number, camera in enumerate(CAMERAS):
        rows = np.flatnonzero(camera.sees(day.x_m, day.y_m))
        x, y = (
            np.rint((values[rows] + np.random.default_rng([number, k]).normal(0, NOISE_SD_M, len(rows))) * 1000)
            for k, values in enumerate((day.x_m, day.y_m))
        )
        told = {
            "camera_id": [camera.camera_id] * len(rows),
            "ts": day.frame_ms[day.frame[rows]],
            "person": np.arange(len(rows)) % 30_000,
            "track_id": track_ids(day.person[rows], day.frame[rows]).astype(str),
            "x_mm": x,
            "y_mm": y,
            "quality": ["metric"] * len(rows),
        }
        schema = SCHEMAS["observations"]
        columns = [
            pa.nulls(len(rows), f.type) if f.name not in told else pa.array(told[f.name]).cast(f.type) for f in schema
        ]
        tables.append(pa.table(columns, schema=schema))
    return pa.concat_tables(tables)


@pytest.mark.parametrize("display_moved", [False, True])
def test_violations_of_each_area_are_those_of_true_positions_in_view(tmp_path: Path, display_moved: bool) -> None:
    """Within 5 % on the floor; in each area within 10 %, or 1 % of the floor's where it has few."""
    day = simulate_day(OPENS, closes=CLOSES, seed=4, interval_s=2.0, display_moved=display_moved)
    true = violations(in_view(day))
    site = shop(tmp_path)
    store = Store(site.root / "store", site_id=site.site_id)
    store.append("observations", seen(day))
    store.fold()
    with open_days(site, "2026-11-14") as warehouse:
        rows = warehouse.rows("select area_id, count(*) as n from violations group by area_id")
        by_camera = warehouse.rows("select count(*) as n from camera_episodes where to_ms - from_ms >= 3000")[0]["n"]
    n = {r["area_id"]: r["n"] for r in rows}
    n_floor, n_true = sum(n.values()), len(true.frame)
    print(f"floor {n_floor} of {n_true}", {a: (n.get(a, 0), int(true.inside(r).sum())) for a, r in AREA_RECTS.items()})
    assert n_true > 1000
    assert by_camera > 1.2 * n_true
    assert n_floor == pytest.approx(n_true, rel=0.05)
    for area_id, rect in AREA_RECTS.items():
        assert n.get(area_id, 0) == pytest.approx(true.inside(rect).sum(), rel=0.1, abs=0.01 * n_true), area_id
