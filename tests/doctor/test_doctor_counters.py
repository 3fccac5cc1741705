"""`vsd doctor` on door counters: silent, damaged, without a line, without counts; each printed fix is typed."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import pytest
from figures.test_counted_doors import COUNTED, DAYS, DOOR, SIDES, add, site

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.doctor.counters import examine_counters
from vsd_analytics.doctor.finding import Finding

BY_DAY = [f"{day}T08:00,20,12" for day in DAYS]


def findings(root: Path, day: int) -> list[Finding]:
    return [*examine_counters(load_site(root), now=datetime(2026, 11, day, 12, tzinfo=UTC))]


def found(root: Path, day: int) -> list[tuple[str, str]]:
    return [(each.state, each.detail) for each in findings(root, day)]


def type_fix(root: Path, finding: Finding) -> int:
    """Type the printed fix in the project's folder; return its exit code."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(root)
        return run(cli, shlex.split(str(finding.fix))[1:])


def test_a_counter_that_sends_is_fine_and_a_silent_one_needs_somebody(tmp_path: Path) -> None:
    root = site(tmp_path)
    assert found(root, 16) == [("needs you", "door: no counts were added")]
    add(root, BY_DAY, *SIDES)
    assert found(root, 16) == [("ok", "door: 7 intervals until 2026-11-15")]
    assert found(root, 18)[0][0] == "ok", "three days, as over a long weekend"
    silent = "door: 7 intervals until 2026-11-15: silent for 4 days; if it is gone, its [[line]] needs to = 2026-11-16"
    assert found(root, 19) == [("needs you", silent)]


def test_what_doctor_prints_for_a_line_without_counts_adds_them(tmp_path: Path) -> None:
    root = site(tmp_path)
    (root / "doors.csv").write_text("time,in,out\n2026-11-16T08:00,5,1\n2026-11-16T08:15,3,0\n")
    (missing,) = findings(root, 16)
    assert type_fix(root, missing) == 0
    assert found(root, 16) == [("ok", "door: 2 intervals until 2026-11-16")]


@pytest.mark.parametrize(("columns", "header", "row", "every"), [
    (SIDES, "time,in,out", "5,1", "15min"),
    (SIDES, "time,in,out", "5,1", "1h"),
    (SIDES[:2], "time,in", "5", "5min"),
    (("--both", "in"), "time,count", "5", "1h"),
])  # fmt: skip
def test_what_doctor_prints_for_a_silent_counter_adds_a_file_like_those_before(
    columns: tuple[str, ...], header: str, row: str, every: str, tmp_path: Path
) -> None:
    root = site(tmp_path)
    add(root, BY_DAY, *columns, every=every)
    (silent,) = findings(root, 20)
    (root / "doors.csv").write_text(f"{header}\n2026-11-19T08:00,{row}\n")
    assert type_fix(root, silent) == 0
    assert found(root, 20) == [("ok", "door: 8 intervals until 2026-11-19")]


def test_a_counter_that_is_gone_is_not_silent_once_its_line_has_the_printed_end(tmp_path: Path) -> None:
    root = site(tmp_path)
    add(root, BY_DAY, *SIDES)
    (silent,) = findings(root, 20)
    end = silent.detail.rpartition("to = ")[2]
    site(root, text=f"{DOOR}to = {end}\n")
    assert found(root, 20) == [("ok", "door: 7 intervals until 2026-11-15")]


def test_counts_of_no_line_are_named_and_the_fix_removes_them(tmp_path: Path) -> None:
    root = site(tmp_path)
    add(root, BY_DAY, *SIDES)
    file = root / "counts" / "door.parquet"
    file.with_name("old door.parquet").write_bytes(file.read_bytes())
    site(root, text=COUNTED.format("gate"))
    door, old_door, gate = findings(root, 16)
    assert (door.state, old_door.state, gate.state) == ("note", "note", "needs you")
    assert [type_fix(root, each) for each in (door, old_door)] == [0, 0]
    assert found(root, 16) == [("needs you", "gate: no counts were added")]


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda data: b"",
    "cut off": lambda data: data[:-1],
    "a flipped bit": lambda data: data[:90] + bytes([data[90] ^ 1]) + data[91:],
    "of another program": lambda data: b"PAR1 not a file",
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_damaged_counts_need_somebody_and_the_fix_lets_them_be_added_again(
    damage: Callable[[bytes], bytes], tmp_path: Path
) -> None:
    root = site(tmp_path)
    add(root, BY_DAY, *SIDES)
    file = root / "counts" / "door.parquet"
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    (damaged,) = findings(root, 16)
    assert (damaged.state, damaged.detail.partition(":")[0]) == ("needs you", "counts/door.parquet")
    assert type_fix(root, damaged) == 0
    add(root, BY_DAY, *SIDES)
    assert file.read_bytes() == whole
