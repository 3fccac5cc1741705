"""Ids, classes, cameras and topics of a file cannot act on a terminal or flood it, whichever doubt shows them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from walks import START, Step, project, walks

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run

EVIL = "\x1b[2J\x07\u202e<script>alert(1)</script>\x9b31m"
LONG = "x" * 5000
STEPS = walks(n_people=4, seconds=40)


def table(*columns: Callable[[Step], str], names: str) -> str:
    rows = [[s.at.isoformat(), *(f'"{column(s)}"' for column in columns), str(s.x_m), str(s.y_m)] for s in STEPS]
    return "\n".join([f"ts,{names},x_m,y_m", *(",".join(row) for row in rows)]) + "\n"


TABLES = {
    "two spellings": table(lambda s: f"{'0' * (s.at.second % 2)}{s.track}{EVIL}", names="track_id"),
    "long spellings": table(lambda s: f"{' ' * (s.at.second % 2)}{s.track}{LONG[:150]}", names="track_id"),
    "sums": table(lambda s: "total" if s.track == 4 else f"{s.track}{EVIL}", names="track_id"),
    "ids that do not last": table(lambda s: f"{EVIL}{s.track}-{s.at.second}", names="track_id"),
    "cameras": table(lambda s: str(s.track), lambda s: f"{EVIL}{s.track % 2}", names="track_id,camera"),
    "floors": table(lambda s: str(s.track), lambda s: f"{EVIL}{s.track % 2}{LONG}", names="track_id,floor"),
    "classes": table(
        lambda s: str(s.track), lambda s: ("person", f"car{EVIL}{LONG}")[s.track % 2], names="track_id,class"
    ),
    "units": table(lambda s: str(s.track), lambda s: f"cm{EVIL}", names="track_id,unit"),
    "a column": table(lambda s: str(s.track), lambda s: str(s.track % 2), names=f'track_id,"camera{EVIL}"'),
}


def said_of(root: Path, text: str, capsys: pytest.CaptureFixture[str], *options: str) -> str:
    (root / "a.csv").write_text(text, encoding="utf-8")
    run(cli, ["-C", str(root), "--now", "2025-12-01", "check", str(root / "a.csv"), *options])
    return "".join(capsys.readouterr())


def is_harmless(said: str) -> bool:
    return all(c.isprintable() or c == "\n" for c in said) and max(map(len, said.splitlines())) < 1500


@pytest.mark.parametrize("name", TABLES)
def test_names_of_a_table_are_shown_short_and_without_commands(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = said_of(project(tmp_path / "p"), TABLES[name], capsys)
    assert "from 2025-11-25" in said
    assert is_harmless(said), said[:2000]


def test_topics_and_keys_of_messages_as_well(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    messages = [
        {
            "topic": f"{EVIL}{k % 2}",
            "payload": {"t": START.timestamp() + k, "people": [{"id": 1, EVIL: 1, "x": k / 9, "y": 2}]},
        }
        for k in range(60)
    ]
    text = "".join(json.dumps(m) + "\n" for m in messages)
    mapping = ("--persons", "payload.people", "--map", "ts=payload.t,track_id=id,x_m=x,y_m=y")
    for options in ((), mapping):
        said = said_of(project(tmp_path / "p"), text, capsys, *options)
        assert is_harmless(said), said[:2000]
    assert "W221" in said
