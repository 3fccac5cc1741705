"""The glossary's terms are used, and words that puzzled readers stay out of pages, help and messages."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path

import click
import generate_reference as reference
import pytest
from markdown_pages import REPOSITORY

from vsd_analytics.cli.explain import explanations
from vsd_analytics.settings import SETTINGS
from vsd_analytics.wording.catalogue import catalogue

DOCS = REPOSITORY / "docs"
FROM_SQL = {"relations.md", "internal.md", "figures.md"}  # made from the headers of the SQL files, and named like them
PAGES = sorted(
    [
        REPOSITORY / "README.md",
        REPOSITORY / "CONTRIBUTING.md",
        *(p for p in DOCS.rglob("*.md") if p.name not in FROM_SQL),
    ]
)

BANNED = {
    r"told": "reported, printed, shown",
    r"(?<!people )kept": "stored, saved, left; of people it may be used",
    r"mend(?:s|ed|ing)?": "fix",
    r"taken apart": "separated, split",
    r"leftovers?": "superseded, remaining",
    r"twins?": "JSON file",
    r"fives": "small counts",
    r"hills?": "watershed, peak",
    r"anew": "again, re-",
    r"leaves? the house": "is sent",
    r"week to come": "next week",
    r"of (?:which|whom) (?:nothing|none|no one|nobody)": "a sentence of its own",
    r"by the hand of": "by",
    r"(?:is|are) to be (?:had|expected|seen|found)": "is available, is expected",
    r"cannot be told|be told apart": "is unknown, cannot be separated",
    r"(?<![a-z,] )(?-i:Told|Counted|Listed|Given|Named|Left out|Compared|Asked) (?:is|are)": "The table lists ...",
    r"it is (?:what|that which)": "the noun itself",
    r"(?<!\w)(?<!people )(?<!person )(?<!pair )(?<!who )(?<!whoever )(?<!they )(?<!group )(?<!both )(?<!crowd that )"
    r"stands(?! out)": "is, lies; of people it may be used",
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
    texts |= explanations()
    texts |= {s.name: s.help for s in SETTINGS}
    assert {where: found for where, text in texts.items() if (found := banned_in(text))} == {}


NAMES = re.compile(r"^ +\w+(?:, \w+)*:(?= )", re.M)
"""Names of arguments and attributes in a docstring: code, not words."""


def docstrings_and_comments(source: str) -> Iterator[str]:
    """Yield the strings of a module that stand alone (docstrings, help of fields), then each block of comments."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.value.value
    yield from (t.string for t in tokenize.generate_tokens(io.StringIO(source).readline) if t.type == tokenize.COMMENT)


def test_docstrings_and_comments_use_plain_words() -> None:
    found = {}
    for path in (REPOSITORY / "vsd_analytics").rglob("*.py"):
        source = path.read_text(encoding="utf-8")
        if not SEARCH.search(" ".join(source.split())):  # to parse all of them takes three seconds
            continue
        texts = [NAMES.sub("", text) for text in docstrings_and_comments(source)]
        if bad := [slip for text in texts for slip in banned_in(" ".join(text.split()))]:
            found[str(path)] = bad
    assert found == {}


def test_headers_of_sql_files_use_plain_words() -> None:
    found = {}
    for path in (REPOSITORY / "sql").rglob("*.sql"):
        # comments below the header belong to the fingerprint of facts: a changed one makes every fact stale
        header = takewhile(lambda line: line.startswith("--"), path.read_text(encoding="utf-8").splitlines())
        prose = re.sub(r"^-- +(?!name|grain|reads|params)(\w+)  +", "", "\n".join(header), flags=re.M)
        if bad := banned_in(" ".join(prose.replace("-- ", "").split())):
            found[path.name] = bad
    assert found == {}


def test_the_wording_catalogue_uses_plain_words() -> None:
    forms = {k: [v] if isinstance(v, str) else list(v.values()) for k, v in catalogue().items()}
    later = ("headline.", "verdict.")  # these sentences change together with the rules that choose them
    found = {k: bad for k, v in forms.items() if not k.startswith(later) and (bad := banned_in(" ".join(v)))}
    assert found == {}


@pytest.mark.parametrize(
    "text",
    ["What stands in truth.json", "a kept file", "Told are both", "its JSON twin", "computed anew", "Listed are all"],
)
def test_banned_words_are_found(text: str) -> None:
    assert banned_in(text)


def test_people_may_stand_and_code_may_say_anything() -> None:
    assert banned_in("whoever stands there; `kept` in the header") == []


def test_every_term_of_the_glossary_is_used() -> None:
    page = (DOCS / "glossary.md").read_text(encoding="utf-8")
    terms = [t.lower() for t in re.findall(r"\*\*([^*]+)\*\*", page)]
    texts = [p.read_text(encoding="utf-8") for p in DOCS.rglob("*.md") if p.name != "glossary.md"]
    texts += [p.read_text(encoding="utf-8") for folder in ("vsd_analytics", "sql") for p in sources(folder)]
    everything = " ".join(re.sub(r"[\s_-]+|\s*\n\s*(?:--|#)?\s*", " ", text.lower()) for text in texts)
    assert len(terms) > 40
    assert len(terms) == len(set(terms))
    assert [t for t in terms if re.sub(r"[\s_-]+", " ", t) not in everything] == []


def sources(folder: str) -> list[Path]:
    return [p for p in (REPOSITORY / folder).rglob("*") if p.suffix in (".py", ".sql")]


ELSEWHERE = re.compile(
    r"\b(?:house plan|(?:report|design) brief|recipe [RJ]?\d+)\b|\(brief\b|(?<![\w.-])[RJ]\d{1,2}(?![\w.-])", re.I
)
"""References to papers that no reader of the project has."""
PUBLIC = [
    p
    for folder, kinds in (
        ("vsd_analytics", ("py", "toml")),
        ("sql", ("sql",)),
        ("reports", ("toml", "j2", "js", "css")),
        ("docs", ("md", "py")),
        ("tests", ("py",)),
    )
    for kind in kinds
    for p in sorted((REPOSITORY / folder).rglob(f"*.{kind}"))
    if p != Path(__file__)
]


def test_texts_say_the_rule_and_not_the_paper_it_comes_from() -> None:
    """Help, headers and docstrings are shipped; "see section 7.6" of a plan sends the reader nowhere."""
    found = {
        f"{path.relative_to(REPOSITORY)}: {match[0]}"
        for path in PUBLIC
        for match in ELSEWHERE.finditer("\n".join(prose_lines(path)))
    }
    assert found == set()


def prose_lines(path: Path) -> Iterator[str]:
    """Yield the comments and texts of a Python file, and every line of another file."""
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".py":
        yield from text.splitlines()
        return
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT or (token.type == tokenize.STRING and " " in token.string):
            yield token.string


@pytest.mark.parametrize(
    "text", ["See the house plan, section 7.6.", "(report brief, 4.2)", "until clear (J11)", "(R4, M9)"]
)
def test_a_reference_to_such_a_paper_is_found(text: str) -> None:
    assert ELSEWHERE.search(text)
