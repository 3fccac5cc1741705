"""`vsd explain WORDS` and the assistant's `explain`: the page that answers a newcomer's words comes first."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.cli.explain import explanations
from vsd_analytics.wording.manual import Manual, Section, sections_of

MANUAL = Manual(explanations())


@pytest.mark.parametrize(
    ("words", "pages"),
    [
        ("opening hours", {"guide"}),
        ("how do I back up", {"backup"}),
        ("how do I replace a camera", {"camera-life"}),
        ("erase a person", {"erasure"}),
        ("mail every monday", {"mail"}),
        ("video", {"detectors"}),
        ("install", {"install"}),
        ("who is staff", {"settings", "space", "glossary"}),
        ("distance_m", {"settings"}),
        ("alarm", {"alarms"}),
        ("M41", {"figures"}),
        ("what does W230 mean", {"explain"}),
        ("counting lines", {"lines", "guide", "relations"}),
        ("notebook pandas", {"python"}),
        ("what is a violation", {"glossary", "figures"}),
    ],
)
def test_the_first_section_is_on_the_page_that_answers(words: str, pages: set[str]) -> None:
    first, *_ = MANUAL.search(words, most=3)
    assert first.page in pages, first


@given(st.text(max_size=60))
def test_words_are_words_and_no_query(words: str) -> None:
    assert len(MANUAL.search(words, most=2)) <= 2


def test_each_code_has_one_section_whole() -> None:
    for code, text in explanations().items():
        assert MANUAL.search(code.lower(), most=5) == [Section("explain", code, text)]


def test_a_section_ends_at_the_next_heading_and_a_comment_in_code_is_no_heading() -> None:
    page = "# Timers\n\n[Layout](x.md)\n\n## Steps\n```\n# as root\nvsd report\n```\n## Empty\n\n## Last\n\nEnd."
    assert list(sections_of("timers", page)) == [
        Section("timers", "Timers", "Layout"),
        Section("timers", "Steps", "```\n# as root\nvsd report\n```"),
        Section("timers", "Last", "End."),
    ]
