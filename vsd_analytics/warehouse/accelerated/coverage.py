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
    camera, ts, covered = (frames[c] for c in ("camera_id", "ts_ms", "covered_ms"))
    first, last = ts // _QUARTER_MS, (ts + covered - 1) // _QUARTER_MS
    # A frame within one quarter counts wherever it lies. Most are, and those of a camera and quarter follow each other.
    within, longer = np.flatnonzero(last <= first), np.flatnonzero(last > first)
    starts = starts_of(camera[within], first[within])
    # of longer ones only the quarters of the batch count
    n = last[longer] - first[longer] + 1
    frame = np.repeat(longer, n)
    quarter = first[frame] + (np.arange(len(frame)) - np.repeat(np.cumsum(n) - n, n))
    is_wanted = (quarter >= quarters.min()) & (quarter <= quarters.max())
    frame, quarter = frame[is_wanted], quarter[is_wanted]
    end_ms = np.minimum((ts + covered)[frame], (quarter + 1) * _QUARTER_MS)
    columns = {
        "camera_id": (camera[within][starts], camera[frame]),
        "quarter": (first[within][starts], quarter),
        "n_frames": (np.diff(starts, append=len(within)), quarter == first[frame]),
        "recorded_ms": (sums(covered[within], starts), end_ms - np.maximum(ts[frame], quarter * _QUARTER_MS)),
        "is_inferred": (greatest(~frames["has_heartbeat"][within], starts), ~frames["has_heartbeat"][frame]),
    }
    pieces = {name: np.concatenate(both) for name, both in columns.items()}
    order, starts = grouped_by(pieces["quarter"] // 4, pieces["camera_id"], pieces["quarter"])
    pieces = take(pieces, order)
    facts = {
        "hour": pieces["quarter"][starts] // 4,
        "camera_id": pieces["camera_id"][starts],
        "quarter": pieces["quarter"][starts],
        "n_frames": sums(pieces["n_frames"], starts),
        "recorded_ms": sums(pieces["recorded_ms"], starts),
        "is_inferred": greatest(pieces["is_inferred"], starts),
    }
    # only hours with frames of their own
    hours = frames["camera_id"] * np.int64(2**40) + frames["hour"]
    own = np.isin(facts["camera_id"] * np.int64(2**40) + facts["hour"], hours[starts_of(hours)])
    return take(facts, own)


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
    runs = {
        "hour": hour[starts],
        "camera_id": camera[starts],
        "restarts": np.zeros(len(starts), dtype=np.int64),
        "first_seq": seq[starts],
        "last_seq": seq[last],
        "first_ms": ts[starts],
        "last_ms": ts[last],
        "n_messages": seq[last] - seq[starts] + 1,
    }
    return take(runs, order_by(runs["hour"], np.arange(len(starts))))
