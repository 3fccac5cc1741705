"""Writes the made-up projects that are measured.

    python tests/benchmarks/made_up_sets.py DIR [week] [pairs] [site] [history] [day]    # makes DIR/week and so on

`week` is the busy week of `bench_marts.py`. `pairs` are 2.4 million records of 18 cameras in twelve hours: episodes of
twelve seconds at random places, with track ids, and no persons. The others are of `made_up_site.py`: `site` are two
weeks of 18 cameras, a frame a second, 65.3 million person records; `history` ten weeks of three cameras, a frame in 20
seconds; `day` a day of 46 cameras until minute 30 of its last hour.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from bench_marts import CONFIG, FIRST_MS, stored_rows, write_week
from made_up_site import DAY_MS, write_site

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


def write_day(root: Path) -> None:
    """Write a project of a day that is open all day, without its last half hour."""
    midnight_ms, n_hour = FIRST_MS // DAY_MS * DAY_MS, 46 * 3600 * 6
    n_records = n_hour * 47 // 2
    write_site(root, n_records=n_records, n_cameras=46, open_h=24, first_ms=midnight_ms, opening="00:00-24:00")


SETS = {
    "week": lambda root: write_week(root, days=7),
    "pairs": write_pairs,
    "site": lambda root: write_site(root, n_records=65_318_400),
    "history": lambda root: write_site(root, n_records=2_721_600, n_cameras=3, interval_s=20),
    "day": write_day,
}


def main(folder: Path, names: Sequence[str]) -> None:
    """Make some of the projects, or all."""
    for name in names or SETS:
        (folder / name).mkdir(parents=True)
        SETS[name](folder / name)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
