"""Text tables: delimiters, compression, columns and their names, times, bad rows with their line numbers."""

from __future__ import annotations

import bz2
import gzip
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from raw_reading import NINE_MS, Reading, read, read_table

from vsd_analytics.ingest.formats.tables import Tables
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source

HEADER = "ts,camera_id,track_id,x_m,y_m"
ROWS = ["2026-11-09T09:00:00Z,cam-1,7,1.5,2.5", "2026-11-09T09:00:01Z,cam-2,8,-3,0.25"]
CSV = "\n".join([HEADER, *ROWS]) + "\n"
NAIVE = IngestOptions(camera="cam-1", frame_zone="Europe/Rome")


def _zst(text: str) -> bytes:
    sink = pa.BufferOutputStream()
    with pa.CompressedOutputStream(sink, "zstd") as stream:
        stream.write(text.encode())
    data: bytes = sink.getvalue().to_pybytes()
    return data


def _places(found: Reading) -> list[tuple[Any, ...]]:
    assert found.error is None
    return [(r["camera"], r["ts_ms"] - NINE_MS, r["track"], r["x_m"], r["y_m"], r["line"]) for r in found.people]


EXPECTED = [("cam-1", 0, "7", 1.5, 2.5, 2), ("cam-2", 1000, "8", -3.0, 0.25, 3)]


@pytest.mark.parametrize(
    "content",
    [
        CSV,
        CSV.rstrip("\n"),
        CSV.replace("\n", "\r\n"),
        "\ufeff" + CSV,
        CSV.replace(",", ";"),
        CSV.replace(",", "\t"),
        CSV.replace(",", " "),
        CSV.replace(",", "  \t"),
        "# " + CSV.replace(",", " "),
        CSV.replace("camera_id", " Camera_ID ").replace("x_m", "X_M"),
        CSV.replace("cam-1", '"cam-1"').replace("track_id", '"track_id"'),
        CSV.replace(",", ', "', 1).replace(",track_id", '",track_id'),
        gzip.compress(CSV.encode(), mtime=0),
        bz2.compress(CSV.encode()),
        _zst(CSV),
    ],
    ids=str,
)
def test_one_table_in_many_dresses(tmp_path: Path, content: str | bytes) -> None:
    path = tmp_path / "export"
    found = read_table(path, content, IngestOptions())
    assert _places(found) == EXPECTED
    assert not found.rejected
    assert Tables().detects(Source(path))
    assert {r["quality"] for r in found.people} == {"metric"}


def test_blank_lines_are_no_records_and_lines_keep_their_numbers(tmp_path: Path) -> None:
    found = read_table(tmp_path / "a.csv", "\n\r\n" + CSV.replace("\n", "\n\n") + "  \n,,,,\n")
    assert [r["line"] for r in found.people] == [5, 7]
    assert found.reasons == {10: "not-a-time"}


def test_semicolon_files_may_have_decimal_commas(tmp_path: Path) -> None:
    found = read_table(tmp_path / "a.csv", "ts;x_m;y_m\n1794214800;1,25;2.5\n")
    assert [(r["x_m"], r["y_m"]) for r in found.people] == [(1.25, 2.5)]
    headerless = IngestOptions(camera="cam-1", columns=("ts", "x_m", "y_m"))
    found = read_table(tmp_path / "a.csv", "1794214800;1,25;2,5\n", headerless)
    assert [(r["x_m"], r["y_m"]) for r in found.people] == [(1.25, 2.5)]


def test_cells_with_delimiters_in_quotes_are_one_cell(tmp_path: Path) -> None:
    text = 'ts,name,x_m,y_m\n1794214800,"Smith, ""J""",1,2\n1794214801,"a,b,c",3,4\n'
    assert [r["x_m"] for r in read_table(tmp_path / "a.csv", text).people] == [1.0, 3.0]


@pytest.mark.parametrize("bad", ['1794214801,"open,1,2', '1794214801,"a"b,1,2', 'x"y,"z', '1794214801,"line'])
def test_a_quote_that_is_not_closed_spoils_its_own_line_only(tmp_path: Path, bad: str) -> None:
    text = f"ts,name,x_m,y_m\n1794214800,a,1,2\n{bad}\n1794214802,b,3,4\n"
    found = read_table(tmp_path / "a.csv", text)
    assert [r["line"] for r in found.people] == [2, 4]
    assert list(found.reasons) == [3]


