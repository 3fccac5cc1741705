"""Object logs of smart-social-distancing, against a naive engine written here with plain loops."""

from __future__ import annotations

import gzip
import itertools
import math
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path

import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vsd_analytics.errors import InputError, UsageError
from vsd_analytics.ingest.formats.body_distance import EngineSetting, LoggedFrame, Pairs
from vsd_analytics.ingest.formats.smart_social_distancing import ADAPTER
from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch, Source
from vsd_analytics.schema import RAW_SCHEMAS, TABLES

HEADER = "Version,Timestamp,DetectedObjects,ViolatingObjects,EnvironmentScore,Detections,ViolationsIndexes"
Box = tuple[float, float, float, float]


def naive_cm(a: Box, b: Box, *, width: int, height: int, method: str) -> float:
    ax0, ay0, ax1, ay1 = a[0] * width, a[1] * height, a[2] * width, a[3] * height
    bx0, by0, bx1, by1 = b[0] * width, b[1] * height, b[2] * width, b[3] * height
    scale = 170 * (1 / (ay1 - ay0) + 1 / (by1 - by0)) / 2
    if method == "center-points":
        return math.dist(((ax0 + ax1) / 2, (ay0 + ay1) / 2), ((bx0 + bx1) / 2, (by0 + by1) / 2)) * scale
    corners = (((ax0, ay0), (bx0, by0)), ((ax1, ay0), (bx1, by0)), ((ax0, ay1), (bx0, by1)), ((ax1, ay1), (bx1, by1)))
    return min(math.dist(p, q) for p, q in corners) * scale


def log_row(
    time: str, boxes: Sequence[Box], *, width: int = 640, height: int = 480, method: str = "center-points",
    threshold_cm: float = 150, ids: Sequence[object] | None = None, wrap: bool = False,
) -> str:  # fmt: skip
    close = [
        (i, j)
        for i, j in itertools.combinations(range(len(boxes)), 2)
        if naive_cm(boxes[i], boxes[j], width=width, height=height, method=method) < threshold_cm
    ]
    people = [
        {"position": [0.0, 0.0, 0.0], "bbox": list(box), "tracking_id": ids[i] if ids else f"1-{i}"}
        for i, box in enumerate(boxes)
    ]
    text = str(people)
    if wrap:
        for value in {v for box in boxes for v in box}:
            text = text.replace(repr(value), f"np.float32({value!r})")
    violators = sorted({i for pair in close for i in pair})
    return f'1.0,{time},{len(boxes)},{len(close)},0.9,"{text}","{violators}"'


def write(folder: Path, rows: Sequence[str], *, header: str = HEADER, camera: str = "hall") -> Path:
    path = folder / camera / "objects_log" / "2026-01-05.csv"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    return path


def read(path: Path, options: IngestOptions | None = None) -> tuple[dict[str, pa.Table], list[RawBatch]]:
    batches = list(ADAPTER.read(Source(path), options or IngestOptions()))
    return {name: pa.concat_tables([b.table(name) for b in batches]) for name in TABLES}, batches


def notes(batches: Sequence[RawBatch]) -> list[str]:
    return [n for b in batches for n in b.notes]


def rejected(batches: Sequence[RawBatch]) -> list[tuple[int, str]]:
    return [(r.line, r.reason) for b in batches for r in b.rejected]


NEAR: tuple[Box, Box] = ((0.2, 0.2, 0.3, 0.6), (0.28, 0.2, 0.38, 0.6))
FAR: Box = (0.8, 0.2, 0.9, 0.6)
boxes_strategy = st.lists(
    st.tuples(*(st.floats(0, 0.8), st.floats(0, 0.6), st.floats(0.02, 0.2), st.floats(0.05, 0.4))).map(
        lambda v: (v[0], v[1], v[0] + v[2], v[1] + v[3])
    ),
    max_size=6,
)


