"""The three stored tables: the one place that names their columns, types, units and keys.

`ts` is UTC in milliseconds; floor positions and distances are integers in millimetres, so that binning and thresholds
are exact on every engine; pixels are float32 rounded to a quarter. Ids are dictionary-encoded strings when stored.
"""

from __future__ import annotations

from typing import Final, Literal

import pyarrow as pa

TableName = Literal["frames", "observations", "pairs"]
TABLES: Final[tuple[TableName, ...]] = ("frames", "observations", "pairs")

QUALITIES: Final = ("metric", "body", "relative")

TS: Final = pa.timestamp("ms", tz="UTC")


def _columns(*columns: tuple[str, pa.DataType, bool]) -> pa.Schema:
    return pa.schema([pa.field(name, kind, nullable=nullable) for name, kind, nullable in columns])


SCHEMAS: Final[dict[TableName, pa.Schema]] = {
    # one row per camera and processed frame, also when nobody is in view (the heartbeat);
    # n_persons and n_pairs are the engine's own counts: null n_pairs = this engine sends no pairs, they are derived;
    # seq is the engine's running number, by which lost messages are found
    "frames": _columns(
        ("camera_id", pa.string(), False),
        ("ts", TS, False),
        ("n_persons", pa.int32(), True),
        ("n_pairs", pa.int32(), True),
        ("seq", pa.int64(), True),
    ),
    # one row per person and frame; person is the index within the message the engine sent (tables send one by one: 0);
    # is_staff = the engine's class or tag is one of staff_classes; null = it gave none, or nobody asked
    "observations": _columns(
        ("camera_id", pa.string(), False),
        ("ts", TS, False),
        ("person", pa.int32(), False),
        ("track_id", pa.string(), True),
        ("x_mm", pa.int32(), True),
        ("y_mm", pa.int32(), True),
        ("u_px", pa.float32(), True),
        ("v_px", pa.float32(), True),
        ("quality", pa.string(), False),
        ("is_staff", pa.bool_(), True),
    ),
    # one row per unordered pair and frame that an engine sent; a before b
    "pairs": _columns(
        ("camera_id", pa.string(), False),
        ("ts", TS, False),
        ("person_a", pa.int32(), False),
        ("person_b", pa.int32(), False),
        ("track_a", pa.string(), True),
        ("track_b", pa.string(), True),
        ("x_a_mm", pa.int32(), True),
        ("y_a_mm", pa.int32(), True),
        ("x_b_mm", pa.int32(), True),
        ("y_b_mm", pa.int32(), True),
        ("distance_mm", pa.int32(), True),
        ("distance_sd_mm", pa.int32(), True),
        ("quality", pa.string(), False),
    ),
}

LATER: Final = frozenset({"is_staff"})
"""Columns that older files lack. A file without a value in them lacks them too: it has the bytes that it always had,
and older versions read it."""

# A record is counted once however often it is delivered: these expressions identify it. Records with a track id are
# identified by camera, instant and track; records without one by camera, instant and place, so that the same person
# delivered again in another file, or in another order, is recognised.
TRACKS: Final[dict[TableName, tuple[str, ...]]] = {
    "frames": (),
    "observations": ("track_id",),
    "pairs": ("track_a", "track_b"),
}
PLACES: Final[dict[TableName, tuple[str, ...]]] = {
    "frames": (),
    "observations": ("x_mm", "y_mm", "u_px", "v_px"),
    "pairs": ("x_a_mm", "y_a_mm", "x_b_mm", "y_b_mm", "person_a", "person_b", "distance_mm"),
}
"""What a record without a track id is identified by, besides camera and instant."""
KEYS: Final[dict[TableName, tuple[str, ...]]] = {
    table: (
        *("camera_id", "ts", *TRACKS[table]),
        *(f"case when {' or '.join(f'{t} is null' for t in TRACKS[table])} then {p} end" for p in PLACES[table]),
    )
    for table in TABLES
}

# The output of adapters, before validation, unit conversion and pseudonyms: engine's own names and metres.
# zone is the one a time without an offset was read in; null = the time had an offset of its own.
RAW_SCHEMAS: Final[dict[TableName, pa.Schema]] = {
    "frames": _columns(
        ("camera", pa.string(), True),
        ("ts_ms", pa.int64(), True),
        ("zone", pa.string(), True),
        ("n_persons", pa.int32(), True),
        ("n_pairs", pa.int32(), True),
        ("seq", pa.int64(), True),
        ("line", pa.int64(), False),
    ),
    "observations": _columns(
        ("camera", pa.string(), True),
        ("ts_ms", pa.int64(), True),
        ("zone", pa.string(), True),
        ("person", pa.int32(), False),
        ("track", pa.string(), True),
        ("x_m", pa.float64(), True),
        ("y_m", pa.float64(), True),
        ("u_px", pa.float64(), True),
        ("v_px", pa.float64(), True),
        ("quality", pa.string(), False),
        ("is_staff", pa.bool_(), True),
        ("line", pa.int64(), False),
    ),
    "pairs": _columns(
        ("camera", pa.string(), True),
        ("ts_ms", pa.int64(), True),
        ("zone", pa.string(), True),
        ("person_a", pa.int32(), False),
        ("person_b", pa.int32(), False),
        ("track_a", pa.string(), True),
        ("track_b", pa.string(), True),
        ("x_a_m", pa.float64(), True),
        ("y_a_m", pa.float64(), True),
        ("x_b_m", pa.float64(), True),
        ("y_b_m", pa.float64(), True),
        ("distance_m", pa.float64(), True),
        ("distance_sd_m", pa.float64(), True),
        ("quality", pa.string(), False),
        ("line", pa.int64(), False),
    ),
}
