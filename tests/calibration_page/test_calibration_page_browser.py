"""The page of `vsd calibrate --draw` in a real browser: its homography, its circles, its hands, its lines."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import cv2
import numpy as np
import pytest
from site_text import site_text

from vsd_analytics.calibration_page.page import render_calibration_page
from vsd_analytics.config.project import load_site
from vsd_analytics.errors import CalibrationError
from vsd_analytics.geometry.homography import fit_homography, to_floor, to_image

pytestmark = pytest.mark.browser
SIZE = (1280, 720)
CAMERA = np.array([[0.004, 0.0, -2.56], [0.0, -0.001, 2.2], [0.0, 0.0014, -0.2]])  # looks along +y, horizon at 143 px
FLOOR = ((-3.0, 2.2), (2.5, 2.4), (-4.0, 5.0), (3.5, 5.5), (0.4, 3.6), (-1.0, 7.0), (2.0, 7.5), (0.0, 2.0))
Open = Callable[..., Any]


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("draw")
    picture = np.random.default_rng(0).integers(60, 200, (72, 128, 3)).astype(np.uint8)
    cv2.imwrite(str(folder / "scene.png"), cv2.resize(picture, SIZE, interpolation=cv2.INTER_CUBIC))
    known = '\n[[area]]\nid = "door"\nname = "Door"\npolygon = [[-6, 1], [6, 1], [6, 9], [-6, 9]]\n'
    known += '\n[[fixture]]\nid = "fixture-1"\nname = "Shelf"\npolygon = [[3, 3], [5, 3], [5, 4], [3, 4]]\n'
    (folder / "vsd.toml").write_text(site_text(more='picture = "scene.png"\n') + known)
    site = load_site(folder)
    (folder / "draw.html").write_text(render_calibration_page(site, site.cameras[0]), encoding="utf-8")
    return folder / "draw.html"


@pytest.fixture
def opened(tab: Open, page_file: Path) -> Open:
    def page(**options: Any) -> Any:
        shown = tab(page_file.as_uri(), **{"viewport": {"width": 1400, "height": 1000}, **options})
        if options.get("java_script_enabled", True):
            shown.wait_for_function("document.body.dataset.ready")
        return shown

    return page


def pairs(n: int, *, noise_m: float = 0.0) -> np.ndarray:
    xy = np.array(FLOOR[:n])
    uv = to_image(CAMERA, xy, picture_px=SIZE)
    return np.round(np.column_stack([uv, xy + np.random.default_rng(3).normal(0, noise_m, xy.shape)]), 3)


def give(page: Any, points: Any) -> None:
    page.fill("#csv", "u,v,x,y\n" + "\n".join(",".join(str(n) for n in row) for row in np.asarray(points).tolist()))
    page.dispatch_event("#csv", "change")
    page.evaluate("document.activeElement.blur()")


def matrix(page: Any) -> np.ndarray:
    return np.array([[float(n) for n in line.split()] for line in page.text_content("#matrix").split("\n")])


def at(page: Any, pane: str, place: Any) -> tuple[float, float]:
    """Return where a pixel of the picture, or a spot of the floor, is on the screen."""
    page.locator(f"#{pane}").scroll_into_view_if_needed()
    box = page.locator(f"#{pane}-svg").bounding_box()
    if pane == "picture":
        share = np.asarray(place) / SIZE
    else:
        x0, y0, x1, y1 = page.evaluate("JSON.parse(document.getElementById('meta').textContent).plan.extent")
        share = np.array([(place[0] - x0) / (x1 - x0), (y1 - place[1]) / (y1 - y0)])
    return box["x"] + share[0] * box["width"], box["y"] + share[1] * box["height"]


def csv(page: Any) -> np.ndarray:
    rows = page.input_value("#csv").strip().split("\n")[1:]
    return np.array([[float(n) for n in row.split(",")] for row in rows]).reshape(-1, 4)


@pytest.mark.parametrize(("n", "noise_m"), [(4, 0.0), (5, 0.05), (8, 0.0), (8, 0.3)])
def test_the_page_s_homography_and_error_are_those_of_vsd_calibrate(opened: Open, n: int, noise_m: float) -> None:
    page, points = opened(), pairs(n, noise_m=noise_m)
    give(page, points)
    fit = fit_homography(points)
    uv = points[:, :2]
    there, mine = (to_floor(h, uv, picture_px=SIZE) for h in (fit.homography, matrix(page)))
    # OpenCV stops ten steps of Levenberg and Marquardt after its start, the page at the minimum
    np.testing.assert_allclose(mine, there, atol=0.005 if noise_m else 1e-4)
    assert np.sqrt(np.mean(np.sum((mine - points[:, 2:]) ** 2, axis=1))) <= fit.rmse_m + 1e-6
    if n > 4:
        assert f"off by {fit.rmse_m:.2f} m" in page.text_content("#result")
        assert f"point {int(fit.errors_m.argmax()) + 1}" in page.text_content("#result") or noise_m == 0
    else:
        assert "Four points always fit" in page.text_content("#result")


LINE = [(100.0 * i, 600.0 - 40 * i, i, i) for i in range(5)]


@pytest.mark.parametrize(
    ("points", "says"),
    [
        (pairs(3), "still needed: 1"),
        ([*pairs(3), pairs(3)[0]], "still needed"),
        ([(u, v, i % 3, i) for i, (u, v, _, _) in enumerate(LINE)], "one line in the picture"),
        ([(100 * (i % 3), 600 - 50 * i, x, y) for i, (_, _, x, y) in enumerate(LINE)], "one line on the floor"),
        ([(100, 600, 0, 0), (500, 600, 2, 0), (900, 600, 4, 0), (500, 300, 2, 5)], "Three of the four"),
        ([(100, 600, 0, 0), (900, 600, 4, 0), (900, 300, 0, 5), (100, 300, 4, 5)], "above the horizon"),
    ],
)
def test_points_that_vsd_calibrate_refuses_are_refused_in_words(opened: Open, points: Any, says: str) -> None:
    with pytest.raises(CalibrationError):
        fit_homography(points)
    page = opened()
    give(page, points)
    assert says in page.text_content("#result")
    assert page.text_content("#matrix") == ""
    assert page.errors == []


def test_circles_in_the_picture_are_the_distances_around_the_pointer_s_floor(opened: Open) -> None:
    page = opened()
    give(page, pairs(8))
    spot = to_image(CAMERA, [(0.4, 4.4)], picture_px=SIZE)[0]
    page.mouse.move(*at(page, "picture", spot))
    for name, radius_m in (("c0", 1.0), ("c1", 2.0)):
        d = page.get_attribute(f"#picture .circle.{name}", "d")
        ring = np.array([[float(n) for n in part.split()] for part in re.findall(r"[ML]([^MLZ]+)", d)])
        off = to_floor(CAMERA, ring, picture_px=SIZE) - to_floor(CAMERA, [spot], picture_px=SIZE)[0]
        np.testing.assert_allclose(np.hypot(*off.T), radius_m, atol=0.04)
    before = page.get_attribute("#plan .circle.c0", "d")
    page.mouse.move(*at(page, "picture", spot + np.array([80, 40])))
    assert page.get_attribute("#plan .circle.c0", "d") != before


def test_clicks_on_picture_and_plan_make_points_that_drag_and_undo_change(opened: Open) -> None:
    page = opened()
    for u, v, x, y in pairs(5):
        page.mouse.click(*at(page, "picture", (u, v)))
        assert "click the same spot on the plan" in page.text_content("#said")
        page.mouse.click(*at(page, "plan", (x, y)))
    np.testing.assert_allclose(csv(page)[:, :2], pairs(5)[:, :2], atol=2)
    np.testing.assert_allclose(csv(page)[:, 2:], pairs(5)[:, 2:], atol=0.05)
    np.testing.assert_allclose(to_floor(matrix(page), pairs(5)[:, :2], picture_px=SIZE), pairs(5)[:, 2:], atol=0.1)
    page.mouse.move(*at(page, "plan", pairs(5)[4, 2:]))
    page.mouse.down()
    page.mouse.move(*at(page, "plan", pairs(5)[4, 2:] + np.array([0.5, 0])), steps=4)
    page.mouse.move(*at(page, "plan", pairs(5)[4, 2:] + np.array([1, 0])), steps=4)
    page.mouse.up()
    assert csv(page)[4, 2] == pytest.approx(pairs(5)[4, 2] + 1, abs=0.1)
    page.click("#undo")
    assert csv(page)[4, 2] == pytest.approx(pairs(5)[4, 2], abs=0.1)
    page.click("#redo")
    assert csv(page)[4, 2] == pytest.approx(pairs(5)[4, 2] + 1, abs=0.1)
    for _ in range(12):
        page.keyboard.press("Control+z")
    assert len(csv(page)) == 0
    assert page.is_disabled("#undo")


def test_a_keyboard_alone_places_a_point_corrects_it_and_draws_an_area(opened: Open) -> None:
    page = opened()
    keys = page.keyboard

    def go(name: str) -> None:
        for _ in range(60):
            keys.press("Tab")
            if page.evaluate("document.activeElement.id || document.activeElement.dataset.key") == name:
                outline = page.evaluate("getComputedStyle(document.activeElement).outlineStyle")
                assert outline == "solid" or name == "u"
                return
        raise AssertionError(name)

    go("picture")
    for key in ("ArrowRight", "ArrowDown", "Shift+ArrowLeft", "Enter"):
        keys.press(key)
    go("plan")
    keys.press("ArrowUp")
    keys.press("Enter")
    assert len(csv(page)) == 1
    go("u")
    keys.press("Control+a")
    keys.type("333.5")
    keys.press("Tab")
    assert csv(page)[0, 0] == 333.5
    page.focus("[value=points]")
    keys.press("ArrowDown")
    assert page.get_attribute("body", "data-tool") == "area"
    go("plan")
    for key in ("Enter", "ArrowRight", "ArrowRight", "Enter", "ArrowUp", "ArrowUp", "Enter", "f"):
        keys.press(key)
    assert tomllib.loads(page.input_value("#toml"))["area"][0]["id"] == "area-1"
    assert page.errors == []


def test_fingers_place_points(opened: Open) -> None:
    page = opened(viewport={"width": 390, "height": 800}, has_touch=True, is_mobile=True)
    page.touchscreen.tap(*at(page, "picture", (600, 600)))
    page.touchscreen.tap(*at(page, "plan", (1.0, 4.0)))
    assert csv(page)[0] == pytest.approx([600, 600, 1, 4], abs=4)


def test_drawn_lines_are_read_from_vsd_toml_as_they_were_drawn(opened: Open, page_file: Path, tmp_path: Path) -> None:
    page = opened()
    give(page, pairs(8))
    corners = [(-2.0, 3.0), (1.0, 3.0), (1.0, 5.0), (-2.0, 5.0)]
    for tool, pane in (("area", "plan"), ("fixture", "picture"), ("view", "plan")):
        page.check(f"[value={tool}]")
        for corner in corners:
            place = corner if pane == "plan" else to_image(CAMERA, [corner], picture_px=SIZE)[0]
            page.mouse.click(*at(page, pane, place))
        page.mouse.click(*at(page, pane, corners[0] if pane == "plan" else to_image(CAMERA, corners[:1])[0]))
    first = page.locator("#shapes li").nth(0)
    first.locator("[data-key=name]").fill('The "long" till \\ queue')
    first.locator("[data-key=name]").dispatch_event("change")
    second = page.locator("#shapes li").nth(1)
    second.locator("input[type=number]").fill("1.6")
    second.locator("input[type=number]").dispatch_event("change")
    lines = page.input_value("#toml")
    view = re.search(r"^view = .*$", lines, re.MULTILINE)
    assert view
    (tmp_path / "scene.png").write_bytes((page_file.parent / "scene.png").read_bytes())
    text = (
        (page_file.parent / "vsd.toml")
        .read_text()
        .replace('picture = "scene.png"', f'picture = "scene.png"\n{view[0]}')
    )
    (tmp_path / "vsd.toml").write_text(text + "\n" + lines.replace(view[0], ""))
    site = load_site(tmp_path)
    area = next(a for a in site.areas if a.area_id == "area-1")
    fixture = next(f for f in site.fixtures if f.fixture_id == "fixture-2")  # fixture-1 is taken
    assert area.name == 'The "long" till \\ queue'
    assert (fixture.kind, fixture.is_movable, fixture.height_m) == ("shelf", False, 1.6)
    for polygon in (area.polygon, fixture.polygon, site.cameras[0].view):
        np.testing.assert_allclose(polygon, corners, atol=0.06)
    assert unquote(page.get_attribute("#save-toml", "href")).endswith(lines)


def test_an_id_that_is_taken_or_no_id_is_marked(opened: Open) -> None:
    page = opened()
    page.check("[value=area]")
    for corner in ((0, 2), (2, 2), (2, 4)):
        page.mouse.click(*at(page, "plan", corner))
    page.click("#finish")
    field = page.locator("#shapes [data-key=id]")
    for text, is_bad in (("door", True), ("A b", True), ("queue", False)):
        field.fill(text)
        field.dispatch_event("change")
        assert field.get_attribute("aria-invalid") == str(is_bad).lower(), text


def test_a_line_that_is_no_point_changes_nothing(opened: Open) -> None:
    page = opened()
    give(page, pairs(5))
    page.fill("#csv", "u,v,x,y\n1,2,3\n")
    page.dispatch_event("#csv", "change")
    assert "Nothing was changed" in page.text_content("#said")
    assert page.locator("#points li").count() == 5


def test_zoom_makes_a_click_finer_and_the_whole_comes_back(opened: Open) -> None:
    page = opened()
    page.click("#picture-in")
    page.click("#picture-in")
    assert page.text_content("#picture-zoom") == "225%"
    page.click("#picture-all")
    assert page.get_attribute("#picture-svg", "viewBox") == "0 0 1280 720"


@pytest.mark.parametrize("width", [320, 390, 1280])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_state_is_accessible_quiet_and_fits(opened: Open, axe: Open, scheme: str, width: int) -> None:
    page = opened(color_scheme=scheme, viewport={"width": width, "height": 900}, bypass_csp=True)
    for prepare in (lambda: None, lambda: give(page, pairs(8, noise_m=0.2)), lambda: drawn(page)):
        prepare()
        assert axe(page) == []
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
    small = page.evaluate(
        "[...document.querySelectorAll('button,select,input,a.button')].filter(e => e.offsetParent)"
        ".map(e => e.getBoundingClientRect()).filter(r => r.width && Math.min(r.width, r.height) < 18).length"
    )
    assert small == 0
    assert [u for u in page.seen if not u.startswith("data:")] == [page.seen[0]]
    assert page.errors == []


def drawn(page: Any) -> None:
    for tool in ("area", "fixture", "view"):
        page.check(f"[value={tool}]")
        for corner in ((0, 2), (2, 2), (2, 4)):
            page.mouse.click(*at(page, "plan", corner))
        page.click("#finish")
    page.click("#matrix-box summary")


def test_the_policy_lets_the_page_s_own_script_through_and_no_other(opened: Open) -> None:
    page = opened()
    page.evaluate(
        "() => { const s = document.createElement('script');"
        "s.textContent = 'window.bad = 1'; document.body.append(s); }"
    )
    assert page.evaluate("window.bad") is None


def test_without_its_script_the_page_says_what_it_needs(opened: Open) -> None:
    page = opened(java_script_enabled=False)
    assert page.locator(".off").is_visible()
    assert not page.locator("#csv").is_visible()
