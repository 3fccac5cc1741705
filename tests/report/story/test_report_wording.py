"""The catalogue of sentences: all of the page's words come from it, every call names what its sentence needs."""

from __future__ import annotations

import ast
import re
import string
from collections.abc import Iterator, Mapping
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest
from forbidden_words import forbidden_in
from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.report.pages import week
from vsd_analytics.report.pages.figures_by_id import figures_by_id
from vsd_analytics.resources import shipped
from vsd_analytics.wording import catalogue, terms
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import catalogue as sentences
from vsd_analytics.wording.catalogue import say, say_html
from vsd_analytics.wording.reasons import reason_text

PACKAGE = Path(week.__file__).parents[2]
ROOMS = [PACKAGE / room for room in ("figures", "wording", "report", "planner", "calibration_page", "site_index")]
TEMPLATES = shipped("reports") / "templates"
OF_THE_WEEK = (
    *("week", "hero", "where", "spots", "when", "changed", "bars", "trend", "next", "data", "about", "macros"),
    *("change_maps", "small_maps", "log", "waiting"),
    *("planner", "calibrate", "index/index", "index/compare", "index/macros"),
)
# Modules whose every sentence is in the catalogue.
SPEAKING = (
    *(f"report/pages/{n}" for n in ("headline", "things_to_know", "figure_titles", "no_data", "story", "questions")),
    "wording/format",
    "wording/terms",
    "report/model/remedies",
    *(f"report/pages/{n}" for n in ("key_figures", "tables", "week", "spot_cards", "logged_changes", "sections")),
    "report/pages/figure_list",
    "report/draw/trend_chart",
    *(f"figures/week/{n}" for n in ("changes", "spots", "outlook", "trend_weeks")),
    *(f"report/model/{n}" for n in ("site_changes", "spot_names")),
    *("planner/planner_data", "planner/map_kinds", "planner/page", "planner/lines_layer"),
    *("site_index/week_bars", "site_index/summary", "site_index/page", "site_index/compare_section"),
    "report/draw/funnel_chart",
)
# What code may say without the catalogue: punctuation, CSS and SVG.
NO_SENTENCE = re.compile(r"^[\W\d_]*$|@page|font:|content:|^0 0 |^M\{|select |--|^default-src|\bmdash\b")


def calls(tree: ast.AST) -> Iterator[ast.Call]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("say", "say_html"):
            yield node


def keys_of(node: ast.expr) -> list[str]:
    """Return the keys an argument may be: a literal, either branch of a condition, or all that fit an f-string."""
    match node:
        case ast.Constant(value=str(key)):
            return [key]
        case ast.IfExp():
            return keys_of(node.body) + keys_of(node.orelse)
        case ast.JoinedStr():
            pattern = "".join(
                re.escape(str(v.value)) if isinstance(v, ast.Constant) else r"[\w.]*" for v in node.values
            )
            return [k for k in sentences() if re.fullmatch(pattern, k)]
    return []


def places(entry: str | Mapping[str, str]) -> set[str]:
    forms = [entry] if isinstance(entry, str) else list(entry.values())
    return {name for form in forms for _, name, _, _ in string.Formatter().parse(form) if name}


def python_calls() -> list[Any]:
    found = []
    for path in sorted(p for room in ROOMS for p in room.rglob("*.py")):
        for call in calls(ast.parse(path.read_text(encoding="utf-8"))):
            found += [(path.name, key, call) for key in keys_of(call.args[0])]
    return found


def template_calls() -> list[tuple[str, str, set[str]]]:
    found = []
    for name in OF_THE_WEEK:
        path = TEMPLATES / f"{name}.html.j2"
        if path.exists():
            text = path.read_text(encoding="utf-8")
            for start in (m.end() for m in re.finditer(r"\bsay(?:_html)?\(", text)):
                inside = text[start : start + closing(text[start:])]
                said = set(re.findall(r"(\w+)=", inside))
                found += [(path.name, key, said) for key in re.findall(r'"(\w+(?:\.\w+)+)"', inside)]
    return found


def closing(text: str) -> int:
    depth = 1
    for i, c in enumerate(text):
        depth += (c == "(") - (c == ")")
        if depth == 0:
            return i
    raise AssertionError("a call without an end")


