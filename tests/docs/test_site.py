"""The documentation as a site: every page is in its navigation, and it builds without a warning or a network."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import site_pages
from markdown_pages import REPOSITORY


def test_the_navigation_names_every_page_once() -> None:
    nav = (REPOSITORY / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")[2]
    named = re.findall(r": (\S+\.md)$", nav, re.M)
    pages = {path.relative_to(REPOSITORY / "docs").as_posix() for path in (REPOSITORY / "docs").rglob("*.md")}
    assert sorted(named) == sorted(pages)


class _File:
    def __init__(self, src_uri: str) -> None:
        self.src_uri = src_uri


class _Page:
    def __init__(self, src_uri: str = "figures.md") -> None:
        self.file = _File(src_uri)
        self.meta: dict[str, object] = {}


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        ("see [hours](../sql/marts/hours.sql).", "see hours (`sql/marts/hours.sql`)."),
        ("see [sql/marts/hours.sql](../sql/marts/hours.sql).", "see sql/marts/hours.sql."),
        ("see [Python](python.md#first-example)", "see [Python](python.md#first-example)"),
    ],
)
def test_a_link_out_of_the_pages_names_its_file(given: str, shown: str) -> None:
    assert site_pages.on_page_markdown(given, page=_Page()) == shown


def test_proofs_come_after_what_people_do_in_the_search() -> None:
    for name, rank in (("methods/imports.md", {"search": {"boost": site_pages.PROOF_RANK}}), ("guide.md", {})):
        page = _Page(name)
        site_pages.on_page_markdown("text", page=page)
        assert page.meta == rank


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of the site, built as `make site` does."""
    for needed in ("material", "mkdocstrings"):
        pytest.importorskip(needed, reason="the extra docs is not installed")
    out = tmp_path_factory.mktemp("docs") / "site"
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(out)]
    environ = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, capture_output=True, text=True, cwd=REPOSITORY, env=environ, check=False)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return out


def test_the_site_loads_nothing_from_elsewhere(site: Path) -> None:
    for page in site.rglob("*.html"):
        html = page.read_text(encoding="utf-8")
        assert not re.search(r'<(?:script|img|link)[^>]+(?:src|href)="(?:https?:)?//', html), page.name


@pytest.mark.browser
def test_a_page_opened_from_its_folder_searches_without_a_server(site: Path, tab: Callable[..., Any]) -> None:
    page = tab((site / "index.html").as_uri())
    page.keyboard.press("s")
    page.wait_for_selector("input[name=query]:focus")
    page.keyboard.type("opening hours")
    page.wait_for_selector(".md-search-result__link", state="attached")
    first = page.locator(".md-search-result__link").first.get_attribute("href")
    assert first is not None
    assert "/methods/" not in first
    assert all(address.startswith(("file:", "about:", "data:")) for address in page.seen)