def test_notes_above_a_headerless_table_are_no_records(tmp_path: Path) -> None:
    text = "# written by a tracker, 25 fps\n\n# id time x/m y/m\n7\t1794214801\t1.5\t2.5\n8\t1794214802\t3\t4\n"
    found = read_table(
        tmp_path / "a.txt", text, IngestOptions(camera="cam-1", columns=("track_id", "ts", "x_m", "y_m"))
    )
    assert _places(found) == [("cam-1", 1000, "7", 1.5, 2.5, 4), ("cam-1", 2000, "8", 3.0, 4.0, 5)]
    assert found.rejected == []


def test_a_missing_column_of_named_columns_is_to_be_named_there(tmp_path: Path) -> None:
    options = IngestOptions(camera="cam-1", columns=("ts", "track_a", "track_b"))
    found = read_table(tmp_path / "a.txt", "1794214801 7 8\n", options)
    assert found.error is not None
    assert str(found.error.fix).startswith("name it in --columns: distance_m")


def test_headerless_files_need_names_and_ignored_columns_may_be_at_the_end(tmp_path: Path) -> None:
    text = "1794214800.5,7,1.5,2.5,9,9\n1794214801,8,3,4,9,9\n"
    options = IngestOptions(camera="cam-1", columns=("ts", "track_id", "x_m", "_", "y_m"))
    found = read_table(tmp_path / "a.csv", text, options)
    assert [(r["ts_ms"] - NINE_MS, r["track"], r["x_m"], r["y_m"], r["line"]) for r in found.people] == [
        (500, "7", 1.5, 9.0, 1),
        (1000, "8", 3.0, 9.0, 2),
    ]
    found = read_table(tmp_path / "a.csv", text)
    assert found.error is not None
    assert found.error.code == "E203"
    assert found.error.fix is not None
    assert "no header" in str(found.error.why)
    assert "--columns" in found.error.fix
    too_many = read_table(tmp_path / "a.csv", text, IngestOptions(columns=tuple("abcdefgh")))
    assert too_many.error is not None
    assert "8 columns, a.csv has 6" in too_many.error.what


def test_renames_are_found_whatever_their_case(tmp_path: Path) -> None:
    text = "Time,PX,py\n1794214800,1,2\n"
    renames = {"ts": "time", "x_m": "px", "y_m": "PY"}
    found = read_table(tmp_path / "a.csv", text, IngestOptions(camera="c", map=renames))
    assert [(r["x_m"], r["y_m"]) for r in found.people] == [(1.0, 2.0)]
    site_wide = IngestOptions(camera="c", site_map={**renames, "track_id": "person"})
    assert len(read_table(tmp_path / "a.csv", text, site_wide).people) == 1
    ours = read_table(tmp_path / "a.csv", "ts,x_m,y_m\n1794214800,1,2\n", site_wide)
    assert len(ours.people) == 1
    wrong = read_table(tmp_path / "a.csv", text, IngestOptions(camera="c", map={**renames, "x_m": "pix"}))
    assert wrong.error is not None
    assert "'pix'" in wrong.error.what
    assert wrong.error.fix is not None
    assert "--map" in wrong.error.fix


@pytest.mark.parametrize(
    ("header", "column", "near"),
    [
        ("time,x_m,y_m", "ts", "time"),
        ("timestamp,x_m,y_m", "ts", "timestamp"),
        ("ts,x,y", "x_m", "x"),
        ("ts,x_m,pos_y", "y_m", "pos_y"),
        ("ts,track_a,track_b,dist", "distance_m", "dist"),
        ("ts,track_a,id_b,distance_m", "track_b", "id_b"),
        ("ts,left,top,right", "bottom", None),
    ],
)
def test_a_missing_column_is_named_with_the_nearest_one_found(
    tmp_path: Path, header: str, column: str, near: str | None
) -> None:
    found = read_table(tmp_path / "a.csv", f"{header}\n")
    assert found.error is not None
    assert found.error.code == "E203"
    assert repr(column) in found.error.what
    assert found.error.where is not None
    assert (found.error.where.line, found.error.where.text) == (1, header)
    assert all(name in str(found.error.why) for name in header.split(","))
    assert found.error.fix is not None
    if near is not None:
        assert f"--map {column}={near}" in found.error.fix
        assert header[found.error.where.column - 1 :].startswith(near)  # type: ignore[operator]


