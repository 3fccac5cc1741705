"""Reading small texts with an adapter, and a small site, for the tests in this folder."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyarrow as pa

from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.formats.frames import Frames
from vsd_analytics.ingest.formats.tables import Tables
from vsd_analytics.ingest.reading.adapter import Adapter, IngestOptions, RawBatch, Rejected, Source
from vsd_analytics.schema import RAW_SCHEMAS, TABLES, TableName
from vsd_analytics.site.model import Camera, Floor, Site

NOW = datetime(2026, 11, 20, tzinfo=UTC)
NINE_MS = int(datetime(2026, 11, 9, 9, tzinfo=UTC).timestamp() * 1000)


@dataclass
class Reading:
    tables: dict[TableName, list[dict[str, Any]]] = field(default_factory=dict)
    rejected: list[Rejected] = field(default_factory=list)
    dropped: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)
    engines: set[str] = field(default_factory=set)
    error: VsdError | None = None
    batches: list[RawBatch] = field(default_factory=list)

    @property
    def reasons(self) -> dict[int, str]:
        return {r.line: r.reason for r in self.rejected}

    @property
    def people(self) -> list[dict[str, Any]]:
        return self.tables["observations"]

    def column(self, name: str, table: TableName = "observations") -> list[Any]:
        return [row[name] for row in self.tables[table]]


def read(adapter: Adapter, path: Path, options: IngestOptions | None = None) -> Reading:
    """Read a file to its end or to its VsdError; any other error is the test's failure."""
    reading = Reading()
    try:
        for batch in adapter.read(Source(path), options or IngestOptions()):
            reading.batches.append(batch)
            reading.rejected += batch.rejected
            reading.dropped.update(batch.n_dropped)
            reading.notes += batch.notes
            reading.engines |= set(batch.engines)
    except VsdError as error:
        reading.error = error
    for name in TABLES:
        tables = [b.table(name) for b in reading.batches]
        assert all(t.schema == RAW_SCHEMAS[name] for t in tables)
        reading.tables[name] = pa.concat_tables([RAW_SCHEMAS[name].empty_table(), *tables]).to_pylist()
    return reading


def read_frames(path: Path, content: bytes | str, options: IngestOptions | None = None) -> Reading:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read(Frames(), path, options)


def read_table(path: Path, content: bytes | str, options: IngestOptions | None = None) -> Reading:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read(Tables(), path, options or IngestOptions(camera="cam-1"))


def small_site(root: Path, **changes: Any) -> Site:
    cameras = (
        Camera("cam-1", "Entrance", "ground", engine_ids=("left", "7")),
        Camera("cam-2", "Exit", "ground", clock="Asia/Tokyo"),
    )
    arguments = {"floors": (Floor("ground", "Ground"),), "cameras": cameras, **changes}
    return Site("shop", "Shop", "Europe/Rome", root, **arguments)
