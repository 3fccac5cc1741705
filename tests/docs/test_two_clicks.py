"""Twenty tasks of newcomers: each is at most two clicks from the first page, under a heading that has its words."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from markdown_pages import REPOSITORY, anchors, links

DOCS = REPOSITORY / "docs"
TASKS = {
    "install the program": ("install.md", "As a service"),
    "a first report": ("tutorial.md", "6. The report"),
    "opening hours": ("guide.md", "Opening hours"),
    "a file that is refused": ("refused.md", "What is seen"),
    "a CSV file": ("formats.md", "positions: tables of positions"),
    "a video": ("detectors.md", "From the video to the page"),
    "an IP camera": ("live.md", "Live cameras"),
    "overlapping cameras": ("several-cameras.md", "Nobody is counted twice"),
    "a replaced camera": ("camera-life.md", "A new device at the same place"),
    "how often verdicts are wrong": ("statistics.md", "How often we are wrong"),
    "whether a change worked": ("changes.md", "Compare"),
    "an experiment": ("changes.md", "Days with and without it in turn"),
    "a queue": ("space.md", "How many wait, how long, and how full it is"),
    "staff": ("space.md", "Staff apart from visitors"),
    "a weekly mail": ("mail.md", "Every Monday"),
    "a timer": ("timers.md", "Steps"),
    "backup": ("backup.md", "Back up"),
    "restore": ("backup.md", "Restore"),
    "erasure": ("erasure.md", "What it does not reach"),
    "Excel": ("tools.md", "Excel"),
    "a gap in the records": ("figures.md", "Hour states"),
    "what a word means": ("glossary.md", "Glossary"),
}


def reached(n_clicks: int) -> set[Path]:
    """Return the pages that so many links lead to, from the first page."""
    pages = {DOCS / "index.md"}
    for _ in range(n_clicks):
        pages |= {
            (page.parent / link.partition("#")[0]).resolve() for page in pages for link in links(page) if ".md" in link
        }
    return pages


@pytest.mark.parametrize("task", TASKS)
def test_a_task_is_one_click_away_and_has_a_heading(task: str) -> None:
    name, heading = TASKS[task]
    assert DOCS / name in reached(1)
    assert re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") in anchors(DOCS / name)


def test_every_page_is_at_most_two_clicks_away() -> None:
    lost = {page.name for page in DOCS.rglob("*.md")} - {page.name for page in reached(2)}
    assert lost == set()


def test_a_page_that_nobody_links_to_would_be_found() -> None:
    assert DOCS / "methods" / "atc.md" not in reached(1)
    assert DOCS / "methods" / "atc.md" in reached(2)
