"""Runs one damaged input and says what became of it; what is not meant to come out is raised."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from unittest import mock

import pyarrow as pa
import pyarrow.compute as pc
from fuzz_worlds import CONFIG, World

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.formats.frames import MessageRows
from vsd_analytics.ingest.intake import pipeline
from vsd_analytics.ingest.intake.normalise import Normaliser
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.schema import SCHEMAS, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store.layout import Part
from vsd_analytics.store.secrets import DayKeys
from vsd_analytics.store.store import FoldResult

NOW = datetime(2026, 11, 20, tzinfo=UTC)
LIMIT_S = 5.0
Kept = Counter[tuple[Any, ...]]


class HangError(BaseException):
    """An input took longer than `LIMIT_S`; no handler of the code under test catches it."""


class WrongRowsError(AssertionError):
    """Rows were stored that must not be, or rows are missing that must be there."""


@dataclass(frozen=True)
class Outcome:
    """What became of an input.

    Attributes:
        word: "clean", "quarantined" or "refused".
        code: Code of the refusal, else "".
        rows: Stored rows by table and values.
        took_s: Wall time.
    """

    word: str
    code: str
    rows: Kept
    took_s: float


class MemoryStore:
    """Takes the place of the store: checks rows as `Store.append` does and keeps them."""

    tables: list[tuple[TableName, pa.Table]]

    def __init__(self, root: Path, **more: object) -> None:
        self.root = root
        self.tables = []
        MemoryStore.last = self

    last: MemoryStore | None = None
    """The store that was written to last, or made last where none was."""

    def parts(self, table: TableName, **hours: int) -> list[Part]:
        """Return no part: nothing was stored before."""
        return []

    def days(self) -> set[int]:
        """Return no day: nothing was stored before."""
        return set()

    def append(self, table: TableName, rows: pa.Table, *, engines: Sequence[str] = (), import_id: str = "") -> int:
        """Keep rows in the stored schema."""
        MemoryStore.last = self
        self.tables.append((table, rows.select(SCHEMAS[table].names).cast(SCHEMAS[table])))
        "".join([*engines, import_id]).encode()
        return int(rows.num_rows)

    def fold(self, **more: object) -> FoldResult:
        """Do nothing."""
        return FoldResult()


class Judge:
    """Runs inputs in one folder.

    Args:
        folder: Where the project and the inputs are written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "vsd.toml").write_text(CONFIG)
        self.site: Site = load_site(folder)
        self._keys = DayKeys(folder / "secrets")

    def file(self, world: World, data: bytes, *, name: str | None = None, **options: Any) -> Outcome:
        """Ingest bytes as the file of a world."""
        path = self.folder / (name or world.file)
        path.write_bytes(data)
        try:
            return self.path(path, IngestOptions(**{**world.options, **options}), world.ignored)
        finally:
            path.unlink()

    def folder_of(self, world: World, files: dict[str, bytes]) -> Outcome:
        """Ingest members written into a folder; names that leave it are left out."""
        root = self.folder / world.file
        try:
            for name, data in files.items():
                path = (root / name.replace("\x00", "")).resolve()
                if path.is_relative_to(root) and path != root:
                    with contextlib.suppress(OSError):
                        path.parent.mkdir(parents=True, exist_ok=True)
                        path.write_bytes(data)
            return self.path(root, IngestOptions(**world.options), world.ignored)
        finally:
            shutil.rmtree(root, ignore_errors=True)

    def path(self, path: Path, options: IngestOptions, ignored: frozenset[str] = frozenset()) -> Outcome:
        """Ingest a path."""
        with limited() as took, mock.patch.object(pipeline, "Store", MemoryStore), _unsynced():
            try:
                result = pipeline.ingest(self.site, [path], options, now=NOW)
            except VsdError as error:
                return Outcome("refused", error.code, Counter(), took())
            source = result.sources[0]
        for left in ("quarantine", "store"):  # an input is the first of its project: notes of others go
            shutil.rmtree(self.folder / left, ignore_errors=True)
        store = MemoryStore.last
        assert store is not None
        rows = self._rows(store.tables, ignored)
        if sum(rows.values()) != sum(source.n_records.values()):
            raise WrongRowsError("counts differ from what was stored")
        if source.error is not None:
            return Outcome("refused", source.error.code, rows, took())
        return Outcome("quarantined" if result.n_rejected else "clean", "", rows, took())

    def payloads(self, payloads: Sequence[bytes], ignored: frozenset[str] = frozenset()) -> Outcome:
        """Decode and normalise messages as the listener does."""
        with limited() as took:
            rows = MessageRows(pipeline.with_site(self.site, IngestOptions()))
            for number, payload in enumerate(payloads, 1):
                rows.add(number, payload)
            clean = Normaliser(self.site, now=NOW, keys=self._keys).normalise(rows.batch(0))
        kept = self._rows([(n, t.select(SCHEMAS[n].names).cast(SCHEMAS[n])) for n, t in clean.tables.items()], ignored)
        return Outcome("quarantined" if clean.rejected else "clean", "", kept, took())

    def config(self, data: bytes) -> Outcome:
        """Load bytes as vsd.toml."""
        folder = self.folder / "other"
        folder.mkdir(exist_ok=True)
        (folder / "vsd.toml").write_bytes(data)
        with limited() as took:
            try:
                load_site(folder)
            except VsdError as error:
                return Outcome("refused", error.code, Counter(), took())
        return Outcome("clean", "", Counter(), took())

    def _rows(self, tables: Sequence[tuple[TableName, pa.Table]], ignored: frozenset[str]) -> Kept:
        """Return rows by value, after a look at whether any of them should not be stored."""
        kept: Kept = Counter()
        limit_mm = self.site.settings.coordinate_max_m * 1000
        known = {c.camera_id for c in self.site.cameras}
        for name, table in tables:
            for column in table.schema:
                values = table[column.name]
                if not column.nullable and values.null_count:
                    raise WrongRowsError(f"{name}.{column.name} is null")
                if column.name.endswith("_mm") and (pc.max(pc.abs(values)).as_py() or 0) > limit_mm:
                    raise WrongRowsError(f"{name}.{column.name} is out of range")
                if column.name.endswith("_px") and not pc.all(pc.is_finite(values)).as_py() and values.null_count == 0:
                    raise WrongRowsError(f"{name}.{column.name} is not finite")
            if set(table["camera_id"].to_pylist()) - known:
                raise WrongRowsError(f"{name} has an unknown camera")
            years = pc.unique(pc.year(table["ts"])).to_pylist()
            if years and not 1990 <= min(years) <= max(years) <= NOW.year:
                raise WrongRowsError(f"{name}.ts is out of range")
            shown = [c for c in table.column_names if c not in ignored]
            columns = [table[c].cast(pa.int64()).to_pylist() if c == "ts" else table[c].to_pylist() for c in shown]
            kept.update((name, *row) for row in zip(*columns, strict=True))
        return kept


@contextlib.contextmanager
def limited(limit_s: float = LIMIT_S) -> Iterator[Any]:
    """Raise `HangError` when the block takes longer than `limit_s`; yields the stopwatch."""

    def stop(*signal_and_frame: object) -> None:
        raise HangError(f"longer than {limit_s:g} s")

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, limit_s)
    start = time.perf_counter()
    try:
        yield lambda: time.perf_counter() - start
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


@contextlib.contextmanager
def _unsynced() -> Iterator[None]:
    """Do not wait for the disk: what is durable when is proved elsewhere."""
    with mock.patch.object(os, "fsync", return_value=None):
        yield
