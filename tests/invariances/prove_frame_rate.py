"""Counts violations of the same people at many frame rates and prints how far from the truth: docs/methods.

Run `python tests/invariances/prove_frame_rate.py`. People walk between places of a floor (`seen_worlds.shoppers`), or
through the simulated shop, at their true positions or with 5 cm of noise, with a frame every 0.4 to 4 s. All goes the
way of real data: store, facts, marts. Means of walks or days, with their standard errors.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from tempfile import TemporaryDirectory
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from seen_worlds import shoppers, small_site, true_spells
from warehouse.small_projects import T0, open_days, table

from vsd_analytics.schema import SCHEMAS
from vsd_analytics.simulate.people import simulate_day
from vsd_analytics.simulate.truth import violations
from vsd_analytics.site.model import Camera
from vsd_analytics.store.store import Store

INTERVALS_MS = (400, 800, 1000, 1200, 1500, 2000, 2500, 3000, 4000)
HALVED = ((400, 800), (400, 1200), (1000, 2000), (1500, 3000))
ZONE = ZoneInfo("Europe/Rome")
OPENS, CLOSES = datetime(2026, 11, 14, 11, tzinfo=ZONE), datetime(2026, 11, 14, 20, tzinfo=ZONE)
World = tuple[pa.Table, Mapping[int, float]]


def counted(people: pa.Table, *, every_ms: int) -> tuple[int, float]:
    """Return violations, and the share of person-time in violation, of people seen at every so many milliseconds."""
    times = people["ts"].cast(pa.int64()).to_numpy()
    day = str(np.datetime64(int(times[0]), "ms"))[:10]
    with TemporaryDirectory() as root:
        site = small_site(Path(root), cameras=[Camera("cam", "Cam", "ground", hz=1000 / every_ms)])
        store = Store(site.root / "store", site_id=site.site_id)
        store.append("observations", people.filter(pa.array((times - times[0]) % every_ms == 0)))
        store.fold()
        with open_days(site, day) as warehouse:
            n, in_violation, seen = warehouse.rows(
                "select sum(n_violations), sum(violation_s), sum(exposure_s) from hours"
            )[0].values()
    return int(n), float(in_violation) / float(seen)


def walk(seed: int) -> World:
    """Return 24 people who walk for 25 minutes, ten times a second, and their true spells by frame interval."""
    people = shoppers(seed, start=T0, seconds=1500, step_ms=100, n_people=24)
    true = {}
    for ms in INTERVALS_MS:
        spells = true_spells(people, gap_s=max(3, 2.5 * ms / 1000))
        true[ms] = ((spells >= 30).sum() + (spells > 30).sum()) / 2
    rows = [("cam", p.ts, i, p.track, p.x, p.y, None, None, "metric") for i, p in enumerate(people)]
    return table("observations", rows), true


def shop(seed: int, *, noise_m: float) -> World:
    """Return nine hours of the shop, ten times a second, and its true violations by frame interval: of a gap of 3 s."""
    day = simulate_day(OPENS + timedelta(days=seed), closes=CLOSES + timedelta(days=seed), seed=seed, interval_s=0.1,
                       display_moved=False)  # fmt: skip
    noise = np.random.default_rng(seed).normal(0, noise_m, (2, len(day.frame)))
    x_mm, y_mm = np.rint((np.stack([day.x_m, day.y_m]) + noise) * 1000).astype(np.int32)
    columns = {
        "camera_id": pa.repeat("cam", len(x_mm)),
        "ts": day.frame_ms[day.frame],
        "person": day.person,
        "track_id": day.person.astype(str),
        "x_mm": x_mm,
        "y_mm": y_mm,
        "u_px": pa.nulls(len(x_mm)),
        "v_px": pa.nulls(len(x_mm)),
        "quality": pa.repeat("metric", len(x_mm)),
        "is_staff": pa.nulls(len(x_mm)),
    }
    schema = SCHEMAS["observations"]
    people = pa.table([pa.array(columns[f.name]).cast(f.type) for f in schema], schema=schema)
    return people, dict.fromkeys(INTERVALS_MS, len(violations(day).frame))


def mean(values: Sequence[float]) -> str:
    """Return the mean of ratios less one, with its standard error."""
    x = np.array(values) - 1
    return f"{x.mean():+.1%} ± {x.std(ddof=1) / np.sqrt(len(x)):.1%}"


def tell(name: str, worlds: Iterable[World]) -> None:
    """Print the tables of some worlds of one kind."""
    counts: dict[int, list[float]] = {ms: [] for ms in INTERVALS_MS}
    truths: dict[int, list[float]] = {ms: [] for ms in INTERVALS_MS}
    shares: dict[int, list[float]] = {ms: [] for ms in INTERVALS_MS}
    for people, true in worlds:
        for ms in INTERVALS_MS:
            n, share = counted(people, every_ms=ms)
            counts[ms].append(n)
            truths[ms].append(true[ms])
            shares[ms].append(share)
    print(f"\n{len(counts[400])} x {name}\n")
    print("| interval | violations | true spells | more | share of person-time in violation |")
    print("|---|---|---|---|---|")
    for ms in INTERVALS_MS:
        more = mean(np.divide(counts[ms], truths[ms]).tolist())
        print(f"| {ms / 1000:.1f} s | {np.mean(counts[ms]):,.0f} | {np.mean(truths[ms]):,.0f} | {more} "
              f"| {np.mean(shares[ms]):.1%} |")  # fmt: skip
    for fast, slow in HALVED:
        print(f"{fast / 1000:.1f} s to {slow / 1000:.1f} s: {mean(np.divide(counts[slow], counts[fast]).tolist())}")
    sys.stdout.flush()


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--walks", type=int, default=20)
    parser.add_argument("--days", type=int, default=4)
    options = parser.parse_args()
    tell("24 people who walk for 25 minutes", map(walk, range(options.walks)))
    for noise_m in (0.0, 0.05):
        worlds = (shop(seed, noise_m=noise_m) for seed in range(options.days))
        tell(f"nine hours of the shop, {noise_m * 100:.0f} cm of noise", worlds)


if __name__ == "__main__":
    main()