@settings(max_examples=60, deadline=None)
@given(
    boxes=boxes_strategy, method=st.sampled_from(["center-points", "four-corner"]), width=st.sampled_from([300, 640])
)
def test_distances_are_those_of_a_plain_loop(boxes: list[Box], method: str, width: int) -> None:
    import numpy as np

    pairs = Pairs.of([LoggedFrame(np.array(boxes).reshape(-1, 4), 0, None)] * 2)
    metres = pairs.distances_m(EngineSetting(method, (width, 480), 1.5))
    expected = [
        naive_cm(boxes[i], boxes[j], width=width, height=480, method=method) / 100
        for i, j in itertools.combinations(range(len(boxes)), 2)
    ] * 2
    assert metres.tolist() == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_rows_become_heartbeats_foot_points_and_pairs(tmp_path: Path) -> None:
    path = write(tmp_path, [log_row("2026-01-05 09:00:00", [*NEAR, FAR]), log_row("2026-01-05 09:00:01", [])])
    assert ADAPTER.detects(Source(path))
    tables, batches = read(path)
    start = int(datetime(2026, 1, 5, 9, tzinfo=UTC).timestamp() * 1000)
    assert [
        (f["camera"], f["ts_ms"], f["n_persons"], f["n_pairs"], f["line"]) for f in tables["frames"].to_pylist()
    ] == [
        ("hall", start, 3, 1, 2),
        ("hall", start + 1000, 0, 0, 3),
    ]
    first = tables["observations"].to_pylist()[0]
    assert (first["u_px"], first["v_px"]) == pytest.approx((0.25 * 640, 0.6 * 480))
    assert (first["x_m"], first["track"], first["quality"]) == (None, None, "relative")
    (pair,) = tables["pairs"].to_pylist()
    assert (pair["person_a"], pair["person_b"], pair["quality"], pair["x_a_m"]) == (0, 1, "body", None)
    assert pair["distance_m"] == pytest.approx(170 / (0.4 * 480) * 0.08 * 640 / 100)
    assert notes(batches) == ["info: pairs rebuilt from boxes agree with the log in 2 of 2 rows"]
    assert all(tables[name].schema == RAW_SCHEMAS[name] for name in TABLES)


def test_pairs_beyond_the_threshold_are_stored_up_to_pair_max(tmp_path: Path) -> None:
    at = [(x, 0.2, x + 0.1, 0.6) for x in (0.0, 0.3, 0.75)]
    tables, _ = read(write(tmp_path, [log_row("2026-01-05 09:00:00", at)]))
    assert any(p["distance_m"] > 1.5 for p in tables["pairs"].to_pylist())
    kept = {(p["person_a"], p["person_b"]) for p in tables["pairs"].to_pylist()}
    expected = {
        (i, j)
        for i, j in itertools.combinations(range(3), 2)
        if naive_cm(at[i], at[j], width=640, height=480, method="center-points") < 250
    }
    assert kept == expected


def test_tracked_ids_are_stored_and_fallback_ids_are_not(tmp_path: Path) -> None:
    tables, _ = read(write(tmp_path, [log_row("2026-01-05 09:00:00", [*NEAR, FAR], ids=["1-0", 17, "walker-3"])]))
    assert tables["observations"]["track"].to_pylist() == [None, "17", "walker-3"]
    assert [(p["track_a"], p["track_b"]) for p in tables["pairs"].to_pylist()] == [(None, "17")]


def test_numpy_wrappers_change_nothing(tmp_path: Path) -> None:
    plain, _ = read(write(tmp_path, [log_row("2026-01-05 09:00:00", [*NEAR, FAR])]))
    wrapped, batches = read(write(tmp_path, [log_row("2026-01-05 09:00:00", [*NEAR, FAR], wrap=True)]))
    assert "np.float32" in (tmp_path / "hall/objects_log/2026-01-05.csv").read_text()
    assert not rejected(batches)
    assert all(plain[name].equals(wrapped[name]) for name in TABLES)


