"""What was deleted on request does not come back; what was imported by mistake may."""

from __future__ import annotations

import json
import shutil
from datetime import datetime
from pathlib import Path
from typing import Any

import pytest
from aged_projects import DAYS, TOML, audit, make_project, messages, three_days, vsd, write

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import StoreError, UsageError
from vsd_analytics.live.batches import ReceivedMessage
from vsd_analytics.live.decode import Preparer
from vsd_analytics.schema import TABLES
from vsd_analytics.store.part_files import read_part
from vsd_analytics.store.store import Store

MORNING = f"{DAYS[0]}T10:00..{DAYS[0]}T12:00"  # Rome is an hour ahead: 9 and 10 UTC
ERASE = ("purge", "--camera", "cam-1", "--range", MORNING, "--reason", "request 7")
WHOLE_DAY = ("--camera", "cam-1", "--range", DAYS[0], "--reason", "request 7", "--force")


def figures(root: Path) -> tuple[str, ...]:
    """Return what commands print of the day, without what names the project's files."""
    hours = vsd(root, "hours", "--range", DAYS[0], "--by", "camera", "--json")
    groups = vsd(root, "groups", "--range", DAYS[0])
    cells = vsd(root, "heatmap", "--range", DAYS[0], "--format", "csv")
    query = "select * from episodes order by all"
    return hours, groups, cells, vsd(root, "sql", query, "--range", DAYS[0], "--format", "csv")


def rows_of(root: Path) -> dict[str, list[str]]:
    store = Store(root / "store", site_id="shop")
    return {t: sorted(str(r) for p in store.parts(t) for r in read_part(p.path, t).to_pylist()) for t in TABLES}


def delivered(tmp_path: Path, *, camera: str = "cam-1") -> Path:
    return write(tmp_path / "again.jsonl", messages(camera=camera, day=DAYS[0], hours=(9, 10)))


def nothing_in_quarantine(root: Path) -> bool:
    return not (root / "quarantine").exists() or not any((root / "quarantine").glob("*.jsonl"))


def test_figures_after_an_erasure_are_those_of_a_store_that_never_had_the_records(
    project: Path, tmp_path: Path
) -> None:
    vsd(project, *ERASE)
    every = [json.loads(line) for line in three_days(tmp_path).read_text(encoding="utf-8").splitlines()]
    hours = (f"{DAYS[0]}T09", f"{DAYS[0]}T10")
    others = [m for m in every if m["camera"] != "cam-1" or not m["ts"].startswith(hours)]
    never = make_project(tmp_path / "never")
    vsd(never, "ingest", str(write(tmp_path / "others.jsonl", others)), code=None)
    assert rows_of(project) == rows_of(never)
    assert figures(project) == figures(never)
    vsd(project, "ingest", str(delivered(tmp_path)), code=None)
    assert rows_of(project) == rows_of(never)
    assert figures(project) == figures(never)


def test_a_file_does_not_bring_erased_records_back_and_each_is_counted(project: Path, tmp_path: Path) -> None:
    before = rows_of(project)
    vsd(project, *ERASE)
    erased = rows_of(project)
    n = sum(len(before[t]) - len(erased[t]) for t in TABLES)
    output = json.loads(vsd(project, "ingest", str(delivered(tmp_path)), "--json", code=None))
    (source,) = output["sources"]
    assert source["left_out"] == {"erased on request": n}
    assert any(note.startswith("W312") for note in source["notes"])
    assert rows_of(project) == erased
    assert nothing_in_quarantine(project)


def test_records_beside_the_interval_and_of_other_cameras_are_stored(project: Path, tmp_path: Path) -> None:
    vsd(project, *ERASE)
    frames = [{**messages(camera="cam-1", day=DAYS[0], hours=(9,))[0], "seq": 1000 + k} for k in range(5)]
    for frame, at in zip(frames, ("08:59:59.999", "09:00:00", "10:59:59.999", "11:00:00", "09:30:00"), strict=True):
        frame["ts"] = f"{DAYS[0]}T{at}Z"
    frames[4]["camera"] = "cam-2"
    output = json.loads(vsd(project, "ingest", str(write(tmp_path / "near.jsonl", frames)), "--json", code=None))
    assert output["stored"]["frames"]["new"] == 3
    assert output["sources"][0]["left_out"] == {"erased on request": 2 * 3}, "a frame and two people, twice"


