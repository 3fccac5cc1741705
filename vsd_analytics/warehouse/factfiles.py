"""Fact files: Parquet whose metadata holds the hashes of its inputs and a digest of the file's own bytes.

A file of hourly facts holds the hours of a UTC day or of a week. Its metadata names the inputs of each hour as
`{kind of input: {hash: [hours since the first]}}`, because most hours of a day share most inputs.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.errors import StoreError
from vsd_analytics.store.own_digest import DIGEST, NO_DIGEST, is_undamaged, with_digest
from vsd_analytics.warehouse.held import ENUMS

INPUTS = b"vsd.causes"
"""Metadata key of the input hashes. Every file on disk has it, so it keeps its name from before they were "inputs"."""
ROW_GROUP = 250_000
"""A row group ends with the first hour that brings it to this many rows. So the writer of a day holds few rows, and
where row groups end depends on the rows alone."""
FEW_ROWS = 100
"""A file of fewer rows is not compressed: zstd takes longer to begin each column than it saves blocks of the disk."""
_REPEATED = ("ts_ms", "started_ms")
"""Instants that several rows in a row share, as the cells of an episode do."""
_SPREAD = ("before_ms", "after_ms", "ended_ms", "first_ms", "last_ms", "_from_ms", "_to_ms")
"""Times that hardly repeat, or rise from row to row, as lengths do (`_mm`)."""
_SMALL = ("cx", "cy", "_records", "_persons")
"""Numbers that fill few of their bytes, as counts do (`n_`). So do sums of lengths."""
_NAMES = frozenset(["company", *(name for name, kind in ENUMS.items() if kind == "track_name")])
_KEYS = frozenset(["hour", "quarter", "bucket_quarter", "cx", "cy", "local_date", "site_day", "utc_day", "distance_mm"])


class FactWriter:
    """Makes the bytes of a fact file of rows that come piece by piece.

    Args:
        inputs: What the metadata notes about its inputs.
        noted: Other metadata.
    """

    def __init__(self, inputs: Mapping[str, Any], noted: Mapping[bytes, bytes] | None = None) -> None:
        own = {INPUTS: json.dumps(dict(inputs), sort_keys=True, separators=(",", ":")).encode(), DIGEST: NO_DIGEST}
        self._noted = {**(noted or {}), **own}
        self._sink = pa.BufferOutputStream()
        self._writer: pq.ParquetWriter | None = None
        self._pieces: list[pa.Table] = []
        self._n_rows = 0

    def add(self, rows: pa.Table) -> None:
        """Append rows; all pieces have the same columns. Dictionaries of ids may have names that no row has."""
        self._pieces.append(rows)
        self._n_rows += rows.num_rows
        if self._n_rows >= ROW_GROUP:
            self._flush()

    def has_room(self, rows: pa.Table) -> bool:
        """Return whether a row group goes on after some more rows."""
        return self._n_rows + int(rows.num_rows) < ROW_GROUP

    def finish(self) -> bytes:
        """Return the bytes of the file; at least one piece was added, with or without rows."""
        if self._pieces:
            self._flush()
        assert self._writer is not None
        self._writer.add_key_value_metadata(self._noted)
        self._writer.close()
        return with_digest(self._sink.getvalue().to_pybytes())

    def _flush(self) -> None:
        rows = pa.concat_tables([_with_own_names(piece) for piece in self._pieces]).unify_dictionaries()
        self._pieces, self._n_rows = [], 0
        if self._writer is None:
            encoded = {field.name: encoding for field in rows.schema if (encoding := _encoding(field))}
            self._writer = pq.ParquetWriter(
                self._sink,
                rows.schema.remove_metadata(),
                compression="none" if rows.num_rows < FEW_ROWS else "zstd",
                write_page_checksum=True,
                # Arrow's own schema would say what Parquet's says.
                store_schema=False,
                use_dictionary=[name for name in rows.column_names if name not in encoded],
                # Ids are in every row group from end to end of their order, and no query compares a sum or an instant
                # with a number: their least and greatest values would help to skip nothing.
                write_statistics=[name for name in rows.column_names if name in _KEYS],
                column_encoding=encoded,
            )
        self._writer.write_table(rows.replace_schema_metadata(), row_group_size=max(1, rows.num_rows))


def _with_own_names(rows: pa.Table) -> pa.Table:
    """Return rows whose dictionaries have the names of their own rows alone, in order of these; see `FactWriter.add`.

    Names that hardly repeat are texts. So the bytes of a file follow from its rows, whichever way they came.
    """
    for k, field in enumerate(rows.schema):
        is_dictionary = pa.types.is_dictionary(field.type)
        if field.name in _NAMES and is_dictionary:
            rows = rows.set_column(k, field.name, rows.column(k).cast(pa.string()))
        elif field.name not in _NAMES and (is_dictionary or pa.types.is_string(field.type)):
            rows = rows.set_column(k, field.name, _of_own_names(rows.column(k)))
    return rows


def _of_own_names(column: pa.ChunkedArray) -> pa.Array:
    names = column.combine_chunks()
    if not pa.types.is_dictionary(names.type):
        return names.dictionary_encode()
    used = names.indices.drop_null().unique()
    place = np.zeros(len(names.dictionary), dtype=np.int32)
    place[used] = np.arange(len(used), dtype=np.int32)
    indices = pa.array(place).take(names.indices)
    return pa.DictionaryArray.from_arrays(indices, names.dictionary.take(used), safe=False)


def _encoding(column: pa.Field) -> str | None:
    """Return how Parquet writes a column; None = by its dictionary, because most columns repeat within a day.

    Rows are by hour, camera and ids. So ids and instants repeat from row to row, which zstd sees in plain values, and
    dictionaries would only add the number of each name. Of counts, cells and sums, zstd gets all first bytes, then all
    second bytes and so on: the upper ones are hardly more than runs of zeros.
    """
    name = column.name
    if name in _NAMES:
        return "DELTA_LENGTH_BYTE_ARRAY"  # lengths and characters apart: all ids are of one length
    if not pa.types.is_integer(column.type):
        return None
    is_length = name.endswith("_mm")
    if name.endswith(_REPEATED):
        return "PLAIN"
    if name.startswith("n_") or name.endswith(_SMALL) or (is_length and column.type == pa.int64()):  # a sum of lengths
        return "BYTE_STREAM_SPLIT"
    return "DELTA_BINARY_PACKED" if is_length or name.endswith(_SPREAD) else None


def fact_bytes(rows: pa.Table, *, inputs: Mapping[str, Any], noted: Mapping[bytes, bytes] | None = None) -> bytes:
    """Return the bytes of a fact file.

    Args:
        rows: Its rows.
        inputs: Hash of each kind of input they were computed from, or of a week the names of its files.
        noted: Other metadata.
    """
    writer = FactWriter(inputs, noted)
    writer.add(rows)
    return writer.finish()


def is_undamaged_file(path: Path) -> bool:
    """Return whether a fact file exists, can be read, and matches its digest."""
    try:
        return is_undamaged(path.read_bytes())
    except OSError:
        return False


def is_whole(path: Path) -> bool:
    """Return whether a fact file exists to its end: Parquet ends with the length of its footer and `PAR1`.

    Reads 8 bytes. Facts are written without fsync, so a power cut can leave a short file under a right name.
    """
    try:
        fd = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        size = os.fstat(fd).st_size
        tail = os.pread(fd, 8, max(0, size - 8))
    except OSError:
        return False
    finally:
        os.close(fd)
    return tail[4:] == b"PAR1" and int.from_bytes(tail[:4], "little") + 12 <= size


def damaged_facts(error: object, why: str = "") -> StoreError:
    """Return the error for a fact file that has its full length but cannot be read."""
    return StoreError(
        "a file of the computed facts is damaged",
        code="E302",
        why=why or " ".join(str(error).split())[:300],
        fix="delete the folder facts and run vsd build: facts are computed from the store again",
    )


def noted_inputs(data: bytes) -> dict[str, Any]:
    """Return what the metadata of an undamaged fact file notes: hash of each kind of input, for days by hour."""
    noted = (pq.read_metadata(pa.BufferReader(data)).metadata or {}).get(INPUTS, b"{}")
    return dict(json.loads(noted))


def by_kind(inputs: Mapping[int, Mapping[str, str]], first: int) -> dict[str, dict[str, list[int]]]:
    """Return the input hashes of hours, given their numbers and the first of a file, as its metadata notes them."""
    noted: dict[str, dict[str, list[int]]] = {}
    for hour, hashes in sorted(inputs.items()):
        for kind, value in hashes.items():
            noted.setdefault(kind, {}).setdefault(value, []).append(hour - first)
    return noted


def by_hour(noted: Mapping[str, Any], first: int) -> dict[int, dict[str, str]]:
    """Return the input hashes by hour number that the metadata of a file from hour `first` on notes; see `by_kind`."""
    inputs: dict[int, dict[str, str]] = {}
    for kind, hours_of in noted.items():
        # a file of a version with a file for each hour notes one hash: it holds no hours that could be used again
        for value, hours in hours_of.items() if isinstance(hours_of, dict) else ():
            for hour in hours:
                inputs.setdefault(first + int(hour), {})[str(kind)] = str(value)
    return inputs
