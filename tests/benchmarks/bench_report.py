"""How long `vsd report` takes from built facts, beside bare Python, and what of it is computing and what rendering.

Whole processes, one after another in turn, so that what slows the machine slows all of them; the least and the median
of the rounds stand in the table. Run it with

    python tests/benchmarks/bench_report.py

(or with `--project DIR --week 2026-W46` on a project of your own) and put the table into docs/methods/speed.md. Nothing
asserts a time: machines differ and are noisy, ratios less so.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

from vsd_analytics.config.project import load_site
from vsd_analytics.simulate.demo import ingest_demo
from vsd_analytics.simulate.demo_project import write_demo_project
from vsd_analytics.warehouse.build import build

PARTS = """
import contextlib, gc, importlib, os, sys, time
bare = set(sys.modules)
names = sys.argv[3:]
for name in names:
    with contextlib.suppress(Exception):  # what a module made up itself, such as six.moves, cannot be imported by name
        importlib.import_module(name)
if sys.argv[1] == "-":
    os._exit(0)
from datetime import date
from pathlib import Path
from vsd_analytics.cli import GARBAGE_AFTER
from vsd_analytics.config.project import load_site
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.report.pages.json_and_csv import to_json
gc.set_threshold(GARBAGE_AFTER)
site, monday = load_site(Path(sys.argv[1])), date.fromisocalendar(*map(int, sys.argv[2].split("-W")), 1)
times = [time.perf_counter()]
report = week_report(site, monday)
times.append(time.perf_counter())
render_html(report)
times.append(time.perf_counter())
to_json(report)
times.append(time.perf_counter())
print(*((b - a for a, b in zip(times, times[1:])) if names else (m for m in sys.modules if m not in bare)))
"""
"""Project, week, and modules to import before the clock starts; without any it tells those a report imports, however
late. A project `-` ends after the imports, as the command does: without taking them apart."""
BARE = "bare Python: `python -c pass`"
IMPORTS = "all the report imports, early and late, alone"
WHOLE = "`vsd report --format html`, start-up included"
STEPS = (
    "of it: computing (facts found fresh, marts, figures)",
    "of it: rendering the page",
    "its JSON file, not of it",
)
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
"""Modules stay compiled from run to run, as those of an installed package are."""


def seconds(command: list[str], *, cwd: Path) -> tuple[float, float, str]:
    """Return wall time and processor time of a process, and what it printed."""
    before, start = os.times(), time.perf_counter()
    done = subprocess.run(command, cwd=cwd, check=True, capture_output=True, text=True, env=ENVIRONMENT)
    wall_s, after = time.perf_counter() - start, os.times()
    cpu_s = after.children_user + after.children_system - before.children_user - before.children_system
    return wall_s, cpu_s, done.stdout


def measure(project: Path, *, week: str, rounds: int) -> dict[str, list[tuple[float, float | None]]]:
    """Return wall and processor times by step, a pair for each round."""
    with tempfile.TemporaryDirectory() as out:
        python = [sys.executable, "-c"]
        cli = "from vsd_analytics.cli import main; main()"
        modules = seconds([*python, PARTS, str(project), week], cwd=project)[2].split()
        commands = {
            BARE: [*python, "pass"],
            IMPORTS: [*python, PARTS, "-", week, *modules],
            WHOLE: [*python, cli, "report", "--week", week, "--out", out],
        }
        found: dict[str, list[tuple[float, float | None]]] = defaultdict(list)
        seconds(commands[WHOLE], cwd=project)  # facts, compiled modules and file cache are warm from here on
        for _ in range(rounds):
            for name, command in commands.items():
                found[name].append(seconds(command, cwd=project)[:2])
            _, _, told = seconds([*python, PARTS, str(project), week, *modules], cwd=project)
            for name, took in zip(STEPS, told.split(), strict=True):
                found[name].append((float(took), None))
        return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--project", type=Path, help="a project with facts; default: a demo of two weeks")
    parser.add_argument("--week", default="2026-W46")
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        project = given.project
        if project is None:
            project = Path(folder) / "demo"
            write_demo_project(project, seed=4)
            site = load_site(project)
            ingest_demo(site, sorted((project / "engine").iterdir()), seed=4)
            build(site)
        found = measure(project.resolve(), week=given.week, rounds=given.rounds)
    bare_s = statistics.median(wall for wall, _ in found[BARE])
    print(f"median of {given.rounds} interleaved rounds; bare Python is {1000 * bare_s:.0f} ms\n")
    print("| step | wall, s | least | processor, s | times bare Python |\n|---|--:|--:|--:|--:|")
    for name, took in found.items():
        walls, cpus = [w for w, _ in took], [c for _, c in took if c is not None]
        ratio = statistics.median(w / b for w, (b, _) in zip(walls, found[BARE], strict=True))
        cpu = f"{statistics.median(cpus):.2f}" if cpus else ""
        print(f"| {name} | {statistics.median(walls):.2f} | {min(walls):.2f} | {cpu} | {ratio:.0f} |")


if __name__ == "__main__":
    main()
