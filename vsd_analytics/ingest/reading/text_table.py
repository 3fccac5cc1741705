"""Tables as text: comma, semicolon, tab, bar or blanks between cells, with or without a header line.

A line is a record: a quote that is not closed on its line spoils that line, never the lines after it.
"""

from __future__ import annotations

import contextlib
import csv
from collections.abc import Callable, Iterator, Mapping

import numpy as np
import pyarrow as pa

from vsd_analytics.config.file_columns import FILE_COLUMNS
from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import IngestOptions, Rejected, Source, bytes_read, empty
from vsd_analytics.ingest.reading.column_hints import are_columns
from vsd_analytics.ingest.reading.raw import BadRowError, rejected, whole_line
from vsd_analytics.ingest.reading.table_file import Chunk, Header, repeated_names, unique_names
from vsd_analytics.ingest.reading.text_lines import line_blocks

BLOCK_BYTES = 1 << 20  # a block may be all line ends, or lines of one character, each of them a record
_TITLE_LINES = 30
"""Lines above a header that may hold a title, remarks or the `sep=;` of Excel."""


class TextTable:
    """One text table, its first line read.

    Args:
        source: The file.
        options: `columns` names the columns of a file without a header; `line_max_bytes` bounds a line.

    Raises:
        InputError: E202 no line, E203 too many names for its columns, E204 its first line is no row of a table.
    """

    def __init__(self, source: Source, options: IngestOptions) -> None:
        self._source, self._max_bytes = source, options.line_max_bytes
        head = source.head()
        lines = [_header_text(line) for line in head.removeprefix(b"\xef\xbb\xbf").split(b"\n")]
        # with --columns there is no header line, so lines that start with # before the first record are comments
        skipped = "#" if options.columns is not None else ()
        at = next((i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(skipped)), None)
        if at is None:
            raise empty(source)
        if options.columns is None:
            at = _header_line(lines, at, options)
        # annotated CSV of InfluxDB repeats its annotations and its header for each of its tables
        self._is_annotated = any(line.startswith(("#group", "#datatype")) for line in lines[: at + 1])
        first = lines[at].rstrip("\r")
        self._delimiter = delimiter_of(first, n_cells=len(options.columns or ()))
        try:
            cells = [c.strip() for c in split_by(self._delimiter)(first)]
        except BadRowError as error:
            why = f"its first line cannot be split into cells: {error.args[1]}"
            raise InputError(
                f"{source.file_name} cannot be read as a table",
                code="E204",
                where=Where(source.name, at + 1, first),
                why=why,
                fix="check that it is a text table, or name its format with --format",
            ) from None
        if options.columns is None:
            cells[0] = cells[0].lstrip("# ")
            cells = cells[1:] if self._delimiter == " " and not cells[0] else cells
            self.header = Header(unique_names(cells), at + 1, first, repeated_names(cells))
        else:
            if len(options.columns) > len(cells):
                raise InputError(
                    f"--columns names {len(options.columns)} columns, {source.file_name} has {len(cells)}",
                    code="E203",
                    where=Where(source.name, at + 1, first),
                    fix="one name for each column, in the order of the file; _ for one to ignore",
                )
            names = unique_names([*options.columns, *[""] * (len(cells) - len(options.columns))])
            self.header = Header(names, None, first)
        self.first_line: str | None = first
        self.has_decimal_comma = self._delimiter != ","
        self._n_cells = len(self.header.names)
        self._n_header = at + (options.columns is None)
        self._names = sorted(cells) if options.columns is None and not self.header.repeated else []
        self._in_order = cells

    def chunks(self, wanted: Mapping[str, int]) -> Iterator[Chunk]:
        """Read columns as texts; see `TableFile.chunks`.

        Raises:
            InputError: E205, E206 when the file's compressed data are damaged or unpack to too much.
        """
        with self._source.open() as stream:
            for first, lines in line_blocks(stream, max_bytes=self._max_bytes, block_bytes=BLOCK_BYTES):
                numbers, rows, bad = self._records(first, lines)
                columns = {ours: pa.array([row[i] for row in rows], pa.string()) for ours, i in wanted.items()}
                at = np.array(numbers, dtype=np.int64)
                yield Chunk(columns, at, bad, bytes_read(stream), _WholeLines(first, lines))

    def readable(self) -> contextlib.AbstractContextManager[None]:
        """Do nothing: the lines of a text need no library."""
        return contextlib.nullcontext()

    def has_text(self, column: int) -> bool:
        """Return True: every column holds text."""
        return True

    def can_read(self, column: int) -> bool:
        """Return True: every column can be read as text."""
        return True

    def _records(self, first: int, lines: list[bytes | None]) -> tuple[list[int], list[list[str]], list[Rejected]]:
        """Return line numbers and cells of the records in some lines, and the lines that are no records."""
        split = split_by(self._delimiter)
        numbers: list[int] = []
        rows: list[list[str]] = []
        bad: list[Rejected] = []
        for number, line in enumerate(lines, first):
            if number <= self._n_header or line == b"":
                continue
            try:
                if line is None:
                    raise BadRowError("line-too-long", f"the line is longer than {self._max_bytes:,} bytes")
                text = as_text(line)
                if self._is_annotated and (text.startswith("#") or text.rstrip("\r") == self.first_line):
                    continue
                cells = split(text)
                if len(cells) != self._n_cells:
                    if not text.strip():
                        continue
                    if len(cells) != self._n_cells + 1 or cells[-1].strip():
                        detail = f"the row has {len(cells)} fields, {self._n_cells} expected"
                        raise BadRowError("wrong-number-of-fields", detail)
                if cells[0] in self._names and self._is_other_header(cells):
                    raise self._other_header(number, text)
                numbers.append(number)
                rows.append(cells)
            except BadRowError as error:
                reason, detail = error.args
                bad.append(rejected(number, reason=reason, detail=detail, record=line or b""))
        return numbers, rows, bad

    def _is_other_header(self, cells: list[str]) -> bool:
        names = [cell.strip() for cell in cells]
        return names != self._in_order and sorted(names) == self._names

    def _other_header(self, number: int, text: str) -> InputError:
        return InputError(
            f"{self._source.file_name} has a second header, with its columns in another order",
            code="E203",
            where=Where(self._source.name, number, text),
            why="several exports seem to be joined in it; the rows below would be read from the wrong columns",
            fix="make a file of each part",
        )


