"""Prove the hotspot test: python tests/stats/prove_hotspots.py --floors 400 --people 100 --stored 5.

The floors are those of `floor_worlds`, 14 x 20 cells of 1 m over 28 days. `--floors` counts those whose cells are drawn
at once, `--people` those of single people, counted pair by pair. `--stored` floors of single people go through import,
store, facts and marts as positions in metres; `--stored 40` is the full proof. `--walls` smooths as the map of the week
does, stopping at six shelves: what the test would be with it (docs/methods/hotspots.md says why it is not).
"""

from __future__ import annotations

import argparse
import csv
import tempfile
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from unittest.mock import patch

import numpy as np
from floor_worlds import (
    COLUMNS,
    FRAMES,
    HOURS,
    PLANTED_M,
    ROWS,
    Cube,
    People,
    Variation,
    away,
    cells,
    inner,
    people,
    positions,
)  # fmt: skip

from vsd_analytics.figures.week.walkable import Walkable
from vsd_analytics.stats.hotspots import hotspots

REACH_M = 3.0
"""Smoothing reaches so far: what lies beyond has nothing of the planted place."""
NULL_PEOPLE = {
    "people walk independently": People(),
    "risk grows with density, nobody differs": People(peaks=3),
    "couples in an uneven crowd": People(in_company=0.4, peaks=3),
    "couples cross a corridor": People(in_company=1, is_corridor=True),
    "more position noise on one side": People(in_company=0.4, noise_m=(0.1, 0.5)),
    "people wait at a counter": People(counter_share=0.15),
}
NULL_CELLS = {
    "patches, days independent": Variation(),
    "patches, days correlated .5": Variation(correlation=0.5),
    "patches, days correlated .8": Variation(correlation=0.8),
    "patches, weeks sd .22": Variation(week_sd=0.22),
}
PLANTED = {
    "planted 2.5": Variation(ratio=2.5),
    "planted 2.5, days correlated .5": Variation(ratio=2.5, correlation=0.5),
    "planted 2.5, days correlated .8": Variation(ratio=2.5, correlation=0.8),
    "planted 2.5, weeks sd .22": Variation(ratio=2.5, week_sd=0.22),
    "planted 2.5, fixed a week ago": Variation(ratio=2.5, fixed_days_ago=7),
    "planted 2.5, fixed two weeks ago": Variation(ratio=2.5, fixed_days_ago=14),
}
SHELVES_M = tuple(
    ((left, low), (left + 7, low), (left + 7, high), (left, high))
    for low, high in ((3.8, 4.2), (6.3, 7.3), (9.8, 10.2))
    for left in (2.0, 11.0)
)
"""Two rows of thin shelves and, in the middle, where people wait at a counter, one a metre deep."""


def around_shelves(values: np.ndarray, sigma_cells: float) -> np.ndarray:
    """Return maps smoothed along the floor around `SHELVES_M`; what lies in a shelf counts at the nearest floor."""
    floor = Walkable(SHELVES_M, cell_m=1.0, origin_m=(0.0, 0.0), shape=(ROWS, COLUMNS))
    maps = [floor.smooth(floor.on_floor(v), sigma_cells=sigma_cells) for v in values.reshape(-1, ROWS, COLUMNS)]
    return np.stack(maps).reshape(values.shape)


def outcome(cube: Cube) -> tuple[bool, bool, bool]:
    """Return any hot cell away from a planted place, whether half of its cells are found, and a spot within 1 m."""
    found = hotspots(cube.violation_h, cube.exposure_h, cube.mixed_h, sigma_cells=1.0, is_eligible=inner())
    is_planted = cube.place[0] >= 0
    distance = away(cube.place)
    elsewhere = distance > PLANTED_M + REACH_M if is_planted else np.ones((ROWS, COLUMNS), dtype=bool)
    share = float(found.cells.is_hot[distance <= PLANTED_M].mean()) if is_planted else 0.0
    near = any(np.hypot(s.row - cube.place[0], s.column - cube.place[1]) <= 1 for s in found.spots)
    return bool((found.cells.is_hot & elsewhere).any()), share >= 0.5, bool(near)


