"""Two ingesters, a report, a query and a plain glob at once: no error, no torn read, counts that only grow.

Run it by hand (`make prove` does); it prints the table of docs/faults.md. Both ingesters deliver a third of the files,
each half of the others; everything comes three times over, in random order, an hour of a file overlapping the next.
Meanwhile `vsd report`, `vsd hours` and the glob of the documentation read in loops.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path

from crash_points import call
from jobs import CONFIG, NOW, messages, tables
from project_state import state

FIRST = datetime(2026, 11, 9, tzinfo=UTC)
N_FILES = 18
N_DELIVERIES = 3
MINUTES_EACH, MINUTES_APART = 90, 60


@dataclass
class Loop:
    """What one process did, again and again.

    Attributes:
        name: Row of the table.
        n_runs: How often.
        last: Last count it saw, of person records.
        wrong: What was wrong.
    """

    name: str
    n_runs: int = 0
    last: int = 0
    wrong: list[str] = field(default_factory=list)

    def saw(self, n: int) -> None:
        """Note a count, which must not be smaller than the one before."""
        self.wrong += [f"{n:,} person records after {self.last:,}"] * (n < self.last)
        self.last = n


def vsd(root: Path, *arguments: str) -> tuple[int, str, str]:
    """Run a command in a process of its own; return exit code, output and errors."""
    code = "from vsd_analytics.cli import main; main()"
    command = [sys.executable, "-c", code, "-C", str(root), "--now", NOW, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout, done.stderr


def ingest(root: Path, files: Sequence[Path], until: float) -> Loop:
    """Deliver files one by one, spread over the time."""
    loop, begun = Loop("`vsd ingest`"), time.monotonic()
    for i, file in enumerate(files):
        time.sleep(max(0.0, begun + (until - begun) * i / len(files) - time.monotonic()))
        code, out, err = vsd(root, "ingest", str(file), "--json")
        loop.n_runs += 1
        loop.wrong += [f"{file.name}: exit code {code}: {out[:300]} {err[:300]}"] * (code != 0)
    return loop


def hours(root: Path, over: Path) -> Loop:
    """Ask for the hours until the file `over` is there, once at least."""
    loop = Loop("`vsd hours`")
    while not loop.n_runs or not over.exists():
        code, out, err = vsd(root, "hours", "--json")
        loop.n_runs += 1
        if code == 0:
            loop.saw(sum(hour["person_records"] or 0 for hour in json.loads(out)["hours"]))
        elif "E301" not in out:  # nothing is stored yet
            loop.wrong.append(f"exit code {code}: {out[:300]} {err[:300]}")
    return loop


def report(root: Path, over: Path) -> Loop:
    """Make the weekly report until the file `over` is there."""
    loop = Loop("`vsd report`")
    while not over.exists():
        code, out, err = vsd(root, "report", "--exact", "--week", "2026-W46", "--out", str(root.parent / "reports"))
        loop.n_runs += 1
        loop.wrong += [f"exit code {code}: {out[:300]} {err[:300]}"] * (code > 1 and "E301" not in out + err)
    return loop


def glob(root: Path, over: Path) -> Loop:
    """Count by the glob of the documentation until the file `over` is there."""
    return call(glob_again_and_again, root, over, patience_s=3600.0)  # type: ignore[no-any-return]


def glob_again_and_again(root: Path, over: Path) -> Loop:
    """Count person records, and their keys, without this package."""
    import duckdb

    loop = Loop("plain glob")
    while not over.exists():
        time.sleep(0.05)
        if not any((root / "store" / "observations").rglob("*.parquet")):
            continue
        loop.n_runs += 1
        try:
            n, n_keys = duckdb.sql(
                "select count(*), count(distinct (camera_id, ts, track_id)) from read_parquet("
                f"'{root}/store/observations/**/*.parquet', hive_partitioning = true, union_by_name = true)"
            ).fetchall()[0]
        except duckdb.Error as error:
            loop.wrong.append(str(error)[:300])
            continue
        loop.saw(n)
        loop.wrong += [f"{n - n_keys:,} records twice"] * (n != n_keys)
    return loop


def truth(root: Path, files: Sequence[Path]) -> int:
    """Return the number of different person records in the files."""
    keys = {
        (r["camera_id"], r["ts"], r["track_id"])
        for file in files
        for table, rows in tables(root, file)
        if table == "observations"
        for r in rows.to_pylist()
    }
    return len(keys)


def deliveries(files: Sequence[Path], rng: random.Random) -> tuple[list[Path], list[Path]]:
    """Return what each of two ingesters delivers."""
    both = [f for i, f in enumerate(files) if i % 3 == 0]
    rest = [f for i, f in enumerate(files) if i % 3]
    shares = ([*both, *rest[::2]] * N_DELIVERIES, [*both, *rest[1::2]] * N_DELIVERIES)
    for share in shares:
        rng.shuffle(share)
    return shares


def main() -> int:
    """Print the table of docs/faults.md; 1 when anything is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=5.0, help="how long")
    parser.add_argument("--seed", type=int, default=20261109)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        root, folder = Path(scratch) / "project", Path(scratch) / "given"
        root.mkdir()
        folder.mkdir()
        (root / "vsd.toml").write_text(CONFIG)
        files = [folder / f"{i:02}.jsonl" for i in range(N_FILES)]
        for i, file in enumerate(files):
            first = FIRST + timedelta(minutes=MINUTES_APART * i)
            file.write_text("\n".join(messages(first, MINUTES_EACH, with_pairs=i % 2 == 0)))
        expected = call(truth, root, files)
        begun, over = time.monotonic(), Path(scratch) / "over"
        with ThreadPoolExecutor(5) as pool:
            until = begun + 60 * given.minutes
            writing = [pool.submit(ingest, root, d, until) for d in deliveries(files, random.Random(given.seed))]
            reading = [pool.submit(read, root, over) for read in (hours, report, glob)]
            try:
                loops = [f.result() for f in writing]
            finally:
                over.touch()
            loops += [f.result() for f in reading]
        minutes = (time.monotonic() - begun) / 60
        final = hours(root, over)
        whole = call(state, root)
        stored = sum(whole.rows["observations"].values())
        wrong = [f"{loop.name}: {w}" for loop in (*loops, final) for w in loop.wrong]
        wrong += [f"{n:,} person records instead of {expected:,}" for n in (stored, final.last) if n != expected]
        wrong += [f"litter: {p}" for p in whole.litter]
        code, out, err = vsd(root, "verify")
        wrong += [f"vsd verify: {out[:300]} {err[:300]}"] * (code != 0)
    print("| process | runs | wrong |\n|---|---|---|")
    for loop in loops:
        print(f"| {loop.name} | {loop.n_runs} | {len(loop.wrong)} |")
    print(f"\n{minutes:.1f} minutes; person records stored: {stored:,} of {expected:,}")
    for text in wrong:
        print(f"* {text}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
