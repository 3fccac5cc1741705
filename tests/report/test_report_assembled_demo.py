"""What is planted in the demo comes out of its report: hotspot, outage, missing and low-data hour, redesign."""

from __future__ import annotations

import math
from collections import Counter
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from report.test_report_numbers import strangers

from vsd_analytics.config import load_site
from vsd_analytics.ingest.adapter import IngestOptions
from vsd_analytics.ingest.pipeline import ingest
from vsd_analytics.report.assemble import week_report
from vsd_analytics.report.model import WeekReport
from vsd_analytics.report.render import render_html
from vsd_analytics.simulate import DemoTruth, write_demo_project
from vsd_analytics.site import Site

MONDAY = date(2026, 11, 9)


@pytest.fixture(scope="module")
def truth(demo_project: Path) -> DemoTruth:
    return DemoTruth.read(demo_project / "truth.json")


@pytest.fixture(scope="module")
def site(demo_project: Path) -> Site:
    return load_site(demo_project)


@pytest.fixture(scope="module")
def report(site: Site) -> WeekReport:
    return week_report(site, MONDAY)


def test_planted_hotspot_is_the_busiest_spot(report: WeekReport, truth: DemoTruth) -> None:
    assert report.busiest_spot is not None
    assert report.busiest_spot.area_id == truth.hotspot.area_id
    first = report.maps[0].spots[0]
    assert first.number == 1
    assert math.dist(first.at, (truth.hotspot.x_m, truth.hotspot.y_m)) < 1.0
    assert report.areas[0].area_id == truth.hotspot.area_id


def test_planted_gaps_are_hatched_dashed_and_dotted(report: WeekReport, truth: DemoTruth) -> None:
    cells = {c.start: c for c in report.when.cells}
    missing = cells[truth.missing.start]
    assert (missing.state, missing.violations) == ("no_data", None)
    low = cells[truth.low_data.end.replace(minute=0)]
    assert low.state == "low_data"
    assert low.share == pytest.approx(25 / 60, abs=0.01)
    down = [c for c in report.when.cells if truth.outage.start <= c.start < truth.outage.end and c.state != "closed"]
    assert len(down) == 10
    assert {(c.state, c.cameras_down) for c in down} == {("partial", 1)}
    rest = set(cells.values()) - {missing, low, *down}
    assert {c.state for c in rest} == {"full", "closed"}
    page = render_html(report)
    assert page.count('<td class="hatch">') == 1
    (outage,) = [o for o in report.coverage.outages if o.camera_ids == truth.outage.cameras]
    assert (outage.start, outage.end) == (truth.outage.start, truth.outage.end)
    assert outage.open_h == 10


def test_missing_hours_are_in_no_rate(report: WeekReport) -> None:
    full = {c.camera_id: c.recorded_h for c in report.coverage.cameras}
    # 86 open hours: one missing, one low-data hour of 25 minutes, and ten of camera 3
    assert full["cam-1"] == pytest.approx(85 - 35 / 60, abs=0.01)
    assert report.figures["M0"].denominator == pytest.approx(4 * 84 - 10, abs=0.01)
    assert report.figures["M8"].value == report.level.violations


def test_page_of_the_demo_is_small_and_marked_as_made_up(report: WeekReport) -> None:
    page = render_html(report)
    assert "Made-up data" in page
    assert len(page.encode()) < 250_000


def test_every_number_of_the_demos_page_is_in_its_twin(report: WeekReport) -> None:
    assert strangers(report, render_html(report)) == set()


