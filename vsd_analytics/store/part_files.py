"""Parquet files of the store: how a part is encoded, and the engines noted in its metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.errors import StoreError, Where
from vsd_analytics.schema import LATER, SCHEMAS, TableName
from vsd_analytics.store.owners import OWNER, OWNERS, owners_of, without_owners

HASH_DIFFERS = "its bytes do not match the hash in its name: the disk or a program changed them"
"""Why a file that is named by its hash is damaged, for messages."""
ENGINES = b"vsd.engines"
UNKNOWN = b"vsd.unknown"
"""Number of rows of a part without a value, by column of texts: a part has no statistics of texts."""
ENGINES_MAX = 32
"""Engine names noted in one file: an engine that sends a new name with every message must not fill the metadata."""
CODED = pa.dictionary(pa.int32(), pa.string())
_FEW = ("camera_id", "quality")
"""Texts of few values: numbers of a dictionary are written as such, which takes less time than to look up each text.
The ids of tracks take more bytes that way: where many differ, the writer gives up its own dictionary of them."""
_REPEATS_LEAST = 6
"""A dictionary is smaller where each number comes this often: of 60 columns, delta coding took 1.06 to 1.26 times its
bytes where they came 8 to 25 times, and 0.52 to 0.72 times where they came one to three times."""
_TABLE_MOST = 8
"""Numbers are counted in a table of at most this many times their rows."""


def damaged(path: Path, what: str, *, fix: str) -> StoreError:
    """Return the error (E302) of a file whose name is not the hash of its bytes."""
    return StoreError(f"a file with {what} is damaged", code="E302", where=Where(str(path)), why=HASH_DIFFERS, fix=fix)


def damaged_segment(path: Path) -> StoreError:
    """Return the same of a segment of the spool."""
    return damaged(path, "records acknowledged earlier", fix="move it away and ingest their source again")


def engines_of(path: Path) -> list[str]:
    """Return the engine names and versions noted in a part's metadata."""
    return engines_in(pq.read_metadata(path).metadata)


def engines_in(metadata: Mapping[bytes, bytes] | None) -> list[str]:
    """Return the engine names and versions noted in a file's metadata."""
    noted = (metadata or {}).get(ENGINES)
    return [str(e) for e in json.loads(noted)] if noted else []


def noted_engines(engines: Sequence[str]) -> bytes:
    """Return the metadata that name engines."""
    return json.dumps(list(engines)[:ENGINES_MAX]).encode()


def unknown_in(metadata: Mapping[bytes, bytes] | None) -> Mapping[str, int]:
    """Return the number of rows without a value, by column, as far as a part's metadata note it beside statistics."""
    noted = (metadata or {}).get(UNKNOWN)
    return {str(name): int(n) for name, n in json.loads(noted).items()} if noted else {}


def part_bytes(table: TableName, rows: pa.Table, engines: Sequence[str]) -> pa.Buffer:
    """Return the bytes of a part: zstd, dictionary for ids, delta coding for time, page checksums.

    Millimetres get a dictionary where it is smaller, as of whole centimetres, and delta coding elsewhere.

    Args:
        table: Table of the rows.
        rows: Its columns, and perhaps `owners.OWNER`, which is noted in the metadata.
        engines: Engine names and versions, noted in the metadata.
    """
    bare, owners = without_owners(rows) if OWNER in rows.column_names else (rows, None)
    schema = written_schema(table, bare)
    texts = [f.name for f in schema if pa.types.is_string(f.type)]
    repeated, delta = [*texts, *(name for name in schema.names if name.endswith("_px"))], ["ts"]
    for name in (name for name in schema.names if name.endswith("_mm")):
        (repeated if _is_repeated(bare[name]) else delta).append(name)
    n_unknown = {name: bare[name].null_count for name in texts}
    about = {ENGINES: noted_engines(engines), UNKNOWN: json.dumps(n_unknown).encode()}
    if owners is not None:
        about[OWNERS] = owners
    fields = [f.with_type(CODED) if f.name in _FEW else f for f in schema]
    columns = [_in_order_of_use(coded(bare[f.name])) if f.name in _FEW else bare[f.name].cast(f.type) for f in schema]
    return parquet_bytes(
        pa.table(columns, schema=pa.schema(fields)),
        about=about,
        compression="zstd",
        compression_level=4,
        write_page_checksum=True,
        write_statistics=[name for name in schema.names if name not in texts],  # texts take long to compare
        use_dictionary=repeated,
        column_encoding=dict.fromkeys(delta, "DELTA_BINARY_PACKED"),
        store_schema=False,  # it would name the dictionaries: readers get texts
    )


