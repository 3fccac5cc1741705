"""Taking records out of a store in which nothing is ever replaced: by intent, so that a crash is rolled forward.

What shall go is written down durably first (`store/purge/<digest>.json`); then it is done; then the audit line is
written and the intent removed. Whoever comes next, writer or reader, finishes an intent that a crash left behind. Each
step can be done twice. Readers hold `store/.purge.lock` shared and the removal holds it alone, so that no build or
report sees half of it. Locks are always taken in this order: `.purge.lock`, then `.lock`.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import date
from pathlib import Path
from typing import Any

import msgspec
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.errors import StoreError, Where
from vsd_analytics.schema import SCHEMAS, TableName
from vsd_analytics.store import durable
from vsd_analytics.store.seals import FOLDER, Seals, UnitSeal
from vsd_analytics.store.secrets import DayKeys
from vsd_analytics.store.store import engines_of, part_bytes

LOCK = ".purge.lock"
AUDIT = "purge.jsonl"
WAIT_S = 600.0


@dataclass(frozen=True, slots=True)
class Which:
    """Records of one camera, or of all, in [first_ms, after_ms)."""

    camera_id: str | None
    first_ms: int
    after_ms: int

    def mask(self, rows: pa.Table) -> pa.ChunkedArray:
        """Return which rows of a stored table are meant."""
        ts = rows["ts"].cast(pa.int64())
        inside = pc.and_(pc.greater_equal(ts, self.first_ms), pc.less(ts, self.after_ms))
        return inside if self.camera_id is None else pc.and_(inside, pc.equal(rows["camera_id"], self.camera_id))


@dataclass(frozen=True, slots=True, kw_only=True)
class Intent:
    """What shall go.

    Attributes:
        site_id: The site.
        entry: The audit line.
        unlink: Files that go whole; paths below the project folder.
        which: Records that go out of the parts `rewrite`.
        rewrite: Parts by table; paths below the project folder.
        unseal: Sealed UTC hours out of whose facts the camera of `which` (or everybody) goes.
        forget: Site days (ISO) whose keys are destroyed.
    """

    site_id: str
    entry: Mapping[str, Any]
    unlink: tuple[str, ...] = ()
    which: Which | None = None
    rewrite: Mapping[TableName, tuple[str, ...]] = field(default_factory=dict)
    unseal: tuple[int, ...] = ()
    forget: tuple[str, ...] = ()


@contextlib.contextmanager
def reading(store: Path, *, wait_s: float = WAIT_S) -> Iterator[None]:
    """Keep removals away while a build or report reads; an unfinished removal is finished first.

    Args:
        store: The store folder. Without one, or on a disk that can only be read, there is nothing to keep away.
        wait_s: How long to wait for a removal at work.

    Raises:
        StoreError: E311, a removal did not end in time.
    """
    while True:
        with _held(store / LOCK, fcntl.LOCK_SH, wait_s=wait_s):
            if not pending(store):
                yield
                return
        complete(store, wait_s=wait_s)


@contextlib.contextmanager
def removing(store: Path, *, wait_s: float = WAIT_S, on_wait: Callable[[], None] | None = None) -> Iterator[None]:
    """Hold both locks of a store alone: no reader, no other writer; an unfinished removal is finished first.

    Raises:
        StoreError: E311, somebody read on and on.
    """
    durable.make_dirs(store)
    with _held(store / LOCK, fcntl.LOCK_EX, wait_s=wait_s, on_wait=on_wait), durable.exclusive(store / ".lock"):
        _finish(store)
        yield


def pending(store: Path) -> list[Path]:
    """Return the intents that are not finished."""
    folder = store / "purge"
    return sorted(folder.glob("[0-9a-f]*.json")) if folder.is_dir() else []


def complete(store: Path, *, wait_s: float = WAIT_S) -> None:
    """Finish what a crash left behind, if anything."""
    if pending(store):
        with removing(store, wait_s=wait_s):
            pass


def remove_records(store: Path, intent: Intent) -> None:
    """Do what an intent says, durably, and write the audit line; call it inside `removing`.

    After this was called for the first time a crash at any moment, followed by any writer or reader, ends the same.
    """
    data = msgspec.json.encode(intent, order="deterministic")
    durable.publish(store / "purge" / f"{durable.digest(data)}.json", data)
    _finish(store)


def _finish(store: Path) -> None:
    durable.sweep_temporaries(store / "purge")
    for path in pending(store):
        try:
            intent = msgspec.json.decode(path.read_bytes(), type=Intent)
        except (msgspec.DecodeError, UnicodeDecodeError):
            intent = None
        if intent is None or durable.file_digest(path) != path.stem:
            raise StoreError(
                "a note of records that shall be removed is damaged",
                code="E302",
                where=Where(str(path)),
                why="its bytes are not those whose hash stands in its name: the disk or a program changed them",
                mend="move it away, then run the same vsd purge again",
            )
        _carry_out(store, intent)
        _audit(store.parent / AUDIT, {"id": path.stem, **intent.entry})
        durable.remove(path)
        durable.fsync_dir(path.parent)


def _carry_out(store: Path, intent: Intent) -> None:
    project = store.parent
    touched: set[Path] = set()
    if intent.which is not None:
        for table, names in intent.rewrite.items():
            for name in names:
                touched.add(_without(project / name, table, intent.which))
        _unseal(Seals(project / FOLDER, site_id=intent.site_id), intent)
    if intent.forget:
        DayKeys(project / "secrets").forget(date.fromisoformat(d) for d in intent.forget)
    for name in intent.unlink:
        durable.remove(project / name)
        touched.add((project / name).parent)
    for folder in sorted(touched):
        if folder.is_dir():
            durable.fsync_dir(folder)
            with contextlib.suppress(OSError):
                folder.rmdir()
                durable.fsync_dir(folder.parent)


def _without(path: Path, table: TableName, which: Which) -> Path:
    """Put what remains of a part in its place, then under its own name; return its folder.

    Each step is one rename, so that not even a plain glob sees a record twice or misses one that stays.
    """
    if path.exists():
        rows = read_part(path, table)
        rest = rows.filter(pc.invert(which.mask(rows)))
        if rest.num_rows:
            data = part_bytes(table, rest, engines_of(path))
            durable.publish(path, data)
            path.rename(path.parent / f"{path.name[:2]}-{durable.digest(data)}.parquet")
        else:
            durable.remove(path)
    return path.parent


def read_part(path: Path, table: TableName) -> pa.Table:
    """Return the rows of a part in the schema of today; columns it was written before are null."""
    with pq.ParquetFile(path, page_checksum_verification=True) as file:
        rows = file.read()
    for column in SCHEMAS[table]:
        if column.name not in rows.column_names:
            rows = rows.append_column(column, pa.nulls(rows.num_rows, column.type))
    return rows.select(SCHEMAS[table].names).cast(SCHEMAS[table])


def rows_meant(path: Path, which: Which) -> int:
    """Return how many records of a part are meant."""
    with pq.ParquetFile(path) as file:
        return int(pc.sum(which.mask(file.read(columns=["camera_id", "ts"]))).as_py() or 0)


def _unseal(seals: Seals, intent: Intent) -> None:
    """Take a camera, or all, out of sealed facts and seal what remains."""
    assert intent.which is not None
    camera_id = intent.which.camera_id
    days = sorted({h // 24 for h in intent.unseal})
    for day in days:
        seal = seals.read(day)
        if seal is None:
            continue
        hours = {
            h: _reduced(seals, h, unit, camera_id) if h in intent.unseal else unit for h, unit in seal.hours.items()
        }
        whole_day = seal.camera_days
        left = {c for unit in hours.values() for c in unit.last_ms}
        if whole_day is not None and (camera_id is None or camera_id not in left):
            whole_day = _reduced(seals, day * 24, whole_day, camera_id)
        seals.write(replace(seal, hours=hours, camera_days=whole_day))
    seals.sweep(days)


def _reduced(seals: Seals, hour: int, unit: UnitSeal, camera_id: str | None) -> UnitSeal:
    facts = {}
    for relation, digest in unit.facts.items():
        data = seals.fact_path(relation, hour, digest).read_bytes()
        rows = pq.read_table(pa.BufferReader(data))
        rest = rows if camera_id is not None else rows.slice(0, 0)
        for name in (n for n in rows.column_names if n.endswith("camera_id")):  # a row may tell of two cameras
            rest = rest.filter(pc.not_equal(rest[name], camera_id)) if camera_id is not None else rest
        if rest.num_rows < rows.num_rows:
            sink = pa.BufferOutputStream()
            rest = rest.combine_chunks().replace_schema_metadata(None)  # their causes stand in the seal
            pq.write_table(rest, sink, compression="zstd", write_page_checksum=True)
            data = sink.getvalue().to_pybytes()
        facts[relation] = seals.put(relation, hour, data)
    last_ms = {c: ms for c, ms in unit.last_ms.items() if camera_id is not None and c != camera_id}
    return replace(unit, facts=facts, last_ms=last_ms)


def _audit(path: Path, entry: Mapping[str, Any]) -> None:
    """Append a line unless it is there; a line that a crash cut off goes first."""
    told = path.read_bytes() if path.exists() else b""
    whole = told[: told.rfind(b"\n") + 1]
    mark = f'"id":"{entry["id"]}"'.encode()
    line = b"" if any(mark in old for old in whole.splitlines()) else msgspec.json.encode(entry) + b"\n"
    with path.open("r+b" if path.exists() else "wb") as file:
        os.fchmod(file.fileno(), 0o600)
        file.truncate(len(whole))
        file.seek(len(whole))
        file.write(line)
        file.flush()
        os.fsync(file.fileno())
    durable.fsync_dir(path.parent)


@contextlib.contextmanager
def _held(lock: Path, kind: int, *, wait_s: float, on_wait: Callable[[], None] | None = None) -> Iterator[None]:
    fd = _lock_file(lock, is_needed=kind == fcntl.LOCK_EX)
    if fd is None:
        yield
        return
    try:
        _acquire(fd, lock, kind, wait_s=wait_s, on_wait=on_wait)
        yield
    finally:
        os.close(fd)


def _lock_file(lock: Path, *, is_needed: bool) -> int | None:
    """Open a lock; None where there is no store yet or the disk can only be read: nobody removes anything there."""
    try:
        return os.open(lock, os.O_RDONLY) if lock.exists() else os.open(lock, os.O_RDWR | os.O_CREAT, 0o600)
    except OSError:
        if is_needed:
            raise
        return None


def _acquire(fd: int, lock: Path, kind: int, *, wait_s: float, on_wait: Callable[[], None] | None) -> None:
    until, pause_s = time.monotonic() + wait_s, 0.01
    while True:
        try:
            fcntl.flock(fd, kind | fcntl.LOCK_NB)
        except BlockingIOError:
            if on_wait is not None:
                on_wait()
                on_wait = None
            if time.monotonic() >= until:
                raise StoreError(
                    "the store is in use",
                    code="E311",
                    where=Where(str(lock)),
                    why=f"a report or query that reads it, or a removal, did not end within {wait_s:g} s",
                    mend="close notebooks and reports at work, then run the same command again",
                ) from None
            time.sleep(pause_s)
            pause_s = min(0.5, pause_s * 2)
        else:
            return
