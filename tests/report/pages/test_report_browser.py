"""The page in a real browser: accessible, silent on the network, free of errors, never too wide, printable."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from report import sample_sections as sections
from report import sample_weeks as weeks
from report.sample_space import AREAS, CAPACITY, five_areas

from vsd_analytics.report.pages.week import render_html
from vsd_analytics.resources import LANGUAGES
from vsd_analytics.wording.languages import speaking

pytestmark = pytest.mark.browser

CAPACITY_NAMES = [AREAS[area] for area in CAPACITY]
ALL = {**weeks.ALL, **sections.MORE}
Show = Callable[..., Any]
MODES = [("light", 1280), ("dark", 390)]
"""Dark changes colours alone, at any width: together both modes show every width and every colour."""
TOO_SMALL = """() => [...document.body.querySelectorAll("*")].flatMap(e => {
    if (!e.checkVisibility() || e.closest(".vh, .skip")) return [];
    const found = [], text = [...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim());
    let size = parseFloat(getComputedStyle(e).fontSize);
    if (e.getScreenCTM) { const m = e.getScreenCTM(); size *= Math.hypot(m.a, m.b); }
    if (text && size < 11.95) found.push(["text", size.toFixed(1), e.tagName, e.textContent.trim().slice(0, 30)]);
    const high = e.getBoundingClientRect().height;
    if (e.matches("a, summary, button, input, select") && high < 23.5)
        found.push(["target", high.toFixed(1), e.tagName, e.textContent.trim().slice(0, 30)]);
    return found;
})"""
"""Visible text under 12 px, also in drawings, and links under 24 px high."""
WORDS = r"""() => {
    const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    let n = 0;
    while (texts.nextNode()) {
        const e = texts.currentNode.parentElement;
        if (e.closest("svg, .vh, .skip, style") || !e.checkVisibility()) continue;
        n += texts.currentNode.textContent.split(/\s+/).filter(w => /\p{L}{2,}/u.test(w)).length;
    }
    return n;
}"""
"""Words of two letters or more that a reader sees, outside drawings."""


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    made = {}
    for name, week in ALL.items():
        made[name] = folder / f"{name}.html"
        made[name].write_text(render_html(week()), encoding="utf-8")
    return made


@pytest.mark.parametrize("name", list(ALL))
def test_the_page_is_quiet_fits_and_is_accessible(tab: Show, axe: Show, pages: dict[str, Path], name: str) -> None:
    page = tab(pages[name].as_uri(), bypass_csp=True)
    page.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
    for scheme, width in MODES:
        page.emulate_media(color_scheme=scheme)
        page.set_viewport_size({"width": width, "height": 900})
        overflow = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
        assert overflow == 0, (scheme, width)
        assert axe(page) == [], (scheme, width)
    assert [u for u in page.seen if not u.startswith("data:")] == [pages[name].as_uri()]
    assert page.errors == []


@pytest.mark.parametrize(
    "name",
    [
        *("complete", "twelve_weeks", "refused", "hostile"),
        *("always_open_picture", "too_incomplete", "settings_changed"),
    ],
)
def test_nothing_is_wider_than_the_screen(tab: Show, pages: dict[str, Path], name: str) -> None:
    page = tab(pages[name].as_uri())
    page.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
    beyond = {}
    for width in (320, 360, 390, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        beyond[width] = page.evaluate(
            "['html', '.tt'].map(s => document.querySelector(s)).map(e => e.scrollWidth - e.clientWidth)"
        )
    assert beyond == {width: [0, 0] for width in beyond}


@pytest.mark.parametrize("name", ["twelve_weeks", "too_incomplete", "settings_changed", "hostile"])
def test_every_text_is_large_enough_to_read_and_every_link_to_hit(tab: Show, pages: dict[str, Path], name: str) -> None:
    page = tab(pages[name].as_uri())
    found = {}
    for width in (320, 390, 768, 1280):
        page.set_viewport_size({"width": width, "height": 900})
        found[width] = page.evaluate(TOO_SMALL)
    assert found == {width: [] for width in found}


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_page_with_every_section_is_short_and_asks_on_the_first_screen_of_a_phone(
    tab: Show, tmp_path: Path, language: str
) -> None:
    """The demo's twelve weeks have 900 words; this made-up week has more changes, cards and notes than they."""
    week = ALL["twelve_weeks"]()
    week = replace(week, provenance=replace(week.provenance, language=language), story=None)
    with speaking(language):
        (tmp_path / "page.html").write_text(render_html(week), encoding="utf-8")
    page = tab((tmp_path / "page.html").as_uri(), viewport={"width": 390, "height": 844})
    words = page.evaluate(r"document.body.innerText.split(/\s+/).filter(w => /\p{L}{2,}/u.test(w)).length")
    question = page.evaluate("document.querySelector('.ask').getBoundingClientRect()")
    assert words <= 1000
    assert question["top"] < 700


