"""Every write, unlink and folder sync of every kind of purge as the last thing a process did: `make prove` runs this.

Prints a Markdown table: kind of purge, points, and how many did not end as without a crash.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from purge_crashes import JOBS, outcome, points_of, prepare, start_of

WORDS = {
    "age": "purge --older-than (two days, facts sealed)",
    "range": "purge --camera --range",
    "sealed": "purge --camera --range where facts are sealed",
    "keys": "purge --forget-keys",
}


def main() -> int:
    n_wrong = 0
    print("| purge | points | not as without a crash |\n|---|--:|--:|")
    with tempfile.TemporaryDirectory() as name:
        prepared = prepare(Path(name))
        for job in JOBS:
            start = start_of(job, prepared, Path(name))
            n_points = points_of(job, start)
            wrong = [at for at in range(n_points) if outcome(job, start, Path(name) / f"{job}-{at}", at=at)]
            n_wrong += len(wrong)
            print(f"| {WORDS[job]} | {n_points} | {len(wrong)} |", flush=True)
    return 1 if n_wrong else 0


if __name__ == "__main__":
    sys.exit(main())
