"""The page in a real browser: accessible, silent on the network, free of errors, never too wide, printable."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from report import sample_sections as sections
from report import sample_weeks as weeks
from report.sample_space import AREAS, CAPACITY, five_areas

from vsd_analytics.report.pages.week import render_html
from vsd_analytics.report.words.languages import speaking
from vsd_analytics.site.model import LANGUAGES

pytestmark = pytest.mark.browser

CAPACITY_NAMES = [AREAS[area] for area in CAPACITY]
ALL = {**weeks.ALL, **sections.MORE}
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
TAGS = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    made = {}
    for name, week in ALL.items():
        made[name] = folder / f"{name}.html"
        made[name].write_text(render_html(week()), encoding="utf-8")
    return made


@pytest.mark.parametrize("name", list(ALL))
def test_the_page_is_quiet_fits_and_is_accessible(browser: Any, axe: str, pages: dict[str, Path], name: str) -> None:
    for scheme, width in MODES:
        context = browser.new_context(
            color_scheme=scheme, viewport={"width": width, "height": 900}, bypass_csp=True, reduced_motion="reduce"
        )
        page = context.new_page()
        requests: list[str] = []
        errors: list[str] = []
        page.on("request", lambda r, seen=requests: seen.append(r.url))
        page.on("console", lambda m, seen=errors: seen.append(m.text))
        page.on("pageerror", lambda e, seen=errors: seen.append(str(e)))
        page.goto(pages[name].as_uri())
        page.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
        overflow = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
        page.evaluate(axe)
        found = page.evaluate("tags => axe.run(document, {runOnly: tags})", TAGS)
        context.close()
        nodes = [(v["id"], n["target"], n["failureSummary"]) for v in found["violations"] for n in v["nodes"]]
        assert nodes == [], (scheme, width)
        assert found["passes"]
        assert [u for u in requests if not u.startswith("data:")] == [pages[name].as_uri()]
        assert errors == []
        assert overflow == 0, (scheme, width)


@pytest.mark.parametrize(
    "name",
    [
        *("complete", "twelve_weeks", "refused", "hostile"),
        *("always_open_picture", "too_incomplete", "settings_changed"),
    ],
)
def test_nothing_is_wider_than_the_screen(browser: Any, pages: dict[str, Path], name: str) -> None:
    page = browser.new_page()
    page.goto(pages[name].as_uri())
    page.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
    beyond = {}
    for width in (320, 360, 390, 1280):
        page.set_viewport_size({"width": width, "height": 800})
        beyond[width] = page.evaluate(
            "['html', '.tt'].map(s => document.querySelector(s)).map(e => e.scrollWidth - e.clientWidth)"
        )
    page.close()
    assert beyond == {width: [0, 0] for width in beyond}


@pytest.mark.parametrize("name", ["twelve_weeks", "too_incomplete", "settings_changed", "hostile"])
def test_every_text_is_large_enough_to_read_and_every_link_to_hit(
    browser: Any, pages: dict[str, Path], name: str
) -> None:
    page = browser.new_page()
    page.goto(pages[name].as_uri())
    found = {}
    for width in (320, 390, 768, 1280):
        page.set_viewport_size({"width": width, "height": 900})
        found[width] = page.evaluate(TOO_SMALL)
    page.close()
    assert found == {width: [] for width in found}


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_page_with_every_section_is_short_and_asks_on_the_first_screen_of_a_phone(
    browser: Any, tmp_path: Path, language: str
) -> None:
    """The demo's twelve weeks have 900 words; this made-up week has more changes, cards and notes than they."""
    week = ALL["twelve_weeks"]()
    week = replace(week, provenance=replace(week.provenance, language=language), story=None)
    with speaking(language):
        (tmp_path / "page.html").write_text(render_html(week), encoding="utf-8")
    page = browser.new_page(viewport={"width": 390, "height": 844})
    page.goto((tmp_path / "page.html").as_uri())
    words = page.evaluate(r"document.body.innerText.split(/\s+/).filter(w => /\p{L}{2,}/u.test(w)).length")
    question = page.evaluate("document.querySelector('.ask').getBoundingClientRect()")
    page.close()
    assert words <= 1000
    assert question["top"] < 700


