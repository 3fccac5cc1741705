"""The manual: the pages of `docs/` and what each message means, found by words."""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Final, NamedTuple

from vsd_analytics.resources import shipped

_HEADING = re.compile(r"^(#{1,4}) +(.+?) *$")
_PAGES_OF_TERMS: Final = ("figures", "glossary", "settings")
_TERM = re.compile(r"^\| (M\d+ \| [^|]+?|\*\*[^|]+?\*\*|`\w+`) \| (.+) \|$")
"""A row of these pages explains a figure, a term or a setting: each is looked up alone."""
_LINK = re.compile(r"\[([^]]+)\]\([^)]+\)")
_RANK: Final = (
    "bm25(sections, 3.0, 5.0, 1.0) * case when page like 'methods/%' or page = 'internal' then 0.5 else 1 end"
)
"""A word in the title of a page or in a heading says more than one in the text; proofs and inner tables come last."""
_LITTLE_WORDS: Final = re.compile(
    "a|an|and|are|be|can|do|does|for|from|has|have|how|i|if|in|is|it|mean|means|my|of|on|or|the|there|this|to|we|what|"
    "when|where|which|who|why|will|with|you"
)


class Section(NamedTuple):
    """A part of the manual.

    Attributes:
        page: Name of the page, such as "timers", without `.md`; "explain" for what a message means.
        heading: Its heading, or the code of the message.
        text: Markdown without link addresses.
    """

    page: str
    heading: str
    text: str


class Manual:
    """What can be looked up without a network.

    Args:
        explanations: What each message means, by code.
    """

    def __init__(self, explanations: Mapping[str, str]) -> None:
        self._explanations = explanations

    def search(self, words: str, *, most: int) -> list[Section]:
        """Return the sections that say most about some words, the best first; a code has one of its own.

        A section with these words as its heading is first. All others rank by BM25 of SQLite's full-text search over
        stems of English words; a section needs any of the words.

        Args:
            words: A code such as "E201", or words.
            most: Sections returned.
        """
        every = re.findall(r"\w+", words.lower())
        codes = [word.upper() for word in every if word.upper() in self._explanations]
        if codes:
            return [Section("explain", code, self._explanations[code]) for code in dict.fromkeys(codes[:most])]
        telling = [word for word in every if not _LITTLE_WORDS.fullmatch(word)] or every
        if not telling:
            return []
        asked, term = " OR ".join(f'"{word}"' for word in telling), " ".join(telling)
        query = (
            "select page, heading, body from sections where sections match ? "
            f"order by lower(heading) in (?, ?) desc, {_RANK}, rowid limit ?"
        )
        return [Section(*row) for row in self._index.execute(query, (asked, term, f"{term}s", most))]

    @cached_property
    def _index(self) -> sqlite3.Connection:
        con = sqlite3.connect(":memory:", check_same_thread=False)
        con.execute("create virtual table sections using fts5(page, heading, body, tokenize = 'porter unicode61')")
        con.executemany("insert into sections values (?, ?, ?)", self._sections())
        return con

    def _sections(self) -> Iterator[Section]:
        for code, text in self._explanations.items():
            yield Section("explain", code, text)
        folder = shipped("docs")
        for path in sorted(folder.rglob("*.md")):
            yield from sections_of(str(path.relative_to(folder).with_suffix("")), path.read_text(encoding="utf-8"))


def sections_of(page: str, text: str) -> Iterator[Section]:
    """Yield the sections of a page that have a text, heading by heading; a `#` within a code block is no heading."""
    heading, lines, is_code = page, list[str](), False
    for line in [*text.splitlines(), "# end"]:
        is_code ^= line.lstrip().startswith("```")
        if page in _PAGES_OF_TERMS and (term := _TERM.match(line)) is not None:
            yield Section(page, re.sub(r" \||[*`]", "", term.group(1)), _LINK.sub(r"\1", term.group(2)))
            continue
        match = None if is_code else _HEADING.match(line)
        if match is None:
            lines.append(line)
            continue
        if body := "\n".join(lines).strip():
            yield Section(page, heading, _LINK.sub(r"\1", body))
        heading, lines = _LINK.sub(r"\1", match.group(2)), []
