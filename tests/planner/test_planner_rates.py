"""The page's figures in a real browser are those of the report and of the analysis, for the same selection."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from datetime import timedelta
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
from planner import planted_shop as planted

from vsd_analytics.figures.panels import FloorHours, Panel, Place
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.planner.planner_data import PlannerData
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.story import week_report
from vsd_analytics.site.model import Site
from vsd_analytics.stats.changes import compare_encounter_rates, compare_violation_rates
from vsd_analytics.stats.rates import encounter_rate, violation_rate
from vsd_analytics.warehouse.warehouse import open_warehouse

pytestmark = pytest.mark.browser
SIX_DIGITS = 1e-6
RECTANGLE = (1, 1, 6, 6)

READ = """hash => {
  history.replaceState(null, '', '#' + hash); dispatchEvent(new HashChangeEvent('hashchange'));
  const told = {};
  for (const row of ['now', 'change']) for (const kind of ['violationRate', 'close', 'encounterRate']) {
    const id = `${row}-${kind}`;
    told[id] = {...document.getElementById(id).dataset};
  }
  return told;
}"""


OUTLINES = """i => {
  const d = document.querySelectorAll('#gb path')[i].getAttribute('d');
  return d.split('z').filter(Boolean).map(part => {
    const e = document.createElementNS('http://www.w3.org/2000/svg', 'path');
    e.setAttribute('d', part + 'z');
    const n = e.getTotalLength();
    return Array.from({length: 200}, (_, k) => { const q = e.getPointAtLength(n * k / 200); return [q.x, q.y]; });
  });
}"""


@pytest.fixture(scope="module")
def page_of(browser: Any, pages: dict[str, Path]) -> Iterator[Any]:
    opened: dict[str, Any] = {}

    def page(name: str) -> Any:
        if name not in opened:
            opened[name] = browser.new_page()
            opened[name].goto(pages[name].as_uri())
            opened[name].wait_for_function("document.body.dataset.first")
        return opened[name]

    yield page
    for each in opened.values():
        each.close()


@pytest.fixture(scope="module")
def report(shop: Site) -> WeekReport:
    return week_report(planted.with_settings(shop, min_exposure_h=2.0), planted.MONDAY)


def number(text: str) -> float | None:
    return None if text == "" else float(text)


def assert_same(told: dict[str, str], *expected: float | None) -> None:
    for key, value in zip(("rate", "lo", "hi"), expected, strict=True):
        found = number(told[key])
        if value is None:
            assert found is None, (key, told)
        else:
            assert found == pytest.approx(value, rel=SIX_DIGITS), (key, told, expected)


@pytest.mark.parametrize("name", ["exact", "masked"])
def test_the_whole_week_has_the_report_s_rates_for_the_floor_and_each_area(
    page_of: Any, report: WeekReport, name: str
) -> None:
    places: list[tuple[str, Estimate, Estimate | None]] = [
        ("floor", report.level.violation_rate, report.level.encounter_rate)
    ]
    for area in report.areas:
        place = "rest" if area.area_id is None else f"area%3A{area.area_id}"
        places.append((place, area.violation_rate, area.encounter_rate))
    assert len(places) == 4
    for place, per_open_h, per_person_h in places:
        told = page_of(name).evaluate(READ, f"place={place}")
        assert_same(told["now-violationRate"], per_open_h.value, per_open_h.lo, per_open_h.hi)
        assert per_person_h is not None
        assert_same(told["now-encounterRate"], per_person_h.value, per_person_h.lo, per_person_h.hi)
        assert per_open_h.change is not None
        assert per_open_h.change_lo is not None
        assert per_open_h.change_hi is not None
        assert_same(
            told["change-violationRate"], 1 + per_open_h.change, 1 + per_open_h.change_lo, 1 + per_open_h.change_hi
        )
        assert number(told["change-violationRate"]["a"]) == pytest.approx(per_open_h.previous, rel=SIX_DIGITS)


@pytest.mark.parametrize("name", ["exact", "masked"])
def test_the_share_of_time_too_close_is_the_report_s_for_the_floor_and_each_area(
    page_of: Any, report: WeekReport, exact: PlannerData, name: str
) -> None:
    shares = {"floor": report.level.close_time_share} | {
        "rest" if a.area_id is None else f"area:{a.area_id}": a.close_time_share for a in report.areas
    }
    for place in exact.places:
        told, share = page_of(name).evaluate(READ, f"place={quote(place.place_id)}"), shares[place.place_id]
        assert share is not None
        assert_same(told["now-close"], share.value, share.lo, share.hi)
        change = place.close_time_share
        assert change.change is not None
        assert number(told["change-close"]["rate"]) == pytest.approx(1 + change.change, rel=SIX_DIGITS)
        assert number(told["change-close"]["a"]) == pytest.approx(change.previous, rel=SIX_DIGITS)


def test_the_share_of_time_too_close_of_chosen_days_is_their_time_too_close_by_their_time(
    page_of: Any, shop: Site
) -> None:
    oracle = Oracle(planted.with_settings(shop, **planted.WHOLE))
    data, days = oracle.data, frozenset({0, 1, 3})
    slots = oracle.chosen(oracle.this.days, days, range(9, 11))
    used = data.hours.is_counted[:, slots]
    close_h, time_h = ((v[:, slots] * used).sum() for v in (data.violation_h, data.everyone.exposure_h))
    told = page_of("exact").evaluate(READ, "days=1101000")
    assert number(told["now-close"]["rate"]) == pytest.approx(close_h / time_h, rel=SIX_DIGITS)


def selections() -> list[tuple[str, frozenset[int], range]]:
    """Return selections of days and hours with the address that asks for them."""
    rng = np.random.default_rng(11)
    days = [frozenset(range(7)), frozenset(range(5)), frozenset({0, 1, 2, 4, 6}), frozenset({5, 6})]
    days += [frozenset(np.flatnonzero(rng.random(7) < 0.8).tolist()) for _ in range(4)]
    hours = [range(9, 11), range(9, 10), range(10, 11)]
    return [
        (f"days={''.join('1' if d in chosen else '0' for d in range(7))}&from={h.start}&to={h.stop}", chosen, h)
        for chosen, h in itertools.product(days, hours)
        if chosen
    ]


class Oracle:
    """The same selections from the marts, by the functions of the analysis room."""

    def __init__(self, site: Site) -> None:
        first = planted.FIRST
        self.warehouse = open_warehouse(site, first, planted.MONDAY + timedelta(days=6))
        self.data = FloorHours(self.warehouse, floor=site.floors[0])
        self.this = Period(self.data, planted.MONDAY, planted.MONDAY + timedelta(days=6))
        self.before = Period(self.data, planted.BEFORE, planted.BEFORE + timedelta(days=6))
        self.pair = TwoPeriods(self.before, self.this)
        self.settings = site.settings

    def chosen(self, period_days: list[Any], days: frozenset[int], hours: range) -> Any:
        h = self.data.hours
        inside = np.isin(h.day, [d.toordinal() for d in period_days])
        return np.flatnonzero(inside & np.isin(h.weekday, list(days)) & np.isin(h.hour, list(hours)))

    def panel(self, place: Place, period_days: list[Any], days: frozenset[int], hours: range) -> tuple[Panel, Any]:
        columns = [d for d in period_days if d.weekday() in days]
        slots = self.chosen(period_days, days, hours)
        panel = self.data.sums(place, slots, self.data.hours.is_counted[:, slots], columns)
        return panel, np.array([d.weekday() for d in columns], dtype=np.int64)

    def rates(self, place: Place, days: frozenset[int], hours: range, *, has_history: bool = True) -> tuple[Any, Any]:
        panel, weekday = self.panel(place, self.this.days, days, hours)
        past, past_weekday = self.panel(place, self.this.history_days if has_history else [], days, hours)
        counts, shown_h = past.n.sum(axis=0), past.exposure_h.sum(axis=0)
        known = bool(past.n.shape[1])
        per_open_h = violation_rate(
            panel.n,
            panel.x_h,
            weekday=weekday,
            history_n=past.n if known else None,
            history_x_h=past.x_h if known else None,
            history_weekday=past_weekday if known else None,
        )
        per_person_h = encounter_rate(
            panel.n.sum(axis=0),
            panel.exposure_h.sum(axis=0),
            weekday=weekday,
            history_n=counts if known else None,
            history_exposure_h=shown_h if known else None,
            history_weekday=past_weekday if known else None,
            min_exposure_h=self.settings.min_exposure_h,
        )
        return per_open_h, per_person_h

    def change(self, place: Place, days: frozenset[int], hours: range) -> tuple[Any, Any]:
        sides = []
        for which, period in ((0, self.before), (1, self.this)):
            slots = self.chosen(period.days, days, hours)
            columns = [d for d in period.days if d.weekday() in days]
            sides.append(self.data.sums(place, slots, self.pair.used(which)[:, slots], columns))
        a, b = sides
        return (
            compare_violation_rates(a.n, a.x_h, b.n, b.x_h),
            compare_encounter_rates(
                a.n.sum(axis=0), a.exposure_h.sum(axis=0), b.n.sum(axis=0), b.exposure_h.sum(axis=0),
                min_exposure_h=self.settings.min_exposure_h,
            ),
        )  # fmt: skip

    def rectangle(self, box: tuple[int, int, int, int]) -> Place:
        """Return what was counted in a rectangle, straight from violations and floor cells."""
        x0, y0, x1, y1 = box
        n, exposure_h = np.zeros_like(self.data.everyone.n), np.zeros_like(self.data.everyone.n)
        rows = self.warehouse.rows(
            "select camera_id, hour_start_ms, 1.0 as n, 0.0 as exposure_h from violations where is_open "
            "and x_m >= $x0 and x_m < $x1 and y_m >= $y0 and y_m < $y1 union all "
            "select camera_id, hour_start_ms, 0.0, exposure_open_s / 3600 from cell_hours "
            "where cx * 0.25 >= $x0 and cx * 0.25 < $x1 and cy * 0.25 >= $y0 and cy * 0.25 < $y1",
            {"x0": x0, "y0": y0, "x1": x1, "y1": y1},
        )
        for row in rows:
            at = (
                self.data.ids.index(row["camera_id"]),
                int(np.searchsorted(self.data.hours.start_ms, row["hour_start_ms"])),
            )
            n[at] += float(row["n"])
            exposure_h[at] += float(row["exposure_h"])
        return Place(n, exposure_h, np.asarray((n + exposure_h).any(axis=1)))


@pytest.fixture(scope="module")
def oracle(shop: Site) -> Iterator[Oracle]:
    made = Oracle(planted.with_settings(shop, **planted.WHOLE))
    with made.warehouse:
        yield made


def test_any_days_and_hours_have_the_rates_of_the_analysis(page_of: Any, oracle: Oracle) -> None:
    page, n_intervals = page_of("exact"), 0
    places = {"floor": oracle.this.whole, "area%3Adoor": oracle.this.area("door"), "rest": oracle.this.area(None)}
    for (address, days, hours), (name, place) in itertools.product(selections(), places.items()):
        told = page.evaluate(READ, f"{address}&place={name}")
        per_open_h, per_person_h = oracle.rates(place, days, hours)
        assert_same(told["now-violationRate"], per_open_h.value, per_open_h.lo, per_open_h.hi)
        assert_same(told["now-encounterRate"], per_person_h.value, per_person_h.lo, per_person_h.hi)
        n_intervals += per_open_h.lo is not None
        if len(days) == 7 and len(hours) == 2:
            continue  # there the page tells the report's own change
        for kind, change in zip(
            ("change-violationRate", "change-encounterRate"), oracle.change(place, days, hours), strict=True
        ):
            if change.value is not None and change.n_a and change.n_b:
                assert_same(told[kind], change.value, change.lo, change.hi)
    assert n_intervals > 20


def test_a_rectangle_has_the_rates_of_what_lies_in_it(page_of: Any, oracle: Oracle) -> None:
    page = page_of("exact")
    for box in (RECTANGLE, (0, 0, 25, 14), (21, 5, 25, 8), (3, 2, 4, 4)):
        place = oracle.rectangle(box)
        for address, days, hours in selections()[:6]:
            told = page.evaluate(READ, f"{address}&place=rect&rect={','.join(map(str, box))}")
            per_open_h, per_person_h = oracle.rates(place, days, hours, has_history=False)
            assert_same(told["now-violationRate"], per_open_h.value, per_open_h.lo, per_open_h.hi)
            assert_same(told["now-encounterRate"], per_person_h.value, per_person_h.lo, per_person_h.hi)


def test_a_hotspot_has_the_rates_of_its_squares(page_of: Any, oracle: Oracle, exact: PlannerData) -> None:
    from shapely import contains_xy
    from shapely.geometry import Polygon

    assert exact.hotspots.spots
    for spot in exact.hotspots.spots:
        shapes = [Polygon(p[0], p[1:]) for p in spot.place.polygons]
        inside = [
            oracle.rectangle((x, y, x + 1, y + 1))
            for x, y in itertools.product(range(26), range(16))
            if any(contains_xy(s, x + 0.5, y + 0.5) for s in shapes)
        ]
        assert inside
        n, exposure_h = sum(p.n for p in inside), sum(p.exposure_h for p in inside)
        place = Place(n, exposure_h, np.any([p.cameras for p in inside], axis=0))
        for address, days, hours in selections()[:3]:
            told = page_of("exact").evaluate(READ, f"{address}&place=spot%3A{spot.number}")
            per_open_h, per_person_h = oracle.rates(place, days, hours, has_history=False)
            assert_same(told["now-violationRate"], per_open_h.value, per_open_h.lo, per_open_h.hi)
            assert_same(told["now-encounterRate"], per_person_h.value, per_person_h.lo, per_person_h.hi)


def test_small_counts_put_together_move_rectangles_by_little(page_of: Any, oracle: Oracle, masked: PlannerData) -> None:
    below = int(masked.site.settings.mask_below)
    for box in (RECTANGLE, (7, 1, 12, 6)):
        address = f"place=rect&rect={','.join(map(str, box))}"
        exact, given = (page_of(name).evaluate(READ, address) for name in ("exact", "masked"))
        rates = [float(told["now-violationRate"]["rate"]) for told in (exact, given)]
        n_squares = (box[2] - box[0]) * (box[3] - box[1])
        assert abs(rates[0] - rates[1]) * 14 <= 2 * below * math.sqrt(n_squares)


def test_bands_cover_the_floor_that_the_report_colours(page_of: Any, exact: PlannerData, masked: PlannerData) -> None:
    from shapely import box, union_all
    from shapely.geometry import Polygon

    def shelf_free(shape: Any) -> Any:
        return shape.difference(box(*planted.SHELF))  # the page draws it over the bands

    for name, data in (("exact", exact), ("masked", masked)):
        page = page_of(name)
        page.evaluate(READ, "place=floor")
        assert data.shown is not None
        x0, _, _, y1 = data.shown.extent
        assert data.shown.bands
        for index, step in enumerate(data.site.settings.heat_steps):
            found = page.evaluate(OUTLINES, index)
            rings = [Polygon([(x0 + x / 100, y1 - y / 100) for x, y in ring]).buffer(0) for ring in found]
            drawn = shelf_free(union_all(rings))
            told = union_all([Polygon(p[0], p[1:]) for b in data.shown.bands if b.lower == step for p in b.polygons])
            if told.area < 1:
                assert drawn.area < 1.5
                continue
            assert drawn.intersection(told).area / drawn.union(told).area > 0.88, (name, step)


@pytest.mark.parametrize("week", [0, 1])
def test_the_map_is_the_report_s_to_the_last_digit(
    tab: Callable[..., Any], shop: Site, exact: PlannerData, pages: dict[str, Path], tmp_path: Path, week: int
) -> None:
    """Same cells, same smoothing along the floor around fixtures, same hours: this week's own and the compared ones."""
    from vsd_analytics.figures.week.density import FloorGrid
    from vsd_analytics.planner.hour_counts import TwoWeeks

    site = planted.with_settings(shop, **planted.WHOLE)
    assert exact.shown is not None
    with open_warehouse(site, planted.FIRST, planted.MONDAY + timedelta(days=6)) as warehouse:
        data = TwoWeeks(warehouse, floor=site.floors[0], monday=planted.MONDAY, before=planted.BEFORE)
        grid = FloorGrid(data, exact.shown.extent)
        period, used = (data.pair.before, data.pair.used(0)) if week else (data.this, data.hours.is_counted)
        told = grid.density(period, used=used).values
    text = pages["exact"].read_text(encoding="utf-8")
    at = text.rindex("start().catch")
    hook = f"window.drawn = () => [fine.nx, ...field({'before, before.same' if week else 'week, week.drawn'})];\n"
    path = tmp_path / "hooked.html"
    path.write_text(text[:at] + hook + text[at:], encoding="utf-8")
    page = tab(path.as_uri(), bypass_csp=True)
    page.wait_for_function("document.body.dataset.first")
    n_x, *values = page.evaluate("drawn()")
    shown = np.array(values).reshape(-1, n_x)[: told.shape[0], : told.shape[1]]
    assert told.max() > 1
    np.testing.assert_allclose(shown, told, rtol=1e-9, atol=1e-9)
