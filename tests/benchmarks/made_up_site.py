"""The data of a benchmark: a made-up site of the size of the published deployment, as many records as asked for."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa

from vsd_analytics.config.project import load_site
from vsd_analytics.schema import SCHEMAS, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store.store import Store

CAMERAS: Final = 18
"""Of the published deployment, which sent a frame a second."""
FIRST_MS: Final = 1_794_211_200_000
"""2026-11-09 08:00 UTC, a Monday."""
OPEN_H: Final = 12
HOUR_S, LIFE_S, DAY_MS = 3600, 60, 86_400_000
SLOTS, IN_VIEW, TOGETHER, SIDE_M, APART_M = 8, 0.75, 0.05, 22.5, 30
"""Each camera sees a square of its own; 8 places hold a person three quarters of the time, so 6 people are in view.
In one life of twenty, two walk side by side."""
FOLD_RECORDS: Final = 5_000_000
"""Records between two folds: what a fold holds in memory."""


def write_site(
    root: Path,
    *,
    n_records: int,
    n_cameras: int = CAMERAS,
    open_h: int = OPEN_H,
    interval_s: int = 1,
    first_ms: int = FIRST_MS,
    opening: str = "08:00-20:00",
    seed: int = 1,
) -> Site:
    """Write a project whose store holds `n_records` person records, or up to one frame more.

    Args:
        root: Its folder, empty.
        n_records: Person records. Hours are written camera by camera until there are as many.
        n_cameras: Cameras.
        open_h: Hours of a day with records, from `first_ms` on.
        interval_s: Seconds from frame to frame.
        first_ms: UTC instant of the first record.
        opening: Opening hours of each day.
        seed: Of everything drawn; the same seed gives the same bytes.
    """
    ids = [f"cam-{c:02d}" for c in range(n_cameras)]
    cameras = [f'[[camera]]\nid = "{c}"\nname = "{c}"\nfloor = "hall"\nhz = {1 / interval_s}\n' for c in ids]
    (root / "vsd.toml").write_text(
        '[site]\nid = "bench"\nname = "Bench"\ntimezone = "UTC"\n'
        f'opening = {{ mon-sun = "{opening}" }}\n'
        '[privacy]\npseudonyms = false\n[[floor]]\nid = "hall"\nname = "Hall"\n' + "".join(cameras)
    )
    site = load_site(root, environ={})
    store, rng = Store(root / "store", site_id=site.site_id), np.random.default_rng(seed)
    left, unfolded = n_records, 0
    for hour, camera in ((h, c) for h in count() for c in range(n_cameras)):
        start_ms = first_ms + DAY_MS * (hour // open_h) + 1000 * HOUR_S * (hour % open_h)
        for table, rows in camera_hour(rng, camera, start_ms, most=left, interval_s=interval_s):
            store.append(table, rows, engines=["made-up 1"])
            if table == "observations":
                left, unfolded = left - rows.num_rows, unfolded + rows.num_rows
        if left <= 0 or unfolded >= FOLD_RECORDS:
            store.fold()
            unfolded = 0
        if left <= 0:
            return site
    raise AssertionError


def camera_hour(
    rng: np.random.Generator, camera: int, start_ms: int, *, most: int, interval_s: int = 1
) -> Iterator[tuple[TableName, pa.Table]]:
    """Yield the frames and person records of one camera and hour; the frame that reaches `most` is the last one."""
    n_lives = HOUR_S // LIFE_S + 2
    start, end = rng.uniform(0, SIDE_M, (2, n_lives, SLOTS, 2))
    is_here = rng.random((n_lives, SLOTS)) < IN_VIEW
    is_pair = rng.random((n_lives, SLOTS // 2)) < TOGETHER
    beside = rng.uniform(-0.6, 0.6, (n_lives, SLOTS // 2, 2))
    for place in (start, end):
        place[:, 1::2] = np.where(is_pair[..., None], place[:, ::2] + beside, place[:, 1::2])
    is_here[:, 1::2] = np.where(is_pair, is_here[:, ::2], is_here[:, 1::2])
    phase_s = np.repeat(rng.integers(0, LIFE_S, SLOTS // 2), 2)
    second = np.arange(0, HOUR_S, interval_s)[:, None]
    life, age = (second + phase_s) // LIFE_S, (second + phase_s) % LIFE_S / LIFE_S
    slot = np.broadcast_to(np.arange(SLOTS), life.shape)
    is_seen = is_here[life, slot]
    n_persons = is_seen.sum(axis=1)
    n_frames = int(np.searchsorted(np.cumsum(n_persons), most)) + 1
    life, age, slot, is_seen = life[:n_frames], age[:n_frames], slot[:n_frames], is_seen[:n_frames]
    n_persons = n_persons[:n_frames]
    at_m = start[life, slot] + (end - start)[life, slot] * age[..., None]
    at_m = at_m + rng.normal(0, 0.03, at_m.shape) + [APART_M * camera, 0]
    place_mm = np.round(1000 * at_m)[is_seen].astype(np.int32)
    tracks = pa.array([f"{start_ms // 3_600_000:07x}{camera:02x}{k:07x}" for k in range(n_lives * SLOTS)])
    ts = start_ms + 1000 * interval_s * np.arange(len(n_persons))
    yield "frames", _table("frames", camera, ts=ts, n_persons=n_persons)
    yield (
        "observations",
        _table(
            "observations",
            camera,
            ts=np.repeat(ts, n_persons),
            person=(np.cumsum(is_seen, axis=1) - 1)[is_seen],
            track_id=tracks.take(pa.array((life * SLOTS + slot)[is_seen])),
            x_mm=place_mm[:, 0],
            y_mm=place_mm[:, 1],
            quality=pa.repeat("metric", len(place_mm)),
        ),
    )


def _table(name: TableName, camera: int, **columns: Any) -> pa.Table:
    given = {c: pa.array(v) if isinstance(v, np.ndarray) else v for c, v in columns.items()}
    n_rows = len(given["ts"])
    given["camera_id"] = pa.repeat(f"cam-{camera:02d}", n_rows)
    arrays = [given[f.name].cast(f.type) if f.name in given else pa.nulls(n_rows, f.type) for f in SCHEMAS[name]]
    return pa.table(arrays, schema=SCHEMAS[name])