def test_rows_sharing_a_second_are_spread_over_it(tmp_path: Path) -> None:
    seconds = ["00", "00", "00", "01", "02", "02"]
    tables, _ = read(write(tmp_path, [log_row(f"2026-01-05 09:00:{s}", []) for s in seconds]))
    offsets = [t - tables["frames"]["ts_ms"][0].as_py() for t in tables["frames"]["ts_ms"].to_pylist()]
    assert offsets == [0, 333, 666, 1000, 2000, 2500]


def test_times_are_local_to_the_camera_clock_and_a_repeated_hour_stays_two(tmp_path: Path) -> None:
    times = [
        "2026-10-25 01:59:00",
        "2026-10-25 02:30:00",
        "2026-10-25 02:00:00",
        "2026-10-25 02:30:00",
        "2026-10-25 03:00:00",
    ]
    tables, _ = read(write(tmp_path, [log_row(t, []) for t in times]), IngestOptions(frame_zone="Europe/Zurich"))
    utc = [datetime.fromtimestamp(t / 1000, tz=UTC).strftime("%H:%M") for t in tables["frames"]["ts_ms"].to_pylist()]
    assert utc == ["23:59", "00:30", "01:00", "01:30", "02:00"]


@pytest.mark.parametrize(
    ("engine", "said"),
    [
        ({"width": 1280, "height": 720}, "--method center-points --resolution 1280x720 --threshold 1.5"),
        ({"method": "four-corner"}, "--method four-corner --resolution 640x480 --threshold 1.5"),
        ({"threshold_cm": 200}, "--method center-points --resolution 640x480 --threshold 2"),
    ],
)
def test_a_wrong_setting_is_named_with_the_right_one(tmp_path: Path, engine: dict[str, object], said: str) -> None:
    import numpy as np

    random = np.random.default_rng(3)
    rows = []
    for second in range(50):
        corners = random.uniform(0, 0.7, (6, 2))
        sizes = random.uniform((0.03, 0.2), (0.15, 0.3), (6, 2))
        boxes = [tuple(float(v) for v in (*c, *(c + s))) for c, s in zip(corners, sizes, strict=True)]
        rows.append(log_row(f"2026-01-05 09:00:{second:02}", boxes, **engine))  # type: ignore[arg-type]
    (note,) = notes(read(write(tmp_path, rows))[1])
    assert note.startswith("W209: pairs rebuilt from boxes agree with the log in ")
    assert (
        f"of 50 rows (--method center-points --resolution 640x480 --threshold 1.5); set {said}, which agrees in 50 of"
        in note
    )


def test_the_same_persons_in_other_pairs_disagree_by_number(tmp_path: Path) -> None:
    row = log_row("2026-01-05 09:00:00", [*NEAR, FAR])
    wrong_count = row.replace(",3,1,0.9", ",3,2,0.9")
    wrong_person = row.replace('"[0, 1]"', '"[0, 2]"')
    assert row not in (wrong_count, wrong_person)
    for bad in (wrong_count, wrong_person):
        (note,) = notes(read(write(tmp_path, [row, bad]))[1])
        assert "in 1 of 2 rows" in note


def test_logs_without_indexes_are_checked_by_number(tmp_path: Path) -> None:
    row = log_row("2026-01-05 09:00:00", [*NEAR, FAR]).rpartition(',"')[0]
    tables, batches = read(write(tmp_path, [row], header=HEADER.rpartition(",")[0]))
    assert tables["pairs"].num_rows == 1
    assert notes(batches) == ["info: pairs rebuilt from boxes agree with the log in 1 of 1 rows"]


