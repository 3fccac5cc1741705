"""Crashes, two processes at once, full disks: the table comes out the same."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from stored_rows import HOUR, NINE, frame, part_names, person, stored, table

from vsd_analytics.store import Counts, Store, durable

_APPEND = """
import os, sys
from pathlib import Path
sys.path.insert(0, {here!r})
from stored_rows import *
from vsd_analytics.store import Store, durable, store as module
store = Store(Path(sys.argv[1]), site_id="shop")
"""

_DIE = """
left = int(sys.argv[2])
def dying(path, data, real=durable.publish):
    global left
    left -= 1
    if left < 0:
        durable.make_dirs(path.parent)
        (path.parent / f".{path.name}.{os.getpid()}.tmp").write_bytes(bytes(data)[:10])
        os._exit(9)
    real(path, data)
durable.publish = dying
"""

_DIE_REMOVING = """
left = int(sys.argv[2])
def dying(path, real=durable.remove):
    global left
    left -= 1
    if left < 0:
        os._exit(9)
    real(path)
durable.remove = dying
"""

_FOLD = "store.fold()\n"

_WRITE_AND_FOLD = """
first = int(sys.argv[2])
for k in range(first, first + 12):
    store.append("observations", table("observations", [person(NINE + 100 * (k + j)) for j in range(10)]))
    if k % 3 == 0:
        store.fold()
store.fold()
"""


def _python(code: str, *arguments: object) -> subprocess.Popen[bytes]:
    text = _APPEND.format(here=str(Path(__file__).parent)) + code
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    return subprocess.Popen([sys.executable, "-c", text, *map(str, arguments)], env=environment)


def _fill(root: Path) -> Store:
    store = Store(root, site_id="shop")
    for hour in range(3):
        rows = [person(NINE + hour * HOUR + k, track=str(k % 7)) for k in range(40)]
        store.append("observations", table("observations", rows))
        store.append("frames", table("frames", [frame(NINE + hour * HOUR + k) for k in range(40)]))
    return store


@pytest.fixture(scope="module")
def unharmed(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    root = tmp_path_factory.mktemp("unharmed")
    _fill(root).fold()
    return part_names(root)


@pytest.mark.parametrize(("dying", "after"), [(_DIE, 0), (_DIE, 2), (_DIE, 4), (_DIE, 5), (_DIE_REMOVING, 1)])
def test_killed_in_mid_fold_and_run_again_is_the_same_table(
    tmp_path: Path, unharmed: list[str], dying: str, after: int
) -> None:
    store = _fill(tmp_path)
    process = _python(dying + _FOLD, tmp_path, after)
    assert process.wait() == 9
    assert set(part_names(tmp_path)) <= set(unharmed)
    assert store.damaged() == []
    store.fold()
    assert part_names(tmp_path) == unharmed
    assert list(tmp_path.rglob("*.tmp")) == []
    assert store.n_spooled() == 0


def test_two_processes_that_append_and_fold_at_once_store_each_record_once(tmp_path: Path) -> None:
    processes = [_python(_WRITE_AND_FOLD, tmp_path, first) for first in (0, 6)]
    assert [p.wait() for p in processes] == [0, 0]
    instants = [r["ts"] for r in stored(tmp_path)["observations"]]
    assert len(instants) == len(set(instants)) == 6 + 12 + 9
    assert Store(tmp_path, site_id="shop").damaged() == []


def test_litter_of_dead_processes_is_swept_and_of_live_ones_kept(tmp_path: Path) -> None:
    dead = _python("", tmp_path)
    dead.wait()
    folder = tmp_path / "observations" / "site=shop"
    folder.mkdir(parents=True)
    swept = folder / f".a.parquet.{dead.pid}.tmp"
    kept = [folder / f".b.parquet.{os.getpid()}.tmp", folder / f"visible.{dead.pid}.tmp", folder / ".x.tmp"]
    for path in (swept, *kept):
        path.write_bytes(b"half")
    Store(tmp_path, site_id="shop").fold()
    assert not swept.exists()
    assert all(path.exists() for path in kept)


def test_a_disk_that_refuses_leaves_nothing_half_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path, site_id="shop")

    def refuse(fd: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", refuse)
        with pytest.raises(OSError, match="No space"):
            durable.publish(tmp_path / "part.parquet", b"data")
    assert list(tmp_path.iterdir()) == []
    store.append("frames", table("frames", [frame()]))
    assert store.fold().tables["frames"] == Counts(1, 0, 0)


def test_published_bytes_are_whole_and_folders_are_private(tmp_path: Path) -> None:
    durable.publish(tmp_path / "a" / "b" / "c.bin", b"x" * 100_000)
    assert (tmp_path / "a" / "b" / "c.bin").read_bytes() == b"x" * 100_000
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o700
    assert [p.name for p in (tmp_path / "a" / "b").iterdir()] == ["c.bin"]
