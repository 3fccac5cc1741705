"""What is planted in the demo comes out of its report: hotspot, outage, missing and low-data hour, redesign."""

from __future__ import annotations

import math
from collections import Counter
from datetime import UTC, date, datetime, timedelta
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from report.pages.test_report_numbers import strangers

from vsd_analytics.config.project import load_site
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.figures_by_id import figures_by_id
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.simulate.demo_project import write_demo_project
from vsd_analytics.simulate.truth import DemoTruth
from vsd_analytics.site.model import Site

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
    assert figures_by_id(report)["M0"].denominator == pytest.approx(4 * 84 - 10, abs=0.01)
    assert figures_by_id(report)["M8"].value == report.level.violations


def test_page_of_the_demo_is_small_and_marked_as_made_up(report: WeekReport) -> None:
    page = render_html(report)
    assert "Made-up data" in page
    assert len(page.encode()) < 250_000


def test_every_number_of_the_demos_page_is_in_its_json_file(report: WeekReport) -> None:
    assert strangers(report, render_html(report)) == set()


def test_one_hour_equals_a_count_by_hand(demo_project: Path, site: Site, truth: DemoTruth) -> None:
    """Saturday from 12:00 to 13:00, from the engine's own files, with plain Python: all cameras, each pair once.

    By hand cameras are compared at their frames; the facts compare them at every second, which once in a while tells
    two pairs apart, or joins them, where frames do not.
    """
    from vsd_analytics.geometry import ownership
    from vsd_analytics.warehouse.warehouse import open_warehouse

    owners = {(c.cx, c.cy): c.camera_id for c in ownership.owner_cells(site.cameras, cell_m=0.5, floor=site.floors[0])}
    ms = round(datetime(2026, 11, 14, 11, tzinfo=UTC).timestamp() * 1000)
    files = {c.camera_id: demo_project / "engine" / f"{c.camera_id}_2026-11-14.jsonl.zst" for c in site.cameras}
    # what began before the hour is not of it, however late it is seen first; what begins in it ends or lasts 3 s
    seen = {c: frames(path, ms - 600_000, ms + 3_600_000 + 60_000) for c, path in files.items()}
    step_ms = round(1000 * truth.frame_interval_s[0])
    by_hand = Counter(camera for camera, at in violations(seen, owners, step_ms) if ms <= at < ms + 3_600_000)
    with open_warehouse(site, MONDAY, MONDAY + timedelta(days=6)) as warehouse:
        rows = warehouse.rows("select camera_id, n_violations from camera_hours where hour_start_ms = $ms", {"ms": ms})
    counted = {r["camera_id"]: r["n_violations"] for r in rows}
    print(counted, dict(by_hand))
    assert counted.keys() == by_hand.keys()
    assert all(abs(counted[c] - by_hand[c]) <= 2 for c in counted)
    assert sum(by_hand.values()) > 100


Frames = dict[int, dict[str, tuple[int, int]]]
Run = tuple[str, str, str, tuple[int, ...]]


def frames(path: Path, first_ms: int, end_ms: int) -> Frames:
    """Return where everybody is at each instant of [first, end) in a file of frame messages, in millimetres."""
    import json

    with pa.CompressedInputStream(pa.OSFile(str(path)), "zstd") as stream:
        told = [json.loads(line) for line in stream.read().splitlines()]
    at = {round(datetime.fromisoformat(f["ts"]).timestamp() * 1000): f["persons"] for f in told}
    return {
        ms: {p["id"]: (round(1000 * p["x_m"]), round(1000 * p["y_m"])) for p in persons}
        for ms, persons in at.items()
        if first_ms <= ms < end_ms
    }


