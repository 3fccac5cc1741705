"""One step of a benchmark in a process of its own: `python tests/benchmarks/one_step.py KIND STEP FOLDER N`.

Libraries are imported and data made before the clock starts. Prints one line of JSON: wall and processor seconds of
all threads, greatest memory of the process, and a digest of the answer.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import resource
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tool_heatmaps import HEATMAPS, CountedCells, ours_first, ours_whole

from vsd_analytics.warehouse.input_fingerprint import text_hash

LIBRARIES = {
    **{"raw": ("duckdb",), "DuckDB": ("duckdb", "pandas"), "vsd": ("duckdb", "pandas", "vsd_analytics.config.project")},
    **{"polars": ("polars",), "pandas": ("pandas",), "boost": ("boost_histogram", "pandas")},
    **{"delta": ("deltalake",), "scipy": ("scipy",), "PedPy": ("pedpy",)},
}
"""What a step imports, by the first word of its name. pyarrow and DuckDB import pandas where it is there."""


def work(kind: str, step: str, folder: Path, n: int) -> Callable[[], Any]:
    """Return what is measured, with everything it needs at hand.

    Args:
        kind: "heatmaps", "pairs", "writing" or "density".
        step: Name of the step, as the table prints it.
        folder: The project of a heatmap; an empty folder to write to.
        n: People in a frame, or records to write.
    """
    for word, libraries in LIBRARIES.items():
        for library in libraries if step.startswith(word) else ():
            importlib.import_module(library)
    if kind == "heatmaps":
        importlib.import_module("vsd_analytics.warehouse.warehouse")
        if HEATMAPS[step] in (ours_first, ours_whole):
            shutil.rmtree(folder / "facts", ignore_errors=True)
        return lambda: HEATMAPS[step](folder)
    if kind == "pairs":
        from tool_pairs import PAIRS, crowd

        people = crowd(PERSONS, per_frame=n)
        PAIRS[step](crowd(20 * n, per_frame=n))  # imports, and what a library prepares once
        return lambda: PAIRS[step](people)
    if kind == "writing":
        from tool_writing import WRITERS, records

        rows = records(n)
        return lambda: WRITERS[step](rows, folder)
    from tool_density import camera_hour, counted_map, pedpy_map

    people = camera_hour(folder)
    count = pedpy_map if step.startswith("PedPy") else counted_map
    return lambda: count(people).tolist()


PERSONS = 600_000
"""People who are compared with those of their frame."""


def peak_mib() -> float:
    """Return the greatest memory of this process. Linux hands `ru_maxrss` on from the parent, so it is not asked."""
    with contextlib.suppress(OSError), Path("/proc/self/status").open(encoding="ascii") as lines:
        return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20


def main(kind: str, step: str, folder: str, n: str) -> None:
    """Measure one step and print the line."""
    do = work(kind, step, Path(folder), int(n))
    with contextlib.redirect_stdout(sys.stderr):
        wall, cpu = time.perf_counter(), time.process_time()
        answer = do()
        took = time.perf_counter() - wall, time.process_time() - cpu
    digest = answer.digest() if isinstance(answer, CountedCells) else answer if answer is None else text_hash(answer)
    print(json.dumps({"wall_s": took[0], "cpu_s": took[1], "peak_mib": peak_mib(), "answer": digest}))


if __name__ == "__main__":
    main(*sys.argv[1:5])
