"""The desk in a real browser: its jobs by keyboard alone, names for screen readers, room for fingers, never too wide.

The table of docs/service.md has the numbers of `PRESSES`.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra serve is not installed")
pytest.importorskip("httpx", reason="the extra test is not installed")

from service.desk_site import DESK_TOKEN, desk_app, desk_site
from service.keyboard_jobs import do_jobs

from vsd_analytics.cli import cli
from vsd_analytics.cli.exit_codes import run
from vsd_analytics.config.change_log import read_answers, read_log
from vsd_analytics.config.project import load_site
from vsd_analytics.service.desk_places import WIDTHS_PX
from vsd_analytics.service.http_server import HttpServer

pytestmark = pytest.mark.browser
Open = Callable[..., Any]
HOSTILE = "x" * 120 + ' <script>document.title = "taken"</script>'
FINGER_PX = 44
PAGE = "/desk/weeks/2026-W46/floors/ground/page"
PRESSES = {
    "open the weekly page": 1,
    "answer the question, from the weekly page": 2,
    "log a change": 1,
    "take it back": 1,
    "set a target": 1,
    "change the opening hours": 2,
    "mark an area": 2,
    "compare sites": 1,
    "see it now": 1,
    "open the planner": 1,
    "share a view, from the planner": 1,
}
"""Buttons and links that a job takes at the desk, beside the fields to fill in."""


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[tuple[str, Path]]:
    """Return the address of a small site's desk, and its folder."""
    root = tmp_path / "shop"
    desk_site(root)
    server = HttpServer(desk_app(root), host="127.0.0.1", port=0)
    server.start()
    yield f"http://127.0.0.1:{server.port}", root
    server.close()


@pytest.fixture
def demo_desk(demo_project: Path, tmp_path: Path) -> Iterator[tuple[str, Path]]:
    root = tmp_path / "vsd-demo"
    shutil.copytree(demo_project, root)
    assert run(cli, ["-C", str(root), "site", "build", "--make"]) in (0, 1)
    server = HttpServer(desk_app(root), host="127.0.0.1", port=0)
    server.start()
    yield f"http://127.0.0.1:{server.port}", root
    server.close()


def sign_in(page: Any, writer: str = "Anna") -> None:
    page.get_by_label("Your name").fill(writer)
    page.get_by_label("Token of the desk").fill(DESK_TOKEN)
    page.keyboard.press("Enter")
    page.wait_for_selector("h1:has-text('What was decided')")


