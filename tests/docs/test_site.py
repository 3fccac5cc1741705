"""The documentation as a site: every page is in its navigation, and it builds without a warning or a network."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import site_links
from markdown_pages import REPOSITORY


def test_the_navigation_names_every_page_once() -> None:
    nav = (REPOSITORY / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")[2]
    named = re.findall(r": (\S+\.md)$", nav, re.M)
    pages = {path.relative_to(REPOSITORY / "docs").as_posix() for path in (REPOSITORY / "docs").rglob("*.md")}
    assert sorted(named) == sorted(pages)


class _File:
    src_uri = "figures.md"


class _Page:
    file = _File()


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        ("see [hours](../sql/marts/hours.sql).", "see hours (`sql/marts/hours.sql`)."),
        ("see [sql/marts/hours.sql](../sql/marts/hours.sql).", "see sql/marts/hours.sql."),
        ("see [Python](python.md#first-example)", "see [Python](python.md#first-example)"),
    ],
)
def test_a_link_out_of_the_pages_names_its_file(given: str, shown: str) -> None:
    assert site_links.on_page_markdown(given, page=_Page()) == shown


def test_the_site_builds_without_a_warning_and_loads_nothing_from_elsewhere(tmp_path: Path) -> None:
    for needed in ("material", "mkdocstrings"):
        pytest.importorskip(needed, reason="the extra docs is not installed")
    out = tmp_path / "site"
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(out)]
    environ = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, capture_output=True, text=True, cwd=REPOSITORY, env=environ, check=False)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    for page in out.glob("*.html"):
        html = page.read_text(encoding="utf-8")
        assert not re.search(r'<(?:script|img|link)[^>]+(?:src|href)="(?:https?:)?//', html), page.name
