"""Rows of a file with an interval of time each, beside the intervals that are stored: which are new, known, refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from vsd_analytics.errors import InputError, Where

if TYPE_CHECKING:
    from vsd_analytics.config.count_checks import CountWarning

V = TypeVar("V")
Interval = tuple[int, int]
"""Its ends, UTC milliseconds, end exclusive."""


@dataclass(frozen=True, slots=True)
class IntervalRow(Generic[V]):
    """One interval of a file.

    Attributes:
        line: Its line in the file, from 1.
        from_ms, to_ms: Its ends, UTC milliseconds, end exclusive.
        value: What the line says of it.
    """

    line: int
    from_ms: int
    to_ms: int
    value: V


@dataclass(frozen=True, slots=True)
class RefusedRow:
    """A line that was not taken, why, and how to fix it."""

    line: int
    why: str
    fix: str


@dataclass(frozen=True, slots=True)
class AddedIntervals:
    """What became of a file.

    Attributes:
        n_new: Intervals that were added.
        n_known: Intervals that were stored already, with the same value.
        n_replaced: Intervals of `n_new` that had another value before.
        refused: Lines that were not taken.
        warnings: What looks wrong about those that were.
    """

    n_new: int
    n_known: int
    n_replaced: int
    refused: tuple[RefusedRow, ...]
    warnings: tuple[CountWarning, ...] = ()


def new_rows(
    rows: Sequence[IntervalRow[V]],
    before: Mapping[Interval, V],
    refused: list[RefusedRow],
    *,
    is_replacing: bool,
    shown: Callable[[V], str],
) -> tuple[list[IntervalRow[V]], int, int]:
    """Return the rows that are to be stored, and how many were known and how many of those new replace another value.

    Args:
        rows: Rows of a file.
        before: The stored values.
        refused: Gets the rows that are not taken: with another value than the stored one, unless `is_replacing`, or
            over a stored interval of another length.
        is_replacing: An interval that is stored with another value gets the new one.
        shown: Returns a value as text.
    """
    ends = np.array(sorted(before), np.int64).reshape(-1, 2)
    new: list[IntervalRow[V]] = []
    n_known = n_replaced = 0
    for row in rows:
        interval = (row.from_ms, row.to_ms)
        stored = before.get(interval)
        if stored == row.value:
            n_known += 1
        elif stored is not None and not is_replacing:
            why = f"the series has {shown(stored)} for this interval, and the line says {shown(row.value)}"
            refused.append(RefusedRow(row.line, why, "--replace takes the values of the file"))
        elif stored is None and _overlaps(ends, *interval):
            why = "its interval overlaps one of another length that the series has"
            refused.append(RefusedRow(row.line, why, "the --every of the first file, or remove what was added before"))
        else:
            new.append(row)
            n_replaced += stored is not None
    return new, n_known, n_replaced


def _overlaps(ends: np.ndarray, from_ms: int, to_ms: int) -> bool:
    at = int(np.searchsorted(ends[:, 1], from_ms, side="right"))  # the first that ends after its start
    return at < len(ends) and bool(ends[at, 0] < to_ms)


def nothing_usable(path: Path, refused: Sequence[RefusedRow]) -> InputError:
    """Return the error of a file of which no line can be used: E202, with the first line that was refused."""
    if not refused:
        return InputError(f"{path} has no line below its header", code="E202", fix="export it again")
    first = min(refused, key=lambda row: row.line)
    where = Where(str(path), first.line)
    what = f"no line of {path} can be used"
    return InputError(what, code="E202", where=where, why=f"line {first.line}: {first.why}", fix=first.fix)