@pytest.mark.parametrize(
    ("header", "proposed"),
    [
        ("time,cam,person,x_cm,y_cm,conf", "ts=time,camera_id=cam,track_id=person,x_m=x_cm,y_m=y_cm"),
        ("conf,Sensor,detection,trackId,ts,worldX,worldY", "camera_id=Sensor,track_id=trackId,x_m=worldX,y_m=worldY"),
        ("time,id,x1,y1,x2,y2", "ts=time,track_id=id,left=x1,top=y1,right=x2,bottom=y2"),
        ("date,time,oid,x_m,y_m", "ts=date+time,track_id=oid"),
        ("when,camera_id,track_id,x_m,y_m", "ts=when"),
        ("time,view,track_a,track_b,distance_m", "ts=time,camera_id=view"),
    ],
)
def test_the_first_refusal_of_a_table_names_every_column_that_is_recognised(
    tmp_path: Path, header: str, proposed: str
) -> None:
    cells = ",".join("2026-11-09" if n == "date" else "x" for n in header.split(","))
    found = read_table(tmp_path / "a.csv", f"{header}\n{cells}\n")
    assert found.error is not None
    assert found.error.code == "E203"
    assert str(found.error.fix).split("   ")[0] == f"--map {proposed}"


def test_a_table_without_camera_needs_one_to_be_named(tmp_path: Path) -> None:
    found = read_table(tmp_path / "a.csv", "ts,x_m,y_m\n1794214800,1,2\n", IngestOptions())
    assert found.error is not None
    assert found.error.fix == "--camera ID"


def test_boxes_become_foot_points_both_ways(tmp_path: Path) -> None:
    corners = read_table(tmp_path / "a.csv", "ts,left,top,right,bottom\n1794214800,100,50,140,250\n")
    sizes = read_table(tmp_path / "a.csv", "ts,left,top,width,height\n1794214800,100,50,40,200\n")
    for found in (corners, sizes):
        assert [(r["u_px"], r["v_px"], r["x_m"], r["quality"]) for r in found.people] == [
            (120.0, 250.0, None, "relative")
        ]


def test_floor_metres_win_over_boxes_and_pixels_may_be_beside_them(tmp_path: Path) -> None:
    text = "ts,x_m,y_m,u_px,v_px,left,top,right,bottom\n1794214800,1,2,3,4,100,50,140,250\n"
    (row,) = read_table(tmp_path / "a.csv", text).people
    assert (row["x_m"], row["y_m"], row["u_px"], row["v_px"], row["quality"]) == (1.0, 2.0, 3.0, 4.0, "metric")


def test_frame_numbers_become_times(tmp_path: Path) -> None:
    text = "frame,x_m,y_m\n0,1,2\n10,1,2\n25.0,1,2\n,1,2\n1e300,1,2\n"
    found = read_table(tmp_path / "a.csv", text, IngestOptions(camera="c", fps=12.5, start=NINE_MS))
    assert [r["ts_ms"] - NINE_MS for r in found.people] == [0, 800, 2000]
    assert found.reasons == {5: "not-a-time", 6: "not-a-time"}
    later = read_table(tmp_path / "a.csv", text, IngestOptions(camera="c", fps=12.5, start=NINE_MS, first_frame=10))
    assert [r["ts_ms"] - NINE_MS for r in later.people] == [-800, 0, 1200]
    lacking = read_table(tmp_path / "a.csv", text)
    assert lacking.error is not None
    assert (lacking.error.code, lacking.error.fix) == ("E207", "add --hz 25 --start 2026-11-09T08:00:00+01:00")


