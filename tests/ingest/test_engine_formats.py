"""Formats of engines: every position of the walk is stored exactly, empty frames are frames, damage is named."""

from __future__ import annotations

import bz2
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from engine_files import (
    SIZE,
    START,
    START_MS,
    axis,
    axis_v1,
    azure,
    azure_preview,
    azure_preview_distances,
    contacts,
    deepstream,
    frames,
    lines,
    nvidia,
    onvif,
    otvision,
    supervision_csv,
    supervision_json,
    trajectories,
    video_analyzer,
)
from walks import project

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import IngestResult, ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.schema import TABLES
from vsd_analytics.store.part_files import read_part
from vsd_analytics.store.store import Store

METRES = frames()
SHARES = frames(width=1.0, height=1.0)
N_FRAMES = len(METRES)
N_PERSONS = sum(map(len, METRES))
CLOCK = {"start": START_MS}


@dataclass(frozen=True)
class Format:
    """One kind of file.

    Attributes:
        name: The adapter that must recognise it.
        file: Its file name.
        data: Its bytes.
        people: What it shows, in metres, or in shares of the picture if `is_picture`.
        options: Options it needs.
        is_picture: Whether positions are pixels.
        has_ids: Whether it has track ids.
        has_empty: Whether frames without people are in it.
        left_out: What is left out, by reason.
    """

    name: str
    file: str
    data: bytes
    people: list[list[tuple[str, float, float]]]
    options: Mapping[str, Any] = field(default_factory=dict)
    is_picture: bool = False
    has_ids: bool = True
    has_empty: bool = True
    left_out: Mapping[str, int] = field(default_factory=dict)


PICTURE: dict[str, Any] = {"people": SHARES, "is_picture": True}
FORMATS = {
    "nvidia": Format(
        "nvidia", "a.jsonl", lines(nvidia(METRES)), METRES,
        left_out={"not a person": N_FRAMES, "cluster of the engine": N_FRAMES},
    ),
    "nvidia array": Format(
        "nvidia", "a.json", json.dumps(nvidia(METRES), indent=2).encode(), METRES,
        left_out={"not a person": N_FRAMES, "cluster of the engine": N_FRAMES},
    ),
    "deepstream minimal": Format("nvidia", "a.jsonl", lines(deepstream(SHARES)), **PICTURE),
    **{
        f"axis {below or 'beta'}": Format(
            "axis-scene", "a.jsonl", lines(axis(SHARES, below=below)), options={"size_px": SIZE}, **PICTURE,
            left_out={"not a person": N_FRAMES, "object without a class": N_FRAMES},
        )
        for below in ("", "frame", "data")
    },
    "axis v1": Format(
        "axis-scene", "a.jsonl", lines(axis_v1(SHARES)),
        [[(f"8e653185-{t}", x, y) for t, x, y in each] for each in SHARES], {"size_px": SIZE}, is_picture=True,
        left_out={"not a person": sum(map(bool, SHARES))},
    ),
    **{
        f"otvision {version}{', shares' * is_share}": Format(
            "otvision", "hall.ottrk",
            bz2.compress(json.dumps(otvision(SHARES, version=version, is_share=is_share)).encode()),
            **PICTURE, left_out={"not a person": sum(map(bool, SHARES))},
        )
        for version, is_share in (("1.2", False), ("1.1", False), ("1.0", False), ("1.2", True))
    },
    "azure": Format("azure-spatial-analysis", "a.jsonl", lines(azure(METRES)), METRES, has_ids=False),
    "azure, not calibrated": Format(
        "azure-spatial-analysis", "a.json", json.dumps(azure(METRES, is_calibrated=False)[0], indent=1).encode()
        + b"\n" + lines(azure(METRES, is_calibrated=False)[1:]),
        [[(t, x / 20, y / 20) for t, x, y in each] for each in METRES], is_picture=True, has_ids=False,
    ),
    "azure preview": Format(
        "azure-spatial-analysis", "a.jsonl", lines(azure_preview(SHARES)), options={"size_px": SIZE}, **PICTURE,
        has_ids=False, left_out={"not a person": N_FRAMES, "a crossing of a line or zone": 1,
                                 "a person whose place the event does not give": N_FRAMES},
    ),
    "azure preview, distances": Format(
        "azure-spatial-analysis", "a.jsonl", lines(azure_preview_distances(METRES)), METRES, has_ids=False,
        left_out={"a person whose place the event does not give": N_FRAMES},
    ),
    "azure video analyzer": Format(
        "azure-spatial-analysis", "a.jsonl", lines(video_analyzer(SHARES)), options={"size_px": SIZE}, **PICTURE,
        has_ids=False,
    ),
    "onvif": Format(
        "onvif", "a.xml", onvif(SHARES), options={"size_px": SIZE}, **PICTURE,
        left_out={"not a person": N_FRAMES, "part of a person": N_PERSONS},
    ),
    "onvif in device units": Format(
        "onvif", "a.xml", onvif(SHARES, per_document=7, in_pixels=True), **PICTURE,
        left_out={"not a person": N_FRAMES, "part of a person": N_PERSONS},
    ),
    "petrack": Format("trajectories", "a.txt", trajectories(METRES), METRES, CLOCK),
    "petrack in centimetres": Format("trajectories", "a.txt", trajectories(METRES, unit="cm"), METRES, CLOCK),
    "supervision CSV": Format(
        "supervision", "a.csv", supervision_csv(SHARES), options={"fps": 1.0, **CLOCK}, **PICTURE, has_empty=False,
        left_out={"by --where": N_FRAMES},
    ),
    "supervision JSON": Format(
        "supervision", "a.json", supervision_json(SHARES), options={"fps": 1.0, **CLOCK}, **PICTURE, has_empty=False,
        left_out={"by --where": N_FRAMES},
    ),
}  # fmt: skip


