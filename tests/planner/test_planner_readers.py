"""The planner for readers: hours of the whole floor as the report has them, everything else by the week only."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from planner import planted_shop as planted

from vsd_analytics.figures.share import earlier
from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData, planner_pages
from vsd_analytics.report.pages.json_and_csv import to_json
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.site.model import Site
from vsd_analytics.wording.catalogue import say

AT = """hash => { history.replaceState(null, '', '#' + hash); dispatchEvent(new HashChangeEvent('hashchange'));
  const said = document.getElementById('out').textContent;
  return {said, ...document.getElementById('now-violationRate').dataset}; }"""
CHOSEN = "days=1101111&from=9&to=10"


@pytest.fixture(scope="module")
def text(masked: PlannerData) -> str:
    return render_planner(masked)


def timetable(site: Site, monday: date = planted.MONDAY) -> dict[tuple[int, int], dict[str, Any]]:
    """Return the cells of the report's timetable by day of the week and hour."""
    cells = json.loads(to_json(week_report(site, monday)))["when"]["cells"]
    days = sorted({cell["day"] for cell in cells})
    return {(days.index(cell["day"]), cell["hour"]): cell for cell in cells}


def test_no_small_count_is_in_the_file(masked: PlannerData, text: str, exact: PlannerData) -> None:
    for week in planted.unpacked(text, masked):
        for name in ("violations", "fine", "violations_pair"):
            counts = np.array(week[name][0])
            assert counts.sum() > 0
            assert not ((counts > 0) & (counts < 5)).any(), name
    [week, _] = planted.unpacked(render_planner(exact), exact)
    assert any(0 < n < 5 for n in week["violations"][0]), "the planted floor has some, so there was something to hide"


def test_counts_by_hour_are_those_of_the_report_s_timetable_and_of_no_other_place(
    shop: Site, masked: PlannerData, text: str
) -> None:
    [week, _] = planted.unpacked(text, masked)
    cells = timetable(planted.with_settings(shop, min_exposure_h=2.0))
    assert len(week["n"]) == len(week["hour"]) == 14, "one place, all cameras together"
    for day, hour, n, recorded in zip(week["day"], week["hour"], week["n"], week["recorded"], strict=True):
        if recorded % 2:
            assert n == cells[day, hour]["violations"]
        else:
            assert n == 0, "a camera was down"
    assert sum(v % 2 == 0 for v in week["recorded"]) == 3, "two hours of Wednesday and one of Friday"


def hiding(folder: Path, below: int) -> Site:
    """Return a shop whose report hides every hour with fewer violations; nothing of it was shared before."""
    return planted.with_settings(planted.build(folder / "shop"), mask_below=below, min_exposure_h=2.0)


@pytest.mark.parametrize(("monday", "below"), [(planted.BEFORE, 90), (planted.MONDAY, 60)])
def test_hours_that_the_report_hides_have_equal_parts_of_their_sum_or_are_not_there(
    tmp_path: Path, monday: date, below: int
) -> None:
    """In the last week a camera was down for 40 minutes of an hour: the week does not tell the sum of hidden hours."""
    site = hiding(tmp_path, below)
    [data] = planner_pages(site, monday)
    [exact] = planner_pages(planted.with_settings(site, mask_below=0), monday)
    panel, cells = data.week.panel, timetable(site, monday)
    hidden = np.array([cells[d, h]["violations"] is None for d, h in zip(panel.day, panel.hour, strict=True)])
    assert 0 not in data.week.hidden
    assert 0 < hidden.sum() < len(hidden)
    if monday == planted.MONDAY:
        assert not panel.is_counted[0, hidden].any()
        assert not panel.n[0, 0, hidden].any()
    else:
        assert hidden.sum() > 1
        assert np.ptp(panel.n[0, 0, hidden]) <= 1
        assert panel.n[0, 0, hidden].sum() == exact.week.panel.n[0].sum(axis=0)[hidden].sum()


def test_what_the_planner_shows_is_remembered_like_a_report(tmp_path: Path) -> None:
    site = planted.with_settings(planted.build(tmp_path / "shop"), min_exposure_h=2.0)
    planner_pages(planted.with_settings(site, mask_below=0), planted.MONDAY)
    assert earlier.read(site) == ()
    planner_pages(site, planted.MONDAY)
    assert {planted.MONDAY, planted.BEFORE} <= {week.monday for week in earlier.read(site)}


def test_weeks_with_a_hidden_hour_are_not_compared_in_part(tmp_path: Path) -> None:
    """A camera was down for a part of the other week: the hours that are compared would tell of the others."""
    [data] = planner_pages(hiding(tmp_path, 90), planted.BEFORE, before=planted.MONDAY)
    assert data.why_not_compared == GIVES_AWAY
    assert all(place.violation_rate.change is None for place in data.places)


def test_cells_of_the_whole_week_are_those_of_the_operator_in_sum(exact: PlannerData, masked: PlannerData) -> None:
    sums = []
    for data in (exact, masked):
        assert data.week.cells is not None
        rows = data.week.cells.violations
        sums.append(np.bincount(rows.camera, weights=rows.values[0], minlength=2))
    np.testing.assert_array_equal(*sums)


def test_the_map_of_the_test_of_hotspots_cell_by_cell_is_the_operator_s(text: str, exact: PlannerData) -> None:
    assert 'value="excess"' not in text
    assert 'value="excess"' in render_planner(exact)


def test_the_page_says_what_is_left_out(text: str, exact: PlannerData) -> None:
    assert say("planner.week_only") in text
    assert say("planner.week_only") not in render_planner(exact)
    assert say("page.exact") not in text


@pytest.mark.browser
def test_chosen_hours_change_the_floor_and_leave_an_area_at_its_week(
    tab: Callable[..., Any], pages: dict[str, Path]
) -> None:
    page = tab(pages["masked"].as_uri())
    page.wait_for_function("document.body.dataset.ready")
    whole, chosen = (page.evaluate(AT, at) for at in ("", CHOSEN))
    assert chosen["rate"] != whole["rate"]
    assert chosen["lo"] != ""
    for place in ("area%3Aqueue", "rest", "rect&rect=1,1,6,6"):
        week, hours = (page.evaluate(AT, f"{at}&place={place}") for at in ("", CHOSEN))
        assert hours["rate"] == week["rate"] != "", place
        assert say("planner.script.whole_week") in hours["said"], place
        assert say("planner.script.whole_week") not in week["said"], place
    assert page.errors == []


@pytest.mark.browser
def test_chosen_hours_have_the_operator_s_rates_where_all_cameras_recorded_them(
    tab: Callable[..., Any], pages: dict[str, Path]
) -> None:
    told = []
    for name in ("exact", "masked"):
        page = tab(pages[name].as_uri())
        page.wait_for_function("document.body.dataset.ready")
        told.append(float(page.evaluate(AT, CHOSEN)["rate"]))
    assert told[1] == pytest.approx(told[0], rel=1e-6)


@pytest.mark.browser
def test_the_map_does_not_change_with_the_chosen_hours(tab: Callable[..., Any], pages: dict[str, Path]) -> None:
    page = tab(pages["masked"].as_uri())
    page.wait_for_function("document.body.dataset.ready")
    drawn = "[...document.querySelectorAll('#gb path')].map(p => p.getAttribute('d')).join()"
    maps = []
    for at in ("map=exposure", f"map=exposure&{CHOSEN}"):
        page.evaluate(AT, at)
        maps.append(page.evaluate(drawn))
    assert maps[0] == maps[1] != ""
