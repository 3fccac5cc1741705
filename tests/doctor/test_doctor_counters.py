"""`vsd doctor` on door counters: silent, damaged, without a line, without counts."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import pyarrow.parquet as pq
from figures.test_counted_doors import COUNTED, DAYS, DOOR, SIDES, add, site

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.doctor.counters import examine_counters


def found(root: Path, day: int) -> list[tuple[str, str]]:
    now = datetime(2026, 11, day, 12, tzinfo=UTC)
    return [(each.state, each.detail) for each in examine_counters(load_site(root), now=now)]


def test_a_counter_that_sends_is_fine_and_a_silent_one_needs_somebody(tmp_path: Path) -> None:
    root = site(tmp_path)
    assert found(root, 16) == [("needs you", "door: no counts were added")]
    add(root, [f"{day}T08:00,20,12" for day in DAYS], *SIDES)
    assert found(root, 16) == [("ok", "door: 7 intervals until 2026-11-15")]
    assert found(root, 18)[0][0] == "ok", "three days, as over a long weekend"
    assert found(root, 19) == [("needs you", "door: 7 intervals until 2026-11-15: silent for 4 days")]


def test_counts_of_no_line_are_named_and_the_fix_removes_them(tmp_path: Path) -> None:
    root = site(tmp_path)
    add(root, [f"{day}T08:00,20,12" for day in DAYS], *SIDES)
    site(root, text=COUNTED.format("gate"))
    assert [state for state, _ in found(root, 16)] == ["note", "needs you"]
    assert run(cli, ["-C", str(root), "counts", "remove", "door"]) == 0
    assert found(root, 16) == [("needs you", "gate: no counts were added")]


def test_damaged_and_overlapping_counts_need_somebody(tmp_path: Path) -> None:
    root = site(tmp_path, text=DOOR)
    add(root, [f"{day}T08:00,20,12" for day in DAYS], *SIDES)
    file = root / "counts" / "door.parquet"
    rows = pq.read_table(file, partitioning=None)
    pq.write_table(rows.take([0, 0, 1]), file)
    assert "overlap" in found(root, 16)[0][1]
    file.write_bytes(b"PAR1")
    assert found(root, 16)[0][0] == "needs you"
    assert "cannot be read" in found(root, 16)[0][1]
