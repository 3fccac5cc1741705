"""`instants` and `located`: processed frames, and person records with their places."""

from __future__ import annotations

import numpy as np

from vsd_analytics.warehouse.accelerated.columns import (
    LazyColumns,
    distinct,
    ends_of,
    order_by,
    picked,
    rounded,
    rows_of,
    starts_of,
    take,
)
from vsd_analytics.warehouse.accelerated.site_tables import SiteTables
from vsd_analytics.warehouse.held import NULL, Bools, Columns, Held, Ints

HOUR_MS = 3_600_000
_AFTER_ALL = 2**62


def instants(held: Held, site: SiteTables) -> Columns:
    """Return `staging/instants`, in order of camera and instant; `_key` finds a row by camera and instant.

    `_person` is the first stored record of each frame of people, in their order, and `_frame` its row, -1 for none.
    """
    names = (f"stored_{t}" for t in ("frames", "observations", "pairs", "beside"))
    tables = [held[name] for name in names if name in held]
    low = min((int(t["ts_ms"].min()) for t in tables if len(t["ts_ms"])), default=0)
    span = max((int(t["ts_ms"].max()) for t in tables if len(t["ts_ms"])), default=low) - low + 1
    firsts = [starts_of(t["camera_id"], t["ts_ms"]) for t in tables]  # records of a frame follow each other
    keys = [
        t["camera_id"][rows] * np.int64(span) + (t["ts_ms"][rows] - low) for t, rows in zip(tables, firsts, strict=True)
    ]
    key = distinct(keys[0])
    frame_of_each = [rows_of(key, k) for k in keys[1:]]
    others = [k[frame < 0] for k, frame in zip(keys[1:], frame_of_each, strict=True)]
    if any(map(len, others)):  # people of frames that were not sent as frames
        key = distinct(np.concatenate([key, *others]))
        frame_of_each = [rows_of(key, k) for k in keys[1:]]
    camera, ts = key // span, key % span + low
    n = len(key)
    to_next = np.full(n, _AFTER_ALL, dtype=np.int64)
    is_last = np.ones(n, dtype=np.bool_)
    is_last[:-1] = camera[1:] != camera[:-1]
    to_next[:-1] = ts[1:] - ts[:-1]
    to_next[is_last] = _AFTER_ALL
    interval, has_heartbeat = site.days.of_frames(camera, ts)
    is_in_time = to_next <= int(site.params["next_half_intervals"]) * interval // 2
    weight = np.where(is_in_time, to_next, interval)
    is_silent = ~has_heartbeat & (to_next <= site.params["coverage_gap_ms"])
    frames = {
        "hour": ts // HOUR_MS,
        "camera_id": camera,
        "ts_ms": ts,
        "weight_ms": weight,
        "covered_ms": np.where(is_in_time | is_silent, to_next, interval),
        "interval_ms": interval,
        "has_heartbeat": has_heartbeat,
        "_key": key,
    }
    is_known = interval != NULL
    number = np.where(is_known, np.cumsum(is_known) - 1, -1)
    of_persons = {"_person": firsts[1], "_frame": picked(number, frame_of_each[0])}
    return {**take(frames, is_known), **of_persons, "_low": np.array([low]), "_span": np.array([span])}


def frame_of(instants: Columns, camera: Ints, ts_ms: Ints) -> Ints:
    """Return the row of `instants` of each camera and instant, -1 for none."""
    low, span = int(instants["_low"][0]), int(instants["_span"][0])
    is_within = (ts_ms >= low) & (ts_ms < low + span)
    return rows_of(instants["_key"], np.where(is_within, camera * np.int64(span) + (ts_ms - low), NULL))