class _WholeLines(Mapping[int, str | None]):
    """The lines of a block as texts, by their numbers; made into text only when asked for."""

    def __init__(self, first: int, lines: list[bytes | None]) -> None:
        self._first, self._lines = first, lines

    def __getitem__(self, number: int) -> str | None:
        return whole_line(self._lines[number - self._first])

    def __iter__(self) -> Iterator[int]:
        return iter(range(self._first, self._first + len(self._lines)))

    def __len__(self) -> int:
        return len(self._lines)


def _header_line(lines: list[str], first: int, options: IngestOptions) -> int:
    """Return which line is the header: the first, unless a title or remarks are above one with wanted or telling names.

    Args:
        lines: The head of the file.
        first: The first line that is not blank.
        options: `map` and `site_map` have names of the file.
    """
    theirs = [part for name in (*options.map.values(), *options.site_map.values()) for part in (name, *name.split("+"))]
    wanted = {name.strip().lower() for name in (*FILE_COLUMNS, *theirs)}

    def names_in(line: str) -> list[str]:
        try:
            return split_by(delimiter_of(line))(line.strip().lstrip("# "))
        except BadRowError:
            return []

    def n_wanted(line: str) -> int:
        return len({name.strip().lower() for name in names_in(line)} & wanted)

    if n_wanted(lines[first]):
        return first
    if lines[first].startswith(("#group", "#datatype")):
        return next((i for i in range(first, len(lines)) if not lines[i].startswith("#") and lines[i].strip()), first)
    below = range(first, min(len(lines), first + _TITLE_LINES))
    return next((i for i in below if n_wanted(lines[i]) > 1 or are_columns(names_in(lines[i]))), first)


def delimiter_of(line: str, *, n_cells: int = 0) -> str:
    """Return the delimiter of a line: the most frequent of tab, semicolon, comma and bar, else a blank."""
    counts = {d: line.count(d) for d in ("\t", ";", ",", "|")}
    enough = [d for d, n in counts.items() if n and n + 1 >= n_cells > 0]
    best = enough[0] if enough else max(counts, key=lambda d: counts[d])
    return best if counts[best] else " "


def split_by(delimiter: str) -> Callable[[str], list[str]]:
    """Return the function that splits a line into cells; it raises `BadRowError` where quotes do not match."""
    if delimiter == " ":
        return lambda line: line.split() if '"' not in line else _quoted(" ".join(line.split()), " ")
    return lambda line: line.split(delimiter) if '"' not in line else _quoted(line, delimiter)


def as_text(line: bytes) -> str:
    """Return bytes as text; those that are not UTF-8 stay as escapes."""
    return line.decode("utf-8", "backslashreplace")


def _header_text(line: bytes) -> str:
    """Return a line with names of columns as text: UTF-8, else as Windows of Western Europe writes it."""
    for encoding in ("utf-8", "cp1252"):
        try:
            return line.decode(encoding)
        except UnicodeDecodeError:
            continue
    return as_text(line)


def _quoted(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
    except (csv.Error, StopIteration) as error:
        raise BadRowError("bad-quotes", f"quotes do not match on this line: {error}") from None
