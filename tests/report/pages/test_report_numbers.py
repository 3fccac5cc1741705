"""The numbers gate: every number a reader sees on the page is in the JSON file."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from datetime import date, datetime
from html.parser import HTMLParser
from typing import Any

import pytest
from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.answer import Answers, Reason
from vsd_analytics.figures.week.model_map import FloorMap
from vsd_analytics.report.model.week import Story, WeekReport
from vsd_analytics.report.pages.figures_by_id import figures_by_id
from vsd_analytics.report.pages.json_and_csv import from_json, to_json
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text

NUMBER = re.compile(r"\d+(?:,\d{3})*(?:\.\d+)?")
GEOMETRY = {"extent", "bands", "unseen", "uncertain", "ring", "at", "image"}


class Text(HTMLParser):
    """Collects what a reader sees; leaves out the style, the axis labels and code."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.skipping = 0
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        said = dict(attrs)
        if self.skipping or tag == "style" or said.get("class") == "axt":
            self.skipping += tag not in ("meta", "link", "col")
        for name in ("aria-label", "title"):
            if said.get(name):
                self.texts.append(said[name] or "")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        return

    def handle_endtag(self, tag: str) -> None:
        self.skipping = max(0, self.skipping - 1)

    def handle_data(self, data: str) -> None:
        if not self.skipping:
            self.texts.append(data)


def leaves(value: Any, unit: str | None = None) -> Iterator[tuple[Any, str | None]]:
    """Yield every number, date and text of the JSON file with its unit; the words made from them are left out."""
    if isinstance(value, Story):
        return
    if isinstance(value, Reason):
        yield reason_text(value), unit  # the page shows the sentence, numbers and all
        return
    if isinstance(value, Answers):
        for column, cell in ((c, row[c.name]) for answer in value for row in answer.rows for c in answer.columns):
            yield from leaves(cell, column.unit)
        return
    if is_dataclass(value):
        for field in fields(value):
            if not (isinstance(value, FloorMap) and field.name in GEOMETRY):
                yield from leaves(getattr(value, field.name), field.metadata.get("unit", unit))
    elif isinstance(value, dict):
        for key, item in value.items():
            is_share = key == "share" or (key in ("value", "lo", "hi") and value.get("unit") == "share")
            yield from leaves(item, "share" if is_share else "m" if key.endswith("_m") else unit)
    elif isinstance(value, tuple | list):
        for item in value:
            yield from leaves(item, unit)
    else:
        yield value, unit


def forms(value: Any, unit: str | None) -> set[str]:
    """Return all ways one value of the JSON file may be written."""
    if value is None or isinstance(value, bool):
        return set()
    if isinstance(value, datetime | date):
        said = [str(value.day), str(value.year)]
        if isinstance(value, datetime):
            said += [f"{value.hour:02d}", f"{value.minute:02d}"]
        return set(said)
    if isinstance(value, str):
        return set() if re.search(r"[^\W\d]", value) else set(NUMBER.findall(value))
    if unit == "share":
        texts = [fmt.percent(abs(value)), fmt.signed(value), fmt.fewer_more(value)]
    elif unit in ("m", "s"):
        texts = [f"{value:g}"]
    else:
        texts = [fmt.number(value), fmt.count(value), f"{value:g}"]
        if isinstance(value, int) and 0 <= value < 24:
            texts.append(f"{value:02d}")
    return {n for text in texts for n in NUMBER.findall(text)}


def allowed(report: WeekReport) -> set[str]:
    known = {form for value, unit in leaves(report) for form in forms(value, unit)}
    known |= {f"{step - 1:g}" for step in report.rules.hour_steps}
    known.add(fmt.number(report.rules.mask_below / 2))  # what a count too small to print is in averages
    known |= {str(i + 1) for i in range(len(report.story.things if report.story else ()))}
    if report.state == "empty" and report.level.violation_rate.hi:
        known |= set(NUMBER.findall(fmt.one_in(report.level.violation_rate.hi)))
    return known


def strangers(report: WeekReport, page: str) -> set[str]:
    """Return the numbers on the page that no value of the JSON file explains, nor the heading of its column."""
    read = from_json(to_json(report))
    twin = replace(read, figures=figures_by_id(read))
    named = {v for v, _ in leaves(twin) if isinstance(v, str) and NUMBER.search(v)}
    texts = sorted((v for v in named if re.search(r"[^\W\d]", v)), key=len, reverse=True)
    seen = " \n".join(Text(page).texts)
    for text in texts:
        for form in (text, text.rstrip("."), text[:1].upper() + text[1:].rstrip(".")):
            seen = seen.replace(form, " ")
    return set(NUMBER.findall(seen)) - allowed(twin)


ALL = {**weeks.ALL, **sections.MORE}


@pytest.mark.parametrize("name", list(ALL))
def test_every_number_on_the_page_is_in_the_json_file(name: str) -> None:
    report = ALL[name]()
    assert strangers(report, render_html(report)) == set()


@pytest.mark.parametrize("number", ["987", "14.7", "1,999"])
def test_the_gate_finds_a_number_that_is_not(number: str) -> None:
    report = weeks.normal()
    page = render_html(report).replace("</h1>", f" by {number}</h1>")
    assert strangers(report, page) == {number}


def test_the_gate_finds_a_figure_that_differs() -> None:
    report = weeks.normal()
    level = replace(report.level, violation_rate=replace(report.level.violation_rate, value=122.6))
    assert "123" in strangers(report, render_html(replace(report, level=level)))


def test_every_verdict_of_the_page_is_in_the_json_file() -> None:
    twin = from_json(to_json(weeks.normal()))
    page = render_html(weeks.normal())
    table = page.split('<table class="cmp"')[1].split("</table>")[0]
    said = re.findall(r'<span class="word \w+">([A-Z][a-z ]+)', table)
    expected = [a.violation_rate.verdict for a in twin.areas] + [twin.level.violation_rate.verdict]
    assert [s.strip() for s in said] == [say(f"words.{verdict}") for verdict in expected if verdict is not None]
