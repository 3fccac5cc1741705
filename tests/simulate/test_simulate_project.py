from __future__ import annotations

import json
import tomllib
from collections import Counter
from datetime import datetime, timedelta
from itertools import islice, pairwise
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest

from vsd_analytics.config.project import load_site
from vsd_analytics.errors import UsageError
from vsd_analytics.ingest.formats.frames import Frames
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source
from vsd_analytics.simulate import demo_project as demo
from vsd_analytics.simulate.demo_project import opening, simulate_week, write_demo_project
from vsd_analytics.simulate.shop import AREA_RECTS
from vsd_analytics.simulate.truth import DemoTruth

Project = tuple[Path, DemoTruth]
INTERVAL_S = 8.0
"""Seconds from frame to frame of the project: a quarter of the frames of a demo."""
FRAMES_H = round(3600 / INTERVAL_S)


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    folder = tmp_path_factory.mktemp("demo") / "shop"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(demo, "DETAILED_S", INTERVAL_S)
        return folder, write_demo_project(folder, seed=1, weeks=2)


def messages(folder: Path, name: str) -> list[dict]:  # type: ignore[type-arg]
    decode = msgspec.json.Decoder().decode
    with Source(folder / "engine" / f"{name}.jsonl.zst").open() as f:
        return [decode(line) for line in f.read().splitlines()]


def instants(folder: Path, name: str) -> list[datetime]:
    return [datetime.fromisoformat(m["ts"]) for m in messages(folder, name)]


def test_same_arguments_give_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        demo, "simulate_week", lambda monday, **rest: islice(simulate_week(monday, **rest | {"interval_s": 15.0}), 1)
    )
    truths = [write_demo_project(tmp_path / name, seed=7, weeks=1) for name in "ab"]
    assert truths[0] == truths[1]
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert len(files) == 4 + 4 + 4 + 1 + 3
    assert all((tmp_path / "a" / f).read_bytes() == (tmp_path / "b" / f).read_bytes() for f in files)


def test_truth_file_reads_back(project: Project) -> None:
    folder, truth = project
    read = DemoTruth.read(folder / "truth.json")
    assert read == truth
    assert read.weeks == ("2026-W45", "2026-W46")
    assert len(read.hours) == 2 * 86


def test_toml_names_files_that_exist_and_areas_on_the_floor(project: Project) -> None:
    folder, _ = project
    site = tomllib.loads((folder / "vsd.toml").read_text())
    assert site["site"]["timezone"] == "Europe/Rome"
    assert [c["id"] for c in site["camera"]] == ["cam-1", "cam-2", "cam-3", "cam-4"]
    for camera in site["camera"]:
        assert np.loadtxt(folder / camera["homography"]).shape == (3, 3)
        assert (folder / camera["picture"]).stat().st_size < 90_000
        assert camera["hz"] == 1 / INTERVAL_S
    for area in site["area"]:
        assert all(0 <= x <= 24 and 0 <= y <= 16 for x, y in area["polygon"])
    floor = site["floor"][0]
    plan = ElementTree.fromstring((folder / floor["plan"]).read_text())
    assert float(plan.get("width", "")) * floor["plan_m_per_px"] == 24
    assert float(plan.get("height", "")) * floor["plan_m_per_px"] == 16
    assert {e.tag.rpartition("}")[2] for e in plan.iter()} == {"svg", "path"}


def test_site_loads_and_the_frames_adapter_takes_every_message(project: Project) -> None:
    folder, _ = project
    site = load_site(folder)
    assert [a.area_id for a in site.areas] == list(AREA_RECTS)
    assert all(c.calibrations and c.picture_px == (1280, 720) for c in site.cameras)
    source = Source(folder / "engine" / "cam-1_2026-11-14.jsonl.zst")
    adapter = Frames()
    assert adapter.detects(source)
    batches = list(adapter.read(source, IngestOptions()))
    assert sum(b.table("frames").num_rows for b in batches) == 13.5 * FRAMES_H
    assert sum(b.table("observations").num_rows for b in batches) > 10_000
    assert not [r for b in batches for r in b.rejected]


def test_change_log_holds_the_redesign_before_the_first_open_hour_of_the_last_week(project: Project) -> None:
    folder, truth = project
    entries = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    redesign = next(e for e in entries if e["area"] == truth.redesign.area_id)
    assert datetime.fromisoformat(redesign["at"]) == truth.redesign.at
    assert redesign["at"] == "2026-11-09T06:30:00+01:00"
    assert redesign["text"] == truth.redesign.text
    assert all(set(e) == {"at", "text", "area"} for e in entries)


def test_engine_runs_from_a_quarter_before_opening_to_a_quarter_after_closing(project: Project) -> None:
    for name, begin, end in (("cam-2_2026-11-04", "06:45", "20:15"), ("cam-2_2026-11-08", "08:45", "17:15")):
        at = instants(project[0], name)
        assert f"{at[0]:%H:%M:%S}" == f"{begin}:00"
        assert at[-1] + timedelta(seconds=INTERVAL_S) == at[0].replace(hour=int(end[:2]), minute=int(end[3:]))
        assert {b - a for a, b in pairwise(at)} == {timedelta(seconds=INTERVAL_S)}


