"""The page in a real browser: reached by every hand, quiet, free of errors, never too wide, the same by its address."""

from __future__ import annotations

import base64
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import cv2
import numpy as np
import pytest
from planner.written_address import written_address

from vsd_analytics.answer import Reason
from vsd_analytics.planner import cell_counts
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData

pytestmark = pytest.mark.browser
MODES = [("light", 1280), ("dark", 390)]
VIEWS = (
    "",
    "#show=split&cut=30&map=exposure",
    "#show=difference",
    "#map=risk&place=rect&rect=1,1,6,6&days=1111100",
    "#map=excess",
    "#place=spot%3A1",
)
FOCUSED = """(e => e === document.body ? ''
  : e.id || e.dataset.day || e.dataset.pick || e.dataset.pan || e.value || e.className)(document.activeElement)"""
Open = Callable[..., Any]


@pytest.fixture
def opened(tab: Open, pages: dict[str, Path]) -> Open:
    def page(name: str = "exact", address: str = "", **options: Any) -> Any:
        shown = tab(pages[name].as_uri() + address, **options)
        if options.get("java_script_enabled", True):
            shown.wait_for_function("document.body.dataset.first")
        return shown

    return page


def said(page: Any) -> str:
    return str(page.text_content("#out"))


def view(page: Any) -> list[float]:
    return [float(v) for v in page.get_attribute("#plan", "viewBox").split()]


def address(page: Any) -> dict[str, str]:
    parts = unquote(written_address(page).partition("#")[2]).split("&")
    return dict(part.split("=", 1) for part in parts if part)


@pytest.mark.parametrize(("scheme", "width"), MODES)
def test_every_view_is_accessible_quiet_and_fits(opened: Open, axe: Open, scheme: str, width: int) -> None:
    page = opened(
        "masked" if width < 600 else "exact",
        color_scheme=scheme,
        viewport={"width": width, "height": 900},
        bypass_csp=True,
    )
    for at in VIEWS:
        page.evaluate("at => { location.hash = at || '#'; }", at)
        page.evaluate("dispatchEvent(new HashChangeEvent('hashchange'))")
        assert axe(page) == [], at
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0, at
    assert [u for u in page.seen if not u.startswith("data:")] == [page.seen[0]]
    assert page.errors == []