def violations(seen: dict[str, Frames], owners: dict[tuple[int, int], str], step_ms: int) -> list[tuple[str, int]]:
    """Return camera and first instant of every violation: runs of one camera, joined over cameras, counted once.

    Frames come every `step_ms`.
    """
    import networkx as nx

    runs = [r for camera, told in seen.items() for r in runs_of(camera, told, step_ms)]
    at: dict[int, dict[str, list[Run]]] = {}
    for run in runs:
        for ms in run[3]:
            at.setdefault(ms, {}).setdefault(run[0], []).append(run)

    def place(run: Run, ms: int) -> tuple[float, float]:
        (xa, ya), (xb, yb) = (seen[run[0]][ms][track] for track in run[1:3])
        return (xa + xb) / 2, (ya + yb) / 2

    def owner(run: Run, ms: int) -> str | None:
        x, y = place(run, ms)
        return owners.get((math.floor(x / 500), math.floor(y / 500)))

    def apart(one: Run, other: Run, ms: int) -> float:
        (a, b), (c, d) = ([seen[r[0]][ms][track] for track in r[1:3]] for r in (one, other))
        return min(max(math.dist(a, c), math.dist(b, d)), max(math.dist(a, d), math.dist(b, c)))

    same, both = Counter[tuple[Run, Run]](), Counter[tuple[Run, Run]]()
    for ms, cameras in at.items():
        for one, other in combinations(sorted(cameras), 2):
            mine, theirs = ([r for r in cameras[c] if owner(r, ms) is not None] for c in (one, other))
            off = {(r, q): apart(r, q, ms) for r in mine for q in theirs}
            both.update(off.keys())
            for (r, q), mm in off.items():
                if mm <= 500 and mm == min(off[r, t] for t in theirs) == min(off[t, q] for t in mine):
                    same[r, q] += 1
    graph = nx.Graph([pair for pair, n in same.items() if 2 * n >= both[pair]])
    graph.add_nodes_from(runs)
    found = []
    for component in nx.connected_components(graph):
        records = [(ms, r) for r in sorted(component) for ms in r[3] if owner(r, ms) in (None, r[0])]
        if records:
            begins = min(ms - lead(seen[r[0]], r, ms, -step_ms) for ms, r in records)
            ends = max(ms + lead(seen[r[0]], r, ms, step_ms) for ms, r in records)
            if ends - begins >= 3000:
                most = Counter(r[0] for _, r in records)
                found.append((max(sorted(most), key=lambda c: most[c]), min(ms for ms, _ in records)))
    return found


def runs_of(camera: str, told: Frames, step_ms: int) -> list[Run]:
    """Return the runs of pairs nearer than 2 m; a run ends when they are not within 2.3 m for over 2.5 frames."""
    near: dict[tuple[str, str], list[tuple[int, bool]]] = {}
    for ms in sorted(told):
        for (a, p), (b, q) in combinations(sorted(told[ms].items()), 2):
            if (mm := math.dist(p, q)) < 2300:
                near.setdefault((a, b), []).append((ms, mm < 2000))
    found: list[Run] = []
    for (a, b), seen in near.items():
        cuts = [i for i in range(1, len(seen)) if seen[i][0] - seen[i - 1][0] > 2.5 * step_ms]
        for low, high in pairwise([0, *cuts, len(seen)]):
            if close := tuple(ms for ms, is_close in seen[low:high] if is_close):
                found.append((camera, a, b, close))
    return found


def lead(told: Frames, run: Run, ms: int, step_ms: int) -> float:
    """Return for how long, in ms, they were close after a record, by way of the middle of a cubic.

    With a negative step: before it.
    """
    half_ms = abs(step_ms) // 2
    around = (told.get(ms + n * step_ms, {}) for n in (-1, 0, 1, 2))
    seen = [np.subtract(f[run[1]], f[run[2]]) if {run[1], run[2]} <= f.keys() else None for f in around]
    behind, r0, r1, beyond = seen
    if ms != run[3][0 if step_ms < 0 else -1] or r0 is None or r1 is None or math.hypot(*r1) < 2000:
        return half_ms
    v0 = r1 - r0 if behind is None else (r1 - behind) / 2
    v1 = r1 - r0 if beyond is None else (beyond - r0) / 2
    middle = (r0 + r1) / 2 + (v0 - v1) / 8
    way = np.concatenate([np.linspace(r0, middle, half_ms + 1), np.linspace(middle, r1, half_ms + 1)[1:]])
    return float(np.argmax(np.hypot(*way.T) >= 2000))


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
    row = next(a for a in report.areas if a.area_id == truth.change_effect.area_id)
    assert row.violation_rate.verdict == "clear_fall"
    assert (row.violation_rate.change_hi or 0) < -0.5
    line = next(line for line in report.log if line.area_id == truth.change_effect.area_id)
    assert line.at == truth.change_effect.at
    # few people are left there: without a level per person-hour there is no change of it either
    assert row.encounter_rate is not None
    assert (
        row.encounter_rate.value,
        row.encounter_rate.previous,
        row.encounter_rate.change,
        row.encounter_rate.verdict,
    ) == (
        None,
        None,
        None,
        "too_little_data",
    )
    assert report.story is not None
    assert report.story.things[0].title.startswith("Clear fall at")
    assert line.floor_share is not None
    violation_rate, parts = report.level.violation_rate, [a.difference for a in report.areas]
    assert violation_rate.previous is not None
    assert violation_rate.change is not None
    assert sum(p or 0.0 for p in parts) == pytest.approx(violation_rate.previous * violation_rate.change, rel=1e-9)
    assert line.floor_share == pytest.approx(
        (row.difference or 0.0) / (violation_rate.previous * violation_rate.change), rel=1e-9
    )