def test_the_fold_drops_erased_records_whoever_put_them_into_the_spool(project: Path) -> None:
    """A listener that appended before the purge, a node, a restored spool: all end in the fold."""
    kept = [read_part(path, "observations") for path in sorted((project / "store" / "observations").rglob("*.parquet"))]
    vsd(project, *ERASE)
    erased = rows_of(project)
    store = Store(project / "store", site_id="shop")
    for rows in kept:
        store.append("observations", rows)
    assert store.fold().n_erased > 0
    assert rows_of(project) == erased


def test_a_live_message_of_erased_times_is_dropped_and_counted(project: Path) -> None:
    """The listeners for MQTT and HTTP read messages by the same `Preparer`; so does a purge made while one runs."""
    preparer = Preparer(load_site(project), now=datetime.fromisoformat(f"{DAYS[0]}T12:00:00+00:00"))
    (found, beside) = messages(camera="cam-1", day=DAYS[0], hours=(9, 11))[45:136:90]
    vsd(project, *ERASE)

    def prepared(message: dict[str, Any]) -> Any:
        payload = json.dumps(message).encode()
        received = ReceivedMessage("vsd/cam-1/frames", payload, len(payload), is_retained=False)
        return preparer.prepare([received], now=datetime.fromisoformat(f"{DAYS[0]}T12:00:00+00:00"))

    got = prepared(found)
    assert sum(rows.num_rows for rows in got.tables.values()) == 0
    assert not got.rejected
    assert got.n_dropped["erased on request"] == 1 + len(found["persons"])
    assert prepared(beside).tables["frames"].num_rows == 1


def test_the_quarantine_does_not_bring_erased_records_back(project: Path, tmp_path: Path) -> None:
    """Records that came while their camera had another name; the purge cannot know whose they are."""
    vsd(project, "ingest", str(delivered(tmp_path, camera="side-door")), code=1)
    vsd(project, *ERASE)
    vsd(project, "ingest", str(delivered(tmp_path, camera="side-door")), code=1)
    erased = rows_of(project)
    toml = (project / "vsd.toml").read_text(encoding="utf-8")
    (project / "vsd.toml").write_text(toml.replace('id = "cam-1"', 'id = "cam-1"\nengine_ids = ["side-door"]', 1))
    output = json.loads(vsd(project, "quarantine", "replay", "--json", code=None))
    assert output["left_out"]["erased on request"] > 0
    assert output["stored"] == {}
    assert rows_of(project) == erased


def test_what_cannot_be_read_among_erased_records_goes_to_quarantine_without_its_text(
    project: Path, tmp_path: Path
) -> None:
    """Nobody knows of what time such a line is, and a replay or a reader of the quarantine would bring it back."""
    good = messages(camera="cam-1", day=DAYS[0], hours=(9, 10))
    cut = json.dumps({**good[0], "persons": [{"id": "walker-77", "x_m": 1.0, "y_m": 1.0}]})[:-2]
    timeless = json.dumps({**good[1], "ts": None, "persons": [{"id": "walker-78", "x_m": 1.0, "y_m": 1.0}]})
    lines = [*map(json.dumps, good[:40]), cut, timeless, *map(json.dumps, good[40:])]
    file = tmp_path / "again.jsonl"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")

    def quarantined() -> str:
        vsd(project, "ingest", str(file), code=1)
        return "".join(path.read_text(encoding="utf-8") for path in (project / "quarantine").glob("*.jsonl"))

    assert "walker-77" in quarantined()
    vsd(project, *ERASE)
    for path in (project / "quarantine").glob("*.jsonl"):
        path.unlink()
    after = quarantined()
    assert "walker-7" not in after
    assert "its text is not stored" in after


