"""M26: what another legal distance would count, against the figures of a site that has it."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from vsd_analytics.errors import UsageError
from vsd_analytics.figures.sensitivity import NOBODY, NOT_SENT, NOTHING, PURGED, threshold_sensitivity
from vsd_analytics.schema import SCHEMAS
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Camera, EngineError, Floor, Site
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.wording.reasons import reason_text

DAY = date(2026, 11, 9)
START = 1_794_211_200_000  # 2026-11-09 08:00 UTC
N_S = 120


def site_of(root: Path, **settings: object) -> Site:
    views = ((0, 0), (12, 0), (12, 10), (0, 10)), ((8, 0), (20, 0), (20, 10), (8, 10))
    cameras = tuple(Camera(f"cam-{i}", f"Cam {i}", "ground", hz=1.0, view=view) for i, view in enumerate(views))
    floors = (Floor("ground", "Ground"), Floor("upper", "Upper"))
    return Site("shop", "Shop", "UTC", root, floors=floors, cameras=cameras, settings=Settings().with_values(settings))


def put(site: Site, **tables: dict[str, list[object]]) -> None:
    import pyarrow as pa

    store = Store(site.root / "store", site_id=site.site_id)
    for name, columns in tables.items():
        schema = SCHEMAS[name]  # type: ignore[index]
        n = len(next(iter(columns.values())))
        arrays = [pa.array(columns.get(f.name, [None] * n)) for f in schema]
        arrays = [
            a.cast(pa.int64()).cast(f.type) if f.name == "ts" else a.cast(f.type)
            for a, f in zip(arrays, schema, strict=True)
        ]
        store.append(name, pa.table(arrays, schema=schema))  # type: ignore[arg-type]
    store.fold()


def heartbeats(n_pairs: int | None = None) -> dict[str, list[object]]:
    ts = [START + 1000 * s for s in range(N_S) for _ in range(2)]
    cameras = ["cam-0", "cam-1"] * N_S
    return {"camera_id": [*cameras], "ts": [*ts], "n_persons": [0] * len(ts), "n_pairs": [n_pairs] * len(ts)}


@pytest.fixture
def crowd(tmp_path: Path) -> Site:
    """Return a site with twelve people standing anew each second, in the views of two cameras that overlap."""
    rng = np.random.default_rng(2)
    rows = []
    for second in range(N_S):
        for i, (x, y) in enumerate(rng.integers((0, 0), (20_000, 10_000), size=(12, 2)).tolist()):
            for camera, low, high in (("cam-0", 0, 12_000), ("cam-1", 8_000, 20_000)):
                if low < x < high:
                    rows.append((camera, START + 1000 * second, i, f"{camera}-{i}", x, y, "metric"))
    names = ("camera_id", "ts", "person", "track_id", "x_mm", "y_mm", "quality")
    site = site_of(tmp_path)
    put(site, observations=dict(zip(names, map(list, zip(*rows, strict=True)), strict=True)), frames=heartbeats())
    return site


def open_day(site: Site) -> Warehouse:
    return Warehouse(site, DAY, DAY)


def test_each_point_is_what_a_site_with_that_legal_distance_counts(crowd: Site) -> None:
    with open_day(crowd) as warehouse:
        found = threshold_sensitivity(warehouse)
    assert [p.distance_m for p in found.points] == [1.8, 2.0, 2.2]
    assert (found.state, found.left_out, found.engine) == ("ok", (), None)
    for point in found.points:
        other = replace(crowd, settings=crowd.settings.with_values({"distance_m": point.distance_m}))
        with open_day(other) as warehouse:
            (told,) = warehouse.rows(
                "select sum(violation_records) as n, sum(violation_s) as s, sum(exposure_s) as e from hours"
            )
        assert point.violation_records == told["n"] > 100
        assert point.violation_h == pytest.approx(told["s"] / 3600)
        assert point.share == pytest.approx(told["s"] / told["e"])


def test_distances_that_are_not_stored_are_not_measurable_but_the_others_are(crowd: Site) -> None:
    short = replace(crowd, settings=crowd.settings.with_values({"pair_max_m": 2.1}))
    with open_day(short) as warehouse:
        found = threshold_sensitivity(warehouse)
    assert [p.state for p in found.points] == ["ok", "ok", "not_measurable"]
    assert "2.1 m" in reason_text(found.points[2].reason)
    assert found.points[2].violation_records is None


def test_engine_that_sends_violations_only_says_nothing_of_greater_distances(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    frames = heartbeats(n_pairs=1)
    people = {
        "camera_id": [c for c in ("cam-0", "cam-1") for _ in range(2)],
        "ts": [START] * 4,
        "person": [0, 1, 0, 1],
        "track_id": ["a", "b", "c", "d"],
        "x_mm": [1000, 2000, 15_000, 17_300],
        "y_mm": [1000] * 4,
        "quality": ["metric"] * 4,
    }
    pair = {
        "camera_id": ["cam-0"],
        "ts": [START],
        "person_a": [0],
        "person_b": [1],
        "track_a": ["a"],
        "track_b": ["b"],
        "distance_mm": [1000],
        "quality": ["metric"],
    }
    put(site, observations=people, frames=frames, pairs=pair)
    with open_day(site) as warehouse:
        found = threshold_sensitivity(warehouse)
    assert [(p.violation_records, p.reason) for p in found.points] == [(1, None), (1, None), (None, NOT_SENT)]


def test_stated_engine_error_is_beside_the_count(crowd: Site) -> None:
    stated = replace(crowd, engine=EngineError(precision=0.9, recall=0.75, distance_sd_m=0.1))
    with open_day(stated) as warehouse:
        found = threshold_sensitivity(warehouse)
        plain = threshold_sensitivity(warehouse, floor_id="ground")
    assert plain.points == found.points
    engine, n = found.engine, found.points[1].violation_records
    assert engine is not None
    assert n is not None
    assert engine.violation_records == n
    assert engine.expected == pytest.approx(n * 1.2)
    assert engine.crossings is not None
    assert 0 < engine.crossings.leaving < 0.2 * n
    assert engine.crossings.lo < n < engine.crossings.hi
    assert all(
        word in reason_text(engine.note) for word in ("90%", "75%", "standard deviation of 0.1 m", f"{n:,} counted")
    )


def test_nothing_recorded_is_not_zero(crowd: Site) -> None:
    with Warehouse(crowd, date(2026, 11, 12), date(2026, 11, 12)) as warehouse:
        found = threshold_sensitivity(warehouse)
    assert (found.state, found.reason) == ("not_enough_data", NOTHING)
    assert [p.share for p in found.points] == [None] * 3


def test_an_empty_floor_has_no_share(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    put(site, frames=heartbeats())
    with open_day(site) as warehouse:
        found = threshold_sensitivity(warehouse)
    assert (found.state, found.reason) == ("not_enough_data", NOBODY)
    assert [(p.violation_records, p.share) for p in found.points] == [(0, None)] * 3


def test_single_distances_that_are_gone_are_not_made_up(crowd: Site) -> None:
    with open_day(crowd) as warehouse:
        warehouse.prepare("distances")
        warehouse.con.execute("drop view distances")
        warehouse.con.execute(
            "create temp table distances as select 'cam-0' as camera_id, date '2026-11-09' as local_date, "
            "0 as distance_mm, 0 as n_pairs, 0 as n_sent, 0.0 as nearest_s where false"
        )
        found = threshold_sensitivity(warehouse)
    assert (found.state, found.reason) == ("not_measurable", PURGED)


def test_unknown_floor_is_refused(crowd: Site) -> None:
    with open_day(crowd) as warehouse, pytest.raises(UsageError, match="no floor"):
        threshold_sensitivity(warehouse, floor_id="cellar")
