"""Counting lines over the planner's map: the numbers of `vsd lines`, of the days or hours chosen; else nothing."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from figures.test_line_counts import LINE, shop, through
from planner import planted_shop as planted
from planner.written_address import written_address
from report import ingested_worlds as w
from warehouse.small_projects import DAY, HOUR, T0, Frame, Person, beats

from vsd_analytics.config.project import load_site
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData, planner_pages

GATE = (
    '[[line]]\nid = "gate"\nname = "Gate"\npoints = [[0, 5], [2, 5]]\nleft = "Park"\nright = "Road"\n'
    "from = 2026-11-12\n"
)
NOW = """() => [...document.querySelectorAll('#crossed tbody tr')].filter(r => r.checkVisibility()).map(r =>
  [...r.cells].map(c => (c.querySelector('b') || c).textContent))"""
PLATES = "() => [...document.querySelectorAll('#plates .cn')].map(e => e.textContent)"


def people(*, few_at: int | None = None) -> list[Person | Frame]:
    """Return a week of two hours a day: on day d, 10 + d come in at nine and 20 at ten, and 8 go out in each hour."""
    records: list[Person | Frame] = []
    for d in range(7):
        for hour, n in ((0, 10 + d), (1, 20)):
            at = T0 + d * DAY + hour * HOUR
            for k in range(n):
                records += through(at + k * 60_000, f"in-{d}-{hour}-{k}")
            for k in range(2 if d == few_at else 8):
                records += through(at + 30_000 + k * 60_000, f"out-{d}-{hour}-{k}", way=-1)
            records += beats(at, at + HOUR)
    return records


def known(root: Path, records: Sequence[Person | Frame], *, lines: str = LINE, **settings: float) -> PlannerData:
    toml = shop(root, records, lines=lines) / "vsd.toml"
    text = toml.read_text(encoding="utf-8").replace("09:00-10:00", "09:00-11:00")
    toml.write_text(text, encoding="utf-8")
    return planner_pages(planted.with_settings(load_site(root), **settings), w.MONDAY)[0]


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> PlannerData:
    return known(tmp_path_factory.mktemp("lines-shared"), people(), lines=LINE + GATE)


@pytest.fixture(scope="module")
def exact(tmp_path_factory: pytest.TempPathFactory) -> PlannerData:
    return known(tmp_path_factory.mktemp("lines-exact"), people(), mask_below=0)


def meta(page: str) -> dict[str, Any]:
    found = re.search(r'id="meta">(.*?)</script>', page, flags=re.DOTALL)
    assert found is not None
    return dict(json.loads(found[1]))


def test_the_page_without_script_has_the_week_of_each_line(shared: PlannerData) -> None:
    page = render_planner(shared)
    table = page[page.index('id="crossed"') :]
    rows = re.findall(r'<tr><th scope="row">(.*?)</tr>', table[: table.index("</table>")])
    assert re.findall(r"<b>(.*?)</b> <small>(.*?)</small>", rows[0]) == [("231", "to Shop"), ("112", "to Street")]
    assert "<b>Door" not in page
    assert "&lt;b&gt;Door" in page


def test_only_the_operator_has_hours_of_single_days(shared: PlannerData, exact: PlannerData) -> None:
    assert ["slots" in line for line in meta(render_planner(shared))["lines"]["lines"]] == [False, False]
    (line,) = meta(render_planner(exact))["lines"]["lines"]
    assert [line["slots"][d][9][:2] for d in range(7)] == [[10 + d, 8] for d in range(7)]


def test_a_hidden_day_hides_the_other_days_of_its_line(tmp_path: Path) -> None:
    found = meta(render_planner(known(tmp_path, people(few_at=3))))["lines"]
    (line,) = found["lines"]
    assert line["week"][:2] == [231, 100]
    assert all(found["reasons"][-1 - day[1]]["hides"] for day in line["days"])
    assert [day[0] for day in line["days"]] == [30 + d for d in range(7)]


def test_without_a_line_the_page_has_nothing_of_lines(tmp_path: Path) -> None:
    page = render_planner(known(tmp_path, people(), lines=""))
    assert "lines" not in meta(page)
    assert re.findall(r"crossed|plates|\.cl\b|lines_|type=.?checkbox", page) == []


@pytest.fixture
def opened(tab: Callable[..., Any], tmp_path: Path) -> Callable[..., Any]:
    def page(data: PlannerData, address: str = "", **options: Any) -> Any:
        path = tmp_path / "planner.html"
        path.write_text(render_planner(data), encoding="utf-8")
        shown = tab(path.as_uri() + address, **options)
        shown.wait_for_function("document.body.dataset.first")
        return shown

    return page


def go(page: Any, address: str) -> list[list[str]]:
    page.evaluate("at => { location.hash = at; dispatchEvent(new HashChangeEvent('hashchange')); }", address)
    return list(page.evaluate(NOW))


@pytest.mark.browser
def test_days_or_hours_are_chosen_and_not_both_by_readers(opened: Callable[..., Any], shared: PlannerData) -> None:
    page = opened(shared)
    door, gate = page.evaluate(NOW)
    assert (door[1:], gate[1:3]) == (["231", "112", "100%"], ["0", "0"])
    assert page.evaluate(PLATES) == ["231", "112", "0", "0"]
    assert go(page, "#days=1100000") == [["<b>Door</b>", "61", "32", "100%"]], "the gate came on Thursday"
    assert page.evaluate(PLATES) == ["61", "32"]
    assert go(page, "#from=10")[0][1:] == ["140", "56", "100%"]
    assert go(page, "#from=10&days=1100000")[0][1:] == ["–", "–", "–"]
    assert "Choose days or hours, not both." in page.inner_text("#crossed caption")
    assert page.errors == []


@pytest.mark.browser
def test_the_operator_chooses_hours_of_days(opened: Callable[..., Any], exact: PlannerData) -> None:
    page = opened(exact, "#from=9&to=10&days=0010001")
    assert page.evaluate(NOW)[0][1:] == ["28", "16", "100%"]


@pytest.mark.browser
def test_one_hidden_day_makes_the_sum_of_days_unknown(opened: Callable[..., Any], tmp_path: Path) -> None:
    page = opened(known(tmp_path, people(few_at=3)), "#days=1111100")
    assert page.evaluate(NOW)[0][1:3] == ["160", "–"]
    assert "to Street: hidden, as it would reveal" in page.inner_text("#crossed")


@pytest.mark.browser
@pytest.mark.parametrize(("scheme", "width"), [("light", 1280), ("dark", 320)])
def test_the_layer_is_switched_off_by_keyboard_and_kept_in_the_address(
    opened: Callable[..., Any], axe: Callable[..., Any], shared: PlannerData, scheme: str, width: int
) -> None:
    page = opened(shared, color_scheme=scheme, viewport={"width": width, "height": 900}, bypass_csp=True)
    for is_on in (True, False):
        assert axe(page) == []
        assert page.is_visible("#crossed") is is_on
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
        assert bool(page.evaluate(PLATES)) is is_on
        page.focus("#lines")
        page.keyboard.press("Space")
    assert written_address(page).endswith(".html"), "it is on again"
    page.keyboard.press("Space")
    assert written_address(page).endswith("#lines=off")
    assert page.errors == []


@pytest.mark.browser
def test_a_drawing_in_metres_has_the_lines_and_who_crossed(opened: Callable[..., Any], shared: PlannerData) -> None:
    page = opened(shared)
    with page.expect_download() as waiting:
        page.click("#save-geojson")
    found = json.loads(Path(waiting.value.path()).read_text(encoding="utf-8"))["features"]
    lines = [f for f in found if f["properties"]["layer"] == "counting-lines"]
    assert [f["geometry"]["coordinates"] for f in lines] == [[[[0, 0], [2, 0]]], [[[0, 5], [2, 5]]]]
    assert lines[0]["properties"]["name"] == "<b>Door</b>: 231 to Shop, 112 to Street"
