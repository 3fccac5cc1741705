"""Crashes, two processes at once, full disks: the table comes out the same."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from stored_rows import HOUR, NINE, frame, part_names, person, stored, table

from vsd_analytics.errors import DiskError
from vsd_analytics.store import durable
from vsd_analytics.store.store import Store, TableCounts

_APPEND = """
import os, sys
from pathlib import Path
sys.path.insert(0, {here!r})
from stored_rows import *
from vsd_analytics.store import durable, store as module
from vsd_analytics.store.store import Store
store = Store(Path(sys.argv[1]), site_id="shop")
"""

_DIE = """
left = int(sys.argv[2])
def dying(path, data, real=durable.publish):
    global left
    left -= 1
    if left < 0:
        durable.make_dirs(path.parent)
        with durable.temporary(path) as (_, f):
            f.write(bytes(data)[:10])
            f.flush()
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
for k in range(first, first + 6):
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
    processes = [_python(_WRITE_AND_FOLD, tmp_path, first) for first in (0, 3)]
    assert [p.wait() for p in processes] == [0, 0]
    instants = [r["ts"] for r in stored(tmp_path)["observations"]]
    assert len(instants) == len(set(instants)) == 3 + 6 + 9
    assert Store(tmp_path, site_id="shop").damaged() == []


_WRITE_AND_WAIT = """
with durable.temporary(Path(sys.argv[1]) / "b.parquet") as (name, f):
    print(name, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def elsewhere(tmp_path: Path) -> Iterator[Path]:
    """A temporary file that a live process writes; this process cannot see it by its id, as in another container."""
    text = _APPEND.format(here=str(Path(__file__).parent)) + _WRITE_AND_WAIT
    writer = subprocess.Popen([sys.executable, "-c", text, tmp_path], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert writer.stdout is not None
    yield Path(writer.stdout.readline().decode().strip())
    writer.communicate()


def test_litter_of_dead_processes_is_swept_and_files_of_live_ones_are_not(
    tmp_path: Path, elsewhere: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_such_process(_pid: int, _signal: int) -> None:
        raise ProcessLookupError

    monkeypatch.setattr(os, "kill", no_such_process)
    swept = [tmp_path / f".a.parquet.{'0' * 16}.tmp", tmp_path / ".of version 0.1.4194999.tmp"]
    left = [elsewhere, tmp_path / "visible.4194999.tmp", tmp_path / ".x.tmp", tmp_path / ".y.parquet.other.tmp"]
    for path in (*swept, *left[1:]):
        path.write_bytes(b"half")
    with durable.temporary(tmp_path / "c.parquet") as (own, _):
        Store(tmp_path, site_id="shop").fold()
        assert all(path.exists() for path in [*left, own])
    assert not any(path.exists() for path in [*swept, own])


def test_two_containers_with_one_process_id_do_not_write_into_each_others_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "getpid", lambda: 1)
    path, real = tmp_path / "part.parquet", os.fsync

    def fsync(fd: int) -> None:
        real(fd)
        monkeypatch.setattr(os, "fsync", refuse)
        with pytest.raises(DiskError):  # in the other container, whose disk is full
            durable.publish(path, b"B")
        monkeypatch.setattr(os, "fsync", real)

    monkeypatch.setattr(os, "fsync", fsync)
    durable.publish(path, b"AAAA")
    assert path.read_bytes() == b"AAAA"
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_a_new_file_that_was_swept_before_it_was_locked_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, swept = fcntl.flock, []

    def flock(file: Any, operation: int) -> None:
        if not swept and operation == fcntl.LOCK_EX:
            swept.append(durable.sweep_temporaries(tmp_path))
        real(file, operation)

    monkeypatch.setattr(fcntl, "flock", flock)
    durable.publish(tmp_path / "part.parquet", b"data")
    assert swept == [1]
    assert (tmp_path / "part.parquet").read_bytes() == b"data"


def refuse(_fd: int) -> None:
    raise OSError(28, "No space left on device")


def test_a_disk_that_refuses_leaves_nothing_half_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store(tmp_path, site_id="shop")

    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", refuse)
        with pytest.raises(OSError, match="No space"):
            durable.publish(tmp_path / "part.parquet", b"data")
    assert list(tmp_path.iterdir()) == []
    store.append("frames", table("frames", [frame()]))
    assert store.fold().tables["frames"] == TableCounts(1, 0, 0)


def test_published_bytes_are_whole_and_folders_are_private(tmp_path: Path) -> None:
    durable.publish(tmp_path / "a" / "b" / "c.bin", b"x" * 100_000)
    assert (tmp_path / "a" / "b" / "c.bin").read_bytes() == b"x" * 100_000
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o700
    assert [p.name for p in (tmp_path / "a" / "b").iterdir()] == ["c.bin"]
