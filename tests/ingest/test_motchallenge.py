"""MOTChallenge text: boxes and floor metres, sequences in folders and zips, heartbeats, hostile lines and archives."""

from __future__ import annotations

import gzip
import itertools
import math
import zipfile
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsd_analytics.errors import InputError, UsageError
from vsd_analytics.ingest.formats.motchallenge import ADAPTER
from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch, Source
from vsd_analytics.schema import RAW_SCHEMAS, TABLES

START = 1_700_000_000_000
CLOCK = IngestOptions(fps=10.0, start=START)
LINES = ("1,7,100,200,40,80,1,1.5,2.5,0", "1,8,300,200,40,80,0,3.5,2.5,0", "3,-1,100.5,200,40,80,1,-1,-1,-1")


def sequence(root: Path, name: str, lines: Sequence[str] = LINES, *, kind: str = "gt", ini: str | None = None) -> Path:
    file = root / name / kind / f"{kind}.txt"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if ini is not None:
        (root / name / "seqinfo.ini").write_text(f"[Sequence]\n{ini}\n", encoding="utf-8")
    return file


def zipped(folder: Path, target: Path) -> Path:
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as packed:
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                packed.write(path, path.relative_to(folder).as_posix())
    return target


def read(path: Path, options: IngestOptions = CLOCK) -> tuple[dict[str, pa.Table], list[RawBatch]]:
    batches = list(ADAPTER.read(Source(path), options))
    return {name: pa.concat_tables([b.table(name) for b in batches]) for name in TABLES}, batches


def rejected(batches: Sequence[RawBatch]) -> list[tuple[int, str]]:
    return [(r.line, r.reason) for b in batches for r in b.rejected]


def frames(tables: dict[str, pa.Table]) -> list[tuple[int, int]]:
    return [(f["ts_ms"] - START, f["n_persons"]) for f in tables["frames"].to_pylist()]


def test_boxes_become_foot_points_and_every_frame_a_heartbeat(tmp_path: Path) -> None:
    path = sequence(tmp_path, "Hall", ini="frameRate=10\nseqLength=5")
    assert ADAPTER.detects(Source(path))
    tables, batches = read(path, IngestOptions(start=START))
    people = tables["observations"].to_pylist()
    assert [(p["ts_ms"] - START, p["person"], p["track"], p["u_px"], p["v_px"], p["line"]) for p in people] == [
        (0, 0, "7", 120.0, 280.0, 1),
        (0, 1, "8", 320.0, 280.0, 2),
        (200, 0, None, 120.5, 280.0, 3),
    ]
    assert {(p["x_m"], p["y_m"], p["camera"]) for p in people} == {(None, None, "hall")}
    assert frames(tables) == [(0, 2), (100, 0), (200, 1), (300, 0), (400, 0)]
    assert tables["frames"]["n_pairs"].null_count == 5
    assert not rejected(batches)
    assert all(tables[name].schema == RAW_SCHEMAS[name] for name in TABLES)


def test_floor_metres_are_read_only_when_asked_for(tmp_path: Path) -> None:
    path = sequence(tmp_path, "hall")
    tables, batches = read(path, IngestOptions(fps=10.0, start=START, coordinates="floor"))
    people = tables["observations"].to_pylist()
    assert [(p["x_m"], p["y_m"], p["u_px"], p["quality"]) for p in people] == [
        (1.5, 2.5, None, "metric"),
        (3.5, 2.5, None, "metric"),
    ]
    assert rejected(batches) == [(3, "no-floor-position")]
    assert frames(tables) == [(0, 2), (100, 0), (200, 1)], "a person who cannot be placed was still seen"


def test_class_and_visibility_are_not_floor_metres(tmp_path: Path) -> None:
    path = sequence(tmp_path, "hall", ["1,7,100,200,40,80,1,1,0.9"])
    with pytest.raises(InputError) as caught:
        read(path, IngestOptions(fps=10.0, start=START, coordinates="floor"))
    assert caught.value.code == "E208"


def test_what_is_no_pedestrian_in_nine_columns_is_left_out_and_counted(tmp_path: Path) -> None:
    lines = ["1,1,0,0,9,9,1,1,0.5", "1,2,0,0,9,9,0,1,0.5", "1,3,0,0,9,9,1,3,0.5", "2,4,0,0,9,9,1,7,1"]
    tables, batches = read(sequence(tmp_path, "hall", lines))
    assert tables["observations"]["track"].to_pylist() == ["1"]
    assert [dict(b.n_dropped) for b in batches if b.n_dropped] == [{"ignored box (flag 0)": 1, "not a pedestrian": 2}]
    assert frames(tables) == [(0, 1), (100, 0)]


