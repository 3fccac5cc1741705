"""Every word of the page is in the catalogue: none in the script, none left over in a page of another language."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import pytest

from vsd_analytics.answer import Verdict
from vsd_analytics.planner import page as page_of_planner
from vsd_analytics.planner.lines_layer import SAID as SAID_OF_LINES
from vsd_analytics.planner.page import render_planner
from vsd_analytics.planner.planner_data import PlannerData
from vsd_analytics.planner.script import LAYERS, REASONS, SCRIPTS, script, sentences
from vsd_analytics.resources import shipped
from vsd_analytics.wording import catalogue
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.reasons import reason_text

STATIC = shipped("reports") / "static"
VIEWS = (
    *("", "show=split", "show=difference", "map=risk&days=1111100", "map=excess", "days=0000011", "days=0000001"),
    *("place=rect&rect=1,1,6,6", "place=rect&rect=16,1,18,3", "place=area%3Adoor&show=difference&days=1100000"),
)
READ = """hash => {
  location.hash = hash || '#'; dispatchEvent(new HashChangeEvent('hashchange'));
  const heard = [...document.querySelectorAll('[aria-label],[data-l],[title]')]
    .flatMap(e => ['aria-label', 'data-l', 'title'].map(n => e.getAttribute(n) || ''));
  const read = [...document.querySelectorAll('header,main,.more')].map(e => e.textContent);
  return [document.title, ...read, ...heard].join('\\n');
}"""


def literals(text: str) -> list[str]:
    """Return the texts in quotes of a script, without its comments; what is filled into a template literal is cut."""
    bare = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    found = [a or b for a, b in re.findall(r"'((?:[^'\\\n]|\\.)*)'|\"((?:[^\"\\\n]|\\.)*)\"", bare)]
    return found + [re.sub(r"\$\{[^{}]*\}", "", each) for each in re.findall(r"`((?:[^`\\]|\\.)*)`", bare)]


@pytest.mark.parametrize("name", [*SCRIPTS, *LAYERS.values()])
def test_the_script_holds_no_sentence(name: str) -> None:
    for text in literals((STATIC / name).read_text(encoding="utf-8")):
        if text[:1] in ("#", ".", "[") or "px " in text:
            continue  # a selector, a font
        assert not re.search(r"[A-Za-z]{2,}\s+[A-Za-z]{2,}", text), text


def test_the_script_says_what_is_there_and_all_of_it() -> None:
    code, known = script(tuple(LAYERS)), {*sentences(), *SAID_OF_LINES}
    asked = set(re.findall(r"(?:\bword|\bsay)\('([\w.]+)'", code))
    asked |= {key for pair in re.findall(r"\? '([\w.]+)' : '([\w.]+)'", code) for key in pair} & known
    asked |= {f"reason.none_{kind}" for kind in ("per_open_h", "per_person_h")}
    asked |= {f"words.{verdict}" for verdict in get_args(Verdict)}
    assert asked == known


def test_the_style_holds_no_word() -> None:
    for text in re.findall(r"(?<![-\w])content:([^;}]*)", (STATIC / "planner.css").read_text(encoding="utf-8")):
        assert not re.search(r"[A-Za-z]{2,}", text.replace("attr(data-l)", "")), text


def test_reasons_are_those_of_the_analysis() -> None:
    """The page and `vsd compare` give the same reason in the same words."""
    for name, code in REASONS.items():
        same = re.sub(r"\{[^{}]*\}", "{}", catalogue.template(f"reason.{code}"))
        assert re.sub(r"\{\w+\}", "{}", str(sentences()[f"reason.{name}"])) == same, name


@pytest.mark.browser
def test_a_page_of_another_language_has_no_word_of_this_one(
    masked: PlannerData, tab: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A made-up language marks every sentence; what is outside the marks must come from the data."""
    real = catalogue.template
    monkeypatch.setattr(catalogue, "template", lambda key, /, plural=None: f"⟦{real(key, plural=plural)}⟧")
    for module in (fmt, page_of_planner):
        monkeypatch.setattr(module, "days", lambda: ("1",) * 7)
    monkeypatch.setattr(fmt, "months", lambda: ("2",) * 12)
    path = tmp_path / "marked.html"
    path.write_text(render_planner(masked), encoding="utf-8")
    names = {masked.site.name, masked.floor.name, *(p.name for p in masked.places), "vsd-analytics"}
    names |= {reason_text(p.close_time_share.reason) for p in masked.places}
    names |= {reason_text(p.violation_rate.reason) for p in masked.places} | {
        reason_text(p.encounter_rate.reason) for p in masked.places
    }
    names |= {reason_text(masked.hotspots.reason), "JSON", "SVG", "DXF", "GeoJSON"}
    assert masked.shown is not None
    names |= {f.name for f in masked.shown.fixtures}
    page = tab(path.as_uri())
    page.wait_for_function("document.body.dataset.first")
    for at in VIEWS:
        seen = page.evaluate(READ, at)
        assert "undefined" not in seen, at
        while "⟦" in seen:
            fewer = re.sub(r"⟦[^⟦⟧]*⟧", "", seen)
            assert fewer != seen, at
            seen = fewer
        for text in sorted(names - {""}, key=len, reverse=True):
            seen = seen.replace(text, "")
        assert set(re.findall(r"[A-Za-z]{2,}", seen)) == set(), at
