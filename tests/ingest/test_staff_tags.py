"""Classes and tags of engines that mean staff: whether each record has one is stored, and its text is not."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from engine_files import START, axis, frames, iso, lines, nvidia, onvif
from walks import project

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import ConfigError
from vsd_analytics.ingest.intake.pipeline import IngestResult, ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.store.part_files import read_part
from vsd_analytics.store.store import Store

PEOPLE = [each for each in frames(width=1.0, height=1.0) if each]
STAFF, VISITOR, UNKNOWN = "1", "2", "3"
CLASSES = '[staff]\nstaff_classes = ["Staff", " EMPLOYEE "]\n'
MAP = {"ts": "t", "track_id": "id", "x_m": "x", "y_m": "y", "tag": "label"}
Found = dict[str, set[bool | None]]


def site_with(root: Path, toml: str = CLASSES) -> Path:
    made = project(root)
    text = (made / "vsd.toml").read_text(encoding="utf-8")
    (made / "vsd.toml").write_text(f"{text}[privacy]\npseudonyms = false\n{toml}", encoding="utf-8")
    return made


def read(root: Path, file: str, data: bytes, **options: Any) -> IngestResult:
    (root / file).write_bytes(data)
    given = IngestOptions(**{"camera": "cam-1", **options})
    return ingest(load_site(root), [root / file], given, now=START.replace(year=2026))


def tags(root: Path) -> Found:
    """Return what is stored of the tags of each track."""
    found: Found = {}
    for part in Store(root / "store", site_id="hall").parts("observations"):
        for row in read_part(part.path, "observations").to_pylist():
            found.setdefault(row["track_id"], set()).add(row["is_staff"])
    return found


def with_class(messages: list[dict[str, Any]], person: str) -> bytes:
    """Return messages in which the first person has another class."""
    return b"".join(json.dumps(m).replace(f'"{person}"', '"Staff"', 1).encode() + b"\n" for m in messages)


def vsd_frames() -> bytes:
    kinds = {STAFF: "Employee", VISITOR: "customer", UNKNOWN: None}
    return lines(
        [
            {
                "v": 1,
                "camera": "cam-1",
                "ts": iso(k),
                "persons": [
                    {"id": t, "x_m": x, "y_m": y} | ({"tag": kinds[t]} if kinds[t] else {}) for t, x, y in each
                ],
            }
            for k, each in enumerate(PEOPLE)
        ]
    )


def of_xovis() -> bytes:
    """Return JSON messages whose persons have a list of tags, of which one may name somebody."""
    kinds = {STAFF: ["GROUP", "STAFF"], VISITOR: ["Mario Rossi"], UNKNOWN: []}
    return lines(
        [
            {"t": iso(k), "people": [{"id": t, "x": x, "y": y, "label": kinds[t]} for t, x, y in each]}
            for k, each in enumerate(PEOPLE)
        ]
    )


def of_table() -> bytes:
    kinds = {STAFF: " staff ", VISITOR: "customer", UNKNOWN: ""}
    rows = [f"{iso(k)},{t},{x},{y},{kinds[t]}" for k, each in enumerate(PEOPLE) for t, x, y in each]
    return "\n".join(["t,id,x,y,label", *rows]).encode()


def of_onvif() -> bytes:
    return re.sub(rb'(ObjectId="1">.*?<tt:Type Likelihood="0.85">)Human', rb"\1Staff", onvif(PEOPLE), flags=re.DOTALL)


ALL: Found = {STAFF: {True}, VISITOR: {False}, UNKNOWN: {None}}
OF_CLASSES: Found = {STAFF: {True}, VISITOR: {False}, UNKNOWN: {False}}
FILES: dict[str, tuple[str, Callable[[], bytes], dict[str, Any], Found]] = {
    "frames": ("a.jsonl", vsd_frames, {}, ALL),
    "json": ("a.jsonl", of_xovis, {"format": "json", "persons": "people", "map": MAP}, ALL),
    "table": ("a.csv", of_table, {"map": MAP}, ALL),
    "nvidia": ("a.jsonl", lambda: with_class(nvidia(PEOPLE), "Person"), {}, OF_CLASSES),
    "axis": ("a.jsonl", lambda: with_class(axis(PEOPLE), "Human"), {"size_px": (100, 100)}, OF_CLASSES),
    "onvif": ("a.xml", of_onvif, {"size_px": (100, 100)}, OF_CLASSES),
}


@pytest.mark.parametrize("name", FILES)
def test_whether_the_engine_calls_somebody_staff_is_stored_and_nothing_else_of_it(tmp_path: Path, name: str) -> None:
    file, data, options, expected = FILES[name]
    root = site_with(tmp_path / "project")
    result = read(root, file, data(), **options).sources[0]
    assert (result.error, dict(result.n_rejected)) == (None, {})
    assert tags(root) == expected
    stored = b"".join(p.read_bytes() for p in (root / "store").rglob("*.*") if p.is_file())
    assert b"Rossi" not in stored


@pytest.mark.parametrize("name", FILES)
def test_without_classes_no_tag_is_stored(tmp_path: Path, name: str) -> None:
    file, data, options, expected = FILES[name]
    root = site_with(tmp_path / "project", "")
    options = {**options, **({"map": {k: v for k, v in MAP.items() if k != "tag"}} if "map" in options else {})}
    read(root, file, data(), **options)
    others = expected.keys() - ({STAFF} if expected == OF_CLASSES else set())
    assert tags(root) == {track: {None} for track in others}, "an object of another class is no person"


@pytest.mark.parametrize("name", ["json", "table"])
def test_a_tag_that_nobody_reads_is_refused_and_the_fix_works(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    file, data, options, expected = FILES[name]
    root = site_with(tmp_path / "project", "")
    error = read(root, file, data(), **options).sources[0].error
    assert error is not None
    assert (error.code, tags(root)) == ("E101", {})
    toml = (root / "vsd.toml").read_text(encoding="utf-8")
    assert error.fix is not None
    section, line = error.fix.partition("vsd.toml: ")[2].partition(";")[0].split(" ", 1)
    (root / "vsd.toml").write_text(f"{toml}{section}\n{line}\n", encoding="utf-8")
    read(root, file, data(), **options)
    assert tags(root) == expected


def test_a_new_list_of_classes_reaches_records_that_are_taken_back_and_read_again(tmp_path: Path) -> None:
    root = site_with(tmp_path / "project", CLASSES.replace("Staff", "Guard"))
    options = {"map": MAP}
    read(root, "a.csv", of_table(), **options)
    assert tags(root) == ALL | {STAFF: {False}}
    toml = root / "vsd.toml"
    toml.write_text(toml.read_text(encoding="utf-8").replace("Guard", "Staff"), encoding="utf-8")
    card = read(root, "a.csv", of_table(), **options).sources[0].card
    assert card is not None
    [warning] = [w for w in card.warnings if w.code == "W230"]
    assert tags(root) == ALL | {STAFF: {False}}, "what is stored does not change"
    [purge] = re.findall(r"`vsd (purge --import .+?)`", warning.fix)
    assert run(cli, ["-C", str(root), *purge.split()]) == 0
    read(root, "a.csv", of_table(), **options)
    assert tags(root) == ALL


def test_exported_messages_and_tables_keep_what_the_engine_says(tmp_path: Path) -> None:
    root = site_with(tmp_path / "project")
    read(root, "a.jsonl", vsd_frames())
    out = tmp_path / "out.jsonl"
    assert run(cli, ["-C", str(root), "export", "--out", str(out)]) == 0
    again = site_with(tmp_path / "again", CLASSES)
    read(again, "a.jsonl", out.read_bytes())
    assert tags(again) == ALL | {VISITOR: {None}}, "a message says who is staff, and of nobody that he is not"
    assert run(cli, ["-C", str(root), "export", "--out", str(tmp_path / "out.csv"), "--table", "observations"]) == 0
    assert "is_staff" in (tmp_path / "out.csv").read_text(encoding="utf-8").splitlines()[0]


@pytest.mark.parametrize("value", ['"staff"', "[1]", '[""]'])
def test_classes_are_a_list_of_texts(tmp_path: Path, value: str) -> None:
    root = site_with(tmp_path / "project", f"[staff]\nstaff_classes = {value}\n")
    with pytest.raises(ConfigError) as caught:
        load_site(root)
    assert "staff_classes" in str(caught.value.problems[0])
