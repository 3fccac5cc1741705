"""`episode_segments`: runs of violation records, and when the two came near and parted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.warehouse.accelerated.columns import ends_of, greatest, least, order_by, rounded, starts_of, sums
from vsd_analytics.warehouse.accelerated.site_tables import SiteTables
from vsd_analytics.warehouse.held import NULL, Columns, Held, Ints

Floats = NDArray[np.float64]
_AFTER_ALL = 2**62


def episode_segments(held: Held, site: SiteTables) -> Columns:
    """Return `facts/episode_segments`."""
    records = held["close_records"]
    starts = starts_of(records["_run"])
    ends = ends_of(starts, len(records["_run"])) - 1
    is_owned, ts = records["is_owned"], records["ts_ms"]
    is_placed = (records["x_a_mm"] != NULL) & (records["x_b_mm"] != NULL)
    x2, y2 = (np.where(is_placed, records[f"{c}_a_mm"] + records[f"{c}_b_mm"], 0) for c in ("x", "y"))
    distance = records["distance_mm"]
    n_owned = sums(is_owned, starts)
    before, after = _crossings(held, records, starts, ends, site)
    segments = {
        **{c: records[c][starts] for c in ("hour", "camera_id", "track_a", "track_b", "started_ms")},
        "ended_ms": ts[ends],
        "interval_ms": greatest(records["interval_ms"], starts),
        "gap_ms": greatest(records["gap_ms"], starts),
        "n_records": ends - starts + 1,
        "n_located": sums(is_placed, starts),
        "sum_x2_mm": sums(x2, starts),
        "sum_y2_mm": sums(y2, starts),
        "min_distance_mm": least(distance, starts),
        "sum_distance_mm": sums(distance, starts),
        **{f"n_below_{mm}": sums(distance < mm, starts) for mm in (500, 1000, 1500)},
        "open_left": records["follows"][starts],
        "open_right": records["is_followed"][ends],
        "before_ms": before,
        "after_ms": after,
        "near_from_ms": records["near_from_ms"][starts],
        "near_to_ms": records["near_to_ms"][starts],
        "n_owned": n_owned,
        "owned_from_ms": np.where(n_owned > 0, least(np.where(is_owned, ts, _AFTER_ALL), starts), NULL),
        "owned_to_ms": np.where(n_owned > 0, greatest(np.where(is_owned, ts, NULL), starts), NULL),
        "n_owned_located": sums(is_owned & is_placed, starts),
        "owned_x2_mm": sums(np.where(is_owned, x2, 0), starts),
        "owned_y2_mm": sums(np.where(is_owned, y2, 0), starts),
    }
    order = order_by(segments["hour"], np.arange(len(starts)))
    return {name: values[order] for name, values in segments.items()}


def _crossings(held: Held, records: Columns, starts: Ints, ends: Ints, site: SiteTables) -> tuple[Ints, Ints]:
    """Return how long before its first record each run crossed the distance, and how long after its last."""
    before, after = np.full(len(starts), NULL, dtype=np.int64), np.full(len(starts), NULL, dtype=np.int64)
    begins, stops = np.flatnonzero(~records["follows"][starts]), np.flatnonzero(~records["is_followed"][ends])
    # in order of frames, because the rows that are searched then lie beside each other
    begins, stops = (runs[order_by(records["_frame"][at[runs]])] for runs, at in ((begins, starts), (stops, ends)))
    before[begins] = _crossing_ms(held, records, starts[begins], -1, site)
    after[stops] = _crossing_ms(held, records, ends[stops], 1, site)
    return before, after


def _crossing_ms(held: Held, records: Columns, rows: Ints, outwards: int, site: SiteTables) -> Ints:
    """Return how far from its end each run crossed the distance; NULL where the frames around do not show it.

    The steps are those of the query: a cubic through the places around the crossing, replaced by two straight halves.

    Args:
        held: The relations; `instants` and `located` are read.
        records: `close_records`.
        rows: Rows of these that are ends of runs.
        outwards: -1 for starts, 1 for ends of runs: where time runs away from the run.
        site: The tables of the site.
    """
    nearest = int(site.params["next_half_intervals"])
    x, y = ((records[f"{c}_a_mm"][rows] - records[f"{c}_b_mm"][rows]) for c in ("x", "y"))
    is_known = (records["x_a_mm"][rows] != NULL) & (records["x_b_mm"][rows] != NULL)
    step, beside_x, beside_y = _place(held, records, rows, outwards, nearest, site)
    square, far = int(site.params["distance_mm"]) ** 2, beside_x * beside_x + beside_y * beside_y
    is_crossed = is_known & (x * x + y * y < square) & (far >= square)  # false where far is NaN
    crossing_ms = np.full(len(rows), NULL, dtype=np.int64)
    at = np.flatnonzero(is_crossed)
    rows, step, beside_x, beside_y = rows[at], step[at], beside_x[at], beside_y[at]
    beyond, beyond_x, beyond_y = _place(held, records, rows, 2 * outwards, site.params["gap_half_intervals"], site)
    behind, behind_x, behind_y = _place(held, records, rows, -outwards, nearest, site)
    x, y = x[at].astype(np.float64), y[at].astype(np.float64)
    middle_x = _middle(x, beside_x, behind_x, beyond_x, step, behind, beyond)
    middle_y = _middle(y, beside_y, behind_y, beyond_y, step, behind, beyond)
    half = step / 2
    is_second = middle_x * middle_x + middle_y * middle_y < square
    dx, dy = (
        np.where(is_second, beside_x - middle_x, middle_x - x),
        np.where(is_second, beside_y - middle_y, middle_y - y),
    )
    x, y = np.where(is_second, middle_x, x), np.where(is_second, middle_y, y)
    a, b, c = dx * dx + dy * dy, x * dx + y * dy, x * x + y * y - square
    crossing_ms[at] = rounded(np.where(is_second, half, 0) + half * (np.sqrt(b * b - a * c) - b) / a)
    return crossing_ms


def _middle(
    at: Floats, beside: Floats, behind: Floats, beyond: Floats, step: Floats, behind_ms: Floats, beyond_ms: Floats
) -> Floats:
    """Return one coordinate half way of a cubic from `at` to `beside`; its speeds come from the frames around."""
    straight = (beside - at) / step
    leaving, arriving = (beside - behind) / (behind_ms + step), (beyond - at) / beyond_ms
    leaving, arriving = np.where(np.isnan(leaving), straight, leaving), np.where(np.isnan(arriving), straight, arriving)
    middle: Floats = (at + beside) / 2 + step / 8 * leaving - step / 8 * arriving
    return middle


def _place(
    held: Held, records: Columns, rows: Ints, frames_on: int, n_half_intervals: int, site: SiteTables
) -> tuple[Floats, Floats, Floats]:
    """Return how far off a frame is, and the place of a less that of b in it; NaN where too far off or unknown."""
    frames, located = held["instants"], held["located"]
    frame = records["_frame"][rows]
    other = np.clip(frame + frames_on, 0, len(frames["ts_ms"]) - 1)
    away = np.abs(frames["ts_ms"][other] - frames["ts_ms"][frame])
    is_beside = (other == frame + frames_on) & (frames["camera_id"][other] == frames["camera_id"][frame])
    is_beside &= 2 * away <= n_half_intervals * records["interval_ms"][rows]
    keys = located["_key"]
    at = np.flatnonzero(is_beside) if len(keys) else np.zeros(0, dtype=np.int64)
    of_side: list[Ints] = []
    for track in ("track_a", "track_b"):
        wanted = other[at] * (site.n_tracks + 1) + records[track][rows[at]]
        row = np.minimum(np.searchsorted(keys, wanted), max(0, len(keys) - 1))
        is_found = keys[row] == wanted if len(keys) else wanted < 0
        at, row, of_side = at[is_found], row[is_found], [s[is_found] for s in of_side]
        of_side.append(row)
    a, b = of_side
    is_placed = (located["x_mm"][a] != NULL) & (located["x_mm"][b] != NULL)
    at, a, b = at[is_placed], a[is_placed], b[is_placed]
    away_ms, x, y = (np.full(len(rows), np.nan) for _ in range(3))
    away_ms[at] = away[at]
    x[at], y[at] = (located[c][a] - located[c][b] for c in ("x_mm", "y_mm"))
    return away_ms, x, y
