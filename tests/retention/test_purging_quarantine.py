"""What is in quarantine of a camera and time is shown by an export, goes with a purge, and never comes back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from aged_projects import DAYS, TOML, audit, make_project, vsd

from vsd_analytics.store.quarantine import QuarantineEntry, entries, files

HOUR = ("--camera", "cam-1", "--range", f"{DAYS[0]}T10:00..{DAYS[0]}T11:00")
TABLE = "ts,camera_id,track_id,x_m,y_m\n"


def message(camera: str, time: str, track: str, **person: Any) -> str:
    found = {
        "v": 1,
        "camera": camera,
        "ts": f"{DAYS[0]}T{time}Z",
        "persons": [{"id": track, "x_m": 1, "y_m": 1, **person}],
    }
    return json.dumps(found) + "\n"


MESSAGES = (
    message("cam-1", "08:59:59", "other-time", x_m=99_999)
    + message("cam-1", "09:00:00", "meant-row", x_m=99_999)
    + message("cam-2", "09:00:00", "other-camera", x_m=99_999)
    + message("yard", "09:00:00", "meant-unknown-camera")
    + message("yard", "12:00:00", "unknown-camera-other-time")
    + message("cam-1", "09:00:00", "meant-bad-message", x_m="far")
    + message("cam-2", "09:00:00", "bad-message-other-camera", x_m="far")
    + message("cam-1", "09:00:00", "meant-unreadable")[:-9]
    + "\n"
)
ROWS = (
    f"{DAYS[0]}T09:10:00Z,cam-1,meant-cell,far,1\n"
    f"{DAYS[0]}T09:10:00Z,cam-2,cell-other-camera,far,1\n"
    f"{DAYS[0]}T12:10:00Z,cam-1,cell-other-time,far,1\n"
    "yesterday,cam-1,meant-no-time,1,1\n"
    "yesterday,cam-2,no-time-other-camera,1,1\n"
)
STAY = {
    "other-time",
    "other-camera",
    "unknown-camera-other-time",
    "bad-message-other-camera",
    "cell-other-camera",
    "cell-other-time",
}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    root = make_project(tmp_path / "p")
    (root / "f.jsonl").write_text("".join(message("cam-2", f"07:{k:02d}:00", "good") for k in range(30)) + MESSAGES)
    (root / "t.csv").write_text(TABLE + ROWS)
    vsd(root, "ingest", str(root / "f.jsonl"), str(root / "t.csv"), code=1)
    return root


def quarantined(root: Path) -> list[QuarantineEntry]:
    return [e for path in files(root / "quarantine") for _, e in entries(path) if e is not None]


def tracks(text: str) -> set[str]:
    known = {*STAY, "no-time-other-camera", "meant-row", "meant-unknown-camera", "meant-bad-message"}
    known |= {"meant-unreadable", "meant-cell", "meant-no-time"}
    return {t for t in known if f'"{t}"' in text or f'\\"{t}\\"' in text or f",{t}," in text}


def held(root: Path) -> set[str]:
    return tracks("".join(path.read_text() for path in files(root / "quarantine")))


def test_quarantined_records_of_the_camera_and_time_go_and_others_stay(project: Path) -> None:
    told = json.loads(vsd(project, "purge", *HOUR, "--dry-run", "--json"))["range"]
    assert {t for t in held(project) if t.startswith("meant")} == held(project) - STAY - {"no-time-other-camera"}
    done = json.loads(vsd(project, "purge", *HOUR, "--json"))["range"]
    assert (done["quarantined"], done["doubtful"]) == (told["quarantined"], told["doubtful"])
    assert held(project) == STAY
    assert not list((project / "store" / "purge").glob("*"))
    assert audit(project)[-1]["quarantined"] == done["quarantined"]
    assert "nothing to remove" in vsd(project, "purge", *HOUR)


def test_what_is_in_doubt_is_reported(project: Path) -> None:
    """The frame and the person of an unknown camera, the cut line, the two cells that are no times."""
    assert "8 quarantined records removed, 5 as their camera or time cannot be read" in vsd(project, "purge", *HOUR)


def test_a_replay_after_the_purge_stores_nothing_of_it(project: Path) -> None:
    vsd(project, "purge", *HOUR)
    toml = TOML.replace('id = "cam-1"\n', 'id = "cam-1"\nengine_ids = ["yard"]\n')
    make_project(project, toml=toml + "[ingest]\ncoordinate_max_m = 1000000\n")
    vsd(project, "quarantine", "replay", code=None)
    told = json.loads(vsd(project, "export", *HOUR, "--out", str(project / "left.csv"), "--json"))
    assert (told["records"], told["quarantined"]) == ({"observations": 0}, 0)


@pytest.mark.parametrize("suffix", ["csv", "parquet", "jsonl"])
def test_an_export_shows_what_a_purge_would_remove(project: Path, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"asked.{suffix}"
    said = vsd(project, "export", *HOUR, "--out", str(out))
    beside = tmp_path / "asked.quarantine.jsonl"
    assert f"8 quarantined records written to {beside}, 5 of them" in said
    assert beside.stat().st_mode & 0o777 == 0o600
    shown = tracks(beside.read_text())
    vsd(project, "purge", *HOUR)
    assert shown.isdisjoint(held(project))
    vsd(project, "export", *HOUR, "--out", str(out))
    assert not beside.exists(), "nothing of an earlier export is handed on with this one"


def test_an_unreadable_record_that_came_before_the_time_is_not_meant(project: Path) -> None:
    before = held(project)
    vsd(project, "purge", "--camera", "cam-1", "--range", "2026-12-21..2026-12-22")
    assert held(project) == before


def test_a_camera_that_vsd_toml_does_not_know_any_more_loses_its_quarantined_records(project: Path) -> None:
    make_project(project, toml=TOML.replace('"cam-1"', '"cam-9"'))
    vsd(project, "purge", *HOUR)
    assert "meant-row" not in held(project)


def test_records_counted_only_are_no_records(project: Path) -> None:
    path = project / "quarantine" / "0123456789abcdef.jsonl"
    path.write_text('{"source":"a","line":0,"reason":"bad-json","n_not_kept":7}\n')
    vsd(project, "purge", *HOUR)
    assert [e.n_not_kept for e in quarantined(project) if e.n_not_kept] == [7]
