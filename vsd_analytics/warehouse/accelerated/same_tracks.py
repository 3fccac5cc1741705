"""`same_tracks`: track ids that are one person, because an id was switched or is a double."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.warehouse.accelerated.columns import (
    distinct,
    ends_of,
    grouped_by,
    order_by,
    picked,
    run_of,
    starts_of,
    take,
)
from vsd_analytics.warehouse.accelerated.located import HOUR_MS
from vsd_analytics.warehouse.accelerated.site_tables import SiteTables
from vsd_analytics.warehouse.held import NULL, Columns, Held, Ints

Floats = NDArray[np.float64]
_NONE = 2**50


def same_tracks(held: Held, site: SiteTables) -> Columns:
    """Return `facts/same_tracks`."""
    pairs = np.concatenate([_switched(held["located"], site), _doubles(held, site)], axis=1)
    hour, camera, a, b = pairs
    order, starts = grouped_by(hour, camera, a, b)
    return dict(zip(("hour", "camera_id", "track_a", "track_b"), pairs[:, order[starts]], strict=True))


def _switched(located: Columns, site: SiteTables) -> NDArray[np.int64]:
    """Return hour, camera and both ids where one track begins where, and right after, another one ends."""
    rows = np.flatnonzero((located["track_id"] >= 0) & (located["x_mm"] != NULL))
    # records of a camera are in order of instants, those of a frame in order of members
    rows = picked(rows, order_by(*(picked(located[c], rows) for c in ("camera_id", "track_id"))))
    records = take(located, rows, "camera_id", "track_id", "ts_ms", "x_mm", "y_mm")
    once = starts_of(records["camera_id"], records["track_id"], records["ts_ms"])
    records = records if len(once) == len(rows) else take(records, once)
    camera, track, ts = records["camera_id"], records["track_id"], records["ts_ms"]
    n = len(ts)
    interval = site.days.interval_ms(camera, ts)
    rules = site.params
    reach = np.maximum(rules["episode_gap_ms"], rules["cut_half_intervals"] * interval // 2)
    reach = np.minimum(rules["cut_most_ms"], reach)
    is_first = np.ones(n, dtype=np.bool_)
    is_first[1:] = (camera[1:] != camera[:-1]) | (track[1:] != track[:-1])
    is_last = np.append(is_first[1:], True)[:n]
    step = np.diff(ts, append=0)
    end = np.flatnonzero(is_last | (step > reach))
    start = np.flatnonzero(is_first | (np.append(0, step[:-1])[:n] > reach))
    first = starts_of(camera, track)
    life = run_of(first, n)
    reached = np.maximum(rules["cut_speed_ms"], int(rules["next_half_intervals"]) * interval // 2)
    # one number in order of track and instant finds the farthest record within reach, inwards
    low = int(ts.min(initial=2**62))
    span = int(ts.max(initial=low)) - low + 2 * int(reached.max(initial=0)) + 3
    key = life * np.int64(span) + (ts - low)
    last = ends_of(first, n) - 1
    inner_end = np.maximum(np.searchsorted(key, key[end] - reached[end]), first[life[end]])
    inner_start = np.minimum(np.searchsorted(key, key[start] + reached[start], side="right") - 1, last[life[start]])
    v_end, v_start = _speeds(records, inner_end, end), _speeds(records, start, inner_start)

    order = order_by(camera[start], ts[start])
    start, v_start = start[order], v_start[:, order]
    wide = int(ts.max(initial=low)) - low + int(rules["cut_most_ms"]) + 2
    begins = camera[start] * np.int64(wide) + (ts[start] - low)
    over = camera[end] * np.int64(wide) + (ts[end] - low)
    after = np.searchsorted(begins, over, side="right")
    count = np.searchsorted(begins, over + reach[end], side="right") - after
    one = np.repeat(np.arange(len(end)), count)
    other = np.arange(len(one)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(after, count)
    is_else = track[end[one]] != track[start[other]]
    one, other = one[is_else], other[is_else]
    e, s = end[one], start[other]
    away = ts[s] - ts[e]
    v = np.where(np.isnan(v_end[:, one]), v_start[:, other], v_end[:, one])
    w = np.where(np.isnan(v_start[:, other]), v_end[:, one], v_start[:, other])
    v, w = np.nan_to_num(v), np.nan_to_num(w)
    off = [records[c][s] - records[c][e] - (v[i] + w[i]) / 2 * away for i, c in enumerate(("x_mm", "y_mm"))]
    square = off[0] * off[0] + off[1] * off[1]
    turn = v - w
    is_there = turn[0] * turn[0] + turn[1] * turn[1] <= (rules["cut_turn_mm_per_s"] / 1000) ** 2
    within = rules["cut_place_mm"] + rules["cut_mm_per_s"] * away / 1000
    is_there &= square <= within * within
    one, other, square = one[is_there], other[is_there], square[is_there]
    e, s = end[one], start[other]
    is_best = _is_least(square, one, track[s], ts[s]) & _is_least(square, other, track[e], ts[e])
    e, s = e[is_best], s[is_best]
    return np.stack([ts[s] // HOUR_MS, camera[e], np.minimum(track[e], track[s]), np.maximum(track[e], track[s])])


def _speeds(records: Columns, first: Ints, last: Ints) -> Floats:
    """Return the mean speed from one record to a later one of its track along both axes; NaN where they are one."""
    away = (records["ts_ms"][last] - records["ts_ms"][first]).astype(np.float64)
    away[away == 0] = np.nan
    return np.stack([(records[c][last] - records[c][first]) / away for c in ("x_mm", "y_mm")])


def _is_least(square: Floats, group: Ints, track: Ints, ts: Ints) -> NDArray[np.bool_]:
    """Return whether a row has the least square of its group; among equals, the least track and instant."""
    order = np.lexsort((ts, track, square, group))
    is_least = np.zeros(len(order), dtype=np.bool_)
    is_least[order[starts_of(group[order])]] = True
    return is_least


def _doubles(held: Held, site: SiteTables) -> NDArray[np.int64]:
    """Return hour, camera and both ids where one is beside the other one in most of its records of the hour."""
    pairs, located, rules = held["pairs"], held["located"], site.params
    is_near = (pairs["distance_mm"] <= rules["double_mm"]) & (pairs["track_a"] >= 0) & (pairs["track_b"] >= 0)
    rows = np.flatnonzero(is_near & (pairs["track_a"] != pairs["track_b"]))
    a, b = (picked(pairs[c], rows) for c in ("track_a", "track_b"))
    hour, camera = (picked(pairs[c], rows) for c in ("hour", "camera_id"))
    a, b = np.minimum(a, b), np.maximum(a, b)
    order, starts = grouped_by(hour, camera, a, b)
    n_near, at = np.diff(starts, append=len(rows)), order[starts]
    is_often = n_near >= rules["double_records"]
    at, n_near = at[is_often], n_near[is_often]
    hour, camera, a, b = hour[at], camera[at], a[at], b[at]
    lives = _n_records(located, hour, camera, a, b)
    is_double = 1000 * n_near >= rules["double_thousandths"] * lives
    return np.stack([v[is_double].astype(np.int64) for v in (hour, camera, a, b)])


def _n_records(located: Columns, hour: Ints, camera: Ints, a: Ints, b: Ints) -> Ints:
    """Return the records that the rarer of two ids has in an hour; more than there are where one has none."""
    ids = distinct(np.concatenate([a, b]))
    rows = np.flatnonzero(np.isin(located["track_id"], ids))
    keys = (picked(located["ts_ms"], rows) // HOUR_MS, *(picked(located[c], rows) for c in ("camera_id", "track_id")))
    order, starts = grouped_by(*keys)
    n = np.diff(starts, append=len(rows))
    known = {key: k for k, key in enumerate(zip(*(v[order[starts]].tolist() for v in keys), strict=True))}
    counts = np.full((2, len(hour)), _NONE)
    for side, tracks in enumerate((a, b)):
        wanted = zip(hour.tolist(), camera.tolist(), tracks.tolist(), strict=True)
        counts[side] = [n[known[key]] if key in known else _NONE for key in wanted]
    return np.where(counts.max(axis=0) == _NONE, _NONE, counts.min(axis=0))
