"""Static gates of the page: one file, no script, no request, sound structure, equal bytes, documented variables."""

from __future__ import annotations

import base64
import hashlib
import re
import subprocess
import sys
from dataclasses import fields, is_dataclass, replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from forbidden_words import forbidden_in
from jinja2 import Environment, meta
from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.figures.week import results
from vsd_analytics.report.model import week
from vsd_analytics.report.pages.week import Page, css_string, make_page, render_html
from vsd_analytics.resources import shipped

OF_THE_WEEK = (
    *("week", "hero", "ask", "where", "spots", "when", "changed", "bars", "trend", "next", "data", "about", "macros"),
    *("change_maps", "small_maps", "log", "waiting", "lines", "context"),
)
TEMPLATES = [shipped("reports") / "templates" / f"{name}.html.j2" for name in OF_THE_WEEK]
CALLS = {"say", "say_html", "html_tag"}
VOID = {"meta", "link", "img", "br", "hr", "col", "input", "circle", "rect", "path", "line", "image"}


class Tree(HTMLParser):
    """Collects elements with their attributes and the text inside headings; fails on wrong nesting."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.headings: list[int] = []
        self.feed(page)
        assert self.open == [], f"never closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if re.fullmatch(r"h[1-6]", tag):
            self.headings.append(int(tag[1]))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag, f"</{tag}> closes something else"


ALL = {**weeks.ALL, **sections.MORE}


@pytest.fixture(scope="module", params=list(ALL))
def page(request: pytest.FixtureRequest) -> tuple[str, str]:
    return request.param, render_html(ALL[request.param]())


def test_nothing_is_loaded_and_nothing_runs(page: tuple[str, str]) -> None:
    _, text = page
    tree = Tree(text)
    tags = {tag for tag, _ in tree.elements}
    assert not tags & {"script", "iframe", "object", "embed", "form", "base", "audio", "video"}
    assert re.findall(r"https?://(?!www\.w3\.org/2000/svg)", text) == []
    for tag, attributes in tree.elements:
        assert "style" not in attributes, tag
        assert not [a for a in attributes if a.startswith("on")], tag
        for name in ("src", "href", "action", "poster"):
            target = attributes.get(name)
            assert target is None or target.startswith(("#", "data:image/", "mailto:?")), target
    urls = re.findall(r"url\(([^)]*)", re.sub(r"<style>.*?</style>", "", text, flags=re.DOTALL))
    assert all(u.startswith("#") for u in urls)


def test_the_policy_allows_this_style_and_nothing_else(page: tuple[str, str]) -> None:
    _, text = page
    (style,) = re.findall(r"<style>(.*?)</style>", text, flags=re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    assert (
        policy == f"default-src 'none'; style-src 'sha256-{digest}'; img-src data:; base-uri 'none'; form-action 'none'"
    )


def test_structure_is_sound(page: tuple[str, str]) -> None:
    _, text = page
    tree = Tree(text)
    assert text.startswith("<!doctype html>\n<html lang=")
    assert tree.headings.count(1) == 1
    assert tree.headings[0] == 1
    for before, after in zip(tree.headings, tree.headings[1:], strict=False):
        assert after <= before + 1, tree.headings
    ids = [a["id"] for _, a in tree.elements if "id" in a]
    assert len(ids) == len(set(ids))
    for tag, attributes in tree.elements:
        if tag == "svg":
            assert attributes.get("aria-hidden") == "true" or attributes.get("aria-label"), attributes
        if tag == "th":
            assert attributes.get("scope") in ("row", "col")
        if (attributes.get("href") or "").startswith("#"):
            assert (attributes["href"] or "")[1:] in ids
    assert any(tag == "a" and a.get("class") == "skip" for tag, a in tree.elements)


def test_size_stays_under_the_budget(page: tuple[str, str]) -> None:
    assert len(page[1].encode()) <= 250_000


def test_no_value_of_python_shows(page: tuple[str, str]) -> None:
    visible = re.sub(r"<style>.*?</style>|<[^>]*>", " ", page[1], flags=re.DOTALL)
    assert re.findall(r"\b(None|nan|True|False|inf|Undefined|datetime)\b", visible) == []


def test_hostile_names_stay_text() -> None:
    text = render_html(weeks.hostile())
    assert "<script" not in text
    assert "<img" not in text
    assert text.count("</style>") == 1
    assert "&lt;script&gt;alert(1)&lt;/script&gt; 0" in text
    assert "49" not in re.findall(r"=&#39;([^<]*)", text)[0]
    assert {t for t, _ in Tree(text).elements} == {t for t, _ in Tree(render_html(weeks.normal())).elements}


def test_a_name_cannot_leave_its_css_string() -> None:
    assert css_string('a"b\\</style>\n') == '"a\\22 b\\5c \\3c \\2f style\\3e \\a "'


def test_equal_reports_give_equal_bytes_in_another_process() -> None:
    program = (
        "import sys, hashlib; sys.path[:0] = sys.argv[1:]\n"
        "from report import sample_weeks as fixtures\nfrom vsd_analytics.report.pages.week import render_html\n"
        "print(hashlib.sha256(render_html(fixtures.normal()).encode()).hexdigest())"
    )
    tests = Path(__file__).resolve().parents[2]
    here = hashlib.sha256(render_html(weeks.normal()).encode()).hexdigest()
    there = subprocess.run(
        [sys.executable, "-c", program, str(tests), str(tests.parent)],
        capture_output=True,
        text=True,
        check=True,
        env={"PYTHONHASHSEED": "77", "TZ": "Asia/Tokyo"},
    )
    assert there.stdout.strip() == here


def test_missing_hour_is_hatched_and_never_zero() -> None:
    text = render_html(weeks.normal())
    assert len(re.findall('<td class="hatch"><svg.*?</svg><span class="vh">no data</span></td>', text)) == 2
    assert text.count('<td class="b0">0</td>') == 1
    assert '<td class="b2 low">82<span class="vh">, rough</span></td>' in text
    assert '<td class="b1">&lt;5</td>' in text
    assert text.count(' part">') == 8 + 2


def test_the_hour_that_comes_twice_has_two_rows() -> None:
    page = make_page(weeks.always_open_picture())
    twice = [row for row in page.table.rows if row.label == "02"]
    assert [row.is_second for row in twice] == [False, True]
    assert [c.text != "" for c in twice[1].cells] == [False] * 6 + [True]


def test_a_week_too_incomplete_ranks_and_compares_nothing() -> None:
    text = render_html(weeks.too_incomplete())
    assert 'id="where"' in text
    assert 'id="when"' in text
    for absent in ('class="mk', 'class="cmp"', "Busiest", ">Share<", "likely"):
        assert absent not in text.split("About these figures")[0].split("</style>")[1], absent


def test_masked_areas_show_no_figure() -> None:
    text = render_html(weeks.masked())
    row = re.findall(r'<tr><th scope="row">Pharmacy counter</th>(.*?)</tr>', text)[0]
    assert re.findall(r">([^<]+)<", row) == ["&lt;5", "–", "–", "–", "96%"]


def test_exposure_unknown_says_so_and_never_zero() -> None:
    text = render_html(weeks.exposure_unknown())
    assert "Not measurable" in text
    assert "The engine sends no positions." in text


def test_distance_of_another_law_is_printed_everywhere() -> None:
    text = re.sub(r"<style>.*?</style>", "", render_html(weeks.six_feet()), flags=re.DOTALL)
    assert re.search(r"1\.83\sm", text)
    assert re.findall(r"(?<![\d.])2\sm\b", text) == []


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda p: p.name)
def test_templates_compute_nothing(path: Path) -> None:
    for expression in re.findall(r"{[{%](.*?)[%}]}", path.read_text(), flags=re.DOTALL):
        bare = re.sub(r'"[^"]*"|\'[^\']*\'', "", expression)
        assert re.findall(r"\s[-+*/%~]\s|\*\*|\bround\b|\bformat\b|\bsum\b|\bsafe\b", bare) == [], expression


def test_templates_use_exactly_the_documented_variables() -> None:
    environment = Environment(autoescape=True)
    used: set[str] = set()
    for path in TEMPLATES:
        source = re.sub(r"\|\s*\w+", "", path.read_text())
        used |= meta.find_undeclared_variables(environment.parse(source))
    assert used - CALLS == {f.name for f in fields(Page)}
    documented = set(re.findall(r"^ {8}(\w+): ", Page.__doc__ or "", flags=re.MULTILINE))
    documented |= set(re.findall(r"^    (\w+): [A-Z]", Page.__doc__ or "", flags=re.MULTILINE))
    assert {f.name for f in fields(Page)} <= documented


def test_templates_use_no_forbidden_word() -> None:
    for path in TEMPLATES:
        text = re.sub(r"{[{%].*?[%}]}|<[^>]*>", " ", path.read_text(), flags=re.DOTALL)
        assert forbidden_in(text) == [], path.name


def test_every_field_of_the_model_is_documented() -> None:
    kinds = [k for k in (vars(week) | vars(results)).values() if isinstance(k, type) and is_dataclass(k)]
    assert len(kinds) > 20
    for kind in kinds:
        assert kind.__doc__, kind
        for field in fields(kind):
            assert field.metadata["help"].endswith((".", ")")), (kind, field.name)


def test_the_package_names_no_rainbow() -> None:
    folder = Path(week.__file__).parents[2]
    for path in folder.rglob("*.py"):
        assert not re.search(r"COLORMAP_JET|['\"](jet|turbo|hsv|rainbow)['\"]", path.read_text()), path


def test_a_report_without_cameras_or_areas_still_renders() -> None:
    report = weeks.no_data()
    bare = replace(report, coverage=replace(report.coverage, cameras=(), outages=()), areas=(), log=())
    assert "No camera covers this floor" in render_html(bare)
    never = tuple(replace(c, last_record=None) for c in report.coverage.cameras)
    silent = replace(report, coverage=replace(report.coverage, cameras=never))
    assert "No record of any camera was found" in render_html(silent)