def test_periods_floor_times(tmp_path: Path) -> None:
    text = "ts,x_m,y_m\n" + "".join(f"{1794214800 + s},1,2\n" for s in (0, 0.999, 1.0, 1.999, 4.2))
    seconds = read_table(tmp_path / "a.csv", text, IngestOptions(camera="c", period_s=1))
    assert [r["ts_ms"] - NINE_MS for r in seconds.people] == [0, 0, 1000, 1000, 4000]
    fifths = read_table(tmp_path / "a.csv", text, IngestOptions(camera="c", period_s=0.4))
    assert [r["ts_ms"] - NINE_MS for r in fifths.people] == [0, 800, 800, 1600, 4000]


BAD_CELLS = {
    "text in a number column": ("1794214801,b,abc,2", "not-a-number", "x_m is not a number: 'abc'"),
    "NaN": ("1794214801,b,NaN,2", "not-a-number", "x_m is not a number: 'NaN'"),
    "infinity": ("1794214801,b,1,-inf", "not-a-number", "y_m is not a number: '-inf'"),
    "too large": ("1794214801,b,1e999,2", "not-a-number", "x_m is not a number: '1e999'"),
    "underscores": ("1794214801,b,1_0,2", "not-a-number", "x_m is not a number: '1_0'"),
    "NUL": ("1794214801,b,1\x00,2", "not-a-number", "x_m is not a number: '1\\x00'"),
    "no time": (",b,1,2", "not-a-time", "ts is not a time: ''"),
    "text for time": ("yesterday,b,1,2", "not-a-time", "ts is not a time: 'yesterday'"),
    "the clock's words": ("now,b,1,2", "not-a-time", "ts is not a time: 'now'"),
    "impossible day": ("2026-02-30T10:00:00Z,b,1,2", "not-a-time", "ts is not a time: '2026-02-30T10:00:00Z'"),
    "infinite time": ("inf,b,1,2", "not-a-time", "ts is not a time: 'inf'"),
    "too few fields": ("1794214801,b,1", "wrong-number-of-fields", "the row has 3 fields, 4 expected"),
    "too many fields": ("1794214801,b,1,2,3", "wrong-number-of-fields", "the row has 5 fields, 4 expected"),
}


@pytest.mark.parametrize("name", BAD_CELLS)
def test_a_bad_row_is_quarantined_with_its_line_and_its_neighbours_are_stored(tmp_path: Path, name: str) -> None:
    bad, reason, detail = BAD_CELLS[name]
    text = "\n".join(["", "ts,track_id,x_m,y_m", "1794214800,a,1,2", "", bad, "1794214802,c,3,4", bad, ""])
    found = read_table(tmp_path / "a.csv", text)
    assert found.reasons == {5: reason, 7: reason}
    assert found.rejected[0].detail == detail
    assert [(r["line"], r["track"]) for r in found.people] == [(3, "a"), (6, "c")]


def test_blank_cells_are_missing_not_wrong(tmp_path: Path) -> None:
    text = "ts,track_id,x_m,y_m,u_px,v_px\n1794214800,,1, ,3,4\n"
    (row,) = read_table(tmp_path / "a.csv", text).people
    assert (row["track"], row["x_m"], row["y_m"], row["u_px"]) == (None, 1.0, None, 3.0)


def test_a_trailing_delimiter_is_no_field(tmp_path: Path) -> None:
    found = read_table(tmp_path / "a.csv", "ts,x_m,y_m\n1794214800,1,2,\n1794214801,1,2, \n1794214801,1,2\n")
    assert len(found.people) == 3
    assert not found.rejected


def test_a_cut_last_line_is_quarantined_or_stored_but_never_half_a_number(tmp_path: Path) -> None:
    found = read_table(tmp_path / "a.csv", "ts,x_m,y_m\n1794214800,1,2\n17942148")
    assert (len(found.people), found.reasons) == (1, {3: "wrong-number-of-fields"})


