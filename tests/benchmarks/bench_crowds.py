"""What facts of visits, flow, queues and capacity cost in a crowd, as a ratio to the facts that exist without them.

    python tests/benchmarks/bench_crowds.py --people 200 --minutes 20 --runs 3

A concourse under one camera, as many people in view all the time, two frames a second. Both builds run in turn, each as
a process of its own on the same store without facts: areas that ask for nothing, and the same areas that ask for
visits, with a queue and capacities. Prints processor time and peak memory of both, and their ratios pair by pair.
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from warehouse.small_projects import T0, Frame, Person, make_site, put

from vsd_analytics.site.model import Area, Camera, Site
from vsd_analytics.warehouse.build import build

SIDE_M = 40.0
STAY_S = 90.0
HZ = 2


def site(root: Path, *, is_asking: bool) -> Site:
    """Return a concourse with eight areas."""
    boxes = [(10.0 * k + 1, low) for low in (2.0, 22.0) for k in range(4)]
    areas = tuple(
        Area(
            f"area-{k}", f"Area {k}", "ground", ((x, y), (x + 7, y), (x + 7, y + 14), (x, y + 14)),
            has_visits=is_asking, capacity=20 if is_asking else None, is_queue=is_asking and k == 0,
            served_in="area-1" if is_asking and k == 0 else None,
        )
        for k, (x, y) in enumerate(boxes)
    )  # fmt: skip
    return replace(make_site(root, cameras=[Camera("cam", "Cam", "ground", hz=float(HZ))]), areas=areas)


def crowd(n_people: int, minutes: int) -> list[Person | Frame]:
    """Return people who walk straight across at 1.3 m a second; whoever has left is followed by another one."""
    rng = np.random.default_rng(1)
    n = minutes * 60 * HZ
    place, way = rng.uniform(0, SIDE_M, (n_people, 2)), rng.normal(0, 1.3, (n_people, 2))
    left = rng.uniform(0, STAY_S * HZ, n_people)
    number, newest = np.arange(n_people), n_people
    rows: list[Person | Frame] = []
    for k in range(n):
        ts = T0 + k * 1000 // HZ
        rows.append(Frame(ts, "cam", n_persons=n_people))
        rows += [
            Person(ts, f"t{t}", int(x), int(y))
            for t, (x, y) in zip(number.tolist(), (place * 1000).tolist(), strict=True)
        ]
        place = (place + way / HZ) % SIDE_M
        left -= 1
        gone = np.flatnonzero(left <= 0)
        place[gone] = rng.uniform(0, SIDE_M, (len(gone), 2))
        left[gone] = STAY_S * HZ
        number[gone] = newest + np.arange(len(gone))
        newest += len(gone)
    return rows


def measure(root: Path, *, is_asking: bool) -> dict[str, float]:
    """Return what one build without facts costs, in a process of its own."""
    shutil.rmtree(root / "facts", ignore_errors=True)
    command = [sys.executable, __file__, "--build", str(root), *(["--asking"] if is_asking else [])]
    return dict(json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--people", type=int, default=200)
    parser.add_argument("--minutes", type=int, default=20)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--build", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--asking", action="store_true", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.build is not None:
        build(site(asked.build, is_asking=asked.asking))
        used = resource.getrusage(resource.RUSAGE_SELF)
        print(json.dumps({"cpu_s": used.ru_utime + used.ru_stime, "peak_mib": used.ru_maxrss / 1024}))
        return
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as folder:
        root = Path(folder)
        put(site(root, is_asking=False), crowd(asked.people, asked.minutes))
        pairs = [[measure(root, is_asking=is_asking) for is_asking in (False, True)] for _ in range(asked.runs)]
    print(f"{asked.people} people, {asked.minutes} min at {HZ} Hz: {asked.people * asked.minutes * 60 * HZ:,} records")
    for key in ("cpu_s", "peak_mib"):
        without, asking = ([p[k][key] for p in pairs] for k in (0, 1))
        ratios = sorted(b / a for a, b in zip(without, asking, strict=True))
        print(f"{key}: {statistics.median(without):.1f} without, {statistics.median(asking):.1f} asking; ratios "
              + ", ".join(f"{r:.2f}" for r in ratios))  # fmt: skip


if __name__ == "__main__":
    main()
