"""Messages as recorders of MQTT, logs, Kafka and search engines keep them are read like the messages alone."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from engine_files import axis, axis_v1, azure, deepstream, frames, nvidia
from walks import START, project, walks

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import IngestResult, ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.ingest.reading.envelopes import as_object

NOW = datetime(2025, 12, 1, tzinfo=UTC)
METRES, SHARES = frames(), frames(width=1.0, height=1.0)

ENVELOPES: dict[str, Callable[[str], str]] = {
    "nothing": lambda text: text,
    "mosquitto_sub -v": lambda text: f"site/hall/people {text}",
    "mosquitto_sub -F %j": lambda text: json.dumps(
        {"tst": "2025-11-10T10:00:00+0100", "topic": "a/b", "payload": text}
    ),
    "mosquitto_sub -F %J": lambda text: json.dumps({"topic": "a/b", "qos": 0, "payload": json.loads(text)}),
    "recorder with a clock": lambda text: json.dumps(
        {"timestamp": "2025-11-10T11:00:00.1", "topic": "a/b", "payload": json.loads(text)}
    ),
    "Kafka": lambda text: json.dumps({"topic": "mdx-raw", "partition": 0, "offset": 7, "value": text}),
    "Elasticsearch": lambda text: json.dumps({"_index": "mdx-raw", "_id": "x", "_source": json.loads(text)}),
    "log in brackets": lambda text: f"[2025-11-10 10:00:00,123] [INFO] {text}",
    "syslog": lambda text: f"Nov 10 09:00:00 camera reader[3844]: Data - {text}",
}
"""How each recorder writes a message. What is around it is taken off before anybody looks at what it is."""
OWN = [
    {"v": 1, "camera": "cam-1", "ts": f"2025-11-10T09:00:{k:02d}Z", "persons": [{"id": t, "x_m": x, "y_m": y}
    for t, x, y in people]} for k, people in enumerate(METRES)
]  # fmt: skip
MESSAGES = {
    "frames": OWN,
    "nvidia": nvidia(METRES),
    "deepstream": deepstream(SHARES),
    "axis beta": axis(SHARES),
    "axis v1": axis_v1(SHARES),
    "azure": azure(METRES),
}


def read(root: Path, text: str, **options: Any) -> IngestResult:
    path = root / "messages.txt"
    path.write_text(text, encoding="utf-8")
    return ingest(load_site(root), [path], IngestOptions(**options), now=NOW)


TWO_EACH = [(n, e) for j, e in enumerate(list(ENVELOPES)[1:]) for i, n in enumerate(MESSAGES) if (i + j) % 3 == 0]
"""Messages of two engines in each envelope, and two or three envelopes around those of each engine."""


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> dict[str, IngestResult]:
    """Return what is read of the messages of each engine alone."""
    return {
        name: read(project(tmp_path_factory.mktemp("alone")), "".join(json.dumps(m) + "\n" for m in messages))
        for name, messages in MESSAGES.items()
    }


@pytest.mark.parametrize(("name", "envelope"), TWO_EACH)
def test_what_is_around_a_message_changes_nothing(
    tmp_path: Path, alone: dict[str, IngestResult], name: str, envelope: str
) -> None:
    texts = [json.dumps(m) for m in MESSAGES[name]]
    plain, wrapped = alone[name], read(project(tmp_path), "".join(ENVELOPES[envelope](t) + "\n" for t in texts))
    assert wrapped.sources[0].format == plain.sources[0].format
    assert wrapped.sources[0].n_records == plain.sources[0].n_records
    assert wrapped.fold.n_new == plain.fold.n_new > len(texts)
    assert not sum(wrapped.sources[0].n_rejected.values())


def test_an_array_of_envelopes_is_read_as_well(tmp_path: Path) -> None:
    texts = [json.dumps(m) for m in MESSAGES["nvidia"]]
    found = read(project(tmp_path / "p"), json.dumps([{"topic": "mdx-raw", "payload": text} for text in texts]))
    assert (found.sources[0].format, found.sources[0].n_records["frames"]) == ("nvidia", len(texts))


def test_a_mapping_can_name_the_topic_and_values_of_the_message(tmp_path: Path) -> None:
    root = project(tmp_path / "p", "cam-1", "cam-2")
    texts = acme(lambda second: f"cam-{1 + second % 2}")
    given = {"ts": "payload.t", "camera_id": "topic", "track_id": "id", "x_m": "x", "y_m": "y"}
    result = read(root, texts, persons="payload.people", map=given)
    assert (result.sources[0].error, result.fold.n_new) == (None, 360 + 60)


@pytest.mark.parametrize(
    ("topic", "codes", "is_refused"),
    [
        (lambda second: f"hall/cam{second % 2}/people", ["W221"], True),
        (lambda second: f"hall/{('door', 'till')[second % 2]}", ["W221"], False),
        (lambda second: "hall/door", [], False),
    ],
)
def test_topics_of_several_cameras_are_doubted_where_none_is_read(
    tmp_path: Path, topic: Callable[[int], str], codes: list[str], is_refused: bool
) -> None:
    given = {"ts": "payload.t", "track_id": "id", "x_m": "x", "y_m": "y"}
    (source,) = read(project(tmp_path / "p"), acme(topic), persons="payload.people", map=given).sources
    assert source.card is not None
    assert ([d.code for d in source.card.warnings], source.error is not None) == (codes, is_refused)


def test_a_camera_that_no_message_names_is_one_topic(tmp_path: Path) -> None:
    texts = [json.dumps(m) for m in axis_v1(SHARES)]
    lines = "".join(f"axis/{k % 2}/frame {text}\n" for k, text in enumerate(texts))
    (source,) = read(project(tmp_path / "p"), lines, camera="cam-1").sources
    assert dict(source.n_rejected) == {"other-view": len(texts) // 2}


def test_messages_of_something_else_are_no_frames_without_people(tmp_path: Path) -> None:
    texts = [json.dumps(m) for m in axis(SHARES)]
    other = json.dumps({"timestamp": "2025-11-10T09:00:30Z", "temperature": 21.5})
    (source,) = read(project(tmp_path / "p"), "\n".join([*texts, other]) + "\n").sources
    assert dict(source.n_rejected) == {"bad-message": 1}


def test_persons_of_another_engine_are_no_frame_messages_of_ours(tmp_path: Path) -> None:
    text = "".join(f'{{"time": {1762765200 + k}, "persons": [{{"tid": 1, "x": 1.5, "y": 2.0}}]}}\n' for k in range(20))
    (source,) = read(project(tmp_path / "p"), text).sources
    assert source.error is not None
    assert source.error.code == "E204"
    assert "--persons persons --map ts=time,track_id=tid,x_m=x,y_m=y" in (source.error.fix or "")


@pytest.mark.parametrize(
    "line", [b'"a","{""x"": 1}"', b'1,2,{"x": 1', b'{"torn": 1, {"x": 1}', b'a}{"x": 1}', b'a{"x": 1}']
)
def test_a_torn_line_is_no_message(line: bytes) -> None:

    assert as_object(line) is None


def acme(topic: Callable[[int], str]) -> str:
    """Return what `mosquitto_sub -v` writes of an engine that publishes the people of each second."""
    seconds: dict[int, list[dict[str, Any]]] = {}
    for step in walks():
        person = {"id": step.track, "x": step.x_m, "y": step.y_m}
        seconds.setdefault(int((step.at - START).total_seconds()), []).append(person)
    start = int(START.timestamp())
    return "".join(f"{topic(k)} {json.dumps({'t': start + k, 'people': p})}\n" for k, p in seconds.items())
