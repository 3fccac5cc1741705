"""The glossary's terms are used, and words that puzzled readers stay out of pages, help and messages."""

from __future__ import annotations

import re
from pathlib import Path

import click
import generate_reference as reference
import pytest
from markdown_pages import REPOSITORY

from vsd_analytics.cli import explanations
from vsd_analytics.settings import SETTINGS

DOCS = REPOSITORY / "docs"
FROM_SQL = {"relations.md", "figures.md"}  # made from the headers of the SQL files, and named like them
PAGES = sorted(
    [
        REPOSITORY / "README.md",
        REPOSITORY / "CONTRIBUTING.md",
        *(p for p in DOCS.glob("*.md") if p.name not in FROM_SQL),
    ]
)

BANNED = {
    r"told": "reported, printed, shown",
    r"kept": "stored, saved, left",
    r"mend(?:s|ed|ing)?": "fix",
    r"taken apart": "separated, split",
    r"leftovers?": "superseded, remaining",
    r"twins?": "JSON file",
    r"fives": "small counts",
    r"hills?": "watershed, peak",
    r"(?<!\w)(?<!people )(?<!person )(?<!pair )(?<!who )(?<!whoever )(?<!they )(?<!group )(?<!both )(?<!crowd that )"
    r"stands": "is, lies; of people it may be used",
}
"""Word, as a pattern, and what to write instead."""

SEARCH = re.compile("|".join(rf"\b(?:{word})\b" for word in BANNED), re.I)


def banned_in(text: str) -> list[str]:
    """Return the banned words of a text, with a few words around each; code between backticks may say anything."""
    text = re.sub(r"^```.*?^```$|`[^`\n]*`|\]\([^)]*\)", " ", text, flags=re.M | re.S)
    return [text[max(0, m.start() - 30) : m.end() + 30].replace("\n", " ") for m in SEARCH.finditer(text)]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_pages_use_plain_words(page: Path) -> None:
    assert banned_in(page.read_text(encoding="utf-8")) == []


def test_help_and_explanations_use_plain_words() -> None:
    texts = {name: command.help or "" for name, command in reference.every_command()}
    for name, command in reference.every_command():
        texts |= {f"{name} {p.name}": p.help or "" for p in command.params if isinstance(p, click.Option)}
    texts |= explanations.EXPLANATIONS
    texts |= {s.name: s.help for s in SETTINGS}
    assert {where: found for where, text in texts.items() if (found := banned_in(text))} == {}


@pytest.mark.parametrize("text", ["What stands in truth.json", "a kept file", "Told are both", "its JSON twin"])
def test_banned_words_are_found(text: str) -> None:
    assert banned_in(text)


def test_people_may_stand_and_code_may_say_anything() -> None:
    assert banned_in("whoever stands there; `kept` in the header") == []


def test_every_term_of_the_glossary_is_used() -> None:
    page = (DOCS / "glossary.md").read_text(encoding="utf-8")
    terms = [t.lower() for t in re.findall(r"\*\*([^*]+)\*\*", page)]
    texts = [p.read_text(encoding="utf-8") for p in DOCS.glob("*.md") if p.name != "glossary.md"]
    texts += [p.read_text(encoding="utf-8") for folder in ("vsd_analytics", "sql") for p in sources(folder)]
    everything = " ".join(re.sub(r"[\s_-]+|\s*\n\s*(?:--|#)?\s*", " ", text.lower()) for text in texts)
    assert len(terms) > 40
    assert len(terms) == len(set(terms))
    assert [t for t in terms if re.sub(r"[\s_-]+", " ", t) not in everything] == []


def sources(folder: str) -> list[Path]:
    return [p for p in (REPOSITORY / folder).rglob("*") if p.suffix in (".py", ".sql")]
