"""Every number of docs/performance.md, command by command: `make performance`, or `make performance QUICK=1` to try it.

The commands run in turn, and print their tables below their own line. Let nothing else run meanwhile: it takes hours. A
command that fails is named at the end, and the exit code is 1.
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

COMMANDS: Final = (
    "bench_tools.py --records 10000000 --only heatmaps --memory 8 --rounds 7",
    "bench_tools.py --records 100000000 --only heatmaps --rounds 5 --memory 8",
    "bench_tools.py --records 1000000 --only writing --rounds 7",
    "bench_tools.py --only pairs",
    "bench_ingest.py --rows 1000000 --rounds 7",
    "bench_ingest.py --rows 4000000 --commands",
    "bench_ingest.py --rows 4000000 --commands --pairs",
    "bench_demo.py",
    "bench_history.py --cameras 2 --hours 4 --interval 20 --rounds 10",
    "bench_year.py --weeks 2 10",
    "bench_year.py --weeks 2 10 --only 'first planner'",
    "bench_year.py --weeks 2 --cameras 6 --only report planner 'first planner' hours compare",
    "bench_live.py --cameras 46 --hours 1",
    "bench_live.py --cameras 46 --hours 23",
    "bench_retention_year.py --weeks 13",
    "bench_schedule.py --engine dask --days 8 --rounds 2",
)
"""In the order of the page."""
QUICK: Final = (
    "bench_tools.py --records 200000 --only heatmaps --rounds 1",
    "bench_tools.py --records 100000 --only writing --rounds 1",
    "bench_ingest.py --rows 100000 --rounds 1",
)
"""The same tables of small sets, to see that they run."""


def run(command: str) -> bool:
    """Run one command and tell whether it came to its end."""
    print(f"\n### python tests/benchmarks/{command}\n", flush=True)
    begin = time.monotonic()
    script, *options = shlex.split(command)
    done = subprocess.run([sys.executable, str(Path(__file__).with_name(script)), *options], check=False)
    print(f"\n({time.monotonic() - begin:.0f} s)", flush=True)
    return done.returncode == 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one round of small sets")
    failed = [command for command in (QUICK if parser.parse_args().quick else COMMANDS) if not run(command)]
    for command in failed:
        print(f"failed: {command}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
