"""The same records give the same files in every time zone, language and order of hashing."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from report import ingested_worlds as w

from vsd_analytics.report.pages.pdf import find_chromium

REPOSITORY = Path(__file__).resolve().parents[2]
HERE = {"TZ": "Asia/Kathmandu", "LANG": "tr_TR.UTF-8", "LC_ALL": "tr_TR.UTF-8", "PYTHONHASHSEED": "1"}
THERE = {"TZ": "America/St_Johns", "LANG": "C", "LC_ALL": "C", "PYTHONHASHSEED": "2"}


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def busy(day: int, hour: int) -> dict[w.Place, int]:
        return {w.QUEUE: 20 + day, w.DOOR: 12 + day % 4, w.AISLE: 9 + (day * 5) % 4}

    root = tmp_path_factory.mktemp("shop")
    streams = [w.messages(busy, monday=monday, hours=(9, 10)) for monday in (w.BEFORE, w.MONDAY)]
    w.world(root, w.toml(opening='{ mon-sun = "09:00-10:00" }'), *streams)
    return root


def report(root: Path, out: Path, environment: dict[str, str], *arguments: str) -> dict[str, bytes]:
    """Run the command in a process of its own and return its files."""
    code = "from vsd_analytics.cli import main; main()"
    command = [sys.executable, "-c", code, "-C", str(root), "report", "--week", "2026-W46", "--out", str(out)]
    environ = {**os.environ, "PYTHONPATH": str(REPOSITORY), **environment}
    subprocess.run([*command, *arguments], check=True, capture_output=True, env=environ)
    return {p.name: p.read_bytes() for p in sorted(out.iterdir())}


def test_no_byte_depends_on_time_zone_or_language(shop: Path, tmp_path: Path) -> None:
    kinds = ["html", "json", "csv", "svg", "png"]
    if find_chromium(environ=os.environ) is not None:
        kinds.append("pdf")
    arguments = ["--format", ",".join(kinds), "--figure", "when", "--mail", "--zip", "--to", "manager@example.org"]
    here = report(shop, tmp_path / "here", HERE, *arguments)
    there = report(shop, tmp_path / "there", THERE, *arguments)
    assert {Path(name).suffix for name in here} == {f".{k}" for k in kinds} | {".eml"}
    assert here.keys() == there.keys()
    assert [name for name in here if here[name] != there[name]] == []
