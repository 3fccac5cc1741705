"""Records that one camera frame holds: those of people who were seen at once."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Final

import numpy as np

from vsd_analytics.whatif.arrays import Bools, Ints, in_order

_PAIRS_AT_ONCE: Final = 500_000
"""Pairs that are compared at once: their arrays fit into the caches."""


class FramePairs:
    """Finds the pairs of records that one frame holds.

    Args:
        frame: Frame of each record, shape (n_records,).
    """

    def __init__(self, frame: Ints) -> None:
        self.frame = frame
        self.order = in_order(frame)
        """Records in order of their frames."""
        self._sorted = frame[self.order]

    @cached_property
    def is_first(self) -> Bools:
        """Return whether each record of `order` is the first one of its frame."""
        is_first = np.ones(self.order.size, np.bool_)
        is_first[1:] = self._sorted[1:] != self._sorted[:-1]
        return is_first

    def each(self) -> Iterator[tuple[Ints, Ints]]:
        """Yield all pairs of different records of a frame, each pair once, as places in `order`.

        Each record is paired with the one after it, then with the one behind that: as many rounds as the fullest frame
        has people, less one.
        """
        apart = 1
        one = np.flatnonzero(~self.is_first[1:])
        while one.size:
            for first in range(0, one.size, _PAIRS_AT_ONCE):
                some = one[first : first + _PAIRS_AT_ONCE]
                yield some, some + apart
            apart += 1
            one = one[: np.searchsorted(one, self.order.size - apart)]
            one = one[self._sorted[one + apart] == self._sorted[one]]

    def of(self, rows: Ints, frame: Ints) -> Iterator[tuple[Ints, Ints]]:
        """Yield, in blocks, a position in `rows` and a record of that frame, for all records of the frame of each.

        Args:
            rows: Positions to yield, shape (n,).
            frame: The frame in which to look for each, shape (n,).
        """
        begin, end = (np.searchsorted(self._sorted, frame, side) for side in ("left", "right"))
        n = end - begin
        total = np.cumsum(n)
        first = 0
        while first < rows.size:
            done = total[first - 1] if first else 0
            last = max(int(np.searchsorted(total, done + _PAIRS_AT_ONCE, "right")), first + 1)
            counts = n[first:last]
            offset = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
            yield np.repeat(rows[first:last], counts), self.order[np.repeat(begin[first:last], counts) + offset]
            first = last
