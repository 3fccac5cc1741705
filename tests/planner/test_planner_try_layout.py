"""The planner's "Try a layout": what is dragged or typed is what is saved, as edit and drawings; undo; narrow ways."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
import shapely

from vsd_analytics.config.layout_edits import read_edits
from vsd_analytics.figures.week.floor_maps import map_fixtures
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData
from vsd_analytics.resources import shipped
from vsd_analytics.site.layout import FixtureEdit
from vsd_analytics.site.model import Fixture, Point, Site

pytestmark = pytest.mark.browser
Open = Callable[..., Any]
HOSTILE = 'Shelf "1" </script> \\ ]] {x}'
FIXTURES = (
    Fixture("shelf", HOSTILE, "ground", ((2.0, 2.0), (4.0, 2.0), (4.0, 3.0), (2.0, 3.0)), is_movable=True),
    Fixture("till", "Till", "ground", ((6.0, 2.0), (7.0, 2.0), (7.0, 3.0), (6.0, 3.0)), kind="till"),
)
Corners = tuple[Point, ...]


@pytest.fixture(scope="module")
def site(shop: Site) -> Site:
    return replace(shop, fixtures=FIXTURES)


@pytest.fixture(scope="module")
def planner(exact: PlannerData, tmp_path_factory: pytest.TempPathFactory) -> str:
    assert exact.shown is not None
    shown = replace(exact.shown, fixtures=map_fixtures(FIXTURES))
    file = tmp_path_factory.mktemp("try") / "planner.html"
    file.write_text(render_planner(replace(exact, shown=shown)), encoding="utf-8")
    return file.as_uri()


@pytest.fixture
def page(tab: Open, planner: str) -> Any:
    opened = tab(planner)
    opened.wait_for_function("document.body.dataset.ready")
    opened.click("details.try summary")
    yield opened
    assert opened.errors == []


def edits(page: Any, site: Site, folder: Path) -> dict[str, FixtureEdit]:
    """Save the edit, and read it as vsd whatif does."""
    with page.expect_download() as waiting:
        page.click("#try-save")
    file = folder / waiting.value.suggested_filename
    waiting.value.save_as(file)
    read = read_edits(file, site, last_day=date(2026, 11, 15))
    return {e.fixture_id: e for e in read.edits if isinstance(e, FixtureEdit)}


def test_a_fixture_is_dragged_undone_and_moved_by_keys(page: Any, site: Site, tmp_path: Path) -> None:
    page.select_option("#try-which", "shelf")
    page.click("#try-move")
    box = page.locator("#plan").bounding_box()
    m_px = box["width"] / page.evaluate("+document.getElementById('plan').getAttribute('viewBox').split(' ')[2] / 100")
    at = box["x"] + 9 * m_px, box["y"] + 3 * m_px
    page.mouse.move(*at)
    page.mouse.down()
    page.mouse.move(at[0] + m_px, at[1])
    page.mouse.move(at[0] + 2 * m_px, at[1] - 3 * m_px)  # the screen's y points down
    page.mouse.up()
    moved = edits(page, site, tmp_path)["shelf"].new_polygon
    assert moved is not None
    assert np.allclose(moved, [(x + 2, y + 3) for x, y in FIXTURES[0].polygon], atol=0.051)
    page.focus("#map")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("Shift+ArrowUp")
    assert np.allclose(edits(page, site, tmp_path)["shelf"].new_polygon or (), [(x - 0.1, y + 1) for x, y in moved])
    page.focus("#map")
    for _ in range(2):
        page.keyboard.press("Control+z")
    assert edits(page, site, tmp_path)["shelf"].new_polygon == moved
    page.focus("#map")
    page.keyboard.press("Control+z")
    assert page.locator("#try-list").text_content() == "", "the whole drag was one step"
    assert page.locator("#try-save").is_disabled()
    page.keyboard.press("Control+Shift+z")
    assert edits(page, site, tmp_path)["shelf"].new_polygon == moved
    page.focus("#map")
    page.keyboard.press("Escape")
    assert page.locator("#try-move").get_attribute("aria-pressed") == "false"


def test_all_of_it_works_by_keyboard_alone(page: Any, site: Site, tmp_path: Path) -> None:
    page.locator("#try-which").focus()
    page.keyboard.press("End")
    page.keyboard.type('Promo "x"')
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")
    for text in ("3.5", "4.2", "2", "0.5"):
        page.keyboard.type(text)
        page.keyboard.press("Tab")
    page.keyboard.press("Tab")
    page.keyboard.press("Enter")  # turned by 90 degrees
    new = edits(page, site, tmp_path)["promo-x"]
    assert (new.name, new.old_polygon) == ('Promo "x"', None)
    assert np.allclose(sorted(new.new_polygon or ()), [(4.25, 3.45), (4.25, 5.45), (4.75, 3.45), (4.75, 5.45)])
    page.select_option("#try-which", "till")
    page.click("#try-away")
    assert edits(page, site, tmp_path)["till"].new_polygon is None
    page.click("#try-over")
    assert page.locator("#try-list").text_content() == ""


def test_both_layouts_are_in_the_drawings(page: Any, tmp_path: Path) -> None:
    page.select_option("#try-which", "shelf")
    page.fill("#try-x", "8")
    page.keyboard.press("Tab")
    saved = {}
    for kind in ("svg", "dxf"):
        with page.expect_download() as waiting:
            page.click(f"#save-{kind}")
        saved[kind] = tmp_path / waiting.value.suggested_filename
        waiting.value.save_as(saved[kind])
    layers = {
        name: [
            shapely.Polygon([(v.dxf.location.x, v.dxf.location.y) for v in line.vertices])
            for line in ezdxf.readfile(saved["dxf"]).modelspace().query(f'POLYLINE[layer=="{name}"]')
        ]
        for name in ("FIXTURES", "LAYOUT_BEFORE", "LAYOUT_TRIED")
    }
    assert len(layers["FIXTURES"]) == 2
    assert layers["LAYOUT_BEFORE"][0].equals(shapely.box(2, 2, 4, 3))
    assert layers["LAYOUT_TRIED"][0].equals(shapely.box(8, 2, 10, 3))
    text = saved["svg"].read_text(encoding="utf-8")
    assert re.search(r'id="layout-tried"', text)
    assert re.search(r'id="layout-before"', text)


@pytest.mark.parametrize(
    ("left", "words"),
    [
        ("3", "1.00 m to Till, under 1.2 m."),
        ("2.6", "1.40 m to Till, under 1.5 m."),
        ("2.4", "Every way beside it has 1.5 m or more."),
        ("4.5", "It overlaps Till."),
    ],
)
def test_narrow_ways_and_overlaps_are_said(page: Any, left: str, words: str) -> None:
    page.select_option("#try-which", "shelf")
    page.fill("#try-x", left)
    page.keyboard.press("Tab")
    assert words in page.locator("#try-list").text_content()


def test_the_gap_is_the_distance_of_two_polygons(tab: Open) -> None:
    random = np.random.default_rng(7)
    shapes = [shapely.convex_hull(shapely.MultiPoint(random.uniform(0, 9, (n, 2)))) for n in random.integers(3, 7, 120)]
    shapes[:2] = shapely.box(0, 0, 9, 9), shapely.box(4, 4, 5, 5)  # one inside the other
    rings = [[list(p) for p in shape.exterior.coords[:-1]] for shape in shapes]
    script = (shipped("reports") / "static" / "planner_layout.js").read_text(encoding="utf-8")
    body = script[script.index("function gapBetween") : script.index("/* Ways beside")]
    ask = f"pairs => {{ {body} return pairs.map(([a, b]) => gapBetween(a, b).length); }}"
    lengths = tab("about:blank").evaluate(ask, list(zip(rings[::2], rings[1::2], strict=True)))
    wanted = [one.distance(two) for one, two in zip(shapes[::2], shapes[1::2], strict=True)]
    assert lengths == pytest.approx(wanted, abs=1e-9)
    assert 0 < sum(w > 0 for w in wanted) < len(wanted)


def test_the_open_panel_is_accessible_and_fits_a_phone(page: Any, axe: Open) -> None:
    page.select_option("#try-which", "shelf")
    page.fill("#try-x", "3")
    page.keyboard.press("Tab")
    for width in (1280, 390, 320):
        page.set_viewport_size({"width": width, "height": 844})
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
        assert axe(page) == []
