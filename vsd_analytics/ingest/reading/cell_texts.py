"""Rows of Python values as columns of texts, for files that name each cell: JSON and spreadsheets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from datetime import date, datetime, time
from typing import Any

import numpy as np
import pyarrow as pa

from vsd_analytics.ingest.reading.adapter import Rejected
from vsd_analytics.ingest.reading.raw import rejected
from vsd_analytics.ingest.reading.table_file import Chunk, Header

ROWS = 20_000


class CellTable(ABC):
    """A table whose rows come one by one, as lists of values. Subclasses give the rows.

    Args:
        header: Its columns.
        cell_max_bytes: Rows with a longer cell are rejected.
    """

    first_line: str | None = None
    has_decimal_comma = False

    def __init__(self, header: Header, *, cell_max_bytes: int) -> None:
        self.header, self._cell_max = header, cell_max_bytes

    @abstractmethod
    def rows(self) -> Iterator[tuple[int, Sequence[Any], int]]:
        """Yield number, values in the order of the header, and bytes of the file read so far."""

    def chunks(self, wanted: Mapping[str, int]) -> Iterator[Chunk]:
        """Read columns as texts; see `TableFile.chunks`. What comes before damage is yielded first."""
        numbers: list[int] = []
        cells: list[list[str | None]] = []
        bad: list[Rejected] = []
        done = 0
        damage: Exception | None = None
        rows = self.rows()
        while True:
            try:
                following = next(rows, None)
            except Exception as error:  # raised again below, once the rows before it are handed on
                following, damage = None, error
            if following is None or len(numbers) + len(bad) >= ROWS:
                columns = {ours: pa.array([row[i] for row in cells], pa.string()) for i, ours in enumerate(wanted)}
                yield Chunk(columns, np.array(numbers, dtype=np.int64), bad, done)
                numbers, cells, bad = [], [], []
            if damage is not None:
                raise damage
            if following is None:
                return
            number, values, done = following
            texts = [cell_text(values[i]) if i < len(values) else None for i in wanted.values()]
            if any(text is not None and len(text) > self._cell_max for text in texts):
                detail = f"a cell is longer than {self._cell_max:,} bytes (cell_max_bytes)"
                bad.append(rejected(number, reason="cell-too-long", detail=detail))
                continue
            numbers.append(number)
            cells.append(texts)

    def readable(self) -> AbstractContextManager[None]:
        """Do nothing: `rows` raises errors for people."""
        return nullcontext()

    def has_text(self, column: int) -> bool:
        """Return True: every cell is read as text."""
        return True

    def can_read(self, column: int) -> bool:
        """Return True: every cell is read as text."""
        return True


def cell_text(value: Any) -> str | None:
    """Return a value as a text table would write it; None is missing."""
    if value is None or isinstance(value, str):
        return value if value is None else value.encode("utf-8", "backslashreplace").decode()
    if isinstance(value, datetime | date | time):
        return value.isoformat()
    return str(value)
