"""A writer that is killed leaves files: the next report or build removes them, and no live one loses any."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from warehouse.small_projects import Person, Site, at, beats, make_site, put

from vsd_analytics.store import durable
from vsd_analytics.store.durable import sweep_pages
from vsd_analytics.warehouse import day_files
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.warehouse.week_files import FOLDER as WEEKS

FOLDER = Path("facts", WEEKS)
DAY = date(2026, 11, 9)
DEAD = 2**22 + 1  # no process has so high an id

KILLED = """
import os, signal, sys
sys.path[:0] = sys.argv[2:]
from datetime import date
from pathlib import Path
from warehouse.test_superseded_files import DAY, shop
from vsd_analytics.warehouse.warehouse import Warehouse

warehouse = Warehouse(shop(Path(sys.argv[1])), DAY, DAY)
warehouse.materialise("camera_hours", "coverage", "episodes", "crowding_hours")
os.kill(os.getpid(), signal.SIGKILL)
"""


def shop(root: Path) -> Site:
    return make_site(root)


@pytest.fixture(scope="module")
def stale(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a project with a minute of records, its files of marts, and a minute more that makes all of them stale."""
    site = shop(tmp_path_factory.mktemp("stale"))
    for t in (at("2026-11-09 08:00"), at("2026-11-09 09:00")):
        put(site, [*(Person(t + s * 1000, k, 0, 0) for s in range(60) for k in "ab"), *beats(t, t + 60_000)])
        if t == at("2026-11-09 08:00"):
            read(site)
    return site.root


@pytest.fixture
def site(stale: Path, tmp_path: Path) -> Site:
    return shop(Path(shutil.copytree(stale, tmp_path / "shop")))


def read(site: Site, *names: str) -> None:
    with Warehouse(site, DAY, DAY) as warehouse:
        warehouse.materialise(*(names or ("camera_hours", "coverage", "episodes", "crowding_hours")))


@pytest.fixture(scope="module")
def left_by_the_dead(stale: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the project of a process that wrote facts and marts anew and was killed before it removed the old."""
    root = Path(shutil.copytree(stale, tmp_path_factory.mktemp("killed") / "shop"))
    folder = Path(__file__).parents[1]  # of all tests
    done = subprocess.run([sys.executable, "-c", KILLED, root, folder], env=os.environ, check=False)
    assert done.returncode == -signal.SIGKILL
    return root


@pytest.fixture
def killed(left_by_the_dead: Path, tmp_path: Path) -> Site:
    site = shop(Path(shutil.copytree(left_by_the_dead, tmp_path / "shop")))
    assert doubled(site.root / FOLDER)
    assert doubled(site.root / "facts")
    return site


def doubled(root: Path) -> list[str]:
    """Return the units of which there are several files: whoever reads the folder by a glob counts them double."""
    names = Counter(f"{p.parent.relative_to(root)}/{p.name[:2]}" for p in root.rglob("*.parquet"))
    return sorted(name for name, n in names.items() if n > 1)


def temporary(folder: Path, name: str, *, pid: int = DEAD) -> Path:
    path = folder / f".{name}.{pid}.tmp"
    path.write_bytes(b"half")
    return path


def test_the_next_report_removes_what_a_killed_one_left(killed: Site) -> None:
    read(killed)
    assert doubled(killed.root / "facts") == []


def test_the_next_build_removes_what_a_killed_report_left(killed: Site) -> None:
    folder = next((killed.root / FOLDER).rglob("date=*"))
    left = [temporary(folder, "00-0123456789abcdef.parquet"), temporary(folder, "a", pid=os.getpid())]
    assert build(killed).n_built == 0
    assert doubled(killed.root / "facts") == []
    assert not any(path.exists() for path in left)  # nobody writes facts: the process of that id is another one


def test_nothing_is_removed_while_somebody_reads_facts(killed: Site) -> None:
    left = doubled(killed.root / "facts")
    with Warehouse(killed, DAY, DAY):
        build(killed)
        read(killed)
        assert doubled(killed.root / "facts") == left
    build(killed)
    assert doubled(killed.root / "facts") == []


def test_the_newest_files_of_marts_stay_when_older_ones_go(site: Site) -> None:
    read(site)
    fresh = {p: p.read_bytes() for p in (site.root / FOLDER).rglob("*.parquet")}
    for path in fresh:
        older = path.parent / "00-fedcba9876543210.parquet"
        older.write_bytes(path.read_bytes())
        os.utime(older, ns=(0, path.stat().st_mtime_ns - 1))
    build(site)
    assert {p: p.read_bytes() for p in (site.root / FOLDER).rglob("*.parquet")} == fresh


def test_other_settings_have_other_files_and_only_one_set_of_them(site: Site) -> None:
    read(site)
    read(replace(site, timezone="Asia/Kathmandu"))
    assert doubled(site.root / FOLDER) == []


def test_temporary_files_of_pages_go_with_their_writer(tmp_path: Path) -> None:
    gone = [
        temporary(tmp_path, n) for n in ("2026-W46.html", "2026-W46-ground.json", "2026-W46-where.png", "index.html")
    ]
    stay = [temporary(tmp_path, "notes.txt")]
    with durable.temporary(tmp_path / "2026-W46.html") as (being_written, _):
        sweep_pages(tmp_path)
        assert not any(path.exists() for path in gone)
        assert all(path.exists() for path in [*stay, being_written])


def test_a_file_that_somebody_else_removes_meanwhile_stops_no_build(
    killed: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A report that ends removes replaced files while the build has their names already."""
    listed = day_files.list_parts

    def list_then_lose(*args: Any, **options: Any) -> list[Any]:
        found = list(listed(*args, **options))
        for part in found[:-1]:
            part.path.unlink(missing_ok=True)
        return found

    monkeypatch.setattr(day_files, "list_parts", list_then_lose)
    build(killed)
    assert doubled(killed.root / FOLDER) == []