def test_every_call_in_code_names_a_sentence_and_what_it_needs() -> None:
    found = python_calls()
    assert len(found) > 200
    for where, key, call in found:
        assert key in sentences(), (where, key)
        given = {k.arg for k in call.keywords}
        if None in given or isinstance(call.args[0], ast.JoinedStr):
            continue
        assert places(sentences()[key]) <= given, (where, key)
        assert isinstance(sentences()[key], str) or "plural" in given, (where, key)


def test_every_call_in_a_template_names_a_sentence_and_what_it_needs() -> None:
    found = template_calls()
    assert len(found) > 80
    for where, key, given in found:
        assert key in sentences(), (where, key)
        assert places(sentences()[key]) <= given, (where, key)


def test_no_sentence_of_the_catalogue_is_dead() -> None:
    used = {key for _, key, _ in python_calls()} | {key for _, key, _ in template_calls()}
    text = "".join(p.read_text(encoding="utf-8") for room in ROOMS for p in room.rglob("*.py"))
    indirect = {key for key in sentences() if f'"{key}"' in text}
    for path in (p for room in ROOMS for p in room.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr) and re.match(r"\w+\.", str(getattr(node.values[0], "value", ""))):
                indirect |= set(keys_of(node))
    by_scripts = ("planner.script.", "calibrate_page.script.")  # test_planner_words.py, test_calibration_page_words.py
    said = {key for key in sentences() if key.startswith(by_scripts)}
    assert set(sentences()) - used - indirect - said == set()


def test_the_catalogue_says_no_forbidden_word() -> None:
    """Units of the JSON file are for programs, on no page: they use the terms of the glossary."""
    for key, entry in sentences().items():
        if key.startswith("reason.unit."):
            continue
        for form in [entry] if isinstance(entry, str) else entry.values():
            assert forbidden_in(form) == [], key


def test_the_catalogue_knows_no_distance_of_its_own() -> None:
    for key, entry in sentences().items():
        for form in [entry] if isinstance(entry, str) else entry.values():
            assert not re.search(r"\d+(\.\d+)?\s?(m|ft|metres|feet)\b", form), key


def test_templates_of_the_week_hold_no_words() -> None:
    for name in OF_THE_WEEK:
        path = TEMPLATES / f"{name}.html.j2"
        if path.exists():
            bare = re.sub(r"{#.*?#}|{[{%].*?[%}]}", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
            bare = re.sub(r"\s(aria-label|title|data-l)=\"\"", "", bare)
            spoken = re.findall(r"\s(?:aria-label|title|alt|data-l)=\"[^\"]*[A-Za-z]{2,}[^\"]*\"", bare)
            seen = re.findall(r"[A-Za-z]{2,}", re.sub(r"<[^>]*>", " ", bare))
            assert (spoken, seen) == ([], []), path.name


@pytest.mark.parametrize("name", SPEAKING)
def test_code_holds_no_sentence(name: str) -> None:
    tree = ast.parse((PACKAGE / f"{name}.py").read_text(encoding="utf-8"))
    docs = {id(n.body[0].value) for n in ast.walk(tree) if hasattr(n, "body") and n.body and isinstance(n.body, list)
            and isinstance(n.body[0], ast.Expr)}  # fmt: skip
    docs |= {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    plain = {id(n) for call in ast.walk(tree) if isinstance(call, ast.Call) for n in ast.walk(call.func)}
    plain |= {id(n) for k in ast.walk(tree) if isinstance(k, ast.keyword) and k.arg == "class_" for n in ast.walk(k)}
    raised = {id(n) for r in ast.walk(tree) if isinstance(r, ast.Raise) for n in ast.walk(r)}
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Constant) and isinstance(node.value, str)):
            continue
        if id(node) in docs | plain | raised or NO_SENTENCE.search(node.value):
            continue
        assert not re.search(r"[A-Za-z]{2,}\s+[A-Za-z]{2,}", node.value), (name, node.lineno, node.value)


ALL = {**weeks.ALL, **sections.MORE}


