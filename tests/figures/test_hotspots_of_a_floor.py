"""Hotspots of a floor: planted ones are found, and what cannot be known is refused with its reason."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import shapely
from planted_floors import LAST, QUEUE, SHAPE, VIEW, planted, site_of, square

from vsd_analytics.config.change_log import add_entry
from vsd_analytics.config.project import load_site
from vsd_analytics.figures import cell_weeks
from vsd_analytics.figures.floor_days import NO_FLOOR, NO_IDS, NO_POSITIONS, FloorDays
from vsd_analytics.figures.hotspots import FloorHotspots, hotspots
from vsd_analytics.ingest.intake.pipeline import ingest
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.simulate.truth import DemoTruth
from vsd_analytics.site.model import Area, Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.wording.reasons import reason_text

HOT = square(5, 5)
EVEN = np.ones(SHAPE)


def always(risk: np.ndarray) -> Callable[[int], np.ndarray]:
    return lambda day: risk


def test_planted_hotspot_is_found_with_place_ratio_and_excess(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), always(HOT)) as warehouse:
        found = hotspots(warehouse)
    assert (found.state, found.reason, found.n_days) == ("ok", None, 28)
    (spot,) = found.spots
    assert math.dist((spot.place.x_m, spot.place.y_m), (5, 5)) < 1
    assert (spot.place.area_id, spot.place.name) == ("queue", "Queue")
    outline = shapely.union_all([shapely.Polygon(rings[0], rings[1:]) for rings in spot.place.polygons])
    assert outline.area == spot.place.area_m2
    assert outline.contains(shapely.Point(5, 5))
    # of cells that smoothing adds at the rim, some are not riskier; the ratio is of all of them together
    inside = np.array([[outline.contains(shapely.Point(x + 0.5, y + 0.5)) for x in range(16)] for y in range(12)])
    # three of four people there have somebody near already, so four times as much is all their time: 1 / .325
    truth = np.minimum(HOT, 1 / 0.325)[inside].mean()
    assert spot.lo is not None
    assert spot.hi is not None
    assert spot.ratio == pytest.approx(truth, rel=0.08)
    assert spot.lo < spot.ratio < spot.hi
    assert spot.excess_min_per_week == pytest.approx(60 * (spot.violation_h - spot.expected_h) / 4)
    assert spot.ratio == pytest.approx(spot.violation_h / spot.expected_h)
    assert (spot.state, spot.is_since_first, found.compared_with) == ("persisting", True, LAST - timedelta(days=7))


def test_a_window_read_day_by_day_gives_the_same_figures_as_all_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the last digit; pieces of an older window are forgotten, so that one window is in memory."""

    def found(most: int) -> tuple[list[int], FloorHotspots]:
        monkeypatch.setattr(cell_weeks, "PIECE_HOURS", most)
        with planted(site_of(tmp_path / str(most)), always(HOT)) as warehouse:
            hours = cell_weeks.CellWeeks(warehouse, warehouse.site.floors[0])
            windows = [hours.window(LAST - timedelta(days=k + 27), LAST - timedelta(days=k)) for k in (7, 0)]
            assert len(hours._read) == len(windows[-1])
            return [len(pieces) for pieces in windows], hotspots(warehouse)

    (_, at_once), (n_pieces, by_days) = found(10**9), found(1)
    assert n_pieces == [21, 28]  # days of each window that are loaded
    assert repr(by_days) == repr(at_once)
    assert by_days.spots


def test_rows_that_a_query_returns_in_another_order_are_put_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def backwards(*asked: Any) -> pa.Table:
        rows = in_order(*asked)
        return rows.take(np.arange(rows.num_rows)[::-1])

    in_order = cell_weeks.CellWeeks._asked
    with planted(site_of(tmp_path), always(HOT)) as warehouse:
        expected = hotspots(warehouse)
        monkeypatch.setattr(cell_weeks.CellWeeks, "_asked", backwards)
        found = hotspots(warehouse)
    assert [(s.place.name, s.ratio) for s in found.spots] == [
        (s.place.name, pytest.approx(s.ratio)) for s in expected.spots
    ]
    assert found.spots


def test_without_an_earlier_window_nobody_knows_what_is_new(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), always(HOT), n_days=20) as warehouse:
        found = hotspots(warehouse)
    assert (found.spots[0].state, found.spots[0].since, found.compared_with) == (None, LAST, None)


def test_a_floor_without_hotspot_says_so(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), always(EVEN)) as warehouse:
        found = hotspots(warehouse)
    assert (found.state, found.spots) == ("ok", ())