def test_a_zero_score_in_detections_or_ten_columns_is_a_person(tmp_path: Path) -> None:
    nine = sequence(tmp_path, "a", ["1,-1,0,0,9,9,0,3,0.5"], kind="det")
    assert read(nine)[0]["observations"].num_rows == 1
    ten = sequence(tmp_path, "b", ["1,5,0,0,9,9,0,-1,-1,-1"])
    assert read(ten)[0]["observations"].num_rows == 1


def test_persons_are_numbered_within_frames_also_when_sorted_by_track(tmp_path: Path) -> None:
    lines = [f"{frame},{track},0,0,9,9,1,-1,-1,-1" for track in (1, 2, 3) for frame in (1, 2)]
    tables, _ = read(sequence(tmp_path, "hall", lines))
    assert [(p["ts_ms"] - START, p["person"]) for p in tables["observations"].to_pylist()] == [
        (0, 0), (100, 0), (0, 1), (100, 1), (0, 2), (100, 2),
    ]  # fmt: skip
    assert frames(tables) == [(0, 3), (100, 3)]


@pytest.mark.parametrize(
    "options", [IngestOptions(fps=10.0), IngestOptions(start=START), IngestOptions(start=START, fps=math.nan)]
)
def test_without_rate_or_start_it_says_what_to_give(tmp_path: Path, options: IngestOptions) -> None:
    with pytest.raises(InputError, match="does not say") as caught:
        read(sequence(tmp_path, "hall"), options)
    assert caught.value.code == "E207"
    assert "--hz" in (caught.value.fix or "")


def test_the_user_overrules_rate_and_first_frame(tmp_path: Path) -> None:
    path = sequence(tmp_path, "hall", ["11,1,0,0,9,9"], ini="frameRate=25")
    tables, _ = read(path, IngestOptions(fps=2.0, start=START, first_frame=11.0))
    assert tables["observations"]["ts_ms"].to_pylist() == [START]
    assert tables["frames"]["ts_ms"].to_pylist()[0] == START - 5000


def test_a_tracker_that_counts_from_zero_keeps_its_first_frame(tmp_path: Path) -> None:
    path = sequence(tmp_path, "hall", ["0,1,0,0,9,9", "2,1,0,0,9,9"], ini="frameRate=10\nseqLength=4")
    tables, batches = read(path, IngestOptions(start=START, first_frame=0.0))
    assert frames(tables) == [(0, 1), (100, 0), (200, 1), (300, 0)]
    assert not rejected(batches)


@pytest.mark.parametrize("packed", [False, True])
def test_every_sequence_becomes_the_camera_of_its_name(tmp_path: Path, packed: bool) -> None:
    root = tmp_path / "set"
    sequence(root, "train/MOT16 02")
    sequence(root, "train/MOT16 02", ["9,1,0,0,9,9"], kind="det")
    sequence(root, "test/Ümlaut<script>", ["1,-1,0,0,9,9"], kind="det", ini="frameRate=5\nseqLength=2")
    source = Source(zipped(root, tmp_path / "set.zip") if packed else root)
    assert ADAPTER.detects(source)
    tables, _ = read(source.path)
    assert [(f["camera"], f["n_persons"]) for f in tables["frames"].to_pylist()] == [
        ("mlaut-script", 1), ("mlaut-script", 0), ("mot16-02", 2), ("mot16-02", 0), ("mot16-02", 1),
    ]  # fmt: skip
    for name in ("mot16-02", "MOT16 02"):
        chosen, _ = read(source.path, IngestOptions(fps=10.0, start=START, camera=name))
        assert set(chosen["frames"]["camera"].to_pylist()) == {name}
        assert chosen["observations"].num_rows == 3
    with pytest.raises(UsageError, match="2 sequences") as caught:
        read(source.path, IngestOptions(fps=10.0, start=START, camera="lobby"))
    assert "mot16-02" in (caught.value.why or "")


def test_the_only_sequence_takes_the_camera_given(tmp_path: Path) -> None:
    sequence(tmp_path, "Hall")
    for path in (tmp_path / "Hall", tmp_path, zipped(tmp_path / "Hall", tmp_path / "Hall.zip")):
        assert set(read(path)[0]["frames"]["camera"].to_pylist()) == {"hall"}
        tables, _ = read(path, IngestOptions(fps=10.0, start=START, camera="lobby"))
        assert set(tables["frames"]["camera"].to_pylist()) == {"lobby"}


