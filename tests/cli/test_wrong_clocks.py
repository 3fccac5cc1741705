"""What people hear of a camera whose clock fell back by decades."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from site_text import site_text

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

CONFIG = site_text("cam-1")
HEADER, OLD = "ts,track_id,x_m,y_m\n", "2000-01-01T00:00:07Z,1,1,2\n"
NEW = "2026-11-09T09:00:00Z,1,1,2\n2026-11-10T09:00:00Z,1,1,2\n"

Vsd = Callable[..., tuple[int, str, str]]


@pytest.fixture
def vsd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Vsd:
    (tmp_path / "vsd.toml").write_text(CONFIG)

    def call(*arguments: str | Path) -> tuple[int, str, str]:
        code = run(cli, ["-C", str(tmp_path), "--now", "2026-11-20T00:00:00Z", *map(str, arguments)])
        out, err = capsys.readouterr()
        return code, out, err

    return call


@pytest.mark.parametrize("command", ["check", "ingest"])
def test_instants_far_from_the_others_of_a_file_are_reported(vsd: Vsd, tmp_path: Path, command: str) -> None:
    (tmp_path / "a.csv").write_text(HEADER + OLD + NEW)
    code, _, err = vsd(command, tmp_path / "a.csv")
    assert code == 1
    assert "warning[W213]: 1 record of 2000-01-01 (UTC), more than a year from the others" in err
    assert "vsd purge --camera ID --range DAYS" in err


def test_instants_far_from_what_is_stored_are_reported(vsd: Vsd, tmp_path: Path) -> None:
    (tmp_path / "new.csv").write_text(HEADER + NEW)
    (tmp_path / "old.csv").write_text(HEADER + OLD)
    assert vsd("ingest", tmp_path / "new.csv")[0] == 0
    assert "W213" in vsd("check", tmp_path / "old.csv")[2]
    assert "W213" not in vsd("check", tmp_path / "new.csv")[2]


def test_the_operator_hears_of_them_later_and_can_remove_them(vsd: Vsd, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(HEADER + OLD + NEW)
    vsd("ingest", tmp_path / "a.csv")
    assert "records more than a year from the others: 2000-01-01 (UTC)" in vsd("doctor")[1]
    code, out, err = vsd("hours")
    assert code == 0
    assert "warning[W311]: no record is stored of 9,808 days between 2000-01-01 and 2026-11-09" in err
    assert len(out.splitlines()) == 1 + 3 * 24
    assert "W311" not in vsd("hours", "--week", "2026-W46")[2]
    assert vsd("purge", "--camera", "cam-1", "--range", "2000-01-01")[0] == 0
    assert "more than a year" not in vsd("doctor")[1]
    assert "W311" not in vsd("hours")[2]
