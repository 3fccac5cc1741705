"""The memory of a large site with a long history: 18 cameras, a frame a second, ten weeks of it read by a report.

Facts and marts of ten weeks at this load (327 million records) take an hour of processor time. So two days are made
from records; the other days have the rows of these two with later times, and a store of one frame for each camera and
hour. Which files a report reads, and how many rows they have, is as if all records had been stored. Run it with

    python tests/benchmarks/bench_year.py --weeks 10 --in DIR [--only "first planner"]

It leaves nothing behind, unless `--keep` says where the project goes. Put the table into docs/performance.md.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from made_up_site import FIRST_MS, write_site

from vsd_analytics.config.project import load_site
from vsd_analytics.schema import SCHEMAS
from vsd_analytics.site.model import Site
from vsd_analytics.store.durable import publish
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.camera_days import day_bytes, day_path, day_units, hour_units, read_days
from vsd_analytics.warehouse.day_files import DayFiles, relations_stored_by_day
from vsd_analytics.warehouse.fact_days import FactDays
from vsd_analytics.warehouse.factfiles import FactWriter, by_kind
from vsd_analytics.warehouse.stored_days import Extent
from vsd_analytics.warehouse.units import PartIndex
from vsd_analytics.warehouse.warehouse import Warehouse

PATTERN = 2
"""Days made from records. The days after them repeat them in turn."""
IN_VIEW = 6
EPOCH = date(1970, 1, 1)
FIRST = datetime.fromtimestamp(FIRST_MS / 1000, tz=UTC).date()
FIRST_NUMBER = (FIRST - EPOCH).days
DAY_MS = 86_400_000
INSTANTS = ("ts_ms", "started_ms", "ended_ms", "first_ms", "last_ms", "_from_ms", "_to_ms", "hour_start_ms")
LEAVES = """
import atexit, os, sys
real = os._exit
def leave(n):
    lines = open('/proc/self/status')
    print('PEAK', next(l.split()[1] for l in lines if 'VmHWM' in l), flush=True)
    real(n)
