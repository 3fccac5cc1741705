"""Who is closer than a distance to somebody else in the same frame, before and after some records move."""

from __future__ import annotations

import numpy as np

from vsd_analytics.whatif.arrays import Bools, Floats, Ints
from vsd_analytics.whatif.floor_records import ALONE, FloorRecords
from vsd_analytics.whatif.frame_pairs import FramePairs


def n_close(frames: FramePairs, x_m: Floats, y_m: Floats, *, within_m: float) -> Ints:
    """Return for each record how many others of its frame are closer than `within_m`, shape (n_records,)."""
    x_m, y_m = x_m[frames.order], y_m[frames.order]
    ordered = np.zeros(x_m.size, np.int64)
    for one, other in frames.each():
        is_close = _distance2(x_m, y_m, one, x_m, y_m, other) < within_m**2
        ordered[one[is_close]] += 1  # in one round each record is on either side at most once
        ordered[other[is_close]] += 1
    counts = np.empty_like(ordered)
    counts[frames.order] = ordered
    return counts


def n_close_recorded(records: FloorRecords, *, within_m: float) -> Ints:
    """Return `n_close` of records where they are, a day at a time."""
    counts = [
        n_close(FramePairs(records.frame[day]), records.x_m[day], records.y_m[day], within_m=within_m)
        for day in records.days()
    ]
    return np.concatenate(counts)


def n_close_after(
    before: Ints, frames: FramePairs, places: tuple[Floats, Floats], moved: Ints,
    new_places: tuple[Floats, Floats], *, within_m: float,
) -> Ints:  # fmt: skip
    """Return `n_close` after some records moved; only pairs with one of them are compared.

    Args:
        before: `n_close` as recorded.
        frames: The records' frames.
        places: x and y of all records, as recorded.
        moved: Rows that move, shape (n_moved,).
        new_places: x and y of all records then.
        within_m: The distance.
    """
    counts = before.copy()
    is_moved = np.zeros(counts.size, np.bool_)
    is_moved[moved] = True
    for one, other in frames.of(moved, frames.frame[moved]):
        for (x, y), sign in ((places, -1), (new_places, 1)):
            is_close = (one != other) & (_distance2(x, y, one, x, y, other) < within_m**2)
            a, b = one[is_close], other[is_close]
            counts += sign * np.bincount(a, minlength=counts.size)
            counts += sign * np.bincount(b[~is_moved[b]], minlength=counts.size)
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


def nearest_strangers(
    pairs: tuple[Ints, Ints], places: tuple[Floats, Floats], others: tuple[Floats, Floats]
) -> tuple[Ints, Ints]:
    """Return of the pairs of `near_strangers` the nearest one of each who has any."""
    apart2 = _distance2(*places, pairs[0], *others, pairs[1])
    order = np.lexsort((apart2, pairs[0]))
    one, other = pairs[0][order], pairs[1][order]
    is_nearest = np.ones(one.size, np.bool_)
    is_nearest[1:] = one[1:] != one[:-1]
    return one[is_nearest], other[is_nearest]


def stepped_aside(
    nearest: tuple[Ints, Ints], places: tuple[Floats, Floats], others: tuple[Floats, Floats], *, strength: float,
    reach_m: Floats | float,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Return where people are after each stepped back from the nearest stranger, by strength (reach - distance).

    People who are shifted in time, or pushed, have not seen those whom they now meet, and come too close to them;
    people who did meet stepped aside.

    Args:
        nearest: Of `nearest_strangers`.
        places: As there.
        others: As there.
        strength: Share of the lacking distance, 0 to 1.
        reach_m: Distance from which nobody steps back; one number, or one for each pair.
    """
    x_m, y_m = places[0].copy(), places[1].copy()
    apart = distances(places, others, nearest)
    is_near = apart < reach_m
    one, other, apart, lacks_m = nearest[0][is_near], nearest[1][is_near], apart[is_near], (reach_m - apart)[is_near]
    step = strength * lacks_m / np.maximum(apart, 0.05)
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


def distances(one: tuple[Floats, Floats], other: tuple[Floats, Floats], pairs: tuple[Ints, Ints]) -> Floats:
    """Return how far apart pairs are: rows of the first places, and rows of the others."""
    return np.asarray(np.sqrt(_distance2(*one, pairs[0], *other, pairs[1])))
