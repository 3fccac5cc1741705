"""Sections of reports of small worlds: figures agree, spots have evidence, other cameras are noticed."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import pytest
from report import ingested_worlds as w

from vsd_analytics.answer import Reason, value_of
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.figures_by_id import figures_by_id
from vsd_analytics.report.pages.week import render_html

MORE = {w.QUEUE: 20, w.DOOR: 6, w.AISLE: 5}
SHORT = '{ mon-sun = "09:00-10:00" }'
LESS = {w.QUEUE: 20, w.DOOR: 12, w.AISLE: 5}


@pytest.fixture(scope="module")
def week(tmp_path_factory: pytest.TempPathFactory) -> WeekReport:
    """Two weeks of one camera: the queue as before, half as many at the door."""
    asked = w.toml().replace('name = "Queue"', 'name = "Queue"\nask = "Could the rope go?"')
    streams = (w.messages(w.steady(LESS), monday=w.BEFORE), w.messages(w.steady(MORE)))
    return w.report(w.world(tmp_path_factory.mktemp("sections") / "shop", asked, *streams))


def test_the_trend_ends_with_the_headline_and_begins_with_the_first_week(week: WeekReport) -> None:
    assert week.trend is not None
    assert [t.iso for t in week.trend.weeks] == ["2026-W45", "2026-W46"]
    last = week.trend.weeks[-1]
    assert (last.violation_rate, last.encounter_rate) == (week.level.violation_rate, week.level.encounter_rate)


def test_spots_are_the_planted_ones_with_their_evidence_and_the_sites_own_question(week: WeekReport) -> None:
    assert week.spots is not None
    first, second, third = week.spots.cards
    assert week.spots.kind == "tested"
    assert week.spots.first == w.BEFORE  # the window of four weeks begins before the data do
    assert week.spots.last == w.MONDAY + timedelta(days=6)
    assert [c.name for c in week.spots.cards] == ["Queue", "Door", "On the rest of the floor"]
    assert "spot 3" in third.ask
    assert second.ask.endswith("people stop?")
    assert second.question.endswith("people stop, above all from 09:00 to 11:00?")
    assert [s.at for m in week.maps for s in m.spots] == [c.at for c in week.spots.cards]
    assert first.violation_rate == week.areas[0].violation_rate
    at_the_spots = [(c.here.value, c.here.previous) for c in (first, second) if c.here is not None]
    assert at_the_spots == [pytest.approx((20.0, 20.0), rel=0.02), pytest.approx((6.0, 12.0), rel=0.02)]
    assert first.evidence is not None
    assert (first.evidence.days_present, first.evidence.camera_id, first.evidence.lost_h) == (7, "cam-1", 0.0)
    assert first.evidence.recorded_share == pytest.approx(week.areas[0].recorded_share)
    assert first.evidence.sureness == "medium"  # the engine sends metres, so no error of positions is known
    assert first.usual is not None
    assert first.usual.share >= 0.5
    assert first.usual.weekday is None
    assert first.ask == first.question == week.story.question == "Could the rope go?"  # type: ignore[union-attr]


def test_a_hotspot_counts_the_violations_of_the_people_who_stand_in_it(week: WeekReport) -> None:
    counted = {row["name"]: value_of(row, "n_violations").value for row in week.answers["hotspots"].rows}
    assert counted["Queue"] == 14 * 3 * 20
    assert counted["Door"] == 7 * 3 * (12 + 6)


def test_time_too_close_of_areas_and_hours_is_that_of_the_people_who_stand_there(week: WeekReport) -> None:
    """Two people of each violation, for two frames; one more person stands alone on the rest of the floor."""
    hour_h = {name: 2 * n * w.CLOSE_S / 3600 for name, n in (("queue", 20), ("door", 6), (None, 5))}
    shares = {a.area_id: a.close_time_share.value for a in week.areas if a.close_time_share is not None}
    assert shares == {"queue": 1.0, "door": 1.0, None: pytest.approx(hour_h[None] / (1 + hour_h[None]))}
    whole = sum(hour_h.values()) / (1 + sum(hour_h.values()))
    assert week.level.close_time_share is not None
    assert week.level.close_time_share.value == pytest.approx(whole) == pytest.approx(figures_by_id(week)["M6"].value)
    of_hours = [c.close_time_share for c in week.when.cells if c.state == "full"]
    assert of_hours == pytest.approx([whole] * len(of_hours))
    rest = next(a.close_time_share for a in week.areas if a.area_id is None)
    assert rest is not None
    assert rest.lo is not None
    assert rest.hi is not None
    assert rest.lo <= shares[None] <= rest.hi


def test_a_hotspot_whose_area_was_changed_is_watched_until_enough_days_have_passed(tmp_path: Path) -> None:
    rules = "[analysis]\nhotspot_days = 14\nhotspot_min_days = 10\nhotspot_min_violations = 20\n"

    def counts(day: int, hour: int) -> dict[w.Place, int]:
        return {w.QUEUE: 20 + day % 3, w.DOOR: 24 + day % 2, w.AISLE: 5}

    weeks = (w.MONDAY - timedelta(weeks=2), w.BEFORE, w.MONDAY)
    streams = [w.messages(counts, monday=monday) for monday in weeks]
    log = [{"at": f"{w.MONDAY}T08:00:00+01:00", "text": "Door mat moved", "area": "door"}]
    made = w.report(w.world(tmp_path / "shop", w.toml(more=rules), *streams, log=log))
    rows = {row["name"]: (row["change"], row["changed_on"]) for row in made.answers["past_hotspots"].rows}
    assert rows["Door"] == ("watching", w.MONDAY)
    assert made.spots is not None
    assert [(s.name, s.changed_on) for s in made.spots.watching] == [("Door", w.MONDAY)]
    assert "Door: changed on Mon 9 Nov; watching since." in render_html(made)


def test_both_readings_agree_with_the_headline_and_areas_add_up_to_no_more(week: WeekReport) -> None:
    found = week.readings
    assert found is not None
    if found.between is None:
        assert found.reason
        assert found.areas == ()
        return
    assert found.all is not None
    assert found.all.violation_rate == week.level.violation_rate
    assert (found.between.violation_rate.value or 0) <= (week.level.violation_rate.value or 0)
    areas = {a.area_id: a.violation_rate.value or 0 for a in week.areas}
    assert all((a.violation_rate.value or 0) <= areas[a.area_id] + 1e-9 for a in found.areas)


def test_other_cameras_than_the_week_before_forbid_a_comparison_and_are_named(tmp_path: Path) -> None:
    config = w.toml(cameras=("cam-1", "cam-2"), opening=SHORT)
    before = w.messages(w.steady(MORE), monday=w.BEFORE, camera="cam-1", hours=(9, 10))
    report = w.report(
        w.world(tmp_path / "shop", config, before, w.messages(w.steady(MORE), camera="cam-2", hours=(9, 10)))
    )
    assert report.settings_change is None or report.settings_change.name == "cameras"
    if report.state == "settings_changed":
        assert report.settings_change is not None
        assert (report.settings_change.before, report.settings_change.after) == ("Camera 1", "Camera 2")
        assert "No camera recorded both weeks" in render_html(report)
    else:
        assert report.state == "too_incomplete"  # half of the cameras are silent


def test_a_new_camera_is_left_out_of_the_comparison_and_named(tmp_path: Path) -> None:
    config = w.toml(cameras=("cam-1", "cam-2"), opening=SHORT)
    streams = (
        w.messages(w.steady(MORE), monday=w.BEFORE, camera="cam-1", hours=(9, 10)),
        w.messages(w.steady(MORE), camera="cam-1", hours=(9, 10)),
        w.messages(w.steady(MORE), camera="cam-2", hours=(9, 10)),
    )
    report = w.report(w.world(tmp_path / "shop", config, *streams))
    assert [c.not_compared for c in report.coverage.cameras] == [None, Reason("compare.new_camera")]
    assert "Camera 2 is not compared" in render_html(report)
