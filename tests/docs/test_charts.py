"""The first part of docs/statistics.md says what the tables of docs/methods/ say."""

from __future__ import annotations

import re

import charts
import pytest
from markdown_pages import REPOSITORY

PAGE = (REPOSITORY / "docs" / "statistics.md").read_text(encoding="utf-8")
FOR_READERS, _ = PAGE.split("## Methods and tables")
ROWS = charts.rows_of(charts.tables())
LINE = " ".join(FOR_READERS.split())


@pytest.mark.parametrize("name", charts.CHARTS)
def test_a_chart_is_drawn_from_rows_that_exist_and_shown_on_the_page(name: str) -> None:
    assert charts.drawn(name).startswith(b"<?xml")
    assert f"(images/{name}.svg)" in FOR_READERS
    assert (REPOSITORY / "docs" / "images" / f"{name}.svg").is_file()


def test_the_powers_on_the_page_are_those_of_the_table() -> None:
    office, first, museum = (
        charts.number(charts.row(ROWS, f"power for -30 % in one week, {world}")[4])
        for world in ("12 weeks of history: office", "0 weeks of history: office", "12 weeks of history: museum")
    )
    assert f"in {office:.0f} of 100 cases" in LINE
    assert f"in {first:.0f} while there are none" in LINE
    assert f"museum gets it in only {museum:.0f}:" in LINE


def test_the_score_of_groups_is_that_of_scenes_left_out() -> None:
    scenes = ("seq_eth", "seq_hotel", "zara01")
    cells = [r[2] for r in ROWS if r[0] in scenes and len(r) == 4 and r[1].startswith("near")]
    scores = [score for cell in cells if (score := charts.number(cell)) is not None]
    assert len(scores) == 3
    low, high = min(scores), max(scores)
    assert f"was {low:.2f} to {high:.2f}" in LINE


def test_the_first_part_is_short_and_defines_its_terms() -> None:
    words = re.findall(r"[\w'.,%-]+", re.sub(r"\(images/[^)]*\)", "", FOR_READERS))
    assert len(words) <= 1_020  # five minutes at 200 a minute, pictures not included
    for term in ("violation", "How often", "Time too close", "likely range", "running verdict", "net effect"):
        assert f"**{term}**" in FOR_READERS, term
    for jargon in ("elasticity", "F1", "square root", "M6", "M0", "interval", "correlat", "confidence"):
        assert jargon not in FOR_READERS, jargon


def test_the_false_verdicts_and_weeks_on_the_page_are_those_of_the_tables() -> None:
    level = charts.number(charts.row(ROWS, "level of M0 holds the mean of many weeks: museum")[4])
    named = re.search(r"named in (\d+)%", charts.row(ROWS, "running verdict, 8 weeks", "trend -2 % a week")[5])
    assert f"museum's ranges, {level:.0f} of 100 hold" in LINE
    assert named
    assert f"warns of it in {named[1]} of 100" in LINE
    same = charts.number(charts.row(ROWS, '"about the same" when nothing changes: office')[4])
    largest = charts.number(charts.row(ROWS, "power for the largest area, M0, all areas fall by 30 %: office")[4])
    weeks = re.search(r"\((\d+) to (\d+)\)", charts.row(ROWS, "museum", "-30%")[3])
    assert f"gets it in {same:.0f} of 100 weeks" in LINE
    assert f"its largest area gets it in {largest:.0f}." in LINE
    assert weeks
    assert f"museums need {weeks[1]} to {weeks[2]} weeks for 30 %" in LINE


def test_the_scores_of_simulated_cameras_are_those_of_their_table() -> None:
    scores = [charts.number(r[4].strip("*")) for r in ROWS if r[0].startswith("cam-") and "frames/s" in r[1]]
    assert len(scores) == 8
    assert f"{min(scores):.2f} to {max(scores):.2f} on simulated shop cameras" in LINE
