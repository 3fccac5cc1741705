"""Logged changes on the page: one click, the verdict of the analysis, matched weeks that tell no small count."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from planner import dense_floor as dense
from planner import planted_shop as planted

from vsd_analytics.answer import value_of
from vsd_analytics.figures.change_weeks import log_entry, windows_of
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.planner.change_words import change_words
from vsd_analytics.planner.logged_changes import CellSums, ChangeSide, PlannerChange
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData, planner_pages
from vsd_analytics.report.pages.change_story import came_of
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.site.model import Site
from vsd_analytics.warehouse.stored_days import stored_extent
from vsd_analytics.warehouse.warehouse import open_warehouse
from vsd_analytics.wording.languages import speaking

MOVED = planted.MONDAY
NOTED = planted.MONDAY - timedelta(days=7)
DOOR, EVERYWHERE, LATE = 0, 1, 2


@pytest.fixture(scope="module")
def logged(shop: Site, tmp_path_factory: pytest.TempPathFactory) -> Site:
    """The planted shop, whose log says that the door was changed before the week in which it has far fewer."""
    root = tmp_path_factory.mktemp("logged") / "shop"
    shutil.copytree(shop.root, root)
    entries = (
        (MOVED, "Display moved from the door <b>", "door"),
        (NOTED, "Floor stickers", None),
        (MOVED + timedelta(days=6), "Cameras cleaned", None),
    )
    lines = [json.dumps({"at": f"{day}T06:00:00+01:00", "text": text, "area": area}) for day, text, area in entries]
    (root / "log.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return planted.with_settings(replace(shop, root=root), washout_days=0, min_exposure_h=2.0)


@pytest.fixture(scope="module")
def known(logged: Site) -> PlannerData:
    return planner_pages(logged, planted.MONDAY)[0]


@pytest.fixture(scope="module")
def operators(logged: Site) -> PlannerData:
    """The operator's page, which alone has the matched weeks."""
    return planner_pages(planted.with_settings(logged, mask_below=0), planted.MONDAY)[0]


def by_text(known: PlannerData, start: str) -> PlannerChange:
    [found] = [c for c in known.changes if c.text.startswith(start)]
    return found


def test_a_logged_change_makes_the_page_hold_twelve_weeks_of_the_log(known: PlannerData, logged: Site) -> None:
    assert known.weeks == 12
    assert [c.text.split()[0] for c in known.changes] == ["Floor", "Display", "Cameras"]
    [fewer] = planner_pages(logged, planted.MONDAY - timedelta(days=7))
    assert [c.text.split()[0] for c in fewer.changes] == ["Floor"], "the log of later weeks is not in it"


def test_the_verdict_on_a_change_is_that_of_the_weekly_report(known: PlannerData, logged: Site) -> None:
    [told] = week_report(logged, planted.MONDAY).change_effects
    assert told.state == "ok"
    answers = by_text(known, "Display").answers
    assert answers is not None
    [entry] = answers["logged_change"].rows
    assert (entry["outcome"], entry["design"], entry["before_first"]) == (told.outcome, told.design, told.before[0])
    for name, column, keys, estimate in (
        ("change_so_far", "so_far_change", {}, told.running),
        ("change_effects", "effect_change", {"effect": "close_time_share"}, told.close),
        ("change_places", "place_people_change", {"place": "area"}, told.people),
        ("change_parts", "part_change", {"whole": "floor", "part": "floor"}, told.net),
    ):
        values = [value_of(row, column) for row in answers[name].where(**keys)]
        expected = [] if estimate is None else [(estimate.change, estimate.change_lo, estimate.change_hi)]
        assert [(v.value, v.lo, v.hi) for v in values] == expected, name
    assert told.people is not None


def test_weeks_compared_begin_with_the_records_whatever_days_are_open(logged: Site) -> None:
    extent = stored_extent(logged)
    assert extent is not None
    entry, last = log_entry(logged, 1), planted.MONDAY + timedelta(days=6)
    for first in (extent.first_day, extent.first_day - timedelta(days=30)):  # the planner's page opens earlier days
        with open_warehouse(logged, first, last) as warehouse:
            windows, _ = windows_of(warehouse, entry, area_id="door", weeks=4)
        assert windows is not None
        assert windows.trend[0] >= extent.first_day


