"""The core installation, beside the cameras: takes messages and files in with few libraries, and says what it lacks."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import NamedTuple

import pytest
from site_text import site_text

REPOSITORY = Path(__file__).resolve().parents[2]
CORE = REPOSITORY / "deploy" / "core-requirements.txt"
BLOCKED = """
import contextlib, importlib.abc, io, json, sys
BLOCKED = set(sys.argv[1].split(","))
class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in BLOCKED:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Blocked())
from vsd_analytics.cli import main
def run(command):
    out, err = io.TextIOWrapper(io.BytesIO()), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(command)
        except SystemExit as ended:
            code = ended.code
    out.flush()
    return code, out.buffer.getvalue().decode(), err.getvalue()
done = [run(command) for command in json.loads(sys.argv[2])]
json.dump(done, sys.stdout)
"""
"""Runs commands in one process: to start one takes half a second, and no command can load what is absent."""
MODULES = {"opencv-python-headless": "cv2", "pillow": "PIL", "resvg-py": "resvg_py"}


def names(requirements: list[str]) -> dict[str, str]:
    found = {}
    for line in requirements:
        if line and not line.startswith("#"):
            name = re.match(r"[\w-]+", line)
            assert name is not None
            found[name[0]] = line
    return found


def needed() -> dict[str, str]:
    return names(tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]["dependencies"])


def left_out() -> list[str]:
    return sorted(MODULES.get(name, name) for name in needed().keys() - names(CORE.read_text().splitlines()).keys())


class Done(NamedTuple):
    """How a command ended."""

    code: int
    out: str
    err: str


def vsd(*commands: list[str]) -> list[Done]:
    """Run commands in a process in which all libraries beyond the core are absent."""
    environ = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    words = [sys.executable, "-c", BLOCKED, ",".join(left_out()), json.dumps(commands)]
    done = subprocess.run(words, check=True, capture_output=True, text=True, env=environ, timeout=120)
    return [Done(*ended) for ended in json.loads(done.stdout)]


def project(folder: Path, *, more: str = "") -> Path:
    folder.mkdir()
    alarm = '[[alarm]]\nid = "full"\nkind = "gathering"\nfor_s = 5\n'
    (folder / "vsd.toml").write_text(site_text("cam-1", more=alarm + more), encoding="utf-8")
    rows = "".join(f"2026-11-09T09:00:{s:02}Z,{i},{s / 10 + i},{i}\n" for s in range(60) for i in range(3))
    (folder / "a.csv").write_text("ts,track_id,x_m,y_m\n" + rows, encoding="utf-8")
    return folder


def test_the_core_is_a_part_of_the_whole_with_the_same_versions() -> None:
    core = names(CORE.read_text().splitlines())
    assert core.items() <= needed().items()
    assert {"matplotlib", "cv2", "scipy", "jinja2"} <= set(left_out())


TAKE_IN = (
    "check a.csv",
    "ingest a.csv",
    "imports",
    "quarantine list",
    "alarms",
    "verify",
    "log list",
    "doctor",
    "export --out out.parquet",
    "listen --broker-config",
    "schema frame",
    "hours",
    "heatmap --format csv",
)
MAKE_FIGURES = ("report --week 2026-W46", "hotspots", "today --exact", "forecast")
LISTEN = "listen --once --connect-timeout 1"


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Done]:
    """Return how each command ended; the last listens to a broker that does not answer. One process runs them all."""
    folder = tmp_path_factory.mktemp("core")
    silent, at_broker = project(folder / "a"), project(folder / "b", more='[mqtt]\nhost = "127.0.0.1"\nport = 1\n')
    asked = [(command, ["-C", str(silent), "--now", "2026-11-10", *command.split()]) for command in TAKE_IN]
    asked += [(c, ["-C", str(silent), "--now", "2026-11-20", *c.split(), "--json"]) for c in MAKE_FIGURES]
    asked += [(LISTEN, ["-C", str(silent), *LISTEN.split()]), ("broker", ["-C", str(at_broker), *LISTEN.split()])]
    words = [[str(silent / w) if w in ("a.csv", "out.parquet") else w for w in command] for _, command in asked]
    return dict(zip((name for name, _ in asked), vsd(*words), strict=True))


def test_commands_that_take_records_in_need_no_other_library(done: dict[str, Done]) -> None:
    assert {command: done[command].err for command in TAKE_IN if done[command].code} == {}


def test_listening_needs_no_other_library(done: dict[str, Done]) -> None:
    assert "error[E703]" in done[LISTEN].err
    assert "error[E701]" in done["broker"].err


def test_commands_that_make_figures_say_what_to_install(done: dict[str, Done]) -> None:
    for command in MAKE_FIGURES:
        ended = done[command]
        told = json.loads(ended.out)
        assert (ended.code, told["code"]) == (2, "E107"), command
        assert "pip install vsd-analytics" in told["fix"]
