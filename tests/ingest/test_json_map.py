"""JSON messages of any engine by a mapping: read right, or refused with the reason; no message stops the others."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from live.local_broker import write_project
from site_text import site_text

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError, UsageError
from vsd_analytics.ingest.formats.json_map import JsonMap, message_paths
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.ingest.reading.frame_rows import FrameRows, instant_of
from vsd_analytics.ingest.reading.json_guess import guessed_mapping
from vsd_analytics.ingest.reading.json_values import value_at
from vsd_analytics.ingest.reading.raw import BadRowError
from vsd_analytics.live.batches import ReceivedMessage
from vsd_analytics.live.decode import Preparer
from vsd_analytics.live.mapped import mapped_readers, topic_matches, topics_of

NOW = datetime(2026, 11, 20, 12, tzinfo=UTC)
FLOOR = {"ts": "t", "track_id": "id", "x_m": "x", "y_m": "y"}


def read(message: Any, mapping: dict[str, str] = FLOOR, **options: Any) -> Any:
    """Return the raw batch of one message."""
    given = IngestOptions(map=mapping, camera="cam-1", **{"persons": "p", **options})
    frames = FrameRows(given, engine="json")
    JsonMap().take(message, frames, given, 1)
    return frames.batch(0)


def places(batch: Any, *columns: str) -> list[tuple[Any, ...]]:
    return [tuple(row[c] for c in columns) for row in batch.table("observations").to_pylist()]


@pytest.mark.parametrize(
    ("path", "found"),
    [
        ("a.b.c", 1),
        ("a.list.1.x", 3),
        ("dotted.key", 4),
        ("a.dotted.key", 5),
        ("a.b.c.d", None),
        ("a.list.9", None),
        ("a.list.-1", None),
        ("nothing", None),
        ("a.list.99999999999999999999", None),
    ],
)
def test_a_path_leads_through_objects_and_lists(path: str, found: Any) -> None:
    message = {"a": {"b": {"c": 1}, "list": [{"x": 2}, {"x": 3}], "dotted.key": 5}, "dotted.key": 4}
    assert value_at(message, path) == found


@pytest.mark.parametrize(
    "ts", [1795176000, 1795176000.0, "1795176000", 1795176000000, "2026-11-20T12:00:00Z", "2026-11-20T13:00:00+01:00"]
)
def test_times_are_unix_or_iso(ts: object) -> None:
    (row,) = read({"t": ts, "p": []}).table("frames").to_pylist()
    assert (row["ts_ms"], row["n_persons"]) == (1795176000000, 0)


def test_a_time_of_another_form_needs_its_format_and_is_on_the_cameras_clock() -> None:
    batch = read({"t": "20.11.2026 13:00:00", "p": []}, time_format="%d.%m.%Y %H:%M:%S", frame_zone="Europe/Rome")
    assert batch.table("frames")["ts_ms"].to_pylist() == [1795176000000]
    with pytest.raises(BadRowError):
        read({"t": "20.11.2026 13:00:00", "p": []})


@pytest.mark.parametrize(
    ("mapping", "person", "options", "u_v"),
    [
        ({"left": "b.0", "top": "b.1", "right": "b.2", "bottom": "b.3"}, {"b": [10, 20, 30, 80]}, {}, (20, 80)),
        (
            {"left": "b.x", "top": "b.y", "width": "b.w", "height": "b.h"},
            {"b": {"x": 10, "y": 20, "w": 20, "h": 60}},
            {},
            (20, 80),
        ),
        ({"center_x": "0", "center_y": "1", "width": "2", "height": "3"}, [20, 50, 20, 60], {}, (20, 80)),
        ({"u_px": "u", "v_px": "v"}, {"u": 0.5, "v": 0.25}, {"size_px": (1000, 400)}, (500, 100)),
    ],
)
def test_boxes_become_foot_points(
    mapping: dict[str, str], person: Any, options: dict[str, Any], u_v: tuple[float, float]
) -> None:
    batch = read({"t": 1795176000, "p": [person]}, {"ts": "t", **mapping}, **options)
    assert places(batch, "u_px", "v_px") == [u_v]


@pytest.mark.parametrize(
    ("mapping", "unit", "x_m"), [({"x_m": "x", "y_m": "y"}, "cm", 0.1), ({"x_m": "x_mm", "y_m": "y_mm"}, None, 0.01)]
)
def test_units_are_stated_or_in_the_name(mapping: dict[str, str], unit: str | None, x_m: float) -> None:
    person = {"x": 10, "y": 10, "x_mm": 10, "y_mm": 10}
    batch = read({"t": 1795176000, "p": [person]}, {"ts": "t", **mapping}, unit=unit)
    assert places(batch, "x_m") == [(pytest.approx(x_m),)]


def test_persons_may_be_an_object_whose_keys_are_their_ids() -> None:
    batch = read({"t": 1795176000, "p": {"a7": {"x": 1, "y": 2}}}, {**FLOOR, "track_id": "@key"})
    assert places(batch, "track", "x_m") == [("a7", 1.0)]


def test_a_message_without_a_list_is_one_person() -> None:
    assert places(read({"t": 1795176000, "id": 7, "x": 1, "y": 2}, persons=None), "track", "x_m") == [("7", 1.0)]


def test_a_filter_leaves_out_and_counts() -> None:
    kinds = [("car", 0.9), ("man", 0.9), ("man", "high")]
    people = [{"id": i, "x": 1, "y": 1, "k": {"n": n, "c": c}} for i, (n, c) in enumerate(kinds, 1)]
    batch = read({"t": 1795176000, "p": people}, where="k.n = 'man' and k.c > 0.5")
    assert places(batch, "track") == [("2",)]
    assert batch.table("frames")["n_persons"].to_pylist() == [1]
    assert batch.n_dropped == {"by --where": 2}


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        ({"t": 1795176000}, "bad-message"),
        ({"t": 1795176000, "p": None}, "bad-message"),
        ({"t": 1795176000, "p": "nobody"}, "bad-message"),
        ({"t": 1795176000, "p": [1]}, "bad-message"),
        ({"p": []}, "no-time"),
        ({"t": True, "p": []}, "not-a-time"),
        ({"t": float("inf"), "p": []}, "not-a-time"),
        ({"t": 1e300, "p": []}, "not-a-time"),
        ({"t": "yesterday", "p": []}, "not-a-time"),
        ({"t": 1795176000, "p": [{"id": 1, "x": float("nan"), "y": 1}]}, "not-a-number"),
        ({"t": 1795176000, "p": [{"id": 1, "x": None, "y": 1}]}, "not-a-number"),
        ({"t": 1795176000, "p": [{"id": 1, "y": 1}]}, "not-a-number"),
        ({"t": 1795176000, "p": [{"id": [1], "x": 1, "y": 1}]}, "bad-message"),
    ],
)
def test_what_cannot_be_used_has_a_reason(message: Any, reason: str) -> None:
    with pytest.raises(BadRowError) as bad:
        read(message)
    assert bad.value.args[0] == reason


@pytest.mark.parametrize("mapping", [{}, {"ts": "t"}, {"x_m": "x", "y_m": "y"}, {"ts": "t", "left": "l", "top": "t"}])
def test_a_mapping_without_time_or_place_is_refused(mapping: dict[str, str]) -> None:
    with pytest.raises(UsageError):
        message_paths(IngestOptions(map=mapping, persons="p"))


HOSTILE = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8) | st.just("../../etc"),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(["t", "p", "id", "x", "y", "a.b"]), inner)
    ),
    max_leaves=12,
)


@given(message=HOSTILE)
@settings(max_examples=50)
def test_no_message_makes_the_reader_fail(message: Any) -> None:
    """Whatever is sent: it becomes records that the checks see, or it is rejected with a reason."""
    payload = json.dumps(message).encode()
    got = PREPARER.prepare([ReceivedMessage("acme/x", payload, len(payload)), GOOD], now=NOW)
    assert all(r.reason and r.detail for r in got.rejected)
    assert got.tables["frames"].num_rows >= 1, "the good message beside it is read"


def _preparer() -> Preparer:
    import tempfile

    root = write_project(Path(tempfile.mkdtemp()), port=1883)
    with (root / "vsd.toml").open("a", encoding="utf-8") as toml:
        toml.write(
            '\n[[source]]\nid = "acme"\ntopics = ["acme/#"]\npersons = "p"\ncamera = "cam-1"\n'
            'map = { ts = "t", track_id = "id", x_m = "x", y_m = "y" }\n'
        )
    return Preparer(load_site(root), now=NOW)


PREPARER = _preparer()
_GOOD = json.dumps({"t": NOW.timestamp(), "p": [{"id": "</script>'; drop table x --", "x": 1, "y": 2}]}).encode()
GOOD = ReceivedMessage("acme/deep/er", _GOOD, len(_GOOD))


def test_messages_of_a_topic_are_read_by_its_source_beside_frame_messages() -> None:
    frame = b'{"v":1,"camera":"cam-1","ts":"2026-11-20T11:59:00Z","persons":[]}'
    got = PREPARER.prepare([ReceivedMessage("vsd/cam-1/frames", frame, len(frame)), GOOD], now=NOW)
    assert (got.tables["frames"].num_rows, got.tables["observations"].num_rows) == (2, 1)
    assert not got.rejected
    swapped = PREPARER.prepare([ReceivedMessage("acme/1", frame, len(frame))], now=NOW)
    assert [r.reason for r in swapped.rejected] == ["bad-message"], "nobody reads it as a frame message there"


def test_live_person_who_cannot_be_used_is_quarantined_and_the_next_message_is_not() -> None:
    people = [{"id": "1", "x": "nobody knows", "y": 2}, {"id": "2", "x": 1, "y": 2}]
    payload = json.dumps({"t": NOW.timestamp(), "p": people}).encode()
    empty = json.dumps({"t": NOW.timestamp() - 1, "p": []}).encode()
    sent = [ReceivedMessage("acme/1", each, len(each)) for each in (payload, empty)]
    got = PREPARER.prepare(sent, now=NOW)
    assert (got.tables["frames"].num_rows, got.tables["observations"].num_rows) == (2, 1)
    assert [r.reason for r in got.rejected] == ["not-a-number"]


@pytest.mark.parametrize(
    ("pattern", "topic", "fits"),
    [
        ("a/+/c", "a/b/c", True),
        ("a/+/c", "a/b/d", False),
        ("a/#", "a", True),
        ("a/#", "a/b/c", True),
        ("#", "$SYS/x", False),
        ("+", "a/b", False),
        ("$share/g/a/+", "a/b", True),
        ("a", "a/b", False),
    ],
)
def test_topic_filters_are_those_of_mqtt(pattern: str, topic: str, fits: bool) -> None:
    assert topic_matches(pattern, topic) is fits


def test_sources_add_their_topics_and_formats_of_other_engines_come_live_as_well(tmp_path: Path) -> None:
    more = '[[source]]\nid = "metropolis"\nformat = "nvidia"\ntopics = ["mdx/frames"]\n'
    (tmp_path / "vsd.toml").write_text(site_text("cam-1", more=more), encoding="utf-8")
    site = load_site(tmp_path)
    assert topics_of(("vsd/+/frames", "mdx/frames"), mapped_readers(site)) == ("vsd/+/frames", "mdx/frames")
    message = {"version": "4.0", "id": "1", "sensorId": "cam-1", "timestamp": "2026-11-20T12:00:00.000Z",
               "objects": [{"id": "5", "type": "Person", "coordinate": {"x": 2.0, "y": 3.0}}]}  # fmt: skip
    payload = json.dumps(message).encode()
    got = Preparer(site, now=NOW).prepare([ReceivedMessage("mdx/frames", payload, len(payload))], now=NOW)
    assert got.tables["observations"].select(["x_mm", "y_mm"]).to_pylist() == [{"x_mm": 2000, "y_mm": 3000}]


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ('topics = ["acme/x"]\npersons = "p"\n', "has no map"),
        ('topics = ["acme/x#"]\npersons = "p"\nmap = { ts = "t", x_m = "x", y_m = "y" }\n', "topic filter"),
        ('format = "json"\nfiles = "a*.json"\nmap = { ts = "t" }\n', "has no map"),
    ],
)
def test_a_source_that_cannot_read_a_message_is_reported_in_vsd_toml(tmp_path: Path, lines: str, says: str) -> None:
    (tmp_path / "vsd.toml").write_text(site_text("cam-1", more=f'[[source]]\nid = "acme"\n{lines}'), encoding="utf-8")
    with pytest.raises(ConfigError) as refused:
        load_site(tmp_path)
    assert any(says in problem.what for problem in refused.value.problems)


def test_a_table_format_has_no_topics(tmp_path: Path) -> None:
    more = '[[source]]\nid = "acme"\nformat = "table"\ntopics = ["a"]\n'
    (tmp_path / "vsd.toml").write_text(site_text("cam-1", more=more), encoding="utf-8")
    with pytest.raises(UsageError, match="no message can have"):
        mapped_readers(load_site(tmp_path))


def test_a_file_is_understood_mapped_saved_and_ingested(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "vsd.toml").write_text(site_text("cam-1"), encoding="utf-8")
    path = tmp_path / "acme-2026-11-19.jsonl"
    with path.open("w", encoding="utf-8") as lines:
        for second in range(30):
            people = [{"tid": i, "pos": {"x": 200 + 60 * second, "y": 100 * i}, "cls": "dog" if i == 3 else "human"}
                      for i in range(4)]  # fmt: skip
            lines.write(json.dumps({"meta": {"time": 1795100000 + second}, "data": {"people": people}}) + "\n")
    vsd = ["-C", str(tmp_path), "--now", NOW.isoformat()]
    assert run(cli, [*vsd, "check", str(path)]) == 2
    proposed = "--persons data.people --map ts=meta.time,track_id=tid,x_m=pos.x,y_m=pos.y"
    assert proposed in capsys.readouterr().err
    assert run(cli, [*vsd, "check", str(path), *proposed.split()]) == 1
    doubts = capsys.readouterr().err
    assert "W220" in doubts
    assert "W222" in doubts
    right = [*proposed.split(), "--unit", "cm", "--where", "cls = 'human'", "--save", "acme"]
    assert run(cli, [*vsd, "check", str(path), *right]) == 0
    assert run(cli, [*vsd, "ingest", str(path)]) == 0
    assert "by profile acme  90 person records, 30 frames" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("message", "path", "says"),
    [
        ({"device": 1, "people": []}, "objs", "the message has no key 'objs'; its keys: t, device, people"),
        ({"data": {"a\x1b[2J": 1}}, "data.people", "data has no key 'people'; its keys: a?[2J"),
        ({"data": {}}, "data.people", "data has no key 'people'; it is empty"),
        (
            {str(i): 0 for i in range(12)},
            "p",
            "the message has no key 'p'; its keys: t, 0, 1, 2, 3, 4, 5, 6, 7, 8, ...",
        ),
        ({"k" * 500: 0}, "p", f"the message has no key 'p'; its keys: t, {'k' * 40}"),
        ({"p": None}, "p", "there is no list of persons at 'p', but null"),
        ({"p": "none"}, "p.a", "there is no list of persons at 'p.a', but null"),
        ({"p": "none"}, "p", "there is no list of persons at 'p', but 'none'"),
    ],
)
def test_a_message_without_the_list_says_which_keys_it_has(message: Any, path: str, says: str) -> None:
    with pytest.raises(BadRowError) as caught:
        read({"t": 1_762_675_200, **message}, persons=path)
    assert caught.value.args == ("bad-message", says)


def test_the_fix_of_an_unreadable_message_names_its_source_and_mapping(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = '[[source]]\nid = "acme"\nfiles = "acme*"\nformat = "json"\npersons = "objs"\n'
    more += 'map = { ts = "t", x_m = "x", y_m = "y" }\n'
    (tmp_path / "vsd.toml").write_text(site_text("cam-1", more=more), encoding="utf-8")
    for name in ("acme.jsonl", "other.jsonl"):
        (tmp_path / name).write_text('{"device": "d", "t": 1795100000, "people": []}\n', encoding="utf-8")
    vsd = ["-C", str(tmp_path), "--now", NOW.isoformat()]
    says = """compare it with [[source]] 'acme': persons = "objs", map = { ts = "t", x_m = "x", y_m = "y" }"""
    assert run(cli, [*vsd, "ingest", str(tmp_path / "acme.jsonl")]) == 1
    assert says in capsys.readouterr().err
    for command in (["list"], ["list", "--json"], ["replay"]):
        run(cli, [*vsd, "quarantine", *command])
        assert (json.dumps(says)[1:-1] if "--json" in command else says) in capsys.readouterr().out
    given = ["--persons", "nobody", "--map", "ts=t,x_m=x,y_m=y"]
    run(cli, [*vsd, "ingest", str(tmp_path / "other.jsonl"), *given])
    assert 'compare it with the mapping: persons = "nobody", map' in capsys.readouterr().err


@pytest.mark.parametrize("name", ["oid", "objectId", "object_id", "obj_id", "tid", "trackId", "personId", "id"])
def test_the_proposed_mapping_of_messages_names_the_track(tmp_path: Path, name: str) -> None:
    """A name and a class beside it are no tracks."""
    path = tmp_path / "a.json"
    person = {"type": "person", "name": "walker", name: 7, "x": 1, "y": 2}
    path.write_text(json.dumps({"t": 1_762_675_200, "objs": [person]}), encoding="utf-8")
    assert (
        str(guessed_mapping(Source(path))).partition("   (")[0]
        == f"--persons objs --map ts=t,track_id={name},x_m=x,y_m=y"
    )


@pytest.mark.parametrize("box", [[50, 60, 40, 90], [50, 60, 50, 60]])
def test_a_box_that_is_none_is_a_bad_row_as_in_tables(box: list[int]) -> None:
    """Sizes mapped as right and bottom, or a box of one point."""
    sides = {"ts": "t", "left": "box.0", "top": "box.1", "right": "box.2", "bottom": "box.3"}
    with pytest.raises(BadRowError, match="is no box with a size") as caught:
        read({"t": 1_762_675_200, "p": [{"box": box}]}, sides)
    assert caught.value.args[0] == "bad-box"


@pytest.mark.parametrize(
    ("person", "proposed"),
    [
        ({"bbox": [10, 20, 60, 180]}, "left=bbox.0,top=bbox.1,right=bbox.2,bottom=bbox.3   (corners; if the last two"),
        (
            {"bbox": [410, 20, 60, 180]},
            "left=bbox.0,top=bbox.1,width=bbox.2,height=bbox.3   (the upper left corner; if",
        ),
        ({"xyxy": [10, 20, 60, 180]}, "left=xyxy.0,top=xyxy.1,right=xyxy.2,bottom=xyxy.3"),
        ({"box_tlwh": [10, 20, 60, 180]}, "left=box_tlwh.0,top=box_tlwh.1,width=box_tlwh.2,height=box_tlwh.3"),
        ({"cxcywh": [90, 20, 60, 180]}, "center_x=cxcywh.0,center_y=cxcywh.1,width=cxcywh.2,height=cxcywh.3"),
        ({"box": [[10, 20], [60, 180]]}, "left=box.0.0,top=box.0.1,right=box.1.0,bottom=box.1.1"),
        ({"found": {"rect": [10, 20, 60, 180]}}, "left=found.rect.0,top=found.rect.1"),
        ({"x0": 60, "y0": 180, "x1": 10, "y1": 20}, "left=x1,top=y1,right=x0,bottom=y0"),
        ({"colour": [10, 20, 60, 180]}, None),
        ({"bbox": [10, 20, 60]}, None),
    ],
)
def test_a_box_that_is_a_list_is_proposed(person: dict[str, Any], proposed: str | None, tmp_path: Path) -> None:
    message = {"ts": 1762761600, "objs": [{"tid": 1, **person}]}
    (tmp_path / "a.jsonl").write_text(json.dumps(message) + "\n")
    found = guessed_mapping(Source(tmp_path / "a.jsonl"))
    assert found is None if proposed is None else f"--persons objs --map ts=ts,track_id=tid,{proposed}" in str(found)


def test_one_list_that_cannot_be_corners_decides_for_all(tmp_path: Path) -> None:
    boxes = [[10, 20, 60, 180], [10, 20, 60, 180], [300, 20, 60, 180]]
    messages = [{"ts": 1762761600 + k, "objs": [{"bbox": box}]} for k, box in enumerate(boxes)]
    (tmp_path / "a.json").write_text(json.dumps(messages))
    assert "top=bbox.1,width=bbox.2,height=bbox.3" in str(guessed_mapping(Source(tmp_path / "a.json")))


@pytest.mark.parametrize(
    ("message", "proposed"),
    [
        (
            {"time": "x", "stream": "stdout", "log": {"t": 1, "objs": [{"x": 1, "y": 2}]}},
            "--persons log.objs --map ts=log.t,x_m=x,y_m=y",
        ),
        (
            {"_id": {"$oid": "a"}, "at": {"$date": "x"}, "x": 1, "y": 2},
            "--format json --map 'ts=at.$date,x_m=x,y_m=y'",
        ),
        ({"places": {"-Na": {"ts": 1, "x": 1, "y": 2}, "-Nb": {"ts": 2, "x": 1, "y": 2}}}, None),
    ],
    ids=["Docker", "MongoDB", "a time for each person"],
)
def test_the_time_of_a_message_is_its_own(message: dict[str, Any], proposed: str | None, tmp_path: Path) -> None:
    (tmp_path / "a.jsonl").write_text(json.dumps(message) + "\n")
    found = guessed_mapping(Source(tmp_path / "a.jsonl"))
    assert found is None if proposed is None else proposed in str(found)


def test_a_time_with_utc_behind_it_has_an_offset() -> None:
    assert instant_of("2025-11-10 09:00:00 UTC") == datetime(2025, 11, 10, 9, tzinfo=UTC)
