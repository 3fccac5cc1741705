"""Parquet files of the store: how a part or a spool segment is encoded, and the engines noted in its metadata."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.schema import SCHEMAS, TableName

HASH_DIFFERS = "its bytes do not match the hash in its name: the disk or a program changed them"
"""Why a file that is named by its hash is damaged, for messages."""
ENGINES = b"vsd.engines"
ENGINES_MAX = 32
"""Engine names noted in one file: an engine that sends a new name with every message must not fill the metadata."""


def engines_of(path: Path) -> list[str]:
    """Return the engine names and versions noted in a part's or segment's metadata."""
    noted = (pq.read_metadata(path).metadata or {}).get(ENGINES)
    return [str(e) for e in json.loads(noted)] if noted else []


def segment_bytes(table: TableName, rows: pa.Table, engines: Sequence[str]) -> pa.Buffer:
    """Return the bytes of a spool segment: fast to write, since the next fold reads it once and removes it."""
    return parquet_bytes(_with_engines(table, rows, engines), compression="lz4")


def part_bytes(table: TableName, rows: pa.Table, engines: Sequence[str]) -> pa.Buffer:
    """Return the bytes of a part: zstd, dictionary for ids and millimetres, delta coding for time, page checksums."""
    names = [f.name for f in SCHEMAS[table] if pa.types.is_string(f.type) or f.name.endswith(("_mm", "_px"))]
    return parquet_bytes(
        _with_engines(table, rows, engines),
        compression="zstd",
        compression_level=3,
        row_group_size=1_000_000,
        write_page_checksum=True,
        use_dictionary=names,
        column_encoding={"ts": "DELTA_BINARY_PACKED"},
    )


def read_part(path: Path, table: TableName) -> pa.Table:
    """Return the rows of a part in today's schema; columns that are newer than the part are null."""
    with pq.ParquetFile(path, page_checksum_verification=True) as file:
        rows = file.read()
    for column in SCHEMAS[table]:
        if column.name not in rows.column_names:
            rows = rows.append_column(column, pa.nulls(rows.num_rows, column.type))
    return rows.select(SCHEMAS[table].names).cast(SCHEMAS[table])


def parquet_bytes(rows: pa.Table, **options: object) -> pa.Buffer:
    """Return rows as a Parquet file in memory, so that its name can be the hash of its bytes."""
    sink = pa.BufferOutputStream()
    pq.write_table(rows, sink, **options)
    return sink.getvalue()


def _with_engines(table: TableName, rows: pa.Table, engines: Sequence[str]) -> pa.Table:
    """Return rows in the schema of their table, with the engines noted in its metadata."""
    schema = SCHEMAS[table].with_metadata({ENGINES: json.dumps(list(engines)[:ENGINES_MAX]).encode()})
    return rows.select(schema.names).cast(schema)
