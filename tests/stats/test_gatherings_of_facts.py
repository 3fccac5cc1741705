"""Gatherings and clusters of facts, made hour by hour, are those of the whole time at once."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import Any

import gatherings_at_once as at_once
import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

from vsd_analytics.schema import SCHEMAS
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.warehouse import Warehouse

DAY = date(2026, 11, 9)
HOUR_MS = 3_600_000
START_MS = 1_794_211_200_000  # 2026-11-09 08:00 UTC
INTERVAL_MS = 2000


def crowd(root: Path, *, seed: int) -> Site:
    """Write two hours and a half of people who stand, drift and change ids on a small floor; some have no id."""
    rng = np.random.default_rng(seed)
    n_people, instants = 9, START_MS + HOUR_MS // 2 + INTERVAL_MS * np.arange(9 * HOUR_MS // 4 // INTERVAL_MS)
    step = rng.normal(0, 0.03, (len(instants), n_people, 2)).cumsum(axis=0)
    place = 3.0 + 3.0 * np.sin(step + rng.uniform(0, 6, (n_people, 2)))
    is_here = rng.random((len(instants) // 40 + 1, n_people))[np.arange(len(instants)) // 40] < 0.75
    is_here &= rng.random((len(instants) // 300 + 1, 1))[np.arange(len(instants)) // 300] < 0.9
    frame, person = np.nonzero(is_here)
    life = (np.arange(len(instants))[:, None] + 37 * np.arange(n_people)) // 400
    ids = [f"{p}-{life[f, p]}" if p else None for f, p in zip(frame, person, strict=True)]
    columns: dict[str, Any] = {
        "camera_id": ["cam"] * len(frame),
        "ts": pa.array(instants[frame]),
        "person": person,
        "track_id": ids,
        "x_mm": np.round(1000 * place[frame, person, 0]),
        "y_mm": np.round(1000 * place[frame, person, 1]),
        "quality": ["metric"] * len(frame),
    }
    schema = SCHEMAS["observations"]
    arrays = [pa.array(columns.get(f.name, [None] * len(frame))).cast(f.type) for f in schema]
    settings = Settings().with_values({"pseudonyms": False})
    camera = Camera("cam", "Cam", "ground", hz=1000 / INTERVAL_MS)
    site = Site("shop", "Shop", "UTC", root, floors=(Floor("ground", "Ground"),), cameras=(camera,), settings=settings)
    store = Store(root / "store", site_id="shop")
    store.append("observations", pa.table(arrays, schema=schema))
    store.fold()
    return site


def found_at_once(pairs: pd.DataFrame) -> tuple[tuple[at_once.Lasting, ...], dict[int, float]]:
    """Return gatherings, and the seconds of clusters by size, of close pairs in order of time."""
    ts_ms, frame = np.unique(pairs["ts_ms"], return_inverse=True)
    made = at_once.clusters(frame, pairs["member_a"], pairs["member_b"])
    order = np.argsort(made.of, kind="stable")
    of, seen_at, n = made.of[order], made.seen_at[order], len(made.size)
    track, x, y = (np.concatenate((pairs[f"{c}_a{u}"], pairs[f"{c}_b{u}"]))[seen_at] for c, u in _SIDES)
    weight_s = np.zeros(len(ts_ms))
    weight_s[frame] = pairs["weight_ms"] / 1000
    sizes = pd.Series(weight_s[made.frame]).groupby(made.size).sum().to_dict()
    is_big = (made.size >= 3)[of] & ~pd.isna(track)
    label = at_once.link(of[is_big], pd.factorize(track[is_big])[0], ts_ms=ts_ms[made.frame], gap_ms=np.full(n, 5000))
    big = made.size >= 3
    middle = [np.bincount(of, weights=v / 1000, minlength=n) / np.bincount(of, minlength=n) for v in (x, y)]
    lasting = at_once.lasting(
        label[big],
        ts_ms=ts_ms[made.frame][big],
        interval_ms=np.full(n, INTERVAL_MS)[big],
        size=made.size[big],
        weight_s=weight_s[made.frame][big],
        x_m=middle[0][big],
        y_m=middle[1][big],
        diameter_m=at_once.diameters(of, x / 1000, y / 1000, n_clusters=n)[big],
    )
    return lasting, sizes


_SIDES = (("track", ""), ("x", "_mm"), ("y", "_mm"))


@pytest.mark.parametrize("seed", range(3))
def test_gatherings_made_by_the_hour_are_those_of_the_whole_time(tmp_path: Path, seed: int) -> None:
    site = crowd(tmp_path, seed=seed)
    with Warehouse(site, DAY, DAY) as warehouse:
        pairs = warehouse.frame("select * from pairs where distance_mm < 2000 order by ts_ms, member_a, member_b")
        found = warehouse.rows("select * from gatherings")
        sizes = warehouse.rows("select n_people, cluster_s::double as s from cluster_sizes")
        joined = warehouse.rows("select count(*) as n from gathering_joins where before_ms is not null")[0]["n"]
    expected, seconds = found_at_once(pairs)
    assert joined > 0, "the world must hold gatherings over the hour"
    assert len(expected) > 20
    assert {s["n_people"]: s["s"] for s in sizes} == pytest.approx(seconds)
    names = ("started_ms", "ended_ms", "n_people", "duration_s", "person_s", "x_m", "y_m", "diameter_m")
    told = sorted(tuple(float(g[name]) for name in names) for g in found)
    wanted = sorted(tuple(float(getattr(g, name)) for name in names) for g in expected)
    assert np.array(told) == pytest.approx(np.array(wanted), rel=0, abs=1e-6)
