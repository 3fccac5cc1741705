"""Merges small counts, so that a page given to others has none and its sums stay right.

Counts from 1 to under `mask_below` (five) are never given. They are put together with the next small ones, in order of
time and, where a place has too few all week, with those of the place next to it, until they make five; the five is
given at the middle one. What is left over at the end of a day joins the last count of that day in the same place. So
every count in the file is 0 or at least five, and sums over a place and day of at least five are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.figures.share.counts import Mask

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Given:
    """What may be given of some counts.

    Attributes:
        values: As the counts came, one row per kind of count, shape (n_kinds, n); the first row is 0 or large enough.
        n_dropped: What could not be put anywhere, as all counts together are too small, shape (n_kinds,).
    """

    values: Ints
    n_dropped: Ints


def merge_small_counts(values: Ints, *, groups: Sequence[Ints], mask: Mask) -> Given:
    """Return counts without any value from 1 to under `below`.

    A count large enough stays as it is. Small ones are summed in order; a sum large enough is put where its middle one
    was. What is left when a group ends joins the last count given in that group (of the innermost group that has one);
    where none has, it waits for the next counts.

    Args:
        values: Counts, shape (n_kinds, n), in an order in which neighbours lie near each other. The first kind decides;
            the others go where it goes.
        groups: For each kind of group, from the innermost (such as a place's day) to the outermost, a number for each
            count that changes where a group ends, shape (n,).
        mask: Tells which counts are small.

    Returns:
        The counts given; sums over a group with anything given are exact.
    """
    counts = np.asarray(values, dtype=np.int64)
    lead = counts[0]
    below = mask.below
    if not mask.is_on or not ((lead > 0) & (lead < below)).any():
        return Given(counts.copy(), np.zeros(len(counts), dtype=np.int64))
    moves = np.arange(lead.size)
    ends = np.zeros(lead.size, dtype=np.int64)
    for depth, group in enumerate(groups, 1):
        is_end = np.append(group[1:] != group[:-1], True)
        ends[is_end] = depth
    numbers, closes = lead.tolist(), ends.tolist()
    waiting: list[int] = []
    total = 0
    last = [-1] * (len(groups) + 1)
    for i, n in enumerate(numbers):
        if n >= below:
            last = [i] * len(last)
        elif n > 0:
            waiting.append(i)
            total += n
            if total >= below:
                middle = _middle(waiting, numbers, total)
                moves[waiting] = middle
                last = [middle] * len(last)
                waiting, total = [], 0
        for depth in range(closes[i]):
            if waiting and last[depth] >= 0:
                moves[waiting] = last[depth]
                waiting, total = [], 0
            last[depth] = -1
    if waiting and last[-1] >= 0:
        moves[waiting] = last[-1]
        waiting = []
    given = np.zeros_like(counts)
    for row, kind in zip(given, counts, strict=True):
        np.add.at(row, moves, kind)
    dropped = given[:, waiting].sum(axis=1)
    given[:, waiting] = 0
    return Given(given, dropped)


def _middle(waiting: Sequence[int], numbers: Sequence[int], total: int) -> int:
    """Return the one among the waiting by which half of them have come."""
    seen = 0
    for i in waiting:
        seen += numbers[i]
        if 2 * seen >= total:
            return i
    return waiting[-1]
