"""Removing records from the store, with a write-ahead intent so that a crash is rolled forward.

1. The intent says what to remove. It is written durably first: `store/purge/<digest>.json`.
2. Its steps are done. Each of them can be done twice.
3. The audit line is written, and the intent removed.

The next writer or reader finishes an intent that a crash left behind. Readers hold `store/.purge.lock` shared and a
removal holds it alone, so no build or report sees half a removal. Locks are always taken in this order, or two
processes could wait for each other: `.purge.lock`, `.lock`, the lock of the quarantine.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Annotated, Any

import msgspec
import pyarrow.compute as pc

from vsd_analytics.errors import StoreError, Where
from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.store import durable, file_locks, quarantine
from vsd_analytics.store.erasures import Erasure, RecordScope, lift_erasure, note_erasure
from vsd_analytics.store.imports import imports_of, note_taken_back, order_of
from vsd_analytics.store.part_files import HASH_DIFFERS, read_owned
from vsd_analytics.store.published import withdraw
from vsd_analytics.store.seals import FOLDER, Seals
from vsd_analytics.store.secrets import DayKeys
from vsd_analytics.store.undo_import import forget_repeats, replace_part, undo_import
from vsd_analytics.store.unsealing import unseal

LOCK = ".purge.lock"
AUDIT = "purge.jsonl"
WAIT_S = 600.0

_UNIT = r"/site=[a-z0-9][a-z0-9_-]{0,62}/date=\d{4}-\d{2}-\d{2}/([01]\d|2[0-3])-[0-9a-f]{16}([0-9a-f]{96})?\.parquet\Z"
# an intent may come with somebody else's project: it may name only files that a purge removes, and nothing else
PartName = Annotated[str, msgspec.Meta(pattern=rf"^store/(again/)?({'|'.join(TABLES)}){_UNIT}")]
_FACTS = r"facts(/beside/[0-9a-f]{16})?(/days|/weeks)?"
FileName = Annotated[str, msgspec.Meta(pattern=rf"^(store|store/again|{_FACTS})/[a-z][a-z0-9_]*{_UNIT}")]
SiteName = Annotated[str, msgspec.Meta(pattern=r"^[a-z0-9][a-z0-9_-]{0,62}\Z")]
Digest = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]{16}\Z")]
Hour = Annotated[int, msgspec.Meta(ge=0, le=70_389_503, description="Up to the end of the year 9999.")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Intent:
    """What a purge removes. The names of the fields are those of the file: see docs/storage.md.

    Attributes:
        site_id: The site.
        entry: The audit line.
        unlink: Files to remove whole; paths below the project folder.
        which: Records to remove from the parts `rewrite`.
        rewrite: Parts by table; paths below the project folder.
        import_id: Import whose records leave the parts `rewrite`, and the parts `repeats`.
        repeats: Parts of `store/again/` by table; paths below the project folder.
        unseal: Sealed UTC hours from whose facts the camera of `which` (None = every camera) is removed.
        forget: Site days whose keys are destroyed.
        quarantined: Hashes of the lines to remove from the quarantine, whatever file they are in by then.
        erasure: Records that must not come back.
        is_lifted: They may come back: the erasure was a mistake.
    """

    site_id: SiteName
    entry: Mapping[str, Any]
    unlink: tuple[FileName, ...] = ()
    which: RecordScope | None = None
    rewrite: Mapping[TableName, tuple[PartName, ...]] = field(default_factory=dict)
    import_id: Digest | None = None
    repeats: Mapping[TableName, tuple[PartName, ...]] = field(default_factory=dict)
    unseal: tuple[Hour, ...] = ()
    forget: tuple[date, ...] = ()
    quarantined: tuple[Digest, ...] = ()
    erasure: Erasure | None = None
    is_lifted: bool = False


@contextlib.contextmanager
def reading(store: Path, *, wait_s: float = WAIT_S) -> Iterator[None]:
    """Hold off removals while a build or report reads; finish an unfinished removal first.

    Args:
        store: The store folder. Without one, on a read-only disk or without locks, no removal is possible.
        wait_s: How long to wait for a running removal, in seconds.

    Raises:
        StoreError: E311, a removal did not end in time.
    """
    while True:
        with _held(store / LOCK, is_shared=True, wait_s=wait_s):
            if not pending(store):
                yield
                return
        complete(store, wait_s=wait_s)


@contextlib.contextmanager
def removing(store: Path, *, wait_s: float = WAIT_S, on_wait: Callable[[], None] | None = None) -> Iterator[None]:
    """Hold the locks of a store and of its quarantine alone: no reader, no fold, no replay.

    Finishes an unfinished removal first.

    Raises:
        StoreError: E311, a reader did not end in time; E130, the platform has no locks.
    """
    file_locks.require_locks(store)
    durable.make_dirs(store)
    folder = store.parent / quarantine.FOLDER
    with (
        _held(store / LOCK, is_shared=False, wait_s=wait_s, on_wait=on_wait),
        durable.exclusive(store / ".lock"),
        quarantine.locked(folder) if folder.is_dir() else contextlib.nullcontext(),
    ):
        _finish(store)
        yield


def pending(store: Path) -> list[Path]:
    """Return the intents that are not finished."""
    folder = store / "purge"
    return sorted(folder.glob("[0-9a-f]*.json")) if folder.is_dir() else []


def complete(store: Path, *, wait_s: float = WAIT_S) -> None:
    """Finish the removal that a crash interrupted, if there is one."""
    if pending(store):
        with removing(store, wait_s=wait_s):
            pass


def remove_records(store: Path, intent: Intent) -> None:
    """Do what an intent says, durably, and write the audit line; call it inside `removing`.

    A crash at any moment, followed by any writer or reader, ends the same as no crash.
    """
    data = msgspec.json.encode(intent, order="deterministic")
    # from here on the removal will happen: a crash before this line removes nothing, one after it is rolled forward
    durable.publish(store / "purge" / f"{durable.digest(data)}.json", data, is_private=True)  # a reason may name people
    _finish(store)


def _finish(store: Path) -> None:
    durable.sweep_temporaries(store / "purge")
    for path in pending(store):
        intent = _intent(path, project=store.parent)
        # The intent goes last. Until then every start repeats all steps, so each of them must change nothing when its
        # work is done already: files may be gone, lines written, keys destroyed.
        _carry_out(store, intent)
        _audit(store.parent / AUDIT, {"id": path.stem, **intent.entry})
        durable.remove(path)
        durable.fsync_dir(path.parent)


def _intent(path: Path, *, project: Path) -> Intent:
    """Return an intent that is undamaged and names only what a purge of this project may remove; else E302."""
    why = HASH_DIFFERS
    try:
        data = path.read_bytes()
        if durable.digest(data) == path.stem:
            intent = msgspec.json.decode(data, type=Intent)
            named = (*intent.rewrite.values(), *intent.repeats.values())
            names = [*intent.unlink, *(n for paths in named for n in paths)]
            away = next((n for n in names if not _is_inside(project, n)), None)
            if away is None:
                return intent
            why = f"it names a file outside the project: a folder on the way to {away} is a link"
    except msgspec.ValidationError as error:
        why = f"vsd purge does not write this, at {str(error).rpartition(' - at ')[2][:200]}"
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        why = "it is not readable JSON"
    raise StoreError(
        "the intent of a purge is damaged, or was not written by vsd purge",
        code="E302",
        where=Where(str(path)),
        why=why,
        fix="move it away, then run the same vsd purge again",
    )


def _is_inside(project: Path, name: str) -> bool:
    """Return whether a path stays below the store or facts folder; only these folders may be links themselves."""
    top = (project / Path(name).parts[0]).resolve()
    return (project / name).parent.resolve().is_relative_to(top)


def _carry_out(store: Path, intent: Intent) -> None:
    project = store.parent
    withdraw(project)
    if intent.erasure is not None:  # before records go: whatever stops this, they cannot come back
        (lift_erasure if intent.is_lifted else note_erasure)(store, intent.erasure)
    touched: set[Path] = set()
    if intent.which is not None:
        for table, names in intent.rewrite.items():
            touched |= {_rewrite_without(project / name, table, intent.which) for name in names}
        unseal(Seals(project / FOLDER, site_id=intent.site_id), intent.unseal, intent.which.camera_id)
    if intent.import_id is not None:
        touched |= _undo_import(store, intent, intent.import_id)
    if intent.forget:
        DayKeys(project / "secrets").forget(intent.forget)
    if intent.quarantined:
        gone = frozenset(intent.quarantined)
        quarantine.drop(project / quarantine.FOLDER, lambda line, _: durable.digest(line) in gone)
    for name in intent.unlink:
        durable.remove(project / name)
        touched.add((project / name).parent)
    for folder in sorted(touched):
        if folder.is_dir():
            durable.fsync_dir(folder)
            with contextlib.suppress(OSError):
                folder.rmdir()
                durable.fsync_dir(folder.parent)


def _undo_import(store: Path, intent: Intent, import_id: str) -> set[Path]:
    """Take an import back (`store.undo_import`); return the folders of the parts."""
    project, order = store.parent, order_of(imports_of(store))
    touched = {
        undo_import(store, project / name, table, import_id, order=order)
        for table, names in intent.rewrite.items()
        for name in names
    }
    touched |= {
        forget_repeats(store, project / name, table, import_id)
        for table, names in intent.repeats.items()
        for name in names
    }
    note_taken_back(store, import_id, at=str(intent.entry["at"]))
    return touched


def _rewrite_without(path: Path, table: TableName, scope: RecordScope) -> Path:
    """Replace a part by its remaining rows; return its folder."""
    if path.exists():
        rows = read_owned(path, table)
        replace_part(path, table, rows.filter(pc.invert(scope.mask(rows))))
    return path.parent


def _audit(path: Path, entry: Mapping[str, Any]) -> None:
    """Append a line unless it is there; remove a line that a crash cut off first."""
    written = path.read_bytes() if path.exists() else b""
    whole = written[: written.rfind(b"\n") + 1]
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
def _held(lock: Path, *, is_shared: bool, wait_s: float, on_wait: Callable[[], None] | None = None) -> Iterator[None]:
    fd = _lock_file(lock, is_needed=not is_shared)
    if fd is None:
        yield
        return
    try:
        _acquire(fd, lock, is_shared=is_shared, wait_s=wait_s, on_wait=on_wait)
        yield
    finally:
        os.close(fd)


def _lock_file(lock: Path, *, is_needed: bool) -> int | None:
    """Open a lock file; None where there is no store yet or the disk is read-only: nothing can be removed there."""
    if not is_needed and not file_locks.has_locks():
        return None
    try:
        return os.open(lock, os.O_RDONLY) if lock.exists() else os.open(lock, os.O_RDWR | os.O_CREAT, 0o600)
    except OSError:
        if is_needed:
            raise
        return None


def _acquire(fd: int, lock: Path, *, is_shared: bool, wait_s: float, on_wait: Callable[[], None] | None) -> None:
    until, pause_s = time.monotonic() + wait_s, 0.01
    while True:
        try:
            file_locks.take(fd, is_shared=is_shared, is_waiting=False)
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
                    fix="close open notebooks and running reports, then run the same command again",
                ) from None
            time.sleep(pause_s)
            pause_s = min(0.5, pause_s * 2)
        else:
            return
