"""What every kind of table file offers: its columns, and its rows bit by bit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import pyarrow as pa

from vsd_analytics.ingest.reading.adapter import Rejected


@dataclass(frozen=True, slots=True)
class Header:
    """The columns of one table, as the file gives them.

    Attributes:
        names: Column names, each once.
        repeated: Those that the file has more than once.
        line: Number of the header line; None without a header.
        text: That line, or the first record of a headerless file; None in files that are no text.
    """

    names: Sequence[str]
    line: int | None = None
    text: str | None = None
    repeated: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class Chunk:
    """Some rows.

    Attributes:
        columns: By our names.
        lines: Number of each row in the file, from 1.
        rejected: Rows left out, such as one with a cell too long to read.
        done_bytes: How far into the file the rows reach.
        whole: Text of each row's line, by its number, for formats whose lines can be read again on their own.
    """

    columns: Mapping[str, pa.Array]
    lines: np.ndarray
    rejected: list[Rejected] = field(default_factory=list)
    done_bytes: int = 0
    whole: Mapping[int, str | None] | None = None


class TableFile(Protocol):
    """One file that holds a table."""

    header: Header
    first_line: str | None
    """Line needed above another one to read it again; None = lines cannot be read on their own."""
    has_decimal_comma: bool
    """Whether numbers may have a comma for the point."""

    def chunks(self, wanted: Mapping[str, int]) -> Iterator[Chunk]:
        """Read columns, given the number of the file's column for each of our names."""
        ...

    def readable(self) -> AbstractContextManager[None]:
        """Turn errors of a library about columns and damage, also those while chunks are used, into E203 and E205."""
        ...

    def has_text(self, column: int) -> bool:
        """Return whether a column holds texts."""
        ...

    def can_read(self, column: int) -> bool:
        """Return whether a column is of a type that can be read."""
        ...


def repeated_names(names: Sequence[str]) -> frozenset[str]:
    """Return the names that come more than once."""
    return frozenset(name for name, n in Counter(names).items() if n > 1 and name not in ("", "_"))


def unique_names(names: Sequence[str]) -> list[str]:
    """Return names that are all different: blank, `_` and repeated ones become `_` and the column's number."""
    seen: set[str] = set()
    unique = []
    for i, name in enumerate(names):
        is_taken = not name or name == "_" or name in seen
        seen.add(name)
        unique.append(f"_{i}" if is_taken else name)
    return unique
