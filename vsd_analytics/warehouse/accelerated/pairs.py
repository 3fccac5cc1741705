"""`pairs`: who is within `pair_max_m` of whom, as an engine sent it, else from the places of people."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.warehouse.accelerated.columns import (
    LazyColumns,
    beside,
    grouped_by,
    order_by,
    picked,
    rows_of,
    run_of,
    starts_of,
    take,
)
from vsd_analytics.warehouse.accelerated.located import HOUR_MS, frame_of, frames_in_order, is_counted
from vsd_analytics.warehouse.accelerated.site_tables import SiteTables
from vsd_analytics.warehouse.held import NULL, Columns, Held, Ints

_CROWD = 40
_FLOATS = 2**24
"""Whole numbers below this are floats of 32 bits exactly."""
_PAIRS = 100_000
"""Pairs of people that are compared at once: their numbers fit into the cache of a core."""


def pairs(held: Held, site: SiteTables) -> Columns | None:
    """Return `staging/pairs`, in order of hour, camera, instant and members.

    `_frame` is the row of `instants`; `_a` and `_b` number the persons, `_row_a` and `_row_b` are rows of `located`.
    None where a pair was sent without track ids: only the query says who is who then.
    """
    if site.only_counts:
        return _closer(held["located"], site)
    if "stored_pairs" not in held:
        return None
    stored, frames, instants, located = (held[r] for r in ("stored_pairs", "stored_frames", "instants", "located"))
    reported = np.flatnonzero(frames["n_pairs"] != NULL)
    if not len(stored["ts_ms"]) and not len(reported):
        return _derived(located, np.flatnonzero(located["x_mm"] != NULL), site)
    if np.any(stored["track_a"] < 0) or np.any(stored["track_b"] < 0):
        return None
    is_reported = np.zeros(len(instants["ts_ms"]) + 1, dtype=np.bool_)  # the last one is of no frame
    is_reported[frames_in_order(instants, *(frames[c][reported] for c in ("camera_id", "ts_ms")))] = True
    sent_in = frames_in_order(instants, stored["camera_id"], stored["ts_ms"])
    is_reported[sent_in] = True
    others = np.flatnonzero((located["x_mm"] != NULL) & ~is_reported[located["_frame"]])
    sides = [is_counted(held, site, stored["camera_id"], stored["ts_ms"], stored[t]) for t in ("track_a", "track_b")]
    if sides[0] is not None and sides[1] is not None:
        stored, sent_in = take(stored, sides[0] & sides[1]), sent_in[sides[0] & sides[1]]
    both = _derived(located, others, site), _sent(stored, sent_in, instants, located, site)
    return with_rows({c: np.concatenate([columns[c] for columns in both]) for c in both[1]}, instants, located)


def _closer(located: Columns, site: SiteTables) -> Columns:
    """Return the pairs closer than `distance_m`, in order of frames; other columns are computed when they are read."""
    reach, most = int(site.params["distance_mm"]), int(site.params["pair_max_mm"])
    placed = np.flatnonzero(located["x_mm"] != NULL) if located["x_mm"].dtype == np.int64 else None
    frame, x, y = (located[c] if placed is None else located[c][placed] for c in ("_frame", "x_mm", "y_mm"))
    a, b, square = near(frame, x, y, min(reach, most))
    if reach <= most and np.any(is_at_reach := square == reach * reach):
        a, b, square = (values[~is_at_reach] for values in (a, b, square))
    if placed is not None:
        a, b = placed[a], placed[b]

    def of_one(column: str, row: Ints) -> Callable[[], NDArray[Any]]:
        return lambda: picked(located[column], row)

    columns = LazyColumns(
        {"_a": a, "_b": b, "is_derived": np.ones(1, dtype=np.bool_)},
        {
            **{c: of_one(c, a) for c in ("camera_id", "ts_ms", "weight_ms", "_frame")},
            **{f"{c}_{side}_mm": of_one(f"{c}_mm", row) for side, row in (("a", a), ("b", b)) for c in "xy"},
            "distance_mm": lambda: np.sqrt(square).astype(np.int64),
            "is_owned": lambda: site.floors.is_owned(
                columns["camera_id"],
                columns["ts_ms"],
                columns["x_a_mm"] + columns["x_b_mm"],
                columns["y_a_mm"] + columns["y_b_mm"],
                2,
            ),
        },
    )
    return columns


def _derived(located: Columns, placed: Ints, site: SiteTables) -> Columns:
    """Return the pairs of people whose engine reports no pairs.

    Args:
        located: The relation.
        placed: Its rows of these people who have a place.
        site: The tables of the site.
    """
    frame, x, y = (located[c] for c in ("_frame", "x_mm", "y_mm"))
    if len(placed) < len(x):
        frame, x, y = frame[placed], x[placed], y[placed]
    reach = int(site.params["pair_max_mm"])
    one, other, square = near(frame, x, y, reach)
    a, b = picked(placed, np.minimum(one, other)), picked(placed, np.maximum(one, other))
    ts = picked(located["ts_ms"], a)
    hour = ts // HOUR_MS
    order = order_by(hour, a, b)
    a, b, hour, square, ts = (picked(values, order) for values in (a, b, hour, square, ts))
    camera = picked(located["camera_id"], a)
    x_a, y_a, x_b, y_b = (picked(located[c], side) for side in (a, b) for c in ("x_mm", "y_mm"))
    return {
        "hour": hour,
        "camera_id": camera,
        "ts_ms": ts,
        "member_a": picked(located["member"], a),
        "member_b": picked(located["member"], b),
        "track_a": picked(located["track_id"], a),
        "track_b": picked(located["track_id"], b),
        "x_a_mm": x_a,
        "y_a_mm": y_a,
        "x_b_mm": x_b,
        "y_b_mm": y_b,
        "distance_mm": np.sqrt(square).astype(np.int64),
        "weight_ms": picked(located["weight_ms"], a),
        "is_owned": site.floors.is_owned(camera, ts, x_a + x_b, y_a + y_b, 2),
        "is_derived": np.ones(len(a), dtype=np.bool_),
        "_frame": picked(located["_frame"], a),
        "_a": a,
        "_b": b,
        "_row_a": a,
        "_row_b": b,
    }


def _sent(stored: Columns, frame: Ints, instants: Columns, located: Columns, site: SiteTables) -> Columns:
    """Return the pairs that engines sent with track ids; people who are in pairs only have negative numbers.

    Args:
        stored: The stored pairs.
        frame: The row of `instants` of each, -1 for none.
        instants: The relation.
        located: The relation.
        site: The tables of the site.
    """
    pairs = take({**stored, "_frame": frame}, frame >= 0)
    room = site.n_tracks + 1
    keys = np.concatenate([pairs["_frame"] * room + pairs[track] for track in ("track_a", "track_b")])
    order, starts = grouped_by(keys)
    people = keys[order[starts]]
    person = np.empty(len(keys), dtype=np.int64)
    person[order] = run_of(starts, len(keys))
    frame_starts = starts_of(people // room)
    first = np.repeat(frame_starts, np.diff(frame_starts, append=len(people)))
    row = rows_of(located["_key"], people)
    member = np.where(row < 0, first - np.arange(len(people)) - 1, _at(located["member"], row))
    pairs = {**pairs, **dict(zip("ab", np.split(person, 2), strict=True))}
    is_near = (pairs["distance_mm"] != NULL) & (pairs["distance_mm"] <= site.params["pair_max_mm"])
    pairs = take(pairs, is_near)
    frame, sides = pairs["_frame"], (pairs["a"], pairs["b"])
    places = {}
    for side, of_side in zip("ab", sides, strict=True):
        for c in "xy":
            own = pairs[f"{c}_{side}_mm"]
            if np.any(is_lacking := own == NULL):
                own = np.where(is_lacking, _at(located[f"{c}_mm"], row[of_side]), own)
            places[f"{c}_{side}_mm"] = own
    camera, ts = pairs["camera_id"], pairs["ts_ms"]
    x, y = (places[f"{c}_a_mm"] + places[f"{c}_b_mm"] for c in "xy")
    return {
        "hour": ts // HOUR_MS,
        "camera_id": camera,
        "ts_ms": ts,
        "member_a": member[sides[0]],
        "member_b": member[sides[1]],
        "track_a": pairs["track_a"],
        "track_b": pairs["track_b"],
        **places,
        "distance_mm": pairs["distance_mm"],
        "weight_ms": instants["weight_ms"][frame],
        "is_owned": site.floors.is_owned(camera, ts, x, y, 2),
        "is_derived": np.zeros(len(frame), dtype=np.bool_),
        "_frame": frame,
    }


def _at(values: Ints, rows: Ints) -> Ints:
    """Return values of some rows, NULL for row -1."""
    chosen = np.full(len(rows), NULL, dtype=np.int64)
    is_there = rows >= 0
    chosen[is_there] = values[rows[is_there]]
    return chosen


def near(frame: Ints, x: Ints, y: Ints, reach: int) -> tuple[Ints, Ints, Ints]:
    """Return the pairs of persons of one frame within reach of each other: rows of both, and squared distance.

    Args:
        frame: Number of each person's frame, in order.
        x: Where they stand, in the unit of `reach`.
        y: Likewise.
        reach: Greatest distance.
    """
    n_persons = np.diff(starts_of(frame), append=len(frame))
    if n_persons.max(initial=0) <= _CROWD:
        return _near_of_few(frame, x, y, reach)
    is_crowded = np.repeat(n_persons > _CROWD, n_persons)
    few, many = np.flatnonzero(~is_crowded), np.flatnonzero(is_crowded)
    one, other, square = _near_of_few(frame[few], x[few], y[few], reach)
    near_pairs = [(few[one], few[other], square)]
    many = many[order_by(frame[many], x[many])]
    x, y = x.astype(np.int64), y.astype(np.int64)  # squares need more than 32 bits
    for one, other in beside(frame[many], x[many], reach):
        a, b = many[one], many[other]
        square = (x[a] - x[b]) ** 2 + (y[a] - y[b]) ** 2
        is_near = np.flatnonzero(square <= reach * reach)
        near_pairs.append((a[is_near], b[is_near], square[is_near]))
    one, other, square = (np.concatenate(side) for side in zip(*near_pairs, strict=True))
    return one, other, square


def _near_of_few(frame: Ints, x: Ints, y: Ints, reach: int) -> tuple[Ints, Ints, Ints]:
    """Do what `near` does for frames without a crowd, each person with each, in order of the size of frames.

    People of frames of one size are a table: a row for the first one of each frame, a row for the second one, and so
    on. So each two of a frame are compared in two rows of it.
    """
    kind = _kind_of_distances(x, y, reach)
    coordinates = [values.astype(kind) for values in (x, y)]
    starts = starts_of(frame)
    sizes = np.diff(starts, append=len(frame))
    one, other = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for size in np.flatnonzero(np.bincount(sizes[sizes > 1], minlength=1)).tolist():
        first, second = np.triu_indices(size, 1)
        of_size = starts[sizes == size]
        for rows in np.split(of_size, np.arange(0, len(of_size), max(1, _PAIRS // len(first)))[1:]):
            people = rows + np.arange(size)[:, None]
            square = np.zeros((len(first), len(rows)), dtype=kind)
            for values in coordinates:
                of_people = picked(values, people)
                apart = of_people.take(first, axis=0)
                apart -= of_people.take(second, axis=0)
                apart *= apart
                square += apart
            hits = np.flatnonzero(square <= reach * reach)
            pair = hits // len(rows)
            column = hits - pair * len(rows)
            one.append(rows[column] + first[pair])
            other.append(rows[column] + second[pair])
    a, b = np.concatenate(one), np.concatenate(other)
    dx, dy = (picked(coordinate, a).astype(np.int64) - picked(coordinate, b) for coordinate in (x, y))
    return a, b, dx * dx + dy * dy


def _kind_of_distances(x: Ints, y: Ints, reach: int) -> np.dtype[Any]:
    """Return the type that squares of distances are compared in: short floats take a third of the time of integers.

    Floats are right where they hold every coordinate and twice the square of `reach` exactly. A greater square may be
    rounded, but never to one within reach, as rounding keeps the order.
    """
    is_exact = 2 * reach * reach < _FLOATS and all(
        len(coordinate) == 0 or (int(coordinate.min()) > -_FLOATS and int(coordinate.max()) < _FLOATS)
        for coordinate in (x, y)
    )
    return np.dtype(np.float32 if is_exact else np.int64)


def with_rows(pairs: Columns, instants: Columns, located: Columns) -> Columns:
    """Return pairs that come in any order in the order, and with the further columns, of `pairs`."""
    frame = pairs["_frame"] if "_frame" in pairs else frame_of(instants, pairs["camera_id"], pairs["ts_ms"])
    order = order_by(pairs["hour"], frame, pairs["member_a"], pairs["member_b"], pairs["distance_mm"])
    pairs, frame = take(pairs, order), frame[order]
    first = np.searchsorted(located["_frame"], np.arange(len(instants["ts_ms"])))
    a, b = pairs["member_a"], pairs["member_b"]
    row_a, row_b = (np.where(member > 0, picked(first, frame) + (member - 1), -1) for member in (a, b))
    columns = {**pairs, "_frame": frame, "_row_a": row_a, "_row_b": row_b}
    if pairs["is_derived"].all():
        return {**columns, "_a": row_a, "_b": row_b}
    # Numbers of a frame: first of people who are in pairs only, whose members are -1, -2, ..., then of its records.
    least = np.zeros(len(first), dtype=np.int64)
    np.minimum.at(least, frame, np.minimum(a, b))
    zero = picked(first - np.cumsum(least), frame)
    return {**columns, "_a": zero + a - (a > 0), "_b": zero + b - (b > 0)}
