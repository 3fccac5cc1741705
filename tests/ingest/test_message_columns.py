"""Persons and pairs of many frame messages as columns are those of each message read alone, whatever lies between."""

from __future__ import annotations

import json
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any
from unittest.mock import patch

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from raw_reading import NINE_MS, read_frames

from vsd_analytics.ingest.formats import frames
from vsd_analytics.ingest.reading.adapter import IngestOptions

TOKYO = "Asia/Tokyo"
OPTIONS = IngestOptions(clocks={"cam-2": TOKYO}, persons_max=4)

ids = st.sampled_from(["7", 7, "é", 2**70])
numbers = st.none() | st.sampled_from([0, -1, 3, 0.1, -0.0, 1e300, 2**63, 1.25])
persons = st.lists(
    st.fixed_dictionaries(
        {}, optional={"id": st.none() | ids, **dict.fromkeys(("x_m", "y_m", "u_px", "v_px"), numbers)}
    ),
    max_size=5,
)
pairs = st.lists(
    st.fixed_dictionaries({"a": ids, "b": ids}, optional={"distance_m": numbers, "sd_m": numbers}), max_size=5
)
messages = st.fixed_dictionaries(
    {
        "v": st.just(1),
        "camera": st.sampled_from(["cam-1", "cam-2"]),
        "ts": st.sampled_from(["2026-11-09T09:00:00Z", "2026-11-09T10:00:00.0009+01:00", "2026-11-09T18:00:00.0009"]),
    },
    optional={
        "persons": st.none() | persons,
        "pairs": st.none() | pairs,
        "seq": st.none() | st.integers(0, 2**62),
        "quality": st.sampled_from(["metric", "body", "odd"]),
        "engine": st.sampled_from(["acme 1", "acme 2"]),
        "other": st.just(1),
    },
)
odd_lines = st.sampled_from(
    [
        "",
        "  ",
        "\r",
        "[]",
        '{"v": 1',
        '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","persons":[',
        "]}",
        '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","persons":[{"x_m":NaN}]}',
        '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","persons":[{"x_m":1e999}]}',
        '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","persons":[{"x_m":true}]}',
        '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","persons":[{"id":1.5}]}',
        '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","pairs":[{"a":1}]}',
        '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","seq":99999999999999999999}',
        '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z","persons":[{"id":"\\ud800"}]}',
        '{"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z"} {"v":1,"camera":"cam-1","ts":"2026-11-09T09:00:00Z"}',
    ]
)


def expected(number: int, message: dict[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Return the rows of a message, by its rules and one after the other."""
    listed, sent = message.get("persons"), message.get("pairs")
    ts = datetime.fromisoformat(message["ts"])
    shared = {"camera": message["camera"], "ts_ms": NINE_MS, "zone": None, "line": number}
    if ts.tzinfo is None:
        is_tokyo = message["camera"] == "cam-2"
        shared["zone"] = TOKYO if is_tokyo else "UTC"
        shared["ts_ms"] += 0 if is_tokyo else timedelta(hours=9) // timedelta(milliseconds=1)
    counts = {"n_persons": None if listed is None else len(listed), "n_pairs": None if sent is None else len(sent)}
    quality = message.get("quality", "metric")
    people, links = [], []
    number_of: dict[str, int] = {}
    for i, person in enumerate(listed or ()):
        track = None if person.get("id") is None else str(person["id"])
        places = {axis: person.get(axis) for axis in ("x_m", "y_m", "u_px", "v_px")}
        people.append({**shared, "person": i, "track": track, **places, "quality": quality, "is_staff": None})
        if track is not None:
            number_of.setdefault(track, i)
    others: dict[str, int] = {}
    for pair in sent or ():
        row = {**shared, "quality": quality, "distance_m": pair.get("distance_m"), "distance_sd_m": pair.get("sd_m")}
        for side in ("a", "b"):
            track = str(pair[side])
            if track not in number_of:
                others.setdefault(track, len(listed or ()) + len(others))
            place = listed[number_of[track]] if listed and track in number_of else {}
            row |= {f"track_{side}": track, f"person_{side}": {**others, **number_of}[track]}
            row |= {f"{axis}_{side}_m": place.get(f"{axis}_m") for axis in ("x", "y")}
        links.append(row)
    return {"frames": [{**shared, **counts, "seq": message.get("seq")}], "observations": people, "pairs": links}


def test_a_person_of_one_message_and_a_listed_one_of_the_next_have_their_own_numbers(tmp_path: Path) -> None:
    """Numbers of people who are not listed start anew in each message; here only the second one lists somebody."""
    ts = "2026-11-09T09:00:00Z"
    first = {"v": 1, "camera": "cam-1", "ts": ts, "pairs": [{"a": "z", "b": "y"}, {"a": "y", "b": "x"}]}
    second = {
        "v": 1,
        "camera": "cam-2",
        "ts": ts,
        "persons": [{"id": "p"}, {"id": "q"}],
        "pairs": [{"a": "q", "b": "w"}],
    }
    content = "\n".join(map(json.dumps, (first, second)))
    found = read_frames(tmp_path / "a.jsonl", content, OPTIONS).tables["pairs"]
    assert [(row["person_a"], row["person_b"]) for row in found] == [(0, 1), (1, 2), (1, 2)]


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(lines=st.lists(messages | odd_lines, max_size=12), held=st.integers(1, 12), batch=st.integers(1, 40))
def test_messages_read_together_give_the_rows_of_each(
    lines: list[dict[str, Any] | str], held: int, batch: int, tmp_path: Path
) -> None:
    content = "\n".join(line if isinstance(line, str) else json.dumps(line) for line in lines)
    with patch.object(frames, "_HELD_ROWS", held), patch.object(frames, "BATCH_ROWS", batch):
        found = read_frames(tmp_path / "a.jsonl", content, OPTIONS)
    good = {n: m for n, m in enumerate(lines, 1) if isinstance(m, dict) and len(m.get("persons") or ()) <= 4}
    bad = [n for n, m in enumerate(lines, 1) if n not in good and not (isinstance(m, str) and not m.strip())]
    assert [r.line for r in found.rejected] == bad
    rows = [expected(number, message) for number, message in good.items()]
    for name, of_table in found.tables.items():
        assert of_table == [row for of_message in rows for row in of_message[name]]
    assert found.engines == {m["engine"] for m in good.values() if "engine" in m}
    assert sum(found.dropped.values()) == sum("other" in m for m in lines if isinstance(m, dict))
