"""Gatherings: `shared_tracks`, `gathering_links`, `gathering_parts`, `gathering_joins`."""

from __future__ import annotations

import numpy as np

from vsd_analytics.warehouse.accelerated.columns import (
    beside,
    greatest,
    least,
    order_by,
    picked,
    rounded,
    starts_of,
    sums,
    take,
)
from vsd_analytics.warehouse.accelerated.site_tables import SiteTables
from vsd_analytics.warehouse.graphs import least_connected
from vsd_analytics.warehouse.held import NULL, Columns, Held

_HOUR_MS, _STEPS = 3_600_000, 8


def shared_tracks(held: Held, site: SiteTables) -> Columns:
    """Return `staging/shared_tracks`, in order of camera, tracks and cluster."""
    crowd_people = int(site.params["crowd_people"])
    clusters, people = held["gathering_clusters"], held["clustered"]
    number = np.full(len(people["ts_ms"]), -1, dtype=np.int64)
    number[clusters["_row"]] = np.arange(len(clusters["_row"]))
    cluster = picked(number, held["frame_clusters"]["_first"])
    rows = np.flatnonzero((cluster >= 0) & (people["track_id"] >= 0))
    cluster, track = picked(cluster, rows), picked(people["track_id"], rows)
    order = order_by(cluster, track)
    cluster, track = picked(cluster, order), picked(track, order)
    once = starts_of(cluster, track)  # an engine may send one id twice in a frame
    cluster, track = picked(cluster, once), picked(track, once)
    starts = starts_of(cluster)
    place = np.arange(len(cluster)) - np.repeat(starts, np.diff(starts, append=len(cluster)))
    is_crowd = clusters["n_people"][cluster] > crowd_people
    pairs = []
    for rows, reach in ((np.flatnonzero(~is_crowd), crowd_people), (np.flatnonzero(is_crowd), _STEPS)):
        pairs += [(rows[a], rows[b]) for a, b in beside(cluster[rows], place[rows], reach)]
    a, b = (np.concatenate([once[:0], *(f[i] for f in pairs)]) for i in range(2))
    pair_cluster, a, b = picked(cluster, a), picked(track, a), picked(track, b)
    camera = picked(clusters["camera_id"], pair_cluster)
    order = order_by(camera, a, b, pair_cluster)
    camera, pair_cluster, a, b = (picked(values, order) for values in (camera, pair_cluster, a, b))
    ts, gap = picked(clusters["ts_ms"], pair_cluster), picked(clusters["gap_ms"], pair_cluster)
    is_next = np.zeros(len(pair_cluster), dtype=np.bool_)
    is_next[1:] = (camera[1:] == camera[:-1]) & (a[1:] == a[:-1]) & (b[1:] == b[:-1]) & (ts[1:] - ts[:-1] <= gap[1:])
    before = np.maximum(np.arange(len(pair_cluster)) - 1, 0)
    is_followed = np.append(is_next[1:], False)[: len(pair_cluster)]
    after = np.minimum(np.arange(len(pair_cluster)) + 1, max(0, len(pair_cluster) - 1))
    return {
        "hour": clusters["hour"][pair_cluster],
        "camera_id": camera,
        "cluster_no": pair_cluster + 1,
        "ts_ms": ts,
        "track_a": a,
        "track_b": b,
        "before_no": np.where(is_next, pair_cluster[before] + 1, NULL),
        "before_ms": np.where(is_next, ts[before], NULL),
        "after_ms": np.where(is_followed, ts[after], NULL),
    }


def gathering_links(held: Held, site: SiteTables) -> Columns:
    """Return `staging/gathering_links`, in order of nodes."""
    del site
    shared, number = held["shared_tracks"], held["gathering_clusters"]["cluster_no"]
    is_own = (shared["before_no"] != NULL) & (shared["before_ms"] // _HOUR_MS == shared["hour"])
    first = least_connected(shared["before_no"][is_own] - 1, shared["cluster_no"][is_own] - 1, len(number))
    return {"node": number, "component": first + 1}


def gathering_parts(held: Held, site: SiteTables) -> Columns:
    """Return `facts/gathering_parts`."""
    every, shared, first = held["gathering_clusters"], held["shared_tracks"], held["gathering_links"]["component"] - 1
    n = len(first)
    open_left, open_right = np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    part = first[shared["cluster_no"] - 1]
    before, after = shared["before_ms"], shared["after_ms"]
    open_left[part[(before != NULL) & (before // _HOUR_MS < shared["hour"])]] = True
    open_right[part[(after != NULL) & (after // _HOUR_MS > shared["hour"])]] = True
    order = order_by(first, every["ts_ms"])
    first, c = first[order], take(every, order)
    starts = starts_of(first)
    person_ms, is_placed, is_wide = c["n_people"] * c["weight_ms"], c["n_located"] > 0, c["square_mm2"] != NULL
    n_located = np.maximum(1, c["n_located"])
    x, y = (rounded(person_ms * np.where(is_placed, c[f"sum_{k}_mm"], 0) / n_located) for k in "xy")
    width = rounded(c["weight_ms"] * np.sqrt(np.where(is_wide, c["square_mm2"], 0)))
    at_once = starts_of(first, c["ts_ms"])
    most = greatest(sums(c["n_people"], at_once), np.searchsorted(at_once, starts))
    named = first[starts]
    parts = {
        **{k: c[k][starts] for k in ("hour", "camera_id")},
        "started_ms": least(c["ts_ms"], starts),
        "cluster": every["cluster"][named],
        "ended_ms": greatest(c["ts_ms"], starts),
        "interval_ms": greatest(c["interval_ms"], starts),
        "n_people": most,
        "person_ms": sums(person_ms, starts),
        "placed_ms": sums(np.where(is_placed, person_ms, 0), starts),
        "x_mm_ms": sums(x, starts),
        "y_mm_ms": sums(y, starts),
        "wide_ms": sums(np.where(is_wide, c["weight_ms"], 0), starts),
        "width_mm_ms": sums(width, starts),
        "open_left": open_left[named],
        "open_right": open_right[named],
    }
    is_long = parts["ended_ms"] - parts["started_ms"] + parts["interval_ms"] >= site.params["gathering_last_ms"]
    rows = np.flatnonzero(is_long | parts["open_left"] | parts["open_right"])
    keys = ("hour", "camera_id", "started_ms", "cluster")
    return take(parts, rows[order_by(*(parts[k][rows] for k in keys))])


def gathering_joins(held: Held, site: SiteTables) -> Columns:
    """Return `facts/gathering_joins`."""
    del site
    every, shared, first = held["gathering_clusters"], held["shared_tracks"], held["gathering_links"]["component"] - 1
    hour, before, after = shared["hour"], shared["before_ms"], shared["after_ms"]
    before = np.where((before != NULL) & (before // _HOUR_MS < hour), before, NULL)
    after = np.where((after != NULL) & (after // _HOUR_MS > hour), after, NULL)
    rows = np.flatnonzero((before != NULL) | (after != NULL))
    part = first[shared["cluster_no"][rows] - 1]
    joins = {
        "hour": hour[rows],
        "camera_id": shared["camera_id"][rows],
        "started_ms": every["ts_ms"][part],
        "cluster": every["cluster"][part],
        **{c: shared[c][rows] for c in ("track_a", "track_b", "ts_ms")},
        "before_ms": before[rows],
        "after_ms": after[rows],
    }
    keys = ("hour", "camera_id", "ts_ms", "track_a", "track_b", "started_ms", "cluster")
    return take(joins, order_by(*(joins[k] for k in keys)))