def test_a_long_line_is_quarantined_unread_and_memory_stays_small(tmp_path: Path) -> None:
    text = f"ts,x_m,y_m\n1794214800,1,2\n{'9' * 6_000_000},1,2\n1794214801,3,4\n"
    found = read_table(tmp_path / "a.csv", text)
    assert found.reasons == {3: "line-too-long"}
    assert [r["line"] for r in found.people] == [2, 4]
    tight = read_table(tmp_path / "a.csv", "ts,x_m,y_m\n1794214800.000,1,2\n1794214800,1,2\n", _limited(17))
    assert tight.reasons == {2: "line-too-long"}


def _limited(n_bytes: int) -> IngestOptions:
    return IngestOptions(camera="cam-1", line_max_bytes=n_bytes)


def test_rows_before_damage_in_a_gzip_are_stored(tmp_path: Path) -> None:
    text = "ts,x_m,y_m\n" + "".join(f"{1794214800 + k},{k / 7:.5f},2\n" for k in range(20_000))
    whole = gzip.compress(text.encode(), mtime=0)
    path = tmp_path / "a.csv.gz"
    path.write_bytes(whole[: len(whole) * 2 // 3])
    found = read(Tables(), path, IngestOptions(camera="cam-1"))
    assert found.error is not None
    assert found.error.code == "E205"
    n = len(found.people)
    assert 1000 < n < 20_000
    assert [r["x_m"] for r in found.people] == [float(f"{k / 7:.5f}") for k in range(n)]
    assert not found.rejected


def test_a_gzip_damaged_in_its_first_line_is_called_damaged_not_empty(tmp_path: Path) -> None:
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(CSV.encode(), mtime=0)[:15])
    found = read(Tables(), path)
    assert found.error is not None
    assert found.error.code == "E205"


@pytest.mark.parametrize("content", ["", "\n\n", "\ufeff\n", gzip.compress(b"", mtime=0)])
def test_a_file_without_content_is_called_empty(tmp_path: Path, content: str | bytes) -> None:
    found = read_table(tmp_path / "a.csv", content)
    assert found.error is not None
    assert found.error.code == "E202"


def test_utf_16_is_distinguished_from_garbage(tmp_path: Path) -> None:
    found = read_table(tmp_path / "a.csv", CSV.encode("utf-16"))
    assert found.error is not None
    assert found.error.fix is not None
    assert "iconv" in found.error.fix


def test_bytes_that_are_not_utf_8_keep_people_apart(tmp_path: Path) -> None:
    found = read_table(tmp_path / "a.csv", b"ts,track_id,x_m,y_m\n1794214800,\xe9,1,2\n1794214800,\xe8,1,2\n")
    assert len(set(found.column("track"))) == 2


@pytest.mark.parametrize("written", ["7", "7.0", "7.", "7.000", "7.0000000e+00", ' "7"', " 7 "])
def test_an_id_is_the_same_however_it_is_written(tmp_path: Path, written: str) -> None:
    found = read_table(tmp_path / "a.csv", f"ts,track_id,x_m,y_m\n1794214800,{written},1,2\n")
    assert found.column("track") == ["7"]


def test_ids_that_only_look_like_numbers_are_left_alone(tmp_path: Path) -> None:
    ids = ["12e4", "120000", "1.5e3", "1500", "1_2", "12", "007", "7.5", "inf", "0x10", "1e400", "9" * 30]
    text = "ts,track_id,x_m,y_m\n" + "".join(f"1794214800,{i},1,2\n" for i in ids)
    assert read_table(tmp_path / "a.csv", text).column("track") == ids


def test_pairs_are_distinguished_from_positions_by_their_columns(tmp_path: Path) -> None:
    text = "ts,track_a,track_b,distance_m,distance_sd_m\n1794214800,1,2,1.5,0.1\n1794214800,3,,0,\n"
    found = read_table(tmp_path / "a.csv", text)
    assert found.people == []
    assert [(p["track_a"], p["track_b"], p["distance_m"], p["distance_sd_m"]) for p in found.tables["pairs"]] == [
        ("1", "2", 1.5, 0.1),
        ("3", None, 0.0, None),
    ]
    places = "ts,track_a,track_b,x_a_m,y_a_m,x_b_m,y_b_m\n1794214800,1,2,0,0,3,4\n"
    assert read_table(tmp_path / "a.csv", places).tables["pairs"][0]["x_b_m"] == 3.0
    both = "ts,track_a,track_b,distance_m,x_m,y_m\n1794214800,1,2,1.5,0,0\n"
    as_told = read(Tables("observations"), _written(tmp_path, both), IngestOptions(camera="cam-1"))
    assert len(as_told.people) == 1


def _written(folder: Path, text: str) -> Path:
    (folder / "b.csv").write_text(text)
    return folder / "b.csv"


@pytest.mark.parametrize(
    ("name", "content", "is_ours"),
    [
        ("a.csv", "anything\n", True),
        ("a.txt", "frame x_m y_m\n", True),
        ("a.txt", "ts;u_px;v_px\n", True),
        ("a.txt", "hello world\n", False),
        ("a.csv", '{"v": 1}\n', False),
        ("a.parquet", "PAR1", True),
        ("a.log", "", False),
    ],
)
def test_detection_goes_by_name_or_first_line(tmp_path: Path, name: str, content: str, is_ours: bool) -> None:
    (tmp_path / name).write_text(content)
    assert Tables().detects(Source(tmp_path / name)) == is_ours


def test_a_folder_is_no_table(tmp_path: Path) -> None:
    (tmp_path / "x.csv").mkdir()
    assert not Tables().detects(Source(tmp_path / "x.csv"))


def test_many_rows_come_in_blocks_with_right_lines(tmp_path: Path) -> None:
    rows = [f"1794214800,{k % 9},{k},2,{'x' * 40}" if k % 1000 else f"1794214800,1,{k}" for k in range(120_000)]
    found = read_table(tmp_path / "a.csv", "ts,track_id,x_m,y_m,note\n" + "\n".join(rows))
    assert len(found.batches) > 1
    assert [r["line"] for r in found.people] == [k + 2 for k in range(120_000) if k % 1000]
    assert list(found.reasons) == [k + 2 for k in range(0, 120_000, 1000)]
    assert all(r["x_m"] == r["line"] - 2 for r in found.people)


hostile_text = st.text(alphabet=st.sampled_from("1,2;\t \"'\r\n.eE+-naifxT:Z\x00é"), max_size=60)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@example(content=b"PAR1PAR1")
@example(content=b"PAR1\x00\x00\x00\x00PAR1")
@example(content=b'ts,x_m,y_m\n"')
@given(content=st.one_of(st.binary(max_size=200), hostile_text.map(lambda t: b"ts,track_id,x_m,y_m\n" + t.encode())))
def test_any_bytes_are_read_quarantined_or_refused(content: bytes, tmp_path: Path) -> None:
    options = IngestOptions(camera="cam-1", frame_zone="Europe/Rome", period_s=0.5)
    found = read_table(tmp_path / "a.csv", content, options)
    if found.error is None:
        n_lines = content.count(b"\n") + 1
        assert len(found.people) + len(found.rejected) <= n_lines


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    content=st.binary(max_size=200),
    columns=st.lists(st.sampled_from(["ts", "x_m", "y_m", "_", "frame", "left", "distance_m"]), max_size=4),
)
def test_any_bytes_with_any_columns_are_read_quarantined_or_refused(
    content: bytes, columns: list[str], tmp_path: Path
) -> None:
    read_table(tmp_path / "a.csv", content, IngestOptions(camera="c", columns=tuple(columns), fps=1e-9, start=0))


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=st.lists(
        st.tuples(
            st.integers(0, 2**40),
            st.text(st.characters(codec="utf-8", exclude_characters='\r\n\x00",; \t'), min_size=1, max_size=5),
            st.floats(-9000, 9000),
        ),
        max_size=20,
    )
)
def test_good_rows_come_back_as_written(rows: list[tuple[int, str, float]], tmp_path: Path) -> None:
    text = "ts,track_id,x_m,y_m\n" + "".join(f'{ms / 1000:.3f},"t{track}",{x!r},0\n' for ms, track, x in rows)
    found = read_table(tmp_path / "a.csv", text)
    wanted = [(f"t{track}".strip(), x) for _, track, x in rows]
    assert [(r["track"], r["x_m"]) for r in found.people] == wanted
    assert not found.rejected
