"""Processor time and memory of all facts of a project, computed from nothing by two versions in turn, by relation.

    python tests/benchmarks/bench_facts.py OLD_CHECKOUT PROJECT [--rounds 5]

OLD_CHECKOUT is a folder of another commit (`git worktree add`). Each version gets a copy of the records of PROJECT,
so the older one must be able to read them. Every build is a process of its own, its imports included. Beside
them, DuckDB reads every column of all stored records of persons and pairs into a table. The copies stay
in PROJECT's parent folder, as NAME.before and NAME.now, for `compare_facts.py`.
"""

from __future__ import annotations

import argparse
import compileall
import json
import os
import shutil
import statistics
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parents[2]
BUILD = """
import json, resource, sys, time
from pathlib import Path
from vsd_analytics.config.project import load_site
from vsd_analytics.warehouse import build as module, compute
took = {}
def noted(function, name_of):
    def run(*args, **options):
        before = time.process_time()
        try:
            return function(*args, **options)
        finally:
            name = name_of(*args)
            took[name] = took.get(name, 0) + time.process_time() - before
    return run
compute.create = noted(compute.create, lambda con, relation: relation.name)
compute._load = noted(compute._load, lambda *args: "reading the store")
module.day_facts = noted(module.day_facts, lambda *args: "camera_days")
if hasattr(compute, "Batch"):
    compute.Batch.computes = noted(compute.Batch.computes, lambda batch, relation: relation.name)
module.build(load_site(Path(sys.argv[1])))
relations_s = sum(took.values())
took["all"] = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
took["writing files, names, start"] = took["all"] - relations_s
with open("/proc/self/status") as lines:
    took["MiB"] = next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))
print(json.dumps(took))
"""
RAW = """
import sys, time
from pathlib import Path
from vsd_analytics.store.duck import connect
names = [str(p) for p in Path(sys.argv[1], "store").rglob("*.parquet") if {"observations", "pairs"} & {*p.parts}]
with connect() as con:
    before = time.process_time()
    con.execute("create temp table everything as select * from read_parquet($names, union_by_name = true)",
                {"names": names})
    print(time.process_time() - before)
"""


def copy_records(project: Path, to: Path) -> Path:
    """Copy what facts are computed from."""
    shutil.rmtree(to, ignore_errors=True)
    shutil.copytree(
        project, to, ignore=lambda folder, _: ("facts", "published", "reports") if folder == str(project) else ()
    )
    return to


def build(checkout: Path, project: Path) -> dict[str, float]:
    """Build all facts of a project from nothing; return the processor seconds of all and of each relation, and MiB."""
    shutil.rmtree(project / "facts", ignore_errors=True)
    took: dict[str, float] = json.loads(run(checkout, project, BUILD))
    return took


def run(checkout: Path, project: Path, code: str) -> str:
    """Return the last line that a process of a version prints."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment["PYTHONPATH"] = str(checkout)
    command = [sys.executable, "-c", code, str(project)]
    done = subprocess.run(command, cwd=checkout, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{checkout}: {done.stderr[-2000:]}")
    return done.stdout.splitlines()[-1]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old_checkout", type=Path)
    parser.add_argument("project", type=Path)
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    project = given.project.resolve()
    versions = {
        name: (checkout, copy_records(project, project.with_name(f"{project.name}.{name}")))
        for name, checkout in (("before", given.old_checkout.resolve()), ("now", HERE))
    }
    for checkout, _ in versions.values():
        compileall.compile_dir(checkout / "vsd_analytics", quiet=1)  # as the modules of an installed package are
    rounds: list[dict[str, dict[str, float]]] = []
    raw_s: list[float] = []
    for number in range(given.rounds):
        order = sorted(versions, reverse=number % 2 == 1)
        raw_s.append(float(run(*versions["now"], RAW)))
        rounds.append({name: build(*versions[name]) for name in order})
        print(f"round {number + 1}: {rounds[-1]}; load {os.getloadavg()[0]:.1f}", file=sys.stderr)
    print("| | before | now | now / before, least, median, greatest |\n|---|--:|--:|---|")
    for of, label, digits in (("all", "processor time, s, median", 1), ("MiB", "peak memory, MiB, median", 0)):
        ratios = sorted(r["now"][of] / r["before"][of] for r in rounds)
        before, now = (statistics.median(r[name][of] for r in rounds) for name in ("before", "now"))
        spread = f"{ratios[0]:.2f}, {statistics.median(ratios):.2f}, {ratios[-1]:.2f}"
        print(f"| {label} | {before:,.{digits}f} | {now:,.{digits}f} | {spread} |")
    for name in versions:
        ratios = sorted(r[name]["all"] / s for r, s in zip(rounds, raw_s, strict=True))
        spread = f"{statistics.median(ratios):.1f} ({ratios[0]:.1f} to {ratios[-1]:.1f})"
        print(f"| {name}, times one read of all columns ({statistics.median(raw_s):.2f} s) | | | {spread} |")
    for label, of_files in (("files of facts", len), ("bytes of facts, MB", megabytes)):
        before, now = (of_files([*(v[1] / "facts").rglob("*.parquet")]) for v in versions.values())
        print(f"| {label} | {before:,.4g} | {now:,.4g} | {now / before:.2f} |")
    print("\n| processor s, median | before | now |\n|---|--:|--:|")
    seconds = {
        v: {n: statistics.median(r[v].get(n, 0) for r in rounds) for r in rounds for n in r[v]} for v in versions
    }
    for name in sorted(seconds["before"] | seconds["now"], key=lambda n: -seconds["before"].get(n, 0)):
        if name != "MiB":
            cells = [f"{of[name]:.2f}" if name in of else "–" for of in seconds.values()]
            print(f"| `{name}` | {' | '.join(cells)} |")


def megabytes(paths: list[Path]) -> float:
    """Return the bytes of files in MB."""
    return sum(p.stat().st_size for p in paths) / 1e6


if __name__ == "__main__":
    main()
