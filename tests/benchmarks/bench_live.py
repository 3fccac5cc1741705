"""How old a figure is: from a message that is stored to the hours of the running day, by records in an hour.

A made-up day of many cameras from midnight on; one more frame comes in at its end, is appended and folded, and the
hours of the day are read, as `vsd hours` does. Run it with

    python tests/benchmarks/bench_live.py --cameras 46

and put the line into docs/methods/speed.md. 46 cameras send a million person records an hour: ten times the published
deployment.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from datetime import date
from pathlib import Path

import numpy as np
from made_up_site import DAY_MS, FIRST_MS, HOUR_S, camera_hour, write_site

from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.warehouse import open_warehouse

DAY = date(2026, 11, 9)
MIDNIGHT_MS = FIRST_MS // DAY_MS * DAY_MS


def main() -> None:
    """Print the line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cameras", type=int, default=46)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--hours", type=int, default=2, help="whole hours stored before the running one, at most 23")
    parser.add_argument("--minute", type=int, default=45, help="of the running hour, in which the message comes")
    given = parser.parse_args()
    n_hour = given.cameras * HOUR_S * 6
    took: list[tuple[float, float, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        site = write_site(
            Path(folder),
            n_records=n_hour * (2 * given.hours + 1) // 2,
            n_cameras=given.cameras,
            open_h=24,
            first_ms=MIDNIGHT_MS,
            opening="00:00-24:00",
        )
        build(site)
        store = Store(site.root / "store", site_id=site.site_id)
        for number in range(given.rounds + 1):
            at_ms = MIDNIGHT_MS + 1000 * (given.hours * HOUR_S + given.minute * 60 + number)
            rows = dict(camera_hour(np.random.default_rng(number), 0, at_ms, most=6))
            wall, cpu = time.perf_counter(), time.process_time()
            for table, records in rows.items():
                store.append(table, records)
            store.fold()
            folded = time.process_time()
            with open_warehouse(site, DAY, DAY, relations=("hours",)) as warehouse:
                warehouse.rows("select * from hours")
            took.append((time.perf_counter() - wall, time.process_time() - cpu, folded - cpu))
    took = took[1:]  # the first one imports
    wall_s, cpu_s, fold_s = (statistics.median(t[k] for t in took) for k in range(3))
    least = min(t[1] for t in took)
    print(
        f"{n_hour:,} person records an hour, hour {given.hours + 1}, minute {given.minute}: message to hours "
        f"{cpu_s:.1f} s of processor time (least {least:.1f}), "
        f"{fold_s:.1f} of it storing; {wall_s:.1f} s of wall time; {given.rounds} rounds"
    )


if __name__ == "__main__":
    main()
