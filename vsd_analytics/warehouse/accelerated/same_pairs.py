"""`same_pairs`: which runs of two cameras show the same two people."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.warehouse.accelerated.columns import grouped_by, least, order_by, picked, run_of, starts_of, take
from vsd_analytics.warehouse.accelerated.site_tables import SiteTables
from vsd_analytics.warehouse.held import NULL, Bools, Columns, Held, Ints

"""More seconds than records of an hour reach over."""
_ROWS, _FEW = 16_384, 8
"""Rows that are compared at once, and the share of them, an eighth, that costs less to pick out."""
_SPAN_S = 2**33
"""More seconds than any batch has."""

Floats = NDArray[np.float64]


def same_pairs(held: Held, site: SiteTables) -> Columns:
    """Return `facts/same_pairs`, by the steps of its query."""
    records = held["close_records"]
    seen = _seen(records, site)
    near = _near(seen, int(site.params["same_place_mm"]))
    run, other_run, n_same = _agreeing(seen, near)
    n_both = _both(seen, run, other_run)
    is_same = 2 * n_same >= n_both
    run, other_run, n_same, n_both = run[is_same], other_run[is_same], n_same[is_same], n_both[is_same]
    first = starts_of(records["_run"])
    order = order_by(records["hour"][first[run]], run, other_run)
    run, other_run, n_same, n_both = run[order], other_run[order], n_same[order], n_both[order]
    one, other = first[run], first[other_run]
    return {
        "hour": records["hour"][one],
        **{c: records[c][one] for c in ("camera_id", "track_a", "track_b", "started_ms")},
        **{f"other_{c}": records[c][other] for c in ("camera_id", "track_a", "track_b", "started_ms")},
        "n_same": n_same,
        "n_both": n_both,
    }


def _seen(records: Columns, site: SiteTables) -> Columns:
    """Return where pairs were at whole seconds, on floor from which several cameras may report.

    Rows are in order of records; `_group` numbers the floor and second of an hour.
    """
    x2, y2 = (records[f"{c}_a_mm"] + records[f"{c}_b_mm"] for c in ("x", "y"))
    is_shared = site.floors.owner(records["camera_id"], records["ts_ms"], x2, y2, 2) >= 0
    wanted = "hour camera_id ts_ms interval_ms is_followed next_ms _run"
    places = ("x_a_mm", "y_a_mm", "x_b_mm", "y_b_mm")
    r = take(records, np.flatnonzero(is_shared), *wanted.split(), *places, *(f"next_{p}" for p in places))
    ts = r["ts_ms"]
    is_walking = r["is_followed"] & (r["next_ms"] - ts <= site.params["same_step_ms"])
    to_ms = np.where(is_walking, r["next_ms"], ts + np.minimum(r["interval_ms"], site.params["same_stay_ms"]))
    first = -(-ts // 1000)
    n_seconds = np.maximum(0, -(-to_ms // 1000) - first)
    n_before = np.cumsum(n_seconds) - n_seconds
    row = np.repeat(np.arange(len(ts)), n_seconds)
    step = np.arange(len(row))

    def each(at_first: Ints) -> Ints:
        """Return a number of each second, given that of the first second of each record; it rises with seconds."""
        values = picked(at_first - n_before, row)
        values += step
        return values

    share = each(first) * 1000
    share -= picked(ts, row)
    share = share / picked(to_ms - ts, row)
    moved = {p: np.where(is_walking & (r[f"next_{p}"] != NULL), r[f"next_{p}"] - r[p], 0) for p in places}
    start, way = (
        {**columns, **{f"{c}2_mm": columns[f"{c}_a_mm"] + columns[f"{c}_b_mm"] for c in "xy"}} for columns in (r, moved)
    )
    values = {}
    for p in ("x2_mm", "y2_mm", *places):
        values[p] = picked(way[p].astype(np.float64), row)
        values[p] *= share
        values[p] += picked(start[p].astype(np.float64), row)
    hour_s = 3600 + int(site.params["same_step_ms"]) // 1000 + 2
    hour = r["hour"] - r["hour"].min(initial=2**62)
    floor = site.floors.of_camera[r["camera_id"]] * (hour.max(initial=0) + 1)
    return {
        "camera_id": picked(r["camera_id"], row),
        "_run": picked(r["_run"], row),
        # records of a run are in order of time, and no second lies in two of them
        "_run_seconds": each(r["_run"] * _SPAN_S + first - first.min(initial=2**62)),
        **values,
        "_group": each((floor + hour) * hour_s + first - 3600 * r["hour"]),
    }


def _near(seen: Columns, reach_mm: int) -> Columns:
    """Return the pairs of two cameras in the same place in a second, with the square of how far they are apart."""
    near_pairs = []
    for one, other in _beside(seen, reach_mm):
        is_turned = picked(seen["camera_id"], one) > picked(seen["camera_id"], other)
        p, q = np.where(is_turned, other, one), np.where(is_turned, one, other)
        a, b, c, d = (_places(seen, row, side) for row in (p, q) for side in "ab")
        square = np.minimum(np.maximum(_square(a, c), _square(b, d)), np.maximum(_square(a, d), _square(b, c)))
        rows = np.flatnonzero(square <= reach_mm**2)
        p, q, square = p[rows], q[rows], square[rows]
        rows = np.flatnonzero(_is_in_reach(seen, p, q))
        near_pairs.append((p[rows], q[rows], square[rows]))
    none = np.zeros(0, dtype=np.int64)
    p, q, square = (np.concatenate([none, *(f[i] for f in near_pairs)]) for i in range(3))
    return {"p": p, "q": q, "square_mm2": square}


def _beside(seen: Columns, reach_mm: int) -> Iterator[tuple[Ints, Ints]]:
    """Yield the pairs of rows of two cameras in one second that are within reach along both axes, in blocks.

    In order of x, rows of a block are compared with those k rows on, k = 1, 2, ... while any are within reach along x,
    so that whole stretches of columns are read; only when few rows are left are these picked out.
    """
    # a little farther than the reach, because halving and adding round: the squares decide
    reach = 2 * reach_mm + 2
    x = np.floor(seen["x2_mm"]).astype(np.int64)
    order = order_by(seen["_group"], x)
    low = int(x.min(initial=0))
    key = picked(seen["_group"] * np.int64(int(x.max(initial=0)) - low + reach + 1) + (x - low), order)
    y, camera = picked(seen["y2_mm"], order), picked(seen["camera_id"], order)
    n = len(key)
    for first in range(0, n, _ROWS):
        left: Ints | slice = slice(first, min(first + _ROWS, n - 1))
        hits: list[tuple[Ints, int]] = []
        for k in range(1, n - first):
            if isinstance(left, slice):
                left = slice(first, min(left.stop, n - k))
                on: Ints | slice = slice(first + k, left.stop + k)
            else:
                left = left[left < n - k]
                on = left + k
            is_near = key[on] - key[left] <= reach
            n_near = np.count_nonzero(is_near)
            if not n_near:
                break
            is_beside = is_near & (np.abs(y[on] - y[left]) < reach) & (camera[on] != camera[left])
            rows = np.flatnonzero(is_beside)
            hits.append((rows + first if isinstance(left, slice) else left[rows], k))
            if not isinstance(left, slice):
                left = left[is_near]
            elif n_near * _FEW < len(is_near):
                left = np.flatnonzero(is_near) + first
        if hits:
            one = np.concatenate([rows for rows, _ in hits])
            other = one + np.repeat([k for _, k in hits], [len(rows) for rows, _ in hits])
            yield picked(order, one), picked(order, other)


def _places(seen: Columns, rows: Ints, side: str) -> tuple[Floats, Floats]:
    return picked(seen[f"x_{side}_mm"], rows), picked(seen[f"y_{side}_mm"], rows)


def _square(one: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> Floats:
    x, y = one[0] - other[0], one[1] - other[1]
    x *= x
    y *= y
    x += y
    return x


def _is_in_reach(seen: Columns, p: Ints, q: Ints) -> Bools:
    """Return whether the midpoint of p lies in one of the four squares of side 1 m around the midpoint of q."""
    is_in = np.ones(len(p), dtype=np.bool_)
    for c in ("x2_mm", "y2_mm"):
        a, b = (picked(seen[f"{c[0]}_{side}_mm"], q) for side in "ab")
        square, middle = np.floor(picked(seen[c], p) / 2000), a + b
        low, high = np.floor((middle - 1000) / 2000), np.floor((middle + 1000) / 2000)
        is_in &= (square == low) | (square == high)
    return is_in


def _agreeing(seen: Columns, near: Columns) -> tuple[Ints, Ints, Ints]:
    """Return the runs of two cameras that fit each other best in some second, and in how many seconds they do."""
    camera, run = (picked(seen[c], near["p"]) for c in ("camera_id", "_run"))
    other_camera, other = (picked(seen[c], near["q"]) for c in ("camera_id", "_run"))
    # a pair of tracks is seen once in a second, so that its row says both
    is_best = _is_best(near["square_mm2"], (near["p"], other_camera), (other, run))
    is_best &= _is_best(near["square_mm2"], (near["q"], camera), (run, other))
    rows = np.flatnonzero(is_best)
    run, other = run[rows], other[rows]
    order, starts = grouped_by(run, other)
    first = order[starts]
    return run[first], other[first], np.diff(starts, append=len(run))


def _is_best(square: Floats, groups: tuple[Ints, ...], ties: tuple[Ints, Ints]) -> Bools:
    """Return whether a row is the nearest of its group, among equals the one with the least numbers."""
    order, starts = grouped_by(*groups)
    group, square = run_of(starts, len(order)), picked(square, order)
    is_nearest = square == picked(least(square, starts), group)
    number = np.where(is_nearest, picked(ties[0] * np.int64(2**31) + ties[1], order), 2**62)
    is_best = np.zeros(len(order), dtype=np.bool_)
    is_best[order] = number == picked(least(number, starts), group)
    return is_best


def _both(seen: Columns, run: Ints, other_run: Ints) -> Ints:
    """Return the number of seconds in which both runs are seen; most runs have no gap, so their ends say it."""
    keys = seen["_run_seconds"]
    if not len(keys):
        return np.zeros(len(run), dtype=np.int64)
    first = np.searchsorted(keys, np.arange(keys[-1] // _SPAN_S + 2) * _SPAN_S)
    n = np.diff(first)
    low, high = keys[first[:-1]] % _SPAN_S, keys[first[1:] - 1] % _SPAN_S
    n_both: Ints = np.minimum(high[run], high[other_run]) - np.maximum(low[run], low[other_run]) + 1
    has_gap = high - low >= n
    rows = np.flatnonzero(has_gap[run] | has_gap[other_run])
    n = n[run[rows]]
    row = np.repeat(rows, n)
    at = np.arange(len(row)) - np.repeat(np.cumsum(n) - n - first[run[rows]], n)
    wanted = keys[at] + (other_run - run)[row] * _SPAN_S
    is_seen = keys[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)] == wanted
    n_both[rows] = np.bincount(row[is_seen], minlength=len(run))[rows]
    return np.maximum(n_both, 0)
