"""Erasures: records that were deleted on request, and must not come back by any way.

`store/erasures.json` lists camera, time, and a hash of the reason, and nothing about anybody. Records of such a scope
are dropped before they are stored, quarantined or fetched. They do not go to quarantine, since that would keep them.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.errors import StoreError, Where
from vsd_analytics.store import durable

FILE = "erasures.json"
ERASED = "erased on request"
"""Reason of records that are left out because of an erasure."""
Instant = Annotated[int, msgspec.Meta(ge=-(2**53), le=2**53)]


@dataclass(frozen=True, slots=True)
class RecordScope:
    """Records of one camera (None = all) in [first_ms, after_ms), UTC milliseconds."""

    camera_id: str | None
    first_ms: Instant
    after_ms: Instant

    def mask(self, rows: pa.Table) -> pa.ChunkedArray:
        """Return which rows of a stored table, or of a raw one with `ts_ms`, are in scope."""
        ts = rows["ts_ms"] if "ts_ms" in rows.column_names else rows["ts"].cast(pa.int64())
        inside = pc.and_(pc.greater_equal(ts, self.first_ms), pc.less(ts, self.after_ms))
        if self.camera_id is not None:
            inside = pc.and_(inside, pc.equal(rows["camera_id"].cast(pa.string()), self.camera_id))
        return pc.fill_null(inside, False)


@dataclass(frozen=True, slots=True)
class Erasure:
    """One erasure.

    Attributes:
        which: The records.
        reason: `reason_hash` of why.
    """

    which: RecordScope
    reason: str


def reason_hash(reason: str) -> str:
    """Return a hash of a reason: whoever knows the reason finds its erasure, and the file tells nothing."""
    return durable.digest(reason.strip().encode())


def erasures(store: Path) -> tuple[Erasure, ...]:
    """Return the erasures of a store.

    Raises:
        StoreError: E302, their file is damaged: what was erased could come back.
    """
    path = store / FILE
    try:
        return msgspec.json.decode(path.read_bytes(), type=tuple[Erasure, ...])
    except FileNotFoundError:
        return ()
    except (msgspec.DecodeError, UnicodeDecodeError):
        raise StoreError(
            "the list of erasures is damaged",
            code="E302",
            where=Where(str(path)),
            why="without it, records that were deleted on request could be stored again",
            fix="restore it from a backup, or move it away and repeat the purges that purge.jsonl lists with a reason",
        ) from None


def note_erasure(store: Path, erasure: Erasure) -> None:
    """Note an erasure, durably; a second time changes nothing."""
    _replace(store, {*erasures(store), erasure})


def lift_erasure(store: Path, erasure: Erasure) -> None:
    """Remove an erasure from the list, durably; a second time changes nothing."""
    known = erasures(store)
    if erasure in known:
        _replace(store, (each for each in known if each != erasure))


def _replace(store: Path, every: Iterable[Erasure]) -> None:
    def order(erasure: Erasure) -> tuple[str, int, int, str]:
        which = erasure.which
        return which.camera_id or "", which.first_ms, which.after_ms, erasure.reason

    durable.publish(store / FILE, msgspec.json.encode(sorted(every, key=order)), is_private=True)


def are_erased(rows: pa.Table, every: Iterable[Erasure]) -> pa.Array:
    """Return which rows of a stored table, or of a raw one with `ts_ms`, were erased."""
    is_erased = np.zeros(rows.num_rows, dtype=np.bool_)
    for erasure in every:
        is_erased |= erasure.which.mask(rows).to_numpy(zero_copy_only=False)
    return pa.array(is_erased)


def notes_of_erased(n_dropped: Mapping[str, int]) -> list[str]:
    """Return a warning (W312) where a source brought erased records again, by what was dropped of it."""
    n = n_dropped.get(ERASED, 0)
    return (
        [
            f"W312: {n:,} of its records were {ERASED} before, and are not stored again; if that was a mistake, repeat "
            "that vsd purge with --lift, and import again"
        ]
        if n
        else []
    )


def rows_in_scope(path: Path, scope: RecordScope) -> int:
    """Return how many records of a part are in scope."""
    with pq.ParquetFile(path) as file:
        return int(pc.sum(scope.mask(file.read(columns=["camera_id", "ts"]))).as_py() or 0)


class KnownErasures:
    """The erasures of a store, read again whenever their file has changed.

    Args:
        store: The store folder.
    """

    def __init__(self, store: Path) -> None:
        self._store = store
        self._stat: tuple[int, int] | None = None
        self.every: tuple[Erasure, ...] = ()

    def refresh(self) -> None:
        """Read them again if they have changed since the last call."""
        stat: tuple[int, int] | None = None
        with contextlib.suppress(OSError):
            file_stat = (self._store / FILE).stat()
            stat = (file_stat.st_mtime_ns, file_stat.st_ino)
        if stat != self._stat:
            self.every, self._stat = erasures(self._store), stat
