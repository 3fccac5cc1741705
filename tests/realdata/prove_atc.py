"""Every figure of the catalogue on a real morning: the ATC shopping centre, Wednesday 24 October 2012, hours 9 to 11.

Run `VSD_REALDATA=... python tests/realdata/prove_atc.py`; the table is in docs/methods/atc.md. The recording goes
through ingest, store, facts and report as any engine's output does; what three hours cannot tell is refused with its
reason. Beside them stands what plain numpy counted of the same files, where it did.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.report.pages.json_and_csv import figures_json
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.warehouse.sqlfiles import figure_headers

MONDAY = date(2012, 10, 22)
OPTIONS = IngestOptions(format="positions", columns=("ts", "track_id", "x_m", "y_m", "speed", "angle"), period_s=1.0)
FILES = tuple(f"atc-1024-{hour}_{part}.csv.gz" for hour in (9, 10, 11) for part in ("train", "test"))
NOW = datetime(2026, 11, 20, tzinfo=UTC)
TOML = """\
[site]
id = "atc"
name = "ATC"
timezone = "Asia/Tokyo"
opening = {{ wed = "09:00-12:00" }}

[[floor]]
id = "floor"
name = "Floor"
plan = "{plan}"
plan_m_per_px = 0.05
plan_origin_m = [-60.0, -40.0]

[[camera]]
id = "atc"
name = "ATC"
floor = "floor"
hz = 1.0

[[area]]
id = "west"
name = "West"
floor = "floor"
polygon = [[-60, -40], [0, -40], [0, 40], [-60, 40]]

[[area]]
id = "east"
name = "East"
floor = "floor"
polygon = [[0, -40], [80, -40], [80, 40], [0, 40]]
"""


def figures_of_week(root: Path, folder: Path) -> Mapping[str, Any]:
    """Return the figures of the week of the recording by catalogue id.

    Args:
        root: An empty folder for the project.
        folder: The recording.
    """
    (root / "vsd.toml").write_text(TOML.format(plan=folder / "atc-occu.png"), encoding="utf-8")
    site = load_site(root)
    done = ingest(site, [folder / name for name in FILES], OPTIONS, now=NOW)
    if any(s.error for s in done.sources):
        raise ValueError(done)
    return figures_json(week_report(site, MONDAY, now=NOW))


def said(metric: str, figure: Mapping[str, Any]) -> str:
    """Return what a figure says in one cell: its value and interval, its rows in short, or why there is none."""
    if figure["state"] != "ok":
        return f"*{figure['state'].replace('_', ' ')}*: {figure['reason']}"
    parts = []
    if figure["value"] is not None:
        limits = f" ({number(figure['lo'])} to {number(figure['hi'])})" if figure["lo"] is not None else ""
        parts.append(f"**{number(figure['value'])}**{limits} {UNITS.get(metric, figure['unit'])}")
    if figure["rows"] is not None:
        parts.append(ROWS.get(metric, named())(figure["rows"]))
    if figure["lo"] is None and figure["reason"]:
        parts.append(f"*{figure['reason']}*")
    return "; ".join(p for p in parts if p)


Rows = Sequence[Mapping[str, Any]]
UNITS = {
    "M4": "track ids",
    "M6": "of person-time",
    "M8": "violations",
    "M9": "of violations are between groups",
    "M5": "people in view, mean",
    "M23": "is behaviour",
    "M26": "of person-time",
}


def cells(rows: Rows) -> str:
    """Return how many cells a map has, and its range."""
    values = sorted(row["value"] for row in rows)
    middle = values[len(values) // 2]
    return f"{len(rows):,} cells of 1 m², {number(values[0])} to {number(values[-1])}, median {number(middle)}"


def shares(rows: Rows) -> str:
    """Return classes and their shares."""
    said = []
    for row in rows:
        low, high = (row[k] for k in (("least", "most") if "least" in row else ("from_m", "to_m")))
        unit = "" if "least" in row else " m"
        named = f"{low}" if low == high else f"{low} and more" if high is None else f"{low:g} to {high:g}{unit}"
        said.append(f"{named}: {row['value']:.0%}")
    return ", ".join(said)


def named(*keys: str) -> Callable[[Rows], str]:
    """Return what says rows by some of their keys, what they are, and their value."""

    def tell(rows: Rows) -> str:
        return " / ".join(
            " ".join([*(str(row[key]) for key in keys), row["what"], number(row["value"])])
            for row in rows
            if row["value"] is not None
        )

    return tell


ROWS: Mapping[str, Callable[[Rows], str]] = {
    "M2": named("start"),
    "M6": named("reading"),
    "M9": named("reading"),
    "M11": shares,
    "M15": named("name"),
    **dict.fromkeys(("M16", "M17", "M18", "M19"), cells),
    "M21": shares,
    "M22": lambda rows: f"the largest: {max(row['n_people'] for row in rows)} people",
    "M26": named("distance_m"),
    "M33": named("level"),
}


def number(value: float | bool | str | None) -> str:
    """Return a number with three digits, counts whole."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: "–"}[value]
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def counted(folder: Path) -> Mapping[str, str]:
    """Return by figure what plain numpy counted of the same files (the data's own truth_dev.json)."""
    truth = json.loads((folder.parent / "truth_dev.json").read_text())["positions"]["dev_atc_h09_11"]
    share = truth["person_frames_in_violation"] / truth["person_frames"]
    return {
        "M4": f"{truth['persons']:,}",
        "M5": f"{truth['persons_per_frame_mean']:.1f} in frames with anybody",
        "M6": f"{truth['person_frames_in_violation']:,} of {truth['person_frames']:,} records: {share:.3f}",
        "M8": f"{truth['encounters']:,} of any length, joined over {truth['encounter_gap_s']:g} s instead of 3",
        "M23": f"{truth['pair_frames']:,} pairs in frames of 1 s: {truth['pair_frames'] / 3600:.0f} h",
        "M29": f"{truth['person_frames']:,} records",
    }


def table(figures: Mapping[str, Mapping[str, Any]], truth: Mapping[str, str]) -> str:
    """Return the table of all figures."""
    lines = ["| | figure | ATC, hours 9 to 11 | counted by plain numpy |", "|---|---|---|---|"]
    for header in (h for h in figure_headers() if h.metric in figures):  # absent: nobody asked for them
        text = said(header.metric, figures[header.metric]).replace("|", "\\|")
        lines.append(f"| {header.metric} | {header.name} | {text} | {truth.get(header.metric, '')} |")
    return "\n".join(lines)


def main() -> None:
    """Print the table."""
    folder = Path(os.environ.get("VSD_REALDATA", "")) / "atc"
    if not folder.is_dir():
        print("skipped: VSD_REALDATA names no folder with the recording atc")
        return
    with tempfile.TemporaryDirectory() as root:
        print(table(figures_of_week(Path(root), folder), counted(folder)))


if __name__ == "__main__":
    main()