GOOD = log_row("2026-01-05 09:00:00", [*NEAR])
HOSTILE = {
    "bad-literal": [
        GOOD.replace("[{", "[" * 5000 + "{"),
        GOOD.replace("[{", "__import__('os').system('true') or [{"),
        GOOD.replace("[{", "-" * 200_000 + "1 or [{"),
        GOOD.replace("0.2,", "nan,", 1),
        GOOD.replace("[{", "1" + "+1" * 100_000 + " or [{"),
        GOOD.replace('"[{', '"{}, [{'),
    ],
    "bad-box": [GOOD.replace("0.2,", "1e999,", 1), GOOD.replace("'bbox'", "'box'"), GOOD.replace("0.6]", "0.2]", 1)],
    "bad-time": [GOOD.replace("2026-01-05 09:00:00", "2026-02-30 09:00:00"), GOOD.replace("2026-01", "0001-01-01", 1)],
    "not-a-number": [
        GOOD.replace(",2,", ",two,", 1),
        GOOD.replace(",1,0.9", ",-1,0.9"),
        GOOD.replace(",1,0.9", f",{'9' * 30},0.9"),
    ],
    "count-mismatch": [GOOD.replace(",2,", ",3,", 1)],
    "bad-index": [GOOD.replace("[0, 1]", "[0, 2]"), GOOD.replace("[0, 1]", "[-1]")],
    "bad-track": [
        GOOD.replace("'1-0'", "[1]"),
        GOOD.replace("'1-0'", r"'\ud800'"),
        GOOD.replace("'1-0'", "0x" + "f" * 9000),
    ],
    "wrong-number-of-cells": [GOOD + ",more", "1.0"],
    "bad-csv": [GOOD[:-1], GOOD.replace('"[{', '"[{"')],
    "line-too-long": [GOOD.replace("[{", "[" + " " * 1_000_000 + "{")],
}


@pytest.mark.parametrize(
    ("reason", "row"),
    [pytest.param(reason, row, id=f"{reason}-{i}") for reason, rows in HOSTILE.items() for i, row in enumerate(rows)],
)
def test_a_bad_row_is_quarantined_and_its_neighbours_stay(tmp_path: Path, reason: str, row: str) -> None:
    assert row != GOOD
    later = GOOD.replace("09:00:00", "09:00:05")
    tables, batches = read(write(tmp_path, [GOOD, row, later]))
    assert rejected(batches) == [(3, reason)]
    assert tables["frames"]["line"].to_pylist() == [2, 4]
    assert tables["pairs"].num_rows == 2


def test_too_many_people_or_rows_are_quarantined(tmp_path: Path) -> None:
    crowd = '1.0,2026-01-05 09:00:00,1001,0,0,"' + str([{"bbox": [0, 0, 1, 1]}] * 1001) + '","[]"'
    empty = log_row("2026-01-05 09:00:07", [])
    tables, batches = read(write(tmp_path, [crowd, *[empty] * 1003]))
    assert [r for _, r in rejected(batches)] == ["too-many", *["too-many-in-a-second"] * 3]
    assert len(set(tables["frames"]["ts_ms"].to_pylist())) == 1000


def test_large_logs_come_in_batches_of_bounded_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vsd_analytics.ingest.formats.smart_social_distancing.BATCH_ROWS", 100)
    path = write(tmp_path, [log_row(f"2026-01-05 09:{m:02}:{s:02}", [*NEAR, FAR]) for m in range(2) for s in range(60)])
    tables, batches = read(path)
    assert max(b.table("pairs").num_rows for b in batches) <= 110
    assert len(batches) >= 4
    assert tables["frames"].num_rows == 120
    assert notes(batches) == ["info: pairs rebuilt from boxes agree with the log in 120 of 120 rows"]