@pytest.fixture
def root(tmp_path: Path) -> Path:
    made = project(tmp_path / "project")
    toml = (made / "vsd.toml").read_text(encoding="utf-8").replace("picture_px = [1280, 720]\n", "")
    (made / "vsd.toml").write_text(f"{toml}[privacy]\npseudonyms = false\n", encoding="utf-8")
    return made


def read(root: Path, file: str, data: bytes, **options: Any) -> IngestResult:
    (root / file).write_bytes(data)
    given = IngestOptions(**{"camera": "cam-1", **options})
    return ingest(load_site(root), [root / file], given, now=START.replace(year=2026))


def stored(root: Path) -> dict[str, list[dict[str, Any]]]:
    store = Store(root / "store", site_id="hall")
    return {t: [row for p in store.parts(t) for row in read_part(p.path, t).to_pylist()] for t in TABLES}


def ms(row: Mapping[str, Any]) -> int:
    return round(row["ts"].timestamp() * 1000)


def quarter(value: float) -> float:
    return round(value * 4) / 4


@pytest.mark.parametrize("name", FORMATS)
def test_every_position_is_stored_and_nothing_else(root: Path, name: str) -> None:
    each = FORMATS[name]
    result = read(root, each.file, each.data, **each.options).sources[0]
    assert (result.format, result.error, dict(result.n_rejected)) == (each.name, None, {})
    found = stored(root)
    expected = [(START_MS + 1000 * k, t, x, y) for k, seen in enumerate(each.people) for t, x, y in seen]
    rows = sorted(found["observations"], key=lambda r: (ms(r), r["track_id"] or "", r["person"]))
    assert len(rows) == len(expected) == N_PERSONS
    if each.has_ids:
        assert [(ms(r), r["track_id"]) for r in rows] == [(t_ms, track) for t_ms, track, *_ in expected]
    else:
        assert {r["track_id"] for r in rows} == {None}
        rows.sort(key=lambda r: (ms(r), r["person"]))
    for row, (*_, x, y) in zip(rows, expected, strict=True):
        if each.is_picture:
            assert row["x_mm"] is None
            assert (row["u_px"], row["v_px"]) == pytest.approx((quarter(x * SIZE[0]), quarter(y * SIZE[1])), abs=0.25)
        else:
            assert (row["x_mm"], row["y_mm"]) == (round(x * 1000), round(y * 1000))
            assert row["u_px"] is None
    if each.has_empty:
        assert [(ms(f), f["n_persons"]) for f in found["frames"]] == [
            (START_MS + 1000 * k, len(seen)) for k, seen in enumerate(each.people)
        ][: N_FRAMES - (each.name == "trajectories")]  # a file of positions does not say that its last frame was empty
    assert found["pairs"] == []
    assert {reason: n for reason, n in result.n_dropped.items() if n} == dict(each.left_out)