def test_crowds_are_no_hotspot(tmp_path: Path) -> None:
    crowd = square(10, 6, radius_m=2.5, ratio=8)
    with planted(site_of(tmp_path), always(EVEN), cells_of=lambda hours: hours * crowd) as warehouse:
        assert hotspots(warehouse).spots == ()


def test_place_outside_areas_is_reported_by_metres_and_the_nearest_area(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), always(square(12, 6)), shift_m=(-4, -2)) as warehouse:
        (spot,) = hotspots(warehouse).spots
    assert math.dist((spot.place.x_m, spot.place.y_m), (8, 4)) < 1
    assert spot.place.area_id is None
    assert (spot.place.nearest_id, round(spot.place.nearest_m or 0)) == ("queue", 1)
    assert spot.place.name.endswith(" m")


def test_closed_days_are_in_no_week(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    with planted(site, always(HOT), recorded=lambda camera, day: float(day % 7 != 6)) as warehouse:
        warehouse.con.execute("update camera_hours set open_s = 0 where recorded_open_s = 0")
        (spot,) = hotspots(warehouse).spots
    assert spot.excess_min_per_week == pytest.approx(60 * (spot.violation_h - spot.expected_h) / 4)


def test_days_of_a_camera_that_was_down_are_missing_not_zero(tmp_path: Path) -> None:
    cameras = [Camera(c, c, "ground", hz=1.0, view=VIEW) for c in ("left", "right")]
    site = site_of(tmp_path, cameras=cameras)

    def owner(x: float) -> str:
        return "left" if x < 8 else "right"

    def recorded(camera: str, day: int) -> float:
        return 0.0 if camera == "left" and day < 8 else 1.0

    with planted(site, always(HOT), owner=owner, recorded=recorded) as warehouse:
        found = hotspots(warehouse)
        cube = FloorDays(warehouse, site.floors[0]).cube(slice(0, 28))
    (spot,) = found.spots
    assert found.n_days == 28
    assert not cube.is_recorded[:8, :, :8].any()
    assert cube.is_recorded[:, :, 8:].all()
    # 20 days at the left, so a week's excess is that of 20 days
    assert spot.excess_min_per_week == pytest.approx(60 * (spot.violation_h - spot.expected_h) / 20 * 7)
    with planted(site, always(HOT), owner=owner, recorded=lambda camera, day: recorded(camera, day // 2)) as warehouse:
        found = hotspots(warehouse)
    assert found.state == "ok"
    assert found.cells is not None
    assert not found.cells.is_tested[:, :8].any()
    assert found.spots == ()


def test_camera_days_recorded_too_little_take_no_part(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    with planted(site, always(HOT), recorded=lambda camera, day: 0.59 if day < 3 else 0.61) as warehouse:
        assert hotspots(warehouse).n_days == 25


def test_cells_at_the_border_of_the_view_are_not_tested(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), always(HOT)) as warehouse:
        found = hotspots(warehouse)
    assert found.cells is not None
    assert not found.cells.is_tested[0].any()
    assert not found.cells.is_tested[:, 0].any()
    # a disc of 2 m around a cell 1.5 m from the edge is seen to 93 %, 0.5 m from it to 66 %
    assert found.cells.is_tested[1:-1, 1:-1].all()
    with planted(site_of(tmp_path), always(square(0.5, 6))) as warehouse:
        assert not hotspots(warehouse).cells.is_hot[:, 0].any()  # type: ignore[union-attr]


def test_unknown_views_are_reported(tmp_path: Path) -> None:
    site = site_of(tmp_path, cameras=[Camera("cam", "Cam", "ground", hz=1.0)])
    with planted(site, always(HOT)) as warehouse:
        found = hotspots(warehouse)
    assert found.cells is not None
    assert found.cells.is_tested.all()
    assert "unknown" in reason_text(found.notes[0])


def test_too_few_days_are_refused(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), always(HOT), n_days=13) as warehouse:
        found = hotspots(warehouse)
    assert (found.state, found.spots, found.n, found.cells) == ("not_enough_data", (), None, None)
    assert (
        reason_text(found.reason)
        == "13 of the 28 days were recorded for 60% of opening hours or more; hotspots need 14"
    )


def test_too_few_violations_are_refused(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), always(EVEN), per_day=9) as warehouse:
        found = hotspots(warehouse)
    assert (found.state, reason_text(found.reason)) == (
        "not_enough_data",
        "fewer than 300 violations were counted in the 28 days",
    )


@pytest.mark.parametrize(
    ("lacking", "why"),
    [("people", NO_POSITIONS), ("distances", NO_FLOOR), ("violations", NO_IDS), ("places", NO_POSITIONS)],
)
def test_what_an_engine_does_not_send_is_not_measurable(tmp_path: Path, lacking: str, why: str) -> None:
    with planted(site_of(tmp_path), always(HOT), knows=lambda what: what != lacking) as warehouse:
        found = hotspots(warehouse)
    assert (found.state, found.reason, found.spots) == ("not_measurable", why, ())


def test_nothing_stored_is_not_enough_data(tmp_path: Path) -> None:
    with Warehouse(site_of(tmp_path), LAST, LAST) as warehouse:
        found = hotspots(warehouse)
    assert (found.state, found.n_days) == ("not_enough_data", 0)


def test_a_floor_of_impossible_size_is_not_measurable(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), always(HOT)) as warehouse:
        warehouse.con.execute("update cell_days set cx = 20000, cy = 20000 where cx = 0 and cy = 0")
        found = hotspots(warehouse)
    assert found.state == "not_measurable"
    assert "are they in metres" in reason_text(found.reason)