@pytest.mark.parametrize("language", LANGUAGES)
def test_five_areas_that_ask_how_they_are_used_leave_the_page_within_900_words_and_four_sheets(
    browser: Any, axe: str, tmp_path: Path, language: str
) -> None:
    """Names in drawings are no words of the page, nor is what only a screen reader says."""
    week = five_areas()
    week = replace(week, provenance=replace(week.provenance, language=language), story=None)
    with speaking(language):
        (tmp_path / "page.html").write_text(render_html(week), encoding="utf-8")
    context = browser.new_context(viewport={"width": 390, "height": 844}, bypass_csp=True)
    page = context.new_page()
    page.goto((tmp_path / "page.html").as_uri())
    words = page.evaluate(WORDS)
    pdf = page.pdf(prefer_css_page_size=True, print_background=True)
    names = page.locator("#waiting tbody th").all_inner_texts()
    page.evaluate("document.querySelectorAll('details').forEach(d => d.open = true)")
    page.evaluate(axe)
    found = page.evaluate("tags => axe.run(document, {runOnly: tags})", TAGS)
    overflow = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    context.close()
    assert 700 < words <= 900
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 4
    assert names[:6] == ["Checkout queue", "Pharmacy counter", *CAPACITY_NAMES]
    assert [(v["id"], n["target"]) for v in found["violations"] for n in v["nodes"]] == []
    assert overflow == 0


def test_forced_colours_leave_drawings_their_own(browser: Any, pages: dict[str, Path]) -> None:
    context = browser.new_context(forced_colors="active", viewport={"width": 1280, "height": 900})
    page = context.new_page()
    page.goto(pages["twelve_weeks"].as_uri())
    assert page.evaluate("matchMedia('(forced-colors: active)').matches")
    step, dot, hollow = page.evaluate(
        """() => [".ramp .sw.b4", ".dots .on", ".dots i:not(.on)"].map(s =>
            document.querySelector(s) && getComputedStyle(document.querySelector(s)).backgroundColor)"""
    )
    context.close()
    assert step == "rgb(231, 111, 63)"
    assert dot != hollow, "a filled dot is not an empty one"


def test_the_style_is_let_through_by_the_policy(browser: Any, pages: dict[str, Path]) -> None:
    page = browser.new_page()
    page.goto(pages["hostile"].as_uri())
    assert page.evaluate("getComputedStyle(document.querySelector('.brand')).display") == "flex"
    assert page.evaluate("document.scripts.length") == 0
    page.close()


@pytest.mark.parametrize("paper", ["a4", "letter"])
@pytest.mark.parametrize("name", ["complete", "twelve_weeks", "first_week", "settings_changed", "hostile"])
def test_print_has_at_most_four_tagged_pages_and_a_complete_first_one(
    browser: Any, tmp_path: Path, name: str, paper: str
) -> None:
    path = tmp_path / "week.html"
    path.write_text(render_html(ALL[name](), paper=paper), encoding="utf-8")
    page = browser.new_page(color_scheme="dark")
    page.goto(path.as_uri())
    pdf = page.pdf(prefer_css_page_size=True, print_background=True, tagged=True)
    page.emulate_media(media="print", color_scheme="light")
    page.set_viewport_size({"width": 687 if paper == "a4" else 710, "height": 1000})
    plan = page.evaluate("document.querySelector('.plan').getBoundingClientRect().toJSON()")
    page.close()
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 4
    assert b"/MarkInfo" in pdf
    assert len(pdf) <= 1_000_000
    # the printed area is 182 x 270 mm of A4, 687 x 1020 px; 188 x 255 mm of Letter, 965 px high
    assert plan["bottom"] <= (1020 if paper == "a4" else 965)
    # and the map takes what the words leave: of an ordinary headline at least 85 mm of the height of A4
    assert plan["height"] >= (321 if paper == "a4" and name != "hostile" else 220)


@pytest.mark.parametrize("name", ["twelve_weeks", "first_week", "no_data", "too_incomplete"])
def test_no_words_are_printed_smaller_than_nine_points(browser: Any, pages: dict[str, Path], name: str) -> None:
    """Numbers of drawings apart, which are scaled with them."""
    page = browser.new_page()
    page.goto(pages[name].as_uri())
    page.emulate_media(media="print")
    small = page.evaluate(
        """() => [...document.body.querySelectorAll("*")].filter(e =>
            !e.closest("svg") && e.checkVisibility() && !e.closest(".vh, .skip")
            && [...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim())
            && parseFloat(getComputedStyle(e).fontSize) < 11.99
        ).map(e => [e.tagName, e.className, getComputedStyle(e).fontSize, e.textContent.trim().slice(0, 40)])"""
    )
    page.close()
    assert small == []


def test_a_site_with_three_areas_more_is_one_page_longer_at_most(browser: Any, tmp_path: Path) -> None:
    path = tmp_path / "week.html"
    path.write_text(render_html(sections.twelve_weeks(n_more_areas=3)), encoding="utf-8")
    page = browser.new_page()
    page.goto(path.as_uri())
    pdf = page.pdf(prefer_css_page_size=True, print_background=True, tagged=True)
    page.close()
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 5