def row(name: str, world: Variation | People, n_floors: int) -> str:
    """Return the table's row of one world."""
    told = []
    for seed in range(n_floors):
        rng = np.random.default_rng([seed, 11])
        told.append(outcome(cells(world, rng) if isinstance(world, Variation) else people(world, rng)))
    false, found, near = np.mean(told, axis=0)
    has_place = isinstance(world, Variation) and world.ratio > 1
    more = (f"{found:.0%}", f"{near:.0%}") if has_place else ("-", "-")
    return f"| {' | '.join((name, f'{n_floors}', f'{false:.1%}', *more))} |"


def stored(world: People, seed: int) -> int:
    """Return how many hotspots the product finds on a floor whose positions were imported."""
    from vsd_analytics.figures.hotspots import hotspots as floor_hotspots
    from vsd_analytics.ingest.intake.pipeline import ingest
    from vsd_analytics.ingest.reading.adapter import IngestOptions
    from vsd_analytics.site.model import Camera, Floor, Site
    from vsd_analytics.warehouse.warehouse import Warehouse

    first, interval_s = date(2026, 10, 19), 3600 / FRAMES
    view = ((0.0, 0.0), (float(COLUMNS), 0.0), (float(COLUMNS), float(ROWS)), (0.0, float(ROWS)))
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        camera = Camera("cam", "Cam", "floor", hz=1 / interval_s, view=view)
        opening = (((9 * 60, (9 + HOURS) * 60),),) * 7
        site = Site("s", "S", "UTC", root, floors=(Floor("floor", "Floor"),), cameras=(camera,), opening=opening)
        frame, x, y = positions(world, np.random.default_rng([seed, 11]))
        day, k = frame // (HOURS * FRAMES), frame % (HOURS * FRAMES)
        start_s = datetime(first.year, first.month, first.day, 9, tzinfo=UTC).timestamp()
        ts = start_s + day * 86400 + k * interval_s
        path = root / "positions.csv"
        with path.open("w", newline="", encoding="utf-8") as out:
            writer = csv.writer(out)
            rows = zip(ts.tolist(), range(len(ts)), x.round(3).tolist(), y.round(3).tolist(), strict=True)
            writer.writerows((f"{t:.1f}", i, a, b) for t, i, a, b in rows)
        options = IngestOptions(format="positions", columns=("ts", "track_id", "x_m", "y_m"), period_s=interval_s)
        last = first + timedelta(days=27)
        ingest(site, [path], options, now=datetime(2026, 12, 1, tzinfo=UTC))
        with Warehouse(site, first, last) as warehouse:
            warehouse.materialise("episodes", "violations")
            found = floor_hotspots(warehouse)
        if found.state != "ok":
            raise SystemExit(f"not tested: {found.reason}")
        return len(found.spots)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--floors", type=int, default=400)
    parser.add_argument("--people", type=int, default=100)
    parser.add_argument("--stored", type=int, default=0)
    parser.add_argument("--walls", action="store_true")
    arguments = parser.parse_args()
    if arguments.walls:
        patch("vsd_analytics.stats.hotspots.smoothed", around_shelves).start()
    columns = "world", "floors", "any false hotspot", "planted place found", "located within 1 m"
    print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
    for worlds, n in ((NULL_PEOPLE, arguments.people), (NULL_CELLS, arguments.floors), (PLANTED, arguments.floors)):
        for name, world in worlds.items():
            if n:
                print(row(name, world, n), flush=True)
    if arguments.stored:
        print("\n| world | floors through the store | floors with a hotspot |\n|---|---|---|")
        for name in ("risk grows with density, nobody differs", "couples in an uneven crowd"):
            n_found = sum(stored(NULL_PEOPLE[name], seed) > 0 for seed in range(arguments.stored))
            print(f"| {name} | {arguments.stored} | {n_found} |", flush=True)


if __name__ == "__main__":
    main()