@pytest.mark.parametrize("name", ["nvidia", "axis v1", "azure", "petrack", "supervision CSV"])
def test_damaged_line_goes_to_quarantine_and_the_others_are_stored(root: Path, name: str) -> None:
    each = FORMATS[name]
    whole = each.data.split(b"\n")
    at = next(i for i, line in enumerate(whole) if i > 5 and line)
    whole[at] = whole[at][: len(whole[at]) // 3]
    result = read(root, each.file, b"\n".join(whole), **each.options).sources[0]
    assert result.error is None
    assert sum(result.n_rejected.values()) == 1
    assert next(iter(result.examples.values())).line == at + 1
    assert 0 < N_PERSONS - len(stored(root)["observations"]) <= 3


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda m: m | {"timestamp": "yesterday"}, "not-a-time"),
        (lambda m: m | {"objects": {"id": 1}}, "bad-message"),
        (lambda m: m | {"objects": [{**m["objects"][0], "info": {"footLocation3D": "nan,1"}}]}, "not-a-number"),
        (lambda m: m | {"objects": [{**m["objects"][0], "info": {"footLocation3D": "1e9,1"}}]}, "out-of-range"),
        (lambda m: m | {"sensorId": "somewhere"}, "unknown-camera"),
        (lambda m: m | {"objects": [{"type": "Person", "info": {"footLocation3D": "1,1"}}] * 2001}, "too-many"),
    ],
)
def test_message_that_cannot_be_true_is_quarantined_with_its_reason(
    root: Path, change: Callable[[dict[str, Any]], dict[str, Any]], reason: str
) -> None:
    messages = nvidia(METRES)
    messages[3] = change(messages[3])
    result = read(root, "a.jsonl", lines(messages)).sources[0]
    assert result.error is None
    assert set(result.n_rejected) == {reason}


def test_person_who_cannot_be_used_does_not_cost_the_others_of_the_frame(root: Path) -> None:
    messages = nvidia(METRES)
    at = next(k for k, people in enumerate(METRES) if len(people) > 2)
    spoiled = json.loads(json.dumps(messages[at]))
    spoiled["objects"][0]["info"]["footLocation3D"] = "nan,1"
    result = read(root, "a.jsonl", lines([*messages[:at], spoiled, *messages[at + 1 :]])).sources[0]
    assert result.n_rejected == {"not-a-number": 1}
    assert (len(stored(root)["observations"]), len(stored(root)["frames"])) == (N_PERSONS - 1, N_FRAMES)
    read(root, "b.jsonl", lines([messages[at]]))
    assert len(stored(root)["observations"]) == N_PERSONS, (
        "the message comes again whole: only the missing person is new"
    )


def test_frame_without_a_person_who_can_be_used_is_no_empty_frame(root: Path) -> None:
    messages = nvidia(METRES)
    at = next(k for k, people in enumerate(METRES) if len(people) > 2)
    for found in messages[at]["objects"][:-1]:
        found["info"]["footLocation3D"] = "nan,1"
    result = read(root, "a.jsonl", lines(messages)).sources[0]
    assert result.n_rejected == {"not-a-number": 1}
    assert len(stored(root)["frames"]) == N_FRAMES - 1