class Heard(HTMLParser):
    """Collects what a reader sees or hears."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.skipping = 0
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.skipping += tag in ("style", "code") or (self.skipping > 0 and tag not in ("meta", "link", "col"))
        self.texts += [v or "" for k, v in attrs if k in ("aria-label", "title", "data-l")]

    def handle_endtag(self, tag: str) -> None:
        self.skipping = max(0, self.skipping - 1)

    def handle_data(self, data: str) -> None:
        if not self.skipping:
            self.texts.append(data)


def test_a_page_of_another_language_has_no_word_of_this_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """A made-up language marks every sentence; what is outside the marks must come from the data."""
    real = catalogue.template
    monkeypatch.setattr(catalogue, "template", lambda key, /, plural=None: f"⟦{real(key, plural=plural)}⟧")
    for name in ("first_week", "empty", "no_data", "too_incomplete", "settings_changed", "complete", "refused"):
        report = ALL[name]()
        monkeypatch.setattr(fmt, "days", lambda: ("1",) * 7)
        monkeypatch.setattr(fmt, "months", lambda: ("2",) * 12)
        page = week.render_html(report)
        seen = "\n".join(Heard(page).texts)
        while "⟦" in seen:
            fewer = re.sub(r"⟦[^⟦⟧]*⟧", "", seen)
            assert fewer != seen, name
            seen = fewer
        for text in sorted(names(report), key=len, reverse=True):
            seen = seen.replace(text, "").replace(text.rstrip("."), "")
        left = set(re.findall(r"[A-Za-z]{2,}", seen))
        verdicts = {"Clear", "fall", "rise", "About", "the", "same", "No", "clear", "change", "Too", "little", "data"}
        assert left <= {"C1", *verdicts}, (name, left)


def names(report: Any) -> set[str]:
    """Return the free texts of a report."""
    found = {report.site.name, report.site.floor_name, report.provenance.version, report.week.zone}
    found |= (
        {c.name for c in report.coverage.cameras} | {a.name for a in report.areas} | {line.text for line in report.log}
    )
    found |= {line.area_name or "" for line in report.log} | {m.title for m in report.maps}
    found |= {a.name for m in report.maps for a in m.areas} | set(report.provenance.engines)
    found |= {
        reason_text(e.reason) for a in report.areas for e in (a.violation_rate, a.encounter_rate) if e is not None
    }
    found |= {reason_text(f.reason) for f in figures_by_id(report).values()} | {
        reason_text(f.unit) for f in figures_by_id(report).values()
    }
    found |= more_names(report)
    found |= {
        reason_text(report.level.violation_rate.reason),
        reason_text(report.level.encounter_rate.reason),
        "vsd-analytics",
    }
    return {form for text in found - {""} for form in (text, terms.sentence(text), text.rstrip("."))}


def more_names(report: Any) -> set[str]:
    found = (
        {m.text for m in report.trend.marks} | {reason_text(w.reason) for w in report.trend.weeks}
        if report.trend
        else set()
    )
    for r in report.change_effects:
        found |= {
            r.text,
            r.area_name,
            reason_text(r.reason),
            *r.compared_with,
            *map(reason_text, r.doubts),
            *map(reason_text, r.assumptions),
        }
    for c in report.spots.cards if report.spots else ():
        found |= {c.name, c.ask, c.question, c.evidence.camera_name or ""}
    if report.spots:
        found.add(reason_text(report.spots.reason))
    found |= {
        reason_text(x.reason) for x in (report.readings, report.causes, report.outlook, report.unusual) if x is not None
    }
    return found


def test_backticks_are_code_and_values_are_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(catalogue, "catalogue", lambda language: {"x": "Run `vsd <now>` for {name}"})
    assert say_html("x", name="<b>`a`") == "Run <code>vsd &lt;now&gt;</code> for &lt;b&gt;`a`"
    assert say("x", name="<b>") == "Run `vsd <now>` for <b>"


def test_plural_forms_follow_the_number() -> None:
    assert say("data.gaps", plural=1, n="1") == "1 gap"
    assert say("data.gaps", plural=0, n="0") == "0 gaps"
    with pytest.raises(KeyError, match="say how many"):
        say("data.gaps", n="1")
    with pytest.raises(KeyError):
        say("no.such")
