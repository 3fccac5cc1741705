"""A change of the log: the effect that was planted is found, and what would be no comparison is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from planted_changes import AREAS, area, planted, site_of

from vsd_analytics.answer import Reason
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.before_after import BeforeAfterFigure, before_after
from vsd_analytics.figures.change_weeks import days_needed
from vsd_analytics.wording.reasons import reason_text

FIRST = date(2026, 10, 5)
CHANGE = 29  # day of the change: four weeks and the day before it are whole
N_DAYS = 4 * 7 + 3 + 4 * 7


def log(root: Path, *entries: tuple[int, str | None]) -> None:
    lines = [
        {"at": f"{FIRST + timedelta(days=d)}T07:00:00+00:00", "text": f"moved it on day {d}", "area": area_id}
        for d, area_id in entries
    ]
    root.mkdir(parents=True, exist_ok=True)
    (root / "log.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")


def found(
    root: Path, *entries: tuple[int, str | None], number: int = 1, weeks: int = 4, site: Any = None, **options: Any
) -> BeforeAfterFigure:
    log(root, *(entries or ((CHANGE, "queue"),)))
    asked = {k: options.pop(k) for k in ("area_id",) if k in options}
    with planted(site or site_of(root), **{"first": FIRST, "n_days": N_DAYS, **options}) as warehouse:
        return before_after(warehouse, number, weeks=weeks, **asked)


def changed(effect: float, *, season: float = 1.0) -> Callable[[str, int], float]:
    """Return rates that all move by `season` at the change, and in the queue by `effect` besides."""
    return lambda area_id, day: (
        (season if day >= CHANGE else 1.0) * (effect if area_id == "queue" and day >= CHANGE else 1.0)
    )


def test_the_planted_effect_is_found_and_the_season_is_not_taken_for_it(tmp_path: Path) -> None:
    figure = found(tmp_path, rate=changed(0.6, season=1.5))
    assert (figure.state, figure.design, figure.is_credible, figure.doubts) == ("ok", "beside", True, ())
    assert figure.effect is not None
    assert figure.effect.lo is not None
    assert figure.effect.hi is not None
    assert figure.effect.lo < 0.6 < figure.effect.hi
    assert figure.effect.day_lo is not None
    assert figure.effect.day_hi is not None
    assert figure.effect.day_hi - figure.effect.day_lo < 0.15
    assert figure.effect.verdict == "clear_fall"
    assert figure.alone is not None
    assert figure.alone.value == pytest.approx(0.9, rel=0.12)
    assert figure.comparison is not None
    assert figure.comparison.value == pytest.approx(1.5, rel=0.12)
    assert figure.comparison_areas == ("door", "aisle", "fruit", "bakery", "back")
    assert figure.windows is not None
    assert figure.windows.left_out == (FIRST + timedelta(days=28), FIRST + timedelta(days=30))
    assert figure.windows.before == (FIRST, FIRST + timedelta(days=27))
    assert figure.windows.after == (FIRST + timedelta(days=31), FIRST + timedelta(days=58))
    assert figure.effect.shrunken is not None
    assert figure.effect.trend is not None
    assert len(figure.effect.placebo) == 5
    json.dumps(asdict(figure), default=str)


def test_days_around_the_change_do_not_count(tmp_path: Path) -> None:
    def rate(area_id: str, day: int) -> float:
        return 50.0 if area_id == "queue" and CHANGE - 1 <= day <= CHANGE + 1 else 1.0

    effect = found(tmp_path, rate=rate).effect
    assert effect is not None
    assert effect.value == pytest.approx(1.0, abs=0.12)


def test_whole_weeks_equally_many_on_both_sides(tmp_path: Path) -> None:
    figure = found(tmp_path, n_days=4 * 7 + 3 + 13)
    assert figure.windows is not None
    assert figure.windows.n_weeks == 1
    assert (figure.windows.after[1] - figure.windows.after[0]).days == 6
    assert figure.effect is not None
    assert figure.effect.trend is not None, "the trend is told over all weeks before, not only those compared"
    assert figure.effect.trend.n_weeks == 4
    assert figure.notes == (Reason("logged_change.stored", n=1, weeks=4),)


def test_less_than_a_week_after_is_refused(tmp_path: Path) -> None:
    figure = found(tmp_path, n_days=4 * 7 + 3 + 6)
    assert (figure.state, figure.effect) == ("not_enough_data", None)
    assert reason_text(figure.reason) == (
        "needs a whole week after the change, and 6 days are stored (3 days around it are left out)"
    )


@pytest.mark.parametrize("day", [3, CHANGE, 50])
def test_a_recalibration_in_the_weeks_is_refused(tmp_path: Path, day: int) -> None:
    anew = [("cam", d, "aaaaaaaa" if d < day else "bbbbbbbb") for d in range(N_DAYS)]
    figure = found(tmp_path, rate=changed(0.6), calibrations=anew)
    assert (figure.state, figure.effect, figure.alone) == ("not_measurable", None, None)
    assert figure.reason is not None
    assert "recalibrated" in reason_text(figure.reason)
    same = [("cam", d, "aaaaaaaa") for d in range(N_DAYS)]
    assert found(tmp_path, rate=changed(0.6), calibrations=same).state == "ok"


def test_a_recalibration_of_the_areas_own_camera_is_refused_though_others_stay(tmp_path: Path) -> None:
    anew = [("cam-2", d, "aaaaaaaa" if d < 40 else "bbbbbbbb") for d in range(N_DAYS)]
    figure = found(
        tmp_path,
        site=site_of(tmp_path, cameras=("cam", "cam-2")),
        calibrations=anew,
        camera_of=lambda a: "cam-2" if a == "queue" else "cam",
    )
    assert (figure.state, figure.effect) == ("not_measurable", None)
    assert reason_text(figure.reason) == (
        f"recalibrated between before and after: cam-2 on {FIRST + timedelta(days=40)}; "
        "a recalibration is not a redesign"
    )


def test_only_areas_of_a_recalibrated_camera_are_no_comparison(tmp_path: Path) -> None:
    site = site_of(tmp_path, cameras=("cam", "cam-2"))
    anew = [("cam-2", d, "aaaaaaaa" if d < 40 else "bbbbbbbb") for d in range(N_DAYS)]
    other = ("door", "aisle")
    figure = found(
        tmp_path, site=site, rate=changed(0.6), calibrations=anew, camera_of=lambda a: "cam-2" if a in other else "cam"
    )
    assert (figure.state, figure.comparison_areas) == ("ok", ("fruit", "bakery", "back"))
    assert dict(figure.areas_left_out) == dict.fromkeys(other, Reason("logged_change.calibrated_there"))


def test_too_little_recorded_is_refused(tmp_path: Path) -> None:
    figure = found(tmp_path, recorded=lambda camera, d: 0.0 if d > CHANGE and d % 2 else 1.0)
    assert figure.state == "not_enough_data"
    assert figure.reason is not None
    assert "cameras recorded 50%" in reason_text(figure.reason)


def test_the_cameras_of_the_area_must_have_recorded(tmp_path: Path) -> None:
    site = site_of(tmp_path, cameras=("cam", *(f"cam-{k}" for k in range(2, 7))))
    names = {a.area_id: c.camera_id for a, c in zip(AREAS, site.cameras, strict=True)}
    figure = found(
        tmp_path,
        site=site,
        camera_of=names.__getitem__,
        recorded=lambda camera, d: 0.0 if camera == "cam" and d > CHANGE and d % 2 else 1.0,
    )
    assert figure.state == "not_enough_data"
    assert figure.reason is not None
    assert reason_text(figure.reason).startswith("the cameras of the area recorded 50%")


def test_an_area_that_moved_already_before_is_not_credible(tmp_path: Path) -> None:
    figure = found(tmp_path, rate=lambda a, d: 0.75 ** (d / 7) if a == "queue" else 1.0, day_sd=0.02)
    assert figure.state == "ok"
    assert not figure.is_credible
    assert reason_text(figure.doubts[0]).startswith(
        "the comparison is not credible: already before the change, the area moved -"
    )
    assert figure.effect is not None, "the number is given all the same"
    assert figure.effect.trend is not None
    assert figure.effect.trend.lo < -0.25 < figure.effect.trend.hi


def test_near_and_changed_areas_are_no_comparison(tmp_path: Path) -> None:
    areas = (*AREAS[:4], area("near", 8.0), area("far", 60.0))
    figure = found(
        tmp_path, (CHANGE, "queue"), (40, "door"), (41, None), site=site_of(tmp_path, areas=areas), rate=changed(0.6)
    )
    assert figure.comparison_areas == ("aisle", "fruit", "far")
    left_out = dict(figure.areas_left_out)
    assert reason_text(left_out["near"]) == "4.0 m away, and 5 m are needed"
    assert reason_text(left_out["door"]) == f"it changed too: see the log of {FIRST + timedelta(days=40)}"
    assert figure.is_credible


def test_another_change_in_the_same_area_is_a_doubt(tmp_path: Path) -> None:
    figure = found(tmp_path, (CHANGE, "queue"), (45, "queue"), rate=changed(0.6))
    assert not figure.is_credible
    assert figure.doubts == (Reason("logged_change.other_change", day=str(FIRST + timedelta(days=45))),)


def test_without_a_comparison_area_only_the_area_itself_is_reported_and_called_weak(tmp_path: Path) -> None:
    figure = found(tmp_path, site=site_of(tmp_path, areas=AREAS[:1]), rate=changed(0.6, season=1.5))
    assert (figure.state, figure.design, figure.effect, figure.comparison) == ("ok", "alone", None, None)
    assert reason_text(figure.doubts[0]).startswith("weak design")
    assert figure.alone is not None
    assert figure.alone.value == pytest.approx(0.9, rel=0.12)


def test_what_moved_to_the_neighbours_is_reported(tmp_path: Path) -> None:
    figure = found(tmp_path, rate=changed(0.6), around=lambda a, d: 4.0 if a == "queue" and d >= CHANGE else 2.0)
    near = figure.neighbours
    assert near is not None
    assert near.encounter_rate.verdict == "clear_rise"
    assert near.encounter_rate.value == pytest.approx(2.0, rel=0.25)
    assert near.effect is not None
    assert near.effect.verdict == "clear_rise"


def test_fewer_people_are_reported_beside_the_effect(tmp_path: Path) -> None:
    figure = found(tmp_path, people=lambda a, d: 20.0 if a == "queue" and d >= CHANGE else 40.0)
    assert figure.people is not None
    assert figure.people.verdict == "clear_fall"
    assert figure.effect is not None
    assert figure.violation_rate is not None
    assert figure.effect.verdict == "cannot_tell"
    assert figure.violation_rate.verdict == "clear_fall"
    assert figure.violation_rate.value == pytest.approx(0.5, rel=0.15)


def test_few_violations_are_refused_with_the_rule(tmp_path: Path) -> None:
    figure = found(tmp_path, rate=lambda a, d: 0.01 if a == "queue" else 1.0)
    assert figure.state == "not_enough_data"
    assert figure.reason is not None
    assert "at least 30 violations in the area before" in reason_text(figure.reason)


def test_unknown_entries_and_whole_site_entries_are_answered(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no entry 2"):
        found(tmp_path, number=2)
    with pytest.raises(UsageError, match="whole site"):
        found(tmp_path, (CHANGE, None))
    assert found(tmp_path, (CHANGE, None), area_id="queue", rate=changed(0.6)).effect is not None
    with pytest.raises(UsageError, match="no area"):
        found(tmp_path, area_id="cellar")
    assert days_needed(site_of(tmp_path), 1, weeks=2) == (
        FIRST + timedelta(days=CHANGE - 3 - 12 * 7),
        FIRST + timedelta(days=CHANGE + 3 + 26 * 7),
    )
