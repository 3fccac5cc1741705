"""The words of every branch are as in golden/; `python tests/report/story/golden_cases.py` writes them anew."""

from __future__ import annotations

import pytest
from forbidden_words import forbidden_in
from report.story.golden_cases import CASES, FOLDER, text_of

from vsd_analytics.report.pages.headline import MAX_WORDS
from vsd_analytics.report.pages.story import story_of
from vsd_analytics.wording import terms


@pytest.mark.parametrize("name", list(CASES))
def test_a_branch_says_what_it_said(name: str) -> None:
    assert text_of(CASES[name]()) == (FOLDER / f"{name}.txt").read_text(encoding="utf-8")


def test_no_fragment_is_left_of_a_case_that_is_gone() -> None:
    assert {p.stem for p in FOLDER.glob("*.txt")} == set(CASES)


@pytest.mark.parametrize("name", list(CASES))
def test_a_headline_has_at_most_fifteen_words_and_no_unfilled_place(name: str) -> None:
    text = text_of(CASES[name]())
    assert terms.n_words(story_of(CASES[name]()).headline) <= MAX_WORDS
    assert forbidden_in(text) == []
    for slip in ("{", "}", "  ", " .", " ,", "..", "None", "()", "–"):
        assert slip not in text, slip


def test_no_two_branches_share_their_headline_and_lead_by_accident() -> None:
    said = {name: text_of(case()) for name, case in CASES.items()}
    assert len({story_of(CASES[n]()).rule for n in said}) >= 30
