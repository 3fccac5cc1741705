"""Columns as Arrow files hold them: lengths of texts, texts without dictionaries, texts that are no UTF-8."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import Rejected, Source
from vsd_analytics.ingest.reading.raw import rejected


def text_lengths(column: pa.Array) -> np.ndarray:
    """Return the bytes of each cell of a text, 0 of others."""
    nothing = np.zeros(len(column), dtype=np.int64)
    if pa.types.is_dictionary(column.type):
        lengths = np.append(text_lengths(column.dictionary), 0)
        return np.asarray(lengths[pc.fill_null(column.indices, len(lengths) - 1).to_numpy(zero_copy_only=False)])
    if not is_text(column.type):
        return nothing
    return np.asarray(pc.fill_null(pc.binary_length(column), 0).to_numpy(zero_copy_only=False), dtype=np.int64)


def long_cells(
    columns: Mapping[str, pa.Array], lines: np.ndarray, *, allowed: int
) -> tuple[np.ndarray, list[Rejected], int]:
    """Return which rows have a cell of more than `allowed` bytes, these rows for quarantine, and the bytes of texts.

    Args:
        columns: Columns by our names.
        lines: Number of each row in the file.
        allowed: The setting `cell_max_bytes`.
    """
    is_long, bad, n_bytes = np.zeros(len(lines), dtype=bool), [], 0
    for ours, column in columns.items():
        lengths = text_lengths(column)
        for i in np.flatnonzero((lengths > allowed) & ~is_long).tolist():
            detail = f"{ours} has {lengths[i]:,} bytes; at most {allowed:,} are read (cell_max_bytes)"
            bad.append(rejected(int(lines[i]), reason="cell-too-long", detail=detail))
        is_long |= lengths > allowed
        n_bytes += int(lengths.sum())
    return is_long, bad, n_bytes


def plain(column: pa.Array) -> pa.Array:
    """Return a column without a dictionary; texts that are no UTF-8 as bytes, to be shown as escapes."""
    if pa.types.is_dictionary(column.type):
        column = column.dictionary.take(column.indices)
    if not any(check(column.type) for check in (pa.types.is_string, pa.types.is_large_string, pa.types.is_string_view)):
        return column
    try:
        column.validate(full=True)
    except pa.ArrowInvalid:  # Parquet promises UTF-8 and does not look
        return column.cast(pa.large_binary())
    return column


def is_text(kind: Any) -> bool:
    """Return whether a type is text, or bytes that may be text."""
    checks = (pa.types.is_string, pa.types.is_large_string, pa.types.is_binary, pa.types.is_large_binary)
    return any(check(kind) for check in checks)


def holds_text(kind: Any) -> bool:
    """Return whether a type is text, also by way of a dictionary."""
    return is_text(kind.value_type if pa.types.is_dictionary(kind) else kind)


def flat_fields(schema: pa.Schema) -> list[tuple[str, pa.DataType]]:
    """Return name and type of each column; the fields of a struct are columns with its name and a dot before theirs."""
    fields = list(schema)
    while any(pa.types.is_struct(field.type) for field in fields):
        fields = [inner for field in fields for inner in _inside(field)]
    return [(field.name, field.type) for field in fields]


def _inside(field: pa.Field) -> list[pa.Field]:
    if not pa.types.is_struct(field.type):
        return [field]
    inner = (field.type.field(i) for i in range(field.type.num_fields))
    return [part.with_name(f"{field.name}.{part.name}") for part in inner]


def flat(batch: pa.RecordBatch) -> pa.RecordBatch:
    """Return a batch with the columns of `flat_fields`; where a struct is null, so are its fields."""
    while any(pa.types.is_struct(kind) for kind in batch.schema.types):
        columns = [
            part
            for column in batch.columns
            for part in (column.flatten() if pa.types.is_struct(column.type) else [column])
        ]
        fields = [inner for field in batch.schema for inner in _inside(field)]
        batch = pa.RecordBatch.from_arrays(columns, names=[field.name for field in fields])
    return batch


def as_messages(batch: pa.RecordBatch) -> list[dict[str, Any]]:
    """Return the rows of a batch as JSON would have them: structs are objects, times are texts."""
    return [_as_json(row) for row in batch.to_pylist()]


def _as_json(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _as_json(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_as_json(inner) for inner in value]
    if isinstance(value, Decimal):
        return float(value)
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def no_such_type(source: Source, why: str) -> InputError:
    """Return the error of a column of a type that cannot be read: E203."""
    return InputError(
        f"{source.file_name} has a column of a type that cannot be read",
        code="E203",
        where=Where(source.name),
        why=why,
        fix="write numbers, texts and timestamps into columns, or read others (--map)",
    )