def test_sealed_hours_lose_the_camera_and_late_records_of_them_are_erased_not_quarantined(
    purged: Path, tmp_path: Path
) -> None:
    vsd(purged, "purge", *WHOLE_DAY)
    erased = figures(purged)
    assert '"cam-1"' not in vsd(purged, "sql", "select distinct camera_id from internal.coverage", "--range", DAYS[0])
    output = json.loads(vsd(purged, "ingest", str(delivered(tmp_path)), "--json", code=None))
    assert output["sources"][0]["quarantined"] == {}
    assert nothing_in_quarantine(purged)
    assert figures(purged) == erased


def test_part_of_a_sealed_hour_cannot_be_erased_and_nothing_is_noted(purged: Path) -> None:
    part = f"{DAYS[0]}T10:05..{DAYS[0]}T10:10"
    with pytest.raises(StoreError, match="inside an hour whose records were purged") as refused:
        vsd(purged, "purge", "--camera", "cam-1", "--range", part, "--reason", "request 7")
    assert refused.value.code == "E312"
    assert not (purged / "store" / "erasures.json").exists()


def test_the_list_of_erasures_names_nobody_and_only_its_owner_reads_it(project: Path) -> None:
    vsd(project, *ERASE)
    path = project / "store" / "erasures.json"
    assert "request" not in path.read_text(encoding="utf-8")
    (erasure,) = json.loads(path.read_text(encoding="utf-8"))
    assert erasure.keys() == {"which", "reason"}
    assert erasure["which"].keys() == {"camera_id", "first_ms", "after_ms"}
    assert path.stat().st_mode & 0o777 == 0o600


def test_the_same_erasure_again_changes_nothing(project: Path) -> None:
    vsd(project, *ERASE)
    n_lines = len(audit(project))
    vsd(project, *ERASE)
    assert len(audit(project)) == n_lines == 1


def test_times_without_records_can_be_erased_before_a_file_brings_them(tmp_path: Path) -> None:
    root = make_project(tmp_path / "p", toml=TOML)
    vsd(root, "ingest", str(delivered(tmp_path, camera="cam-2")))
    vsd(root, *ERASE)
    vsd(root, "ingest", str(delivered(tmp_path)), code=None)
    assert not any("'cam-1'" in row for rows in rows_of(root).values() for row in rows)


def test_a_damaged_list_stops_every_door_instead_of_letting_records_in(project: Path, tmp_path: Path) -> None:
    vsd(project, *ERASE)
    (project / "store" / "erasures.json").write_bytes(b"[")
    erased = rows_of(project)
    output = json.loads(vsd(project, "ingest", str(delivered(tmp_path)), "--json", code=2))
    assert output["sources"][0]["error"]["code"] == "E302"
    assert rows_of(project) == erased


def test_a_purge_without_a_reason_is_repeatable_and_an_erasure_can_be_lifted(project: Path, tmp_path: Path) -> None:
    before, file = figures(project), delivered(tmp_path)
    for _ in range(2):
        vsd(project, *ERASE[:-2])
        vsd(project, "ingest", str(file), "--yes", code=None)
        assert figures(project) == before
    vsd(project, *ERASE)
    vsd(project, *ERASE, "--lift")
    assert audit(project)[-1]["lifted"] is True
    vsd(project, "ingest", str(file), "--yes", code=None)
    assert figures(project) == before


def test_only_the_camera_range_and_reason_of_an_erasure_lift_it(project: Path) -> None:
    vsd(project, *ERASE)
    with pytest.raises(UsageError, match="there is no such erasure"):
        vsd(project, *ERASE[:-1], "request 8", "--lift")
    assert len(json.loads((project / "store" / "erasures.json").read_bytes())) == 1


def test_a_taken_back_import_can_be_repeated(project: Path, tmp_path: Path) -> None:
    """An undo is no erasure, with or without a reason."""
    file = write(tmp_path / "more.jsonl", messages(camera="cam-1", day=DAYS[0], hours=(15,)))
    vsd(project, "ingest", str(file), "--yes", code=None)
    with_it = rows_of(project)
    newest = json.loads(vsd(project, "imports", "--json"))["imports"][-1]["id"]
    vsd(project, "purge", "--import", newest, "--reason", "the wrong day")
    assert rows_of(project) != with_it
    shutil.rmtree(project / "quarantine", ignore_errors=True)
    vsd(project, "ingest", str(file), "--yes", code=None)
    assert rows_of(project) == with_it
