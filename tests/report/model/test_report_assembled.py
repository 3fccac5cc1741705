"""The report of small worlds: states of a week, what an engine leaves out, and what a site does not have."""

from __future__ import annotations

import json
import re
from datetime import timedelta
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from report import ingested_worlds as w

from vsd_analytics.config.project import load_site
from vsd_analytics.figures.week.areas import busiest_area
from vsd_analytics.planner.planner_data import PlannerData, PlannerWeek, planner_pages
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.figures_by_id import figures_by_id
from vsd_analytics.report.pages.json_and_csv import from_json, to_csv, to_json
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Area, Site
from vsd_analytics.wording.reasons import reason_text

messages = partial(w.messages, hours=(9, 10))
toml = partial(w.toml, opening='{ mon-sun = "09:00-10:00" }')
HOURS = [(d, 9) for d in range(7)]


def busy(day: int, hour: int) -> dict[w.Place, int]:
    """Counts that differ from day to day as real ones do."""
    return {w.QUEUE: 30 + 3 * (day % 3) + hour % 2, w.DOOR: 12 + day % 4, w.AISLE: 9 + (day * 5) % 4}


def quieter(day: int, hour: int) -> dict[w.Place, int]:
    """The same with half as many at the door."""
    return {**busy(day, hour), w.DOOR: 6 + (day * 3) % 4}