def test_before_and_after_are_the_hours_that_both_recorded(logged: Site) -> None:
    site = planted.with_settings(logged, mask_below=0)
    change = by_text(planner_pages(site, planted.MONDAY)[0], "Display")
    assert change.before is not None
    assert change.after is not None
    with open_warehouse(site, planted.FIRST, planted.MONDAY + timedelta(days=6)) as warehouse:
        data = FloorHours(warehouse, floor=site.floors[0])
        pair = TwoPeriods(Period(data, *change.before.days), Period(data, *change.after.days))
        for k, side in enumerate((change.before, change.after)):
            used = pair.used((0, 1)[k])
            assert side.n[0].sum() == (data.everyone.n * used).sum() > 0
            assert side.recorded_ms.sum() == pytest.approx((data.hours.recorded_s * used).sum() * 1000)
            assert side.close_ms[0].sum() == pytest.approx((data.violation_h * used).sum() * 3.6e6, rel=1e-6)
            assert side.violations is not None
            assert side.violations.values[0].sum() == side.n[0].sum()
    assert change.before.recorded_ms.tolist() == change.after.recorded_ms.tolist()


def test_readers_have_the_verdict_on_a_change_and_no_sums_before_and_after(
    known: PlannerData, operators: PlannerData
) -> None:
    """They are over the hours that both sides recorded: beside the weekly pages they would tell what the others had."""
    assert [(c.before, c.after) for c in known.changes] == [(None, None)] * 3
    assert sum(c.before is not None for c in operators.changes) == 2
    told, exact = (change_words(by_text(of, "Display")) for of in (known, operators))
    assert told.verdict == exact.verdict
    assert told.rows == exact.rows
    assert told.spans == ()
    assert any("operator" in note for note in told.notes)
    assert not any("operator" in note for note in exact.notes)


def test_a_change_of_the_whole_site_is_shown_and_not_judged(known: PlannerData, operators: PlannerData) -> None:
    said = change_words(by_text(operators, "Floor"))
    assert said.verdict.startswith("Cannot tell: it concerns the whole site")
    assert "The map shows the weeks before and after" in said.verdict
    assert said.rows == ()
    assert said.spans
    for late in (change_words(by_text(operators, "Cameras")), change_words(by_text(known, "Floor"))):
        assert not late.spans
        assert "map" not in late.verdict


def test_the_verdict_is_the_page_s_sentence(known: PlannerData, logged: Site) -> None:
    report = week_report(logged, planted.MONDAY)
    [told] = report.change_effects
    with speaking("en"):
        assert change_words(by_text(known, "Display"), day=report.week.sunday).verdict == came_of(
            told, day=report.week.sunday
        )


def test_twelve_weeks_with_a_change_in_each_stay_within_800_kb(exact: PlannerData, known: PlannerData) -> None:
    page = dense.planner(exact, n_violations=300_000)
    change = by_text(known, "Display")
    changes = tuple(
        replace(change, number=k + 1, before=dense_side(page, k), after=dense_side(page, k + 20)) for k in range(12)
    )
    text = render_planner(replace(page, weeks=12, changes=changes))
    assert text.count('data-change="') == 12
    assert len(text.encode()) <= 800_000


