"""A logged change over many weeks: time too close in its area, the running verdict, and what the floor became."""

from __future__ import annotations

import json
import math
from dataclasses import asdict
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from planted_changes import planted, site_of

from vsd_analytics.figures.before_after import BeforeAfterFigure, before_after

FIRST = date(2026, 8, 31)
CHANGE = 12 * 7 + 1
N_DAYS = 12 * 7 + 3 + 8 * 7


def found(root: Path, *entries: tuple[int, str | None], number: int = 1, **options: Any) -> BeforeAfterFigure:
    root.mkdir(parents=True, exist_ok=True)
    lines = [
        {"at": f"{FIRST + timedelta(days=d)}T07:00:00+00:00", "text": f"moved it on day {d}", "area": area_id}
        for d, area_id in (entries or ((CHANGE, "queue"),))
    ]
    (root / "log.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
    with planted(site_of(root), **{"first": FIRST, "n_days": N_DAYS, **options}) as warehouse:
        return before_after(warehouse, number)


def from_change(factor: float, area_id: str = "queue") -> Any:
    return lambda a, d: factor if a == area_id and d >= CHANGE else 1.0


def test_a_fall_is_found_in_every_rate_and_by_the_running_verdict(tmp_path: Path) -> None:
    figure = found(tmp_path, rate=from_change(0.5))
    assert figure.burden is not None
    assert figure.close is not None
    assert figure.running is not None
    for effect in (figure.burden, figure.close, figure.effect, figure.violation_rate, figure.running):
        assert effect is not None
        assert effect.verdict == "clear_fall"
        assert effect.value == pytest.approx(0.5, rel=0.12)
    assert (figure.running.n_reference, figure.running.n_weeks) == (12, 8)
    assert figure.running.clear_since is not None
    assert figure.burden.weights is not None, "twelve weeks before give the comparison areas weights"
    json.dumps(asdict(figure), default=str)


def test_nothing_is_claimed_where_only_the_season_moved(tmp_path: Path) -> None:
    figure = found(tmp_path, rate=lambda a, d: 0.6 if d >= CHANGE else 1.0)
    assert figure.burden is not None
    assert figure.running is not None
    assert figure.floor is not None
    assert figure.burden.verdict != "clear_fall"
    assert figure.running.verdict != "clear_fall"
    assert figure.floor.net.value == pytest.approx(0.6, rel=0.15)


def test_people_who_left_are_the_changes_own_doing_and_its_parts_add_up(tmp_path: Path) -> None:
    figure = found(tmp_path, people=lambda a, d: 20.0 if a == "queue" and d >= CHANGE else 40.0)
    assert figure.burden is not None
    assert figure.routes is not None
    assert figure.burden.verdict == "clear_fall"
    assert figure.close is not None
    assert figure.close.verdict != "clear_fall"
    assert figure.burden.value is not None
    assert figure.routes.people + figure.routes.closeness == pytest.approx(figure.burden.value - 1, abs=1e-12)
    assert figure.routes.people == pytest.approx(-0.5, abs=0.08)
    assert abs(figure.routes.closeness) < 0.08


def test_time_that_moved_to_other_areas_at_any_distance_is_no_fall_of_the_floor(tmp_path: Path) -> None:
    def rate(area_id: str, day: int) -> float:
        if day < CHANGE:
            return 1.0
        return {"queue": 0.2, "fruit": 1.4, "back": 1.4}.get(area_id, 1.0)

    figure = found(tmp_path, rate=rate)
    assert figure.burden is not None
    assert figure.floor is not None
    assert figure.burden.verdict == "clear_fall"
    assert figure.floor.net.verdict != "clear_fall"
    assert figure.floor.moved_elsewhere == pytest.approx(1.0, abs=0.25)
    assert "logged_change.moved_elsewhere" in [c.code for c in figure.cautions]
    assert math.fsum(figure.floor.net.contributions) == pytest.approx((figure.floor.net.value or 0) - 1)
    assert figure.floor.places[-1] is None


def test_a_crowd_that_moves_into_one_comparison_area_does_not_make_the_fall_larger_than_it_is(tmp_path: Path) -> None:
    def rate(area_id: str, day: int) -> float:
        return 1.0 if day < CHANGE else {"queue": 0.2, "fruit": 5.0}.get(area_id, 1.0)

    figure = found(tmp_path, rate=rate)
    so_far = figure.running
    assert so_far is not None
    assert so_far.lo is not None
    assert so_far.hi is not None
    assert so_far.all_hi is not None
    assert so_far.all_hi < 0.2 < so_far.hi, "the range beside all areas misses what was planted"
    assert so_far.lo < 0.2
    assert so_far.value == pytest.approx(0.2, rel=0.15)
    assert so_far.verdict == "clear_fall"
    (caution,) = [c for c in figure.cautions if c.code == "logged_change.rests_on"]
    assert caution.values["area"] == "Fruit"


def test_the_slope_that_would_have_shown_is_given_and_a_small_effect_is_cautioned_with_it(tmp_path: Path) -> None:
    figure = found(tmp_path, rate=from_change(1.0))
    assert figure.burden is not None
    assert figure.burden.trend is not None
    assert figure.burden.trend.n_weeks == 12
    assert figure.burden.trend.detectable_per_week is not None
    assert 0 < figure.burden.trend.detectable_per_week < 0.1
    assert "logged_change.unseen_trend" in [c.code for c in figure.cautions]


def test_entries_of_the_whole_site_and_elsewhere_are_cautions(tmp_path: Path) -> None:
    figure = found(tmp_path, (CHANGE, "queue"), (CHANGE + 9, None), (CHANGE + 10, "door"))
    assert [c.code for c in figure.cautions][:2] == ["logged_change.site_wide", "logged_change.change_elsewhere"]
    assert figure.is_credible
    assert "door" not in figure.comparison_areas


def test_weeks_are_watched_until_the_next_change_of_the_area(tmp_path: Path) -> None:
    figure = found(tmp_path, (CHANGE, "queue"), (CHANGE + 40, "queue"))
    assert figure.windows is not None
    assert figure.windows.watched[1] < FIRST + timedelta(days=CHANGE + 40)
    assert figure.running is not None
    assert figure.running.n_weeks == 5


def test_reference_weeks_begin_after_the_latest_change_before(tmp_path: Path) -> None:
    figure = found(tmp_path, (20, "queue"), (CHANGE, "queue"), number=2)
    assert figure.windows is not None
    assert figure.windows.trend[0] > FIRST + timedelta(days=20)
    assert figure.running is not None
    assert figure.running.n_reference == 9


def test_a_camera_calibrated_anew_in_the_weeks_watched_leaves_no_running_verdict(tmp_path: Path) -> None:
    figure = found(
        tmp_path, calibrations=[("cam", d, "one" if d < CHANGE + 45 else "two") for d in range(N_DAYS)], n_days=N_DAYS
    )
    assert figure.state == "ok"
    assert figure.running is not None
    assert figure.running.reason is not None
    assert figure.running.reason.code == "logged_change.not_alike"


def test_a_week_that_recorded_little_is_left_out_of_the_weeks_read(tmp_path: Path) -> None:
    figure = found(tmp_path, recorded=lambda camera, d: 0.0 if CHANGE + 38 <= d < CHANGE + 43 else 1.0)
    assert figure.running is not None
    assert figure.running.n_weeks in (6, 7)


def test_the_area_that_took_people_up_is_named_with_a_range(tmp_path: Path) -> None:
    def people(area_id: str, day: int) -> float:
        return 40.0 if day < CHANGE else {"queue": 15.0, "fruit": 65.0}.get(area_id, 40.0)

    figure = found(tmp_path, people=people)
    assert [r.area_id for r in figure.receivers] == ["fruit"]
    (fruit,) = figure.receivers
    assert fruit.lo is not None
    assert fruit.hi is not None
    assert 0 < fruit.lo < 0.625 < fruit.hi
    assert figure.taken_up is not None
    assert figure.taken_up.share == pytest.approx(1.0, abs=0.3)
    assert [r.area_id for r in figure.risers] == ["fruit"]
    assert figure.outcome == "moved"
    assert found(tmp_path / "still").receivers == ()


def test_an_area_cleared_to_none_is_a_clear_fall_in_every_rate(tmp_path: Path) -> None:
    figure = found(tmp_path, rate=from_change(0.0))
    assert figure.running is not None
    assert figure.burden is not None
    assert figure.violation_rate is not None
    for effect in (figure.running, figure.burden, figure.violation_rate):
        assert (effect.value, effect.lo, effect.verdict) == (0.0, 0.0, "clear_fall")
        assert effect.hi is not None
        assert 0 < effect.hi < 0.5
    assert figure.outcome == "works"
    assert "inf" not in json.dumps(asdict(figure), default=str).lower().replace("info", "")