def test_rows_before_damage_are_stored(tmp_path: Path) -> None:
    rows = [
        log_row(f"2026-01-05 09:{m:02}:{s:02}", [*NEAR, (0.5, 0.1, 0.6 + s / 997, 0.4 + m / 991)])
        for m in range(20)
        for s in range(60)
    ]
    path = write(tmp_path, rows)
    whole, _ = read(path)
    cut = path.with_suffix(".csv.gz")
    packed = gzip.compress(path.read_bytes(), mtime=0)
    cut.write_bytes(packed[: len(packed) // 2])
    kept: list[pa.Table] = []
    with pytest.raises(InputError) as caught:
        kept.extend(batch.table("frames") for batch in ADAPTER.read(Source(cut), IngestOptions()))
    assert caught.value.code == "E205"
    frames = pa.concat_tables(kept)
    assert 100 < frames.num_rows < whole["frames"].num_rows
    assert frames.slice(0, frames.num_rows - 1).equals(whole["frames"].slice(0, frames.num_rows - 1))


def test_a_missing_column_names_the_nearest(tmp_path: Path) -> None:
    path = write(tmp_path, [GOOD], header=HEADER.replace("Detections", "Detection"))
    with pytest.raises(InputError, match="no column Detections") as caught:
        read(path)
    assert (caught.value.code, caught.value.why) == ("E203", "nearest found: Detection")


@pytest.mark.parametrize(
    "options",
    [
        IngestOptions(method="centre"),
        IngestOptions(resolution_px=(0, 480)),
        IngestOptions(threshold_m=-1.0),
        IngestOptions(frame_zone="../../etc/passwd"),
    ],
)
def test_impossible_options_are_refused(tmp_path: Path, options: IngestOptions) -> None:
    with pytest.raises(UsageError):
        read(write(tmp_path, [GOOD]), options)


def test_a_log_folder_gives_each_camera_its_own_rows(tmp_path: Path) -> None:
    write(tmp_path, [GOOD], camera="door")
    write(tmp_path, [GOOD, GOOD], camera="till")
    assert ADAPTER.detects(Source(tmp_path))
    tables, _ = read(tmp_path)
    assert tables["frames"]["camera"].to_pylist() == ["door", "till", "till"]
    given_name, _ = read(tmp_path / "door", IngestOptions(camera="entrance"))
    assert given_name["frames"]["camera"].to_pylist() == ["entrance"]


def test_a_log_outside_its_folder_names_no_camera(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(f"{HEADER}\n{GOOD}\n")
    assert read(path)[0]["frames"]["camera"].to_pylist() == [None]


def test_other_tables_are_not_claimed(tmp_path: Path) -> None:
    path = tmp_path / "objects_log" / "positions.csv"
    path.parent.mkdir()
    path.write_text("1351038020.969,9190600,-37.2,-3.1,0.9,2.7\n")
    assert not ADAPTER.detects(Source(path))
    assert not ADAPTER.detects(Source(tmp_path))


@pytest.mark.realdata
def test_the_published_log_agrees_in_every_row(realdata: Callable[[str], Path]) -> None:
    path = realdata("smart_social_distancing/default/objects_log/2020-12-09.csv")
    tables, batches = read(path)
    assert notes(batches) == ["info: pairs rebuilt from boxes agree with the log in 1,044 of 1,044 rows"]
    assert (tables["frames"].num_rows, tables["observations"].num_rows) == (1044, 4067)
    assert sum(d < 1.5 for d in tables["pairs"]["distance_m"].to_pylist()) == 954
    assert len(set(tables["frames"]["ts_ms"].to_pylist())) == 1044
    assert set(tables["frames"]["camera"].to_pylist()) == {"default"}
    assert not rejected(batches)


@pytest.mark.realdata
def test_the_published_log_at_a_wrong_aspect_says_what_to_set(realdata: Callable[[str], Path]) -> None:
    path = realdata("smart_social_distancing/default/objects_log/2020-12-09.csv")
    (note,) = notes(read(path, IngestOptions(resolution_px=(1280, 720)))[1])
    assert "in 810 of 1,044 rows" in note
    assert (
        "set --method center-points --resolution 640x480 --threshold 1.5, which agrees in 300 of the first 300" in note
    )