def dense_side(page: PlannerData, seed: int) -> ChangeSide:
    """Return four weeks of a busy floor, no two alike."""
    rng = np.random.default_rng(seed)
    cells = page.week.cells
    assert cells is not None

    def summed(rows: Any) -> CellSums:
        key, first = np.unique(rows.camera * 10**6 + rows.cell, return_index=True)
        sums = np.add.reduceat(rows.values, first, axis=1)
        values = np.rint(sums * rng.uniform(3, 5, sums.shape)).astype(np.int64)
        return CellSums(camera=key // 10**6, cell=key % 10**6, values=values)

    totals = {k: getattr(page.week.panel, k).sum(axis=2) * 4 for k in ("n", "exposure_ms", "close_ms")}
    recorded_ms = page.week.panel.recorded_ms.sum(axis=1) * 4
    days = (planted.FIRST, planted.MONDAY)
    return ChangeSide(
        days=days, recorded_ms=recorded_ms, violations=summed(cells.violations), time=summed(cells.time), **totals
    )


# ---- in the browser ----
@pytest.fixture
def opened(tab: Callable[..., Any], operators: PlannerData, tmp_path: Path) -> Callable[..., Any]:
    path = tmp_path / "logged.html"
    path.write_text(render_planner(operators), encoding="utf-8")

    def page(address: str = "", **options: Any) -> Any:
        shown = tab(path.as_uri() + address, **options)
        shown.wait_for_function("document.body.dataset.first")
        return shown

    return page


@pytest.mark.browser
def test_one_click_answers_whether_a_change_helped(opened: Any, operators: PlannerData) -> None:
    page, change = opened(viewport={"width": 1280, "height": 900}), by_text(operators, "Display")
    assert not page.is_visible(".card")
    page.click(f"[data-change='{change.number}']")
    card = page.locator(".card:visible")
    assert card.count() == 1
    assert card.locator(".verdict").inner_text() == change_words(change).verdict
    assert "Whole floor, from whatever cause" in card.inner_text()
    assert page.evaluate("[document.body.dataset.show, document.body.dataset.map]") == ["difference", "burden"]
    assert page.input_value("#place") == "area:door"
    assert re.search(r"[ML]", page.get_attribute("#gb .f1", "d") + page.get_attribute("#gb .f2", "d"))
    assert change.before is not None
    door = next(k for k, p in enumerate(operators.places) if p.place_id == "area:door")
    rate = sum(n / ms * 3.6e6 for n, ms in zip(change.before.n[door], change.before.recorded_ms, strict=True) if n)
    assert float(page.get_attribute("#change-violationRate", "data-a")) == pytest.approx(rate)
    assert page.is_disabled("[data-day='0']")
    kept = page.url
    page.click(f"[data-change='{change.number}']")
    assert "change" not in page.url
    assert not page.is_visible(".card")
    again = opened(address="#" + kept.partition("#")[2])
    assert again.locator(".verdict:visible").inner_text() == change_words(change).verdict
    assert page.errors == again.errors == []


@pytest.mark.browser
def test_keys_and_fingers_choose_a_change_too(opened: Any) -> None:
    page = opened(viewport={"width": 1280, "height": 900})
    page.focus("[data-change='2']")
    page.keyboard.press("Enter")
    assert page.get_attribute("[data-change='2']", "aria-pressed") == "true"
    assert "cannot be tested here" in page.locator(".verdict:visible").inner_text()
    phone = opened(viewport={"width": 320, "height": 700}, has_touch=True, is_mobile=True)
    phone.tap("[data-change='1']")
    assert phone.locator(".card:visible").count() == 1
    phone.tap(".card:visible [data-pair]")
    assert phone.locator("#cut").bounding_box()["width"] > 200
    assert phone.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0


@pytest.mark.browser
def test_before_and_after_are_a_pair_of_maps_under_one_slider_and_side_by_side_on_paper(opened: Any) -> None:
    page = opened(viewport={"width": 1280, "height": 900})
    page.click("[data-change='1']")
    page.focus(".card:visible [data-pair]")
    page.keyboard.press("Enter")
    assert page.evaluate("[document.body.dataset.show, document.body.dataset.map]") == ["split", "burden"]
    assert page.evaluate("document.activeElement.id") == "cut", "arrow keys move it at once"
    before = float(page.get_attribute("#clip-a", "width"))
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    assert page.input_value("#cut") == "60"
    assert float(page.get_attribute("#clip-a", "width")) > before
    assert page.inner_text("#cut-now") in page.get_attribute("#cut", "aria-label")
    bands = "(id => [...document.querySelectorAll(id + ' path')].map(p => p.getAttribute('d')).join(''))"
    sides = [page.evaluate(f"{bands}('{side}')") for side in ("#ga", "#gb")]
    assert sides[0] != sides[1]
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert not page.is_visible(".both")
    page.emulate_media(media="print")
    left, right = (page.locator(f".both figure:nth-child({k})") for k in (1, 2))
    assert [left.locator("figcaption").inner_text(), right.locator("figcaption").inner_text()] == [
        page.text_content("#cut-was"),
        page.text_content("#cut-now"),
    ]
    a, b = left.bounding_box(), right.bounding_box()
    assert a["y"] == b["y"]
    assert page.evaluate("getComputedStyle(document.getElementById('known-ga')).visibility") == "visible", (
        "clips the maps"
    )
    assert a["x"] + a["width"] <= b["x"]
    assert page.locator(".map").bounding_box()["height"] < 5
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    page.emulate_media(media="screen")
    page.click("[data-change='1']")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.locator(".both").count() == 0, "a single week is one map"
    assert page.errors == []


@pytest.mark.browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_chosen_change_is_quiet_for_axe(opened: Any, axe: Callable[..., Any], scheme: str) -> None:
    page = opened(address="#change=1&show=difference&map=burden", color_scheme=scheme, bypass_csp=True)
    assert axe(page, tags=()) == [], "axe's own choice of rules"