def test_the_jobs_are_done_by_keyboard_in_as_many_presses_as_the_docs_say(
    browser: Any, demo_desk: tuple[str, Path]
) -> None:
    address, root = demo_desk
    context = browser.new_context(permissions=["clipboard-read", "clipboard-write"])
    page = context.new_page()
    seen: list[str] = []
    errors: list[str] = []
    page.on("request", lambda request: seen.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    taken = do_jobs(page, address)
    assert {job: one.presses for job, one in taken.items() if one.presses} == PRESSES
    page.goto(f"{address}{PAGE}")
    assert "of 120" in page.locator(".kpis").text_content() or "under 120" in page.locator(".kpis").text_content()
    assert "Not possible by Anna." in page.locator(".ask").text_content()
    context.close()
    site = load_site(root)
    assert [e.text for e in read_log(site) if e.by] == []
    assert [(a.kind, a.by) for a in read_answers(site)] == [("not-possible", "Anna")]
    assert site.floors[0].target_per_open_h == 120
    assert DESK_TOKEN not in "".join(seen)
    assert [u for u in seen if not u.startswith((address, "data:", "blob:"))] == []
    assert errors == []


def test_the_jobs_are_done_with_fingers(tab: Open, desk: tuple[str, Path]) -> None:
    address, root = desk
    page = tab(
        f"{address}/desk", has_touch=True, is_mobile=True, viewport={"width": 390, "height": 844}, bypass_csp=False
    )
    page.get_by_label("Your name").fill("Anna")
    page.get_by_label("Token of the desk").fill(DESK_TOKEN)
    page.get_by_role("button", name="Sign in").tap()

    def tapped(name: str) -> str:
        with page.expect_navigation():
            page.locator("button", has_text=name).first.tap()
        return str(page.get_by_role("status").text_content())

    page.locator(".pick:has([value=tried])").tap()
    assert tapped("Save the answer").startswith("Saved.")
    page.get_by_label("What was changed").fill("Mat moved")
    assert tapped("Log the change") == "The change is in the log."
    assert tapped(": Mat moved") == "Taken back."
    page.get_by_label("Stay below").fill("120")
    assert tapped("Save the target").startswith("The target is saved.")
    with page.expect_navigation():
        page.get_by_role("link", name="Areas and fixtures").tap()
    page.get_by_label("Name").fill("Display")
    for x, y in ((20, 20), (60, 20), (60, 90)):
        with page.expect_navigation():
            page.locator(".plan-narrow").tap(position={"x": x, "y": y})
    assert tapped("Save the place").startswith("The place is saved.")
    site = load_site(root)
    assert [(a.kind, a.by) for a in read_answers(site)] == [("tried", "Anna")]
    assert [a.name for a in site.areas] == ["Door & <i>mat</i>", "Display"]
    assert site.floors[0].target_per_open_h == 120


@pytest.mark.parametrize("size", [1280, 390])
def test_the_plan_is_as_wide_as_its_clicks_are_read(tab: Open, desk: tuple[str, Path], size: int) -> None:
    page = tab(f"{desk[0]}/desk", viewport={"width": size, "height": 900}, bypass_csp=False)
    sign_in(page)
    page.goto(f"{desk[0]}/desk/places/ground")
    shown = [name for name in WIDTHS_PX if page.locator(f".plan-{name}").is_visible()]
    assert shown == ["wide" if size == 1280 else "narrow"]
    assert page.locator(f".plan-{shown[0]}").bounding_box()["width"] == WIDTHS_PX[shown[0]]


@pytest.mark.parametrize("address", ["/desk", "/desk/places/ground"])
def test_paper_has_what_was_written_and_no_form(tab: Open, desk: tuple[str, Path], address: str) -> None:
    page = tab(f"{desk[0]}/desk", bypass_csp=False)
    sign_in(page)
    page.goto(f"{desk[0]}{address}")
    page.emulate_media(media="print")
    fields = page.locator("input:not([type=image]), select, button, summary")
    assert [f for f in fields.all() if f.is_visible()] == []
    assert page.locator("h1").is_visible()


def test_the_table_of_the_docs_has_these_presses() -> None:
    text = (Path(__file__).resolve().parents[2] / "docs" / "service.md").read_text(encoding="utf-8")
    for job, n in PRESSES.items():
        [line] = [line for line in text.splitlines() if line.startswith(f"| {job} |")]
        assert line.split("|")[3].strip() == str(n), job


def test_the_desk_needs_no_script(tab: Open, desk: tuple[str, Path]) -> None:
    address, root = desk
    page = tab(f"{address}/desk", java_script_enabled=False, bypass_csp=False)
    page.get_by_label("Your name").fill("Anna")
    page.get_by_label("Token of the desk").fill(DESK_TOKEN)
    page.get_by_role("button", name="Sign in").click()
    page.get_by_label("What was changed").fill("Mat moved")
    page.get_by_role("button", name="Log the change").click()
    assert page.get_by_role("status").text_content() == "The change is in the log."
    assert [e.text for e in read_log(load_site(root))] == ["Mat moved"]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_page_is_accessible_fits_and_has_room_for_fingers(
    tab: Open, axe: Open, desk: tuple[str, Path], scheme: str
) -> None:
    address, _ = desk
    page = tab(f"{address}/desk", color_scheme=scheme, bypass_csp=True)
    check(page, axe, "sign in")
    sign_in(page, "<b>" + "y" * 90)
    check(page, axe, "open")
    page.locator("form[action='/desk/log'] [name=text]").fill(HOSTILE)
    page.locator("form[action='/desk/log'] button").click()
    page.wait_for_selector("[role=status]")
    assert page.title() == "Shop <b>: site desk"
    page.locator("form[action='/desk/log'] [name=text]").fill("again")
    page.evaluate("document.querySelector(\"form[action='/desk/log'] [name=at]\").type = 'text'")
    page.locator("form[action='/desk/log'] [name=at]").fill("never")
    page.locator("form[action='/desk/log'] button").click()
    page.wait_for_selector("[role=alert]")
    check(page, axe, "mistake")
    page.locator("[value=tried]").check()
    page.locator("form[action='/desk/answer'] button").click()
    page.wait_for_selector("[role=status]")
    page.locator(".undo button").last.click()
    page.wait_for_selector("[role=status]")
    check(page, axe, "written")
    page.goto(f"{address}/desk/places/ground")
    check(page, axe, "places")
    page.locator("form[action='/desk/mark'] [name=name]").fill(HOSTILE[:80])
    page.locator("form[action='/desk/mark'] [name=corners]").fill("0,0 1,1 1,0 0,1")
    page.get_by_role("button", name="Save the place").click()
    page.wait_for_selector("[role=alert]")
    check(page, axe, "corners")
    page.goto(f"{address}/desk/weeks/last/floors/attic/page")
    check(page, axe, "problem")


def check(page: Any, axe: Open, what: str) -> None:
    for width in (1280, 720, 390, 320):
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0, what
        if width in (1280, 320):
            assert axe(page) == [], (what, width)
    small = page.evaluate(
        "least => [...document.querySelectorAll('button, select, input:not([type=hidden], [type=radio]), .pick')]"
        ".filter(e => e.checkVisibility() && e.getBoundingClientRect().height < least).map(e => e.outerHTML)",
        FINGER_PX,
    )
    assert small == [], what
