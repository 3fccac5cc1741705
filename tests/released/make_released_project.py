"""Makes the project that later versions must still open: `python tests/released/make_released_project.py` at a release.

Writes `VERSION.zip` beside itself: `vsd.toml`, change log, store, counts of a door counter and a series of sales of a
made-up week, as this version writes them, and `printed.json`, the figures that this version prints of them. A file of a
released version is never made again.
"""

from __future__ import annotations

import json
import sys
import tempfile
import zipfile
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import msgspec

sys.path.insert(0, str(Path(__file__).parents[1]))

from simulate.small_scenes import make_week

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.report.pages.json_and_csv import figures_json, to_json
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.version import VERSION

HERE = Path(__file__).resolve().parent
MONDAY = date(2026, 11, 9)
NOW = datetime(2026, 11, 17, 12, tzinfo=UTC)
TOML = """\
[site]
id = "shop"
name = "Riverside Store"
timezone = "Europe/Rome"
opening = { mon-sun = "09:00-12:00" }
closed = ["2026-12-25"]

[[floor]]
id = "ground"
name = "Ground floor"

[[camera]]
id = "cam-1"
name = "Entrance"
floor = "ground"

[[area]]
id = "west"
name = "West"
floor = "ground"
polygon = [[0, 0], [6, 0], [6, 20], [0, 20]]
visits = true

[[area]]
id = "till"
name = "Till"
floor = "ground"
polygon = [[8, 0], [10, 0], [10, 3], [8, 3]]
staff = true

[[line]]
id = "door"
name = "Door"
counted_by = "counter"
left = "Shop"
right = "Street"

[[fixture]]
id = "display"
name = "Display"
floor = "ground"
polygon = [[15, 5], [16, 5], [16, 6], [15, 6]]
movable = true

[[alarm]]
id = "full"
kind = "gathering"
for_s = 60

[mqtt]
host = "127.0.0.1"

[staff]
people = "visitors"

[report]
mask_below = 1
show_context = true
show_lines = true
"""
ADDED = (
    ("counts", "add", "doors.csv", "--line", "door", "--left", "in", "--right", "out", "--every", "1h"),
    ("context", "add", "sales.csv", "--name", "sales", "--value", "in", "--unit", "EUR", "--sum", "--every", "1h"),
)
"""Commands that add what others than cameras measured, one value an hour."""

ROWS = ("line_days", "context_days")


def printed(root: Path) -> dict[str, Any]:
    """Return what a report prints of a project: value, ends, state of each figure, and the counts of its hours.

    Of counts and series, whose figures are tables, it is the rows.
    """
    report = week_report(load_site(root), MONDAY, now=NOW)
    told = json.loads(to_json(report))
    return {
        "figures": {m: {k: f[k] for k in ("value", "lo", "hi", "state")} for m, f in figures_json(report).items()},
        "hours": [[cell["start"], cell["violations"], cell["state"]] for cell in told["when"]["cells"]],
        "log": [[line["at"], line["text"]] for line in told["log"]],
        "rows": {name: told["answers"][name]["rows"] for name in ROWS if name in told["answers"]},
    }


def main() -> None:
    """Write the file of this version; one that is there is left alone."""
    path = HERE / f"{VERSION}.zip"
    if path.exists():
        sys.exit(f"{path.name} is there: what a version wrote stays as it was")
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "vsd.toml").write_text(TOML, encoding="utf-8")
        entry = {"at": "2026-11-11T07:00:00+01:00", "text": "Display moved", "area": "west"}
        (root / "log.jsonl").write_text(json.dumps(entry) + "\n", encoding="utf-8")
        week = make_week(interval_s=20.0, per_hour=2, hotspot=None)
        lines = b"\n".join(msgspec.json.encode(message) for message in week.messages) + b"\n"
        (root / "frames.jsonl").write_bytes(lines)
        done = ingest(load_site(root), [root / "frames.jsonl"], IngestOptions(format="frames"), now=NOW)
        assert not any(source.error for source in done.sources)
        hours = [(day, hour) for day in range(7) for hour in range(9, 12)]
        rows = [f"{MONDAY + timedelta(days=d)}T{h:02}:00,{40 + 3 * d + h},{38 + 2 * d + h}" for d, h in hours]
        for command in ADDED:
            (root / command[2]).write_text("\n".join(["time,in,out", *rows]) + "\n", encoding="utf-8")
            arguments = [str(root / word) if word == command[2] else word for word in command]
            assert run(cli, ["-C", str(root), "--now", NOW.isoformat(), *arguments]) == 0
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            left_out = {root / "frames.jsonl", *(root / command[2] for command in ADDED)}
            left_out.update(file for name in ("secrets", "status") for file in (root / name).iterdir())
            for file in sorted(p for p in root.rglob("*") if p.is_file() and p not in left_out):
                archive.write(file, file.relative_to(root))
            archive.writestr("printed.json", json.dumps(printed(root), indent=1, sort_keys=True))


if __name__ == "__main__":
    main()
