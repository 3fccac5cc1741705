"""Parquet tables: the types engines write, missing against wrong numbers, damage."""

from __future__ import annotations

import math
from datetime import date, datetime
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from raw_reading import NINE_MS, Reading, read

from vsd_analytics.ingest.formats.tables import Tables
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source


def read_columns(path: Path, columns: dict[str, Any], options: IngestOptions | None = None, **writing: Any) -> Reading:
    pq.write_table(pa.table(columns), path, **writing)
    assert Tables().detects(Source(path))
    return read(Tables(), path, options or IngestOptions(camera="cam-1"))


@pytest.mark.parametrize(
    "times",
    [
        pa.array([NINE_MS, NINE_MS + 1], pa.timestamp("ms", tz="UTC")),
        pa.array([NINE_MS * 1000, NINE_MS * 1000 + 1999], pa.timestamp("us", tz="Europe/Rome")),
        pa.array([NINE_MS * 10**6, NINE_MS * 10**6 + 1999999], pa.timestamp("ns", tz="UTC")),
        pa.array([NINE_MS, NINE_MS + 1]),
        pa.array([NINE_MS / 1000, NINE_MS / 1000 + 0.001]),
        pa.array([NINE_MS * 1000, NINE_MS * 1000 + 1999]),
        pa.array([NINE_MS * 10**6, NINE_MS * 10**6 + 1990000]),
        pa.array(["2026-11-09T09:00:00Z", "2026-11-09T10:00:00.001+01:00"]),
        pa.array(["2026-11-09T09:00:00Z", "2026-11-09T10:00:00.001+01:00"]).dictionary_encode(),
        pa.array([b"2026-11-09T09:00:00Z", b"2026-11-09T10:00:00.001+01:00"]),
        pa.array(["2026-11-09T09:00:00Z", "1794214800.001"], pa.large_string()),
    ],
    ids=lambda a: str(a.type),
)
def test_instants_of_any_type(tmp_path: Path, times: pa.Array) -> None:
    found = read_columns(tmp_path / "a.parquet", {"ts": times, "x_m": [1, 2], "y_m": [3.0, 4.0]})
    assert [r["ts_ms"] - NINE_MS for r in found.people] == [0, 1]
    assert [r["line"] for r in found.people] == [1, 2]


def test_naive_timestamps_and_dates_are_on_the_cameras_clock(tmp_path: Path) -> None:
    options = IngestOptions(camera="cam-1", frame_zone="Europe/Rome")
    naive = pa.array([datetime(2026, 11, 9, 10), None], pa.timestamp("us"))
    found = read_columns(tmp_path / "a.parquet", {"ts": naive, "x_m": [1, 2], "y_m": [3, 4]}, options)
    assert [r["ts_ms"] - NINE_MS for r in found.people] == [0]
    assert found.reasons == {2: "not-a-time"}
    day = read_columns(tmp_path / "a.parquet", {"ts": [date(2026, 11, 9)], "x_m": [1], "y_m": [3]}, options)
    assert [r["ts_ms"] - NINE_MS for r in day.people] == [-10 * 3_600_000]


@pytest.mark.parametrize("kind", [pa.float32(), pa.float64(), pa.int16(), pa.decimal128(9, 3), pa.string()], ids=str)
def test_numbers_of_any_type_and_null_is_missing(tmp_path: Path, kind: pa.DataType) -> None:
    one: Any = {"string": "2", "decimal128(9, 3)": Decimal("2")}.get(str(kind), 2)
    columns = {"ts": [NINE_MS] * 2, "x_m": pa.array([one, None], kind), "y_m": pa.array([one, one], kind)}
    found = read_columns(tmp_path / "a.parquet", columns)
    assert [(r["x_m"], r["y_m"]) for r in found.people] == [(2.0, 2.0), (None, 2.0)]
    assert not found.rejected


def test_nan_and_infinity_are_wrong_not_missing(tmp_path: Path) -> None:
    columns = {"ts": [NINE_MS] * 3, "x_m": [math.nan, -math.inf, 1.0], "y_m": [1.0] * 3}
    found = read_columns(tmp_path / "a.parquet", columns)
    assert found.reasons == {1: "not-a-number", 2: "not-a-number"}
    assert len(found.people) == 1


