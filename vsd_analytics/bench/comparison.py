"""Runs the steps of a benchmark in turn, each in a process of its own, and compares times and answers."""

from __future__ import annotations

import importlib.util
import json
import statistics
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from vsd_analytics.bench.heatmaps import HEATMAPS
from vsd_analytics.bench.one_step import LIBRARIES, PERSONS
from vsd_analytics.bench.pair_rates import PAIRS
from vsd_analytics.bench.writing import WRITERS

WRITTEN_MOST: Final = 1_000_000
PER_FRAME: Final = (6, 20)
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


def heatmaps(project: Path, *, rounds: int, on_step: Progress) -> list[MeasuredStep]:
    """Measure the way from stored records to heatmap and hours."""
    return _compare("heatmaps", _installed(HEATMAPS), lambda: project, 0, rounds, on_step)


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
    """Return the names of the steps whose library is installed."""
    words = {name: next((w for w in LIBRARIES if name.startswith(w)), None) for name in steps}
    return [n for n, w in words.items() if w is None or importlib.util.find_spec(LIBRARIES[w]) is not None]


def _compare(
    kind: str, steps: Sequence[str], folder: Callable[[], Path], n: int, rounds: int, on_step: Progress
) -> list[MeasuredStep]:
    """Run all steps once a round, every second round in the opposite order; the first step is the unit."""
    runs: dict[str, list[Took]] = {step: [] for step in steps}
    for number in range(rounds):
        for step in steps if number % 2 == 0 else [*reversed(steps)]:
            on_step(f"round {number + 1} of {rounds}: {step}")
            runs[step].append(_run(kind, step, folder(), n))
    answers = [t.answer for took in runs.values() for t in took if t.answer is not None]
    return [_row(step, took, runs[steps[0]], answers[:1]) for step, took in runs.items()]


def _run(kind: str, step: str, folder: Path, n: int) -> Took:
    command = [sys.executable, "-m", "vsd_analytics.bench.one_step", kind, step, str(folder), str(n)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{step}: {done.stderr.strip()[-2000:]}")
    return Took(**json.loads(done.stdout))


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
