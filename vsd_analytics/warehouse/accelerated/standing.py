"""Facts of where people stood: `exposure`, `crowding`, `area_tracks` and `track_lives`."""

from __future__ import annotations

import numpy as np

from vsd_analytics.warehouse.accelerated.columns import (
    ends_of,
    grouped_by,
    n_true,
    order_by,
    picked,
    starts_of,
    summed,
    sums,
    take,
)
from vsd_analytics.warehouse.accelerated.site_tables import NO_AREAS, SiteTables, areas_of, is_close
from vsd_analytics.warehouse.held import NULL, Columns, Held, Ints

_QUARTER_MS, _HOUR_MS = 900_000, 3_600_000


def exposure(held: Held, site: SiteTables) -> Columns:
    """Return `facts/exposure`."""
    del site
    located, frames = held["located"], held["instants"]
    starts = starts_of(located["_frame"])
    frame, n_owned = located["_frame"][starts], n_true(located["is_owned"], starts)
    quarter = frames["ts_ms"][frame] // _QUARTER_MS
    return summed(
        {"hour": quarter // 4, "camera_id": frames["camera_id"][frame], "quarter": quarter},
        {
            "person_records": n_owned,
            "n_doubled": np.diff(starts, append=len(located["_frame"])) - n_owned,
            "n_unlocated": n_true(located["x_mm"] == NULL, starts),
            "exposure_ms": n_owned * frames["weight_ms"][frame],
        },
    )


def crowding(held: Held, site: SiteTables) -> Columns:
    """Return `facts/crowding`."""
    located, pairs, frames = held["located"], held["pairs"], held["instants"]
    is_standing = located["is_owned"] & (located["x_mm"] != NULL)
    n_persons = np.bincount(located["_frame"][is_standing], minlength=len(frames["ts_ms"]))
    frame = np.flatnonzero(n_persons)
    n, weight = n_persons[frame], frames["weight_ms"][frame]
    close = np.flatnonzero(is_close(pairs, site))
    for side in ("_row_a", "_row_b"):
        close = close[pairs[side][close] >= 0]
        close = close[is_standing[pairs[side][close]]]
    camera = np.concatenate([frames["camera_id"][frame], pairs["camera_id"][close]])
    quarter = np.concatenate([frames["ts_ms"][frame], pairs["ts_ms"][close]]) // _QUARTER_MS
    none, no_pair = np.zeros(len(close), dtype=np.int64), np.zeros(len(frame), dtype=np.int64)
    return summed(
        {"hour": quarter // 4, "camera_id": camera, "quarter": quarter},
        {
            "frames": np.concatenate([no_pair + 1, none]),
            "person_ms": np.concatenate([n * weight, none]),
            "copresent_pair_ms": np.concatenate([n * (n - 1) // 2 * weight, none]),
            "close_pair_ms": np.concatenate([no_pair, pairs["weight_ms"][close]]),
        },
    )


def area_tracks(held: Held, site: SiteTables) -> Columns:
    """Return `facts/area_tracks`."""
    located = held["located"]
    rows = np.flatnonzero(located["is_owned"] & (located["x_mm"] != NULL) & (located["track_id"] >= 0))
    at = take(located, rows, "camera_id", "track_id", "ts_ms", "x_mm", "y_mm")
    area, names = areas_of(at, held["cameras"], held["area_cells"], site)
    rows = np.flatnonzero(area > NO_AREAS)
    hour, camera, track = (v[rows] for v in (at["ts_ms"] // _HOUR_MS, at["camera_id"], at["track_id"]))
    order, starts = grouped_by(hour, camera, area[rows], track)
    chosen = order[starts]
    area_id = np.array([*names, None], dtype=object)[area[rows][chosen]]
    return {"hour": hour[chosen], "camera_id": camera[chosen], "area_id": area_id, "track_id": track[chosen]}


def track_lives(held: Held, site: SiteTables) -> Columns:
    """Return `facts/track_lives`."""
    located = held["located"]
    rows = np.flatnonzero(located["track_id"] >= 0)
    # records of a camera are in order of instants
    rows = picked(rows, order_by(*(picked(located[c], rows) for c in ("camera_id", "track_id"))))
    located = take(located, rows, "camera_id", "track_id", "ts_ms", "x_mm", "y_mm", "weight_ms")
    hour = located["ts_ms"] // _HOUR_MS
    camera, track, ts = located["camera_id"], located["track_id"], located["ts_ms"]
    starts = starts_of(camera, track, hour)
    ends = ends_of(starts, len(ts)) - 1
    n_ends, n_goes_on, n_came_before = _ended(located, starts, ends, site)
    lives = {
        "hour": hour[starts],
        "camera_id": camera[starts],
        "track_id": track[starts],
        "n_records": ends - starts + 1,
        "first_ms": ts[starts],
        "last_ms": ts[ends],
        "exposure_ms": sums(located["weight_ms"], starts),
        "n_ends": n_ends,
        "n_goes_on": n_goes_on,
        "n_came_before": n_came_before,
    }
    return take(lives, order_by(lives["hour"], lives["camera_id"], lives["track_id"]))


def _ended(located: Columns, starts: Ints, ends: Ints, site: SiteTables) -> tuple[Ints, Ints, Ints]:
    """Return 1 for each life that ends at a known place, and how many others begin there after and before it."""
    n, ts = len(starts), located["ts_ms"]
    known = np.flatnonzero(located["x_mm"] != NULL)
    after = np.searchsorted(known, ends, side="right") - 1  # its last known place
    before = np.searchsorted(known, starts)
    is_placed = before <= after
    first_row, last_row = (known[np.where(is_placed, at, 0)] if len(known) else starts * 0 for at in (before, after))
    camera, track = located["camera_id"][starts], located["track_id"][starts]
    first_ms, last_ms, moved_ms = ts[starts], ts[ends], ts[last_row] - ts[first_row]
    first, last = (tuple(located[c][row] for c in ("x_mm", "y_mm")) for row in (first_row, last_row))
    speed = [
        np.where(moved_ms == 0, 0.0, (e - b) / np.where(moved_ms == 0, 1, moved_ms))
        for b, e in zip(first, last, strict=True)
    ]
    interval = site.days.interval_ms(camera, first_ms // _HOUR_MS * _HOUR_MS)
    rules = site.params
    reach = np.maximum(
        rules["cut_least_ms"], np.minimum(rules["cut_most_ms"], rules["cut_half_intervals"] * interval // 2)
    )
    same = np.zeros(n, dtype=np.bool_)
    same[1:] = (camera[1:] == camera[:-1]) & (track[1:] == track[:-1])
    is_new = ~same
    is_new[1:] |= first_ms[1:] - last_ms[:-1] > reach[1:]
    is_over = np.ones(n, dtype=np.bool_)
    is_over[:-1] = ~same[1:] | (first_ms[1:] - last_ms[:-1] > reach[:-1])
    end, start = np.flatnonzero(is_placed & is_over), np.flatnonzero(is_placed & is_new)
    start = start[order_by(camera[start], first_ms[start])]
    low = int(min(first_ms.min(), last_ms.min())) - 2 * rules["cut_most_ms"] if n else 0
    span = int(last_ms.max()) - low + 4 * rules["cut_most_ms"] if n else 1
    key, at = camera[start] * np.int64(span) + first_ms[start] - low, camera[end] * np.int64(span) + last_ms[end] - low
    begins = np.searchsorted(key, at - reach[end])
    count = np.searchsorted(key, at + reach[end], side="right") - begins
    one = np.repeat(end, count)
    other = start[np.arange(len(one)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(begins, count)]
    is_else = track[one] != track[other]
    one, other = one[is_else], other[is_else]
    after_ms = first_ms[other] - last_ms[one]
    off = [b[other] - e[one] - v[one] * after_ms for b, e, v in zip(first, last, speed, strict=True)]
    is_there = off[0] * off[0] + off[1] * off[1] <= np.power(
        rules["cut_place_mm"] + rules["cut_mm_per_s"] * np.abs(after_ms) / 1000, 2
    )
    n_ends = np.zeros(n, dtype=np.int64)
    n_ends[end] = 1
    goes_on, came_before = (
        np.bincount(one[is_there & is_side], minlength=n) for is_side in (after_ms > 0, after_ms < 0)
    )
    return n_ends, goes_on, came_before