def coded(texts: pa.ChunkedArray) -> pa.DictionaryArray:
    """Return texts as numbers of a dictionary; those that are, stay as they are."""
    whole = texts.chunk(0) if texts.num_chunks == 1 else texts.combine_chunks()  # which copies even one piece
    return whole if pa.types.is_dictionary(whole.type) else whole.dictionary_encode()


def _in_order_of_use(texts: pa.DictionaryArray) -> pa.DictionaryArray:
    """Return texts with a dictionary of those that are used, in the order in which they come: same rows, same bytes."""
    numbers = texts.indices.dictionary_encode()
    return pa.DictionaryArray.from_arrays(numbers.indices, texts.dictionary.take(numbers.dictionary))


def _is_repeated(values: pa.ChunkedArray) -> bool:
    """Return whether a dictionary of whole numbers takes less space than their differences, by how often each comes.

    Numbers that are spread too wide to count them in a table are taken as different.
    """
    least, greatest = pc.min_max(values).as_py().values()
    if least is None or greatest - least >= _TABLE_MOST * len(values):
        return False
    is_there = np.zeros(greatest - least + 1, dtype=np.bool_)
    is_there[values.drop_null().to_numpy() - least] = True
    return bool(_REPEATS_LEAST * np.count_nonzero(is_there) < len(values))


def read_part(path: Path, table: TableName) -> pa.Table:
    """Return the rows of a part in today's schema; columns that are newer than the part are null."""
    with pq.ParquetFile(path, page_checksum_verification=True) as file:
        rows = with_every_column(table, file.read())
    return rows.select(SCHEMAS[table].names).cast(SCHEMAS[table])


def written_schema(table: TableName, rows: pa.Table) -> pa.Schema:
    """Return the columns of a table that a file of these rows has: those of `LATER` where a row has a value."""
    has_value = {c for c in LATER & {*rows.column_names} if rows[c].null_count < rows.num_rows}
    return pa.schema([f for f in SCHEMAS[table] if f.name not in LATER or f.name in has_value])


def with_every_column(table: TableName, rows: pa.Table) -> pa.Table:
    """Return the rows of a file with the columns of their table that it lacks, as null."""
    for column in SCHEMAS[table]:
        if column.name not in rows.column_names:
            rows = rows.append_column(column, pa.nulls(rows.num_rows, column.type))
    return rows


def read_owned(path: Path, table: TableName) -> pa.Table:
    """Return the rows of a part as `read_part`, with the column `owners.OWNER`."""
    rows = read_part(path, table)
    return rows.append_column(OWNER, owners_of(path))


def parquet_bytes(rows: pa.Table, *, about: Mapping[bytes, bytes] | None = None, **options: Any) -> pa.Buffer:
    """Return rows as a Parquet file in memory, so that its name can be the hash of its bytes.

    Args:
        rows: The rows.
        about: Metadata of the file, beside those of the rows.
        **options: Those of `pyarrow.parquet.ParquetWriter`.
    """
    sink = pa.BufferOutputStream()
    with pq.ParquetWriter(sink, rows.schema, **options) as writer:
        writer.add_key_value_metadata(about or {})
        writer.write_table(rows)
    return sink.getvalue()