def test_sequences_without_floor_metres_are_named_and_left_out(tmp_path: Path) -> None:
    sequence(tmp_path, "with")
    sequence(tmp_path, "without", ["1,1,0,0,9,9,1,-1,-1,-1"])
    tables, batches = read(tmp_path, IngestOptions(fps=10.0, start=START, coordinates="floor"))
    assert set(tables["frames"]["camera"].to_pylist()) == {"with"}
    (note,) = [n for b in batches for n in b.notes]
    assert note.startswith("W208: without ")


BAD = [
    ("not-a-number", "1,1,x,0,9,9"), ("not-a-number", "1,1,nan,0,9,9"), ("not-a-number", "1,1,1_0,0,9,9"),
    ("not-a-number", "1,1,0,0,inf,9"), ("not-a-number", "one,1,0,0,9,9"), ("bad-frame", "0,1,0,0,9,9"),
    ("bad-frame", "1.5,1,0,0,9,9"), ("bad-frame", "1e9,1,0,0,9,9"), ("too-few-columns", "1,1,0,0,9"),
    ("bad-box", "1,1,0,0,0,9"), ("bad-box", "1,1,0,0,9,-9"), ("line-too-long", "1,1,0,0,9,9," + "1" * 1_000_001),
]  # fmt: skip


@pytest.mark.parametrize(("reason", "line"), [pytest.param(*b, id=f"{b[0]}-{i}") for i, b in enumerate(BAD)])
def test_a_bad_line_is_quarantined_and_its_neighbours_stay(tmp_path: Path, reason: str, line: str) -> None:
    tables, batches = read(sequence(tmp_path, "hall", ["1,1,0,0,9,9", line, "", "2,1,0,0,9,9"]))
    assert rejected(batches) == [(2, reason)]
    assert tables["observations"]["line"].to_pylist() == [1, 4]
    assert tables["frames"].num_rows == 2


