"""WILDTRACK annotations: grid cells to metres, one virtual camera, every file a heartbeat."""

from __future__ import annotations

import gzip
import io
import itertools
import json
import tarfile
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pyarrow as pa
import pytest

from vsd_analytics.errors import InputError
from vsd_analytics.ingest.formats.wildtrack import ADAPTER
from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch, Source
from vsd_analytics.schema import RAW_SCHEMAS, TABLES

START = 1_700_000_000_000
CLOCK = IngestOptions(start=START)


def person(identity: object, cell: object) -> dict[str, object]:
    return {
        "personID": identity,
        "positionID": cell,
        "views": [{"viewNum": 0, "xmin": 1, "ymin": 1, "xmax": 2, "ymax": 2}],
    }


FILES: Mapping[str, bytes] = {
    "00000000.json": json.dumps([person(4, 0), person(5, 480 * 1440 - 1)]).encode(),
    "00000005.json": b"[]",
    "00000010.json": json.dumps([person(4, 481)]).encode(),
}


def folder(root: Path, files: Mapping[str, bytes] = FILES) -> Path:
    path = root / "annotations_positions"
    path.mkdir(parents=True)
    for name, data in files.items():
        (path / name).write_bytes(data)
    return path


def tarred(path: Path, files: Mapping[str, bytes] = FILES, *, mode: str = "w:gz") -> Path:
    with tarfile.open(path, mode) as packed:  # type: ignore[call-overload]
        for name, data in files.items():
            info = tarfile.TarInfo(f"annotations_positions/{name}")
            info.size = len(data)
            packed.addfile(info, io.BytesIO(data))
    return path


def read(path: Path, options: IngestOptions = CLOCK) -> tuple[dict[str, pa.Table], list[RawBatch]]:
    batches = list(ADAPTER.read(Source(path), options))
    return {name: pa.concat_tables([b.table(name) for b in batches]) for name in TABLES}, batches


def rejected(batches: Sequence[RawBatch]) -> list[tuple[int, str]]:
    return [(r.line, r.reason) for b in batches for r in b.rejected]


@pytest.mark.parametrize("kind", ["folder", "parent", "tar.gz", "tar"])
def test_cells_become_metres_and_files_heartbeats(tmp_path: Path, kind: str) -> None:
    inner = folder(tmp_path / "set")
    path = {"folder": inner, "parent": inner.parent}.get(kind) or tarred(
        tmp_path / f"a.{kind}", mode="w:gz" if kind == "tar.gz" else "w"
    )
    assert ADAPTER.detects(Source(path))
    tables, batches = read(path)
    assert [(f["camera"], f["ts_ms"] - START, f["n_persons"], f["n_pairs"]) for f in tables["frames"].to_pylist()] == [
        ("wildtrack", 0, 2, None),
        ("wildtrack", 500, 0, None),
        ("wildtrack", 1000, 1, None),
    ]
    people = tables["observations"].to_pylist()
    assert [(p["track"], round(p["x_m"] * 1000), round(p["y_m"] * 1000), p["quality"]) for p in people] == [
        ("4", -3000, -9000, "metric"),
        ("5", 8975, 26975, "metric"),
        ("4", -2975, -8975, "metric"),
    ]
    assert not rejected(batches)
    assert all(tables[name].schema == RAW_SCHEMAS[name] for name in TABLES)


def test_rate_first_frame_and_camera_are_the_users(tmp_path: Path) -> None:
    tables, _ = read(folder(tmp_path), IngestOptions(start=START, fps=2.0, first_frame=10.0, camera="square"))
    assert {f["camera"]: f["ts_ms"] for f in tables["frames"].to_pylist()} == {"square": START}
    assert tables["frames"]["ts_ms"].to_pylist() == [START - 5000, START - 2500, START]


@pytest.mark.parametrize("options", [IngestOptions(), IngestOptions(start=START, fps=0.0)])
def test_without_a_usable_clock_it_says_what_to_give(tmp_path: Path, options: IngestOptions) -> None:
    with pytest.raises(InputError) as caught:
        read(folder(tmp_path), options)
    assert caught.value.code == "E207"


