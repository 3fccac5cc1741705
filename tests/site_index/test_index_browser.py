"""The index in a real browser: accessible, silent on the network, never too wide, printable, its links followed."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from report import sample_weeks as weeks
from site_index import many_reports as many
from site_index.compared_sites import write_sites
from site_index.test_index_page import hostile

from vsd_analytics.site_index.collect_reports import gather, sources_of, write_index
from vsd_analytics.site_index.floor_weeks import catalogue
from vsd_analytics.site_index.page import render_index

pytestmark = pytest.mark.browser

Show = Callable[..., Any]
NAMES = ("company", "hostile", "one floor", "compared")


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    root = tmp_path_factory.mktemp("pages")
    folders = many.company(root / "projects")
    single = root / "single"
    for back, state in enumerate((weeks.settings_changed, weeks.empty, weeks.exposure_unknown, weeks.masked)):
        many.write(single, many.report(state, back=back))
    for back in range(50, 60):
        many.write(single, many.report(back=back))
    made = {}
    compared = write_sites(root / "sites", n_weeks=4)
    for name, sources in (("company", folders), ("one floor", [single]), ("compared", compared)):
        out = root / name
        made[name] = write_index(out, render_index(catalogue(gather(sources_of(sources), out).entries)))
    made["hostile"] = root / "hostile.html"
    made["hostile"].write_text(render_index(hostile(root)), encoding="utf-8")
    return made


@pytest.mark.parametrize("name", NAMES)
def test_the_page_is_quiet_fits_and_is_accessible(tab: Show, axe: Show, pages: dict[str, Path], name: str) -> None:
    page = tab(pages[name].as_uri(), bypass_csp=True)
    page.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
    for width in (1280, 941, 720, 390, 360, 320):
        page.emulate_media(color_scheme="dark" if width == 390 else "light")  # dark changes colours alone
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0, width
        if width in (1280, 390):
            assert axe(page) == [], width
    assert [u for u in page.seen if not u.startswith("data:")] == [pages[name].as_uri()]
    assert page.errors == []


def test_the_style_is_let_through_by_the_policy_and_a_link_leads_to_its_page(tab: Show, pages: dict[str, Path]) -> None:
    page = tab(pages["company"].as_uri(), java_script_enabled=False)
    assert page.locator(".brand").evaluate("e => getComputedStyle(e).display") == "flex"
    page.get_by_role("link", name="Riverside Store, First floor").first.click()
    assert page.url.endswith("/riverside/2026-W46-first.html")
    assert page.title() == "a week"


def test_print_is_one_page_of_figures_without_links(tab: Show, pages: dict[str, Path]) -> None:
    page = tab(pages["company"].as_uri(), color_scheme="dark")
    pdf = page.pdf(prefer_css_page_size=True, print_background=True, tagged=True)
    page.emulate_media(media="print", color_scheme="light")
    assert page.locator(".idx .ix-files").first.is_hidden()
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) == 1
    assert b"/MarkInfo" in pdf