@settings(max_examples=50, deadline=None)
@given(text=st.text(alphabet="0123456789.,-+eE nai\n\r_x", max_size=300))
def test_no_text_makes_it_fall_over(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("any") / "gt.txt"
    path.write_bytes(text.encode())
    tables, batches = read(path, IngestOptions(fps=10.0, start=START, camera="c"))
    used = tables["observations"]["line"].to_pylist() + [line for line, _ in rejected(batches)]
    assert len(used) == len(set(used)) <= 1 + text.count("\n") + text.count("\r")


def test_batches_are_bounded_and_add_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = sequence(tmp_path, "hall", [f"{f},{p},0,0,9,9" for f in range(1, 51) for p in range(5)], ini="seqLength=130")
    whole, _ = read(path)
    monkeypatch.setattr("vsd_analytics.ingest.formats.motchallenge.BATCH_ROWS", 40)
    tables, batches = read(path)
    assert max(b.table(name).num_rows for b in batches for name in TABLES) == 40
    assert all(tables[name].equals(whole[name]) for name in TABLES)
    done = [b.done_bytes for b in batches]
    assert done[-1] == path.stat().st_size


def test_what_follows_damage_is_unknown_not_empty(tmp_path: Path) -> None:
    lines = [f"{f},{p},{(f * 7919 + p * 31) % 997},{(f * 31) % 89},9,9" for f in range(1, 3000) for p in range(3)]
    whole = sequence(tmp_path, "hall", lines, ini="frameRate=10\nseqLength=9000")
    packed = gzip.compress(whole.read_bytes(), mtime=0)
    cut = whole.with_name("gt.txt.gz")
    cut.write_bytes(packed[: len(packed) // 2])
    assert ADAPTER.detects(Source(cut))
    kept: list[pa.Table] = []
    with pytest.raises(InputError) as caught:
        kept.extend(batch.table("frames") for batch in ADAPTER.read(Source(cut), CLOCK))
    assert caught.value.code == "E205"
    counts = pa.concat_tables(kept)["n_persons"].to_pylist()
    assert 100 < len(counts) < 2999
    assert set(counts[:-1]) == {3}


def test_a_zip_bomb_is_refused_before_it_is_read(tmp_path: Path) -> None:
    sequence(tmp_path / "set", "hall", ["1,1,0,0,9,9" + " " * 900_000] * 5)
    with pytest.raises(InputError) as caught:
        read(zipped(tmp_path / "set", tmp_path / "set.zip"))
    assert caught.value.code == "E206"


@pytest.mark.parametrize("damage", ["cut", "body", "encrypted"])
def test_a_damaged_zip_is_an_input_error(tmp_path: Path, damage: str) -> None:
    sequence(tmp_path / "set", "hall", [f"{f},1,{f * 7919 % 997},0,9,9" for f in range(1, 2000)])
    path = zipped(tmp_path / "set", tmp_path / "set.zip")
    data = bytearray(path.read_bytes())
    if damage == "cut":
        data = data[: len(data) // 2]
    elif damage == "body":
        data[2000:2100] = bytes(100)
    else:
        for mark in (data.index(b"PK\x03\x04") + 6, data.index(b"PK\x01\x02") + 8):
            data[mark] |= 1
    path.write_bytes(data)
    with pytest.raises(InputError) as caught:
        read(path)
    assert caught.value.code == "E205"


@pytest.mark.parametrize("name", ["gt.txt", "positions.csv", "det.csv"])
@pytest.mark.parametrize("line", ["1351038020.969,9190600,-37.2,-3.1,0.9,2.7", "frame,id,x,y,w,h", '{"v":1}', ""])
def test_other_files_are_not_claimed(tmp_path: Path, name: str, line: str) -> None:
    path = tmp_path / name
    path.write_text(line + "\n")
    assert not ADAPTER.detects(Source(path))
    assert not ADAPTER.detects(Source(tmp_path))


def test_an_archive_without_sequences_is_neither_claimed_nor_read(tmp_path: Path) -> None:
    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "notes.txt").write_text("1,1,0,0,9,9\n")
    path = zipped(tmp_path / "set", tmp_path / "set.zip")
    assert not ADAPTER.detects(Source(path))
    with pytest.raises(InputError) as caught:
        read(path)
    assert caught.value.code == "E204"


@pytest.mark.realdata
@pytest.mark.parametrize(
    ("name", "fps", "n_frames", "n_persons", "n_close"),
    [("PETS09-S2L1", 7.0, 795, 4650, 1072), ("TUD-Stadtmitte", 25.0, 179, 1156, 479)],
)
def test_published_sequences_have_their_known_counts(
    realdata: Callable[[str], Path], name: str, fps: float, n_frames: int, n_persons: int, n_close: int
) -> None:
    path = realdata("pets_mot/3DMOT2015Labels.zip")
    assert ADAPTER.detects(Source(path))
    options = IngestOptions(fps=fps, start=START, camera=name.lower(), coordinates="floor")
    tables, batches = read(path, options)
    assert (tables["frames"].num_rows, tables["observations"].num_rows) == (n_frames, n_persons)
    at = defaultdict(list)
    for p in tables["observations"].to_pylist():
        at[p["ts_ms"]].append((round(p["x_m"] * 1000), round(p["y_m"] * 1000)))
    squares = [
        (ax - bx) ** 2 + (ay - by) ** 2
        for people in at.values()
        for (ax, ay), (bx, by) in itertools.combinations(people, 2)
    ]
    assert sum(square < 2000**2 for square in squares) == n_close
    assert not rejected(batches)


def test_objects_of_visdrone_are_no_pedestrians(tmp_path: Path) -> None:
    kinds = (1, 4, 2, 0, 1)
    lines = [f"1,{k},{100 + 50 * k},200,40,80,1,{kind},{k % 2},{k % 3}" for k, kind in enumerate(kinds)]
    tables, batches = read(sequence(tmp_path, "Hall", lines))
    assert tables["observations"]["track"].to_pylist() == ["0", "2", "4"]
    assert sum(b.n_dropped.get("not a pedestrian", 0) for b in batches) == 2
    assert frames(tables) == [(0, 3)]


@pytest.mark.parametrize("rest", ["0,0,0", "-1,-1,-1", "{},1.5,0", "{},1,3", "{},2,0", "{}.5,1,0", "{}0,1,0"])
def test_other_lines_of_ten_columns_have_no_category(rest: str, tmp_path: Path) -> None:
    lines = [f"1,{k},{100 + 50 * k},200,40,80,0.9,{rest.format(kind)}" for k, kind in enumerate((1, 4, 2))]
    lines.append(f"1,9,600,200,40,80,0.9,{'1,1,0' if rest == '{}0,1,0' else rest.format(1)}")
    tables, _ = read(sequence(tmp_path, "Hall", lines))
    assert tables["observations"].num_rows == 4
