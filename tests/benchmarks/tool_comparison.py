"""Runs the steps of a benchmark in turn, each in a process of its own, and compares times and answers."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from one_step import LIBRARIES, PERSONS
from tool_heatmaps import HEATMAPS
from tool_pairs import PAIRS
from tool_writing import WRITERS

WRITTEN_MOST: Final = 1_000_000
PER_FRAME: Final = (6, 20)
LOOK_S: Final = 0.1
"""How often the memory of a step is looked at, where there is a limit."""
Progress = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Took:
    """One run of a step.

    Attributes:
        wall_s, cpu_s: Wall time, and processor time of all threads.
        peak_mib: Greatest memory of the process, what it imports included.
        answer: Digest of the answer; None where there is none.
    """

    wall_s: float
    cpu_s: float
    peak_mib: float
    answer: str | None


@dataclass(frozen=True, slots=True)
class StepTooLarge:
    """A step that was ended because it used more memory than it may.

    Attributes:
        name: The step.
        limit_mib: What it may use.
    """

    name: str
    limit_mib: int


@dataclass(frozen=True, slots=True)
class MeasuredStep:
    """A step beside the unit of its table, over all rounds.

    Attributes:
        name: The step.
        cpu_s, wall_s: Median.
        ratios: Least, median and greatest ratio of processor time to that of the unit in the same round.
        wall_ratio: Median ratio of wall time.
        peak_mib: Median.
        is_equal: Its answers are those of the first step that has one; None = it has none.
    """

    name: str
    cpu_s: float
    wall_s: float
    ratios: tuple[float, float, float]
    wall_ratio: float
    peak_mib: float
    is_equal: bool | None


def heatmaps(
    project: Path, *, rounds: int, on_step: Progress, limit_mib: int | None = None
) -> list[MeasuredStep | StepTooLarge]:
    """Measure the way from stored records to heatmap and hours.

    Args:
        project: The project of the made-up site.
        rounds: Runs of every step.
        on_step: Called before every run.
        limit_mib: Memory that a step may use. One that uses more is ended, and not run again. None = no limit.
    """
    runs = _runs("heatmaps", _installed(HEATMAPS), lambda: project, 0, rounds, on_step, limit_mib)
    too_large = [StepTooLarge(name, limit_mib or 0) for name, took in runs.items() if len(took) < rounds]
    return [*_rows({name: took for name, took in runs.items() if len(took) == rounds}), *too_large]


def pair_rates(folder: Path, *, rounds: int, on_step: Progress) -> Iterator[tuple[int, list[MeasuredStep]]]:
    """Measure who is within 2.5 m of whom; yields people in a frame with their rows."""
    for per_frame in PER_FRAME:
        yield per_frame, _compare("pairs", _installed(PAIRS), lambda: folder, per_frame, rounds, on_step)


def writing(folder: Path, *, n_records: int, rounds: int, on_step: Progress) -> list[MeasuredStep]:
    """Measure writing of at most `WRITTEN_MOST` records; each run has an empty folder."""
    numbers = iter(range(1_000_000))

    def new_folder() -> Path:
        path = folder / f"written-{next(numbers)}"
        path.mkdir()
        return path

    return _compare("writing", _installed(WRITERS), new_folder, min(n_records, WRITTEN_MOST), rounds, on_step)


def pedpy(project: Path, *, rounds: int, on_step: Progress) -> list[MeasuredStep]:
    """Measure the map of one camera and hour with PedPy; none where it is not installed."""
    if importlib.util.find_spec("pedpy") is None:
        return []
    return _compare("density", ["numpy, from arrays", "PedPy, classic density"], lambda: project, 0, rounds, on_step)


def persons_a_second(row: MeasuredStep) -> float:
    """Return how many persons a second a step compared with all others of their frame."""
    return PERSONS / row.cpu_s


def _installed(steps: Iterable[str]) -> list[str]:
    """Return the names of the steps whose libraries are installed."""
    needed = {name: [lib for w, libs in LIBRARIES.items() if name.startswith(w) for lib in libs] for name in steps}
    return [name for name, libs in needed.items() if all(map(importlib.util.find_spec, libs))]


def _compare(
    kind: str, steps: Sequence[str], folder: Callable[[], Path], n: int, rounds: int, on_step: Progress
) -> list[MeasuredStep]:
    """Run all steps once a round, every second round in the opposite order; the first step is the unit."""
    return _rows(_runs(kind, steps, folder, n, rounds, on_step, None))


def _runs(
    kind: str,
    steps: Sequence[str],
    folder: Callable[[], Path],
    n: int,
    rounds: int,
    on_step: Progress,
    limit_mib: int | None,
) -> dict[str, list[Took]]:
    """Return the runs of each step; fewer than rounds of one that used more memory than it may."""
    runs: dict[str, list[Took]] = {step: [] for step in steps}
    for number in range(rounds):
        for step in steps if number % 2 == 0 else [*reversed(steps)]:
            if len(runs[step]) < number:
                continue
            on_step(f"round {number + 1} of {rounds}: {step}")
            if took := _run(kind, step, folder(), n, limit_mib):
                runs[step].append(took)
    return runs


def _rows(runs: Mapping[str, Sequence[Took]]) -> list[MeasuredStep]:
    unit = next(iter(runs.values()), [])
    answers = [t.answer for took in runs.values() for t in took if t.answer is not None]
    return [_row(step, took, unit, answers[:1]) for step, took in runs.items()]


def _run(kind: str, step: str, folder: Path, n: int, limit_mib: int | None) -> Took | None:
    """Run a step in a process of its own; None when it used more memory than it may."""
    command = [sys.executable, str(Path(__file__).with_name("one_step.py")), kind, step, str(folder), str(n)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        while True:
            try:
                printed, errors = running.communicate(timeout=LOOK_S if limit_mib else None)
                break
            except subprocess.TimeoutExpired:
                if limit_mib and _resident_mib(running.pid) > limit_mib:
                    running.kill()
                    running.communicate()
                    return None
    if running.returncode:
        raise RuntimeError(f"{step}: {errors.strip()[-2000:]}")
    return Took(**json.loads(printed))


def _resident_mib(pid: int) -> float:
    """Return the memory of a process; 0 where the system does not say, or when it has ended."""
    with contextlib.suppress(OSError), Path(f"/proc/{pid}/status").open(encoding="ascii") as lines:
        return next((int(line.split()[1]) / 1024 for line in lines if line.startswith("VmRSS")), 0.0)
    return 0.0


def _row(name: str, took: Sequence[Took], unit: Sequence[Took], expected: Sequence[str]) -> MeasuredStep:
    ratios = [t.cpu_s / u.cpu_s for t, u in zip(took, unit, strict=True)]
    answers = {t.answer for t in took}
    return MeasuredStep(
        name,
        statistics.median(t.cpu_s for t in took),
        statistics.median(t.wall_s for t in took),
        (min(ratios), statistics.median(ratios), max(ratios)),
        statistics.median(t.wall_s / u.wall_s for t, u in zip(took, unit, strict=True)),
        statistics.median(t.peak_mib for t in took),
        None if answers == {None} else answers == set(expected),
    )
