"""Export: the records as they are stored, and back again."""

from __future__ import annotations

import csv
import json
import os
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from aged_projects import DAYS, TOML, make_project, messages, three_days, vsd, write
from test_purging_by_range import table

from vsd_analytics.errors import UsageError
from vsd_analytics.store import durable

HOUR = f"{DAYS[0]}T10:00..{DAYS[0]}T11:00"


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = make_project(tmp_path_factory.mktemp("kept") / "p")
    sent = messages(camera="cam-1", day="2026-11-13", hours=(9,))
    for k, message in enumerate(sent):
        ids = [p["id"] for p in message["persons"]]
        message["pairs"] = [{"a": ids[0], "b": ids[1], "distance_m": 1.234, "sd_m": 0.05}] if len(ids) == 2 else []
        message["quality"] = "body" if k % 2 else "metric"
        for person in message["persons"]:
            person.update(u_px=12.25, v_px=100.5)
    del sent[3]["persons"][0]["id"]
    vsd(root, "ingest", str(three_days(root)), str(write(root / "sent.jsonl", sent)))
    return root


def test_frame_messages_read_back_give_the_same_table(project: Path, tmp_path: Path) -> None:
    out = tmp_path / "all.jsonl"
    assert "3,720 person records" in vsd(project, "export", "--out", str(out))
    again = make_project(tmp_path / "again")
    vsd(again, "ingest", str(out))
    assert table(again) == table(project)
    assert out.stat().st_mode & 0o777 == 0o600
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".")] == []


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_read_back_gives_the_same_observations(project: Path, tmp_path: Path, suffix: str) -> None:
    out = tmp_path / f"people.{suffix}"
    vsd(project, "export", "--out", str(out), "--range", f"{DAYS[0]}..2026-11-12", "--camera", "cam-2")
    again = make_project(tmp_path / "again")
    vsd(again, "ingest", str(out))

    def places(root: Path) -> list[tuple[object, ...]]:
        rows = (
            r
            for p in (root / "store" / "observations").rglob("*.parquet")
            for r in pq.ParquetFile(p).read().to_pylist()
        )
        names = ("camera_id", "ts", "track_id", "x_mm", "y_mm")
        return sorted(tuple(r[n] for n in names) for r in rows if r["camera_id"] == "cam-2")

    assert places(again) == places(project)


def test_only_what_was_asked_for_is_handed_over(project: Path, tmp_path: Path) -> None:
    out = tmp_path / "asked.csv"
    told = json.loads(vsd(project, "export", "--camera", "cam-1", "--range", HOUR, "--out", str(out), "--json"))
    with out.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert told["records"] == {"observations": len(rows)} == {"observations": 120}
    assert {r["camera_id"] for r in rows} == {"cam-1"}
    assert {r["ts"][:13] for r in rows} == {f"{DAYS[0]} 09"}
    assert (rows[0]["x_mm"], rows[0]["x_m"]) == ("1000", "1")
    nothing = json.loads(vsd(project, "export", "--range", "2020-01-01", "--out", str(out), "--json"))
    assert nothing["records"] == {"observations": 0}


def test_pairs_without_ids_are_reported_and_are_in_the_table(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    lines = f"ts,camera_id,track_a,track_b,distance_m\n{DAYS[0]}T09:00:00Z,cam-1,,,1.5\n"
    (root / "pairs.csv").write_text(lines)
    vsd(root, "ingest", str(root / "pairs.csv"), "--format", "pairs")
    told = json.loads(vsd(root, "export", "--out", str(tmp_path / "all.jsonl"), "--json"))
    assert (told["left_out"], told["without_frame"], told["records"]["pairs"]) == (1, 1, 1)
    vsd(root, "export", "--table", "pairs", "--out", str(tmp_path / "pairs.parquet"))
    (row,) = pq.read_table(tmp_path / "pairs.parquet").to_pylist()
    assert (row["distance_mm"], row["distance_m"]) == (1500, 1.5)


@pytest.mark.parametrize(
    "arguments", [("--out", "x.txt"), ("--out", "x.jsonl", "--table", "pairs"), ("--out", "x.csv", "--table", "all")]
)
def test_wrong_forms_are_refused(project: Path, arguments: tuple[str, ...]) -> None:
    with pytest.raises(UsageError):
        vsd(project, "export", *arguments)


def test_a_file_that_cannot_be_written_leaves_nothing(project: Path, tmp_path: Path) -> None:
    with pytest.raises(OSError, match="nowhere"):
        vsd(project, "export", "--out", str(tmp_path / "nowhere" / "x.csv"))
    assert list(tmp_path.iterdir()) == []


def test_pseudonyms_are_exported_as_pseudonyms(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p", toml=TOML.replace("pseudonyms = false", ""))
    vsd(root, "ingest", str(write(root / "f.jsonl", messages(camera="cam-1", day=DAYS[0], hours=(9,)))))
    vsd(root, "export", "--out", str(tmp_path / "all.jsonl"))
    ids = {p["id"] for line in (tmp_path / "all.jsonl").read_text().splitlines() for p in json.loads(line)["persons"]}
    assert all(len(i) == 16 and int(i, 16) >= 0 for i in ids)


FORMULA = '=HYPERLINK("http://elsewhere")'


def test_a_track_id_that_is_a_formula_is_none_in_csv_and_itself_elsewhere(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p")
    found = messages(camera="cam-1", day=DAYS[0], hours=(9,))[:2]
    found[0]["persons"][0]["id"] = FORMULA
    del found[1]["persons"][0]["id"]
    vsd(root, "ingest", str(write(root / "f.jsonl", found)))
    for suffix in ("csv", "parquet", "jsonl"):
        vsd(root, "export", "--out", str(tmp_path / f"x.{suffix}"))
    with (tmp_path / "x.csv").open(newline="") as file:
        assert {r["track_id"] for r in csv.DictReader(file)} == {f"'{FORMULA}", "b9-0", ""}
    assert FORMULA in pq.read_table(tmp_path / "x.parquet")["track_id"].to_pylist()
    assert FORMULA in [p.get("id") for p in json.loads((tmp_path / "x.jsonl").read_text().splitlines()[0])["persons"]]


@pytest.mark.parametrize("suffix", ["csv", "parquet", "jsonl"])
def test_an_export_is_durable_before_it_has_its_name(
    project: Path, tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, synced, fsync = tmp_path / f"x.{suffix}", [], os.fsync

    def noting(fd: int) -> None:
        synced.append((os.fstat(fd).st_ino, os.fstat(fd).st_size, out.exists()))
        fsync(fd)

    monkeypatch.setattr(os, "fsync", noting)
    vsd(project, "export", "--out", str(out))
    assert (out.stat().st_ino, out.stat().st_size, False) in synced


def test_what_a_killed_export_left_is_removed_by_the_next_one(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Killed(BaseException):
        """The process ended here."""

    def killed(*_: object, **__: object) -> None:
        raise Killed

    with monkeypatch.context() as patched:
        patched.setattr(Path, "rename", killed)
        patched.setattr(Path, "unlink", killed)
        with pytest.raises(Killed):
            vsd(project, "export", "--out", str(tmp_path / "x.csv"))
    assert len(list(tmp_path.iterdir())) == 1
    others = {".x.csv", ".notes.csv.tmp", ".mine.0123456789abcdef.tmp"}
    for name in others:
        (tmp_path / name).touch()
    with durable.temporary(tmp_path / "y.csv") as (being_written, _):
        vsd(project, "export", "--out", str(tmp_path / "y.parquet"))
        assert {p.name for p in tmp_path.iterdir()} == {*others, being_written.name, "y.parquet"}
