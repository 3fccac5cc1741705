"""Stops and refuses every write, fsync, rename, link, unlink, mkdir and file creation of every job of the store.

Run it by hand (`make prove` does): it prints the tables of docs/faults.md. Each point starts from the same project: the
job is stopped by SIGKILL at that call, or the call fails (once, or with all that follow), or a write is short; then the
store is read as it is; then the same job is run again and the project compared with one whose job nothing disturbed.

What the second run finds is the files below the project folder, and nothing else of the first. So where a fault left
the same names and bytes, and the same was acknowledged, as at an earlier point, reading and running again would only be
repeated; what was found then counts for this point as well.
"""

from __future__ import annotations

import argparse
import hashlib
import shutil
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from crash_points import FAULTS, KINDS, Fault, Point, call, run, why_not, without_token
from jobs import JOBS, Job
from project_state import State, Truth, differences, glance, state

MEMORY = Path("/dev/shm")


@dataclass(frozen=True)
class Unharmed:
    """A job that nothing disturbed.

    Attributes:
        before: The project it starts from.
        points: The calls it makes.
        whole: What the project holds after it.
        truth: All there may be.
        wrong: What is wrong all the same.
        known: What was found wrong by reading and running again, by what a fault left.
    """

    before: Path
    points: tuple[Point, ...]
    whole: State
    truth: Truth
    wrong: tuple[str, ...]
    known: dict[str, list[str]] = field(default_factory=dict)


def unharmed(job: Job, folder: Path) -> Unharmed:
    """Run a job undisturbed, twice; return what there is to disturb."""
    before = folder / "before" / "project"
    call(job.prepare, before)
    root = _copy(before, folder / "unharmed")
    done = run(job.act, root, is_traced=True)
    assert done.status == "ok", done.told
    call(job.finish, root)
    whole = call(state, root)
    truth = Truth.of(whole, call(state, before))
    wrong = [f"litter: {p}" for p in whole.litter]
    wrong += [f"{done.n_elsewhere} calls in other threads"] * (done.n_elsewhere > 0)
    counted = Counter(p.kind for p in done.points)
    wrong += [f"calls that were not counted: {done.n_traced - counted}"] * (counted != done.n_traced)
    wrong += [f"second {w}" for w in call(read_and_run_again, job, root, truth, whole, done.acked)]
    return Unharmed(before, tuple(done.points), whole, truth, tuple(wrong))


def disturb(job: Job, given: Unharmed, point: Point, fault: Fault, *, folder: Path) -> list[str]:
    """Disturb a job at one point, read, run it again, compare; return what is wrong, and remove the folder."""
    root = _copy(given.before, folder)
    done = run(job.act, root, point=point, fault=fault)
    where = f"{job.name}, {fault.name} at {point.kind} {point.turn}, {point.call} {point.path}"
    if done.struck is None:
        return [f"{where}: the point was not met"]
    expected = {"kill -9": ("killed",), "short write": ("ok",)}.get(fault.name, ("ok", "error"))
    wrong = [f"{done.status}: {done.told}"] * (done.status not in expected)
    wrong += [f"fsync tried again on {r}" for r in done.retried]
    left = _left(root, done.acked)
    if left not in given.known:
        given.known[left] = call(read_and_run_again, job, root, given.truth, given.whole, done.acked)
    shutil.rmtree(folder)
    return [f"{where}: {w}" for w in wrong + given.known[left]]


def read_and_run_again(job: Job, root: Path, truth: Truth, whole: State, acked: list[object]) -> list[str]:
    """Return what is wrong with a project as a fault left it, and after the same job once more."""
    wrong = glance(root, truth, acked)
    try:
        job.act(root, acked.append)
        job.finish(root)
    except Exception as error:
        return [*wrong, f"run again: {type(error).__name__}: {error}"]
    found = differences(state(root), whole, is_named_alike=job.is_named_alike)
    return wrong + [f"run again: {w}" for w in glance(root, truth, acked) + found]


def _left(root: Path, acked: object) -> str:
    """Return a hash of the names and bytes of all files, and of what was acknowledged."""
    found = hashlib.blake2b(repr(acked).encode())
    paths = [(without_token(str(p.relative_to(root))), p) for p in root.rglob("*")]
    for name, path in sorted(paths):
        found.update(f"\0{name}\0".encode())
        found.update(hashlib.blake2b(path.read_bytes()).digest() if path.is_file() else b"")
    return found.hexdigest()


def _copy(before: Path, folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(before.parent, folder)
    return folder / before.name


def prove(names: list[str], faults: list[str], *, n_at_once: int, every: int = 1, below: str = "") -> Iterator[str]:
    """Print the table of the jobs, each with how many points of a fault went wrong, and yield what is wrong.

    Args:
        names: Jobs.
        faults: Faults.
        n_at_once: Points tried at the same time.
        every: Try only each so many-th point.
        below: Try only points whose path has this in it, such as "facts/".
    """
    print(f"| job | {' | '.join([*KINDS, *faults])} |")
    print("|---" * (1 + len(KINDS) + len(faults)) + "|")
    n_points = n_read = 0
    for name in names:
        job = JOBS[name]
        with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as scratch:
            given = unharmed(job, Path(scratch))
            yield from (f"{name}: {w}" for w in given.wrong)
            cells = [str(Counter(p.kind for p in given.points)[k] or "") for k in KINDS]
            for fault in (FAULTS[f] for f in faults):
                begun = time.monotonic()
                points = [p for p in given.points if p.kind in fault.kinds and below in p.path][::every]
                with ThreadPoolExecutor(n_at_once) as pool:
                    found = list(pool.map(partial(_disturb_somewhere, job, given, fault, Path(scratch)), points))
                n_points += len(points)
                cells.append(f"{sum(map(bool, found))} of {len(points)}")
                took = f"{name}, {fault.name}: {cells[-1]} in {time.monotonic() - begun:.0f} s"
                print(took, file=sys.stderr, flush=True)
                yield from (w for wrongs in found for w in wrongs)
            print(f"| {name} | {' | '.join(cells)} |", flush=True)
            n_read += len(given.known)
    print(f"\n{n_points:,} points, which left {n_read:,} different projects")


def _disturb_somewhere(job: Job, given: Unharmed, fault: Fault, scratch: Path, point: Point) -> list[str]:
    return disturb(job, given, point, fault, folder=scratch / f"{threading.get_ident()}")


def main() -> int:
    """Print the tables of docs/faults.md; 1 when anything is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", default=",".join(JOBS), help="jobs, separated by commas")
    parser.add_argument("--faults", default=";".join(FAULTS), help="faults, separated by semicolons")
    parser.add_argument("--every", type=int, default=1, help="try only each so many-th point")
    parser.add_argument("--below", default="", help="try only points whose path has this in it, such as facts/")
    parser.add_argument("--at-once", type=int, default=2, help="points tried at the same time")
    given = parser.parse_args()
    if (reason := why_not()) is not None:
        print(f"skipped: {reason}")
        return 0
    n_wrong = 0
    names, faults = given.jobs.split(","), given.faults.split(";")
    for text in prove(names, faults, n_at_once=given.at_once, every=given.every, below=given.below):
        print(f"* {text}", file=sys.stderr, flush=True)
        n_wrong += 1
    return min(n_wrong, 1)


if __name__ == "__main__":
    raise SystemExit(main())