@pytest.mark.parametrize(
    ("reason", "data"),
    [
        pytest.param("bad-json", b'[{"personID": 4, "posit', id="cut"),
        pytest.param("bad-json", b"[" * 200_000, id="nested"),
        pytest.param("bad-json", b"\xff\xfe\x00", id="not-utf-8"),
        pytest.param("bad-json", b"", id="empty"),
        pytest.param("bad-file", b'{"personID": 4}', id="no-list"),
        pytest.param("file-too-long", b"[" + b" " * (1 << 20) + b"]", id="too-long"),
    ],
)
@pytest.mark.parametrize("packed", [False, True])
def test_an_unreadable_file_is_quarantined_and_claims_no_empty_frame(
    tmp_path: Path, reason: str, data: bytes, packed: bool
) -> None:
    files = {**FILES, "00000005.json": data}
    tables, batches = read(tarred(tmp_path / "a.tar.gz", files) if packed else folder(tmp_path, files))
    assert rejected(batches) == [(2, reason)]
    assert [t - START for t in tables["frames"]["ts_ms"].to_pylist()] == [0, 1000]


@pytest.mark.parametrize(
    "bad",
    [
        person(4, -1),
        person(4, 480 * 1440),
        person(4, 1.0),
        person("4", 1),
        person(True, 1),
        person(10**30, 1),
        [],
        None,
        {},
    ],
)
def test_a_person_off_the_grid_is_quarantined_but_was_seen(tmp_path: Path, bad: object) -> None:
    files = {"00000000.json": json.dumps([person(1, 1), bad, person(2, 2)]).encode()}
    tables, batches = read(folder(tmp_path, files))
    assert rejected(batches) == [(1, "bad-position")]
    assert tables["observations"]["track"].to_pylist() == ["1", "2"]
    assert tables["frames"]["n_persons"].to_pylist() == [3]


def test_files_before_damage_are_stored(tmp_path: Path) -> None:
    files = {
        f"{n * 5:08}.json": json.dumps([person(p, (n * 7919 + p * 104729) % 691200) for p in range(30)]).encode()
        for n in range(100)
    }
    path = tarred(tmp_path / "a.tar.gz", files)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    kept: list[pa.Table] = []
    with pytest.raises(InputError) as caught:
        kept.extend(b.table("frames") for b in ADAPTER.read(Source(path), CLOCK))
    assert caught.value.code == "E205"
    counts = pa.concat_tables(kept)["n_persons"].to_pylist()
    assert 10 < len(counts) < 100
    assert set(counts) == {30}


def test_a_tar_that_unpacks_to_an_absurd_size_is_refused(tmp_path: Path) -> None:
    path = tarred(tmp_path / "a.tar.gz", {**FILES, "film.raw": bytes(30_000_000)})
    with pytest.raises(InputError) as caught:
        read(path)
    assert caught.value.code == "E206"


def test_a_tar_header_of_absurd_size_is_refused_unread(tmp_path: Path) -> None:
    header = tarfile.TarInfo("annotations_positions/00000000.json")
    header.type, header.size = tarfile.XHDTYPE, 6 << 30
    path = tmp_path / "a.tar.gz"
    path.write_bytes(gzip.compress(header.tobuf(tarfile.GNU_FORMAT) + bytes(10_000), mtime=0))
    with pytest.raises(InputError) as caught:
        read(path)
    assert caught.value.code == "E206"


def test_hostile_member_names_write_nothing(tmp_path: Path) -> None:
    inner = tmp_path / "in"
    inner.mkdir()
    path = tarred(inner / "a.tar.gz", {"../../../00000000.json": FILES["00000000.json"], **FILES})
    before = sorted(tmp_path.rglob("*"))
    tables, _ = read(path)
    assert tables["frames"].num_rows == 3
    assert sorted(tmp_path.rglob("*")) == before