def test_person_of_onvif_in_a_cropped_picture_or_outside_the_picture_does_not_cost_the_frame(root: Path) -> None:
    def seen(number: int, kind: str, *sides: float) -> str:
        box = " ".join(f'{n}="{s}"' for n, s in zip(("left", "top", "right", "bottom"), sides, strict=True))
        types = f"<tt:ClassCandidate><tt:Type>{kind}</tt:Type><tt:Likelihood>0.5</tt:Likelihood></tt:ClassCandidate>"
        kinds = f'<tt:Class>{types}<tt:Type Likelihood="0.53">{kind}</tt:Type></tt:Class>'
        shape = f"<tt:Shape><tt:BoundingBox {box}/></tt:Shape>"
        return f'<tt:Object ObjectId="{number}"><tt:Appearance>{shape}{kinds}</tt:Appearance></tt:Object>'

    objects = [
        seen(1, "Human", 600, 100, 680, 480),
        seen(2, "Head", 620, 100, 660, 150),
        seen(3, "Face", 625, 110, 655, 150),
        seen(4, "Human", 0, 0, 0, 0),
        seen(5, "Human", 90_000, 100, 90_010, 480),
    ]
    scale = f'<tt:Translate x="-1.0" y="1.0"/><tt:Scale x="{2 / SIZE[0]:.9f}" y="{-2 / SIZE[1]:.9f}"/>'
    frame = f"<tt:Transformation>{scale}</tt:Transformation>{''.join(objects)}"
    document = (
        '<tt:MetadataStream xmlns:tt="http://www.onvif.org/ver10/schema"><tt:VideoAnalytics>'
        f'<tt:Frame UtcTime="2025-11-10T09:00:00Z">{frame}</tt:Frame></tt:VideoAnalytics></tt:MetadataStream>'
    )
    result = read(root, "a.xml", document.encode()).sources[0]
    assert [(r["track_id"], r["u_px"], r["v_px"]) for r in stored(root)["observations"]] == [("1", 640.0, 480.0)]
    left_out = {"not a person": 2, "person in a cropped picture, without a box": 1}
    assert {reason: n for reason, n in result.n_dropped.items() if n} == left_out
    assert result.n_rejected == {"out-of-range": 1}


def test_engines_own_position_is_asked_for_by_coordinates(root: Path) -> None:
    read(root, "a.jsonl", lines(nvidia(METRES)), coordinates="image")
    assert {(r["x_mm"], r["u_px"], r["v_px"]) for r in stored(root)["observations"]} == {(None, 120.0, 200.0)}


@pytest.mark.parametrize(("name", "n"), [("axis v1", 16), ("onvif", 16)])
def test_shares_of_a_picture_of_unknown_size_are_not_stored(root: Path, name: str, n: int) -> None:
    result = read(root, FORMATS[name].file, FORMATS[name].data).sources[0]
    assert dict(result.n_rejected) == {"no-size": n}
    assert stored(root)["observations"] == []


def test_size_of_the_picture_may_be_in_vsd_toml(root: Path) -> None:
    toml = (root / "vsd.toml").read_text()
    (root / "vsd.toml").write_text(toml.replace('id = "cam-1"', 'id = "cam-1"\npicture_px = [1280, 960]'))
    read(root, "a.jsonl", FORMATS["axis v1"].data)
    assert len(stored(root)["observations"]) == N_PERSONS


def test_contacts_without_distances_are_pairs_at_the_limit(root: Path) -> None:
    result = read(root, "contacts.txt", contacts(METRES)).sources[0]
    assert (result.format, result.error) == ("sociopatterns", None)
    pairs = stored(root)["pairs"]
    assert len(pairs) == 3 * 16
    assert {(p["distance_mm"], p["quality"], p["x_a_mm"]) for p in pairs} == {(1500, "relative", None)}
    assert (pairs[0]["track_a"], pairs[0]["track_b"], ms(pairs[0])) == ("1001", "1002", 1_762_765_200_000)
    assert {f["n_pairs"] for f in stored(root)["frames"]} == {3}


def test_contacts_that_count_from_a_start_need_it(root: Path) -> None:
    data = contacts(METRES, first_s=20)
    refused = read(root, "contacts.txt", data).sources[0]
    assert refused.error is not None
    assert refused.error.code == "E207"
    assert stored(root)["pairs"] == []
    read(root, "contacts.txt", data, start=START_MS)
    assert ms(stored(root)["pairs"][0]) == START_MS + 20_000


@pytest.mark.parametrize("lacking", [{}, {"fps": 25.0}])
def test_trajectories_need_a_start(root: Path, lacking: dict[str, Any]) -> None:
    error = read(root, "a.txt", trajectories(METRES), **lacking).sources[0].error
    assert error is not None
    assert error.code == "E207"


BOMB = (
    b'<?xml version="1.0"?>\n<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>\n'
    b'<tt:MetadataStream xmlns:tt="http://www.onvif.org/ver10/schema">&b;</tt:MetadataStream>\n'
)


