"""A small input cannot ask for much memory or time, whatever it claims; a large honest one passes."""

from __future__ import annotations

import bz2
import gzip
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from raw_reading import NINE_MS, NOW, small_site

from vsd_analytics.ingest.intake.pipeline import SourceResult, ingest
from vsd_analytics.ingest.reading import parquet
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.ingest.reading.limits import GB, records_max, unpacked_max
from vsd_analytics.settings import Settings

DAY_MESSAGES = 30 * 10 * 86_400
ROW = {"ts": NINE_MS, "camera_id": "cam-1", "track_id": "7", "x_m": 1.0, "y_m": 2.0}


def table(n: int = 1, **changes: Any) -> pa.Table:
    """Return rows that are all alike but for the columns given."""
    columns = {**ROW, **changes}
    return pa.table({k: v if isinstance(v, list | pa.Array) else [v] * n for k, v in columns.items()})


def take(tmp_path: Path, path: Path, options: Mapping[str, Any] | None = None, **settings: Any) -> SourceResult:
    site = small_site(tmp_path / "site", settings=Settings().with_values(settings))
    return ingest(site, [path], IngestOptions(**(options or {})), now=NOW).sources[0]


def take_table(tmp_path: Path, rows: pa.Table, *, writing: Mapping[str, Any] | None = None, **settings: Any) -> Any:
    pq.write_table(rows, tmp_path / "a.parquet", compression="zstd", **(writing or {}))
    return take(tmp_path, tmp_path / "a.parquet", **settings)


def stored(folder: Path) -> list[list[dict[str, Any]]]:
    """Return the rows of each part in the order of their hours. Parts also note the file they came from."""
    parts = (folder / "site" / "store").rglob("*.parquet")
    return [pq.ParquetFile(path).read().to_pylist() for path in sorted(parts, key=lambda p: (p.parent, p.name[:3]))]


def code(result: SourceResult) -> str:
    return "" if result.error is None else result.error.code


def shrunk(path: Path, *, footer: bool) -> None:
    """Write a hundred where a number is above a million: in the footer, or in the headers of pages."""

    def varint(value: int, length: int) -> bytes:
        digits = [(value << 1 >> 7 * i) & 127 for i in range(length)]
        return bytes([d | 128 for d in digits[:-1]] + [digits[-1]])

    column = pq.read_metadata(path).row_group(0).column(2)
    true = varint(column.total_uncompressed_size, 5 if column.total_uncompressed_size >= 1 << 27 else 4)
    data = path.read_bytes()
    at = len(data) - 8 - int.from_bytes(data[-8:-4], "little")
    pages, end = data[:at], data[at:]
    assert true in end
    path.write_bytes(pages + end.replace(true, varint(100, len(true))) if footer else data)


def test_a_cell_of_gigabytes_is_refused_from_the_footer(tmp_path: Path) -> None:
    result = take_table(tmp_path, table(track_id="x" * 20_000_000))
    assert result.error is not None
    assert (result.error.code, result.n_records) == ("E206", {})
    said = str(result.error)
    assert "20,000,403 bytes; at most 4,000,000 are read" in said
    assert "unpack_free_mb" in (result.error.fix or "")


def test_a_footer_that_lies_about_a_page_is_found_out_by_the_page(tmp_path: Path) -> None:
    pq.write_table(table(track_id="x" * 20_000_000), tmp_path / "a.parquet", compression="zstd", use_dictionary=False)
    shrunk(tmp_path / "a.parquet", footer=True)
    metadata = pq.read_metadata(tmp_path / "a.parquet")
    assert metadata.row_group(0).column(2).total_uncompressed_size == 100
    result = take(tmp_path, tmp_path / "a.parquet")
    assert (code(result), result.n_records) == ("E209", {})
    assert result.error is not None
    assert "a page of 20,0" in str(result.error)


def test_more_rows_than_bytes_can_say_are_refused_and_a_setting_lets_them_in(tmp_path: Path) -> None:
    rows = table(20_000)
    result = take_table(tmp_path, rows, records_free=10_000, records_per_byte_max=1.0)
    assert (code(result), result.n_records) == ("E209", {})
    assert result.error is not None
    assert "20,000 records or more; at most 10,000 are read" in str(result.error)
    assert "records_free" in (result.error.fix or "")
    assert take_table(tmp_path, rows, records_free=20_000).n_records == {"observations": 20_000}


def test_one_text_in_every_row_counts_as_often_as_it_is_there(tmp_path: Path) -> None:
    rows = table(10_000, track_id="x" * 1000)
    assert code(take_table(tmp_path, rows)) == "E206"
    result = take_table(tmp_path, rows, unpack_free_mb=20.0)
    assert (code(result), result.n_rejected) == ("", {"long-track-id": 10_000})


