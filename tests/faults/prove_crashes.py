"""Kills and refuses every write, fsync, rename, link, unlink, mkdir and file creation of every job of the store.

Run it by hand (`make prove` does): it prints the tables of docs/faults.md. Each point starts from the same project: the
job is stopped by SIGKILL at that call, or the call fails once with EIO or ENOSPC; then the store is read as it stands;
then the same job is run again and the project compared with one whose job nothing disturbed.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from crash_points import Point, call, run, strike, why_not
from jobs import JOBS, Job, Row, State, differences, glance, state

FAULTS = {"kill -9": "signal=SIGKILL", "EIO": "error=EIO", "ENOSPC": "error=ENOSPC"}
KINDS = ("create", "write", "fsync", "rename", "link", "unlink", "mkdir", "truncate")


@dataclass(frozen=True)
class Unharmed:
    """A job that nothing disturbed.

    Attributes:
        before: The project it starts from.
        points: The calls it makes.
        whole: What the project holds after it.
        truth: All rows there may be.
        wrong: What is wrong all the same.
    """

    before: Path
    points: tuple[Point, ...]
    whole: State
    truth: dict[str, set[Row]]
    wrong: tuple[str, ...]


def unharmed(job: Job, folder: Path) -> Unharmed:
    """Run a job undisturbed, twice; return what there is to disturb."""
    before = folder / "before" / "project"
    call(job.prepare, before)
    root = _copy(before, folder / "unharmed")
    done = run(job.act, root, is_traced=True)
    assert done.status == "ok", done.told
    call(job.finish, root)
    whole, first = call(state, root), call(state, before)
    truth = {t: set(whole.rows[t]) | set(first.rows[t]) for t in whole.rows}
    wrong = [f"litter: {p}" for p in whole.litter] + call(glance, root, truth, done.acked)
    wrong += [f"{done.n_elsewhere} calls in other threads"] * (done.n_elsewhere > 0)
    again = run(job.act, root)
    call(job.finish, root)
    wrong += [f"second run: {again.told}"] * (again.status != "ok")
    wrong += [f"second run: {w}" for w in differences(job, call(state, root), whole)]
    return Unharmed(before, tuple(done.points), whole, truth, tuple(wrong))


def disturb(job: Job, given: Unharmed, point: Point, fault: str, *, folder: Path) -> list[str]:
    """Disturb a job at one point, read, run it again, compare; return what is wrong, and remove the folder."""
    root = _copy(given.before, folder)
    harmed = strike(job.act, root, point=point, fault=FAULTS[fault], restore=lambda: _copy(given.before, folder))
    where = f"{job.name}, {fault} at {point.call} {point.number} {point.text[:160]}"
    if harmed is None:
        return [f"{where}: the point was not met"]
    expected = ("killed",) if fault == "kill -9" else ("ok", "error")
    wrong = [f"{harmed.status}: {harmed.told}"] * (harmed.status not in expected)
    wrong += [f"fsync tried again on {r}" for r in harmed.retried]
    wrong += call(glance, root, given.truth, harmed.acked)
    again = run(job.act, root)
    call(job.finish, root)
    wrong += [f"run again: {again.told}"] * (again.status != "ok")
    wrong += [f"run again: {w}" for w in call(glance, root, given.truth, [*harmed.acked, *again.acked])]
    wrong += [f"run again: {w}" for w in differences(job, call(state, root), given.whole)]
    shutil.rmtree(folder)
    return [f"{where}: {w}" for w in wrong]


def _copy(before: Path, folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(before.parent, folder)
    return folder / before.name


def prove(names: list[str], *, n_at_once: int, every: int = 1) -> Iterator[str]:
    """Print the table of the jobs and yield what is wrong.

    Args:
        names: Jobs.
        n_at_once: Points tried at the same time.
        every: Try only each so many-th point.
    """
    print("| job | fault | " + " | ".join(KINDS) + " | points | wrong |")
    print("|---" * (len(KINDS) + 4) + "|")
    n_points = 0
    for name in names:
        job = JOBS[name]
        with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(n_at_once) as pool:
            given = unharmed(job, Path(scratch))
            yield from (f"{name}: {w}" for w in given.wrong)
            points = given.points[::every]
            for fault in FAULTS:
                folders = (Path(scratch) / f"{fault[:4].strip()}-{i}" for i in range(len(points)))
                one = partial(_disturb_in, job, given, fault)
                found = list(pool.map(one, points, folders))
                kinds = Counter(p.kind for p in points)
                n_points += len(points)
                counts = " | ".join(str(kinds[k] or "") for k in KINDS)
                print(f"| {name} | {fault} | {counts} | {len(points)} | {sum(map(bool, found))} |", flush=True)
                yield from (w for wrongs in found for w in wrongs)
    print(f"\n{n_points:,} points")


def _disturb_in(job: Job, given: Unharmed, fault: str, point: Point, folder: Path) -> list[str]:
    return disturb(job, given, point, fault, folder=folder)


def main() -> int:
    """Print the tables of docs/faults.md; 1 when anything is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", default=",".join(JOBS), help="jobs, separated by commas")
    parser.add_argument("--every", type=int, default=1, help="try only each so many-th point")
    parser.add_argument("--at-once", type=int, default=2, help="points tried at the same time")
    given = parser.parse_args()
    if (reason := why_not()) is not None:
        print(f"skipped: {reason}")
        return 0
    n_wrong = 0
    for text in prove(given.jobs.split(","), n_at_once=given.at_once, every=given.every):
        print(f"* {text}", file=sys.stderr, flush=True)
        n_wrong += 1
    return min(n_wrong, 1)


if __name__ == "__main__":
    raise SystemExit(main())
