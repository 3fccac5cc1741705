"""Segments of the spool: records that are acknowledged, until the next fold reads them once and removes them.

A segment is an Arrow file: it is written in three quarters of the time of a Parquet file, and read in a third.
Those that a node hands on to its site are Parquet files, and so are those of older versions. Both are read here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.schema import TableName
from vsd_analytics.store.owners import OWNER
from vsd_analytics.store.part_files import CODED, ENGINES, coded, noted_engines, parquet_bytes, written_schema

ARROW = ".arrow"
_ABOUT = b"vsd.segment"
"""Number of rows, first and last instant of a segment, UTC milliseconds."""


@dataclass(frozen=True, slots=True)
class About:
    """What a segment notes of its rows.

    Attributes:
        n_rows: Their number.
        first_ms, last_ms: Their first and last instant, UTC milliseconds; None where it is not noted.
    """

    n_rows: int
    first_ms: int | None
    last_ms: int | None


def segment_bytes(table: TableName, rows: pa.Table, engines: Sequence[str]) -> pa.Buffer:
    """Return the bytes of a segment that stays on this machine.

    Args:
        table: Table of the rows.
        rows: Its columns, at least one row, and perhaps `owners.OWNER`, which is written where it names an import.
        engines: Engine names and versions, noted in the metadata.
    """
    fields = [f.with_type(CODED) if pa.types.is_string(f.type) else f for f in written_schema(table, rows)]
    if _is_owned(rows):
        fields.append(pa.field(OWNER, CODED))
    columns = [coded(rows[f.name]) if f.type == CODED else rows[f.name].cast(f.type) for f in fields]
    first, last = pc.min_max(rows["ts"].cast(pa.int64())).as_py().values()
    about = {ENGINES: noted_engines(engines), _ABOUT: b"%d %d %d" % (rows.num_rows, first, last)}
    written = pa.table(columns, schema=pa.schema(fields, about))
    sink = pa.BufferOutputStream()
    options = pa.ipc.IpcWriteOptions(compression="lz4", use_threads=False)
    with pa.ipc.new_file(sink, written.schema, options=options) as file:
        file.write_table(written)
    return sink.getvalue()


def sent_bytes(table: TableName, rows: pa.Table, engines: Sequence[str], *, compression: str = "zstd") -> pa.Buffer:
    """Return the bytes of a segment that a node hands on; see `segment_bytes`."""
    schema = written_schema(table, rows)
    bare = rows.select(schema.names).cast(schema).replace_schema_metadata({ENGINES: noted_engines(engines)})
    return parquet_bytes(
        bare.append_column(OWNER, rows[OWNER].cast(pa.string())) if _is_owned(rows) else bare,
        compression=compression,
        use_dictionary=[f.name for f in schema if pa.types.is_string(f.type)] + [OWNER],
        write_statistics=["ts"],  # `about` reads the ends of a segment there
    )


def read_segment(path: Path, *, columns: Sequence[str] | None = None) -> pa.Table:
    """Return the rows of a segment with the names of its engines in the metadata, texts as dictionaries.

    Args:
        path: The segment.
        columns: Names of the columns to read; None = all.

    Raises:
        pyarrow.ArrowInvalid: It is damaged.
        OSError: It cannot be read, or is damaged.
    """
    if path.suffix != ARROW:
        noted = pq.read_metadata(path)
        noted_columns = (noted.schema.column(i) for i in range(noted.num_columns))
        texts = [column.name for column in noted_columns if column.physical_type == "BYTE_ARRAY"]
        with pq.ParquetFile(path, read_dictionary=texts, pre_buffer=False) as file:
            return file.read(columns=columns, use_threads=False)
    rows = _opened(path).read_all()
    rows.validate(full=True)  # the number of a text that its dictionary lacks would end the process
    return rows if columns is None else rows.select(columns)


def about(path: Path) -> About:
    """Return what a segment notes of its rows.

    Raises:
        ValueError: It is damaged (`pyarrow.ArrowInvalid` is one).
        OSError: It cannot be read, or is damaged.
    """
    if path.suffix == ARROW:
        with pa.OSFile(str(path)) as file:  # of which the footer is read alone
            noted = pa.ipc.open_file(file).schema.metadata or {}
        n_rows, first_ms, last_ms = map(int, noted.get(_ABOUT, b"").split())
        return About(n_rows, first_ms, last_ms)
    noted = pq.read_metadata(path)
    at = noted.schema.names.index("ts")
    statistics = [noted.row_group(i).column(at).statistics for i in range(noted.num_row_groups)]
    if not statistics or not all(n is not None and n.has_min_max for n in statistics):
        return About(noted.num_rows, None, None)
    ends = [int(pa.scalar(end, pa.timestamp("ms", "UTC")).value) for n in statistics for end in (n.min, n.max)]
    return About(noted.num_rows, min(ends), max(ends))


def owners_in(path: Path) -> frozenset[str]:
    """Return the imports that brought the rows of a segment, "" for rows of none; raises as `read_segment`."""
    if path.suffix != ARROW:
        rows = read_segment(path, columns=[OWNER]) if OWNER in schema_of(path).names else None
    else:
        with pa.OSFile(str(path)) as file:
            at = pa.ipc.open_file(file).schema.get_field_index(OWNER)
            options = pa.ipc.IpcReadOptions(use_threads=False, included_fields=[at])
            rows = pa.ipc.open_file(file, options=options).read_all() if at >= 0 else None
    if rows is None:
        return frozenset([""])
    rows.validate(full=True)
    return frozenset(name or "" for name in rows[OWNER].unique().cast(pa.string()).to_pylist())


def schema_of(path: Path) -> pa.Schema:
    """Return the columns of a segment, with texts as texts; raises as `read_segment`."""
    if path.suffix != ARROW:
        with pq.ParquetFile(path) as file:
            return file.schema_arrow
    schema = _opened(path).schema
    return pa.schema([f.with_type(pa.string()) if pa.types.is_dictionary(f.type) else f for f in schema])


def _opened(path: Path) -> pa.ipc.RecordBatchFileReader:
    data = path.read_bytes()
    return pa.ipc.open_file(pa.py_buffer(data), options=pa.ipc.IpcReadOptions(use_threads=False))


def _is_owned(rows: pa.Table) -> bool:
    return OWNER in rows.column_names and coded(rows[OWNER]).dictionary.to_pylist() not in ([], [""])
