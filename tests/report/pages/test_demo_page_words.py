"""The demo's weekly page: at most 900 visible words, and its question within the first screen of a phone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from vsd_analytics.cli import cli
from vsd_analytics.config import load_site
from vsd_analytics.simulate import write_demo_project
from vsd_analytics.simulate.demo import ingest_demo
from vsd_analytics.site.model import LANGUAGES

pytestmark = pytest.mark.browser

MOST = 900
PHONE = {"width": 390, "height": 844}
WORDS = r"""() => {
    document.querySelectorAll(".vh, .skip").forEach(e => e.remove());
    return document.body.innerText.split(/\s+/).filter(w => /\p{L}{2,}/u.test(w)).length;
}"""
"""Words of two letters or more that a reader sees before opening anything, those of drawings too."""


@pytest.fixture(scope="module", params=[2, 12], ids=["two weeks", "twelve weeks"])
def demo_of_weeks(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a demo project with this many weeks, stored."""
    root = tmp_path_factory.mktemp("demo") / "vsd-demo"
    write_demo_project(root, seed=4, weeks=request.param)
    ingest_demo(load_site(root), sorted((root / "engine").iterdir()), seed=4)
    return root


def pages(root: Path, out: Path) -> Iterator[str]:
    """Yield the address of the last week's page in each language."""
    for language in LANGUAGES:
        words = ["report", "--week", "2026-W46", "--language", language, "--out", str(out / language)]
        made = CliRunner().invoke(cli, ["-C", str(root), "--quiet", *words])
        assert made.exit_code == 0, made.output
        yield (out / language / "2026-W46.html").as_uri()


def check(browser: Any, address: str) -> None:
    for viewport in ({"width": 1280, "height": 900}, PHONE):
        page = browser.new_page(viewport=viewport)
        page.goto(address)
        question = page.evaluate("document.querySelector('.ask').getBoundingClientRect().bottom")
        n_words = page.evaluate(WORDS)
        page.close()
        assert 400 < n_words <= MOST, (address, viewport)
        assert question <= viewport["height"], (address, viewport)


def test_the_page_of_a_first_week_is_short_and_asks_on_the_first_screen(
    browser: Any, demo_project: Path, tmp_path: Path
) -> None:
    asked = demo_project / "questions.jsonl"
    before = asked.read_bytes() if asked.exists() else None
    for address in pages(demo_project, tmp_path):
        check(browser, address)
    if before is None:  # the project is shared: tests leave it as it is
        asked.unlink(missing_ok=True)
    else:
        asked.write_bytes(before)


def test_the_page_of_two_and_of_twelve_weeks_is_short_and_asks_on_the_first_screen(
    browser: Any, demo_of_weeks: Path, tmp_path: Path
) -> None:
    for address in pages(demo_of_weeks, tmp_path):
        check(browser, address)
