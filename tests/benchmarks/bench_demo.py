"""How long each step takes on two demo weeks, as ratios to one plain read of the same records in the same run.

The unit is DuckDB reading every column of all stored person records once. Run it with

    python tests/benchmarks/bench_demo.py

and put the table into docs/methods/speed.md. Nothing asserts a time: machines differ and are noisy, ratios less so.
"""

from __future__ import annotations

import os
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from datetime import date
from pathlib import Path

from vsd_analytics.config.project import load_site
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.simulate.demo import ingest_demo
from vsd_analytics.simulate.demo_project import write_demo_project
from vsd_analytics.site.model import Site
from vsd_analytics.store.duck import connect
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.warehouse import open_warehouse

MONDAY, SUNDAY = date(2026, 11, 9), date(2026, 11, 15)
ROUNDS = 5


def read_all(site: Site) -> None:
    """Read every column of the stored person records once."""
    names = [str(p) for p in (site.root / "store" / "observations").rglob("*.parquet")]
    with connect() as con:
        con.execute("create temp table everything as select * from read_parquet($names)", {"names": names})


def all_marts(site: Site) -> None:
    """Open the warehouse of a week and compute every mart in full, none from days that are stored."""
    with open_warehouse(site, MONDAY, SUNDAY, uses_days=False) as warehouse:
        for name in relations("marts"):
            warehouse.table(f"select * from {name}")


def all_facts(site: Site) -> None:
    """Compute all facts anew."""
    shutil.rmtree(site.root / "facts", ignore_errors=True)
    build(site)


def report(site: Site) -> None:
    """Make the page of a week from fresh facts."""
    render_html(week_report(site, MONDAY))


def seconds(step: Callable[[], object]) -> float:
    """Return the processor time of a step, that of all threads."""
    start = time.process_time()
    step()
    return time.process_time() - start


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "demo"
        truth = write_demo_project(root, seed=4)
        site = load_site(root)
        ingest_s = seconds(lambda: ingest_demo(site, sorted((root / "engine").iterdir()), seed=4))
        steps: dict[str, Callable[[Site], None]] = {
            "read all person records once (the unit)": read_all,
            "all facts of two weeks": all_facts,
            "all marts of a week, from facts": all_marts,
            "the weekly page, from facts": report,
        }
        times: dict[str, list[float]] = {name: [] for name in steps}
        for _ in range(ROUNDS):
            for name, step in steps.items():
                times[name].append(seconds(lambda step=step: step(site)))  # type: ignore[misc]
    unit = times["read all person records once (the unit)"]
    print(
        f"{truth.n_person_records:,} person records, {truth.n_messages:,} frames; "
        f"{ROUNDS} interleaved rounds; load {os.getloadavg()[0]:.0f}; ingest once: {ingest_s:.1f} s\n"
    )
    print("| step | processor s, median | times the unit, median | least | greatest |\n|---|--:|--:|--:|--:|")
    for name, took in times.items():
        ratios = [t / u for t, u in zip(took, unit, strict=True)]
        spread = f"{statistics.median(ratios):.1f} | {min(ratios):.1f} | {max(ratios):.1f}"
        print(f"| {name} | {statistics.median(took):.2f} | {spread} |")


if __name__ == "__main__":
    sys.exit(main())
