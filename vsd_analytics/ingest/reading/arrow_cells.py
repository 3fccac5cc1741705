"""Columns as Arrow files hold them: lengths of texts, texts without dictionaries, texts that are no UTF-8."""

from __future__ import annotations

from collections.abc import Mapping
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


def no_such_type(source: Source, why: str) -> InputError:
    """Return the error of a column of a type that cannot be read: E203."""
    return InputError(
        f"{source.file_name} has a column of a type that cannot be read",
        code="E203",
        where=Where(source.name),
        why=why,
        fix="write numbers, texts and timestamps into plain columns, or read others (--map)",
    )
