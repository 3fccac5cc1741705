"""Pages in another language: no sentence is missing or left in English, and numbers and dates follow."""

from __future__ import annotations

import json
import os
import re
import shutil
import string
import subprocess
import sys
import tomllib
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest
from markupsafe import escape
from report import sample_sections as sections
from report import sample_weeks as weeks

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.pages.json_and_csv import to_json
from vsd_analytics.report.pages.mail import make_mail
from vsd_analytics.report.pages.story import finish, story_of
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.resources import DEFAULT_LANGUAGE, LANGUAGES
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import catalogue, say
from vsd_analytics.wording.languages import speaking, tag_of

REPOSITORY = Path(__file__).parents[2]
OTHERS = [language for language in LANGUAGES if language != DEFAULT_LANGUAGE]
ENGLISH = re.compile(
    r"\b(the|and|violations?|hours?|week|weeks|camera|cameras|since|between|likely|fewer|more|than|people|with|data)\b"
)
"""Words that no Italian sentence has."""


def sentences(language: str) -> dict[str, str]:
    """Return every sentence, plural forms each under its own key: those that English has."""
    found = {}
    for key, entry in catalogue(language).items():
        forms = (
            {"": entry}
            if isinstance(entry, str)
            else {f"#{form}": text for form, text in entry.items() if form in ("one", "other")}
        )
        found |= {f"{key}{form}": text for form, text in forms.items()}
    return found


def places(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name is not None}


def planted(report: WeekReport) -> list[str]:
    """Return the texts that a report by hand holds as such: names, the log, reasons without a code; longest first."""

    def leaves(value: object) -> list[str]:
        if isinstance(value, dict):
            return [text for inner in value.values() for text in leaves(inner)]
        if isinstance(value, list):
            return [text for inner in value for text in leaves(inner)]
        return [value] if isinstance(value, str) else []

    texts = {text.rstrip(".") for text in leaves(json.loads(to_json(replace(report, story=None)))) if len(text) > 3}
    return sorted(texts | {text[:1].upper() + text[1:] for text in texts}, key=lambda text: (-len(text), text))


def in_language(report: WeekReport, language: str) -> WeekReport:
    """Return a report by hand as if it had been made in a language: its sentences are made anew."""
    provenance = replace(report.provenance, language=language)
    return replace(report, provenance=provenance, story=None)


def test_every_language_has_a_catalogue_and_a_tag() -> None:
    assert LANGUAGES == ("en", "it")
    assert [tag_of(language) for language in LANGUAGES] == ["en-GB", "it-IT"]


def one_file(english: str) -> str:
    """Return the file of a language with more plural forms than English has, its other sentences left in English."""
    days = 'days = { one = "{n} dzień", few = "{n} dni", many = "{n} dni wiele", other = "{n} dnia" }'
    text = english.replace('tag = "en-GB"', 'tag = "pl-PL"').replace(
        'days = { one = "one day", other = "{n} days" }', days
    )
    assert days in text
    assert "pl-PL" in text
    words = tomllib.loads((REPOSITORY / "reports/wording/figures.toml").read_text(encoding="utf-8"))
    for metric, parts in words.items():
        own = (f"{part} = {json.dumps('pl ' + said['en'])}" for part, said in parts.items())
        text += "\n".join((f"\n[figures.{metric}]", *own, ""))
    return text


A_PAGE = """
from report import sample_weeks as weeks
from dataclasses import replace
from vsd_analytics.report.pages.week import render_html
from vsd_analytics.resources import LANGUAGES
from vsd_analytics.wording.catalogue import catalogue, say
from vsd_analytics.wording.languages import separated, speaking
import json, sys
with speaking("pl"):
    report = weeks.normal()
    report = replace(report, provenance=replace(report.provenance, language="pl"), story=None)
    days = [say("format.days", plural=n, n=n) for n in (1, 2, 5, 22, 25)]
    print(json.dumps([LANGUAGES, days, separated("1,234.5"), render_html(report), catalogue("pl")["reason.unit.M0"]]))
"""


