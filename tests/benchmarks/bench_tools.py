"""How fast this machine goes from records to heatmap and hours, ours and other tools in turn; docs/performance.md.

    python tests/benchmarks/bench_tools.py
    python tests/benchmarks/bench_tools.py --records 10000000 --only heatmaps
    python tests/benchmarks/bench_tools.py --records 100000000 --only heatmaps --rounds 1 --memory 8 --in /srv/scratch

Other tools take part where they are installed: pip install -e '.[test,bench]'. Every step is a process of its own,
in turn, and its answer must equal that of the others. Times are ratios to the first step. The data are made up, and
removed afterwards. The exit code is 1 when two answers differ.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import tool_comparison
from made_up_site import write_site
from tool_comparison import MeasuredStep, StepTooLarge, persons_a_second

KINDS = ("heatmaps", "pairs", "writing", "density")


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print, and return the exit code."""
    parser = argparse.ArgumentParser(description="Measure this machine beside other tools.")
    parser.add_argument("--records", type=int, default=1_000_000, help="person records to make, from 1,000 on")
    parser.add_argument("--rounds", type=int, default=5, help="runs of every step")
    parser.add_argument("--only", choices=KINDS, action="append", help="measure only this; repeatable")
    parser.add_argument("--seed", type=int, default=1, help="another seed makes other people")
    parser.add_argument("--memory", type=float, metavar="GIB", help="end a step of the heatmaps that uses more (Linux)")
    parser.add_argument("--in", dest="parent", metavar="DIR", help="where to make the data")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--quiet", action="store_true", help="print no progress")
    asked_for = parser.parse_args(arguments)
    n_records, rounds, seed = asked_for.records, asked_for.rounds, asked_for.seed

    def on_step(text: str) -> None:
        if not asked_for.quiet:
            print(text, file=sys.stderr)

    found: dict[str, list[MeasuredStep | StepTooLarge]] = {}
    limit_mib = None if asked_for.memory is None else round(1024 * asked_for.memory)
    asked = asked_for.only or KINDS
    with tempfile.TemporaryDirectory(prefix="vsd-bench-", dir=asked_for.parent) as folder:
        root = Path(folder)
        site = root / "project"
        site.mkdir()
        if {"heatmaps", "density"} & set(asked):
            on_step(f"making {n_records:,} records")
            write_site(site, n_records=n_records, seed=seed)
        if "heatmaps" in asked:
            found["records to heatmap and hours"] = tool_comparison.heatmaps(
                site, rounds=rounds, on_step=on_step, limit_mib=limit_mib
            )
        if "density" in asked:
            found["map of one camera and hour"] = [*tool_comparison.pedpy(site, rounds=rounds, on_step=on_step)]
        if "pairs" in asked:
            for per_frame, rates in tool_comparison.pair_rates(root, rounds=rounds, on_step=on_step):
                found[f"pairs within 2.5 m, {per_frame} people in a frame"] = [*rates]
        if "writing" in asked:
            n_written = min(n_records, tool_comparison.WRITTEN_MOST)
            written = tool_comparison.writing(root, n_records=n_records, rounds=rounds, on_step=on_step)
            found[f"writing of {n_written:,} records in batches"] = [*written]
    found = {title: rows for title, rows in found.items() if rows}
    is_equal = all(getattr(row, "is_equal", None) is not False for rows in found.values() for row in rows)
    if asked_for.json:
        tables = {title: [asdict(row) for row in rows] for title, rows in found.items()}
        print(json.dumps({"n_records": n_records, "rounds": rounds, "seed": seed, "machine": _machine(), **tables}))
        return int(not is_equal)
    print(f"{n_records:,} records, {rounds} rounds, seed {seed}; {_machine()}")
    for title, rows in found.items():
        print("\n" + _table(title, rows))
    return int(not is_equal)


def _machine() -> str:
    def known(name: str) -> str | None:
        try:
            return f"{name} {version(name)}"
        except PackageNotFoundError:
            return None

    names = ("vsd-analytics", "numpy", "duckdb", "pyarrow", "pandas", "polars", "boost-histogram", "deltalake", "pedpy")
    tools = [tool for name in names if (tool := known(name))]
    return f"{os.cpu_count()} cores, {platform.machine()}, Python {platform.python_version()}, {', '.join(tools)}"


def _table(title: str, rows: Sequence[MeasuredStep | StepTooLarge]) -> str:
    """Return a Markdown table."""
    is_rate = title.startswith("pairs")
    more = "million persons a second | " if is_rate else ""
    lines = [
        f"| {title} | {more}processor s | wall s | processor time, times the first | least | greatest | wall, times "
        "| MiB | equal |",
        "|---|" + "--:|" * (8 if is_rate else 7) + "---|",
    ]
    for row in rows:
        if isinstance(row, StepTooLarge):
            lines.append(f"| {row.name} {'| – ' * 6}| over {row.limit_mib:,} | |")
            continue
        rate = f"{persons_a_second(row) / 1e6:.1f} | " if is_rate else ""
        least, middle, greatest = row.ratios
        equal: dict[Any, str] = {None: "", True: "yes", False: "**no**"}
        lines.append(
            f"| {row.name} | {rate}{row.cpu_s:.2f} | {row.wall_s:.2f} | {middle:.2f} | {least:.2f} | {greatest:.2f} "
            f"| {row.wall_ratio:.2f} | {row.peak_mib:,.0f} | {equal[row.is_equal]} |"
        )
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
