"""What history costs: the report of one week with 4 and with 52 weeks before and around it, facts warm.

One made-up year; the short project has the last four weeks of the same store. Both reports are whole processes, one
after the other. Run it with

    python tests/benchmarks/bench_history.py

and put the table into docs/performance.md.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from datetime import date, timedelta
from pathlib import Path

from made_up_site import write_site

from vsd_analytics.config.project import load_site
from vsd_analytics.warehouse.build import build

FIRST = date(2026, 11, 9)
IN_VIEW = 6


def short_copy(year: Path, to: Path, *, first: date) -> None:
    """Copy a project with the records and facts of the days from `first` on only."""

    def earlier(folder: str, names: list[str]) -> list[str]:
        return [n for n in names if n.startswith("date=") and date.fromisoformat(n[5:]) < first]

    shutil.copytree(year, to, ignore=earlier)


def report(project: Path, week: str, now: str) -> tuple[float, float, float]:
    """Make a report in a process of its own; return wall and processor seconds and the greatest memory in MiB."""
    code = (
        "import resource, sys; from vsd_analytics.cli import main; import atexit, os; real = os._exit\n"
        "def leave(n):\n"
        "    lines = open('/proc/self/status'); print(next(l.split()[1] for l in lines if 'VmHWM' in l), flush=True)\n"
        "    real(n)\n"
        f"os._exit = leave; sys.argv[1:] = ['-C', {str(project)!r}, '--now', {now!r}, '--quiet', "
        f"'report', '--week', {week!r}, '--format', 'html']; main()"
    )
    before, begun = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    took, after = time.perf_counter() - begun, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError(done.stderr[-2000:])
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return took, cpu, int(done.stdout.split()[-1]) / 1024


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--weeks", type=int, default=52)
    parser.add_argument("--cameras", type=int, default=18)
    parser.add_argument("--hours", type=int, default=12)
    parser.add_argument("--interval", type=int, default=1, help="Seconds from frame to frame.")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--in", dest="parent")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=given.parent) as root:
        year, month = Path(root) / "year", Path(root) / "month"
        year.mkdir()
        size = {"n_cameras": given.cameras, "open_h": given.hours, "interval_s": given.interval}
        n_records = given.weeks * 7 * given.cameras * given.hours * 3600 // given.interval * IN_VIEW
        site = write_site(year, n_records=n_records, **size)
        print(f"made {n_records:,} records", file=sys.stderr)
        begun = time.process_time()
        build(site)
        print(f"facts took {time.process_time() - begun:.0f} s of processor time", file=sys.stderr)
        monday = FIRST + timedelta(weeks=given.weeks - 1)
        short_copy(year, month, first=monday - timedelta(weeks=3))
        build(load_site(month, environ={}))
        week, now = f"{monday:%G-W%V}", f"{monday + timedelta(weeks=1)}T12:00:00Z"
        projects = {4: month, given.weeks: year}
        first = {n: report(project, week, now) for n, project in projects.items()}
        took: dict[int, list[tuple[float, float, float]]] = {n: [] for n in projects}
        for number in range(given.rounds):
            for n in sorted(projects, reverse=number % 2 == 1):
                took[n].append(report(projects[n], week, now))
        ratios = [b[1] / a[1] for a, b in zip(took[4], took[given.weeks], strict=True)]
        sizes = {n: sum(p.stat().st_size for p in project.rglob("*.parquet")) for n, project in projects.items()}
        print(
            f"{n_records:,} records in {given.weeks} weeks, {size}, {given.rounds} rounds; "
            f"load {os.getloadavg()[0]:.0f}\n"
        )
        print(
            "| weeks | first report, processor s | again, median | least | wall s, median | MiB | store and facts, MB |"
        )
        print("|--:|--:|--:|--:|--:|--:|--:|")
        for n, of in took.items():
            wall, cpu, peak = (statistics.median(t[k] for t in of) for k in range(3))
            cost = f"{first[n][1]:.1f} | {cpu:.2f} | {min(t[1] for t in of):.2f} | {wall:.1f} | {peak:.0f}"
            print(f"| {n} | {cost} | {sizes[n] / 1e6:.0f} |")
        print(f"\nratio of processor time: {statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})")


if __name__ == "__main__":
    main()
