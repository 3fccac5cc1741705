"""VSD frame messages: every kind of bad line is quarantined with its number, the good ones around it are stored."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import jsonschema
import msgspec
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from raw_reading import NINE_MS, read, read_frames

from vsd_analytics.ingest.formats import frames
from vsd_analytics.ingest.formats.frames import FrameMessage, Frames, json_schema
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source

GOOD: dict[str, Any] = {"v": 1, "camera": "cam-1", "ts": "2026-11-09T09:00:00Z", "persons": [{"id": 7, "x_m": 1.5}]}


def line(**changes: Any) -> str:
    return json.dumps({**GOOD, **changes})


def test_a_message_becomes_a_frame_its_persons_and_its_pairs(tmp_path: Path) -> None:
    persons = [{"id": "7", "x_m": 1.2, "y_m": 3.4}, {"id": 9, "u_px": 512.0, "v_px": 633.5}, {"x_m": 0, "y_m": -1}]
    pairs = [{"a": "7", "b": 9, "distance_m": 1.42, "sd_m": 0.15}]
    text = line(persons=persons, pairs=pairs, seq=3, engine="acme 2", quality="body", ts="2026-11-09T10:00:00.2+01:00")
    found = read_frames(tmp_path / "a.jsonl", text)
    shared = {"camera": "cam-1", "ts_ms": NINE_MS + 200, "zone": None, "line": 1}
    assert found.tables["frames"] == [{**shared, "n_persons": 3, "n_pairs": 1, "seq": 3}]
    blank = {"track": None, "x_m": None, "y_m": None, "u_px": None, "v_px": None, "is_staff": None}
    assert found.people == [
        {**shared, **blank, "person": 0, "quality": "body", "track": "7", "x_m": 1.2, "y_m": 3.4},
        {**shared, **blank, "person": 1, "quality": "body", "track": "9", "u_px": 512.0, "v_px": 633.5},
        {**shared, **blank, "person": 2, "quality": "body", "x_m": 0.0, "y_m": -1.0},
    ]
    ends = {"person_a": 0, "person_b": 1, "track_a": "7", "track_b": "9", "x_a_m": 1.2, "y_a_m": 3.4}
    measured = {"x_b_m": None, "y_b_m": None, "distance_m": 1.42, "distance_sd_m": 0.15, "quality": "body"}
    assert found.tables["pairs"] == [{**shared, **ends, **measured}]
    assert found.engines == {"acme 2"}
    assert not found.rejected
    assert not found.dropped


def test_no_persons_is_a_heartbeat_and_unknown_counts_stay_unknown(tmp_path: Path) -> None:
    text = "\n".join(
        [line(persons=[]), line(persons=[], pairs=[]), json.dumps({k: GOOD[k] for k in ("v", "camera", "ts")})]
    )
    found = read_frames(tmp_path / "a.jsonl", text)
    assert found.column("n_persons", "frames") == [0, 0, None]
    assert found.column("n_pairs", "frames") == [None, 0, None]


BAD_LINES: dict[str, tuple[bytes, str]] = {
    "cut off": (line().encode()[:40], "bad-json"),
    "not JSON": (b"hello", "bad-json"),
    "not an object": (b"[1, 2]", "bad-message"),
    "NaN": (line(persons=[{"x_m": float("nan")}]).encode(), "bad-json"),
    "Infinity": (line(persons=[{"x_m": float("inf")}]).encode(), "bad-json"),
    "too large a number": (
        b'{"v":1,"camera":"a","ts":"2026-11-09T09:00:00Z","persons":[{"x_m":1e999}]}',
        "bad-message",
    ),
    "text for a number": (line(persons=[{"x_m": "1.5"}]).encode(), "bad-message"),
    "true for a number": (line(persons=[{"x_m": True}]).encode(), "bad-message"),
    "a list for an id": (line(persons=[{"id": [1]}]).encode(), "bad-message"),
    "persons not a list": (line(persons={"id": 1}).encode(), "bad-message"),
    "no camera": (b'{"v":1,"ts":"2026-11-09T09:00:00Z"}', "bad-message"),
    "empty camera": (line(camera="").encode(), "bad-message"),
    "long camera": (line(camera="x" * 201).encode(), "bad-message"),
    "number for camera": (line(camera=7).encode(), "bad-message"),
    "no time": (b'{"v":1,"camera":"a"}', "bad-message"),
    "unix time": (line(ts=1794214800).encode(), "bad-message"),
    "impossible time": (line(ts="2026-02-30T09:00:00Z").encode(), "bad-message"),
    "version 2": (line(v=2).encode(), "bad-message"),
    "lone surrogate": (b'{"v":1,"camera":"\\ud800","ts":"2026-11-09T09:00:00Z"}', "bad-json"),
    "not UTF-8": (line().encode().replace(b"cam-1", b"cam-\xff"), "bad-json"),
    "NUL": (b"\x00" + line().encode(), "bad-json"),
    "deep nesting": (b"[" * 100_000, "bad-message"),
    "deep unknown field": (line()[:-1].encode() + b',"u":' + b"[" * 100_000 + b"]" * 100_000 + b"}", "bad-json"),
    "two objects": (line().encode() * 2, "bad-json"),
    "pair of one": (line(pairs=[{"a": 1}]).encode(), "bad-message"),
}


@pytest.mark.parametrize("name", BAD_LINES)
def test_a_bad_line_is_quarantined_and_its_neighbours_are_stored(tmp_path: Path, name: str) -> None:
    bad, reason = BAD_LINES[name]
    content = b"\n".join([line().encode(), b"", bad, b"  \r", line(camera="cam-2").encode(), b""])
    found = read_frames(tmp_path / "a.jsonl", content)
    assert found.reasons == {3: reason}
    assert found.rejected[0].detail.startswith("not a VSD frame message: ")
    assert found.column("camera", "frames") == ["cam-1", "cam-2"]
    assert found.column("line", "frames") == [1, 5]


def test_hostile_names_pass_as_mere_text(tmp_path: Path) -> None:
    names = ["../../x", "<script>alert(1)</script>", "a\x00b", "café \u202e"]
    found = read_frames(tmp_path / "a.jsonl", "\n".join(line(camera=n, persons=[{"id": n, "x_m": 1}]) for n in names))
    assert found.column("camera", "frames") == names
    assert found.column("track") == names


@pytest.mark.parametrize(("ts", "year"), [("0001-01-01T00:00:00+14:00", 1), ("9999-12-31T23:59:59-12:00", 9999)])
@pytest.mark.parametrize("zone", ["UTC", "Europe/Rome"])
def test_the_ends_of_the_calendar_are_times_for_validation_to_judge(
    tmp_path: Path, ts: str, year: int, zone: str
) -> None:
    options = IngestOptions(frame_zone=zone)
    found = read_frames(tmp_path / "a.jsonl", "\n".join([line(ts=ts), line(ts=ts[:19])]), options)
    years = [ms / 1000 / 86400 / 365.2425 + 1970 for ms in found.column("ts_ms", "frames")]
    assert all(abs(y - year) < 1.01 for y in years)


def test_a_line_that_is_too_long_is_quarantined_unread(tmp_path: Path) -> None:
    long = line(persons=[{"id": "x" * 2_000_000, "x_m": 1}])
    found = read_frames(tmp_path / "a.jsonl", "\n".join([line(), long, line()]))
    assert found.reasons == {2: "line-too-long"}
    assert found.column("line", "frames") == [1, 3]
    allowed = read_frames(tmp_path / "a.jsonl", "\n".join([line(), long]), IngestOptions(line_max_bytes=3_000_000))
    assert allowed.column("line", "frames") == [1, 2]
    tight = read_frames(tmp_path / "a.jsonl", line(), IngestOptions(line_max_bytes=20))
    assert "20 bytes" in tight.rejected[0].detail


def test_unknown_fields_are_counted_and_not_stored(tmp_path: Path) -> None:
    persons = [{"id": 1, "x_m": 1, "age": 44}, {"id": 2, "x_m": 1, "age": 3, "face": "…"}]
    pairs = [{"a": 1, "b": 2, "kind": "family"}]
    text = "\n".join([line(), line(persons=persons, pairs=pairs, shop="x"), line(note=None)])
    found = read_frames(tmp_path / "a.jsonl", text)
    assert found.dropped == {"unknown field": 6}
    assert not found.rejected
    assert len(found.people) == 4
    assert "family" not in str([b.tables for b in found.batches])


def test_two_persons_with_one_id_are_both_handed_on_and_the_pair_is_the_first(tmp_path: Path) -> None:
    persons = [{"id": "a", "x_m": 1, "y_m": 1}, {"id": "a", "x_m": 5, "y_m": 5}, {"id": "b", "x_m": 2, "y_m": 2}]
    found = read_frames(tmp_path / "a.jsonl", line(persons=persons, pairs=[{"a": "a", "b": "b"}]))
    assert found.column("person") == [0, 1, 2]
    (pair,) = found.tables["pairs"]
    assert (pair["person_a"], pair["x_a_m"], pair["person_b"], pair["x_b_m"]) == (0, 1.0, 2, 2.0)


def test_a_pair_of_persons_not_listed_is_nobody_elses_place(tmp_path: Path) -> None:
    persons = [{"x_m": 1, "y_m": 1}, {"x_m": 2, "y_m": 2}]
    pairs = [{"a": "p", "b": "q", "distance_m": 1}, {"a": "q", "b": "r", "distance_m": 1}]
    found = read_frames(tmp_path / "a.jsonl", line(persons=persons, pairs=pairs))
    members = [(p["person_a"], p["person_b"]) for p in found.tables["pairs"]]
    assert members == [(2, 3), (3, 4)]
    assert [p["x_a_m"] for p in found.tables["pairs"]] == [None, None]


def test_naive_times_are_on_their_cameras_clock(tmp_path: Path) -> None:
    naive = "2026-11-09T09:00:00"
    options = IngestOptions(frame_zone="UTC", clocks={"cam-2": "Asia/Tokyo", "cam-3": "Europe/Rome"})
    text = "\n".join(line(camera=c, ts=t) for c in ("cam-1", "cam-2", "cam-3") for t in (naive, naive + "+00:00"))
    found = read_frames(tmp_path / "a.jsonl", text, options)
    hours = [(ms - NINE_MS) / 3_600_000 for ms in found.column("ts_ms", "frames")]
    assert hours == [0, 0, -9, 0, -1, 0]


def test_a_local_time_that_comes_twice_is_the_first_and_reported(tmp_path: Path) -> None:
    options = IngestOptions(frame_zone="Europe/Rome")
    found = read_frames(tmp_path / "a.jsonl", line(ts="2026-10-25T02:30:00"), options)
    assert found.column("ts_ms", "frames") == [1792888200000]  # 00:30 UTC
    assert [n[:5] for n in found.notes] == ["W211:"]
    assert not read_frames(tmp_path / "a.jsonl", line(ts="2026-10-25T02:30:00+01:00"), options).notes


def test_a_byte_order_mark_and_windows_line_ends_are_no_part_of_messages(tmp_path: Path) -> None:
    content = b"\xef\xbb\xbf" + line().encode() + b"\r\n" + line().encode() + b"\r\n"
    path = tmp_path / "a.jsonl"
    found = read_frames(path, content)
    assert found.column("line", "frames") == [1, 2]
    assert Frames().detects(Source(path))


@pytest.mark.parametrize(
    ("content", "is_ours"),
    [
        (line(), True),
        ("\n\n  " + line(), True),
        ("ts,x_m,y_m\n1,2,3", False),
        ('[{"camera": 1}]', False),
        ('{"other": 1}', False),
        ("", False),
    ],
)
def test_detection_goes_by_a_line_that_is_one(tmp_path: Path, content: str, is_ours: bool) -> None:
    (tmp_path / "x").write_text(content)
    assert Frames().detects(Source(tmp_path / "x")) == is_ours


def test_messages_before_damage_in_a_gzip_are_stored(tmp_path: Path) -> None:
    text = "".join(line(seq=k, ts=f"2026-11-09T09:{k // 60:02}:{k % 60:02}Z") + "\n" for k in range(3000))
    whole = gzip.compress(text.encode(), compresslevel=1, mtime=0)
    path = tmp_path / "a.jsonl.gz"
    path.write_bytes(whole[: len(whole) // 2])
    assert Frames().detects(Source(path))
    found = read(Frames(), path)
    assert found.error is not None
    assert found.error.code == "E205"
    n = len(found.tables["frames"])
    assert 100 < n < 3000
    assert found.column("ts_ms", "frames") == [NINE_MS + 1000 * k for k in range(n)]
    assert not found.rejected


def test_many_messages_come_in_several_batches_with_right_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frames, "BATCH_ROWS", 2_500)
    persons = [{"id": k, "x_m": k, "y_m": 0} for k in range(4)]
    found = read_frames(tmp_path / "a.jsonl", "\n".join(line(persons=persons) for _ in range(1200)))
    assert len(found.batches) == 3
    assert found.column("line", "frames") == list(range(1, 1201))
    assert found.column("person") == list(range(4)) * 1200
    assert [b.done_bytes for b in found.batches] == sorted(b.done_bytes for b in found.batches)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@example(content=b"\x1f\x8b")
@example(content=b"BZh9")
@example(content=b"\x28\xb5\x2f\xfd\x00")
@given(content=st.one_of(st.binary(max_size=300), st.lists(st.binary(max_size=60), max_size=8).map(b"\n".join)))
def test_any_bytes_are_read_or_quarantined(content: bytes, tmp_path: Path) -> None:
    found = read_frames(tmp_path / "a.jsonl", content)
    if content.startswith((b"\x1f\x8b", b"BZh", b"\x28\xb5\x2f\xfd")):
        assert found.error is not None
        assert found.error.code == "E205"
        return
    assert len(found.reasons) == sum(bool(x.strip()) for x in content.removeprefix(b"\xef\xbb\xbf").split(b"\n"))


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5), lambda v: st.lists(v, max_size=3)
)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.dictionaries(st.sampled_from([*GOOD, "pairs", "quality", "other"]), json_values, max_size=3))
def test_any_change_of_a_message_is_taken_by_schema_and_reader_alike(changes: dict[str, Any], tmp_path: Path) -> None:
    found = read_frames(tmp_path / "a.jsonl", line(**changes))
    assert len(found.tables["frames"]) + len(found.rejected) == 1


@pytest.mark.parametrize("name", ["good", "text for a number", "no camera", "long camera", "version 2", "pair of one"])
def test_the_published_schema_agrees_with_the_reader(name: str) -> None:
    text = line().encode() if name == "good" else BAD_LINES[name][0]
    validator = jsonschema.Draft202012Validator(json_schema())
    assert validator.is_valid(json.loads(text)) == (name == "good")


def test_what_msgspec_writes_the_reader_reads(tmp_path: Path) -> None:
    message = msgspec.convert(GOOD, FrameMessage)
    assert len(read_frames(tmp_path / "a.jsonl", msgspec.json.encode(message)).tables["frames"]) == 1


@pytest.mark.parametrize("damaged", ["\x00\x00\x00\x00", 'am": "cam-1"}', '{"v', "[" * 100_000 + "\n" + "\x00"])
def test_a_damaged_first_line_is_quarantined_and_the_others_are_read(tmp_path: Path, damaged: str) -> None:
    from vsd_analytics.ingest.formats.recognise import find_adapter

    path = tmp_path / "a.jsonl"
    path.write_text(f"{damaged}\n{line()}\n")
    assert find_adapter(Source(path), IngestOptions()).name == "frames"
    found = read_frames(path, path.read_text())
    assert [f["line"] for f in found.tables["frames"]] == [damaged.count("\n") + 2]
    assert [r.line for r in found.rejected][:1] == [1]
