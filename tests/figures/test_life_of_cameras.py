"""A camera that was taken down, or is not there yet, is neither down nor missing nor expected, in any figure."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path

import pytest
from warehouse.small_projects import DAY, HOUR, T0, Person, beats, make_site, open_days, put

from vsd_analytics.figures.coverage_answers import coverage_answers
from vsd_analytics.figures.forecast import forecast
from vsd_analytics.figures.operator_counts import silent_cameras
from vsd_analytics.figures.today import today
from vsd_analytics.figures.trend import trend
from vsd_analytics.live.silence import Opening
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.warehouse.owner_spans import camera_life

STAYS, GOES = Camera("stays", "Stays", "ground", hz=1 / 30), Camera("goes", "Goes", "ground", hz=1 / 30)
WEEK_MS = 7 * DAY
END = date(2026, 11, 16)
WEEKS = 6


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """Return a site of six weeks; the second camera records the first three, and ends with them."""
    first = T0 - 3 * WEEK_MS
    made = make_site(tmp_path_factory.mktemp("lives"), cameras=[STAYS, GOES], opening=None)
    for day in range(7 * WEEKS):
        start = first + day * DAY
        put(made, beats(start, start + 4 * HOUR, camera="stays", every=30_000))
        if day < 21 + 7:
            put(made, beats(start, start + 4 * HOUR, camera="goes", every=30_000))
            put(made, [Person(start + 30_000 * k, "p", 1000, 1000, camera="goes") for k in range(40)])
    return replace(made, cameras=(STAYS, replace(GOES, end_day=END)))


def without_end(site: Site) -> Site:
    return replace(site, cameras=(STAYS, GOES))


def test_it_is_not_silent_and_has_no_outage_and_its_share_says_why(site: Site) -> None:
    with open_days(without_end(site), "2026-11-16", "2026-11-22") as warehouse:
        assert silent_cameras(warehouse) == ["goes"]
    with open_days(site, "2026-11-16", "2026-11-22") as warehouse:
        assert silent_cameras(warehouse) == []
        recorded, _, outages, *_ = coverage_answers(warehouse)
        rows = {row["camera_id"]: row for row in recorded.rows}
        assert rows["goes"]["scheduled_h"] == 0
        share = rows["goes"]["recorded_share"]
        assert share.reason is not None
        assert share.reason.code == "camera.not_there"
        assert {row["camera_id"] for row in outages.rows} == {"stays"}
        assert warehouse.rows("select max(cameras_down) as n from hours where state = 'full'") == [{"n": 0}]


def test_its_past_is_that_of_a_camera_without_an_end(site: Site) -> None:
    past = "2026-11-02", "2026-11-15"
    with open_days(site, *past) as warehouse, open_days(without_end(site), *past) as other:
        query = "select * from camera_hours order by all"
        assert warehouse.rows(query) == other.rows(query)


def test_nothing_is_expected_of_it_next_week(site: Site) -> None:
    monday = date(2026, 11, 23)
    with open_days(site, "2026-10-19", "2026-11-29") as warehouse:
        expected = forecast(warehouse, monday)
    with open_days(without_end(site), "2026-10-19", "2026-11-29") as warehouse:
        awaited = forecast(warehouse, monday)
    assert max(row.value or 0 for row in awaited.people.rows) > 0
    assert {row.value for row in expected.people.rows if row.value is not None} == {0.0}
    assert expected.left_out == ()


def test_the_card_of_the_day_does_not_look_for_it(site: Site) -> None:
    at = datetime(2026, 11, 25, 11, tzinfo=UTC)
    with open_days(site, "2026-10-19", "2026-11-25") as warehouse:
        card = today(warehouse, at=at)
    assert (card.n_cameras, [c.camera_id for c in card.silent]) == (1, [])
    with open_days(without_end(site), "2026-10-19", "2026-11-25") as warehouse:
        assert [c.camera_id for c in today(warehouse, at=at).silent] == ["goes"]


def test_the_trend_leaves_out_no_camera_that_is_gone_and_counts_no_time_of_it(site: Site) -> None:
    with open_days(site, "2026-10-19", "2026-11-22") as warehouse:
        found = trend(warehouse, date(2026, 11, 16))
        of_one = trend(warehouse, date(2026, 11, 9))
    assert found.left_out == ()
    assert found.weeks[-1].coverage == pytest.approx(4 / 24)
    assert found.weeks[-2].coverage == of_one.weeks[-1].coverage == pytest.approx(4 / 24)


def test_no_alarm_of_silence_is_due_after_its_end_or_before_its_beginning(site: Site) -> None:
    begins = replace(STAYS, camera_id="comes", first_day=END)
    end_ms = round(datetime.combine(END, datetime.min.time(), UTC).timestamp() * 1000)
    ended, new = (Opening(site, is_always=True, life=camera_life(site, c)) for c in (site.cameras[1], begins))
    assert (ended.is_open(end_ms - 1), ended.is_open(end_ms), ended.closes(end_ms - HOUR)) == (True, False, end_ms)
    assert ended.opens(end_ms, before_ms=end_ms + DAY) is None
    assert new.opens(end_ms - timedelta(days=2) // timedelta(milliseconds=1), before_ms=end_ms + DAY) == end_ms


def test_a_camera_that_comes_later_has_no_outage_before_it(tmp_path: Path) -> None:
    comes = replace(GOES, camera_id="comes", first_day=date(2026, 11, 10))
    site = make_site(tmp_path, cameras=[STAYS, comes])
    for camera, first in (("stays", T0), ("comes", T0 + DAY)):
        put(site, beats(first, T0 + DAY + 4 * HOUR, camera=camera, every=30_000))
    with open_days(site, "2026-11-09", "2026-11-10") as warehouse:
        (started,) = warehouse.rows("select min(started_ms) as ms from outages where camera_id = 'comes'")
        assert started["ms"] == T0 - 8 * HOUR + DAY, "midnight: it was not recorded from its first day on"
        states = warehouse.rows("select distinct state from hours where local_date = date '2026-11-09' order by 1")
        assert {row["state"] for row in states} == {"full", "no_data"}
