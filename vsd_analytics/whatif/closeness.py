"""Who is closer than a distance to somebody else in the same frame, before and after some records move."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from vsd_analytics.whatif.floor_records import ALONE, Bools, Floats, Ints

_PAIRS_AT_ONCE: Final = 4_000_000


class FramePairs:
    """Finds the pairs of records that one frame holds.

    Args:
        frame: Frame of each record, shape (n_records,).
    """

    def __init__(self, frame: Ints) -> None:
        self._order = np.argsort(frame, kind="stable")
        self._sorted = frame[self._order]

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
            yield np.repeat(rows[first:last], counts), self._order[np.repeat(begin[first:last], counts) + offset]
            first = last


def n_close(frame: Ints, x_m: Floats, y_m: Floats, *, within_m: float) -> Ints:
    """Return for each record how many others of its frame are closer than `within_m`, shape (n_records,)."""
    everyone = np.arange(frame.size)
    counts = np.zeros(frame.size, np.int64)
    for one, other in FramePairs(frame).of(everyone, frame):
        is_close = (one != other) & (_distance2(x_m, y_m, one, x_m, y_m, other) < within_m**2)
        counts += np.bincount(one[is_close], minlength=frame.size)
    return counts


def n_close_after(
    before: Ints, frame: Ints, x_m: Floats, y_m: Floats, moved: Ints, new_x_m: Floats, new_y_m: Floats, *,
    within_m: float,
) -> Ints:  # fmt: skip
    """Return `n_close` after some records moved; only pairs with one of them are compared.

    Args:
        before: `n_close` as recorded.
        frame: Frame of all records.
        x_m: Where they are, with `y_m`.
        y_m: Likewise.
        moved: Rows that move, shape (n_moved,).
        new_x_m: Where all records are then, with `new_y_m`, shape (n_records,).
        new_y_m: Likewise.
        within_m: The distance.
    """
    counts = before.copy()
    is_moved = np.zeros(frame.size, np.bool_)
    is_moved[moved] = True
    for one, other in FramePairs(frame).of(moved, frame[moved]):
        for x, y, sign in ((x_m, y_m, -1), (new_x_m, new_y_m, 1)):
            is_close = (one != other) & (_distance2(x, y, one, x, y, other) < within_m**2)
            a, b = one[is_close], other[is_close]
            counts += sign * np.bincount(a, minlength=frame.size)
            counts += sign * np.bincount(b[~is_moved[b]], minlength=frame.size)
    return counts


def near_strangers(
    frames: FramePairs, rows: Ints, frame: Ints, places: tuple[Floats, Floats], others: tuple[Floats, Floats],
    is_with: tuple[Ints, Ints, Ints, Ints], *, within_m: float,
) -> tuple[Ints, Ints]:  # fmt: skip
    """Return the pairs of people who come near strangers: positions 0 to n - 1, and records of the others.

    Args:
        frames: Finds the others of a frame.
        rows: 0 to n - 1, shape (n,).
        frame: The frame in which each is, shape (n,).
        places: x and y of each, floor metres.
        others: x and y of all records.
        is_with: Person and company of each, and of all records: those are no strangers.
        within_m: How near.
    """
    pairs = []
    for one, other in frames.of(rows, frame):
        near = np.flatnonzero(_distance2(*places, one, *others, other) < within_m**2)
        near = near[~_together(one[near], other[near], is_with)]
        pairs.append((one[near], other[near]))
    none = np.zeros(0, np.int64)
    return tuple(np.concatenate(column) for column in zip(*pairs, strict=True)) if pairs else (none, none)  # type: ignore[return-value]


def stepped_aside(
    pairs: tuple[Ints, Ints], places: tuple[Floats, Floats], others: tuple[Floats, Floats], *, strength: float,
    reach_m: float,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Return where people are after each stepped back from the nearest stranger, by strength (reach - distance).

    People who are shifted in time, or pushed, have not seen those whom they now meet, and come too close to them;
    people who did meet stepped aside.

    Args:
        pairs: Of `near_strangers`.
        places: As there.
        others: As there.
        strength: Share of the lacking distance, 0 to 1.
        reach_m: Distance from which nobody steps back.
    """
    x_m, y_m = places[0].copy(), places[1].copy()
    apart = np.sqrt(_distance2(*places, pairs[0], *others, pairs[1]))
    order = np.lexsort((apart, pairs[0]))
    one, other, apart = pairs[0][order], pairs[1][order], apart[order]
    is_nearest = np.ones(one.size, np.bool_)
    is_nearest[1:] = one[1:] != one[:-1]
    is_nearest &= apart < reach_m
    one, other, apart = one[is_nearest], other[is_nearest], apart[is_nearest]
    step = strength * (reach_m - apart) / np.maximum(apart, 0.05)
    x_m[one] += step * (places[0][one] - others[0][other])
    y_m[one] += step * (places[1][one] - others[1][other])
    return x_m, y_m


def is_close_to_any(
    pairs: tuple[Ints, Ints], places: tuple[Floats, Floats], others: tuple[Floats, Floats], *, within_m: float
) -> Bools:
    """Return which of the people of `near_strangers` are closer than `within_m` to one of these, shape (n,)."""
    is_close = np.zeros(places[0].size, np.bool_)
    is_close[pairs[0][_distance2(*places, pairs[0], *others, pairs[1]) < within_m**2]] = True
    return is_close


def _together(one: Ints, other: Ints, is_with: tuple[Ints, Ints, Ints, Ints]) -> Bools:
    """Return whether two are one person, or walk together."""
    track, company, other_track, other_company = is_with
    is_group = (company[one] != ALONE) & (company[one] == other_company[other])
    return np.asarray((track[one] == other_track[other]) | is_group)


def _distance2(x_m: Floats, y_m: Floats, one: Ints, other_x: Floats, other_y: Floats, other: Ints) -> Floats:
    return np.asarray((x_m[one] - other_x[other]) ** 2 + (y_m[one] - other_y[other]) ** 2)