def test_positions_off_the_plan_are_left_out(tmp_path: Path) -> None:
    plan = tmp_path / "plan.svg"
    plan.write_text('<svg xmlns="http://www.w3.org/2000/svg" width="16" height="12" viewBox="0 0 16 12"/>')
    site = replace(site_of(tmp_path), floors=(Floor("ground", "Ground floor", plan, 1.0),))
    with planted(site, always(HOT)) as warehouse:
        warehouse.con.execute("update cell_days set cx = 20000, cy = 20000 where cx = 0 and cy = 0")
        found = hotspots(warehouse)
    assert found.state == "ok"
    assert found.grid is not None
    assert found.grid.shape == SHAPE
    assert found.cells is not None
    # where the plan ends there is no floor that could be unseen
    assert found.cells.is_tested[0, 1:].all()


def test_a_place_that_became_riskier_is_new_and_the_old_one_persists(tmp_path: Path) -> None:
    there = square(12, 7, ratio=6)

    def risk(day: int) -> np.ndarray:
        return np.maximum(HOT, there) if day >= 35 else HOT

    with planted(site_of(tmp_path), risk, n_days=49) as warehouse:
        weeks = [hotspots(warehouse, until=LAST - timedelta(days=7 * k)) for k in (2, 1, 0)]
    assert [[(s.state, s.since) for s in w.spots] for w in weeks] == [
        [("persisting", LAST - timedelta(days=35))],
        [("persisting", LAST - timedelta(days=35))],
        [("persisting", LAST - timedelta(days=35)), ("new", LAST)],
    ]
    assert len({s.spot_id for w in weeks for s in w.spots if s.state == "persisting"}) == 1
    assert weeks[-1].compared_with == LAST - timedelta(days=7)


def test_what_is_no_hotspot_any_more_is_reported_with_its_ratio_now(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), lambda day: HOT if day < 14 else EVEN, n_days=49) as warehouse:
        weeks = [hotspots(warehouse, until=LAST - timedelta(days=7 * k)) for k in (5, 4, 3, 2, 1, 0)]
    gone = [k for k, week in enumerate(weeks) if week.resolved]
    assert gone
    week = weeks[gone[0]]
    assert (week.spots, len(week.resolved)) == ((), 1)
    assert week.resolved[0].spot_id == weeks[gone[0] - 1].spots[0].spot_id
    ratio = week.resolved[0].ratio
    assert ratio is not None
    assert ratio < week.resolved[0].ratio_before


def test_a_logged_change_restarts_the_window_of_the_place(tmp_path: Path) -> None:
    site = site_of(tmp_path)
    changed = LAST - timedelta(days=7)
    with planted(site, always(HOT), n_days=49) as warehouse:
        before = hotspots(warehouse)
        add_entry(site, text="till moved", at=changed.isoformat(), area="queue")
        found = hotspots(warehouse)
    assert (found.spots, found.resolved) == ((), ())
    (watched,) = found.watching
    assert (watched.spot_id, watched.changed_on) == (before.spots[0].spot_id, changed)
    assert watched.ratio is not None
    # what was measured since the change is the ratio, with the days before it left out
    assert watched.ratio == pytest.approx(before.spots[0].ratio, rel=0.15)