def test_texts_that_repeat_the_one_before_are_read_few_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[int] = []
    pieces = parquet.ParquetTable._in_pieces

    def spied(self: Any, held: Any, names: Any) -> Any:
        seen.append(max(b.num_rows for b in held))
        return pieces(self, held, names)

    monkeypatch.setattr(parquet.ParquetTable, "_in_pieces", spied)
    rows = table(2000, track_id="x" * 50_000)
    writing = {"use_dictionary": False, "column_encoding": {"track_id": "DELTA_BYTE_ARRAY"}}
    result = take_table(tmp_path, rows, writing=writing, unpack_free_mb=500.0)
    assert (code(result), result.n_rejected) == ("", {"cell-too-long": 2000})
    assert max(seen) < 500


def test_a_long_cell_is_quarantined_and_its_neighbours_are_stored(tmp_path: Path) -> None:
    result = take_table(tmp_path, table(3, ts=[NINE_MS, NINE_MS + 1, NINE_MS + 2], track_id=["a", "x" * 20_000, "b"]))
    assert (dict(result.n_records), result.n_rejected) == ({"observations": 2}, {"cell-too-long": 1})
    assert "20,000 bytes; at most 10,000 are read (cell_max_bytes)" in result.examples["cell-too-long"].detail
    assert result.examples["cell-too-long"].line == 2


def test_lists_and_long_fixed_cells_are_refused_unread(tmp_path: Path) -> None:
    lists = pa.ListArray.from_arrays(pa.array([0, 100_000], pa.int32()), pa.array([1.0] * 100_000))
    assert code(take_table(tmp_path, table(x_m=lists))) == "E203"
    assert code(take_table(tmp_path, table(track_id=pa.array([b"x" * 20_000], pa.binary(20_000))))) == "E209"


@pytest.mark.parametrize("text", ["7", "a", "ß"])
def test_many_small_row_groups_are_read_like_one(tmp_path: Path, text: str) -> None:
    rows = table(50, ts=[NINE_MS + k for k in range(50)], track_id=[f"{text}{k % 3}" for k in range(50)])
    found = [
        take_table(tmp_path / name, rows, writing={"row_group_size": size}, pseudonyms=False)
        for name, size in (("one", 50), ("many", 3))
        if not (tmp_path / name).mkdir()
    ]
    assert [dict(r.n_records) for r in found] == [{"observations": 50}] * 2
    assert stored(tmp_path / "one") == stored(tmp_path / "many")


def test_row_groups_before_a_damaged_one_are_stored_however_small(tmp_path: Path) -> None:
    rows = table(50, ts=[NINE_MS + k for k in range(50)], track_id=[f"a{k}" for k in range(50)])
    pq.write_table(rows, tmp_path / "a.parquet", row_group_size=10)
    data = bytearray((tmp_path / "a.parquet").read_bytes())
    at = pq.read_metadata(tmp_path / "a.parquet").row_group(3).column(2).dictionary_page_offset
    data[at : at + 8] = b"\xff" * 8
    (tmp_path / "a.parquet").write_bytes(data)
    result = take(tmp_path, tmp_path / "a.parquet")
    assert (code(result), result.n_records) == ("E205", {"observations": 30})
    assert "after record 30" in str(result.error)


def test_texts_in_a_dictionary_and_not_in_turns_are_read_like_plain_ones(tmp_path: Path) -> None:
    words = [f"{k:05}" + "é" * 40 for k in range(2000)]
    rows = table(2000, ts=[NINE_MS + k for k in range(2000)], track_id=words)
    stores = []
    for name, writing in {
        "plain": {"use_dictionary": False},
        "dictionary": {"use_dictionary": True},
        "dictionary, then not": {"use_dictionary": True, "dictionary_pagesize_limit": 2000, "data_page_size": 2000},
        "prefixes": {"use_dictionary": False, "column_encoding": {"track_id": "DELTA_BYTE_ARRAY"}},
        "lengths": {"use_dictionary": False, "column_encoding": {"track_id": "DELTA_LENGTH_BYTE_ARRAY"}},
    }.items():
        (tmp_path / name).mkdir()
        result = take_table(tmp_path / name, rows, writing={**writing, "row_group_size": 700}, pseudonyms=False)
        assert (code(result), result.n_records) == ("", {"observations": 2000}), name
        stores.append(stored(tmp_path / name))
    assert all(store == stores[0] for store in stores)


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress])
def test_a_text_that_unpacks_without_end_is_refused_after_what_is_allowed(tmp_path: Path, pack: Any) -> None:
    line = json.dumps({"v": 1, "camera": "cam-1", "ts": "2026-11-09T09:00:00Z", "persons": []}).encode() + b"\n"
    (tmp_path / "a.jsonl.x").write_bytes(pack(line * 10_000))
    result = take(tmp_path, tmp_path / "a.jsonl.x", unpack_free_mb=0.1)
    assert code(result) == "E206"
    assert result.error is not None
    assert "unpack_ratio_max" in (result.error.fix or "") or "unpack_free_mb" in (result.error.fix or "")
    assert take(tmp_path, tmp_path / "a.jsonl.x").n_records == {"frames": 10_000}