def test_a_further_language_is_one_file_with_the_plural_forms_it_has(tmp_path: Path) -> None:
    for folder in ("vsd_analytics", "sql", "reports"):
        shutil.copytree(REPOSITORY / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    english = (tmp_path / "reports/wording/en.toml").read_text(encoding="utf-8")
    (tmp_path / "reports/wording/pl.toml").write_text(one_file(english), encoding="utf-8")
    path = os.pathsep.join(map(str, (tmp_path, REPOSITORY / "tests")))
    done = subprocess.run(
        [sys.executable, "-c", A_PAGE], env={**os.environ, "PYTHONPATH": path}, cwd=tmp_path,
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    languages, days, number, page, unit = json.loads(done.stdout)
    assert languages == ["en", "it", "pl"]
    assert days == ["1 dzień", "2 dni", "5 dni wiele", "22 dni", "25 dni wiele"]
    assert number == "1\N{NO-BREAK SPACE}234,5"
    assert '<html lang="pl-PL">' in page
    assert "listopada" in page  # the month of the sample, as CLDR writes it
    assert unit == "pl violations per open hour"


@pytest.mark.parametrize("language", OTHERS)
def test_no_sentence_is_missing_and_none_is_left_over(language: str) -> None:
    ours, english = sentences(language).keys(), sentences(DEFAULT_LANGUAGE).keys()
    assert sorted(english - ours) == [], f"{language}.toml or figures.toml of reports/wording lacks these"
    assert sorted(ours - english) == [], f"only {language} has these: add the English sentence, or delete them"


@pytest.mark.parametrize("language", OTHERS)
def test_a_translation_names_no_place_that_is_not_filled(language: str) -> None:
    english = sentences(DEFAULT_LANGUAGE)
    wrong = {key: text for key, text in sentences(language).items() if not places(text) <= places(english[key])}
    assert wrong == {}


@pytest.mark.parametrize("language", OTHERS)
def test_a_translation_joins_to_its_neighbours_as_the_english_does(language: str) -> None:
    """Sentences are joined: their spaces at both ends must be those of the English ones."""

    def ends(text: str) -> tuple[str, str]:
        return text[: len(text) - len(text.lstrip())], text[len(text.rstrip()) :]

    english = sentences(DEFAULT_LANGUAGE)
    assert [key for key, text in sentences(language).items() if ends(text) != ends(english[key])] == []


def said(text: str) -> str:
    """Return a sentence without its places and commands."""
    return re.sub(r"`[^`]*`|{[^}]*}|\[\[\w+\]\]", "", text)


@pytest.mark.parametrize("language", OTHERS)
def test_no_sentence_is_left_in_english(language: str) -> None:
    left = {key: text for key, text in sentences(language).items() if ENGLISH.search(said(text))}
    assert left == {}


@pytest.mark.parametrize("language", OTHERS)
def test_a_sentence_that_says_something_differs_from_the_english(language: str) -> None:
    english = sentences(DEFAULT_LANGUAGE)
    translated = sentences(language).items()
    same = [key for key, text in translated if text == english[key] and re.search(r"[a-z]{4}", said(text))]
    assert len(same) <= 12, same


WEEKS: list[Callable[[], WeekReport]] = [
    *(weeks.normal, weeks.no_data, weeks.too_incomplete, weeks.first_week, weeks.empty, weeks.settings_changed),
    *(sections.complete, sections.with_tested_spots, sections.refused),
]


@pytest.mark.parametrize("language", OTHERS)
@pytest.mark.parametrize("week", WEEKS, ids=lambda w: w.__name__)
def test_a_page_is_written_in_its_language_alone(week: Callable[[], WeekReport], language: str) -> None:
    with speaking(language):
        page = render_html(in_language(week(), language))
    assert f'<html lang="{tag_of(language)}">' in page
    seen = re.sub(r"<(style|code)\b.*?</\1>|<[^>]+>", " ", page, flags=re.DOTALL)
    with speaking(language):
        headline = story_of(in_language(week(), language)).headline
    assert headline in page or headline.replace("’", "&#39;") in page
    assert 'counter(page) " of "' not in page
    for text in planted(week()):
        seen = seen.replace(str(escape(text)), " ")
    assert ENGLISH.findall(seen) == []


def test_numbers_days_and_dates_follow_the_language() -> None:
    day = date(2026, 11, 9)
    assert (fmt.number(1234.4), fmt.number(4.21), fmt.date_long(day)) == ("1,234", "4.2", "Monday 9 November 2026")
    with speaking("it"):
        assert (fmt.number(1234.4), fmt.number(4.21)) == ("1.234", "4,2")
        assert fmt.date_long(day) == "lunedì 9 novembre 2026"
        assert fmt.date_short(day) == "lun 9 nov"
        assert fmt.percent(0.927) == "93%"
        assert fmt.metres(1.83) == "1,83 m"


def test_a_block_in_a_language_leaves_the_one_before() -> None:
    english = say("words.clear_fall")
    with speaking("it"):
        assert say("words.clear_fall") != english
        with speaking(None):
            assert say("words.clear_fall") != english
    assert say("words.clear_fall") == english
    with pytest.raises(KeyError), speaking("xx"):
        pass


@pytest.mark.parametrize("language", OTHERS)
def test_a_mail_is_written_in_the_language_of_its_report(language: str) -> None:
    with speaking(language):
        report = finish(in_language(weeks.normal(), language))
    mail = make_mail(report)
    body = mail.get_body(preferencelist=("plain",))
    assert body is not None
    text = re.sub(r"\s+", " ", body.get_content())
    for name in planted(weeks.normal()):
        text = text.replace(name, " ")
    assert ENGLISH.findall(text) == []
    assert mail["Subject"].endswith(report.story.headline if report.story else "")
