"""`camera_days` from stored parts, one after the other: few columns of each, and no more than a sum for each camera and day."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.store.layout import Part
from vsd_analytics.warehouse.arrays.columns import Ints, distinct, rounded
from vsd_analytics.warehouse.arrays.stored import read_columns

DAY_MS = 86_400_000
_READ: Mapping[TableName, tuple[str, ...]] = {
    "frames": ("camera_id", "ts", "n_persons", "n_pairs"),
    "observations": ("camera_id", "ts", "track_id"),
    "pairs": ("camera_id", "ts", "track_a", "track_b"),
}
_LONGEST_MS, _UNKNOWN_MS = 1_200_000, 1000


def camera_days(parts: Mapping[TableName, Sequence[Part]], cameras: pa.Table) -> pa.Table:
    """Return `facts/camera_days`.

    Args:
        parts: Stored parts of whole UTC days.
        cameras: The relation `cameras`.
    """
    intervals = dict(zip(cameras["camera_id"].to_pylist(), cameras["interval_ms"].to_pylist(), strict=True))
    sums: dict[tuple[int, str], Ints] = defaultdict(lambda: np.zeros(5, dtype=np.int64))
    instants: dict[tuple[int, str], list[Ints]] = defaultdict(list)
    for table in TABLES:
        for part in parts[table]:
            rows = read_columns(part, table, _READ[table])
            for camera, own in _by_camera(rows):
                if camera not in intervals:
                    continue
                ts = own["ts"].cast(pa.int64()).to_numpy()
                told = _told(table, own)
                day = ts // DAY_MS
                for number in range(int(day.min()), int(day.max()) + 1):
                    is_its = day == number
                    if is_its.any():
                        sums[number, camera] += told[:, is_its].sum(axis=1)
                        if intervals[camera] is None:
                            instants[number, camera].append(ts[is_its])
    keys = sorted(sums, key=lambda key: (key[0], key[1].encode()))
    n_frames, n_persons, n_pairs, n_records, n_tracked = np.array([sums[key] for key in keys], dtype=np.int64).reshape(-1, 5).T
    intervals_ms = [_interval_ms(intervals[camera], instants[day, camera]) for day, camera in keys]
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


def _by_camera(rows: pa.Table) -> list[tuple[str, pa.Table]]:
    """Return the rows of each camera; stored rows are in order of cameras, but that is no promise."""
    cameras = rows["camera_id"].combine_chunks()
    codes = cameras.indices.to_numpy()
    return [(name, rows.filter(pa.array(codes == code))) for code, name in enumerate(cameras.dictionary.to_pylist()) if (codes == code).any()]


def _told(table: TableName, rows: pa.Table) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    """Return for each row whether it is of a frame, of people, of pairs, a record, and a record with track ids."""
    every, none = np.ones(rows.num_rows, dtype=np.bool_), np.zeros(rows.num_rows, dtype=np.bool_)

    def known(column: str) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        found: np.ndarray[tuple[int], np.dtype[np.bool_]] = pc.is_valid(rows[column]).to_numpy()
        return found

    if table == "frames":
        return np.stack([every, known("n_persons"), known("n_pairs"), none, none])
    if table == "observations":
        return np.stack([none, every, none, every, known("track_id")])
    return np.stack([none, none, every, every, known("track_a") & known("track_b")])


def _interval_ms(of_camera: int | None, instants: Sequence[Ints]) -> int:
    """Return the frame interval: that of vsd.toml, else the median time between frames, else a second."""
    found = _UNKNOWN_MS if of_camera is None else of_camera
    if of_camera is None:
        steps = np.diff(distinct(np.concatenate(instants)))
        found = int(rounded(np.median(steps, keepdims=True))[0]) if len(steps) else _UNKNOWN_MS
    return min(found, _LONGEST_MS)