def located(held: Held, site: SiteTables) -> Columns | None:
    """Return `staging/located`, in order of camera, instant and member.

    `_frame` is the row of `instants`, `_key` one number in order of frame and track, those without one last.
    None where a record has one floor coordinate without the other: only the query says what that means.
    """
    stored, frames = held["stored_observations"], held["instants"]
    if not is_placed_everywhere(stored) and np.any((stored["x_mm"] == NULL) != (stored["y_mm"] == NULL)):
        return None
    camera, ts = stored["camera_id"], stored["ts_ms"]
    x, y = _places(held, stored, site)
    if site.only_counts:
        return _by_frame({"camera_id": camera, "ts_ms": ts, "x_mm": x, "y_mm": y}, frames, site)
    frame = np.repeat(frames["_frame"], np.diff(frames["_person"], append=len(ts)))
    track = stored["track_id"]
    key = frame * (site.n_tracks + 1)
    key += np.where(track < 0, site.n_tracks, track)  # nulls last
    rows = order_by(key)
    ordered = picked(key, rows)
    if np.any(ordered[1:] == ordered[:-1]):  # people without ids are numbered by place
        places = (np.where(v == NULL, _AFTER_ALL, v) for v in (x, y))
        pixels = (np.where(np.isnan(v), np.inf, v) for v in (stored["u_px"], stored["v_px"]))
        rows = np.lexsort((key, *places, *pixels, stored["person"])[::-1])
    n_unknown = int(np.searchsorted(ordered, 0))  # records of cameras that vsd.toml does not name
    rows, ordered = rows[n_unknown:], ordered[n_unknown:]
    if (counts := is_counted(held, site, camera, ts, track)) is not None:
        is_there = picked(counts, rows)
        rows, ordered = rows[is_there], ordered[is_there]
    frame, camera, ts, x, y = (picked(values, rows) for values in (frame, camera, ts, x, y))
    starts = starts_of(frame)
    first = np.repeat(starts, np.diff(starts, append=len(frame)))
    return {
        "camera_id": camera,
        "ts_ms": ts,
        "member": np.arange(1, len(frame) + 1) - first,
        "track_id": picked(track, rows),
        "x_mm": x,
        "y_mm": y,
        "weight_ms": picked(frames["weight_ms"], frame),
        "is_owned": site.floors.is_owned(camera, ts, x, y),
        "_frame": frame,
        "_key": ordered,
    }


def is_placed_everywhere(stored: Columns) -> bool:
    """Return whether every stored record is known to have a place: only then are places 32-bit numbers."""
    return bool(stored["x_mm"].dtype == np.int32 == stored["y_mm"].dtype)


def _places(held: Held, stored: Columns, site: SiteTables) -> tuple[Ints, Ints]:
    """Return the floor places of stored records: as they were sent, else of foot points."""
    x, y = stored["x_mm"], stored["y_mm"]
    if is_placed_everywhere(stored):
        return x, y
    projected = np.flatnonzero((x == NULL) & ~np.isnan(stored["u_px"]))
    if len(projected):
        x, y = x.copy(), y.copy()
        x[projected], y[projected] = _projected(held["calibrations"], take(stored, projected), site)
    return x, y


def _by_frame(records: Columns, frames: Columns, site: SiteTables) -> Columns:
    """Return records in order of their frames, without members; weights and owners are computed when they are read."""
    frame = frames["_frame"].astype(np.int32)
    frame_of_each = np.repeat(frame, np.diff(frames["_person"], append=len(records["ts_ms"])))
    if np.any(frame[1:] <= frame[:-1]) or np.any(frame[:1] < 0):  # of several parts, or of unknown cameras
        rows = order_by(frame_of_each)
        rows = rows[np.searchsorted(frame_of_each[rows], 0) :]
        records, frame_of_each = take(records, rows), frame_of_each[rows]
    return LazyColumns(
        {**records, "_frame": frame_of_each},
        {
            "weight_ms": lambda: picked(frames["weight_ms"], frame_of_each),
            "is_owned": lambda: site.floors.is_owned(*(records[c] for c in ("camera_id", "ts_ms", "x_mm", "y_mm"))),
        },
    )


