"""Processor time of two versions for the same week: all marts from built facts, and the weekly page.

    python tests/benchmarks/compare_versions.py OLD_CHECKOUT OLD_PROJECT PROJECT [--week 2026-W46] [--rounds 5]

OLD_CHECKOUT is a folder of another commit (`git worktree add`). Each version has a project of its own, made by itself
from the same people (`vsd demo` with the same seed). Every step is a process of its own, the versions in turn; a step
runs once before the clock starts, so that facts and stored days are warm and modules compiled, as those of an installed
package are: without that, the version with more code pays for reading its sources. Ratios are pair by pair.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parents[2]
START = """
import resource, sys
from datetime import date, timedelta
from pathlib import Path
from vsd_analytics.config.project import load_site
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.warehouse import open_warehouse
year, week = map(int, sys.argv[2].split("-W"))
site, monday = load_site(Path(sys.argv[1])), date.fromisocalendar(year, week, 1)
def used(): return sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
"""
MARTS = """
before = used()
with open_warehouse(site, monday, monday + timedelta(days=6), uses_days=False) as warehouse:
    for name in sys.argv[3].split(",") if len(sys.argv) > 3 else relations("marts"):
        warehouse.table(f"select * from {name}")
print(used() - before)
"""
PAGE = """
from vsd_analytics.cli import main
sys.argv = ["vsd", "-C", sys.argv[1], "report", "--week", sys.argv[2], "--out", sys.argv[3]]
main()
"""
NAMES = 'print(",".join(relations("marts")))'


def run(checkout: Path, code: str, *arguments: str) -> tuple[str, float]:
    """Return the last line that a process with this version prints, and its processor time."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPATH"] = str(checkout)
    command = [sys.executable, "-c", START + code, *arguments]
    before = os.times()
    done = subprocess.run(command, cwd=checkout, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{checkout}: {done.stderr[-2000:]}")
    after = os.times()
    cpu_s = after.children_user + after.children_system - before.children_user - before.children_system
    return done.stdout.split("\n")[-2], cpu_s


def used(checkout: Path, code: str, *arguments: str) -> float:
    """Return the processor time that a step prints, or that of its whole process where it prints none."""
    if code == MARTS:
        return float(run(checkout, code, *arguments)[0])
    with tempfile.TemporaryDirectory() as out:
        took_s = run(checkout, code, *arguments, out)[1]
        assert list(Path(out).glob("*.html"))
    return took_s


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old_checkout", type=Path)
    parser.add_argument("old_project", type=Path)
    parser.add_argument("project", type=Path)
    parser.add_argument("--week", default="2026-W46")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--page", action="store_true", help="the page alone, without the marts")
    given = parser.parse_args()
    old = (given.old_checkout.resolve(), str(given.old_project.resolve()), given.week)
    new = (HERE, str(given.project.resolve()), given.week)
    old_marts, new_marts = (run(v[0], NAMES, *v[1:])[0].split(",") for v in (old, new))
    both = ",".join(sorted(set(old_marts) & set(new_marts)))
    steps: dict[str, tuple[str, list[str]]] = {
        f"all marts ({len(old_marts)} and {len(new_marts)})": (MARTS, []),
        f"the {both.count(',') + 1} marts of both": (MARTS, [both]),
        "the weekly page, start-up included": (PAGE, []),
    }
    if given.page:
        steps = dict(list(steps.items())[-1:])
    print("| step | before, processor s, median | after | after / before, least | median | greatest |")
    print("|---|--:|--:|--:|--:|--:|")
    for name, (code, more) in steps.items():
        times = [[used(v[0], code, *v[1:], *more) for v in (old, new)] for _ in range(given.rounds + 1)][1:]
        ratios = [after / before for before, after in times]
        before_s, after_s = (statistics.median(column) for column in zip(*times, strict=True))
        print(
            f"| {name} | {before_s:.2f} | {after_s:.2f} | {min(ratios):.2f} | {statistics.median(ratios):.2f} "
            f"| {max(ratios):.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