@pytest.mark.parametrize(
    "ids",
    [
        pa.array([7, 1234567890123]),
        pa.array([7.0, 1234567890123.0]),
        pa.array(["7", "1234567890123"]),
        pa.array(["7.0", "1234567890123"]).dictionary_encode(),
        pa.array([b"7", b"1234567890123"]),
        pa.array([Decimal("7"), Decimal("1234567890123")]),
    ],
    ids=lambda a: str(a.type),
)
def test_an_id_is_the_same_whatever_its_type(tmp_path: Path, ids: pa.Array) -> None:
    columns = {"ts": [NINE_MS] * 2, "x_m": [1, 2], "y_m": [3, 4], "track_id": ids, "camera_id": ids}
    found = read_columns(tmp_path / "a.parquet", columns)
    assert found.column("track") == found.column("camera") == ["7", "1234567890123"]


def test_missing_ids_are_missing_and_a_missing_camera_is_the_one_named(tmp_path: Path) -> None:
    ids = pa.array([None, math.nan, 3.0])
    columns = {"ts": [NINE_MS] * 3, "x_m": [1, 2, 3], "y_m": [3, 4, 5], "track_id": ids, "camera_id": ids}
    found = read_columns(tmp_path / "a.parquet", columns)
    assert found.column("track") == [None, None, "3"]
    assert found.column("camera") == ["cam-1", "cam-1", "3"]


def test_times_without_offset_are_on_each_rows_clock(tmp_path: Path) -> None:
    options = IngestOptions(frame_zone="UTC", clocks={"a": "Asia/Tokyo", "b": "UTC"})
    columns = {"ts": ["2026-11-09T09:00:00"] * 4, "camera_id": ["a", "b", "c", "a"], "x_m": [1] * 4, "y_m": [1] * 4}
    found = read_columns(tmp_path / "a.parquet", columns, options)
    assert [(r["ts_ms"] - NINE_MS) / 3_600_000 for r in found.people] == [-9, 0, 0, -9]


def test_only_the_columns_that_are_needed_matter(tmp_path: Path) -> None:
    columns = {
        "ts": [NINE_MS],
        "frame": ["not a number, and not needed"],
        "x_m": [1],
        "y_m": [2],
        "nested": [{"a": [1]}],
        "left": ["?"],
    }
    found = read_columns(tmp_path / "a.parquet", columns)
    assert len(found.people) == 1


@pytest.mark.parametrize("column", ["ts", "x_m", "track_id"])
def test_a_column_of_an_impossible_type_is_refused(tmp_path: Path, column: str) -> None:
    columns: dict[str, Any] = {"ts": [NINE_MS], "track_id": ["a"], "x_m": [1], "y_m": [2], column: [[1, 2]]}
    found = read_columns(tmp_path / "a.parquet", columns)
    assert found.error is not None
    assert found.error.code == "E203"


def test_a_file_cut_in_half_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    pq.write_table(pa.table({"ts": np.arange(9999), "x_m": np.arange(9999), "y_m": np.arange(9999)}), path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    assert Tables().detects(Source(path))
    found = read(Tables(), path, IngestOptions(camera="c"))
    assert found.error is not None
    assert found.error.code == "E205"
    assert "Parquet" in found.error.what


def test_records_before_damage_inside_are_stored(tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    n = 300_000
    columns = {"ts": np.full(n, NINE_MS), "x_m": np.random.default_rng(1).random(n), "y_m": np.zeros(n)}
    pq.write_table(pa.table(columns), path, row_group_size=100_000, use_dictionary=False, compression="zstd")
    data = bytearray(path.read_bytes())
    offset = pq.read_metadata(path).row_group(2).column(1).data_page_offset
    data[offset : offset + 2000] = b"\xff" * 2000
    path.write_bytes(data)
    found = read(Tables(), path, IngestOptions(camera="c"))
    assert found.error is not None
    assert found.error.code == "E205"
    assert len(found.people) == 200_000


def test_a_table_without_rows_has_no_records(tmp_path: Path) -> None:
    found = read_columns(tmp_path / "a.parquet", {"ts": pa.array([], pa.int64()), "x_m": [], "y_m": []})
    assert found.people == []
    assert found.error is None


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(flips=st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(1, 255)), min_size=1, max_size=5))
def test_any_damage_is_read_quarantined_or_refused(flips: list[tuple[float, int]], tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    columns = {"ts": [NINE_MS, NINE_MS + 5], "x_m": [1.0, 2.0], "y_m": [3.0, 4.0], "track_id": ["a", "b"]}
    pq.write_table(pa.table(columns), path)
    data = bytearray(path.read_bytes())
    for where, bits in flips:
        data[int(len(data) * where)] ^= bits
    path.write_bytes(data)
    read(Tables(), path, IngestOptions(camera="c"))
