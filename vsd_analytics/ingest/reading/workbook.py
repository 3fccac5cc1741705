"""Excel workbooks (xlsx): the one sheet that has rows, read row by row. Needs the extra `xlsx` (openpyxl)."""

from __future__ import annotations

import warnings
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.reading.adapter import Source, empty
from vsd_analytics.ingest.reading.cell_texts import CellTable, cell_text
from vsd_analytics.ingest.reading.column_hints import are_columns
from vsd_analytics.ingest.reading.limits import unpacked_max, unpacks_too_far
from vsd_analytics.ingest.reading.table_file import Header, repeated_names, unique_names

COLUMNS_MAX = 500
LOOKED_AT_ROWS = 50
NOTES_WIDTH = 2
"""Rows of titles and notes have no more values: a word and its value."""


class Workbook(CellTable):
    """One workbook, its header row read: the first row with a value.

    Args:
        source: The file.

    Raises:
        InputError: E202 no sheet has rows, E204 several have, or openpyxl is missing, E205 damaged, E206 it unpacks to
            more than is allowed.
    """

    has_decimal_comma = True  # of numbers that are texts; those of cells are numbers

    def __init__(self, source: Source) -> None:
        self._source = source
        with self._damage():
            self._check_size()
            with self._opened() as book:
                filled = {sheet.title: n for sheet in book.worksheets if (n := _widest_row(sheet))}
        if any(n > NOTES_WIDTH for n in filled.values()):  # a cover with a title and a date is no table
            filled = {name: n for name, n in filled.items() if n > NOTES_WIDTH}
        if not filled:
            raise empty(source)
        if len(filled) > 1:
            raise InputError(
                f"{source.file_name} has {len(filled)} sheets with values",
                code="E204",
                where=Where(source.name),
                why=f"only one can be the table: {', '.join(name[:40] for name in list(filled)[:10])}",
                fix="save the sheet with the records as a file of its own, or as CSV UTF-8",
            )
        self._sheet = next(iter(filled))
        with self._damage(), self._opened() as book:
            first = _first_row(book[self._sheet])
        assert first is not None
        self._n_header, cells = first
        names = [("" if cell is None else cell_text(cell) or "").strip() for cell in cells]
        while names and not names[-1]:
            names.pop()
        super().__init__(
            Header(unique_names(names[:COLUMNS_MAX]), self._n_header, repeated=repeated_names(names[:COLUMNS_MAX])),
            cell_max_bytes=int(source.settings.cell_max_bytes),
        )

    def rows(self) -> Iterator[tuple[int, Sequence[Any], int]]:
        """Yield the rows below the header that have a value; see `CellTable.rows`."""
        width = len(self.header.names)
        with self._damage(), self._opened() as book:
            rows = book[self._sheet].iter_rows(min_row=self._n_header + 1, max_col=width, values_only=True)
            for number, row in enumerate(rows, start=self._n_header + 1):
                if any(cell not in (None, "") for cell in row):
                    yield number, row, 0

    def _check_size(self) -> None:
        with zipfile.ZipFile(self._source.path) as archive:
            n_unpacked = sum(info.file_size for info in archive.infolist())
        if n_unpacked > unpacked_max(self._source.size_bytes, self._source.settings):
            raise unpacks_too_far(
                self._source.name,
                n_bytes=self._source.size_bytes,
                settings=self._source.settings,
                unpacked_bytes=n_unpacked,
            )

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        try:
            import openpyxl
        except ImportError:
            raise InputError(
                f"{self._source.file_name} is an Excel workbook, and openpyxl is not installed",
                code="E204",
                where=Where(self._source.name),
                why="workbooks are read by the extra xlsx",
                fix='pip install "vsd-analytics[xlsx]", or save the sheet as CSV UTF-8',
            ) from None
        # opened here, because openpyxl takes no path with another suffix; its warnings about styles do not matter
        with self._source.path.open("rb") as stream, warnings.catch_warnings(action="ignore"):
            book = openpyxl.load_workbook(stream, read_only=True, data_only=True, keep_links=False)
            for sheet in book.worksheets:
                sheet.reset_dimensions()  # what a file says of its size may be too small, and rows would be lost
            try:
                yield book
            finally:
                book.close()

    @contextmanager
    def _damage(self) -> Iterator[None]:
        try:
            yield
        except InputError:
            raise
        except (zipfile.BadZipFile, zlib.error, OSError, ValueError, LookupError, SyntaxError, TypeError) as error:
            raise self._damaged(error) from None
        except (AttributeError, EOFError, RuntimeError, OverflowError) as error:
            raise self._damaged(error) from None  # openpyxl trusts what it reads

    def _damaged(self, error: Exception) -> InputError:
        return InputError(
            f"{self._source.file_name} is damaged, encrypted or no Excel workbook",
            code="E205",
            where=Where(self._source.name),
            why=f"{type(error).__name__}: {str(error)[:200]}",
            fix="save it again, or as CSV UTF-8; the records before the damage are stored",
        )


def _filled_rows(sheet: Any) -> list[tuple[int, Sequence[Any], int]]:
    """Return number, cells and how many of them have a value, of the rows near the top that have one."""
    rows = sheet.iter_rows(max_row=LOOKED_AT_ROWS, max_col=COLUMNS_MAX, values_only=True)
    counted = [(number, row, sum(c not in (None, "") for c in row)) for number, row in enumerate(rows, start=1)]
    return [(number, row, n) for number, row, n in counted if n]


def _widest_row(sheet: Any) -> int:
    return max((n for _, _, n in _filled_rows(sheet)), default=0)


def _first_row(sheet: Any) -> tuple[int, Sequence[Any]] | None:
    """Return number and cells of the header, or None when there is no value near the top.

    That is the first row whose cells are names of columns, else the first one with a value. A row with one value above
    a row with several is a title, and no header.
    """
    filled = _filled_rows(sheet)
    named = next((f for f in filled if are_columns(str(c) for c in f[1] if isinstance(c, str))), None)
    if named is not None:
        return named[:2]
    while len(filled) > 1 and filled[0][2] == 1 and filled[1][2] > NOTES_WIDTH:
        filled.pop(0)
    return filled[0][:2] if filled else None
