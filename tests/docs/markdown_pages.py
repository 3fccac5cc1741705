"""Reads the Markdown pages: their blocks of code, commands and links."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
PAGES = sorted([REPOSITORY / "README.md", REPOSITORY / "CHANGELOG.md", *(REPOSITORY / "docs").rglob("*.md")])

_BLOCK = re.compile(r"(?:<!-- (?P<mark>[^>]*?) -->\n)?^```(?P<language>\w*)\n(?P<text>.*?)^```$", re.M | re.S)
_INLINE = re.compile(r"(?<!`)`(vsd(?: [^`]*)?)`(?!`)")
_LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)|<img[^>]*src=\"([^\"]+)\"")


@dataclass(frozen=True, slots=True)
class Block:
    """One fenced block: the comment before it, its language, its text and its chapter (`##`)."""

    mark: str
    language: str
    text: str
    chapter: str


def blocks(page: Path) -> Iterator[Block]:
    """Yield the fenced blocks of a page in order."""
    text = page.read_text(encoding="utf-8")
    for found in _BLOCK.finditer(text):
        chapter = re.findall(r"^## (.+)$", text[: found.start()], re.M)
        yield Block(found["mark"] or "", found["language"], found["text"], chapter[-1] if chapter else "")


def commands(page: Path) -> list[list[str]]:
    """Return the words of every `vsd` command a page shows, in blocks and in running text."""
    lines = []
    for block in blocks(page):
        if block.language in ("", "console", "sh"):
            joined = block.text.replace("\\\n", " ")
            lines += [part for line in joined.split("\n") for part in line.removeprefix("$ ").split(" && ")]
    lines += _INLINE.findall(_BLOCK.sub("", page.read_text(encoding="utf-8")))
    return [shlex.split(line, comments=True) for line in lines if re.match(r"vsd(\s|$)", line.strip())]


def links(page: Path) -> list[str]:
    """Return the relative targets a page links to, without external addresses."""
    found = (a or b for a, b in _LINK.findall(_BLOCK.sub("", page.read_text(encoding="utf-8"))))
    return [target for target in found if not re.match(r"[a-z]+:", target)]


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    text = _BLOCK.sub("", page.read_text(encoding="utf-8"))
    titles = re.findall(r"^#+ (.+)$", text, re.M)
    return {re.sub(r"[^\w\- ]", "", t.lower()).replace(" ", "-") for t in titles}
