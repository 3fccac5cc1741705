"""Writes the made-up projects whose facts are measured: a busy week, and a day of an engine that sends pairs only.

    python tests/benchmarks/made_up_sets.py DIR    # makes DIR/week and DIR/pairs

The week is that of `bench_marts.py`. The pairs are 2.4 million records of 18 cameras in twelve hours: episodes of
twelve seconds at random places, with track ids, and no persons.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
from bench_marts import CONFIG, FIRST_MS, stored_rows, write_week

from vsd_analytics.config.project import load_site
from vsd_analytics.store.store import Store

CAMERAS, OPEN_S, EPISODE_S, RECORDS = 18, 12 * 3600, 12, 2_400_000


def write_pairs(root: Path) -> None:
    """Write a project with a day of pairs in its store."""
    cameras = [f'[[camera]]\nid = "cam-{c}"\nname = "Camera {c}"\nfloor = "ground"\n' for c in range(CAMERAS)]
    (root / "vsd.toml").write_text(CONFIG + "".join(cameras))
    site, rng = load_site(root), np.random.default_rng(3)
    store = Store(root / "store", site_id=site.site_id)
    n_episodes = RECORDS // CAMERAS // EPISODE_S
    for camera in range(CAMERAS):
        start_s = np.sort(rng.integers(0, OPEN_S - EPISODE_S, n_episodes))
        second = np.repeat(start_s, EPISODE_S) + np.tile(np.arange(EPISODE_S), n_episodes)
        order = np.argsort(second, kind="stable")
        episode, ts_ms = np.repeat(np.arange(n_episodes), EPISODE_S)[order], FIRST_MS + 1000 * second[order]
        frames, of_frame, n_pairs = np.unique(ts_ms, return_inverse=True, return_counts=True)
        number = np.arange(len(ts_ms)) - (np.cumsum(n_pairs) - n_pairs)[of_frame]  # of a pair in its frame
        place_mm = rng.uniform(0, 20_000, (n_episodes, 2)).astype(np.int64)[episode]
        distance_mm = np.clip(rng.normal(1300, 300, len(episode)), 200, 2400).astype(np.int64)
        columns = {
            "ts": pa.array(ts_ms),
            "person_a": pa.array(2 * number),
            "person_b": pa.array(2 * number + 1),
            "track_a": pa.array([f"{camera:02x}a{k:013x}" for k in episode]),
            "track_b": pa.array([f"{camera:02x}b{k:013x}" for k in episode]),
            "x_a_mm": pa.array(place_mm[:, 0]),
            "y_a_mm": pa.array(place_mm[:, 1]),
            "x_b_mm": pa.array(place_mm[:, 0] + distance_mm),
            "y_b_mm": pa.array(place_mm[:, 1]),
            "distance_mm": pa.array(distance_mm),
            "quality": pa.repeat("metric", len(episode)),
        }
        store.append("pairs", stored_rows("pairs", len(episode), camera, **columns), engines=["made-up 1"])
        counts = {"ts": pa.array(frames), "n_persons": pa.array(2 * n_pairs), "n_pairs": pa.array(n_pairs)}
        store.append("frames", stored_rows("frames", len(frames), camera, **counts), engines=["made-up 1"])
    store.fold()


def main(folder: Path) -> None:
    """Make both projects."""
    for name in ("week", "pairs"):
        (folder / name).mkdir(parents=True)
    write_week(folder / "week", days=7)
    write_pairs(folder / "pairs")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
