"""`vsd bench`: how fast this machine goes from records to heatmap and hours, beside other tools."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from vsd_analytics.cli.options import json_option
from vsd_analytics.cli.output import emit_json, rounded
from vsd_analytics.cli.project import Project, pass_project

if TYPE_CHECKING:
    from collections.abc import Sequence

    from vsd_analytics.bench.comparison import MeasuredStep, StepTooLarge

KINDS = ("heatmaps", "pairs", "writing", "density")


@click.command()
@click.option(
    "--records",
    "n_records",
    type=click.IntRange(1_000, 1_000_000_000),
    default=1_000_000,
    show_default=True,
    help="Person records to make: 18 cameras, a frame a second, 6 people in view.",
)
@click.option("--rounds", type=click.IntRange(1, 99), default=5, show_default=True, help="Runs of every step.")
@click.option("--only", type=click.Choice(KINDS), multiple=True, help="Measure only this; repeatable.")
@click.option("--seed", type=int, default=1, show_default=True, help="Another seed makes other people.")
@click.option(
    "--memory",
    "limit_gib",
    type=click.FloatRange(min=0.1),
    metavar="GIB",
    help="End a step of the heatmaps that uses more memory than this (Linux).",
)
@click.option("--in", "parent", metavar="DIR", help="Where to make the data (default: the folder for temporary files).")
@json_option
@pass_project
def bench(
    project: Project,
    n_records: int,
    rounds: int,
    only: tuple[str, ...],
    seed: int,
    limit_gib: float | None,
    parent: str | None,
    as_json: bool,
) -> int:
    """Measure this machine: from stored records to heatmap and hours, ours and other tools in turn.

    Other tools take part where they are installed: pip install 'vsd-analytics[bench]'. Every step is a process of its
    own, in turn, and its answer must equal that of the others. Times are ratios to the first step. The
    data are made up, and removed afterwards. The exit code is 1 when two answers differ.

    \b
    Example:
      vsd bench
      vsd bench --records 10000000 --only heatmaps
      vsd bench --records 100000000 --only heatmaps --rounds 1 --memory 8 --in /srv/scratch
    """
    import tempfile
    from pathlib import Path

    from vsd_analytics.bench import comparison
    from vsd_analytics.bench.made_up_site import write_site

    def on_step(text: str) -> None:
        if not project.quiet:
            click.echo(text, err=True)

    found: dict[str, list[MeasuredStep | StepTooLarge]] = {}
    limit_mib = None if limit_gib is None else round(1024 * limit_gib)
    asked = only or KINDS
    with tempfile.TemporaryDirectory(prefix="vsd-bench-", dir=parent) as folder:
        root = Path(folder)
        site = root / "project"
        site.mkdir()
        if {"heatmaps", "density"} & set(asked):
            on_step(f"making {n_records:,} records")
            write_site(site, n_records=n_records, seed=seed)
        if "heatmaps" in asked:
            found["records to heatmap and hours"] = comparison.heatmaps(
                site, rounds=rounds, on_step=on_step, limit_mib=limit_mib
            )
        if "density" in asked:
            found["map of one camera and hour"] = [*comparison.pedpy(site, rounds=rounds, on_step=on_step)]
        if "pairs" in asked:
            for per_frame, rates in comparison.pair_rates(root, rounds=rounds, on_step=on_step):
                found[f"pairs within 2.5 m, {per_frame} people in a frame"] = [*rates]
        if "writing" in asked:
            n_written = min(n_records, comparison.WRITTEN_MOST)
            written = comparison.writing(root, n_records=n_records, rounds=rounds, on_step=on_step)
            found[f"writing of {n_written:,} records in batches"] = [*written]
    found = {title: rows for title, rows in found.items() if rows}
    is_equal = all(getattr(row, "is_equal", None) is not False for rows in found.values() for row in rows)
    if as_json:
        tables = {title: [asdict(row) for row in rows] for title, rows in found.items()}
        emit_json(rounded({"n_records": n_records, "rounds": rounds, "seed": seed, "machine": _machine(), **tables}))
        return int(not is_equal)
    click.echo(f"{n_records:,} records, {rounds} rounds, seed {seed}; {_machine()}")
    for title, rows in found.items():
        click.echo("\n" + _table(title, rows))
    return int(not is_equal)


def _machine() -> str:
    import os
    import platform
    from importlib.metadata import PackageNotFoundError, version

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
    from vsd_analytics.bench.comparison import StepTooLarge, persons_a_second

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