def test_one_hour_equals_a_count_by_hand(demo_project: Path, site: Site) -> None:
    """Saturday from 12:00 to 13:00, from the engine's own files, with plain numpy."""
    from vsd_analytics import ownership
    from vsd_analytics.warehouse.warehouse import open_warehouse

    owners = {(c.cx, c.cy): c.camera_id for c in ownership.owner_cells(site.cameras, cell_m=0.5, floor=site.floors[0])}
    start = datetime(2026, 11, 14, 11, tzinfo=UTC)
    by_hand = Counter({c.camera_id: 0 for c in site.cameras})
    for camera in site.cameras:
        for (x, y), begins in episodes(demo_project / "engine" / f"{camera.camera_id}_2026-11-14.jsonl.zst"):
            if start <= begins < start + timedelta(hours=1):
                by_hand[camera.camera_id] += (
                    owners.get((math.floor(x / 0.5), math.floor(y / 0.5)), camera.camera_id) == camera.camera_id
                )
    with open_warehouse(site, MONDAY, MONDAY + timedelta(days=6)) as warehouse:
        rows = warehouse.rows(
            "select camera_id, n_violations from camera_hours where hour_start_ms = $ms",
            {"ms": round(start.timestamp() * 1000)},
        )
    assert {r["camera_id"]: r["n_violations"] for r in rows} == dict(by_hand)
    assert sum(by_hand.values()) > 100


def episodes(path: Path) -> list[tuple[tuple[float, float], datetime]]:
    """Return mean midpoint and first instant of every violation in a file of frame messages, one every 2 s."""
    import json

    with pa.CompressedInputStream(pa.OSFile(str(path)), "zstd") as stream:
        frames = [json.loads(line) for line in stream.read().splitlines()]
    runs: dict[tuple[str, str], list[tuple[int, float, float]]] = {}
    found = []
    for frame in frames:
        ms = round(datetime.fromisoformat(frame["ts"]).timestamp() * 1000)
        people = sorted(frame["persons"], key=lambda p: p["x_m"])
        for i, a in enumerate(people):
            for b in people[i + 1 :]:
                if b["x_m"] - a["x_m"] >= 2:
                    break
                mm = [round(1000 * (a[k] - b[k])) for k in ("x_m", "y_m")]
                if mm[0] ** 2 + mm[1] ** 2 < 2000**2:
                    key = min(a["id"], b["id"]), max(a["id"], b["id"])
                    middle = ms, (a["x_m"] + b["x_m"]) / 2, (a["y_m"] + b["y_m"]) / 2
                    if key in runs and ms - runs[key][-1][0] > 5000:
                        found.append(runs.pop(key))
                    runs.setdefault(key, []).append(middle)
    out = []
    for run in [*found, *runs.values()]:
        if run[-1][0] - run[0][0] + 2000 >= 3000:
            x, y = np.mean([r[1:] for r in run], axis=0)
            out.append(((float(x), float(y)), datetime.fromtimestamp(run[0][0] / 1000, tz=UTC)))
    return out


def test_planted_redesign_is_a_clear_fall_in_its_area(tmp_path: Path) -> None:
    """Two weeks of the entrance's camera alone, which sees the display that was moved."""
    truth = write_demo_project(tmp_path, seed=4, weeks=2)
    text = (tmp_path / "vsd.toml").read_text(encoding="utf-8")
    blocks = [b for b in text.split("\n\n") if not b.startswith("[[camera]]") or 'id = "cam-1"' in b]
    (tmp_path / "vsd.toml").write_text("\n\n".join(blocks), encoding="utf-8")
    site = load_site(tmp_path)
    files = sorted((tmp_path / "engine").glob("cam-1_*"))
    ingest(site, files, IngestOptions(format="frames"), now=datetime(2026, 11, 20, tzinfo=UTC))
    report = week_report(site, MONDAY)
    row = next(a for a in report.areas if a.area_id == truth.redesign.area_id)
    assert row.often.verdict == "clear_fall"
    assert (row.often.change_hi or 0) < -0.5
    line = next(line for line in report.log if line.area_id == truth.redesign.area_id)
    assert line.at == truth.redesign.at
    assert line.since is not None
    assert line.since.verdict == "clear_fall"
    # few people are left there: without a level per person-hour there is no change of it either
    assert row.risky is not None
    assert (row.risky.value, row.risky.previous, row.risky.change, row.risky.verdict) == (
        None,
        None,
        None,
        "too_little_data",
    )
    assert report.story is not None
    assert "seems to have worked" in report.story.things[0].title
