"""Facts of recorded time: `coverage` and `recorded_spans`, and `sequence_runs` of engines whose numbers rise."""

from __future__ import annotations

import numpy as np

from vsd_analytics.warehouse.accelerated.columns import ends_of, greatest, grouped_by, order_by, starts_of, sums, take
from vsd_analytics.warehouse.accelerated.site_tables import SiteTables
from vsd_analytics.warehouse.held import NULL, Columns, Held

_QUARTER_MS, _HOUR_MS = 900_000, 3_600_000


def coverage(held: Held, site: SiteTables) -> Columns:
    """Return `facts/coverage`."""
    del site
    frames, quarters = held["instants"], held["quarters"]["quarter"]
    ts, covered = frames["ts_ms"], frames["covered_ms"]
    end = ts + covered
    first, last = ts // _QUARTER_MS, (end - 1) // _QUARTER_MS
    n = np.maximum(1, last - first + 1)
    frame = np.repeat(np.arange(len(ts)), n)
    quarter = first[frame] + (np.arange(len(frame)) - np.repeat(np.cumsum(n) - n, n))
    # a frame within one quarter counts wherever it lies; of longer ones only the quarters of the batch
    is_wanted = (n[frame] == 1) | ((quarter >= quarters.min()) & (quarter <= quarters.max()))
    frame, quarter = frame[is_wanted], quarter[is_wanted]
    recorded = np.minimum(end[frame], (quarter + 1) * _QUARTER_MS) - np.maximum(ts[frame], quarter * _QUARTER_MS)
    order, starts = grouped_by(quarter // 4, frames["camera_id"][frame], quarter)
    frame, quarter, recorded = frame[order], quarter[order], recorded[order]
    at = frame[starts]
    found = {
        "hour": quarter[starts] // 4,
        "camera_id": frames["camera_id"][at],
        "quarter": quarter[starts],
        "n_frames": sums(quarter == first[frame], starts),
        "recorded_ms": sums(recorded, starts),
        "is_inferred": greatest(~frames["has_heartbeat"][frame], starts),
    }
    # only hours with frames of their own
    hours = frames["camera_id"] * np.int64(2**40) + frames["hour"]
    own = np.isin(found["camera_id"] * np.int64(2**40) + found["hour"], hours[starts_of(hours)])
    return take(found, own)


def recorded_spans(held: Held, site: SiteTables) -> Columns:
    """Return `facts/recorded_spans`."""
    del site
    frames = held["instants"]
    order = order_by(frames["hour"], np.arange(len(frames["hour"])))
    hour, camera, ts, covered, has_heartbeat = (
        frames[c][order] for c in ("hour", "camera_id", "ts_ms", "covered_ms", "has_heartbeat")
    )
    n, end = len(ts), ts + covered
    is_first = np.zeros(n, dtype=np.bool_)
    is_first[starts_of(hour, camera)] = True
    is_start = is_first.copy()
    is_start[1:] |= end[:-1] < ts[1:]
    starts = np.flatnonzero(is_start)
    last = ends_of(starts, n) - 1  # a span ends with its last frame
    hour_end = greatest(end, np.flatnonzero(is_first))[np.cumsum(is_first) - 1] if n else end
    is_last = np.append(is_first[starts[1:]], True)[: len(starts)]
    return {
        "hour": hour[starts],
        "camera_id": camera[starts],
        "started_ms": ts[starts],
        "ended_ms": np.where(is_last, hour_end[last], end[last]),
        "is_inferred": ~has_heartbeat[starts],
    }


def sequence_runs(held: Held, site: SiteTables) -> Columns | None:
    """Return `facts/sequence_runs`; None where the numbers of a camera fall."""
    del site
    frames = held["stored_frames"]
    frames = take(frames, np.flatnonzero(frames["seq"] != NULL))
    frames = take(frames, order_by(frames["camera_id"], frames["ts_ms"] - frames["ts_ms"].min(initial=2**62)))
    camera, ts, seq = frames["camera_id"], frames["ts_ms"], frames["seq"]
    hour, n = ts // _HOUR_MS, len(ts)
    is_same = camera[1:] == camera[:-1]
    if np.any(is_same & (seq[1:] <= seq[:-1])):
        return None
    is_edge = np.ones(n, dtype=np.bool_)
    is_edge[1:] = ~is_same | (hour[1:] > hour[:-1]) | (seq[1:] > seq[:-1] + 1)
    starts = np.flatnonzero(is_edge)
    last = ends_of(starts, n) - 1
    found = {
        "hour": hour[starts],
        "camera_id": camera[starts],
        "restarts": np.zeros(len(starts), dtype=np.int64),
        "first_seq": seq[starts],
        "last_seq": seq[last],
        "first_ms": ts[starts],
        "last_ms": ts[last],
        "n_messages": seq[last] - seq[starts] + 1,
    }
    return take(found, order_by(found["hour"], np.arange(len(starts))))