def test_a_change_elsewhere_restarts_nothing(tmp_path: Path) -> None:
    site = site_of(
        tmp_path, areas=[QUEUE, replace(QUEUE, area_id="far", polygon=((12, 8), (15, 8), (15, 11), (12, 11)))]
    )
    with planted(site, always(HOT)) as warehouse:
        add_entry(site, text="plant pot watered", at=LAST.isoformat(), area="far")
        add_entry(site, text="new opening hours", at=LAST.isoformat())
        found = hotspots(warehouse)
    assert ([s.place.area_id for s in found.spots], found.watching) == (["queue"], ())


def test_the_day_asked_for_decides_whatever_is_loaded(tmp_path: Path) -> None:
    with planted(site_of(tmp_path), always(HOT), n_days=49) as warehouse:
        long = hotspots(warehouse, until=LAST - timedelta(days=7))
        warehouse.con.execute(f"delete from cell_days where local_date > '{LAST - timedelta(days=7)}'")
        short = hotspots(warehouse, until=LAST - timedelta(days=7))
    assert long.spots == short.spots
    with pytest.raises(KeyError):
        hotspots(warehouse, floor_id="attic")


def test_the_demos_checkout_queue_comes_first(demo_project: Path) -> None:
    whole = load_site(demo_project)
    truth = DemoTruth.read(demo_project / "truth.json").hotspot
    refused = _of_demo(whole)
    assert refused.state == "not_enough_data"
    assert "hotspots need 14" in reason_text(refused.reason)
    # one week is what this demo holds
    found = _of_demo(replace(whole, settings=whole.settings.with_values({"hotspot_days": 7, "hotspot_min_days": 5})))
    first = found.spots[0]
    assert first.place.area_id == truth.area_id
    assert any(shapely.Polygon(p[0]).contains(shapely.Point(truth.x_m, truth.y_m)) for p in first.place.polygons)
    assert math.dist((first.place.peak_x_m, first.place.peak_y_m), (truth.x_m, truth.y_m)) < 1
    assert found.n_days == 7


def _of_demo(site: Site) -> FloorHotspots:
    with Warehouse(site, LAST - timedelta(days=6), LAST) as warehouse:
        warehouse.materialise("episodes", "violations")
        return hotspots(warehouse)


@pytest.mark.realdata
def test_three_hours_of_atc_are_refused_with_the_reason(realdata: Callable[[str], Path], tmp_path: Path) -> None:
    camera = Camera("atc", "ATC", "floor")
    site = Site("site", "Site", "Asia/Tokyo", tmp_path, floors=(Floor("floor", "Floor"),), cameras=(camera,))
    columns = ("ts", "track_id", "x_m", "y_m", "speed", "angle")
    files = [realdata(f"atc/atc-1024-{hour}_{part}.csv.gz") for hour in (9,) for part in ("train", "test")]
    ingest(
        site,
        files,
        IngestOptions(format="positions", columns=columns, period_s=1.0),
        now=datetime(2026, 11, 20, tzinfo=UTC),
    )
    with Warehouse(site, date(2012, 10, 24), date(2012, 10, 24)) as warehouse:
        found = hotspots(warehouse)
    assert found.state == "not_enough_data"
    assert (
        reason_text(found.reason) == "0 of the 28 days were recorded for 60% of opening hours or more; hotspots need 14"
    )


def test_an_area_that_holds_most_of_the_excess_gives_the_name() -> None:
    from vsd_analytics.figures.cell_places import place_of
    from vsd_analytics.figures.floor_days import Grid

    grid = Grid(1.0, 0, 0, (4, 4))
    inside = np.zeros((4, 4), dtype=bool)
    inside[1, :3] = True
    areas = [
        replace(QUEUE, polygon=((0, 0), (1, 0), (1, 4), (0, 4))),
        Area("a", "A", "g", ((1, 0), (3, 0), (3, 4), (1, 4))),
    ]
    weights = np.zeros((4, 4))
    weights[1, :3] = 5, 1, 1
    place = place_of(grid, inside, weights=weights, areas=areas)
    assert (place.area_id, place.area_m2) == ("queue", 3)
    assert (place.x_m, place.y_m) == (pytest.approx((2.5 + 1.5 + 2.5) / 7), 1.5)
    weights[1, :3] = 1, 1, 1
    assert place_of(grid, inside, weights=weights, areas=areas).area_id == "a"
    assert place_of(grid, inside, weights=weights, areas=areas[:1]).area_id is None