os._exit = leave
from vsd_analytics.cli import main
sys.argv[1:] = {arguments!r}
main()
"""


def later(rows: pa.Table, days: int) -> pa.Table:
    """Return rows of facts or marts some days later."""
    columns = []
    for name, column in zip(rows.column_names, rows.columns, strict=True):
        if name == "weekday":
            columns.append(pa.chunked_array([_weekdays(rows["local_date"], column, days)]))
        elif pa.types.is_date(column.type):
            columns.append(pc.add(column.cast(pa.int32()), days).cast(pa.int32()).cast(column.type))
        elif (step := _step(name)) and not pa.types.is_string(column.type):
            columns.append(pc.add(column, pa.scalar(step * days, column.type)))
        else:
            columns.append(column)
    return pa.table(columns, schema=rows.schema)


def _step(name: str) -> int:
    """Return what a day adds to a column; 0 = nothing."""
    if name.endswith(INSTANTS):
        return DAY_MS
    return {"hour": 24, "utc_day": 1, "quarter": 96, "bucket_quarter": 96}.get(name, 0)


def _weekdays(dates: pa.ChunkedArray, weekday: pa.ChunkedArray, days: int) -> pa.Array:
    first = weekday.to_numpy() - (dates.cast(pa.int32()).to_numpy() + 3) % 7
    moved = (dates.cast(pa.int32()).to_numpy() + days + 3) % 7
    return pa.array(first + moved, weekday.type)


def make_pattern(root: Path, *, n_cameras: int, open_h: int) -> Site:
    """Write a project of two days made from records, with its facts."""
    root.mkdir(parents=True)
    site = write_site(root, n_records=PATTERN * n_cameras * open_h * 3600 * IN_VIEW, n_cameras=n_cameras, open_h=open_h)
    build(site)
    return site


def make(root: Path, pattern: Site, *, weeks: int, open_h: int) -> Site:
    """Write a project of some weeks: the two days of the pattern again and again."""
    root.mkdir(parents=True)
    (root / "vsd.toml").write_text((pattern.root / "vsd.toml").read_text())
    site = load_site(root, environ={})
    _write_frames(site, weeks * 7, open_h)
    _write_facts(site, pattern)
    _write_marts(site, weeks * 7)
    return site


def _write_frames(site: Site, n_days: int, open_h: int) -> None:
    """Store one frame for each camera and hour, so that days and hours have parts."""
    ids = [c.camera_id for c in site.cameras]
    starts = [FIRST_MS + DAY_MS * d + 3_600_000 * h for d in range(n_days) for h in range(open_h)]
    schema, n_rows = SCHEMAS["frames"], len(ids) * len(starts)
    values = {"ts": np.repeat(starts, len(ids)), "camera_id": ids * len(starts), "n_persons": [0] * n_rows}
    columns = [pa.array(values[f.name]).cast(f.type) if f.name in values else pa.nulls(n_rows, f.type) for f in schema]
    store = Store(site.root / "store", site_id=site.site_id)
    store.append("frames", pa.table(columns, schema=schema), engines=["made-up 1"])
    store.fold()


def _write_facts(site: Site, pattern: Site) -> None:
    """Write the facts of all days, under the names that a build looks for."""
    index = PartIndex(Store(site.root / "store", site_id=site.site_id), first_hour=None, last_hour=None)
    whole = build(pattern)
    units = day_units(index, index.hours(), site=site)
    for unit in units:
        days = unit.number - FIRST_NUMBER
        rows = pq.read_table(whole.paths["camera_days"][FIRST_NUMBER + days % PATTERN])
        publish(day_path(site, unit), day_bytes(unit, later(rows, days - days % PATTERN)), is_synced=False)
    files = FactDays(site, hour_units(site, index, index.hours(), read_days(site, units)))
    for name in files.names:
        rows_of = [pq.read_table(whole.paths[name][FIRST_NUMBER + k]) for k in range(PATTERN)]
        for day, path in files.paths[name].items():
            days = day - FIRST_NUMBER
            rows = later(rows_of[days % PATTERN], days - days % PATTERN)
            writer = FactWriter(by_kind({u.number: files.inputs(name, u) for u in files.units[day]}, day * 24))
            hours = rows["hour"].to_numpy()
            for unit in files.units[day]:
                first, after = np.searchsorted(hours, [unit.number, unit.number + 1])
                writer.add(rows.slice(int(first), int(after - first)))
            publish(path, writer.finish(), is_synced=False)


def _write_marts(site: Site, n_days: int) -> None:
    """Write the marts with week files: those of three days are computed, the others follow from these."""
    middle = n_days // 2 - n_days // 2 % PATTERN
    days = [FIRST + timedelta(days=middle + k) for k in range(PATTERN)]
    marts = [r for r in relations_stored_by_day() if r.layer == "marts"]
    names = [r.name for r in marts]
    rows_of = {}
    with Warehouse(site, days[0], days[-1]) as warehouse:
        warehouse.prepare(" ".join(names))
        for relation in marts:
            of_day = f"select * from {relation.name} where {relation.stored_by} = $day"
            rows_of[relation.name] = [warehouse.table(of_day, {"day": day}) for day in days]
    files = DayFiles(site, build(site, is_trusting=True), extents=[Extent(FIRST, FIRST + timedelta(days=n_days - 1))])
    for relation in marts:
        of_day = rows_of[relation.name]
        for week in files.weeks(relation):
            for day in week.inputs:
                k = (day - days[0]).days % PATTERN
                rows = later(of_day[k], (day - days[k]).days)
                week.rows[day] = rows if day >= FIRST else rows.slice(0, 0)
            week.write(relation.stored_by)


def measure(project: Path, arguments: list[str]) -> tuple[float, float]:
    """Run a command in a process of its own; return its processor seconds and greatest memory in MiB."""
    code = LEAVES.format(arguments=["-C", str(project), "--quiet", *arguments])
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    peak = [line.split()[1] for line in done.stdout.splitlines() if line.startswith("PEAK ")]
    if done.returncode > 1 or not peak:
        raise RuntimeError(f"{arguments}: {done.stderr[-2000:]}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, int(peak[-1]) / 1024


def without_marts(project: Path, copy: Path) -> Path:
    """Return a copy of a project, by hard links, that has facts and no mart."""
    marts = {r.name for r in relations_stored_by_day() if r.layer == "marts"}
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(
        project, copy, copy_function=os.link, ignore=lambda path, _: marts if path.endswith("weeks") else ()
    )
    return copy


def commands(weeks: int, out: Path) -> Mapping[str, list[str]]:
    """Return the commands that are measured, by name: of the last week stored."""
    monday = FIRST + timedelta(weeks=weeks - 1)
    now, week, before = f"{monday + timedelta(weeks=1)}T12:00:00Z", f"{monday:%G-W%V}", monday - timedelta(weeks=1)
    made = ["--now", now]
    return {
        "report": [*made, "report", "--week", week, "--format", "html", "--out", str(out)],
        "planner": [*made, "planner", "--exact", "--week", week, "--out", str(out)],
        "first planner": [*made, "planner", "--exact", "--week", week, "--out", str(out)],
        "hours": [*made, "hours", "--week", week, "--json"],
        "compare": [*made, "compare", f"{before:%G-W%V}", week],
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--weeks", type=int, nargs="*", default=[1, 2, 4, 10])
    parser.add_argument("--cameras", type=int, default=18)
    parser.add_argument("--hours", type=int, default=12)
    parser.add_argument("--in", dest="parent")
    parser.add_argument("--keep", type=Path, help="Folder of the projects; those that are there are measured again.")
    parser.add_argument("--only", nargs="*", default=["report", "planner", "hours", "compare"])
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=given.parent) as folder:
        parent = given.keep or Path(folder)
        root = parent / f"pattern-{given.cameras}"
        size = {"n_cameras": given.cameras, "open_h": given.hours}
        pattern = load_site(root, environ={}) if root.exists() else make_pattern(root, **size)
        print("| weeks | command | first, processor s | MiB | again, processor s | MiB |")
        print("|--:|---|--:|--:|--:|--:|", flush=True)
        for weeks in given.weeks:
            project = parent / f"{given.cameras}-{weeks}"
            if not project.exists():
                begun = time.process_time()
                make(project, pattern, weeks=weeks, open_h=given.hours)
                print(f"{weeks} weeks took {time.process_time() - begun:.0f} s to make", file=sys.stderr)
            asked = commands(weeks, Path(folder))
            for name in given.only:
                if name == "compare" and weeks == 1:
                    continue
                (first_s, first_mib), (again_s, again_mib) = (
                    measure(
                        without_marts(project, parent / "copy") if name.startswith("first") else project, asked[name]
                    )
                    for _ in range(2)
                )
                cost = f"{first_s:.1f} | {first_mib:.0f} | {again_s:.1f} | {again_mib:.0f}"
                print(f"| {weeks} | {name} | {cost} |", flush=True)


if __name__ == "__main__":
    main()
