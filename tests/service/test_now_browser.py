"""The live page in a real browser: at every size, renewed, and still there when the server is not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("starlette", reason="the extra serve is not installed")
pytest.importorskip("httpx", reason="the extra test is not installed")

from service.desk_site import READ_TOKEN, desk_app, desk_site
from service.live_states import AT, STATES, site_of_two_floors

from vsd_analytics.service.http_server import HttpServer
from vsd_analytics.service.now_page import render_now
from vsd_analytics.wording.languages import speaking

pytestmark = pytest.mark.browser
Open = Callable[..., Any]
PASSWORD = {"username": "anybody", "password": READ_TOKEN}


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_every_state_is_accessible_and_fits_from_a_phone_to_a_wall(
    tab: Open, axe: Open, tmp_path: Path, scheme: str
) -> None:
    path = tmp_path / "now.html"
    for language in ("en", "it"):
        for words, state in STATES.items():
            with speaking(language):
                path.write_text(render_now(state, site_of_two_floors(tmp_path), floor_id="ground", at=AT))
            page = tab(path.as_uri(), color_scheme=scheme, bypass_csp=True)
            for width, height in ((1920, 1080), (1280, 720), (390, 844), (320, 640)):
                page.set_viewport_size({"width": width, "height": height})
                over = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
                assert over == 0, (words, width)
                if language == "en" and width in (1920, 320):
                    assert axe(page) == [], (words, width)
            assert page.title() != "taken"


def test_the_page_is_renewed_and_stays_with_its_age_when_the_server_is_away(browser: Any, tmp_path: Path) -> None:
    """The browser asks for a name and the token, as people type them."""
    desk_site(tmp_path / "shop")
    server = HttpServer(desk_app(tmp_path / "shop"), host="127.0.0.1", port=0)
    server.start()
    address = f"http://127.0.0.1:{server.port}/now"
    context = browser.new_context(http_credentials=PASSWORD)
    page = context.new_page()
    page.clock.install()
    page.goto(address)
    page.evaluate("document.getElementById('hd').textContent = 'an old page'")
    with page.expect_response(address):
        page.clock.run_for(60_000)
    page.wait_for_selector("h1:has-text('Nothing is stored yet')")
    assert page.locator("#away").is_hidden()
    server.close()
    for minutes in range(1, 4):
        page.clock.run_for(60_000)
        page.wait_for_function("n => document.getElementById('away').textContent.includes(` ${n} `)", arg=minutes)
    assert page.locator("#away").is_visible()
    assert page.locator("#away").text_content() == "No connection: this page is 3 minutes old."
    assert page.locator("h1").text_content() == "Nothing is stored yet"
    context.close()


def test_without_script_the_browser_loads_the_page_again(tab: Open, tmp_path: Path) -> None:
    path = tmp_path / "now.html"
    path.write_text(render_now(None, site_of_two_floors(tmp_path), floor_id="ground", at=AT))
    page = tab(path.as_uri(), java_script_enabled=False)
    assert page.locator("head meta[http-equiv=refresh]").get_attribute("content") == "60"
    assert page.locator("h1").text_content() == "Nothing is stored yet"
