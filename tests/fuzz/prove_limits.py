"""25,000 inputs, each with at most 10 s of processor time and 1 GB of memory: bombs and damaged inputs.

    python tests/fuzz/prove_limits.py --inputs 25000 --seed 0

prints a Markdown table for docs/security.md. Every fifth input is a bomb (fuzz_bombs.py), read by `ingest` into a
store on disk. Each is read by a process of its own, forked from one that has the program loaded, so that its time and
its peak memory (the program's own is among it) are the system's account. The others are damaged inputs of
prove_fuzz.py; forty of them share a process: each has its own time, and its memory is at most the peak of the process
so far. `--only NUMBER` runs one.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from unittest import mock

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent), str(HERE.parent.parent)]

import pyarrow as pa  # noqa: E402
from fuzz_bombs import BOMBS, make_bomb  # noqa: E402
from fuzz_cases import WORLDS, run_case  # noqa: E402
from fuzz_judge import NOW, Judge  # noqa: E402
from fuzz_worlds import text_of  # noqa: E402

from vsd_analytics.config.project import load_site  # noqa: E402
from vsd_analytics.errors import VsdError  # noqa: E402
from vsd_analytics.ingest.intake.pipeline import ingest  # noqa: E402
from vsd_analytics.ingest.reading.adapter import IngestOptions  # noqa: E402

LIMIT_S = 10.0
LIMIT_MB = 1000.0
STOPPED_S = 30
"""Processor time after which an input is stopped."""
SILENT_S = 600
"""Wall time after which a process is."""
AT_ONCE = 50


@dataclass(frozen=True)
class Account:
    """What one input took.

    Attributes:
        kind: For the table.
        said: "accepted", "refused CODE" or "failed ...".
        cpu_s: Processor time, of the program and of the system for it.
        wall_s: Wall time.
        peak_mb: Largest resident memory.
        n_bytes: Size of the input on disk.
    """

    kind: str
    said: str
    cpu_s: float
    wall_s: float
    peak_mb: float
    n_bytes: int = 0

    @property
    def is_over(self) -> bool:
        """Tell whether it went over a limit."""
        return self.cpu_s > LIMIT_S or self.peak_mb > LIMIT_MB

    @property
    def has_failed(self) -> bool:
        """Tell whether it ended in something else than records or a refusal."""
        return not self.said.startswith(("accepted", "refused"))


def accounted(kinds: Sequence[str], jobs: Sequence[Callable[[], str]]) -> list[Account]:
    """Run jobs in a process of their own and return what each took; a job says what became of its input."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        os.close(reading)
        resource.setrlimit(resource.RLIMIT_CPU, (STOPPED_S * len(jobs), STOPPED_S * len(jobs)))
        signal.alarm(SILENT_S)
        with os.fdopen(writing, "w", encoding="utf-8", errors="replace") as stream:
            for kind, job in zip(kinds, jobs, strict=True):
                cpu_s, wall_s = time.process_time(), time.perf_counter()
                try:
                    said = job()
                except BaseException:
                    said = f"failed: {traceback.format_exc(limit=-4)}"
                took = (time.process_time() - cpu_s, time.perf_counter() - wall_s)
                peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6
                print(json.dumps([kind, said, *took, peak_mb]), file=stream, flush=True)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, encoding="utf-8") as told:
        accounts = [Account(*json.loads(line)) for line in told]
    _, status, used = os.wait4(child, 0)
    if len(accounts) < len(jobs):  # what it took is that of the whole process
        said = f"failed: stopped by signal {os.WTERMSIG(status)}"
        cpu_s, peak_mb = used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / 1e6
        accounts += [Account(kind, said, cpu_s, 0.0, peak_mb) for kind in kinds[len(accounts) :]]
    return accounts


def read_bomb(project: Path, path: Path, options: dict[str, object]) -> str:
    """Read one input into the store of a project; return what became of it."""
    with mock.patch.object(os, "fsync", return_value=None):  # what is durable when is proved elsewhere
        try:
            result = ingest(load_site(project), [path], IngestOptions(**options), now=NOW)  # type: ignore[arg-type]
        except VsdError as error:
            return f"refused {error.code}"
    error = result.sources[0].error
    return "accepted" if error is None else f"refused {error.code}"


