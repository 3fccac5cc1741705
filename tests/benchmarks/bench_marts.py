"""How long all marts of a busy week take from built facts, beside one plain read of the week's records in the same run.

The unit is DuckDB reading every column of every stored record of the week once (the greatest value of each, which
leaves it nothing to skip). The week is made up: 6 cameras, 12 hours a day, a frame a second, about 6 people in
view, 11 million person records and 1.1 million violation records. Run it with

    python tests/benchmarks/bench_marts.py

and put the tables into docs/methods/speed.md. Nothing asserts a time: machines differ and are noisy, ratios less so.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa

from vsd_analytics.config.project import load_site
from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store.duck import connect
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.warehouse import open_warehouse

MONDAY = date(2026, 11, 9)
FIRST_MS = 1_794_211_200_000
"""2026-11-09 08:00 UTC."""
CAMERAS, OPEN_S, SLOTS, LIFE_S, SIDE_M = 6, 12 * 3600, 8, 60, 22.5
IN_VIEW, TOGETHER = 0.75, 0.05
"""Share of the 8 slots that hold somebody; share of lives that two slots spend side by side."""
CONFIG = """[site]
id = "shop"
name = "Shop"
timezone = "UTC"
opening = { mon-sun = "08:00-20:00" }
[privacy]
pseudonyms = false
[[floor]]
id = "ground"
name = "Ground"
"""


Took = tuple[float, float]
"""Wall and processor time, seconds."""


class Clock:
    """Wall and processor time since the last look."""

    def __init__(self) -> None:
        self._last = time.perf_counter(), time.process_time()

    def lap(self) -> Took:
        """Return the time since the last look, and look."""
        before, self._last = self._last, (time.perf_counter(), time.process_time())
        return self._last[0] - before[0], self._last[1] - before[1]


def write_week(root: Path, *, days: int) -> Site:
    """Write a project with a made-up week in its store."""
    cameras = [f'[[camera]]\nid = "cam-{c}"\nname = "Camera {c}"\nfloor = "ground"\n' for c in range(CAMERAS)]
    areas = [
        f'[[area]]\nid = "area-{c}"\nname = "Area {c}"\nfloor = "ground"\n'
        f"polygon = [[{30 * c}, 0], [{30 * c + 12}, 0], [{30 * c + 12}, 12], [{30 * c}, 12]]\n"
        for c in range(CAMERAS)
    ]
    (root / "vsd.toml").write_text(CONFIG + "".join(cameras + areas))
    site = load_site(root)
    store = Store(root / "store", site_id=site.site_id)
    rng = np.random.default_rng(1)
    for day in range(days):
        for camera in range(CAMERAS):
            for table, rows in camera_day(rng, camera, FIRST_MS + 86_400_000 * day):
                store.append(table, rows, engines=["made-up 1"])
    store.fold()
    return site


def camera_day(rng: np.random.Generator, camera: int, first_ms: int) -> Iterator[tuple[TableName, pa.Table]]:
    """Yield the frames and person records of one camera and day.

    Each slot holds one person after another for a minute each, who walks straight; the second of two slots is empty,
    or holds somebody of its own, or a companion of the first at 0.8 m.
    """
    n_lives = OPEN_S // LIFE_S + 2
    shape = (n_lives, SLOTS)
    start, end = rng.uniform(0, SIDE_M, (2, *shape, 2))
    is_here = rng.random(shape) < IN_VIEW
    pairs = rng.random((n_lives, SLOTS // 2)) < TOGETHER
    beside = rng.uniform(-0.57, 0.57, (n_lives, SLOTS // 2, 2))
    for walked in (start, end):
        walked[:, 1::2] = np.where(pairs[..., None], walked[:, ::2] + beside, walked[:, 1::2])
    is_here[:, 1::2] = np.where(pairs, is_here[:, ::2], is_here[:, 1::2])
    phase = np.repeat(rng.integers(0, LIFE_S, SLOTS // 2), 2)
    second = np.arange(OPEN_S)[:, None]
    life, age = (second + phase) // LIFE_S, (second + phase) % LIFE_S / LIFE_S
    slot = np.broadcast_to(np.arange(SLOTS), life.shape)
    here = is_here[life, slot]
    at = start[life, slot] + (end - start)[life, slot] * age[..., None]
    place_mm = np.round(1000 * (at + rng.normal(0, 0.03, at.shape)) + [30_000 * camera, 0])[here].astype(np.int64)
    n_persons = here.sum(axis=1)
    names = pa.array([f"{first_ms // 86_400_000:05x}{camera:x}{k:010x}" for k in range(n_lives * SLOTS)])
    ts = pa.array(first_ms + 1000 * np.arange(OPEN_S))
    person = (np.cumsum(here, axis=1) - 1)[here]
    yield "frames", stored_rows("frames", OPEN_S, camera, ts=ts, n_persons=pa.array(n_persons))
    yield (
        "observations",
        stored_rows(
            "observations",
            len(person),
            camera,
            ts=ts.take(pa.array(np.repeat(np.arange(OPEN_S), n_persons))),
            person=pa.array(person),
            track_id=names.take(pa.array((life * SLOTS + slot)[here])),
            x_mm=pa.array(place_mm[:, 0]),
            y_mm=pa.array(place_mm[:, 1]),
            quality=pa.repeat("metric", len(person)),
        ),
    )


def stored_rows(name: TableName, n_rows: int, camera: int, **columns: pa.Array) -> pa.Table:
    """Return rows of a stored table, one camera; columns that are not given are unknown."""
    known = {"camera_id": pa.repeat(f"cam-{camera}", n_rows), **columns}
    arrays = [
        known[f.name].cast(f.type) if f.name in known else pa.nulls(n_rows, f.type).cast(f.type) for f in SCHEMAS[name]
    ]
    return pa.table(arrays, schema=SCHEMAS[name])


def read_all(site: Site) -> None:
    """Read every column of every stored record once."""
    with connect() as con:
        for table in TABLES:
            names = [str(p) for p in sorted((site.root / "store" / table).rglob("*.parquet"))]
            columns = ", ".join(f"max({'epoch_ms(ts)' if c == 'ts' else c})" for c in SCHEMAS[table].names)
            if names:
                con.execute(f"select {columns} from read_parquet($names)", {"names": names}).fetchall()


def all_marts(site: Site, days: int, *, uses_days: bool = False) -> Iterator[str]:
    """Open the warehouse of the week and compute every mart in full, each once; yield what was done after each.

    Args:
        site: The project, its facts built.
        days: Days from Monday on.
        uses_days: Read the marts that are kept by day instead.
    """
    with open_warehouse(site, MONDAY, MONDAY + timedelta(days=days - 1), uses_days=uses_days) as warehouse:
        yield "opening: facts found fresh"
        for name in relations("marts"):
            warehouse.materialise(name)
            yield name


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--days", type=int, default=7)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    clock = Clock()
    reads: list[Took] = []
    marts: dict[str, list[Took]] = defaultdict(list)
    kept: list[Took] = []
    with tempfile.TemporaryDirectory() as folder:
        site = write_week(Path(folder), days=given.days)
        print(f"made and stored in {clock.lap()[0]:.0f} s", file=sys.stderr)
        build(site)
        built = clock.lap()
        list(all_marts(site, given.days, uses_days=True))
        first = clock.lap()
        for _ in range(given.rounds):
            clock.lap()
            read_all(site)
            reads.append(clock.lap())
            for name in all_marts(site, given.days):
                marts[name].append(clock.lap())
            list(all_marts(site, given.days, uses_days=True))
            kept.append(clock.lap())
        with open_warehouse(site, MONDAY, MONDAY + timedelta(days=given.days - 1)) as warehouse:
            counted = warehouse.rows(
                "select sum(person_records)::bigint as n, sum(violation_records)::bigint as m, "
                "sum(n_violations)::bigint as v from camera_hours"
            )[0]
    total = [(sum(t[0] for t in round_), sum(t[1] for t in round_)) for round_ in zip(*marts.values(), strict=True)]
    print(
        f"{counted['n']:,} person records, {counted['m']:,} violation records, {counted['v']:,} violations; "
        f"{given.rounds} interleaved rounds; the unit took {statistics.median(r[0] for r in reads):.2f} s "
        f"({statistics.median(r[1] for r in reads):.2f} s of processor time)\n"
    )
    print("| step | times the unit, median | least | processor time, times the unit |\n|---|--:|--:|--:|")
    print("| read all columns of the raw week once (the unit) | 1.0 | 1.0 | 1.0 |")
    print(_row("**all marts from built facts**", total, reads))
    print(_row("all marts, their days written as well (once)", [first] * given.rounds, reads))
    print(_row("all marts, their days stored", kept, reads))
    print(_row("building the facts (once)", [built] * given.rounds, reads))
    print("\n| of all marts | times the unit, median | least | processor time, times the unit |\n|---|--:|--:|--:|")
    for name, took in sorted(marts.items(), key=lambda item: -statistics.median(t[1] for t in item[1])):
        print(_row(name if " " in name else f"`{name}`", took, reads))


def _row(name: str, took: list[Took], reads: list[Took]) -> str:
    wall, cpu = ([t[k] / r[k] for t, r in zip(took, reads, strict=True)] for k in (0, 1))
    return f"| {name} | {statistics.median(wall):.2f} | {min(wall):.2f} | {statistics.median(cpu):.2f} |"


if __name__ == "__main__":
    main()
