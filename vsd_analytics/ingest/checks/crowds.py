"""Frames with more persons or pairs than a camera can see: mostly due to wrong times, and too much for the database.

When a source sends its records one by one, a frame is all records of one camera and instant. Records that would be one
in the store count once, so that times cut to seconds, or a repeated delivery, do not make a crowd.
"""

from __future__ import annotations

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.ingest.reading.raw import Check
from vsd_analytics.ingest.reading.reasons import TOO_MANY
from vsd_analytics.schema import TableName

_FRAME = ("camera_id", "ts_ms")
# what distinguishes the records of a frame: ids, and without them places; the same rule as `schema.KEYS`
_TRACKS = {"observations": ("track",), "pairs": ("track_a", "track_b")}
_PLACES = {
    "observations": ("x_m", "y_m", "u_px", "v_px"),
    "pairs": ("x_a_m", "y_a_m", "x_b_m", "y_b_m", "person_a", "person_b", "distance_m"),
}


class Crowds:
    """Finds crowded frames among the raw rows of one ingest, batch by batch.

    Two batches may share a frame, so the rows of each camera's newest frame are counted with the next batch too. Once a
    frame is crowded, all its later rows are rejected as well.

    Args:
        persons_max: Most persons of a frame.
        pairs_max: Most pairs.
    """

    def __init__(self, *, persons_max: int, pairs_max: int) -> None:
        self._most = {"observations": persons_max, "pairs": pairs_max}
        self._found: set[tuple[str, int]] = set()
        self._newest: dict[str, pa.Table] = {}

    def check(self, name: TableName) -> Check:
        """Return the check of one table, for rows that passed all other checks."""
        persons, pairs = self._most["observations"], self._most["pairs"]
        detail = f"its frame has more than {persons:,} persons or {pairs:,} pairs"
        return TOO_MANY, detail, self._of_frames if name == "frames" else lambda rows: self._of_records(name, rows)

    def _of_frames(self, rows: pa.Table) -> pa.Array:
        is_crowded = pc.or_kleene(
            pc.greater(rows["n_persons"], self._most["observations"]), pc.greater(rows["n_pairs"], self._most["pairs"])
        )
        self._note(rows.filter(is_crowded))
        return self._is_found(rows)

    def _of_records(self, name: TableName, rows: pa.Table) -> pa.Array:
        records = rows.select([*_FRAME, *_TRACKS[name], *_PLACES[name]])
        if name in self._newest:
            records = pa.concat_tables([self._newest[name], records]).unify_dictionaries()
        if _may_be_crowded(records, self._most[name]):  # rare; only then the slower count of different records
            self._note(_crowded(_different(name, records), self._most[name]))
        self._newest[name] = _newest(records)
        return self._is_found(rows)

    def _note(self, frames: pa.Table) -> None:
        self._found.update(zip(*(frames[c].to_pylist() for c in _FRAME), strict=True))

    def _is_found(self, rows: pa.Table) -> pa.Array:
        if not self._found:
            return pa.repeat(pa.scalar(False), rows.num_rows)
        frames = zip(*(rows[c].to_pylist() for c in _FRAME), strict=True)
        return pa.array([frame in self._found for frame in frames], pa.bool_())


def _may_be_crowded(records: pa.Table, most: int) -> bool:
    """Return whether a frame may have more than so many records: first by the instants of all cameras together."""
    if records.num_rows <= most or pc.max(pc.value_counts(records["ts_ms"]).field("counts")).as_py() <= most:
        return False
    return bool(_crowded(records, most).num_rows)


def _crowded(records: pa.Table, most: int) -> pa.Table:
    """Return the frames with more than so many records."""
    frames = pa.table({"camera_id": records["camera_id"].cast(pa.string()), "ts_ms": records["ts_ms"]})
    counts = frames.group_by(list(_FRAME)).aggregate([([], "count_all")])
    return counts.filter(pc.greater(counts["count_all"], most))


def _different(name: TableName, records: pa.Table) -> pa.Table:
    """Return one row for each record that would be one in the store."""
    is_known = pc.is_valid(records[_TRACKS[name][0]])
    for track in _TRACKS[name][1:]:
        is_known = pc.and_(is_known, pc.is_valid(records[track]))
    keys = {c: records[c] for c in (*_FRAME, *_TRACKS[name])}
    keys["camera_id"] = keys["camera_id"].cast(pa.string())
    for c in _PLACES[name]:
        keys[c] = pc.if_else(is_known, pa.scalar(None, records.schema.field(c).type), records[c])
    return pa.table(keys).group_by(list(keys)).aggregate([])


def _newest(records: pa.Table) -> pa.Table:
    """Return the records of each camera's newest frame."""
    cameras, ts_ms = records["camera_id"].combine_chunks().dictionary_encode(), records["ts_ms"].to_numpy()
    newest_ms = np.full(len(cameras.dictionary), ts_ms.min(initial=0))
    np.maximum.at(newest_ms, cameras.indices, ts_ms)
    return records.filter(pa.array(ts_ms == newest_ms[cameras.indices]))