def test_large_sets_come_in_batches_of_bounded_size(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = folder(tmp_path, {f"{n:08}.json": json.dumps([person(p, p) for p in range(9)]).encode() for n in range(30)})
    whole, _ = read(path)
    monkeypatch.setattr("vsd_analytics.ingest.formats.wildtrack.BATCH_ROWS", 50)
    tables, batches = read(path)
    assert max(b.table("observations").num_rows for b in batches) <= 50
    assert all(tables[name].equals(whole[name]) for name in TABLES)


@pytest.mark.parametrize("data", [b'{"version":1.3,"people":[]}', b'[{"image_id":1}]'])
def test_other_json_files_are_not_claimed(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "00000000.json").write_bytes(data)
    assert not ADAPTER.detects(Source(tmp_path))
    assert not ADAPTER.detects(Source(tmp_path / "00000000.json"))
    with pytest.raises(InputError) as caught:
        read(tarred(tmp_path / "a.tar", {}, mode="w"))
    assert caught.value.code == "E204"


@pytest.mark.realdata
def test_published_annotations_have_their_known_counts(realdata: Callable[[str], Path]) -> None:
    path = realdata("wildtrack/annotations_positions_0_995.tar.gz")
    assert ADAPTER.detects(Source(path))
    tables, batches = read(path)
    assert (tables["frames"].num_rows, tables["observations"].num_rows) == (200, 4785)
    at = defaultdict(list)
    for p in tables["observations"].to_pylist():
        at[p["ts_ms"]].append((round(p["x_m"] * 1000), round(p["y_m"] * 1000)))
    squares = [
        (ax - bx) ** 2 + (ay - by) ** 2
        for people in at.values()
        for (ax, ay), (bx, by) in itertools.combinations(people, 2)
    ]
    assert sum(square < 2000**2 for square in squares) == 4093
    assert not rejected(batches)


# single views ---------------------------------------------------------------------------------------------------------

UNSEEN = {"xmin": -1, "ymin": -1, "xmax": -1, "ymax": -1}


def in_views(identity: object, **boxes: tuple[object, object, object, object]) -> dict[str, object]:
    """Return a person seen in the views given, such as v0=(xmin, ymin, xmax, ymax)."""
    views = [{"viewNum": n, **UNSEEN} for n in range(7)]
    for name, box in boxes.items():
        views[int(name[1:])].update(zip(("xmin", "ymin", "xmax", "ymax"), box, strict=True))
    return {"personID": identity, "positionID": 7, "views": views}


def per_camera(root: Path, *people: object) -> tuple[dict[str, pa.Table], list[RawBatch]]:
    return read(
        folder(root, {"00000005.json": json.dumps(people).encode()}), IngestOptions(start=START, per_camera=True)
    )


def test_single_views_send_foot_points_and_are_heartbeats_each(tmp_path: Path) -> None:
    people = in_views(4, v0=(100, 50, 141, 200), v6=(-10, 900, 30, 1300)), in_views(5, v6=(0, 0, 10, 20)), in_views(6)
    tables, batches = per_camera(tmp_path, *people)
    assert not rejected(batches)
    frames = [(f["camera"], f["ts_ms"] - START, f["n_persons"]) for f in tables["frames"].to_pylist()]
    assert frames == [(f"C{n}", 500, {1: 1, 7: 2}.get(n, 0)) for n in range(1, 8)]
    assert [
        (p["camera"], p["person"], p["track"], p["u_px"], p["v_px"], p["x_m"])
        for p in tables["observations"].to_pylist()
    ] == [("C1", 0, "4", 120.5, 200.0, None), ("C7", 0, "4", 10.0, 1300.0, None), ("C7", 1, "5", 5.0, 20.0, None)]


@pytest.mark.parametrize(
    "bad",
    [
        {"personID": 4, "positionID": 7},
        {"personID": 4, "views": in_views(4)["views"][:6]},  # type: ignore[index]
        {"personID": 4, "views": [*in_views(4)["views"][:6], {"viewNum": 0, **UNSEEN}]},  # type: ignore[index]
        {"personID": 4, "views": [1] * 7},
        {"personID": 4, "views": [{"viewNum": "x" * 9}] * 7},
        in_views("4", v0=(1, 1, 2, 2)),
        in_views(4, v0=(1, 1, "2", 2)),
        in_views(4, v0=(1, 1, 2, 10**12)),
        "nobody",
    ],
)
def test_person_with_a_bad_box_is_quarantined_and_the_others_stay(tmp_path: Path, bad: object) -> None:
    tables, batches = per_camera(tmp_path, bad, in_views(5, v1=(0, 0, 10, 20)))
    assert rejected(batches) == [(1, "bad-box")]
    assert tables["observations"]["camera"].to_pylist() == ["C2"]
    assert sum(tables["frames"]["n_persons"].to_pylist()) == 1
