"""Parquet files of the store: how a part or a spool segment is encoded, and the engines noted in its metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.schema import SCHEMAS, TableName
from vsd_analytics.store.owners import OWNER, OWNERS, owners_of, without_owners

HASH_DIFFERS = "its bytes do not match the hash in its name: the disk or a program changed them"
"""Why a file that is named by its hash is damaged, for messages."""
ENGINES = b"vsd.engines"
ENGINES_MAX = 32
"""Engine names noted in one file: an engine that sends a new name with every message must not fill the metadata."""


def engines_of(path: Path) -> list[str]:
    """Return the engine names and versions noted in a part's or segment's metadata."""
    return engines_in(pq.read_metadata(path).metadata)


def engines_in(metadata: Mapping[bytes, bytes] | None) -> list[str]:
    """Return the engine names and versions noted in a file's metadata."""
    noted = (metadata or {}).get(ENGINES)
    return [str(e) for e in json.loads(noted)] if noted else []


def segment_bytes(table: TableName, rows: pa.Table, engines: Sequence[str], *, compression: str = "lz4") -> pa.Buffer:
    """Return the bytes of a spool segment: fast to write, since the next fold reads it once and removes it.

    Rows may have the column `owners.OWNER`; it is written where it names an import. A segment that is sent to another
    machine is smaller with the compression "zstd".
    """
    owner = rows[OWNER] if OWNER in rows.column_names else None
    bare = _with_engines(table, rows, engines, {})
    is_owned = owner is not None and pc.any(pc.not_equal(owner, "")).as_py()
    return parquet_bytes(
        bare.append_column(OWNER, owner) if is_owned else bare,
        compression=compression,
        use_dictionary=[f.name for f in bare.schema if pa.types.is_string(f.type)] + [OWNER],
        write_statistics=["ts"],  # `spans` reads the hours of a segment there
    )


def part_bytes(table: TableName, rows: pa.Table, engines: Sequence[str]) -> pa.Buffer:
    """Return the bytes of a part: zstd, dictionary for ids and millimetres, delta coding for time, page checksums.

    Args:
        table: Table of the rows.
        rows: Its columns, and perhaps `owners.OWNER`, which is noted in the metadata.
        engines: Engine names and versions, noted in the metadata.
    """
    bare, owners = without_owners(rows) if OWNER in rows.column_names else (rows, None)
    names = [f.name for f in SCHEMAS[table] if pa.types.is_string(f.type) or f.name.endswith(("_mm", "_px"))]
    return parquet_bytes(
        _with_engines(table, bare, engines, {OWNERS: owners} if owners is not None else {}),
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


def read_owned(path: Path, table: TableName) -> pa.Table:
    """Return the rows of a part as `read_part`, with the column `owners.OWNER`."""
    rows = read_part(path, table)
    return rows.append_column(OWNER, owners_of(path))


def parquet_bytes(rows: pa.Table, **options: object) -> pa.Buffer:
    """Return rows as a Parquet file in memory, so that its name can be the hash of its bytes."""
    sink = pa.BufferOutputStream()
    pq.write_table(rows, sink, **options)
    return sink.getvalue()


def _with_engines(table: TableName, rows: pa.Table, engines: Sequence[str], noted: Mapping[bytes, bytes]) -> pa.Table:
    """Return rows in the schema of their table, with the engines and other notes in its metadata."""
    about = {ENGINES: json.dumps(list(engines)[:ENGINES_MAX]).encode(), **noted}
    if rows.schema.equals(SCHEMAS[table]):
        return rows.replace_schema_metadata(about)
    schema = SCHEMAS[table].with_metadata(about)
    return rows.select(schema.names).cast(schema)
