"""`close_records`, and the facts that add up its runs and pairs: `episode_cells` and `track_pairs`."""

from __future__ import annotations

import numpy as np

from vsd_analytics.warehouse.accelerated.columns import (
    ends_of,
    grouped_by,
    order_by,
    picked,
    run_of,
    starts_of,
    sums,
    take,
)
from vsd_analytics.warehouse.accelerated.company import is_standing
from vsd_analytics.warehouse.accelerated.located import HOUR_MS
from vsd_analytics.warehouse.accelerated.site_tables import SiteTables, gap_ms
from vsd_analytics.warehouse.held import NULL, Bools, Columns, Held, Ints


def close_records(held: Held, site: SiteTables) -> Columns:
    """Return `staging/close_records`, in order of camera, pair and instant.

    `_run` numbers the runs and `_pair` the pairs of tracks, both in this order; `_frame` is the row of `instants`.
    """
    pairs = held["pairs"]
    rows, near_from, near_to = _close_rows(pairs, site)
    named = ("hour", "camera_id", "ts_ms", "track_a", "track_b", "distance_mm", "weight_ms", "is_owned", "_frame")
    pairs = take(pairs, rows, *named, "x_a_mm", "y_a_mm", "x_b_mm", "y_b_mm")
    camera, ts, hour = pairs["camera_id"], pairs["ts_ms"], pairs["hour"]
    is_turned = pairs["track_a"] > pairs["track_b"]
    a, b = (
        np.where(is_turned, pairs[other], pairs[one]) for one, other in (("track_a", "track_b"), ("track_b", "track_a"))
    )
    sides = (("a", "b"), ("b", "a"))
    places = {
        f"{c}_{one}_mm": np.where(is_turned, pairs[f"{c}_{other}_mm"], pairs[f"{c}_{one}_mm"])
        for one, other in sides
        for c in ("x", "y")
    }
    interval = site.days.interval_ms(camera, ts)
    gap = gap_ms(interval, site.params["episode_gap_ms"], site)
    n = len(ts)
    pair_starts = starts_of(camera, a, b)
    is_first, is_last = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    is_first[pair_starts] = True
    is_last[:-1], is_last[-1:] = is_first[1:], True
    step = np.diff(ts, append=0)
    follows = ~is_first
    follows[1:] &= step[:-1] <= gap[1:]
    is_run_start = ~follows
    is_run_start[1:] |= hour[1:] != hour[:-1]
    run_starts = np.flatnonzero(is_run_start)
    run = run_of(run_starts, n)
    return {
        "hour": hour,
        "camera_id": camera,
        "track_a": a,
        "track_b": b,
        "ts_ms": ts,
        "started_ms": picked(ts[run_starts], run),
        "weight_ms": pairs["weight_ms"],
        "interval_ms": interval,
        "gap_ms": gap,
        **places,
        "distance_mm": pairs["distance_mm"],
        "is_owned": pairs["is_owned"],
        "follows": follows,
        "is_followed": ~is_last & (step <= gap),
        "near_from_ms": np.maximum(near_from, HOUR_MS * hour - gap),
        "near_to_ms": np.minimum(near_to, HOUR_MS * (hour + 1) + gap),
        **{f"next_{name}": _next(values, is_last) for name, values in (("ms", ts), *places.items())},
        "_run": run,
        "_pair": run_of(pair_starts, n),
        "_frame": pairs["_frame"],
    }


