"""The first part of docs/statistics.md says what the tables behind it say."""

from __future__ import annotations

import re

import charts
import pytest
from markdown_pages import REPOSITORY

PAGE = (REPOSITORY / "docs" / "statistics.md").read_text(encoding="utf-8")
FOR_READERS, TABLES = PAGE.split("## Methods and tables")
ROWS = charts.rows_of(TABLES)


@pytest.mark.parametrize("name", charts.CHARTS)
def test_a_chart_is_drawn_from_rows_that_exist_and_shown_on_the_page(name: str) -> None:
    assert charts.drawn(name).startswith(b"<?xml")
    assert f"(images/{name}.svg)" in FOR_READERS
    assert (REPOSITORY / "docs" / "images" / f"{name}.svg").is_file()


def test_the_powers_on_the_page_are_those_of_the_table() -> None:
    office, museum = (
        charts.number(charts.row(ROWS, f"power for -30 % in one week, 12 weeks of history: {site}")[4])
        for site in ("office", "museum")
    )
    assert office is not None
    assert museum is not None
    assert f"in {office:.0f} of\n100 cases" in FOR_READERS
    assert "sees it in one of eight" in FOR_READERS
    assert 1 / 8.5 < museum / 100 < 1 / 7.5


def test_the_elasticities_on_the_page_are_those_of_the_table() -> None:
    for name in ("M6 share of time too close", "M7 violations per person-hour"):
        value, between = charts.row(ROWS, name)[1:3]
        assert f"{value}, likely between {between.replace(' to ', ' and ')}" in FOR_READERS.replace("\n", " ")


def test_the_first_part_takes_five_minutes_and_defines_its_terms() -> None:
    words = re.findall(r"\w+", re.sub(r"\(images/[^)]*\)", "", FOR_READERS))
    assert len(words) <= 1_100  # 220 a minute
    for term in ("violation", "How often", "Time too close", "likely range", "running verdict", "net effect"):
        assert f"**{term}**" in FOR_READERS, term
