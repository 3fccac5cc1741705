"""`camera_days` from stored parts, one after the other: few columns are read, and only sums are held."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.store.layout import Part
from vsd_analytics.warehouse.accelerated.columns import distinct, rounded, starts_of
from vsd_analytics.warehouse.held import Bools, Ints
from vsd_analytics.warehouse.stored_records import NotedColumns, opened, read_columns

DAY_MS = 86_400_000
_READ: Mapping[TableName, tuple[str, ...]] = {
    "frames": ("camera_id", "ts", "n_persons", "n_pairs"),
    "observations": ("camera_id", "ts", "track_id"),
    "pairs": ("camera_id", "ts", "track_a", "track_b"),
}
_KNOWN = ("n_persons", "n_pairs", "track_id", "track_a", "track_b")
"""Columns of which it matters only whether they are known."""


def camera_days(parts: Mapping[TableName, Sequence[Part]], cameras: pa.Table, params: Mapping[str, Any]) -> pa.Table:
    """Return `facts/camera_days`.

    Args:
        parts: Stored parts of whole UTC days.
        cameras: The relation `cameras`.
        params: The settings and rules that SQL reads.
    """
    intervals = dict(zip(cameras["camera_id"].to_pylist(), cameras["interval_ms"].to_pylist(), strict=True))
    sums: dict[tuple[int, str], Ints] = defaultdict(lambda: np.zeros(5, dtype=np.int64))
    instants: dict[tuple[int, str], list[Ints]] = defaultdict(list)
    for table in TABLES:
        for part in parts[table]:
            with opened(part, table) as file:
                noted = NotedColumns(file.metadata)
                if not noted.n_rows:
                    continue
                of_day = None if None in intervals.values() else noted.day
                needed = [
                    c
                    for c in _READ[table]
                    if not (c in _KNOWN and noted.are_alike(c)) and (c != "ts" or of_day is None)
                ]
                rows = read_columns(file, noted, table, needed).combine_chunks()
            cameras = rows["camera_id"].chunk(0)
            names = cameras.dictionary.to_pylist()
            group = cameras.indices.to_numpy()
            if of_day is None:
                ts = rows["ts"].cast(pa.int64()).to_numpy()
                day = ts // DAY_MS
                first_day = int(day.min())
                group = (day - first_day) * len(names) + group
            else:
                ts, first_day = np.zeros(0, dtype=np.int64), of_day
            starts = starts_of(group)  # records of a camera follow each other
            n_rows = np.bincount(group[starts], np.diff(starts, append=len(group))).astype(np.int64)
            counts = [_counted(group, known, n_rows) for known in _kinds(table, rows, noted)]
            for number in np.flatnonzero(n_rows).tolist():
                key = (first_day + number // len(names), names[number % len(names)])
                sums[key] += [of_kind[number] for of_kind in counts]
                if key[1] in intervals and intervals[key[1]] is None:
                    instants[key].append(ts[group == number])
    keys = sorted(sums, key=lambda key: (key[0], key[1].encode()))
    n_frames, n_persons, n_pairs, n_records, n_tracked = (
        np.array([sums[key] for key in keys], dtype=np.int64).reshape(-1, 5).T
    )
    intervals_ms = [_interval_ms(intervals.get(camera), instants[day, camera], params) for day, camera in keys]
    return pa.table(
        {
            "utc_day": pa.array([day for day, _ in keys], pa.int64()),
            "camera_id": pa.array([camera for _, camera in keys], pa.string()),
            "interval_ms": pa.array(intervals_ms, pa.int64()),
            "has_heartbeat": n_frames > 0,
            "has_persons": n_persons > 0,
            "has_tracks": 2 * n_tracked >= n_records,
            "sends_pairs": n_pairs > 0,
        }
    )


def _counted(group: Ints, is_known: Bools | bool, n_rows: Ints) -> Ints:
    """Return how many known rows each group has, given the number of its rows."""
    if isinstance(is_known, bool):
        return n_rows if is_known else np.zeros_like(n_rows)
    return np.bincount(group[is_known], minlength=len(n_rows))


def _kinds(table: TableName, rows: pa.Table, noted: NotedColumns) -> tuple[Bools | bool, ...]:
    """Return which rows are of frames, of people, of pairs, records, and records with track ids."""

    def known(column: str) -> Bools | bool:
        if column not in rows.column_names:
            return noted.is_known(column)
        is_valid: Bools = pc.is_valid(rows[column]).to_numpy()
        return is_valid

    if table == "frames":
        return True, known("n_persons"), known("n_pairs"), False, False
    if table == "observations":
        return False, True, False, True, known("track_id")
    a, b = known("track_a"), known("track_b")
    return False, False, True, True, a & b


def _interval_ms(of_camera: int | None, instants: Sequence[Ints], params: Mapping[str, Any]) -> int:
    """Return the frame interval: that of vsd.toml, else the median time between frames, else a second."""
    unknown_ms = int(params["unknown_interval_ms"])
    interval_ms = unknown_ms if of_camera is None else of_camera
    if of_camera is None and instants:
        steps = np.sort(np.diff(distinct(np.concatenate(instants))))  # sorted, as np.median takes longer
        middle = steps[(len(steps) - 1) // 2 : len(steps) // 2 + 1]
        interval_ms = int(rounded(middle.mean(keepdims=True))[0]) if len(steps) else unknown_ms
    return min(interval_ms, int(params["longest_interval_ms"]))
