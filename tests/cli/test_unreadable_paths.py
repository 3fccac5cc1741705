"""A path that the system refuses is E120, whoever's it is: no command says of it that it does not exist or is empty."""

from __future__ import annotations

import ctypes
import os
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from site_text import site_text

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import find_project
from vsd_analytics.owners import denied, is_there

if sys.platform != "linux":
    pytest.skip("rights are taken from root as Linux does it", allow_module_level=True)

READS_ALL = 1 << 1 | 1 << 2
"""Capabilities of root to enter and read everything: DAC_OVERRIDE, DAC_READ_SEARCH."""


@contextmanager
def without_rights_of_root() -> Iterator[None]:
    """Let the system refuse files to root as it does to others."""
    libc = ctypes.CDLL(None, use_errno=True)
    header = (ctypes.c_uint32 * 2)(0x20080522, 0)
    before = (ctypes.c_uint32 * 6)()  # effective, permitted, inheritable; of 32 capabilities each
    assert libc.capget(header, before) == 0
    without = (ctypes.c_uint32 * 6)(*before)
    without[0] &= ~READS_ALL
    assert libc.capset(header, without) == 0
    try:
        yield
    finally:
        assert libc.capset(header, before) == 0


@pytest.fixture
def secret(tmp_path: Path) -> Iterator[Path]:
    """A folder with a file, which the system refuses."""
    (tmp_path / "vsd.toml").write_text(site_text("cam-1"), encoding="utf-8")
    folder = tmp_path / "secret"
    folder.mkdir()
    (folder / "a.csv").write_text("ts,x_m,y_m\n", encoding="utf-8")
    (folder / "vsd.toml").write_text(site_text("cam-1"), encoding="utf-8")
    folder.chmod(0)
    with without_rights_of_root():
        yield folder
    folder.chmod(0o700)


COMMANDS = [
    "inbox {folder}",
    "inbox {file}",
    "check {folder}",
    "check {file}",
    "ingest {folder}",
    "ingest {file}",
    "ingest --watch {folder}",
    "context add --name sales --unit EUR --sum {file}",
    "counts add --line door {file}",
    "site build {folder}",
    "site build --root {folder}",
    "calibrate cam-1 --points {file}",
    "engine run {file} --camera cam-1",
    "whatif {file}",
    "node join {file}",
    "-C {folder} hours",
]


@pytest.mark.parametrize("command", COMMANDS)
def test_what_the_system_refuses_is_not_called_missing(
    command: str, secret: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = shlex.split(command.format(folder=secret, file=secret / "a.csv"))
    assert run(cli, ["-C", str(secret.parent), *words]) == 2
    said = capsys.readouterr().err
    assert "[E120]" in said
    assert "Permission denied" in said


def test_a_file_that_vsd_toml_names_is_not_called_missing(secret: Path, capsys: pytest.CaptureFixture[str]) -> None:
    toml = site_text("cam-1", more='picture = "secret/cam.png"\n')
    (secret.parent / "vsd.toml").write_text(toml, encoding="utf-8")
    assert run(cli, ["-C", str(secret.parent), "hours"]) == 2
    said = capsys.readouterr().err
    assert "'secret/cam.png' may not be read" in said
    assert "there is no file" not in said


def test_pythons_whose_pathlib_says_no_are_refused_too(secret: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From 3.14 on, `Path.exists`, `is_file` and `is_dir` are False where the system refuses."""
    monkeypatch.setattr(Path, "exists", os.path.exists)
    monkeypatch.setattr(Path, "is_file", os.path.isfile)
    monkeypatch.setattr(Path, "is_dir", os.path.isdir)
    for path in (secret, secret / "a.csv"):
        with pytest.raises(PermissionError):
            is_there(path)
    with pytest.raises(PermissionError):
        find_project(secret)
    assert not is_there(secret.parent / "nothing")
    assert is_there(secret.parent)


def test_the_fix_names_the_folder_that_refuses(secret: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    me = os.geteuid()
    monkeypatch.setattr("os.geteuid", lambda: me + 12345)
    why, fix = denied(PermissionError(13, "Permission denied", str(secret / "deep" / "a.csv")))
    assert why is not None
    assert f"the folder {secret} belongs to" in why
    assert "run the command as" in fix
    assert denied(FileNotFoundError(2, "No such file", str(secret / "a.csv")))[0] is None