@pytest.mark.parametrize(
    ("name", "head", "line"),
    [
        ("a.jsonl", '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","persons":[]}\n', "x\n"),
        ("a.csv", "ts,camera_id,track_id,x_m,y_m\n1794214800,cam-1,7,1,2\n", "x\n"),
        ("gt.txt", "1,1,1,1,9,9\n", "x\n"),
    ],
)
def test_a_source_of_unreadable_records_is_read_no_further(tmp_path: Path, name: str, head: str, line: str) -> None:
    (tmp_path / name).write_text(head + line * 2000)
    options = {"camera": "cam-1", "start": NINE_MS, "fps": 25.0} if name == "gt.txt" else {}
    result = take(tmp_path, tmp_path / name, options, unreadable_max=1000)
    assert code(result) == "E209"
    assert result.error is not None
    assert "unreadable_max" in (result.error.fix or "")
    assert sum(result.n_records.values()) >= 1
    assert code(take(tmp_path, tmp_path / name, options, unreadable_max=2000)) == ""


def test_bad_rows_beyond_what_quarantine_keeps_are_counted_exactly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "vsd_analytics.ingest.intake.quarantine_writer.Quarantine.room", property(lambda self: 100 - self._n_taken)
    )
    result = take_table(tmp_path, table(1000, x_m=1e9))
    assert result.n_rejected == {"out-of-range": 1000}
    lines = [json.loads(x) for p in (tmp_path / "site" / "quarantine").iterdir() for x in p.read_text().splitlines()]
    assert len(lines) == 101
    assert [entry["n_not_kept"] for entry in lines if "n_not_kept" in entry] == [900]


@pytest.mark.parametrize("n", [20, 21])
def test_frames_with_more_people_than_a_picture_holds_are_quarantined(tmp_path: Path, n: int) -> None:
    persons = [{"id": i, "x_m": i, "y_m": 1} for i in range(n)]
    message = {"v": 1, "camera": "cam-1", "ts": "2026-11-09T09:00:00Z", "persons": persons}
    (tmp_path / "a.jsonl").write_text(json.dumps(message) + "\n")
    people = [{"personID": i, "positionID": i} for i in range(n)]
    folder = tmp_path / "annotations_positions"
    folder.mkdir()
    (folder / "00000000.json").write_text(json.dumps(people))
    boxes = [{"bbox": [i / n, 0.1, (i + 1) / n, 0.5]} for i in range(n)]
    head = "Version,Timestamp,DetectedObjects,ViolatingObjects,EnvironmentScore,Detections,ViolationsIndexes\n"
    (tmp_path / "log.csv").write_text(f'{head}1.0,2026-11-09 09:00:00,{n},0,0.9,"{boxes}","[]"\n')
    options = {"camera": "cam-1", "start": NINE_MS}
    for path in (tmp_path / "a.jsonl", tmp_path / "log.csv", folder):
        own = tmp_path / f"site of {path.name}"  # the same people elsewhere would be another camera's
        own.mkdir()
        result = take(own, path, options if path == folder else {"camera": "cam-1"}, persons_max=20)
        assert result.n_rejected == ({} if n == 20 else {"too-many": 1}), path
        assert result.n_records["observations"] == (20 if n == 20 else 0)


def test_a_frame_number_without_end_makes_no_heartbeats(tmp_path: Path) -> None:
    (tmp_path / "gt.txt").write_text("1,1,1,1,9,9\n9000000,1,1,1,9,9\n")
    result = take(tmp_path, tmp_path / "gt.txt", {"camera": "cam-1", "start": NINE_MS, "fps": 25.0})
    assert (dict(result.n_records), result.n_rejected) == ({"observations": 1, "frames": 1}, {"bad-frame": 1})


def test_a_day_of_thirty_cameras_at_ten_frames_a_second_is_within_every_bound() -> None:
    settings = Settings()
    n_bytes = DAY_MESSAGES * 400  # a heartbeat and five people of 60 bytes each
    records = DAY_MESSAGES * (1 + 5 + 10)  # frames, people, pairs
    assert (n_bytes, records) == (10_368_000_000, 414_720_000)
    assert n_bytes <= settings.unpack_max_gb * GB
    assert records <= settings.records_max
    assert settings.unreadable_max <= DAY_MESSAGES / 100
    for packed in (n_bytes, n_bytes // 29, n_bytes // 106):  # plain, and what gz and bz2 make of heartbeats alone
        assert unpacked_max(packed, settings) >= n_bytes
    heartbeats = DAY_MESSAGES * 71
    assert records_max(heartbeats // 106, settings) >= DAY_MESSAGES
    assert records_max(n_bytes // 20, settings) >= records