@pytest.mark.parametrize(
    ("bad", "n_lost"),
    [
        (BOMB, 0),
        (BOMB.replace(b'<!ENTITY a "aaaaaaaaaa">', b'<!ENTITY a SYSTEM "file:///etc/passwd">'), 0),
        (b"<tt:MetadataStream><tt:Frame></tt:MetadataStream>\n", 0),
        (b"<tt:MetadataStream xmlns:tt='u'>" + b"<tt:x>" * 10 + b"\0</tt:MetadataStream>\n", 0),
    ],
)
def test_hostile_document_goes_to_quarantine_and_the_others_are_stored(root: Path, bad: bytes, n_lost: int) -> None:
    documents = onvif(SHARES)
    middle = documents.find(b"<?xml", len(documents) // 2)
    result = read(root, "a.xml", documents[:middle] + bad + documents[middle:], size_px=SIZE).sources[0]
    assert result.error is None
    assert dict(result.n_rejected) == {"bad-xml": 1}
    assert len(stored(root)["observations"]) == N_PERSONS - n_lost


def test_half_a_document_is_named_and_what_came_before_is_stored(root: Path) -> None:
    data = onvif(SHARES, per_document=20)
    result = read(root, "a.xml", data[: len(data) * 3 // 4], size_px=SIZE).sources[0]
    assert dict(result.n_rejected) == {"bad-xml": 1}
    assert 30 < len(stored(root)["observations"]) < N_PERSONS


def test_persons_only_and_the_user_may_say_otherwise(root: Path) -> None:
    data = supervision_csv(SHARES)
    read(root, "a.csv", data, fps=1.0, start=START_MS, where="class_name = 'car'")
    assert {r["track_id"] for r in stored(root)["observations"]} == {"9"}


def test_supervision_without_frame_or_time_is_refused(root: Path) -> None:
    rows = supervision_csv(SHARES).replace(b",frame_index", b"").decode().splitlines()
    data = "\n".join([rows[0], *(row.rpartition(",")[0] for row in rows[1:])]).encode()
    error = read(root, "a.csv", data).sources[0].error
    assert error is not None
    assert error.code == "E203"
    assert "frame_index" in (error.fix or "")


@pytest.mark.parametrize("name", ["a.csv", "a.json"])
def test_results_of_ultralytics_for_one_picture_are_refused_with_the_way_that_works(root: Path, name: str) -> None:
    box = {"x1": 235.925, "y1": 770.14203, "x2": 371.54599, "y2": 1101.02905}
    data = f'name,class,confidence,box,track_id\nperson,0,0.7438,"{box}",7\n'
    if name == "a.json":
        found = {"name": "person", "class": 0, "confidence": 0.7438, "box": box, "track_id": 7}
        data = json.dumps([found], indent=2)
    error = read(root, name, data.encode()).sources[0].error
    assert error is not None
    assert error.code == "E203"
    assert "save_txt=True" in (error.fix or "")


@pytest.mark.parametrize(
    ("kinds", "codes", "is_note"),
    [
        (["Face", None], ["W222"], [False]),
        ([None], ["W222"], [False]),
        (["Car"], ["W222"], [True]),
        (["Human", None], [], []),
    ],
)
def test_camera_that_classifies_nobody_as_a_person_is_warned_of(
    root: Path, kinds: list[str | None], codes: list[str], is_note: list[bool]
) -> None:
    seen = [
        {
            "bounding_box": {"left": 0.1 * n, "right": 0.1 * n + 0.05, "top": 0.3, "bottom": 0.4},
            "timestamp": f"2025-11-10T09:00:{second:02d}.454206Z",
            "track_id": f"030deaa3-{n}",
            **({} if kind is None else {"class": {"score": 0.75, "type": kind}}),
        }
        for second in range(20)
        for n, kind in enumerate(kinds)
    ]
    frame = [
        {"frame": {"observations": [o for o in seen if o["timestamp"] == at], "operations": [], "timestamp": at}}
        for at in sorted({str(o["timestamp"]) for o in seen})
    ]
    read_in = read(root, "a.jsonl", b"\n" + lines(frame), size_px=SIZE).sources[0]
    assert read_in.format == "axis-scene"
    assert read_in.card is not None
    found = [d for d in read_in.card.warnings if d.code == "W222"]
    assert [d.code for d in found] == codes
    assert [d.is_note for d in found] == is_note
    assert len(stored(root)["frames"]) == 20, "an empty frame is a frame"


def test_a_person_whose_parent_is_zero_is_a_part_of_nothing(root: Path) -> None:
    """Some cameras write `Parent="0"` for every object, with the class twice and boxes in pixels."""
    document = (
        '<tt:MetadataStream xmlns:tt="http://www.onvif.org/ver10/schema"><tt:VideoAnalytics>'
        '<tt:Frame UtcTime="2025-11-10T09:00:00Z"><tt:Transformation><tt:Translate x="-1" y="1"/>'
        '<tt:Scale x="0.001" y="-0.002"/></tt:Transformation><tt:Object ObjectId="2" Parent="0"><tt:Appearance>'
        '<tt:Shape><tt:BoundingBox left="600" top="100" right="800" bottom="500"/></tt:Shape><tt:Class>'
        "<tt:ClassCandidate><tt:Type>Human</tt:Type><tt:Likelihood>0.9</tt:Likelihood></tt:ClassCandidate>"
        '<tt:Type Likelihood="0.9">Person</tt:Type></tt:Class></tt:Appearance></tt:Object></tt:Frame>'
        "</tt:VideoAnalytics></tt:MetadataStream>"
    )
    read(root, "a.xml", document.encode(), size_px=(1000, 500))
    (row,) = stored(root)["observations"]
    assert (row["u_px"], row["v_px"]) == (350.0, 250.0)


def test_messages_of_single_objects_are_people_of_one_frame_with_a_period(root: Path) -> None:
    """DeepStream's full payload: the class is a key, untracked people share an id, each message has its own time."""
    box = {"topleftx": 100, "toplefty": 50, "bottomrightx": 140, "bottomrighty": 150}
    objects = [
        {"id": "1", "bbox": box, "vehicle": {"type": "car"}},
        *({"id": track, "bbox": box, "person": {"age": 0}} for track in ("7", "18446744073709551615")),
        {"id": "8", "bbox": box, "pose": {"num_joints": 17}, "coordinate": {"x": 0, "y": 0, "z": 0}},
    ]
    made = [
        {"messageid": str(i), "mdsversion": "1.0", "@timestamp": f"2025-11-10T09:00:00.{i}Z", "sensor": {"id": "cam-1"}}
        for i in range(len(objects))
    ]
    found = [{**message, "object": each} for message, each in zip(made, objects, strict=True)]
    result = read(root, "a.jsonl", b"".join(json.dumps(m).encode() + b"\n" for m in found), period_s=1.0)
    assert result.sources[0].n_dropped["not a person"] == 1
    rows = stored(root)["observations"]
    assert sorted((ms(row), row["u_px"], row["v_px"], row["track_id"] is None) for row in rows) == [
        (START_MS, 120.0, 150.0, False),
        (START_MS, 120.0, 150.0, False),
        (START_MS, 120.0, 150.0, True),
    ]


@pytest.mark.parametrize(
    ("stated", "length_s", "n_read"),
    [
        (N_FRAMES, None, N_FRAMES),
        (N_FRAMES + 600, None, N_FRAMES + 600),
        (125_000, None, N_FRAMES - 1),  # the last one shows nobody
        (125_000, N_FRAMES, N_FRAMES - 1),
        (N_FRAMES + 7200, N_FRAMES + 7200, N_FRAMES + 7200),
    ],
    ids=["as it is", "ten minutes of nobody", "35 hours of nobody", "more than its length", "a long video"],
)
def test_frames_that_a_video_cannot_have_are_not_recorded(
    stated: int, length_s: int | None, n_read: int, root: Path
) -> None:
    document = otvision(SHARES, version="1.2", is_share=False)
    document["metadata"]["video"] |= {"number_of_frames": stated, "expected_duration": length_s}
    (source,) = read(root, "hall.ottrk", bz2.compress(json.dumps(document).encode())).sources
    assert source.n_records["frames"] == n_read
    assert [note[:4] for note in source.notes if note.startswith("W2")] == ["W228"] * (n_read < stated)