def _close_rows(pairs: Columns, site: SiteTables) -> tuple[Ints, Ints, Ints]:
    """Return the violation records in order of camera, pair and instant, and since and until when each pair is near."""
    distance_mm = int(site.params["distance_mm"])
    is_near = pairs["distance_mm"] < distance_mm + int(site.params["parting_mm"])
    rows = np.flatnonzero(is_near & (pairs["track_a"] >= 0) & (pairs["track_b"] >= 0))
    a, b, camera = (picked(pairs[c], rows) for c in ("track_a", "track_b", "camera_id"))
    a, b = np.minimum(a, b), np.maximum(a, b)
    order = order_by(camera, a, b)  # those of a camera are in order of instants
    rows, a, b, camera = (picked(values, order) for values in (rows, a, b, camera))
    ts = picked(pairs["ts_ms"], rows)
    gap = gap_ms(site.days.interval_ms(camera, ts), site.params["episode_gap_ms"], site)
    is_begun = np.zeros(len(ts), dtype=np.bool_)
    is_begun[starts_of(camera, a, b)] = True
    is_begun[1:] |= np.diff(ts) > gap[1:]
    starts = np.flatnonzero(is_begun)
    stretch, is_close = run_of(starts, len(ts)), picked(pairs["distance_mm"], rows) < distance_mm
    near_from, near_to = ts[starts], ts[ends_of(starts, len(ts)) - 1] if len(ts) else ts
    stretch = stretch[is_close]
    return rows[is_close], picked(near_from, stretch), picked(near_to, stretch)


def _next(values: Ints, is_last: Bools) -> Ints:
    """Return the value of the row after each, NULL for the last ones of their group."""
    following = np.append(values[1:], NULL)[: len(values)]
    following[is_last] = NULL
    return following


def episode_cells(held: Held, site: SiteTables) -> Columns:
    """Return `facts/episode_cells`."""
    records, cell_mm = held["close_records"], int(site.params["cell_mm"])
    n = len(records["_run"])
    x, y = (np.concatenate([records[f"{c}_a_mm"], records[f"{c}_b_mm"]]) for c in ("x", "y"))
    rows = np.flatnonzero(x != NULL)
    record, cx, cy = rows % max(1, n), x[rows] // cell_mm, y[rows] // cell_mm
    order, starts = grouped_by(records["hour"][record], records["_run"][record], cx, cy)
    record = record[order]
    weight = records["weight_ms"][record]
    first = record[starts]
    return {
        **{c: records[c][first] for c in ("hour", "camera_id", "track_a", "track_b", "started_ms")},
        "cx": cx[order[starts]],
        "cy": cy[order[starts]],
        "violation_ms": sums(weight, starts),
        "owned_ms": sums(np.where(records["is_owned"][record], weight, 0), starts),
    }


def track_pairs(held: Held, site: SiteTables) -> Columns:
    """Return `facts/track_pairs`."""
    records = held["close_records"] if "close_records" in held else close_records(held, site)
    records = take(records, np.flatnonzero(records["track_a"] != records["track_b"]))
    starts = starts_of(records["hour"], records["_pair"])
    n = len(records["hour"])
    ts, x2, y2 = records["ts_ms"], *(records[f"{c}_a_mm"] + records[f"{c}_b_mm"] for c in "xy")
    known = np.flatnonzero(x2 > NULL // 2)
    ends = ends_of(starts, n)
    first, after = np.searchsorted(known, starts), np.searchsorted(known, ends)
    is_placed = first < after
    first, last = (known[np.where(is_placed, at, 0)] if len(known) else starts for at in (first, after - 1))
    is_in_company = is_standing(held, site, *(records[c] for c in ("camera_id", "ts_ms", "track_a", "track_b")))
    pairs = {
        **{c: records[c][starts] for c in ("hour", "camera_id", "track_a", "track_b")},
        "n_records": ends - starts,
        "n_near": sums(records["distance_mm"] <= site.params["together_mm"], starts),
        "violation_ms": sums(records["weight_ms"], starts),
        "standing_ms": sums(np.where(is_in_company, records["weight_ms"], 0), starts),
    }
    for name, row in (("first", first), ("last", last)):
        pairs |= {
            f"{name}_ms": np.where(is_placed, ts[row], NULL),
            f"{name}_x2_mm": np.where(is_placed, x2[row], NULL),
            f"{name}_y2_mm": np.where(is_placed, y2[row], NULL),
        }
    return take(pairs, order_by(pairs["hour"], records["_pair"][starts]))