@pytest.fixture(scope="module")
def busy_week(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Return a site of which one busy week is stored. Tests leave it as it is."""
    return w.world(tmp_path_factory.mktemp("busy"), toml(), messages(busy))


@pytest.fixture(scope="module")
def of_busy(busy_week: Site) -> WeekReport:
    """Return the report of that week."""
    return w.report(busy_week)


def text_of(page: str) -> str:
    """Return what a reader sees of a page."""
    body = re.sub(r"<style>.*?</style>|<svg.*?</svg>", " ", page, flags=re.DOTALL)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", body))


# the busiest spot -----------------------------------------------------------------------------------------------------


def test_the_busiest_spot_is_not_the_largest_polygon() -> None:
    """The hall has most, on sixteen times the floor; the corner's few are too little to speak of."""

    def square(area_id: str, side_m: float) -> Area:
        return Area(area_id, area_id, "ground", ((0, 0), (side_m, 0), (side_m, side_m), (0, side_m)))

    areas = (square("hall", 20), square("till", 5), square("corner", 1))
    data = SimpleNamespace(areas=areas, site=SimpleNamespace(settings=Settings()))
    assert busiest_area(data, {"hall": 400.0, "till": 300.0, "corner": 20.0}, total=720.0) == "till"
    assert busiest_area(data, {"hall": 400.0, "corner": 20.0}, total=10_000.0) == "hall", "none holds a material share"
    assert busiest_area(data, {}, total=0.0) is None


# states ---------------------------------------------------------------------------------------------------------------


def test_two_whole_weeks_are_compared(tmp_path: Path) -> None:
    log = [{"at": "2026-11-09T08:00:00+01:00", "text": "Stand moved away", "area": "door"}]
    site = w.world(tmp_path, toml(), messages(busy, monday=w.BEFORE), messages(quieter, engine="acme 1.0"), log=log)
    report = w.report(site)
    assert report.state == "normal"
    verdicts = {a.area_id: a.violation_rate.verdict for a in report.areas}
    assert verdicts == {"door": "clear_fall", "queue": "cannot_tell", None: "cannot_tell"}
    assert report.busiest_spot is not None
    assert report.busiest_spot.area_id == "queue"
    (line,) = report.log
    assert line.moved_after == 1.0
    assert "Stand moved away. Door." in text_of(render_html(report))


def test_first_week_has_a_level_and_no_change(of_busy: WeekReport) -> None:
    report = of_busy
    assert report.state == "first_week"
    assert report.previous is None
    assert report.level.violation_rate.value is not None
    assert report.level.violation_rate.change is None
    assert {a.violation_rate.verdict for a in report.areas} == {None}
    assert "Comparisons start next week" in render_html(report)


def test_below_sixty_percent_nothing_is_compared_or_ranked(tmp_path: Path) -> None:
    site = w.world(tmp_path, toml(), messages(busy, monday=w.BEFORE), messages(busy, days=range(4)))
    report = w.report(site)
    assert report.coverage.share == pytest.approx(4 / 7)
    assert report.state == "too_incomplete"
    assert report.busiest_spot is None
    assert report.busiest_hour is None
    assert all(not m.spots for m in report.maps)
    assert report.level.violation_rate.change is None
    assert {c.state for c in report.when.cells if c.day.weekday() > 3} == {"no_data"}
    assert {c.violations for c in report.when.cells if c.day.weekday() > 3} == {None}


@pytest.fixture(scope="module")
def begun_week(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Return a site with a whole week and the days of the next one up to Thursday, 11:00. Tests leave it as it is."""
    lost = [(w.rome(1, 10), w.rome(1, 11)), (w.rome(3, 11), w.rome(3, 12))]
    streams = w.messages(busy, monday=w.BEFORE), w.messages(busy, days=range(4), lost=lost)
    return w.world(tmp_path_factory.mktemp("begun"), w.toml(), *streams).with_settings(mask_below=0)


def test_hours_to_come_are_neither_recorded_nor_missing(begun_week: Site) -> None:
    report = w.report(begun_week, clock=w.rome(3, 11, 20))
    assert report.state == "too_incomplete"
    assert report.is_so_far
    assert report.coverage.not_over_from == w.rome(3, 11)
    assert report.coverage.share == pytest.approx(10 / 11)  # of 11 hours that are over, one was lost
    assert [(o.start, o.end) for o in report.coverage.outages] == [(w.rome(1, 10), w.rome(1, 11))]
    states = {(c.day.weekday(), c.hour): c.state for c in report.when.cells if c.state != "closed"}
    to_come = {(3, 11), *((day, hour) for day in (4, 5, 6) for hour in (9, 10, 11))}
    assert {at for at, state in states.items() if state == "not_over"} == to_come
    assert states[1, 10] == "no_data"
    assert [d.share for d in report.coverage.cameras[0].days][4:] == [None, None, None]
    assert report.level.violation_rate.change is None
    assert report.story is not None
    assert report.story.question == ""
    page = text_of(render_html(report))
    assert "Week 46 is not over yet" in page
    assert "Missing: Tue 10 Nov, 10:00 to Tue 10 Nov, 11:00." in page
    rows = [line.split(",") for line in to_csv(report)["hours.csv"].splitlines()]
    assert sum("not_over" in row for row in rows) == 10


def test_the_planner_has_no_hours_to_come(begun_week: Site) -> None:
    """An hour that is not over would else be one that nobody recorded."""
    monday, clock = w.MONDAY, w.rome(3, 11, 20)
    [now], [over] = planner_pages(begun_week, monday, clock=clock), planner_pages(begun_week, monday)

    def recorded(page: PlannerData) -> dict[tuple[int, int], bool]:
        panel = page.week.panel
        found = zip(panel.day, panel.hour, panel.recorded_ms.any(axis=0), strict=True)
        return {(int(day), int(hour)): bool(is_recorded) for day, hour, is_recorded in found}

    to_come = {(3, 11), *((day, hour) for day in (4, 5, 6) for hour in (9, 10, 11))}
    assert recorded(over).keys() - recorded(now).keys() == to_come
    assert not any(recorded(over)[at] for at in to_come)
    assert [at for at, is_recorded in recorded(now).items() if not is_recorded] == [(1, 10)], "what was lost"
    assert now.week.is_ranked is over.week.is_ranked is False


def test_the_planner_has_no_hours_to_come_of_the_other_week_either(begun_week: Site) -> None:
    """The week that is over is shown, beside the one that is not."""
    given = {"before": w.MONDAY, "clock": w.rome(3, 11, 20)}
    [now], [over] = planner_pages(begun_week, w.BEFORE, **given), planner_pages(begun_week, w.BEFORE, before=w.MONDAY)
    assert now.before is not None
    assert over.before is not None

    def hours(page: PlannerWeek) -> set[tuple[int, int]]:
        return set(zip(page.panel.weekday.tolist(), page.panel.hour.tolist(), strict=True))

    assert hours(over.before) - hours(now.before) == {(3, 11), *((d, h) for d in (4, 5, 6) for h in (9, 10, 11))}
    assert hours(over.week) == hours(now.week)


def test_the_command_and_the_service_know_what_is_over(begun_week: Site, capsys: pytest.CaptureFixture[str]) -> None:
    from vsd_analytics.cli import cli
    from vsd_analytics.cli.exit_codes import run
    from vsd_analytics.service.answers import ReportAnswers

    now, from_ = "2026-11-12T11:20:00+01:00", "2026-11-12T11:00:00+01:00"
    command = ["--now", now, "--quiet", "report", "--week", "2026-W46", "--format", "json", "--out", "-"]
    assert run(cli, ["-C", str(begun_week.root), *command, "--exact"]) == 0
    assert json.loads(capsys.readouterr().out)["coverage"]["not_over_from"] == from_
    assert run(cli, ["-C", str(begun_week.root), *command]) == 0
    so_far = json.loads(capsys.readouterr().out)
    assert (so_far["week"]["monday"], so_far["week"]["sunday"]) == ("2026-11-09", "2026-11-10"), "Wednesday stays back"
    assert (so_far["coverage"]["not_over_from"], so_far["trend"], so_far["spots"]) == (None, None, None)
    seconds, present = [0.0], [w.rome(3, 11, 20)]
    answers = ReportAnswers(begun_week.root, clock=lambda: seconds[0], present=lambda: present[0])
    served = json.loads(answers.report("2026-W46", "ground"))
    assert {**served, "generated_at": None} == {**so_far, "generated_at": None}
    seconds[0], present[0] = 10.0, w.rome(7, 4, 1)  # the last site day has ended, and no file has changed
    assert json.loads(answers.report("2026-W46", "ground"))["week"]["iso"] == "2026-W46"


def test_a_week_that_is_nearly_over_is_compared_over_the_hours_that_are(tmp_path: Path) -> None:
    site = w.world(tmp_path, toml(), messages(busy, monday=w.BEFORE), messages(busy, days=range(6)))
    site = site.with_settings(mask_below=0)
    report = w.report(site, clock=w.rome(6, 8))
    assert report.state == "normal"
    assert report.coverage.share == pytest.approx(1.0)
    assert report.coverage.outages == ()
    without_clock = w.report(site)
    assert without_clock.coverage.share == pytest.approx(6 / 7)
    assert report.level.violation_rate.previous == without_clock.level.violation_rate.previous


def test_a_clock_says_nothing_about_a_week_that_is_over_or_that_has_not_begun(begun_week: Site) -> None:
    plain = to_json(w.report(begun_week))
    for clock in (w.rome(6, 12), w.rome(0, 9, 59)):  # closed for the week; records ahead of the clock
        assert to_json(w.report(begun_week, clock=clock)) == plain
    next_week = w.MONDAY + timedelta(days=7)
    ahead = to_json(w.report(begun_week, next_week, clock=w.rome(3, 12)))
    assert ahead == to_json(w.report(begun_week, next_week))


def test_no_data_week_names_each_cameras_last_record(tmp_path: Path) -> None:
    streams = [messages(busy, monday=w.BEFORE, camera=c) for c in ("cam-1", "cam-2")]
    site = w.world(tmp_path, toml(cameras=("cam-1", "cam-2")), *streams)
    report = w.report(site)
    assert report.state == "no_data"
    last = w.rome(6, 9, 59, monday=w.BEFORE).replace(second=40)
    assert [c.last_record for c in report.coverage.cameras] == [last, last]
    assert report.maps == ()
    assert report.areas == ()
    assert report.level.violation_rate.value is None
    assert {c.violations for c in report.when.cells} == {None}
    page = text_of(render_html(report))
    assert "All cameras stopped in the same minute" in page
    assert "Sun 8 Nov, 09:59" in page


def test_no_data_week_tells_when_cameras_stopped_apart(tmp_path: Path) -> None:
    site = w.world(
        tmp_path,
        toml(cameras=("cam-1", "cam-2")),
        messages(busy, monday=w.BEFORE, camera="cam-1"),
        messages(busy, monday=w.BEFORE, camera="cam-2", days=range(3)),
    )
    assert "stopped at different times" in render_html(w.report(site))


def test_no_data_week_of_one_camera_speaks_of_one_camera(tmp_path: Path) -> None:
    site = w.world(tmp_path, toml(cameras=("cam-1",)), messages(busy, monday=w.BEFORE, camera="cam-1"))
    page = text_of(render_html(w.report(site)))
    assert "The camera stopped." in page
    assert "different times" not in page


def test_empty_week_has_people_and_an_upper_bound(tmp_path: Path) -> None:
    far_apart = [w.person(f"p{k}", 3.0 * k, 1.0) for k in range(5)]  # of fewer people nothing is given
    frames = ({**message, "persons": far_apart} for message in w.messages(w.steady({})))
    report = w.report(w.world(tmp_path, w.toml(), frames))
    assert report.state == "empty"
    assert report.level.violation_rate.value == 0
    assert report.level.violation_rate.hi == pytest.approx(3 / 21, rel=0.01)
    assert report.coverage.seen_h == 21
    assert report.level.violations == 0
    assert report.busiest_spot is None
    assert "1 in 7 open hours" in render_html(report)


def test_recalibration_inside_the_window_blocks_the_comparison(tmp_path: Path) -> None:
    def pixels(track: str, x: float, y: float) -> dict[str, Any]:
        return {"id": track, "u_px": 100 * x, "v_px": 100 * y}

    (tmp_path / "calibration").mkdir(parents=True)
    for name, scale in (("old", 0.01), ("new", 0.011)):
        np.savetxt(tmp_path / "calibration" / f"{name}.txt", np.diag([scale, 0.01, 1.0]))
    (tmp_path / "calibration" / "cam-1.toml").write_text(
        '[[calibration]]\nhomography = "calibration/old.txt"\nfrom = 2026-10-01T00:00:00+01:00\n'
        '[[calibration]]\nhomography = "calibration/new.txt"\nfrom = 2026-11-12T08:00:00+01:00\n',
        encoding="utf-8",
    )
    streams = messages(busy, monday=w.BEFORE, say=pixels), messages(busy, say=pixels)
    site = w.world(tmp_path, toml(), *streams)
    assert [len(c.calibrations) for c in site.cameras] == [2]
    report = w.report(site)
    assert report.state == "settings_changed"
    change = report.settings_change
    assert change is not None
    assert change.name == "calibration"
    assert change.at == w.rome(3, 8)
    assert change.violation_rate_before is not None
    assert change.violation_rate_after is not None
    assert report.level.violation_rate.change is None
    assert {a.violation_rate.verdict for a in report.areas} == {None}
    page = text_of(render_html(report))
    assert (
        "A camera was recalibrated on Thursday 12 November 2026, 08:00, so positions and distances are measured "
        "differently. Figures before and after cannot be compared, so the change column is empty." in page
    )
    assert "No clear change" not in page


def test_another_engine_blocks_the_comparison_even_if_it_changes_on_the_last_day(tmp_path: Path) -> None:
    streams = [messages(busy, days=range(6)), messages(busy, days=[6], engine="acme 2.0")]
    report = w.report(w.world(tmp_path, toml(), messages(busy, monday=w.BEFORE), *streams))
    assert report.provenance.engines == ("acme 1.0", "acme 2.0")
    assert report.state == "settings_changed"
    assert report.settings_change is not None
    assert (report.settings_change.before, report.settings_change.after) == ("acme 1.0", "acme 1.0, acme 2.0")
    assert report.level.violation_rate.verdict is None
    assert "The engine changed" in render_html(report)


def test_closed_day_is_neither_missing_nor_zero(tmp_path: Path) -> None:
    site = w.world(
        tmp_path,
        toml(site='closed = ["2026-11-11"]'),
        messages(busy, monday=w.BEFORE),
        messages(busy, days=[0, 1, 3, 4, 5, 6]),
    )
    report = w.report(site)
    assert report.state == "normal"
    assert report.coverage.share == 1
    assert report.coverage.scheduled_h == 6
    assert {(c.state, c.violations) for c in report.when.cells if c.day.day == 11} == {("closed", None)}
    assert report.when.day_means[2].value is None
    assert report.coverage.cameras[0].days[2].share is None
    assert report.level.violation_rate.verdict == "cannot_tell"


# what an engine leaves out --------------------------------------------------------------------------------------------


def pairs_only(counts: w.Counts, **options: Any) -> list[dict[str, Any]]:
    """Return frames of an engine that sends pairs without positions."""
    frames = []
    for frame in messages(counts, is_alone=False, **options):
        ids = [p["id"] for p in frame.pop("persons")]
        frame["pairs"] = [{"a": a, "b": b, "distance_m": 1.5} for a, b in zip(ids[::2], ids[1::2], strict=True)]
        frames.append(frame)
    return frames


def test_pairs_only_makes_how_risky_not_measurable_and_never_zero(tmp_path: Path) -> None:
    report = w.report(w.world(tmp_path, toml(), pairs_only(busy, monday=w.BEFORE), pairs_only(busy)))
    assert report.level.violation_rate.value == pytest.approx(sum(sum(busy(d, h).values()) for d, h in HOURS) / 7)
    for estimate in (report.level.encounter_rate, report.level.people):
        assert (estimate.value, estimate.state) == (None, "not_measurable")
        assert reason_text(estimate.reason) == "the engine sends no positions"
    assert report.level.exposure_h is None
    assert report.coverage.seen_h is None
    for key in ("M3", "M6", "M7", "M15"):
        assert figures_by_id(report)[key].state == "not_measurable", key
        assert figures_by_id(report)[key].value is None
    assert report.areas == ()
    assert report.maps == ()
    page = text_of(render_html(report))
    assert "Time too close Not measurable The engine sends no positions." in page


def test_no_ids_makes_how_often_not_measurable_but_hours_show_the_records(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def nameless(track: str, x: float, y: float) -> dict[str, Any]:
        return {"x_m": x, "y_m": y}

    site = w.world(tmp_path, toml(), messages(busy, say=nameless))
    report = w.report(site)
    assert report.level.violation_rate.value is None
    assert report.level.violation_rate.state == "not_measurable"
    assert "no track ids" in reason_text(report.level.violation_rate.reason)
    assert report.level.people.value is not None
    assert report.level.violations is None
    assert {c.violations for c in report.when.cells} == {None}
    assert figures_by_id(report)["M8"].state == "not_measurable"
    page = text_of(render_html(report))
    assert "Violations cannot be counted on this floor" in page
    assert "How often Not measurable" in page
    from vsd_analytics.cli import cli
    from vsd_analytics.cli.exit_codes import run

    assert run(cli, ["-C", str(tmp_path), "hours", "--week", "2026-W46", "--json"]) == 0
    hours = json.loads(capsys.readouterr().out)["hours"]
    n_pairs = sum(sum(busy(d, h).values()) for d, h in HOURS)
    assert sum(h["violation_records"] for h in hours if h["violation_records"]) == 2 * n_pairs


def test_pixels_without_calibration_are_not_measurable(tmp_path: Path) -> None:
    def pixels(track: str, x: float, y: float) -> dict[str, Any]:
        return {"id": track, "u_px": 100 * x, "v_px": 100 * y}

    site = w.world(tmp_path, toml(), messages(busy, say=pixels))
    report = w.report(site)
    assert report.level.violation_rate.state == "not_measurable"
    assert "calibration" in reason_text(report.level.violation_rate.reason)
    assert report.state != "empty"
    assert "vsd calibrate" in render_html(report)


def test_one_camera_without_calibration_is_left_out_and_named(tmp_path: Path) -> None:
    def pixels(track: str, x: float, y: float) -> dict[str, Any]:
        return {"id": track, "u_px": 100 * x, "v_px": 100 * y}

    config = w.toml(cameras=("cam-1", "cam-2"))
    site = w.world(tmp_path, config, w.messages(busy), w.messages(busy, camera="cam-2", say=pixels))
    report = w.report(site)
    n_pairs = sum(sum(busy(d, h).values()) for d in range(7) for h in (9, 10, 11))
    assert report.level.violation_rate.value == pytest.approx(n_pairs / 21)
    assert [c.not_counted is None for c in report.coverage.cameras] == [True, False]
    assert report.level.encounter_rate.value == pytest.approx(
        report.level.violation_rate.value * 21 / (report.level.exposure_h or 0), rel=1e-9
    )
    assert "Camera 2 is not counted" in render_html(report)


# what a site does not have --------------------------------------------------------------------------------------------


def test_site_without_areas_has_a_map_and_says_how_to_name_them(tmp_path: Path) -> None:
    half = messages(lambda day, hour: {place: n // 2 for place, n in busy(day, hour).items()})
    report = w.report(w.world(tmp_path, toml(areas={}), messages(busy, monday=w.BEFORE), half))
    assert report.state == "normal"
    assert report.areas == ()
    assert report.busiest_spot is None
    assert report.maps[0].bands
    page = text_of(render_html(report))
    assert "This floor has no areas. Add areas to" in page
    assert "Whole floor: clear fall" in page


def test_floor_without_plan_or_picture_is_drawn_bare(of_busy: WeekReport) -> None:
    report = of_busy
    (drawn,) = report.maps
    assert (drawn.kind, drawn.image) == ("floor", None)
    assert drawn.extent[0] < w.QUEUE[0] < w.ALONE[0] < drawn.extent[2]
    assert drawn.spots[0].name == "Queue"


def test_without_a_plan_the_heat_lies_over_the_cameras_picture(tmp_path: Path) -> None:
    (tmp_path / "calibration").mkdir(parents=True)
    (tmp_path / "pictures").mkdir()
    matrix = np.array([[0.025, 0.0, -2.0], [0.0, -0.025, 14.0], [0.0, 0.0, 1.0]])
    np.savetxt(tmp_path / "calibration" / "cam-1.txt", matrix)
    cv2.imwrite(str(tmp_path / "pictures" / "cam-1.png"), np.full((640, 960), 120, np.uint8))
    config = toml(camera='homography = "calibration/cam-1.txt"\npicture = "pictures/cam-1.png"')
    report = w.report(w.world(tmp_path, config, messages(busy)))
    (drawn,) = report.maps
    assert drawn.kind == "picture"
    assert drawn.extent == (0, 0, 960, 640)
    ring = np.array(drawn.bands[-1].polygons[0][0])
    u, v = np.linalg.inv(matrix)[:2] @ (w.QUEUE[0] + 0.75, w.QUEUE[1], 1)
    assert np.hypot(*(ring.mean(axis=0) - (u, v))) < 40
    assert drawn.image is not None
    assert drawn.image.data_uri.startswith("data:image/webp")


def test_two_floors_have_two_reports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    upper = '[[floor]]\nid = "upper"\nname = "Upper floor"\n\n[[camera]]\nid = "cam-2"\nname = "Up"\nfloor = "upper"\n'
    streams = messages(busy), messages(w.steady({w.QUEUE: 7}), camera="cam-2")
    w.world(tmp_path, toml(more=upper), *streams)
    from vsd_analytics.cli import cli
    from vsd_analytics.cli.exit_codes import run

    assert run(cli, ["-C", str(tmp_path), "report", "--week", "2026-W46", "--format", "html,json"]) == 0
    made = capsys.readouterr().out.splitlines()
    names = sorted(p.name for p in (tmp_path / "reports").iterdir())
    assert names == [f"2026-W46-{floor}.{kind}" for floor in ("ground", "upper") for kind in ("html", "json")]
    assert len(made) == 4
    ground, above = (from_json((tmp_path / "reports" / name).read_bytes()) for name in names if "json" in name)
    assert ground.site.floors == above.site.floors == ("ground", "upper")
    assert ground.level.violations == sum(sum(busy(d, h).values()) for d, h in HOURS)
    assert above.level.violations == 7 * 7
    assert above.areas == ()
    assert [c.camera_id for c in above.coverage.cameras] == ["cam-2"]
    assert run(cli, ["-C", str(tmp_path), "report", "--week", "2026-W46", "--floor", "cellar"]) == 2
    assert "no floor has the id 'cellar'" in capsys.readouterr().err


def test_a_six_foot_site_never_says_two_metres(tmp_path: Path) -> None:
    config = toml(site="distance_m = 1.83")
    report = w.report(w.world(tmp_path, config, messages(busy)))
    assert report.level.violation_rate.value is not None
    page = re.sub(r"<style>.*?</style>", "", render_html(report), flags=re.DOTALL)
    for text in (page, to_json(report).decode(), *to_csv(report).values()):
        assert not re.search(r"(?<![\d.])2(\.0)?[\s\u00a0]?m\b", text)
    assert "1.83\u00a0m" in page


def test_a_report_is_the_same_after_reading_it_from_disk(busy_week: Site, of_busy: WeekReport) -> None:
    first, again = to_json(of_busy), to_json(w.report(load_site(busy_week.root)))
    assert first == again
