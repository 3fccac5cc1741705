"""What DuckDB spills is private, and does not outlive its process for long."""

from __future__ import annotations

import os
import signal
import stat
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from vsd_analytics.store import spill
from vsd_analytics.store.duck import connect

SPILLING = """
import sys
from vsd_analytics.store.duck import connect
con = connect(memory_limit="20MB", threads=1)
con.execute("set preserve_insertion_order = false")
con.execute("create temp table big as select i, hash(i) as h from range(2_500_000) as t(i)")
print("spilled", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty temporary folder that this process and its children use."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path


def spilling() -> subprocess.Popen[str]:
    """Return a process that has spilled and waits for the end of its input."""
    process = subprocess.Popen(
        [sys.executable, "-c", SPILLING], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "spilled\n"
    return process


def test_what_is_spilled_lies_in_a_folder_that_only_its_owner_can_enter(temporary: Path) -> None:
    with spilling() as process:
        (folder,) = temporary.iterdir()
        assert any(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        assert str(process.pid) not in folder.name
    assert list(temporary.iterdir()) == []


def test_the_folder_of_a_killed_process_is_removed_by_the_next_and_that_of_a_living_one_is_not(temporary: Path) -> None:
    with spilling() as killed, spilling() as living:
        folders = set(temporary.iterdir())
        assert len(folders) == 2
        killed.send_signal(signal.SIGKILL)
        killed.wait()
        with spilling():
            left = set(temporary.iterdir())
            assert len(left & folders) == 1
            assert len(left) == 2
        assert living.poll() is None
    assert list(temporary.iterdir()) == []


def test_a_sweep_follows_no_link_and_touches_nothing_but_spilled_folders(temporary: Path) -> None:
    precious = temporary / "precious"
    precious.mkdir()
    (precious / "photo").write_text("mine")
    (temporary / f"{spill.PREFIX}link").symlink_to(precious, target_is_directory=True)
    (temporary / f"{spill.PREFIX}file").write_text("mine")
    (temporary / f"{spill.PREFIX}dead").mkdir()
    spill.sweep(temporary)
    assert sorted(os.listdir(temporary)) == ["precious", f"{spill.PREFIX}file", f"{spill.PREFIX}link"]
    assert (precious / "photo").read_text() == "mine"


def test_two_connections_of_one_process_spill_to_different_folders() -> None:
    with connect() as one, connect() as other:
        folders = [c.execute("select current_setting('temp_directory')").fetchall()[0][0] for c in (one, other)]
    assert folders[0] != folders[1]


SITE = """
[site]
id = "hall"
name = "Hall"
timezone = "UTC"
[[floor]]
id = "ground"
name = "Ground"
[[camera]]
id = "cam"
name = "Camera"
"""


def test_commands_leave_no_folder(temporary: Path) -> None:
    (temporary / "vsd.toml").write_text(SITE)
    (temporary / "frames.jsonl").write_text('{"v": 1, "camera": "cam", "ts": "2026-11-09T10:00:00Z", "persons": []}\n')
    commands = (["ingest", "frames.jsonl"], ["build"])
    runs = f"[run(cli, command) for command in {commands}]"
    code = f"from vsd_analytics.cli import cli\nfrom vsd_analytics.cli.exit_codes import run\nassert {runs} == [0, 0]"
    subprocess.run([sys.executable, "-c", code], cwd=temporary, check=True)
    assert list((temporary / "facts").iterdir())
    assert list(temporary.glob(f"{spill.PREFIX}*")) == []
