"""Processor time and memory of two versions for the same questions, in turn.

    python tests/benchmarks/compare_versions.py OLD_CHECKOUT PROJECT --week 2026-W47 [--rounds 5] [--steps report]

OLD_CHECKOUT is a folder of another commit (`git worktree add`). PROJECT has a store and no facts, such as
`made_up_sets.py` writes. Each version gets a copy of it and computes its own facts. Every step of a round is a process
of its own, first of the old version and then of this one; ratios are pair by pair. Before the rounds each warm step
runs once, so that stored weeks and compiled modules are there, as in an installed package. `first` steps begin with
facts and no mart, `purged` with the weeks before the last one purged. `live` appends a message to the last minute
stored and asks for the hours of its day. The tables are in docs/methods/speed.md.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

HERE = Path(__file__).resolve().parents[2]
COMMAND = """
import sys
from vsd_analytics.cli import main
main()
"""
HOTSPOTS = """
import cProfile, pstats, sys
from vsd_analytics.cli import main
profile = cProfile.Profile()
profile.enable()
try:
    main(sys.argv[1:])
except SystemExit as error:
    profile.disable()
    rows = pstats.Stats(profile).stats.items()
    own = [row[3] for (path, _, name), row in rows if name == "hotspots" and path.endswith("figures/hotspots.py")]
    print(max(own, default=float("nan")))
    raise
"""
LIVE = """
import sys, time
from datetime import date
from pathlib import Path
import pyarrow.parquet as pq
from vsd_analytics.config.project import load_site
try:
    from vsd_analytics.store.store import Store
except ImportError:
    from vsd_analytics.store import Store
from vsd_analytics.warehouse.warehouse import open_warehouse
def ask(warehouse): return warehouse.rows("select * from hours")
site, day = load_site(Path(sys.argv[1])), date.fromisoformat(sys.argv[2])
with open_warehouse(site, day, day, relations=("hours",)) as warehouse:
    ask(warehouse)
store = Store(site.root / "store", site_id=site.site_id)
begun = time.process_time()
for table in ("frames", "observations"):
    store.append(table, pq.read_table(f"{sys.argv[3]}/{table}.parquet"))
store.fold()
with open_warehouse(site, day, day, relations=("hours",)) as warehouse:
    ask(warehouse)
print(time.process_time() - begun)
"""
STEPS = ("report", "planner", "hours", "report first", "planner first", "hotspots", "report purged", "live")


@dataclass(frozen=True)
class Version:
    """A version and its copies of the project.

    Attributes:
        checkout: Its files.
        folder: Of its copies: `built` has facts, `warm` has marts too.
    """

    checkout: Path
    folder: Path

    def run(self, code: str, *arguments: str) -> tuple[str, float, float]:
        """Return what a process prints, its processor seconds, and its greatest memory in MiB."""
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        environment["PYTHONPATH"] = str(self.checkout)
        with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
            command = [sys.executable, "-c", code, *arguments]
            process = subprocess.Popen(command, cwd=self.folder, env=environment, stdout=out, stderr=err)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
            out.seek(0)
            err.seek(0)
            if process.returncode not in (0, 1):  # 1 = a warning
                sys.exit(f"{self.checkout} {arguments}: {err.read()[-2000:]}")
            return out.read(), usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024

    def command(self, project: Path, *arguments: str) -> tuple[str, float, float]:
        """Run a command of a project."""
        return self.run(COMMAND, "-C", str(project), "--quiet", *arguments)

    def copied(self, name: str) -> Path:
        """Return a copy of one of its projects, by hard links: no file of a store or of facts is written in place."""
        copy = self.folder / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(self.folder / name, copy, copy_function=os.link)
        return copy


@dataclass(frozen=True)
class Asked:
    """What is asked for.

    Attributes:
        week: The last week stored.
        message: Folder of the message of `live`; None = that step is not asked for.
    """

    week: str
    message: Path | None

    @property
    def monday(self) -> date:
        """First day of the week."""
        return date.fromisocalendar(*map(int, self.week.split("-W")), 1)

    def measured(self, step: str, version: Version) -> tuple[float, float]:
        """Run a step; return processor seconds, and the greatest memory in MiB."""
        out, now = str(version.folder / "out"), f"{self.monday + timedelta(days=7)}T12:00:00Z"
        name, _, state = step.partition(" ")
        if step == "live":
            day = str(self.monday)
            printed, _, mib = version.run(LIVE, str(version.copied("warm")), day, str(self.message))
            return float(printed), mib
        project = version.copied("built") if state else version.folder / "warm"
        made = ["--now", now, name, "--week", self.week, "--out", out]
        if name == "hotspots":
            made[2] = "report"
            printed, _, mib = version.run(HOTSPOTS, "-C", str(project), "--quiet", *made)
            return float(printed.split()[-1]), mib
        if state == "purged":
            version.command(project, *made)
            version.command(project, "--now", now, "purge", "--older-than", str(self.monday), "--force")
        if name == "hours":
            made = ["--now", now, "hours", "--week", self.week, "--json"]
        _, took_s, mib = version.command(project, *made)
        return took_s, mib


def write_message(folder: Path, project: Path) -> None:
    """Write a frame and its people for the last minute that a project has stored."""
    import numpy as np
    import pyarrow.parquet as pq
    from made_up_site import camera_hour

    last = max(project.glob("store/frames/**/*.parquet"))
    at_ms = int(pq.read_table(last, columns=["ts"])["ts"].cast("int64").to_numpy().max()) + 1000
    folder.mkdir()
    for table, rows in camera_hour(np.random.default_rng(1), 0, at_ms, most=6):
        pq.write_table(rows, folder / f"{table}.parquet")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old_checkout", type=Path)
    parser.add_argument("project", type=Path)
    parser.add_argument("--week", default="2026-W46")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--steps", nargs="+", choices=STEPS, default=["report", "planner"])
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=given.project.resolve().parent) as folder:
        message = Path(folder) / "message" if "live" in given.steps else None
        if message is not None:
            write_message(message, given.project)
        asked = Asked(given.week, message)
        both = [Version(given.old_checkout.resolve(), Path(folder) / "old"), Version(HERE, Path(folder) / "new")]
        begun = datetime.now(UTC)
        for version in both:
            shutil.copytree(given.project, version.folder / "built", copy_function=os.link)
            _, took_s, mib = version.command(version.folder / "built", "build")
            print(f"{version.folder.name}: all facts {took_s:.1f} s, {mib:.0f} MiB; load {os.getloadavg()[0]:.1f}")
            shutil.copytree(version.folder / "built", version.folder / "warm", copy_function=os.link)
            for step in given.steps:
                if step != "live" and step not in ("report first", "planner first", "report purged"):
                    asked.measured(step, version)
        print("| step | before, processor s, MiB | after | after / before, least | median | greatest |")
        print("|---|--:|--:|--:|--:|--:|", flush=True)
        for step in given.steps:
            rounds = [[asked.measured(step, version) for version in both] for _ in range(given.rounds)]
            ratios = [new[0] / old[0] for old, new in rounds]
            columns = zip(*rounds, strict=True)
            cells = " | ".join(
                f"{statistics.median(s for s, _ in column):.1f}, {max(mib for _, mib in column):.0f}"
                for column in columns
            )
            spread = f"{min(ratios):.2f} | {statistics.median(ratios):.2f} | {max(ratios):.2f}"
            print(f"| {step} | {cells} | {spread} |", flush=True)
        took = datetime.now(UTC) - begun
        print(f"{given.rounds} rounds, {took.total_seconds() / 60:.0f} minutes; load {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
