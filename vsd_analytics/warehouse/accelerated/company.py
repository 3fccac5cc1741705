"""Company of people who stand: `standing_groups`, and the relations of windows it is computed from."""

from __future__ import annotations

import numpy as np

from vsd_analytics.stats.standing_company import mean_distances_mm, stands_together
from vsd_analytics.warehouse.accelerated.columns import order_by, picked, starts_of, summed, take
from vsd_analytics.warehouse.accelerated.site_tables import SiteTables
from vsd_analytics.warehouse.graphs import least_connected
from vsd_analytics.warehouse.held import Bools, Columns, Held, Ints

_HOUR_MS = 3_600_000


def window_tracks(held: Held, site: SiteTables) -> Columns:
    """Return `staging/window_tracks`, in order of camera, window and track."""
    located = held["located"]
    rows = np.flatnonzero(located["track_id"] >= 0)
    tracks = summed(
        {
            "camera_id": located["camera_id"][rows],
            "window_ms": _window(located["ts_ms"][rows], site),
            "track_id": located["track_id"][rows],
        },
        {"seen_ms": located["weight_ms"][rows]},
    )
    n = len(tracks["track_id"])
    starts = starts_of(tracks["camera_id"], tracks["window_ms"])
    before = np.repeat(starts, np.diff(starts, append=n))
    return {**tracks, "member": np.arange(n) - before + 1}


def window_pairs(held: Held, site: SiteTables) -> Columns:
    """Return `staging/window_pairs`; `_a` and `_b` are the rows of `window_tracks`."""
    pairs, reach_mm = held["pairs"], int(site.params["company_reach_mm"])
    a, b = pairs["track_a"], pairs["track_b"]
    rows = np.flatnonzero((pairs["distance_mm"] < reach_mm) & (a >= 0) & (b >= 0) & (a != b))
    a, b, weight = picked(a, rows), picked(b, rows), picked(pairs["weight_ms"], rows).astype(np.int64)
    columns = summed(
        {
            "camera_id": picked(pairs["camera_id"], rows),
            "window_ms": _window(picked(pairs["ts_ms"], rows), site),
            "track_a": np.minimum(a, b),
            "track_b": np.maximum(a, b),
        },
        {"n_records": np.ones_like(weight), "close_ms": weight, "mm_ms": weight * picked(pairs["distance_mm"], rows)},
    )
    tracks = held["window_tracks"]
    sides = [_rows_of(tracks, *(columns[c] for c in ("camera_id", "window_ms", f"track_{side}"))) for side in "ab"]
    is_seen = (sides[0] >= 0) & (sides[1] >= 0) & (columns["close_ms"] > 0)
    columns = take({**columns, "_a": sides[0], "_b": sides[1]}, is_seen)
    seen_ms = np.maximum(tracks["seen_ms"][columns["_a"]], tracks["seen_ms"][columns["_b"]])
    return {
        **columns,
        "member_a": tracks["member"][columns["_a"]],
        "member_b": tracks["member"][columns["_b"]],
        "mean_mm": mean_distances_mm(columns["mm_ms"], columns["close_ms"], seen_ms, reach_mm=reach_mm),
    }


def window_company(held: Held, site: SiteTables) -> Columns:
    """Return `staging/window_company`; `_row` and `_first` are rows of `window_tracks`."""
    pairs, tracks, params = held["window_pairs"], held["window_tracks"], site.params
    is_long = pairs["close_ms"] >= params["company_least_ms"]
    is_long &= pairs["n_records"] >= params["company_least_records"]
    is_together = stands_together(
        pairs["_a"],
        pairs["_b"],
        pairs["mean_mm"],
        is_long,
        together_mm=int(params["together_mm"]),
        reach_mm=int(params["company_reach_mm"]),
    )
    a, b = pairs["_a"][is_together], pairs["_b"][is_together]
    first = least_connected(a, b, len(tracks["track_id"]))
    row = np.unique(np.concatenate([a, b]))
    first = first[row]
    return {
        "camera_id": tracks["camera_id"][row],
        "window_ms": tracks["window_ms"][row],
        "node": tracks["member"][row],
        "component": tracks["member"][first],
        "_row": row,
        "_first": first,
    }


def standing_tracks(held: Held, site: SiteTables) -> Columns:
    """Return `staging/standing_tracks`, in order of camera, window and track."""
    del site
    company, tracks = held["window_company"], held["window_tracks"]
    columns = take(tracks, company["_row"], "camera_id", "window_ms", "track_id", "seen_ms")
    return {**columns, "group_id": tracks["track_id"][company["_first"]]}


def standing_groups(held: Held, site: SiteTables) -> Columns:
    """Return `facts/standing_groups`."""
    del site
    tracks = held["standing_tracks"]
    rows = {"hour": tracks["window_ms"] // _HOUR_MS, **tracks, "exposure_ms": tracks["seen_ms"]}
    return take(rows, order_by(rows["hour"], rows["camera_id"], rows["window_ms"], rows["track_id"]))


def is_standing(held: Held, site: SiteTables, camera: Ints, ts: Ints, a: Ints, b: Ints) -> Bools:
    """Return whether two tracks stand in one company in the window of an instant."""
    tracks, window = held["standing_tracks"], _window(ts, site)
    if not len(tracks["track_id"]):
        return np.zeros(len(ts), dtype=np.bool_)
    first, second = (_rows_of(tracks, camera, window, side) for side in (a, b))
    group = tracks["group_id"]
    is_together: Bools = (first >= 0) & (second >= 0) & (group[first] == group[second])
    return is_together


def _window(ts: Ints, site: SiteTables) -> Ints:
    width_ms = int(site.params["company_window_ms"])
    windows: Ints = ts // width_ms * width_ms
    return windows


def _rows_of(tracks: Columns, camera: Ints, window: Ints, track: Ints) -> Ints:
    """Return the row of each track in a window, -1 without one; rows are in order of camera, window and track."""
    if not len(tracks["track_id"]):
        return np.full(len(track), -1, dtype=np.int64)
    low, n_tracks = int(tracks["window_ms"].min()), int(max(tracks["track_id"].max(), track.max(initial=0))) + 1
    n_windows = int(max(tracks["window_ms"].max(), window.max(initial=low))) - low + 1

    def keys(camera: Ints, window: Ints, track: Ints) -> Ints:
        packed: Ints = (camera.astype(np.int64) * n_windows + (window - low)) * n_tracks + track
        return packed

    known = keys(*(tracks[c] for c in ("camera_id", "window_ms", "track_id")))
    wanted = np.where((track < 0) | (window < low), -1, keys(camera, window, track))
    at = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
    rows: Ints = np.where(known[at] == wanted, at, -1)
    return rows
