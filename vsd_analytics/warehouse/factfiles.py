"""Fact files: Parquet whose metadata holds the hashes of its inputs and a digest of the file's own bytes.

The digest is BLAKE2b over the whole file with zeros in the digest's place. So it covers rows, statistics and footer: a
flipped bit in a statistic could make a reader skip rows that are in the file.

A file of hourly facts holds the hours of a UTC day. Its metadata names the inputs of each hour as
`{kind of input: {hash: [hours of the day]}}`, because most hours of a day share most inputs.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.warehouse.arrays.held import ENUMS

INPUTS = b"vsd.causes"
"""Metadata key of the input hashes. Every file on disk has it, so it keeps its name from before they were "inputs"."""
DIGEST = b"vsd.digest"
ROW_GROUP = 250_000
"""A row group ends with the first hour that brings it to this many rows. So the writer of a day holds few rows, and
where row groups end depends on the rows alone."""
_INSTANTS = ("ts_ms", "started_ms", "ended_ms", "first_ms", "last_ms", "_from_ms", "_to_ms")
_BYTES = 16
_ZEROS = b"0" * 2 * _BYTES


class FactWriter:
    """Makes the bytes of a fact file of rows that come piece by piece.

    Args:
        inputs: What the metadata notes about its inputs.
        noted: Other metadata.
    """

    def __init__(self, inputs: Mapping[str, Any], noted: Mapping[bytes, bytes] | None = None) -> None:
        own = {INPUTS: json.dumps(dict(inputs), sort_keys=True).encode(), DIGEST: _ZEROS}
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
        blank: bytes = self._sink.getvalue().to_pybytes()
        place = _place(blank)
        return blank[:place] + _digest(blank) + blank[place + len(_ZEROS) :]

    def _flush(self) -> None:
        rows = _with_own_names(self._pieces)
        self._pieces, self._n_rows = [], 0
        if self._writer is None:
            self._writer = pq.ParquetWriter(
                self._sink,
                rows.schema.remove_metadata(),
                compression="zstd",
                write_page_checksum=True,
                # Arrow's own schema would say what Parquet's says.
                store_schema=False,
                # Instants rise from row to row, so their differences are small; all else repeats within a day, and
                # where it does not, Parquet gives the dictionary up by itself.
                use_dictionary=[name for name in rows.column_names if not name.endswith(_INSTANTS)],
                # Every row group has ids from end to end of their order: comparing each for that finds nothing to skip.
                write_statistics=[name for name in rows.column_names if name not in ENUMS],
                column_encoding={n: "DELTA_BINARY_PACKED" for n in rows.column_names if n.endswith(_INSTANTS)},
            )
        self._writer.write_table(rows.replace_schema_metadata(), row_group_size=max(1, rows.num_rows))


def _with_own_names(pieces: Sequence[pa.Table]) -> pa.Table:
    """Return pieces as one table, with ids as dictionaries of the names that occur, in order.

    So the writer need not look up the text of each row, and a file holds no names of other days.
    """
    rows = pa.concat_tables(map(_with_dictionaries, pieces))
    if any(column.num_chunks != 1 for column in rows.columns):  # else these steps would only copy
        rows = rows.unify_dictionaries().combine_chunks()
    columns = (_own_names(rows[name]) if name in ENUMS else rows[name] for name in rows.column_names)
    return pa.table(list(columns), rows.column_names)


def _with_dictionaries(rows: pa.Table) -> pa.Table:
    for name in (c for c in rows.column_names if c in ENUMS and pa.types.is_string(rows[c].type)):
        rows = rows.set_column(rows.column_names.index(name), name, rows[name].dictionary_encode())
    return rows


def _own_names(column: pa.ChunkedArray) -> pa.DictionaryArray:
    ids = column.chunk(0) if column.num_chunks else pa.array([], column.type)
    n = len(ids.dictionary)
    codes = (ids.indices.fill_null(n) if ids.null_count else ids.indices).to_numpy()
    used = np.flatnonzero(np.bincount(codes, minlength=n)[:n])
    names = ids.dictionary.take(pa.array(used))
    if not pc.all(pc.less(names[:-1], names[1:])).as_py():  # those of a batch are in order
        order = pc.sort_indices(names)
        names, used = names.take(order), used[order.to_numpy()]
    number = np.zeros(n + 1, dtype=np.int32)
    number[used] = np.arange(len(used))
    own = pa.array(number.take(codes), mask=codes == n if ids.null_count else None)
    return pa.DictionaryArray.from_arrays(own, names, safe=False)


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


def is_undamaged(data: bytes) -> bool:
    """Return whether all bytes of a fact file match its digest; False for a file without one."""
    place = _place(data)
    noted = data[place : place + len(_ZEROS)]
    return _digest(data[:place] + _ZEROS + data[place + len(_ZEROS) :]) == noted


def is_undamaged_file(path: Path) -> bool:
    """Return whether a fact file exists, can be read, and matches its digest."""
    try:
        return is_undamaged(path.read_bytes())
    except OSError:
        return False


def noted_inputs(data: bytes) -> dict[str, Any]:
    """Return what the metadata of an undamaged fact file notes: hash of each kind of input, for days by hour."""
    noted = (pq.read_metadata(pa.BufferReader(data)).metadata or {}).get(INPUTS, b"{}")
    return dict(json.loads(noted))


def by_kind(inputs: Mapping[int, Mapping[str, str]]) -> dict[str, dict[str, list[int]]]:
    """Return the input hashes of the hours of a UTC day as the metadata of its file notes them."""
    found: dict[str, dict[str, list[int]]] = {}
    for hour, hashes in sorted(inputs.items()):
        for kind, value in hashes.items():
            found.setdefault(kind, {}).setdefault(value, []).append(hour % 24)
    return found


def by_hour(noted: Mapping[str, Any], day: int) -> dict[int, dict[str, str]]:
    """Return the input hashes by UTC hour number that the metadata of a file of a UTC day notes; see `by_kind`."""
    found: dict[int, dict[str, str]] = {}
    for kind, hours_of in noted.items():
        # a file of a version with a file for each hour notes one hash: it holds no hours that could be used again
        for value, hours in hours_of.items() if isinstance(hours_of, dict) else ():
            for hour in hours:
                found.setdefault(day * 24 + int(hour), {})[str(kind)] = str(value)
    return found


def _place(data: bytes) -> int:
    """Return the offset of the digest.

    Parquet's footer stores metadata as Thrift strings: after the key come two bytes (field type and length), then the
    value. `rfind`, because column data before the footer may hold the same bytes by chance.
    """
    return data.rfind(DIGEST) + len(DIGEST) + 2


def _digest(data: bytes) -> bytes:
    return hashlib.blake2b(data, digest_size=_BYTES).hexdigest().encode()
