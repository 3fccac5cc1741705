"""Raw tables from lists and arrays: the shape every adapter hands over."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import IO, Any

import msgspec
import numpy as np
import numpy.typing as npt
import pyarrow as pa

from vsd_analytics.ingest.reading.adapter import EXCERPT_CHARS, WHOLE_MAX_BYTES, IngestOptions, RawBatch, Rejected
from vsd_analytics.schema import RAW_SCHEMAS, TableName

Check = tuple[str, str, Callable[[pa.Table], pa.ChunkedArray | pa.Array]]
"""Reason, a sentence for people, and which rows are bad (null: not)."""


class BadRowError(Exception):
    """A record that cannot be used. Its arguments are the reason, a short stable slug, and a sentence for people."""


def raw_table(name: TableName, **columns: Any) -> pa.Table:
    """Build one raw table, filling absent columns with nulls.

    Args:
        name: Table of `vsd_analytics.schema.RAW_SCHEMAS`.
        **columns: Values by column: a list, NumPy array or Arrow array of one length each, or a single value (string,
            number or None) for every row. At least one column must be a sequence. NaN stays NaN, a wrong number that
            the checks must see; None is missing.

    Returns:
        A table in the schema of `name`, columns in its order.

    Raises:
        KeyError: A column is not one of the schema.
        ValueError: Lengths differ, only single values are given, or a column that must have values is absent.
        pyarrow.ArrowInvalid: A value does not fit its column's type.
    """
    schema = RAW_SCHEMAS[name]
    unknown = sorted(set(columns) - set(schema.names))
    if unknown:
        raise KeyError(f"raw {name} have no column {', '.join(unknown)}")
    lengths = {len(values) for values in columns.values() if _is_sequence(values)}
    if len(lengths) != 1:
        raise ValueError(f"columns of raw {name} have lengths {sorted(lengths)}")
    n_rows = lengths.pop()
    missing = [f.name for f in schema if not f.nullable and columns.get(f.name) is None]
    if missing:
        raise ValueError(f"raw {name} need a column {', '.join(missing)}")
    return pa.table([_array(columns.get(f.name), f.type, n_rows) for f in schema], schema=schema)


def floored(ts_ms: npt.NDArray[np.int64], options: IngestOptions) -> npt.NDArray[np.int64]:
    """Return instants (UTC milliseconds) floored to the sampling period: records of one period are one frame.

    Without `period_s`, or with one below a millisecond, they stay as they are.
    """
    if not options.period_s or options.period_s < 0.001:
        return ts_ms
    period_ms = options.period_s * 1000
    return (np.floor(ts_ms / period_ms) * period_ms).astype(np.int64)


def rejected(line: int, *, reason: str, detail: str, record: str | bytes = "") -> Rejected:
    """Return a record for quarantine with its text shortened to `EXCERPT_CHARS`.

    Args:
        line: 1-based line or record number in the source.
        reason: A short, stable slug.
        detail: One sentence for people.
        record: The record as it was sent. Bytes are its line, which is stored whole if possible; bytes that are not
            UTF-8 are shown as replacement characters.
    """
    if isinstance(record, str):
        return Rejected(line, reason, detail, record[:EXCERPT_CHARS])
    text = record[: 4 * EXCERPT_CHARS].decode("utf-8", "replace")
    return Rejected(line, reason, detail, text[:EXCERPT_CHARS], whole_line(record))


def too_many_people(n_persons: int, options: IngestOptions) -> str:
    """Return the detail of a frame with more people than `persons_max`."""
    return f"{n_persons:,} people in one frame; at most {options.persons_max:,} are read (persons_max)"


def whole_line(line: bytes | None) -> str | None:
    """Return a line as text, or None when it is empty, longer than `WHOLE_MAX_BYTES` or not UTF-8."""
    if not line or len(line) > WHOLE_MAX_BYTES:
        return None
    try:
        return line.decode()
    except UnicodeDecodeError:
        return None


def row_json(row: Mapping[str, Any]) -> str | None:
    """Return a raw row as a JSON object, or None when that is longer than `WHOLE_MAX_BYTES`.

    JSON has no NaN and no infinity, and null would mean missing: they become the texts "nan", "inf", "-inf".
    """
    plain = {k: str(v) if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}
    text = msgspec.json.encode(plain)
    return None if len(text) > WHOLE_MAX_BYTES else text.decode()


def rows_table(name: TableName, rows: Sequence[Mapping[str, Any]], *, lines: Sequence[int]) -> pa.Table:
    """Return the raw table of rows that `row_json` wrote: the inverse.

    Args:
        name: Table of `vsd_analytics.schema.RAW_SCHEMAS`.
        rows: Decoded JSON objects.
        lines: Numbers for the column `line`.

    Raises:
        ValueError: A value does not fit its column (`pyarrow.ArrowInvalid` is one).
        TypeError: As well (`pyarrow.ArrowTypeError` is one).
    """
    schema = RAW_SCHEMAS[name]
    floats = [f.name for f in schema if pa.types.is_floating(f.type)]
    read = [
        {**row, **{c: float(row[c]) for c in floats if row.get(c) is not None}, "line": line}
        for row, line in zip(rows, lines, strict=True)
    ]
    table = pa.Table.from_pylist(read, schema=schema)
    for column in schema:
        if not column.nullable and table[column.name].null_count:
            raise ValueError(f"{column.name} is missing")
    return table


def without_zones(batch: RawBatch) -> RawBatch:
    """Return a batch whose times count as exact: the user stated their zone, and no clock of a camera moves them."""
    tables = {}
    for name, table in batch.tables.items():
        at = table.schema.get_field_index("zone")
        tables[name] = table.set_column(at, table.schema.field(at), pa.nulls(table.num_rows, pa.string()))
    return replace(batch, tables=tables)


def n_rows(tables: Iterable[pa.Table]) -> int:
    """Return the number of rows of the longest table, which limits the size of a batch."""
    return max((t.num_rows for t in tables), default=0)


def bounded_lines(stream: IO[bytes], *, max_bytes: int) -> Iterator[tuple[int, bytes | None]]:
    """Yield the lines of a stream with their 1-based numbers, never holding more than `max_bytes` of one.

    Args:
        stream: Bytes; a UTF-8 byte order mark at its start is left out.
        max_bytes: Longest line yielded, its end not counted.

    Yields:
        Number and line without its end (LF or CR LF); None for a line that is too long, which is skipped.
    """
    number = 0
    while line := stream.readline(max_bytes + 2):
        number += 1
        body: bytes | None = line.rstrip(b"\r\n")
        while not line.endswith(b"\n") and (line := stream.readline(max_bytes)):
            body = None
        if body is not None and number == 1:
            body = body.removeprefix(b"\xef\xbb\xbf")
        yield number, None if body is None or len(body) > max_bytes else body


def _is_sequence(values: Any) -> bool:
    return hasattr(values, "__len__") and not isinstance(values, str | bytes)


def _array(values: Any, kind: pa.DataType, length: int) -> pa.Array | pa.ChunkedArray:
    if values is None:
        return pa.nulls(length, kind)
    if not _is_sequence(values):
        return pa.repeat(pa.scalar(values, type=kind), length)
    if isinstance(values, pa.Array | pa.ChunkedArray):
        return values if values.type == kind else values.cast(kind)
    return pa.array(values, type=kind, from_pandas=False)