def test_outage_silences_one_camera_only(project: Project) -> None:
    folder, truth = project
    (camera,) = truth.outage.cameras
    assert truth.outage.end - truth.outage.start == timedelta(hours=21)
    for day in ("2026-11-12", "2026-11-13"):
        down = instants(folder, f"{camera}_{day}")
        assert down
        assert not [t for t in down if truth.outage.start <= t < truth.outage.end]
        up = [t for t in instants(folder, f"cam-1_{day}") if truth.outage.start <= t < truth.outage.end]
        assert len(up) > 1.6 * FRAMES_H
    seqs = [m["seq"] for m in messages(folder, f"{camera}_2026-11-13")]
    assert seqs[0] > messages(folder, f"{camera}_2026-11-12")[-1]["seq"] + 1, "the gap shows in seq"


@pytest.mark.parametrize("camera", ["cam-1", "cam-4"])
def test_one_hour_is_missing_and_one_is_recorded_less_than_half(project: Project, camera: str) -> None:
    folder, truth = project
    tuesday = Counter(t.hour for t in instants(folder, f"{camera}_2026-11-10"))
    assert truth.missing.start.isoformat() == "2026-11-10T20:00:00+01:00"
    assert tuesday[19] == 0
    assert tuesday[18] == FRAMES_H
    sunday = Counter(t.hour for t in instants(folder, f"{camera}_2026-11-15"))
    assert truth.low_data.end.isoformat() == "2026-11-15T10:35:00+01:00"
    assert 0 < sunday[9] < FRAMES_H / 2
    assert sunday[10] == FRAMES_H


def test_redesign_at_least_halves_violations_in_its_area_and_nowhere_else(project: Project) -> None:
    _, truth = project
    rate = {(a.week, a.area_id): a.violations / a.open_h for a in truth.areas}
    change = {area: rate["2026-W46", area] / rate["2026-W45", area] for area in AREA_RECTS}
    assert truth.redesign.effect == pytest.approx(change["entrance"], abs=1e-3)
    assert change["entrance"] < 0.5
    assert all(0.7 < change[area] < 1.4 for area in AREA_RECTS if area != "entrance")


def test_redesign_shows_in_what_the_camera_reports(project: Project) -> None:
    folder, _ = project
    x0, y0, x1, y1 = AREA_RECTS["entrance"]
    records = []
    for day in ("2026-11-04", "2026-11-11"):
        n = 0
        for message in messages(folder, f"cam-1_{day}"):
            xy = np.array([(p["x_m"], p["y_m"]) for p in message["persons"]]).reshape(-1, 2)
            i, j = np.triu_indices(len(xy), 1)
            middle = (xy[i] + xy[j]) / 2
            inside = (middle >= (x0, y0)).all(axis=1) & (middle < (x1, y1)).all(axis=1)
            n += int((inside & (np.hypot(*(xy[i] - xy[j]).T) < 2.0)).sum())
        records.append(n)
    assert records[1] < 0.5 * records[0]


def test_hotspot_has_the_stated_concentration(project: Project) -> None:
    _, truth = project
    last = {a.area_id: a.violations for a in truth.areas if a.week == "2026-W46"}
    x0, y0, x1, y1 = AREA_RECTS["checkout-queue"]
    blocked_m2 = 24 * 16 - 5 * 5 - 2.8 * 3.4  # storeroom and office; shelves make the rest a little smaller still
    density = last["checkout-queue"] / ((x1 - x0) * (y1 - y0))
    elsewhere_at_least = (last["floor"] - last["checkout-queue"]) / blocked_m2
    assert 0.7 * density / elsewhere_at_least < truth.hotspot.rate_ratio < density / elsewhere_at_least
    assert truth.hotspot.rate_ratio > 5
    assert max(last, key=lambda a: last[a] if a != "floor" else 0) == truth.hotspot.area_id
    assert x0 < truth.hotspot.x_m < x1
    assert y0 < truth.hotspot.y_m < y1


def test_counts_of_messages_and_persons_are_true(project: Project) -> None:
    folder, truth = project
    n_messages = n_persons = 0
    for path in sorted((folder / "engine").iterdir()):
        with Source(path).open() as f:
            text = f.read()
        n_messages, n_persons = n_messages + text.count(b"\n"), n_persons + text.count(b'"id":')
    assert (n_messages, n_persons) == (truth.n_messages, truth.n_person_records)


def test_opening_hours_follow_local_time_over_the_change_of_clocks() -> None:
    before, after = opening(datetime(2026, 3, 28).date())[0], opening(datetime(2026, 3, 30).date())[0]
    assert before.isoformat() == "2026-03-28T08:00:00+01:00"
    assert after.isoformat() == "2026-03-30T08:00:00+02:00"


@pytest.mark.parametrize(
    "arguments",
    [
        {"weeks": 0},
        {"last_week": "2026-46"},
        {"last_week": "2026-W54"},
        {"last_week": "0000-W01"},
        {"detailed_weeks": 0},
    ],
)
def test_bad_arguments_are_refused_before_anything_is_written(tmp_path: Path, arguments: dict) -> None:  # type: ignore[type-arg]
    with pytest.raises(UsageError):
        write_demo_project(tmp_path / "new", **arguments)
    assert not (tmp_path / "new").exists()


def test_a_folder_with_a_project_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "vsd.toml").write_text("[site]\n")
    with pytest.raises(UsageError, match="already holds a project"):
        write_demo_project(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == ["vsd.toml"]