def is_counted(held: Held, site: SiteTables, camera: Ints, ts: Ints, track: Ints) -> Bools | None:
    """Return whether each record is of the people who are counted: visitors, or staff; None = everybody is."""
    if site.params["people"] == "all":
        return None
    staff = held["staff"]
    staff = take(staff, staff["track_id"] >= 0)
    is_staff = np.isin(_track_hours(site, ts // HOUR_MS, camera, track), _track_hours(site, **staff)) & (track >= 0)
    return is_staff if site.params["people"] == "staff" else ~is_staff


def _track_hours(site: SiteTables, hour: Ints, camera_id: Ints, track_id: Ints) -> Ints:
    """Return one number for each hour, camera and track; cameras and tracks begin at -1."""
    return (hour * (site.n_cameras + 1) + camera_id + 1) * (site.n_tracks + 1) + track_id + 1


def frames_in_order(frames: Columns, camera: Ints, ts: Ints) -> Ints:
    """Return the row of `instants` of each record; stored records of a frame follow each other, so few are searched."""
    starts = starts_of(camera, ts)
    rows = frame_of(frames, camera[starts], ts[starts])
    return np.repeat(rows, np.diff(starts, append=len(ts)))


def _projected(calibrations: Columns, stored: Columns, site: SiteTables) -> tuple[Ints, Ints]:
    """Return the floor places of foot points; NULL without a calibration, beyond the horizon and far away."""
    n = len(stored["ts_ms"])
    x, y = np.full(n, NULL, dtype=np.int64), np.full(n, NULL, dtype=np.int64)
    u, v = stored["u_px"], stored["v_px"]
    most = site.params["coordinate_max_mm"]
    for i in range(len(calibrations["camera_id"])):
        c = {name: values[i] for name, values in calibrations.items()}
        is_its = (
            (stored["camera_id"] == c["camera_id"]) & (stored["ts_ms"] >= c["from_ms"]) & (stored["ts_ms"] < c["to_ms"])
        )
        rows = np.flatnonzero(is_its)
        if not len(rows):
            continue
        w = c["w_sign"] * (c["h31"] * u[rows] + c["h32"] * v[rows] + c["h33"])
        wx = c["w_sign"] * 1000 * (c["h11"] * u[rows] + c["h12"] * v[rows] + c["h13"])
        wy = c["w_sign"] * 1000 * (c["h21"] * u[rows] + c["h22"] * v[rows] + c["h23"])
        is_placed = (w > 0) & (np.abs(wx) < most * w) & (np.abs(wy) < most * w)
        rows = rows[is_placed]
        x[rows], y[rows] = rounded(wx[is_placed] / w[is_placed]), rounded(wy[is_placed] / w[is_placed])
    return x, y


def calibrations_used(held: Held, site: SiteTables) -> Columns:
    """Return `facts/calibrations_used`."""
    del site
    stored, calibrations = held["stored_observations"], held["calibrations"]
    rows = np.flatnonzero((stored["x_mm"] == NULL) & ~np.isnan(stored["u_px"]))
    camera, ts = stored["camera_id"][rows], stored["ts_ms"][rows]
    number = np.full(len(rows), -1, dtype=np.int64)
    for i, (of_camera, first, after) in enumerate(
        zip(*(calibrations[c] for c in ("camera_id", "from_ms", "to_ms")), strict=True)
    ):
        number[(camera == of_camera) & (ts >= first) & (ts < after)] = i
    # in order of the names of calibrations, which are texts
    by_name = np.argsort(calibrations["calibration_id"].astype(str), kind="stable")
    place = np.argsort(by_name)
    known = np.flatnonzero(number >= 0)
    camera, ts, number = camera[known], ts[known], number[known]
    order = order_by(ts // HOUR_MS, camera, place[number], ts)
    camera, ts, number = camera[order], ts[order], number[order]
    starts = starts_of(ts // HOUR_MS, camera, number)
    ends = ends_of(starts, len(ts)) - 1
    return {
        "hour": ts[starts] // HOUR_MS,
        "camera_id": camera[starts],
        "calibration_id": calibrations["calibration_id"][number[starts]],
        "first_ms": ts[starts],
        "last_ms": ts[ends],
        "n_records": ends - starts + 1,
    }