@pytest.mark.parametrize("width", [320, 390, 1280])
def test_nothing_is_wider_than_the_screen(opened: Open, width: int) -> None:
    page = opened(address="#place=rect&rect=1,1,6,6&show=split", viewport={"width": width, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
    small = page.evaluate(
        "[...document.querySelectorAll('button,select,input')].filter(e => e.offsetParent)"
        ".map(e => e.getBoundingClientRect())"
        ".filter(r => r.width && Math.min(r.width, r.height) < 18).length"
    )
    assert small == 0


def test_the_policy_lets_the_page_s_own_script_and_style_through(opened: Open) -> None:
    page = opened()
    assert page.evaluate("getComputedStyle(document.querySelector('.app')).display") == "grid"
    assert page.errors == []
    page.evaluate(
        "() => { const s = document.createElement('script');"
        "s.textContent = 'window.bad = 1'; document.body.append(s); }"
    )
    assert page.evaluate("window.bad") is None


def test_a_keyboard_alone_reaches_everything(opened: Open) -> None:
    """Tab to each control in turn; choose, look around, draw a rectangle and read its rate without a pointer."""
    page = opened(viewport={"width": 1280, "height": 900})
    keys = page.keyboard
    reached: list[str] = []
    for _ in range(60):
        keys.press("Tab")
        name = page.evaluate(FOCUSED)
        if not name or name in reached:
            break
        assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid", name
        reached.append(name)
    wanted = [
        "week",
        "mapkind",
        *map(str, range(7)),
        "1111111",
        "from",
        "to",
        "place",
        "draw",
        "map",
        "zi",
        "link",
        "png",
    ]
    assert [name for name in wanted if name not in reached] == []

    page.focus("[name=show][value=week]")
    keys.press("ArrowDown")
    assert address(page) == {"show": "split"}
    before = page.get_attribute("#clip-b", "x")
    page.focus("#cut")
    for _ in range(10):
        keys.press("ArrowLeft")
    assert float(page.get_attribute("#clip-b", "x")) < float(before)
    page.focus("[data-day='5']")
    keys.press("Space")
    keys.press("Tab")
    keys.press("Enter")
    assert address(page)["days"] == "1111100"

    page.focus("#map")
    keys.press("+")
    zoomed = view(page)
    keys.press("ArrowRight")
    assert view(page)[0] > zoomed[0]
    assert view(page)[2] == pytest.approx(zoomed[2])
    keys.press("0")
    assert view(page)[0] == 0
    keys.press("r")
    first = page.input_value("#left"), page.input_value("#right")
    keys.press("ArrowLeft")
    keys.press("ArrowLeft")
    keys.press("Shift+ArrowRight")
    second = page.input_value("#left"), page.input_value("#right")
    assert [int(b) - int(a) for a, b in zip(first, second, strict=True)] == [-2, -1]
    keys.press("Escape")
    assert said(page).startswith("Rectangle.")
    page.fill("#left", "1")
    keys.press("Tab")
    page.fill("#right", "6")
    keys.press("Tab")
    page.fill("#bottom", "1")
    page.fill("#top", "6")
    keys.press("Tab")
    assert page.text_content("#read-name") == "Rectangle"
    assert address(page)["rect"] == "1,1,6,6"
    assert page.errors == []


def test_single_clicks_do_what_dragging_does(opened: Open) -> None:
    page = opened(viewport={"width": 1280, "height": 900})
    box = page.locator("#map").bounding_box()
    page.click("#zi")
    page.click("#zi")
    middle = view(page)
    page.click("[aria-label='Move right']")
    assert view(page)[0] > middle[0]
    page.click("#map", position={"x": box["width"] * 0.2, "y": box["height"] * 0.5})
    assert view(page)[0] < middle[0]
    page.click("#zr")
    page.click("#draw")
    page.click("#map", position={"x": box["width"] * 0.05, "y": box["height"] * 0.9})
    assert "opposite corner" in page.text_content("#said")
    assert page.get_attribute("#draw", "aria-pressed") == "true"
    page.click("#map", position={"x": box["width"] * 0.25, "y": box["height"] * 0.5})
    assert address(page)["rect"] == "1,1,6,5"
    assert page.get_attribute("#draw", "aria-pressed") == "false", "what is drawn is drawn: the map moves again"
    page.click("#clear")
    assert "rect" not in address(page)


def test_how_to_draw_is_said_while_one_draws(opened: Open) -> None:
    page = opened(viewport={"width": 390, "height": 800}, has_touch=True, is_mobile=True)
    page.tap("#draw")
    assert "Drag across the map, or tap two opposite corners." in page.text_content("#said")
    box = page.locator("#map").bounding_box()
    assert 0 <= box["y"] < 800 - box["height"], "the map is in sight"
    hint = page.locator("#said").bounding_box()
    assert box["y"] + box["height"] <= hint["y"] < 800 - hint["height"], "and so is what to do"
    for x, y in ((0.1, 0.2), (0.5, 0.8)):
        page.touchscreen.tap(box["x"] + x * box["width"], box["y"] + y * box["height"])
    assert page.text_content("#read-name") == "Rectangle"
    assert page.text_content("#said") == ""
    page.focus("#draw")
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.id") == "map", "arrow keys move what is drawn"


def test_a_hotspot_is_chosen_by_its_number_and_from_the_list(opened: Open) -> None:
    page = opened(viewport={"width": 1280, "height": 900})
    named = page.eval_on_selector_all("#place option", "all => all.map(o => o.value)")
    assert "spot:1" in named
    page.locator("circle[data-spot='spot:1']").click(force=True)
    assert page.input_value("#place") == "spot:1"
    assert page.text_content("#read-name").startswith("Hotspot 1: ")
    assert page.locator(".hs.on").count() == 1
    assert said(opened(address="#place=spot%3A1")) == said(page)
    page.select_option("#place", "floor")
    assert page.locator(".hs.on").count() == 0


@pytest.mark.parametrize("width", [320, 390, 1280])
def test_no_name_lies_under_a_number(opened: Open, width: int) -> None:
    page = opened(viewport={"width": width, "height": 800})
    boxes = page.evaluate(
        "[...document.querySelectorAll('.hm,.pt:not(.out-of-way)')].map(e => { const r = e.getBoundingClientRect();"
        "return [r.x, r.y + r.height / 5, r.right, r.y + r.height * 0.8, e.getAttribute('class')]; })"
    )
    assert len([b for b in boxes if b[4] == "hm"]) > 0
    names = [b for b in boxes if b[4] != "hm"]
    assert names
    for a in names:
        for b in boxes:
            assert a is b or a[0] >= b[2] or b[0] >= a[2] or a[1] >= b[3] or b[1] >= a[3], (a, b)


def test_dragging_and_the_wheel_move_draw_and_zoom(opened: Open) -> None:
    page = opened(viewport={"width": 1280, "height": 900})
    box = page.locator("#map").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.wheel(0, -400)
    page.wait_for_function("document.querySelector('#plan').viewBox.baseVal.width < 2475")
    zoomed = view(page)
    assert zoomed[2] < 2475
    page.mouse.down()
    page.mouse.move(x + 120, y + 10, steps=4)
    page.mouse.up()
    assert view(page)[0] < zoomed[0]
    page.click("#zr")
    page.click("#draw")
    page.mouse.move(box["x"] + 60, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 300, box["y"] + 200, steps=5)
    page.mouse.up()
    rect = [int(v) for v in address(page)["rect"].split(",")]
    assert rect[2] - rect[0] > 4
    assert page.text_content("#read-name") == "Rectangle"


def test_a_finger_moves_the_map_and_taps_buttons(opened: Open) -> None:
    page = opened(viewport={"width": 390, "height": 800}, has_touch=True, is_mobile=True)
    page.tap("#zi")
    zoomed = view(page)
    assert zoomed[2] < 2475
    box = page.locator("#map").bounding_box()
    page.touchscreen.tap(box["x"] + 20, box["y"] + box["height"] / 2)
    assert view(page)[0] < zoomed[0]
    page.tap("[data-day='0']")
    assert address(page)["days"] == "0111111"


def test_the_sentence_speaks_of_the_selection(opened: Open) -> None:
    page = opened()
    assert page.get_attribute("#out", "aria-live") == "polite"
    assert re.fullmatch(
        r"Week 46: \d+ per open hour \(likely between \d+ and \d+\), \d+% of time too close\. "
        r"13 hours recorded in this selection\.",
        said(page),
    )
    page.check("[value=difference]")
    # two weeks have no history, so a fall of a seventh is not clear
    found = r"Week 45: \d+ per open hour\. Week 46: \d+\. No clear change, \d+% fewer \(likely between"
    assert re.match(found, said(page))
    page.click("[data-pick='0000011']")
    assert "Too little data to compare: a change needs at least 5 pairs of days" in said(page)
    page.check("[value=week]")
    assert "No interval: an interval needs at least 5 recorded days, has 2." in said(page)
    page.click("[data-day='6']")
    assert "2 hours recorded in this selection. Few hours: treat as rough." in said(page)


def test_a_selection_with_few_violations_is_not_counted_out(opened: Open) -> None:
    page = opened("masked", address="#place=rect&rect=14,8,16,10")
    assert "fewer than 5 violations were counted" in said(page)
    assert page.get_attribute("#now-violationRate", "data-rate") == ""
    nobody = opened("masked", address="#place=rect&rect=16,1,18,3")
    assert "no camera counted anybody there" in said(nobody)


def test_the_address_brings_the_same_view_back(opened: Open, pages: dict[str, Path]) -> None:
    page = opened()
    page.select_option("#mapkind", "burden")
    page.select_option("#place", "area:queue")
    page.click("[data-pick='1111100']")
    page.select_option("#from", "10")
    page.check("[value=split]")
    page.click("#zi")
    again = opened(address="#" + written_address(page).partition("#")[2])
    assert said(again) == said(page)
    assert view(again) == pytest.approx(view(page), abs=1)
    for each in ("#mapkind", "#place", "#from"):
        assert again.input_value(each) == page.input_value(each)
    assert again.evaluate("document.body.dataset.show") == "split"
    page.click("[data-pick='1111111']")
    page.check("[value=week]")
    page.select_option("#mapkind", "violations")
    page.select_option("#place", "floor")
    page.select_option("#from", "9")
    page.click("#zr")
    assert written_address(page) == pages["exact"].as_uri()


@pytest.mark.parametrize(
    "hostile",
    [
        "map=__proto__&show=constructor&place=toString",
        "place=<img src=x onerror=window.bad=1>&map='><script>",
        "days=2222222&from=99&to=-1&cut=1e9&view=NaN,Infinity,0",
        "rect=999999,-999999,3,3&place=rect&view=-99999,99999,1",
        "rect=1,1,1,1&place=rect&view=0,0,0",
        "place=%E0%A4%A&show=%00&rect=1,2",
        "&&&===&show&" + "a" * 100_000,
    ],
)
def test_a_hostile_address_does_no_harm(opened: Open, hostile: str) -> None:
    page = opened(address="#" + hostile)
    assert page.errors == []
    assert page.evaluate("window.bad") is None
    assert said(page) != ""
    assert all(np.isfinite(view(page)))
    assert "NaN" not in page.inner_text("main")


def test_the_picture_is_the_map_and_the_link_the_address(opened: Open) -> None:
    page = opened(address="#show=difference", viewport={"width": 1280, "height": 900})
    with page.expect_download() as waiting:
        page.click("#png")
    assert waiting.value.suggested_filename == "shop-ground-2026-W46-difference.png"
    picture = cv2.imdecode(np.frombuffer(Path(waiting.value.path()).read_bytes(), dtype=np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    assert picture.shape[1] == 2400
    blue = (picture == np.array([0x9F, 0x6F, 0x1F])).all(axis=2)  # "fewer", as on the page
    assert blue.sum() > 1000
    page.click("#link")
    page.wait_for_function("document.getElementById('said').textContent.length > 0")
    assert page.errors == []


RECORD = """() => {
  window.texts = [];
  const write = CanvasRenderingContext2D.prototype.fillText;
  CanvasRenderingContext2D.prototype.fillText = function (text, ...at) {
    window.texts.push(text);
    return write.call(this, text, ...at);
  };
}"""


@pytest.mark.parametrize(
    ("address", "shown"),
    [
        ("", "Violations · Week 46"),
        (
            "#show=difference&days=0000011&from=10&to=11",
            "Violations · Week 46, Week 45 · Difference · Saturday, Sunday · 10:00–11:00",
        ),
    ],
)
def test_a_picture_says_what_it_shows(opened: Open, address: str, shown: str) -> None:
    """Its title alone is the same for all weeks, days and changes."""
    page = opened(address=address)
    page.evaluate(RECORD)
    with page.expect_download():
        page.click("#png")
    assert page.evaluate("window.texts[1]") == shown


def test_without_script_the_report_s_map_and_figures_are_there(opened: Open) -> None:
    page = opened(java_script_enabled=False, color_scheme="light")
    assert page.is_visible("text=open this page in a browser that runs its script")
    assert not page.is_visible("#draw")
    assert page.is_visible("#figures")
    assert "likely between" in page.text_content("#figures")
    shown = page.locator("#plan").screenshot()
    picture = cv2.imdecode(np.frombuffer(shown, dtype=np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    assert (picture == np.array([0x44, 0x44, 0x93])).all(axis=2).sum() > 50  # the strongest band


def test_it_prints_on_paper(opened: Open) -> None:
    page = opened(color_scheme="dark")
    pdf = page.pdf(prefer_css_page_size=True, print_background=True, tagged=True)
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 3
    page.emulate_media(media="print", color_scheme="dark")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert not page.is_visible("#draw")
    assert page.is_visible("#out")


def test_a_floor_without_a_map_has_its_rates(tab: Open, exact: PlannerData, tmp_path: Path) -> None:
    assert exact.before is not None
    bare = replace(exact, shown=None, walkable=None, seen=None, changes=(), why_no_map=Reason("nobody.seen"),
                   week=replace(exact.week, cells=None),
                   before=replace(exact.before, cells=None))  # fmt: skip
    path = tmp_path / "bare.html"
    path.write_text(render_planner(bare), encoding="utf-8")
    page = tab(path.as_uri() + "#place=spot%3A1")
    page.wait_for_function("document.body.dataset.first")
    assert page.is_visible("text=This floor has no map: nobody was seen.")
    assert said(page).startswith("Week 46: ")
    page.select_option("#place", "area:door")
    page.check("[value=difference]")
    page.click("[data-pick='1111100']")
    assert "Clear fall" in said(page)
    assert page.errors == []


def test_data_that_cannot_be_read_say_so(tab: Open, pages: dict[str, Path], tmp_path: Path) -> None:
    text = pages["masked"].read_text(encoding="utf-8")
    broken = re.sub(r'(id="data">)[^<]*', lambda m: m[1] + base64.b64encode(b"not gzip").decode(), text)
    path = tmp_path / "broken.html"
    path.write_text(broken, encoding="utf-8")
    page = tab(path.as_uri())
    page.wait_for_function("document.getElementById('said').textContent.length > 0")
    assert "cannot open the data of this page" in page.text_content("#said")
    assert page.is_visible("#figures")
    assert not page.is_visible("#draw")


def test_an_area_is_chosen_on_the_map_by_pointer_and_by_key(opened: Open) -> None:
    page = opened(viewport={"width": 1280, "height": 900})
    page.locator("path[data-area='area:door']").click()
    assert page.input_value("#place") == "area:door"
    assert page.text_content("#side-name") == "Door Shop" or "Door" in page.text_content("#side-name")
    for kind in ("violationRate", "close", "encounterRate"):
        shown = page.text_content(f"#side-{kind}")
        assert shown == page.locator(f"#now-{kind} b").text_content()
        assert re.search(r"\d", shown)
    assert page.locator(".ar.on").count() == 1
    page.focus("#map")
    page.keyboard.press("A")
    assert page.input_value("#place") != "area:door"
    page.keyboard.press("Shift+A")
    assert page.input_value("#place") == "area:door"


def test_dragging_selects_no_text(opened: Open) -> None:
    page = opened(viewport={"width": 1280, "height": 900})
    box = page.locator("#map").bounding_box()
    page.click("#zi")
    page.mouse.move(box["x"] + 20, box["y"] + 20)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] - 20, box["y"] + box["height"] - 20, steps=6)
    page.mouse.up()
    assert page.evaluate("getSelection().toString()") == ""
    assert page.evaluate("getComputedStyle(document.querySelector('#plan text')).userSelect") == "none"


def test_fixtures_have_their_names_where_there_is_room(opened: Open) -> None:
    page = opened(viewport={"width": 1280, "height": 900})
    shelf = page.locator("text.fn")
    assert shelf.text_content() == "Shelf"
    assert page.evaluate("getComputedStyle(document.querySelector('text.fn')).visibility") == "visible"
    phone = opened(viewport={"width": 320, "height": 700})
    boxes = phone.evaluate(
        "[...document.querySelectorAll('text.fn:not(.out-of-way)')].map(e => e.getBBox().width <= +e.dataset.along)"
    )
    assert all(boxes)


def test_no_day_chosen_is_said_in_words(opened: Open) -> None:
    page = opened(address="#days=0000000")
    assert said(page) == "No day is chosen. Choose at least one day."
    assert page.locator("#now-violationRate small").text_content() == "no day is chosen"
    assert "no open hour was recorded" not in page.inner_text("main")


@pytest.fixture
def viewed(tab: Open, exact: PlannerData, tmp_path: Path) -> Any:
    """The page of a floor whose first camera sees its left half and whose second, down on a Wednesday, the right."""
    path = tmp_path / "viewed.html"
    assert exact.shown is not None
    grid = cell_counts.grid_of(exact.shown.extent)
    assert grid is not None
    seen = np.zeros((2, grid.n_y * 4, grid.n_x * 4), dtype=np.bool_)
    seen[0, :, : grid.n_x * 2], seen[1, :, grid.n_x * 2 :] = True, True
    path.write_text(render_planner(replace(exact, seen=seen)), encoding="utf-8")
    page = tab(path.as_uri())
    page.wait_for_function("document.body.dataset.first")
    return page


def test_floor_that_no_camera_recorded_in_the_chosen_time_is_hatched(viewed: Any, exact: PlannerData) -> None:
    def hatched() -> float:
        return float(viewed.evaluate("(b => b.width * b.height)(document.querySelector('#wb .nv').getBBox())"))

    assert exact.shown is not None
    x0, y0, x1, y1 = exact.shown.extent
    whole = (x1 - x0) * (y1 - y0) * 100**2
    assert hatched() == 0
    shipped = "document.body.classList.contains('views')"
    assert not viewed.evaluate(shipped), "the report's hatching is there until a map is drawn anew"
    assert viewed.is_visible(".k-off")
    viewed.click("[data-pick='1111100']")
    for day in (0, 1, 3, 4):
        viewed.click(f"[data-day='{day}']")
    assert viewed.evaluate(shipped)
    assert 0.4 * whole < hatched() < 0.6 * whole
    viewed.click("[data-day='2']")
    assert hatched() > 0.9 * whole


def test_too_little_to_tell_is_dotted_and_what_may_be_chance_is_muted(opened: Open) -> None:
    page = opened(address="#map=risk&days=1100000")
    assert page.evaluate("document.querySelector('#wb .dt').getBBox().width") > 0
    assert page.is_visible(".k-few")
    assert not page.is_visible(".k-sure")
    page = opened(address="#map=excess")
    assert page.is_visible(".k-sure")
    assert page.evaluate("getComputedStyle(document.querySelector('#gb .m2')).fillOpacity") == "0.3"
    assert page.evaluate("getComputedStyle(document.querySelector('#gs .m2')).fillOpacity") == "1"
    assert page.get_attribute("#gs", "clip-path") == "url(#sure)"
    assert page.locator("#sure path").count() == page.locator(".hs").count()
