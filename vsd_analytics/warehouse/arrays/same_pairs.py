"""`same_pairs`: which runs of two cameras show the same two people."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.warehouse.arrays.columns import (
    NULL,
    Bools,
    Columns,
    Ints,
    beside,
    grouped_by,
    least,
    order_by,
    run_of,
    starts_of,
)
from vsd_analytics.warehouse.arrays.held import Held
from vsd_analytics.warehouse.arrays.site_tables import SiteTables

_REACH_MM = 500
_FARTHEST_MS, _STAY_MS = 4000, 1000
_SPAN_S = 2**33
"""More seconds than any batch has."""

Floats = NDArray[np.float64]


def same_pairs(held: Held, site: SiteTables) -> Columns:
    """Return `facts/same_pairs`, by the steps of its query."""
    records = held["close_records"]
    seen = _seen(records, site)
    near = _near(seen)
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

    Rows are in order of `_group`, a floor and second of an hour, and of `_x`, the whole millimetres of x2.
    """
    x2, y2 = (records[f"{c}_a_mm"] + records[f"{c}_b_mm"] for c in ("x", "y"))
    is_shared = site.floors.owner(records["camera_id"], records["ts_ms"], x2, y2, 2) >= 0
    wanted = "hour camera_id ts_ms x_a_mm y_a_mm x_b_mm y_b_mm interval_ms is_followed next_ms _run"
    places = ("x_a_mm", "y_a_mm", "x_b_mm", "y_b_mm")
    names = (*wanted.split(), *(f"next_{p}" for p in places))
    rows = np.flatnonzero(is_shared)
    r = {name: records[name][rows] for name in names}
    ts = r["ts_ms"]
    is_walking = r["is_followed"] & (r["next_ms"] - ts <= _FARTHEST_MS)
    to_ms = np.where(is_walking, r["next_ms"], ts + np.minimum(r["interval_ms"], _STAY_MS))
    second = -(-ts // 1000)
    n_seconds = np.maximum(0, -(-to_ms // 1000) - second)
    row = np.repeat(np.arange(len(ts)), n_seconds)
    second = second[row] + (np.arange(len(row)) - np.repeat(np.cumsum(n_seconds) - n_seconds, n_seconds))
    here = {p: r[p] for p in places}
    there = {p: np.where(is_walking & (r[f"next_{p}"] != NULL), r[f"next_{p}"], r[p]) for p in places}

    def middle(c: str, share: Floats, row: Ints) -> Floats:
        start = here[f"{c}_a_mm"] + here[f"{c}_b_mm"]
        end = there[f"{c}_a_mm"] + there[f"{c}_b_mm"] - here[f"{c}_a_mm"] - here[f"{c}_b_mm"]
        found: Floats = start[row] + share * end[row]
        return found

    share = (1000 * second - ts[row]) / (to_ms - ts)[row]
    x = np.floor(middle("x", share, row)).astype(np.int64)
    # records reach at most four seconds beyond their hour, so that seconds of an hour are small numbers
    of_hour = (site.floors.of_camera[r["camera_id"]][row], r["hour"][row], second - 3600 * r["hour"][row])
    order = order_by(*of_hour, x)
    group = run_of(starts_of(*(key[order] for key in of_hour)), len(row))
    # records of a run are in order of time, and no second lies in two of them
    run_seconds = r["_run"][row] * _SPAN_S + (second - int(second.min(initial=2**62)))
    row, share = row[order], share[order]
    moves = {p: there[p] - here[p] for p in places}
    return {
        **{name: r[name][row] for name in ("camera_id", "_run")},
        "_run_seconds": run_seconds,
        **{p: here[p][row] + share * moves[p][row] for p in places},
        **{f"{c}2_mm": middle(c, share, row) for c in "xy"},
        "_x": x[order],
        "_group": group,
    }


def _near(seen: Columns) -> Columns:
    """Return the pairs of two cameras in the same place in a second, with the square of how far they are apart."""
    found = []
    # a little farther than the reach, because halving and adding round: the squares below decide
    for one, other in beside(seen["_group"], seen["_x"], 2 * _REACH_MM + 2):
        camera, other_camera = seen["camera_id"][one], seen["camera_id"][other]
        is_other = (camera != other_camera) & (np.abs(seen["y2_mm"][one] - seen["y2_mm"][other]) <= 2 * _REACH_MM + 1)
        is_turned = (camera > other_camera)[is_other]
        p, q = one[is_other], other[is_other]
        p, q = np.where(is_turned, q, p), np.where(is_turned, p, q)
        square = np.minimum(
            np.maximum(_square(seen, p, q, "a", "a"), _square(seen, p, q, "b", "b")),
            np.maximum(_square(seen, p, q, "a", "b"), _square(seen, p, q, "b", "a")),
        )
        is_near = square <= _REACH_MM**2
        p, q, square = p[is_near], q[is_near], square[is_near]
        is_in = _is_in_reach(seen, p, q)
        found.append((p[is_in], q[is_in], square[is_in]))
    none = np.zeros(0, dtype=np.int64)
    p, q, square = (np.concatenate([none, *(f[i] for f in found)]) for i in range(3))
    return {"p": p, "q": q, "square_mm2": square}


def _square(seen: Columns, p: Ints, q: Ints, one: str, other: str) -> Floats:
    x: Floats = seen[f"x_{one}_mm"][p] - seen[f"x_{other}_mm"][q]
    y: Floats = seen[f"y_{one}_mm"][p] - seen[f"y_{other}_mm"][q]
    return x * x + y * y


def _is_in_reach(seen: Columns, p: Ints, q: Ints) -> Bools:
    """Return whether the midpoint of p lies in one of the four squares of side 1 m around the midpoint of q."""
    is_in = np.ones(len(p), dtype=np.bool_)
    for c in ("x2_mm", "y2_mm"):
        square, middle = np.floor(seen[c][p] / 2000), seen[f"{c[0]}_a_mm"][q] + seen[f"{c[0]}_b_mm"][q]
        low, high = np.floor((middle - 1000) / 2000), np.floor((middle + 1000) / 2000)
        is_in &= (square == low) | (square == high)
    return is_in


def _agreeing(seen: Columns, near: Columns) -> tuple[Ints, Ints, Ints]:
    """Return the runs of two cameras that fit each other best in some second, and in how many seconds they do."""
    camera, run = (seen[c][near["p"]] for c in ("camera_id", "_run"))
    other_camera, other = (seen[c][near["q"]] for c in ("camera_id", "_run"))
    # a pair of tracks is seen once in a second, so that its row says both
    is_best = _is_best(near["square_mm2"], (near["p"], other_camera), (other, run))
    is_best &= _is_best(near["square_mm2"], (near["q"], camera), (run, other))
    run, other = run[is_best], other[is_best]
    order, starts = grouped_by(run, other)
    first = order[starts]
    return run[first], other[first], np.diff(starts, append=len(run))


def _is_best(square: Floats, groups: tuple[Ints, ...], ties: tuple[Ints, Ints]) -> Bools:
    """Return whether a row is the nearest of its group, among equals the one with the least numbers."""
    order, starts = grouped_by(*groups)
    group, square = run_of(starts, len(order)), square[order]
    is_nearest = square == least(square, starts)[group]
    number = np.where(is_nearest, (ties[0] * np.int64(2**31) + ties[1])[order], 2**62)
    found = np.zeros(len(order), dtype=np.bool_)
    found[order] = number == least(number, starts)[group]
    return found


def _both(seen: Columns, run: Ints, other_run: Ints) -> Ints:
    """Return the number of seconds in which both runs are seen."""
    keys = seen["_run_seconds"]
    first = np.searchsorted(keys, run * _SPAN_S)
    n = np.searchsorted(keys, (run + 1) * _SPAN_S) - first
    of = np.repeat(np.arange(len(run)), n)
    at = np.arange(len(of)) - np.repeat(np.cumsum(n) - n, n) + np.repeat(first, n)
    wanted = keys[at] + (other_run - run)[of] * _SPAN_S
    found = keys[np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)] == wanted if len(keys) else wanted < 0
    return np.bincount(of[found], minlength=len(run))
