"""A year of 18 cameras that purges what is older than 30 days, week by week, as a timer would.

Each week the records of seven days are stored and folded, `vsd build` computes their facts, and `vsd purge` seals the
facts of what is older and removes these records. Then the report of the last week is made; with --reports that of
earlier weeks too, each after its purge. Run it with

    python tests/benchmarks/bench_retention_year.py --weeks 52 --in DIR
    python tests/benchmarks/bench_retention_year.py --weeks 8 --retention-days 7 --reports 2 --in DIR

It prints bytes and processor seconds every fourth week, takes about an hour and 5 GB, and leaves nothing behind. Eight
weeks of which seven are purged take ten minutes. Put the last lines into docs/performance.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from made_up_site import CAMERAS, DAY_MS, FIRST_MS, HOUR_S, camera_hour, write_site

from vsd_analytics.store.store import Store

OPEN_H = 6
"""Six people in view at a frame a second: 2.3 million records a day, as the published deployment has in 24 hours."""
START_MS = FIRST_MS - 54 * 7 * DAY_MS
"""A Monday more than a year ago: records of days to come are not purged."""
FIRST = datetime.fromtimestamp(START_MS / 1000, tz=UTC).date()
SEED = 1
MOST = 1_000_000_000


def store_week(store: Store, week: int, *, open_h: int) -> int:
    """Store the records of seven days, as many in whatever open hours, and return how many persons they have."""
    n_persons = 0
    for day in range(7 * week, 7 * week + 7):
        rng = np.random.default_rng([SEED, day])
        for hour in range(open_h):
            for camera in range(CAMERAS):
                start_ms = START_MS + DAY_MS * day + 1000 * HOUR_S * hour
                for table, rows in camera_hour(rng, camera, start_ms, most=MOST, interval_s=open_h // OPEN_H):
                    store.append(table, rows, engines=["made-up 1"])
                    n_persons += rows.num_rows if table == "observations" else 0
        store.fold()
    return n_persons


def run(root: Path, *arguments: str) -> tuple[float, float]:
    """Run a command of `vsd`; return its processor seconds, and its peak of memory in MiB."""
    vsd = [sys.executable, "-c", "from vsd_analytics.cli import main; main()"]
    with subprocess.Popen([*vsd, *arguments], cwd=root, stdout=subprocess.DEVNULL) as process:
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise SystemExit(f"vsd {' '.join(arguments)}: exit code {process.returncode}")
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--weeks", type=int, default=52)
    parser.add_argument("--in", dest="folder", type=Path, default=None, help="where; the default is a temporary folder")
    parser.add_argument("--retention-days", type=int, default=30)
    parser.add_argument("--open-hours", type=int, default=OPEN_H, help="a multiple of 6, with as many records a day")
    parser.add_argument("--reports", type=int, default=1, help="of how many weeks at the end reports are made")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        root = Path(folder)
        store = Store(root / "store", site_id=write_site(root, n_records=1).site_id)
        n_persons, n_bytes, n_days = 0, 0, 0
        spent_s, peak_mib = {"build": 0.0, "purge": 0.0}, {"build": 0.0, "purge": 0.0}
        for week in range(options.weeks):
            before = _bytes(root / "store")
            n_persons += store_week(store, week, open_h=options.open_hours)
            n_bytes += _bytes(root / "store") - before
            n_days = max(0, 7 * week + 7 - options.retention_days)
            edge = FIRST + timedelta(days=7 * week + 7 - options.retention_days)
            for name, arguments in {"build": (), "purge": ("--older-than", edge.isoformat(), "--force")}.items():
                seconds, mib = run(root, name, *arguments)
                spent_s[name] += seconds
                peak_mib[name] = max(mib, peak_mib[name])
            if week % 4 == 3 or week == options.weeks - 1:
                times = ", ".join(f"{name} {1e6 * s / n_persons:.2f} s" for name, s in spent_s.items())
                peaks = ", ".join(f"{name} {mib:,.0f} MiB" for name, mib in peak_mib.items())
                print(
                    f"week {week + 1}: {n_persons / 1e6:.0f} million records of {n_bytes / n_persons:.2f} bytes; "
                    f"{_sizes(root)}; {times} a million; peaks: {peaks}; purged: purges took "
                    f"{1e6 * spent_s['purge'] / (n_persons / (7 * week + 7) * n_days or 1):.2f} s a million of its "
                    f"records, {_sealed(root, n_persons / (7 * week + 7) * n_days)}",
                    flush=True,
                )
            if week >= options.weeks - options.reports:
                name = "{}-W{:02d}".format(*(FIRST + timedelta(weeks=week)).isocalendar()[:2])
                for which in ("first", "again"):
                    seconds, mib = run(root, "report", "--week", name)
                    print(f"report of {name}, {which}: {seconds:.1f} s, peak {mib:,.0f} MiB", flush=True)
        print(f"with its marts: {_sizes(root)}")


def _sealed(root: Path, n_persons: float) -> str:
    """Return in words how many files of sealed facts there are, and bytes for each purged record of a person."""
    files = list((root / "sealed").rglob("*.parquet"))
    return f"{len(files):,} sealed files of {_bytes(root / 'sealed') / (n_persons or 1):.2f} bytes a record"


def _sizes(root: Path) -> str:
    mib = {name: _bytes(root / name) / 2**20 for name in ("store", "facts", "sealed")}
    said = ", ".join(f"{name} {size:,.0f} MiB" for name, size in mib.items())
    return f"{said}, together {sum(mib.values()) / 1024:.2f} GiB"


def _bytes(folder: Path) -> int:
    return sum(p.stat().st_size for p in folder.rglob("*") if p.is_file())


if __name__ == "__main__":
    main()
