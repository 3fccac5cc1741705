"""Relations as numpy arrays: what their columns hold, and the few steps that all of them are computed with.

Columns are plain arrays of one length. Ids are integers in the order of their names, -1 where unknown. Other numbers
are int64, `NULL` where unknown. Names that begin with an underscore are columns of arrays only: no SQL file has them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import cycle
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.warehouse.held import Bools, Columns, Ints

_DIGIT_BITS = 16
_ODD = (np.uint64(0x9E3779B97F4A7C15), np.uint64(0xC2B2AE3D27D4EB4F))
"""Multipliers that spread neighbouring numbers over all bits."""
_BLOCK = 250_000
_RUN = 16
"""Rows of a run at least, on average, for sorting runs to cost less than sorting rows."""
_NEAR = 32
"""Rows are almost in order where at most one of this many is greater than the row this far behind it."""
_ROOM = 4
"""Numbers a row may take of a table with a place for every key; where it is more, keys are sorted."""


class LazyColumns(Columns):
    """Columns of which some are computed when they are first read: most facts read a few of a relation's.

    Iterating yields those that are there, so a reader names the columns that it wants.

    Args:
        columns: Columns that are there.
        later: What computes each of the others, by name.
    """

    def __init__(self, columns: Columns, later: Mapping[str, Callable[[], NDArray[Any]]]) -> None:
        super().__init__(columns)
        self._later = dict(later)

    def __missing__(self, name: str) -> NDArray[Any]:
        self[name] = self._later.pop(name)()
        return self[name]


def picked(values: NDArray[Any], rows: NDArray[Any]) -> NDArray[Any]:
    """Return the values of some rows, by number; all of them are there, so nothing is checked, which takes a third."""
    return values.take(rows, mode="clip")


def take(columns: Columns, rows: NDArray[Any], *names: str) -> Columns:
    """Return some rows, by number or by mask, of the columns with these names; of all columns without names.

    A mask that leaves out no row copies nothing.
    """
    names = names or tuple(columns)
    if rows.dtype == np.bool_:
        if rows.all():
            return {name: columns[name] for name in names}
        rows = np.flatnonzero(rows)
    return {name: picked(columns[name], rows) for name in names}


def order_by(*keys: NDArray[Any]) -> Ints:
    """Return the numbers of the rows in order of integer keys, the first one first; equal rows stay in order."""
    packed, n_bits = packed_keys(*keys)
    return np.lexsort(keys[::-1]) if packed is None else _order(packed, n_bits)


def grouped_by(*keys: NDArray[Any]) -> tuple[Ints, Ints]:
    """Return the numbers of the rows in order of keys, and where each group of equal keys begins in this order."""
    packed, n_bits = packed_keys(*keys)
    if packed is None:
        order = np.lexsort(keys[::-1])
        return order, starts_of(*(key[order] for key in keys))
    order = _order(packed, n_bits)
    return order, starts_of(picked(packed, order))


def packed_keys(*keys: NDArray[Any]) -> tuple[Ints | None, int]:
    """Return keys as one number in their order, and its bits; None where they need more than an integer has."""
    n, room = len(keys[0]), 1
    packed = np.zeros(n, dtype=np.int64)
    for key in keys if n else ():
        low = int(key.min())
        size = int(key.max()) - low + 1
        room *= size
        if room >= 2**62:
            return None, 0
        if size > 1:
            packed *= size
            packed += key
            packed -= low
    return packed, (room - 1).bit_length()


def _order(packed: Ints, n_bits: int) -> Ints:
    """Sort runs of rows where these are long, as stored records are in order; else 16 bits at a time, the lowest first.

    Numpy sorts so short integers by counting, in linear time. It merges runs of longer ones, which takes a fifth of
    that where few rows are far from their place, such as people who are in order but for those of a frame.
    """
    for is_next in (packed[1:] < packed[:-1], packed[1:] != packed[:-1]):
        n_runs = np.count_nonzero(is_next) + 1
        if n_runs * _RUN <= len(packed) and (order := _order_of_runs(packed, is_next)) is not None:
            return order
    if n_bits > _DIGIT_BITS and np.count_nonzero(packed[_NEAR:] < packed[:-_NEAR]) * _NEAR <= len(packed):
        return np.argsort(packed, kind="stable")
    order = np.argsort(packed.astype(np.uint16), kind="stable")  # a cast takes the lowest 16 bits
    for shift in range(_DIGIT_BITS, n_bits, _DIGIT_BITS):
        order = picked(order, np.argsort(picked((packed >> shift).astype(np.uint16), order), kind="stable"))
    return order


def _order_of_runs(packed: Ints, is_next: Bools) -> Ints | None:
    """Return the order of rows whose runs are each in order; None where two runs overlap.

    Args:
        packed: The keys.
        is_next: Whether a run begins with the row after each row but the last.
    """
    starts = np.append(0, np.flatnonzero(is_next) + 1)
    ends = ends_of(starts, len(packed))
    runs = np.argsort(packed[starts], kind="stable")
    first, last = packed[starts[runs]], packed[ends[runs] - 1]
    # of two runs with one key in both, the rows would have to be merged, unless both have that key alone
    if np.any((last[:-1] > first[1:]) | ((last[:-1] == first[1:]) & (first[:-1] != last[1:]))):
        return None
    n = (ends - starts)[runs]
    order = np.arange(len(packed))
    order += np.repeat(starts[runs] - (np.cumsum(n) - n), n)
    return order


def distinct(keys: Ints) -> Ints:
    """Return the different numbers in order."""
    keys = keys[starts_of(keys)]  # few are left where equal ones follow each other
    order, starts = grouped_by(keys)
    return keys[order[starts]]


def rows_of(keys: Ints, wanted: Ints) -> Ints:
    """Return the row of each wanted key, -1 for none; keys are in order, each once."""
    if not len(keys):
        return np.full(len(wanted), -1, dtype=np.int64)
    rows = np.searchsorted(keys, wanted)
    rows[picked(keys, rows) != wanted] = -1  # beyond the last key the last one is picked
    return rows


def one_of_each(keys: Ints) -> Ints:
    """Return the number of one row of each different key, in no order.

    Each row writes its number into a table, at a hash of its key. The row whose number is there afterwards is the one
    of its key; rows of other keys at that place try again with another hash. For some ten thousand rows, whose table
    fits into the caches, this takes half the time of sorting.
    """
    n_bits = (4 * len(keys)).bit_length()
    at, rows, chosen = np.empty(1 << n_bits, dtype=np.int32), np.arange(len(keys)), list[Ints]()
    for factor in cycle(_ODD):
        own = np.arange(len(rows), dtype=np.int32)
        place = ((keys.view(np.uint64) * factor) >> np.uint64(64 - n_bits)).view(np.int64)
        at[place] = own
        there = picked(at, place)
        chosen.append(rows[there == own])
        others = np.flatnonzero(picked(keys, there) != keys)
        if not len(others):
            break
        rows, keys = rows[others], keys[others]
    return np.concatenate(chosen)


def one_alike(place: Ints, n_places: int, *keys: NDArray[Any]) -> Ints:
    """Return for each row the number of one row with equal keys, the same for all rows that are equal.

    Each row writes its number into a table, at its place. Rows whose keys differ from those of the row that is there
    afterwards are sorted. So this takes a fraction of sorting where most rows of a place have the same keys.

    Args:
        place: Place of each row in the table; rows with equal keys have one place.
        n_places: Number of places.
        keys: The keys.
    """
    own = np.arange(len(place))
    at = np.zeros(n_places, dtype=np.int64)
    at[place] = own
    alike = picked(at, place)
    others = np.flatnonzero(alike != own)
    rows = alike[others]
    is_same = np.ones(len(others), dtype=np.bool_)
    for key in keys:
        is_same &= picked(key, rows) == picked(key, others)
    others = others[~is_same]
    order, starts = grouped_by(*(picked(key, others) for key in keys))
    others = others[order]
    alike[others] = np.repeat(others[starts], np.diff(starts, append=len(others)))
    return alike


def starts_of(*keys: NDArray[Any]) -> Ints:
    """Return the first row of each run of equal keys, given rows in order of the keys."""
    n = len(keys[0])
    is_first = np.ones(n, dtype=np.bool_)
    if n:
        is_first[1:] = keys[0][1:] != keys[0][:-1]
        for key in keys[1:]:
            is_first[1:] |= key[1:] != key[:-1]
    return np.flatnonzero(is_first)


def run_of(starts: Ints, n: int) -> Ints:
    """Return the number of its run for each of `n` rows, given the first row of each run."""
    return np.repeat(np.arange(len(starts)), np.diff(starts, append=n))


def ends_of(starts: Ints, n: int) -> Ints:
    """Return the row after each run, given the first row of each of the runs of `n` rows."""
    return np.append(starts[1:], n)[: len(starts)]


def sums(values: NDArray[Any], starts: Ints) -> Ints:
    """Return the sum of each run."""
    return np.add.reduceat(values.astype(np.int64), starts) if len(starts) else np.zeros(0, dtype=np.int64)


def n_true(is_chosen: Bools, starts: Ints) -> Ints:
    """Return how many rows of each run are chosen; where all or none are, nothing is added up."""
    if is_chosen.all():
        return np.diff(starts, append=len(is_chosen))
    return sums(is_chosen, starts) if is_chosen.any() else np.zeros(len(starts), dtype=np.int64)


def least(values: NDArray[Any], starts: Ints) -> NDArray[Any]:
    """Return the least value of each run."""
    return np.minimum.reduceat(values, starts) if len(starts) else values[:0]


def greatest(values: NDArray[Any], starts: Ints) -> NDArray[Any]:
    """Return the greatest value of each run."""
    return np.maximum.reduceat(values, starts) if len(starts) else values[:0]


def summed(keys: Columns, values: Columns) -> Columns:
    """Return the sums of values by all combinations of keys that occur, in order of the keys."""
    runs = starts_of(*keys.values())
    if len(runs) * _RUN <= len(next(iter(keys.values()))):  # most records of a key follow each other
        keys, values = take(keys, runs), {name: sums(v, runs) for name, v in values.items()}
    order, starts = grouped_by(*keys.values())
    return {**take(keys, order[starts]), **{name: sums(v[order], starts) for name, v in values.items()}}


def counted(n: int, *series: tuple[Ints, Ints | None]) -> tuple[Ints, list[Ints]]:
    """Return the keys that occur, in order, and of each series how often each occurs, or the sum of its weights.

    Keys are counted in a table with a place for every key, where that needs few numbers for each row.

    Args:
        n: Keys are at least 0 and less than this.
        series: Keys, and a weight for each; None = 1. A key that only a series with weights has is left out.
    """
    every = np.arange(n) if n <= _ROOM * sum(len(keys) for keys, _ in series) else None
    if every is None:
        every = distinct(np.concatenate([keys for keys, _ in series]))
        series = tuple((np.searchsorted(every, keys), weights) for keys, weights in series)
    counts = [np.bincount(keys, weights, minlength=len(every)).astype(np.int64, copy=False) for keys, weights in series]
    used = np.flatnonzero(sum(count for count, (_, weights) in zip(counts, series, strict=True) if weights is None))
    return every[used], [count[used] for count in counts]


def beside(group: Ints, x: Ints, reach: int) -> Iterator[tuple[Ints, Ints]]:
    """Yield the pairs of rows of one group whose `x` differ by at most `reach`: each pair once, in blocks.

    A row is paired with those after it that are near enough: rows in a strip cost work, not all rows of a group.

    Args:
        group: Group of each row, in order, not negative.
        x: Coordinate of each row, in order within its group.
        reach: Greatest difference.
    """
    if not len(x):
        return
    low = int(x.min())
    key = group * np.int64(int(x.max()) - low + reach + 1) + (x - low)
    n_after = np.searchsorted(key, key + reach, side="right") - np.arange(1, len(key) + 1)
    done = np.concatenate([[0], np.cumsum(n_after)])
    first = 0
    while first < len(key):
        after = max(first + 1, int(np.searchsorted(done, done[first] + _BLOCK, side="right")) - 1)
        n = n_after[first:after]
        rows = np.repeat(np.arange(first, after), n)
        yield rows, rows + 1 + (np.arange(len(rows)) - np.repeat(done[first:after] - done[first], n))
        first = after


def rounded(values: NDArray[np.float64]) -> Ints:
    """Return the nearest whole numbers, halves away from zero, as SQL rounds."""
    whole = np.trunc(values)
    return (whole + np.where(np.abs(values - whole) >= 0.5, np.copysign(1.0, values), 0.0)).astype(np.int64)