def bomb(judge: Judge, number: int, *, seed: int) -> Account:
    """Make bomb `number`, in a process of its own as well, and read it."""
    kind = sorted(BOMBS)[number % len(BOMBS)]
    folder, project = judge.folder / "bomb", judge.folder / "project"
    for each in (folder, project):
        shutil.rmtree(each, ignore_errors=True)
        each.mkdir()
    shutil.copy(judge.folder / "vsd.toml", project)

    def made() -> str:
        _, path, options = make_bomb(number, seed=seed, folder=folder)
        return json.dumps([str(path), options])

    told = accounted([kind], [made])[0].said
    if told.startswith("failed"):
        return Account(kind, f"not made, {told}", 0, 0, 0)
    path, options = json.loads(told)
    n_bytes = sum(p.stat().st_size for p in folder.rglob("*") if p.is_file())
    return replace(accounted([kind], [lambda: read_bomb(project, Path(path), options)])[0], n_bytes=n_bytes)


def damaged(judge: Judge, numbers: Sequence[int], *, seed: int) -> list[Account]:
    """Run damaged inputs of prove_fuzz.py."""

    def judged(number: int) -> str:
        outcome = run_case(judge, number, seed=seed).outcome
        return f"refused {outcome.code}" if outcome.word == "refused" else "accepted"

    kinds = [f"damaged: {WORLDS[number % len(WORLDS)].name.partition(':')[0]}" for number in numbers]
    return accounted(kinds, [partial(judged, number) for number in numbers])


def warm(judge: Judge) -> None:
    """Read an undamaged input or two, so that no child loads what the program needs."""
    project = judge.folder / "project"
    project.mkdir()
    shutil.copy(judge.folder / "vsd.toml", project)
    for world in WORLDS:
        if world.pack is not None and world.file:
            path = judge.folder / world.file
            path.write_bytes(world.pack(text_of(world.lines) if world.lines else world.files))
            read_bomb(project, path, dict(world.options))
            path.unlink()


def run(judge: Judge, numbers: Sequence[int], *, seed: int) -> dict[int, Account]:
    """Run inputs by number: every fifth is a bomb."""
    bombs = {n: bomb(judge, n // 5, seed=seed) for n in numbers if n % 5 == 0}
    others = [n for n in numbers if n % 5]
    told = damaged(judge, [n // 5 * 4 + n % 5 - 1 for n in others], seed=seed) if others else []
    return {**bombs, **dict(zip(others, told, strict=True))}


def table(accounts: Sequence[Account]) -> str:
    """Return what inputs took, one row a kind, as Markdown."""
    lines = [
        "| input | inputs | refused | accepted | failed | largest kB on disk | slowest s | (wall s) | largest MB | over a limit |",  # noqa: E501
        "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    kinds: dict[str, list[Account]] = defaultdict(list)
    for account in accounts:
        kinds[account.kind].append(account)
    for kind, found in [*sorted(kinds.items()), ("all", list(accounts))]:
        n_refused = sum(a.said.startswith("refused") for a in found)
        n_accepted = sum(a.said == "accepted" for a in found)
        disk = max(a.n_bytes for a in found) / 1e3
        lines.append(
            f"| {kind} | {len(found):,} | {n_refused:,} | {n_accepted:,} | {len(found) - n_refused - n_accepted:,} | "
            f"{f'{disk:,.0f}' if disk else '–'} | {max(a.cpu_s for a in found):.2f} | "
            f"{max(a.wall_s for a in found):.2f} | {max(a.peak_mb for a in found):,.0f} | "
            f"{sum(a.is_over for a in found):,} |"
        )
    return "\n".join(lines)


def main() -> int:
    """Print the table and what went over a limit or failed; return 1 when anything did."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=25_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int, help="Run one input and say what it took.")
    given = parser.parse_args()
    accounts: list[Account] = []
    with tempfile.TemporaryDirectory() as folder:
        pa.set_cpu_count(1)
        judge = Judge(Path(folder))
        warm(judge)
        gc.freeze()  # else the first collection of each child copies all of the program
        for first in range(0, given.inputs, AT_ONCE):
            numbers = range(first, min(first + AT_ONCE, given.inputs)) if given.only is None else [given.only]
            for number, account in run(judge, numbers, seed=given.seed).items():
                accounts.append(account)
                if given.only is not None or account.is_over or account.has_failed:
                    print(f"{number}: {account}", file=sys.stderr, flush=True)
            print(f"{len(accounts):,} inputs", file=sys.stderr, flush=True)
            if given.only is not None:
                break
        gc.unfreeze()
    print(f"{len(accounts):,} inputs, seed {given.seed}; limits {LIMIT_S:g} s of processor time, {LIMIT_MB:,g} MB\n")
    print(table(accounts))
    return int(any(a.is_over or a.has_failed for a in accounts))


if __name__ == "__main__":
    sys.exit(main())
