"""Feather and Arrow IPC files in bounded memory: what their buffers unpack to is summed before any is unpacked.

Arrow itself allocates what a buffer claims. So the messages' own tables (flatbuffers) are read first, as the format
describes them: https://arrow.apache.org/docs/format/Columnar.html#ipc-file-format
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import IO, Any, Final

import numpy as np
import pyarrow as pa

from vsd_analytics.errors import InputError
from vsd_analytics.ingest.reading.adapter import BATCH_ROWS, Source, damaged_after
from vsd_analytics.ingest.reading.arrow_cells import (
    as_messages,
    flat,
    flat_fields,
    holds_text,
    long_cells,
    no_such_type,
    plain,
)
from vsd_analytics.ingest.reading.limits import records_max, too_many_records, unpacked_max, unpacks_too_far
from vsd_analytics.ingest.reading.table_file import Chunk, Header, repeated_names, unique_names

MAGIC: Final = b"ARROW1"
MESSAGES_MAX: Final = 1_000
"""Rows with structs and lists that are values of Python at once."""
_METADATA_MAX: Final = 16 << 20
_DAMAGE = (pa.ArrowException, OSError, struct.error, ValueError)


class ArrowTable:
    """One Feather (version 2) or Arrow IPC file, its footer read.

    Args:
        source: The file.

    Raises:
        InputError: E205 when its footer cannot be read, E206 or E209 when it unpacks to more than is allowed.
    """

    def __init__(self, source: Source) -> None:
        self._source, self._done = source, 0
        with self.readable(), source.path.open("rb") as raw:
            self._check(raw)
            with pa.ipc.open_file(raw) as file:
                self._schema = file.schema
        fields = flat_fields(self._schema)
        names, self._types = [name for name, _ in fields], [kind for _, kind in fields]
        self.has_lists = any(pa.types.is_nested(kind) for kind in self._types)
        self.header = Header(unique_names(names), repeated=repeated_names(names))
        self.first_line: str | None = None
        self.has_decimal_comma = False

    def chunks(self, wanted: Mapping[str, int]) -> Iterator[Chunk]:
        """Read columns; see `TableFile.chunks`.

        Raises:
            InputError: A column is of a type that cannot be read (E203).
        """
        for i in wanted.values():
            if not self.can_read(i):
                kind = f"{self.header.names[i][:80]} is a {str(self._types[i])[:80]}"
                raise no_such_type(self._source, kind)
        self._done = 0
        with pa.OSFile(str(self._source.path), "rb") as raw, pa.ipc.open_file(raw) as file:
            for number in range(file.num_record_batches):
                batch = file.get_batch(number)
                batch.validate(full=True)  # offsets that point outside would be read as they are
                for at in range(0, batch.num_rows, BATCH_ROWS):
                    yield self._chunk(flat(batch.slice(at, BATCH_ROWS)), wanted, file.num_record_batches, number)

    def rows(self) -> Iterator[tuple[int, dict[str, Any], int]]:
        """Yield number (from 1), values and done bytes of each row, with what its structs and lists hold.

        Raises:
            InputError: E205, it is damaged.
        """
        number, n_bytes = 0, self._source.size_bytes
        with self.readable(), pa.OSFile(str(self._source.path), "rb") as raw, pa.ipc.open_file(raw) as file:
            for group in range(file.num_record_batches):
                batch = file.get_batch(group)
                batch.validate(full=True)
                for at in range(0, batch.num_rows, MESSAGES_MAX):
                    for row in as_messages(batch.slice(at, MESSAGES_MAX)):
                        number += 1
                        yield number, row, n_bytes * (group + 1) // file.num_record_batches

    @contextmanager
    def readable(self) -> Iterator[None]:
        """Turn errors about damage into E205."""
        try:
            yield
        except InputError:
            raise
        except (pa.ArrowNotImplementedError, pa.ArrowTypeError) as error:
            raise no_such_type(self._source, str(error)[:200]) from None
        except _DAMAGE as error:
            why = f"it is no whole Arrow file: {str(error)[:200]}"
            raise damaged_after(self._source, self._done, why=why) from None

    def has_text(self, column: int) -> bool:
        """Return whether a column holds texts."""
        return holds_text(self._types[column])

    def can_read(self, column: int) -> bool:
        """Return whether a column is of a type that can be read: no list and no struct."""
        kind = self._types[column]
        return not pa.types.is_nested(kind) and not (
            pa.types.is_dictionary(kind) and pa.types.is_nested(kind.value_type)
        )

    def _chunk(self, batch: pa.RecordBatch, wanted: Mapping[str, int], n_batches: int, number: int) -> Chunk:
        columns = {ours: plain(batch.column(i)) for ours, i in wanted.items()}
        lines = np.arange(self._done + 1, self._done + batch.num_rows + 1)
        is_long, bad, _ = long_cells(columns, lines, allowed=int(self._source.settings.cell_max_bytes))
        keep = pa.array(~is_long)
        self._done += batch.num_rows
        done_bytes = self._source.size_bytes * (number + 1) // n_batches
        return Chunk({ours: c.filter(keep) for ours, c in columns.items()}, lines[~is_long], bad, done_bytes)

    def _check(self, raw: IO[bytes]) -> None:
        """Refuse a file whose batches state too many rows, or buffers that unpack to too much."""
        size = self._source.size_bytes
        raw.seek(max(0, size - 10))
        length, magic = struct.unpack("<i6s", raw.read(10))
        if magic != MAGIC or not 0 < length <= min(size, _METADATA_MAX):
            raise ValueError("it does not end as an Arrow file")
        raw.seek(size - 10 - length)
        footer = _Flat.root(raw.read(length))
        n_bytes = n_rows = 0
        for is_dictionary, field in ((True, 2), (False, 3)):
            for offset, n_metadata in footer.structs(field, "<qi4xq", parts=2):
                for rows, unpacked in _batch(raw, offset, n_metadata, is_dictionary=is_dictionary):
                    n_rows = n_rows if is_dictionary else n_rows + rows
                    n_bytes += unpacked
        if n_rows > records_max(size, self._source.settings):
            raise too_many_records(self._source, n_rows)
        if n_bytes > unpacked_max(size, self._source.settings):
            settings = self._source.settings
            raise unpacks_too_far(self._source.name, n_bytes=size, settings=settings, unpacked_bytes=n_bytes)


class _Flat:
    """A table of a flatbuffer."""

    def __init__(self, data: bytes, at: int) -> None:
        self.data, self.at = data, at
        self._fields = at - struct.unpack_from("<i", data, at)[0]
        if not 0 <= self._fields < len(data):
            raise ValueError("a table points outside of its message")

    @staticmethod
    def root(data: bytes) -> _Flat:
        """Return the root table."""
        return _Flat(data, struct.unpack_from("<I", data)[0])

    def place(self, field: int) -> int | None:
        """Return where a field is; None when it is absent."""
        n_bytes = struct.unpack_from("<H", self.data, self._fields)[0]
        if 4 + 2 * field >= n_bytes:
            return None
        offset = struct.unpack_from("<H", self.data, self._fields + 4 + 2 * field)[0]
        return self.at + offset if offset else None

    def number(self, field: int, form: str) -> int:
        """Return a number; 0 when it is absent."""
        at = self.place(field)
        return 0 if at is None else int(struct.unpack_from(form, self.data, at)[0])

    def table(self, field: int) -> _Flat | None:
        """Return an inner table."""
        at = self.place(field)
        return None if at is None else _Flat(self.data, at + struct.unpack_from("<I", self.data, at)[0])

    def structs(self, field: int, form: str, *, parts: int) -> list[tuple[int, ...]]:
        """Return the first `parts` numbers of each struct of a vector."""
        at = self.place(field)
        if at is None:
            return []
        at += struct.unpack_from("<I", self.data, at)[0]
        count, n_bytes = struct.unpack_from("<I", self.data, at)[0], struct.calcsize(form)
        if count * n_bytes > len(self.data):
            raise ValueError("a list is longer than its message")
        return [struct.unpack_from(form, self.data, at + 4 + i * n_bytes)[:parts] for i in range(count)]


def _batch(raw: IO[bytes], offset: int, n_metadata: int, *, is_dictionary: bool) -> Iterator[tuple[int, int]]:
    """Yield the rows of one batch, and the bytes that its buffers unpack to."""
    if not 8 <= n_metadata <= _METADATA_MAX or offset < 0:
        raise ValueError("a batch is not where the footer says")
    raw.seek(offset)
    data = raw.read(n_metadata)
    start = 8 if data[:4] == b"\xff\xff\xff\xff" else 4  # files of before 2020 lack the mark
    batch: _Flat | None = _Flat.root(data[start:]).table(2)
    if batch is not None and is_dictionary:
        batch = batch.table(1)
    if batch is None:
        raise ValueError("a batch has no content")
    n_bytes = 0
    for place, length in batch.structs(2, "<qq", parts=2):
        n_unpacked = length
        if batch.place(3) is not None and length >= 8:
            raw.seek(offset + n_metadata + place)
            n_unpacked = max(length, struct.unpack("<q", raw.read(8))[0])
        n_bytes += n_unpacked
    yield batch.number(0, "<q"), n_bytes
