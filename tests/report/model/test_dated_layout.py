"""Areas and fixtures with dates: old weeks have the old layout, and an area counts on the days it exists alone."""

from __future__ import annotations

from datetime import timedelta

import pytest
from report import ingested_worlds as w

from vsd_analytics.answer import Reason
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.contributions import contributions
from vsd_analytics.report.pages.map_figures import map_figures
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.site.model import Site

HOURS, OPENING = (9, 10), '{ mon-sun = "09:00-10:00" }'
COUNTS = {w.QUEUE: 30, w.DOOR: 20, w.AISLE: 10}
THURSDAY = w.MONDAY + timedelta(days=3)


def area(area_id: str, x0: int, y0: int, dates: str) -> str:
    ring = [[x0, y0], [x0 + 4, y0], [x0 + 4, y0 + 4], [x0, y0 + 4]]
    return f'[[area]]\nid = "{area_id}"\nname = "{area_id.title()}"\npolygon = {ring}\n{dates}\n'


def display(x0: int, dates: str) -> str:
    ring = [[x0, 13], [x0 + 1, 13], [x0 + 1, 14], [x0, 14]]
    return f'[[fixture]]\nid = "display"\nname = "Display"\npolygon = {ring}\n{dates}\n'


LAYOUT = (
    area("queue", 1, 1, "")
    + area("door", 7, 1, f'from = "{w.MONDAY}"')
    + area("gate", 7, 1, f'to = "{w.MONDAY}"')
    + area("aisle", 1, 7, f'from = "{THURSDAY}"')
    + display(2, f'to = "{w.MONDAY}T06:30"')
    + display(12, f'from = "{w.MONDAY}T06:30"')
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Site:
    streams = [w.messages(w.steady(COUNTS), monday=monday, hours=HOURS) for monday in (w.BEFORE, w.MONDAY)]
    return w.world(tmp_path_factory.mktemp("dated"), w.toml(areas={}, opening=OPENING, more=LAYOUT), *streams)


@pytest.fixture(scope="module")
def before(site: Site) -> WeekReport:
    return w.report(site, w.BEFORE)


@pytest.fixture(scope="module")
def now(site: Site) -> WeekReport:
    return w.report(site)


def test_each_week_has_the_areas_of_its_days(before: WeekReport, now: WeekReport) -> None:
    assert {a.area_id for a in before.areas} == {"queue", "gate", None}
    assert {a.area_id for a in now.areas} == {"queue", "door", "aisle", None}
    assert {a.area_id for a in before.maps[0].areas} == {"queue", "gate"}
    assert {a.area_id for a in now.maps[0].areas} == {"queue", "door", "aisle"}


def test_an_area_counts_the_days_it_exists_alone(before: WeekReport, now: WeekReport) -> None:
    rates = {a.area_id: (a.counted, a.violation_rate.value) for a in now.areas}
    assert rates["aisle"] == (40, 10.0), "four days of one hour, ten in each"
    assert rates["door"] == (140, 20.0)
    assert rates[None] == (30, pytest.approx(30 / 7)), "the aisle's floor until Wednesday"
    assert {a.area_id: a.counted for a in before.areas} == {"queue": 210, "gate": 140, None: 70}


def test_a_new_area_is_compared_with_nothing_and_says_why(now: WeekReport) -> None:
    found = {a.area_id: a for a in now.areas}
    for area_id in ("door", "aisle"):
        assert (found[area_id].violation_rate.previous, found[area_id].violation_rate.change) == (None, None)
        assert found[area_id].violation_rate.reason == Reason("area.new")
    assert found["queue"].violation_rate.previous == 30.0
    assert "this area did not exist yet" in render_html(now)


def test_contributions_add_up_where_an_area_is_new(now: WeekReport) -> None:
    found = contributions(now)
    assert found is not None
    values = {row.name: row.value for row in found.rows}
    assert values["Door"] == "+20"
    assert values["Rest of the floor"] == "−26", "the gate's 20 and six of seven parts of the aisle"
    assert values["Aisle"] == "+6"
    assert (values["Week 45"], values["Week 46"]) == ("60", "60")


def test_old_weeks_draw_a_fixture_where_it_stood_then(before: WeekReport, now: WeekReport) -> None:
    assert [f.ring[0] for f in before.maps[0].fixtures] == [(2.0, 13.0)]
    assert [f.ring[0] for f in now.maps[0].fixtures] == [(12.0, 13.0)]


def test_the_maps_around_a_move_draw_both_places(now: WeekReport) -> None:
    figure = map_figures(now).change
    assert now.change_maps is not None
    assert figure is not None
    assert [f.ring[0] for f in now.change_maps.fixtures_before or ()] == [(2.0, 13.0)]
    then, today, difference = [p.drawing for p in figure.panels]
    solid, left = [d.count('class="fx mv"') + d.count('class="fx"') for d in (then, today)], today.count('class="gn"')
    assert (solid, left, then.count('class="gn"'), difference.count('class="gn"')) == ([1, 1], 1, 0, 1)
    assert "where Display stood before" in render_html(now)
