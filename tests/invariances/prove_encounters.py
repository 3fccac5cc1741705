"""Counts violations of people whose track ids switch, double and flicker, and prints how far from those of true ids.

Run `python tests/invariances/prove_encounters.py`; the tables are in docs/methods. Floors and trackers are those
of `encounter_worlds.py`; all goes the way of real data: store, facts, marts. Real recordings with true ids:
`tests/realdata/prove_recorded_encounters.py`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import date
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyarrow as pa

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from invariances.encounter_worlds import Seen, cut, doubled, noisy, queue, thinned, walkers
from invariances.seen_worlds import small_site
from warehouse.small_projects import T0, open_days

from vsd_analytics.answer import Value
from vsd_analytics.figures.groups import groups
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.visits import visits
from vsd_analytics.schema import SCHEMAS
from vsd_analytics.site.model import Area, Camera
from vsd_analytics.store.store import Store

DAY = "2026-11-09"
DISTANCES_M = (1.0, 1.25, 1.5, 2.0)
TRACKERS: dict[str, Callable[[Seen, np.random.Generator], Seen]] = {
    "10 % cut": lambda s, rng: cut(s, rng, share=0.1),
    "30 % cut": lambda s, rng: cut(s, rng, share=0.3),
    "50 % cut": lambda s, rng: cut(s, rng, share=0.5),
    "30 % cut, up to 2 s lost": lambda s, rng: cut(s, rng, share=0.3, lost_s=2.0),
    "6 % doubles": lambda s, rng: doubled(s, rng, share=0.06),
    "20 % doubles of 8 s": lambda s, rng: doubled(s, rng, share=0.2, lasts_s=8.0),
    "30 % cut, 6 % doubles": lambda s, rng: doubled(cut(s, rng, share=0.3), rng, share=0.06),
}


def counted(seen: Seen, *, every_ms: int, distance_m: float) -> tuple[int, float, float | None, float | None]:
    """Return violations, M6, M9 and the median of M36 of what a tracker reports, through store and warehouse."""
    corners = ((6.0, 5.0), (14.0, 5.0), (14.0, 11.0), (6.0, 11.0))
    with TemporaryDirectory() as root:
        cameras = [Camera("cam", "Cam", "ground", hz=1000 / every_ms)]
        area = Area("middle", "Middle", "ground", corners, has_visits=True)
        site = replace(small_site(Path(root), cameras=cameras, distance_m=distance_m), areas=(area,))
        store = Store(site.root / "store", site_id=site.site_id)
        store.append("observations", table_of(seen))
        store.fold()
        with open_days(site, DAY) as warehouse:
            n, close_s, seen_s = warehouse.rows(
                "select sum(n_violations), sum(violation_s), sum(exposure_s) from hours"
            )[0].values()
            between = groups(warehouse).between.value
            day = date.fromisoformat(DAY)
            row = visits(Period(FloorHours(warehouse, floor=site.floors[0]), day, day)).rows[0]
            dwell = row["dwell_median_s"]
            assert isinstance(dwell, Value)
    return int(n), float(close_s) / float(seen_s), between, dwell.value


def table_of(seen: Seen) -> pa.Table:
    """Return the records as rows of the store."""
    n = len(seen.ts_ms)
    columns = {
        "camera_id": pa.array(np.full(n, "cam")),
        "ts": pa.array(seen.ts_ms + T0).cast(SCHEMAS["observations"].field("ts").type),
        "person": pa.array(np.arange(n), pa.int32()),
        "track_id": pa.array(np.char.add("t", seen.track.astype(str))),
        "x_mm": pa.array(np.rint(1000 * seen.x_m).astype(np.int32)),
        "y_mm": pa.array(np.rint(1000 * seen.y_m).astype(np.int32)),
        "u_px": pa.nulls(n, pa.float32()),
        "v_px": pa.nulls(n, pa.float32()),
        "quality": pa.array(np.full(n, "metric")),
        "is_staff": pa.nulls(n, pa.bool_()),
    }
    return pa.table(columns, schema=SCHEMAS["observations"])


def worlds(seed: int, *, hours: float) -> Iterator[tuple[str, Seen]]:
    """Yield the floors: people who walk and stand, few and many, and a queue; places with an error of 0.07 m."""
    rng = np.random.default_rng(seed)
    yield "few people", walkers(rng, seconds=round(3600 * hours), per_hour=150)
    yield "many people", walkers(rng, seconds=round(1800 * hours), per_hour=700)
    yield "a queue", queue(rng, seconds=round(3600 * hours))


def main() -> None:
    """Print a table of each floor and frame rate."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=1.0, help="how long each floor is watched")
    parser.add_argument("--every-ms", type=int, nargs="*", default=[200, 1000])
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    for every_ms in options.every_ms:
        for name, people in worlds(options.seed, hours=options.hours):
            rng = np.random.default_rng(options.seed)
            seen = noisy(thinned(people, every_ms=every_ms), rng, sd_m=0.07, smooth_s=0.5)
            print(f"\n{name}, a frame every {every_ms} ms: violations with true ids, then the change; M6, M9, M36")
            whole = {d: counted(seen, every_ms=every_ms, distance_m=d) for d in DISTANCES_M}
            print(
                "| true ids |",
                " | ".join(f"{d} m: {whole[d][0]}" for d in whole),
                "|",
                _figures(whole[2.0]),
                flush=True,
            )
            for kind, tracker in TRACKERS.items():
                tracked = tracker(seen, np.random.default_rng(options.seed + 1))
                found = {d: counted(tracked, every_ms=every_ms, distance_m=d) for d in DISTANCES_M}
                changes = " | ".join(f"{found[d][0] / whole[d][0] - 1:+.1%}" for d in found)
                print(f"| {kind} |", changes, "|", _figures(found[2.0]), flush=True)


def _figures(found: tuple[int, float, float | None, float | None]) -> str:
    _, m6, m9, m36 = found
    return f"M6 {m6:.3f} | M9 {'-' if m9 is None else f'{m9:.3f}'} | M36 {'-' if m36 is None else f'{m36:.0f} s'} |"


if __name__ == "__main__":
    main()
