"""Every write, unlink and folder sync of every kind of purge as the last thing a process did: `make prove` runs this.

Prints a Markdown table: kind of purge, points, and how many did not end as without a crash.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from purge_crashes import JOBS, outcome, points_of, prepare, start_of

WORDS = {
    "age": "purge --older-than (two days, facts sealed)",
    "range": "purge --camera --range",
    "sealed": "purge --camera --range where facts are sealed",
    "request": "purge --camera --range --reason",
    "delivered": "the same, and the file comes again after the crash",
    "sealed request": "purge --camera --range --reason where facts are sealed",
    "keys": "purge --forget-keys",
}


def main() -> int:
    n_wrong = 0
    print("| purge | points | not as without a crash |\n|---|--:|--:|")
    memory = Path("/dev/shm")  # where a sync costs nothing
    with tempfile.TemporaryDirectory(dir=memory if memory.is_dir() else None) as name:
        prepared = prepare(Path(name))
        for job in JOBS:
            start = start_of(job, prepared, Path(name))
            n_points = points_of(job, start)
            wrong = 0
            for at in range(n_points):
                if found := outcome(job, start, root := Path(name) / "project", at=at):
                    print(f"* {WORDS[job]}, point {at}: {found}", file=sys.stderr, flush=True)
                    wrong += 1
                shutil.rmtree(root)
            n_wrong += wrong
            print(f"| {WORDS[job]} | {n_points} | {wrong} |", flush=True)
    return 1 if n_wrong else 0


if __name__ == "__main__":
    sys.exit(main())
