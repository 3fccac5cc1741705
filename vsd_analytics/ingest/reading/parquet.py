"""Parquet files in bounded memory: sizes are checked in the footer, in the page headers, and while reading.

The sizes in the footer are checked first. The footer may lie, so the headers of a row group's pages are checked before
the row group is read, and decoded bytes are counted against the same limit. Texts are read as the dictionaries they are
stored as, so that one long text in every row is in memory once.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.errors import InputError, Where
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
from vsd_analytics.ingest.reading.limits import (
    MB,
    records_max,
    too_many,
    too_many_records,
    unpacked_max,
    unpacks_too_far,
)
from vsd_analytics.ingest.reading.parquet_pages import PageError, ParquetPage, pages
from vsd_analytics.ingest.reading.table_file import Chunk, Header, repeated_names, unique_names

MAGIC = b"PAR1"
READ_ROWS = BATCH_ROWS // 2
READ_BYTES = 16 * MB
"""Bytes of a text column read at once."""
HANDED_BYTES = 16 * MB
"""Texts are yielded in pieces of about this size."""
MESSAGES_MAX = 1_000
"""Rows with structs and lists that are values of Python at once."""
VALUE_BYTES = 8
"""Bytes that a value takes in memory at least."""


class ParquetTable:
    """One Parquet file, its footer read.

    Args:
        source: The file.

    Raises:
        InputError: E205 when its footer cannot be read.
    """

    def __init__(self, source: Source) -> None:
        self._source, self._settings = source, source.settings
        self._done = 0
        self._unpacked, self._allowed = 0, unpacked_max(source.size_bytes, source.settings)
        try:
            with pq.ParquetFile(source.path) as file:
                self._metadata = file.metadata
                fields = flat_fields(file.schema_arrow)
                parquet = file.metadata.schema
                self._leaves = {parquet.column(i).path: i for i in reversed(range(file.metadata.num_columns))}
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:  # the last: a name that is no UTF-8
            raise InputError(
                f"{source.file_name} is not a whole Parquet file",
                code="E205",
                where=Where(source.name),
                why=f"its footer cannot be read, as when a copy was cut short: {str(error)[:200]}",
                fix="copy or export the file again",
            ) from None
        self.names: list[str] = [name for name, _ in fields]
        self._types = [kind for _, kind in fields]
        self.has_lists = any(pa.types.is_nested(kind) for kind in self._types)
        self.header = Header(unique_names(self.names), repeated=repeated_names(self.names))
        self.first_line: str | None = None
        self.has_decimal_comma = False
        self.n_rows: int = self._metadata.num_rows

    def chunks(self, wanted: Mapping[str, int]) -> Iterator[Chunk]:
        """Read columns.

        Args:
            wanted: Number of the column for each of our names.

        Raises:
            InputError: E203 a column is of a type that cannot be read, E206 the file unpacks to more than is allowed,
                E209 it has more rows or a larger page than is allowed. Chunks before are valid.
            pyarrow.ArrowException, OSError, PageError: The file is damaged; see `readable`.
        """
        self._done = 0
        names = {ours: self.names[i] for ours, i in wanted.items()}
        leaves = {name: self._leaf(name) for name in names.values()}
        self._check_footer(list(leaves.values()))
        texts = [
            name
            for name, i in leaves.items()
            if self._metadata.schema.column(i).physical_type == "BYTE_ARRAY" and "." not in name
        ]
        held: list[pa.RecordBatch] = []  # small row groups are worked on together
        n_rows = n_bytes = 0
        damage: Exception | None = None
        batches = self._batches(leaves, texts)
        while damage is None:
            try:
                batch = next(batches, None)
            except (pa.ArrowException, PageError, OSError, InputError) as error:  # what came before is handed on first
                batch, damage = None, error
            is_other = batch is None or (bool(held) and held[0].schema != batch.schema)
            if held and (is_other or n_rows >= READ_ROWS or n_bytes >= READ_BYTES):
                ready, held, n_rows, n_bytes = held, [], 0, 0
                yield from self._in_pieces(ready, names)
            if batch is None:
                break
            held.append(batch)
            n_rows, n_bytes = n_rows + batch.num_rows, n_bytes + batch.get_total_buffer_size()
        if damage is not None:
            raise damage

    def _batches(self, leaves: Mapping[str, int], texts: list[str]) -> Iterator[pa.RecordBatch]:
        """Read row group by row group, texts as dictionaries where they can be."""
        path, metadata = self._source.path, self._metadata
        with (
            path.open("rb") as raw,
            pq.ParquetFile(path, metadata=metadata, read_dictionary=texts) as coded,
            pq.ParquetFile(path, metadata=metadata) as plain,
        ):
            for group in range(metadata.num_row_groups):
                if not metadata.row_group(group).num_rows:
                    continue
                rows, is_coded = self._how(raw, group, leaves)
                file = coded if is_coded else plain
                # a thread a column is worth it where batches are large
                threads = rows == READ_ROWS
                parts = file.iter_batches(rows, row_groups=[group], columns=sorted(leaves), use_threads=threads)
                yield from map(flat, parts)

    def rows(self) -> Iterator[tuple[int, dict[str, Any], int]]:
        """Yield number (from 1), values and done bytes of each row, with what its structs and lists hold.

        Raises:
            InputError: E205 to E209, as `chunks`.
        """
        self._check_footer(list(self._leaves.values()))
        number, metadata = 0, self._metadata
        with self.readable(), self._source.path.open("rb") as raw, pq.ParquetFile(self._source.path) as file:
            for group in range(metadata.num_row_groups):
                n_rows, _ = self._how(raw, group, self._leaves) if metadata.row_group(group).num_rows else (1, False)
                for batch in file.iter_batches(min(n_rows, MESSAGES_MAX), row_groups=[group]):
                    self._count(batch.nbytes)
                    for row in as_messages(batch):
                        number += 1
                        yield number, row, self._done_bytes(number)

    @contextmanager
    def readable(self) -> Iterator[None]:
        """Turn pyarrow's errors about columns and damage, also those while chunks are used, into E203 and E205."""
        try:
            yield
        except (pa.ArrowNotImplementedError, pa.ArrowTypeError, pa.ArrowKeyError) as error:
            raise no_such_type(self._source, str(error)[:200]) from None
        except (pa.ArrowException, PageError, OSError) as error:
            raise damaged_after(self._source, self._done, why=str(error)[:200]) from None

    def has_text(self, column: int) -> bool:
        """Return whether a column holds texts."""
        return holds_text(self._types[column])

    def can_read(self, column: int) -> bool:
        """Return whether a column is of a type that can be read: no list and no struct, and its cells are short."""
        try:
            self._leaf(self.names[column])
        except InputError:
            return False
        return True

    def _leaf(self, name: str) -> int:
        """Return the number of the stored column of this name: lists and structs have none, they have parts."""
        at = self._leaves.get(name)
        if at is None or self._metadata.schema.column(at).max_repetition_level:
            raise no_such_type(self._source, f"{name[:80]} is a {str(self._types[self.names.index(name)])[:80]}")
        length = self._metadata.schema.column(at).length
        if length is not None and length > self._settings.cell_max_bytes:
            allowed = int(self._settings.cell_max_bytes)
            why = f"each cell of {name[:80]} is so long; ids, times and numbers are short"
            raise too_many(self._source, f"cells of {length:,} bytes", "cell_max_bytes", allowed=allowed, why=why)
        return at

    def _check_footer(self, leaves: list[int]) -> None:
        """Refuse a file whose own footer states too many rows or bytes."""
        if self.n_rows > records_max(self._source.size_bytes, self._settings):
            raise too_many_records(self._source, self.n_rows)
        stored = 0
        for group in range(self._metadata.num_row_groups):
            row_group = self._metadata.row_group(group)
            stored += sum(row_group.column(i).total_uncompressed_size for i in leaves)
        self._count(max(stored, VALUE_BYTES * self.n_rows * len(leaves)))
        self._unpacked = 0

    def _count(self, n_bytes: int) -> None:
        self._unpacked += n_bytes
        if self._unpacked > self._allowed:
            raise unpacks_too_far(
                self._source.name,
                n_bytes=self._source.size_bytes,
                settings=self._settings,
                unpacked_bytes=self._unpacked,
            )

    def _how(self, raw: IO[bytes], group: int, leaves: Mapping[str, int]) -> tuple[int, bool]:
        """Check the pages of a row group, and find how it is read.

        Returns:
            How many rows take at most about `READ_BYTES` a column, and whether texts can be read as dictionaries.
        """
        pages_of_column: dict[str, list[ParquetPage]] = {}
        rows = READ_ROWS
        for name, leaf in leaves.items():
            column = self._metadata.row_group(group).column(leaf)
            first = column.dictionary_page_offset
            start = column.data_page_offset if not first or first > column.data_page_offset else first
            end = min(start + column.total_compressed_size, self._source.size_bytes)
            read = []
            for page in pages(raw, start=start, end=end):
                self._check_page(page, name)
                self._count(page.unpacked_bytes)
                read.append(page)
            if column.physical_type == "BYTE_ARRAY":
                pages_of_column[name] = read
            rows = min(rows, READ_BYTES // max(1, self._metadata.schema.column(leaf).length or VALUE_BYTES))
        is_coded = all(page.can_be_dictionary for read in pages_of_column.values() for page in read)
        sizes = [p.text_bytes for read in pages_of_column.values() for p in read if not (is_coded and p.is_dictionary)]
        return max(1, min(rows, int(READ_BYTES // max(1.0, *sizes)))) if sizes else max(1, rows), is_coded

    def _check_page(self, page: ParquetPage, name: str) -> None:
        allowed = min(int(self._settings.page_max_mb * MB), self._allowed)
        if page.unpacked_bytes > allowed:
            shown = f"a page of {page.unpacked_bytes:,} bytes in {name[:80]}"
            why = "a page is unpacked whole; writers make pages of about 1 MB"
            raise too_many(self._source, shown, "page_max_mb", allowed=allowed, why=why)

    def _in_pieces(self, held: list[pa.RecordBatch], names: Mapping[str, str]) -> Iterator[Chunk]:
        """Leave out rows with a cell that is too long, count what texts take, and hand on the rest bit by bit."""
        batch = held[0] if len(held) == 1 else pa.Table.from_batches(held).unify_dictionaries().combine_chunks()
        places = {ours: batch.schema.get_all_field_indices(name)[0] for ours, name in names.items()}
        columns = {ours: _whole(batch.column(i)) for ours, i in places.items()}
        n_rows = len(next(iter(columns.values())))
        lines = np.arange(self._done + 1, self._done + n_rows + 1)
        is_long, too_long, n_bytes = long_cells(columns, lines, allowed=int(self._settings.cell_max_bytes))
        self._count(n_bytes + VALUE_BYTES * n_rows * len(columns))
        if too_long:
            keep = pa.array(~is_long)
            columns = {ours: column.filter(keep) for ours, column in columns.items()}
            lines = lines[~is_long]
        step = max(1, len(lines) // (1 + n_bytes // HANDED_BYTES))
        for at in range(0, len(lines), step):
            part = {ours: plain(column.slice(at, step)) for ours, column in columns.items()}
            yield Chunk(part, lines[at : at + step], too_long, self._done_bytes(self._done + n_rows))
            too_long = []
        if too_long:
            nothing = {ours: plain(column) for ours, column in columns.items()}
            yield Chunk(nothing, lines, too_long, self._done_bytes(self._done + n_rows))
        self._done += n_rows

    def _done_bytes(self, n_rows: int) -> int:
        return self._source.size_bytes * n_rows // max(1, self.n_rows)


def _whole(column: pa.Array | pa.ChunkedArray) -> pa.Array:
    return column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