@pytest.mark.parametrize("language", LANGUAGES)
def test_five_areas_that_ask_how_they_are_used_leave_the_page_within_900_words_and_four_sheets(
    tab: Show, axe: Show, tmp_path: Path, language: str
) -> None:
    """Names in drawings are no words of the page, nor is what only a screen reader says."""
    week = five_areas()
    week = replace(week, provenance=replace(week.provenance, language=language), story=None)
    with speaking(language):
        (tmp_path / "page.html").write_text(render_html(week), encoding="utf-8")
    page = tab((tmp_path / "page.html").as_uri(), viewport={"width": 390, "height": 844}, bypass_csp=True)
    words = page.evaluate(WORDS)
    pdf = page.pdf(prefer_css_page_size=True, print_background=True)
    names = page.locator("#waiting tbody th").all_inner_texts()
    page.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
    violations = axe(page)
    overflow = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert 700 < words <= 900
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 4
    assert names[:6] == ["Checkout queue", "Pharmacy counter", *CAPACITY_NAMES]
    assert violations == []
    assert overflow == 0


def test_forced_colours_leave_drawings_their_own(tab: Show, pages: dict[str, Path]) -> None:
    page = tab(pages["twelve_weeks"].as_uri(), forced_colors="active")
    assert page.evaluate("matchMedia('(forced-colors: active)').matches")
    step, dot, hollow = page.evaluate(
        """() => [".ramp .sw.b4", ".dots .on", ".dots i:not(.on)"].map(s =>
            document.querySelector(s) && getComputedStyle(document.querySelector(s)).backgroundColor)"""
    )
    assert step == "rgb(231, 111, 63)"
    assert dot != hollow, "a filled dot is not an empty one"


def test_the_style_is_let_through_by_the_policy(tab: Show, pages: dict[str, Path]) -> None:
    page = tab(pages["hostile"].as_uri())
    assert page.evaluate("getComputedStyle(document.querySelector('.brand')).display") == "flex"
    assert page.evaluate("document.scripts.length") == 0


@pytest.mark.parametrize("paper", ["a4", "letter"])
@pytest.mark.parametrize("name", ["complete", "twelve_weeks", "first_week", "settings_changed", "hostile"])
def test_print_has_at_most_four_tagged_pages_and_a_complete_first_one(
    tab: Show, tmp_path: Path, name: str, paper: str
) -> None:
    path = tmp_path / "week.html"
    path.write_text(render_html(ALL[name](), paper=paper), encoding="utf-8")
    page = tab(path.as_uri(), color_scheme="dark")
    pdf = page.pdf(prefer_css_page_size=True, print_background=True, tagged=True)
    page.emulate_media(media="print", color_scheme="light")
    page.set_viewport_size({"width": 687 if paper == "a4" else 710, "height": 1000})
    plan = page.evaluate("document.querySelector('.plan').getBoundingClientRect().toJSON()")
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 4
    assert b"/MarkInfo" in pdf
    assert len(pdf) <= 1_000_000
    # the printed area is 182 x 270 mm of A4, 687 x 1020 px; 188 x 255 mm of Letter, 965 px high
    assert plan["bottom"] <= (1020 if paper == "a4" else 965)
    # and the map takes what the words leave: of an ordinary headline at least 85 mm of the height of A4
    assert plan["height"] >= (321 if paper == "a4" and name != "hostile" else 220)


@pytest.mark.parametrize("name", ["twelve_weeks", "first_week", "no_data", "too_incomplete"])
def test_no_words_are_printed_smaller_than_nine_points(tab: Show, pages: dict[str, Path], name: str) -> None:
    """Numbers of drawings apart, which are scaled with them."""
    page = tab(pages[name].as_uri())
    page.emulate_media(media="print")
    small = page.evaluate(
        """() => [...document.body.querySelectorAll("*")].filter(e =>
            !e.closest("svg") && e.checkVisibility() && !e.closest(".vh, .skip")
            && [...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim())
            && parseFloat(getComputedStyle(e).fontSize) < 11.99
        ).map(e => [e.tagName, e.className, getComputedStyle(e).fontSize, e.textContent.trim().slice(0, 40)])"""
    )
    assert small == []


def test_a_site_with_three_areas_more_is_one_page_longer_at_most(tab: Show, tmp_path: Path) -> None:
    path = tmp_path / "week.html"
    path.write_text(render_html(sections.twelve_weeks(n_more_areas=3)), encoding="utf-8")
    page = tab(path.as_uri())
    pdf = page.pdf(prefer_css_page_size=True, print_background=True, tagged=True)
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 5
