"""Every sentence of the page, in one catalogue for each language; code asks for them by key.

`reports/wording/en.toml` has the sentences of a language; `figures.toml` beside it has the words of figures in each.

A sentence has named places, `{name}`, which callers fill with text that `report.format` has made; a number never
becomes text here. Where a sentence hangs on how many there are, its entry is a table of plural forms.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from typing import Any, Final, Self

from markupsafe import Markup, escape

from vsd_analytics.resources import DEFAULT_LANGUAGE
from vsd_analytics.wording.languages import language, plural_form, wording

_WEEKS: Final = frozenset({"week", "before", "now", "number"})
"""Places of a week's number."""
FORMS: Final = frozenset({"zero", "one", "two", "few", "many", "other"})
"""Plural forms, as CLDR names them; an entry has `other` and those that its language has besides."""
_CODE: Final = re.compile(r"`([^`]*)`")


def say(key: str, /, *, plural: float | None = None, **values: object) -> str:
    """Return a sentence of the catalogue.

    Args:
        key: Its table and name, such as "headline.empty".
        plural: How many there are, where the entry has plural forms.
        **values: Text for its named places; the catalogue may leave some unused.

    Raises:
        KeyError: There is no such sentence, or it has a place without a value.
    """
    return nested_quotes(template(key, plural=plural).format(**_with_days(key, values)))


def say_html(key: str, /, *, plural: float | None = None, **values: object) -> Markup:
    """Return a sentence as HTML: its values are escaped, and text between backticks is set as code."""
    safe = _CODE.sub(r"<code>\1</code>", str(escape(template(key, plural=plural))))
    return Markup(nested_quotes(Markup(safe).format(**_with_days(key, values))))


def nested_quotes(text: str) -> str:
    """Return a text with the inner quotation marks of the language in force for a quotation within a quotation.

    A name or a sentence that a place is filled with may have quotation marks of its own: «Cassa “A”», not «Cassa «A»».
    The mark of a quotation that nobody closes stays as it is.
    """
    (opens, closes), (inner_opens, inner_closes) = _quotation_marks(language())
    if text.count(opens) < 2 or text.count(opens) != text.count(closes):
        return text
    depth, marked = 0, []
    for char in text:
        depth -= char == closes
        if depth > 0 and char in (opens, closes):
            marked.append(inner_opens if char == opens else inner_closes)
        else:
            marked.append(char)
        depth += char == opens
    return "".join(marked)


@cache
def _quotation_marks(language: str) -> tuple[tuple[str, str], tuple[str, str]]:
    """Return the outer and the inner quotation marks of a language: opening and closing."""
    words = wording(language)["format"]
    outer, inner = (words[key].split("{text}") for key in ("quoted", "quoted_inside"))
    return (outer[0], outer[1]), (inner[0], inner[1])


def template(key: str, /, *, plural: float | str | None = None) -> str:
    """Return a sentence with its places unfilled.

    Args:
        key: Its table and name.
        plural: How many there are, where the entry has plural forms, or one of these forms.
    """
    entries = catalogue(language())
    entry = entries[f"range.{key}" if _is_of_days(key) else key]
    if isinstance(entry, str):
        return entry
    if plural is None:
        raise KeyError(f"{key} has plural forms: say how many")
    form = plural if isinstance(plural, str) else plural_form(plural)
    return entry.get(form, entry["other"])


class DaysText(str):
    """Days in a row as the catalogue writes them: in full, and shortly where its place says so: `{week:short}`."""

    __slots__ = ("short",)
    short: str

    def __new__(cls, text: str, short: str) -> Self:
        """Return the days.

        Args:
            text: In full.
            short: For a narrow column.
        """
        days = super().__new__(cls, text)
        days.short = short
        return days

    def __format__(self, spec: str) -> str:
        return self.short if spec == "short" else super().__format__(spec)


@dataclass(frozen=True, slots=True)
class SpokenDays:
    """The days of a report that are no week.

    Attributes:
        names: Text for the places `{span}`, `{span_before}` and `{span_days}`.
        weeks: What is written in the place of a week, by the week's number.
    """

    names: Mapping[str, str]
    weeks: Mapping[int, DaysText]


@contextmanager
def about_days(days: SpokenDays | None) -> Iterator[None]:
    """Speak of days instead of a week inside the block: sentences of `range.` come before others.

    Args:
        days: The days; None = speak of a week.
    """
    before = _DAYS.set(days)
    try:
        yield
    finally:
        _DAYS.reset(before)


def is_about_days() -> bool:
    """Tell whether the block speaks of days instead of a week."""
    return _DAYS.get() is not None


def _is_of_days(key: str) -> bool:
    return is_about_days() and f"range.{key}" in catalogue(language())


def _with_days(key: str, values: Mapping[str, object]) -> Mapping[str, object]:
    """Return the text of a sentence's places; where it speaks of days, weeks are written as days."""
    days = _DAYS.get()
    if days is None or not _is_of_days(key):
        return values
    shown = {k: days.weeks.get(v, v) if k in _WEEKS and isinstance(v, int) else v for k, v in values.items()}
    return {**shown, **days.names}


def has(key: str) -> bool:
    """Tell whether the catalogue has a sentence."""
    return key in catalogue(language())


_DAYS: ContextVar[SpokenDays | None] = ContextVar("days", default=None)


@cache
def catalogue(language: str = DEFAULT_LANGUAGE) -> Mapping[str, str | Mapping[str, str]]:
    """Return all sentences of a language by key; plural forms are tables with `other` and what else it has."""
    sections = {name: table for name, table in wording(language).items() if name not in ("language", "figures")}
    return dict(_flat(sections)) | _of_figures(language)


def _of_figures(language: str) -> dict[str, str]:
    """Return the words of figures: `reason.unit.M30` for the JSON file, and `more.M30.name` and such for the page.

    `figures.toml` has them in some languages; the file of a language has those in its own, in `[figures]`.
    """
    shared = {
        metric: {part: by_language[language] for part, by_language in parts.items() if language in by_language}
        for metric, parts in wording("figures").items()
    }
    own = wording(language).get("figures", {})
    return {
        f"reason.unit.{metric}" if part == "json_unit" else f"more.{metric}.{part}": text
        for metric, parts in shared.items()
        for part, text in (parts | own.get(metric, {})).items()
    }


def _flat(table: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    entries: list[tuple[str, Any]] = []
    for name, value in table.items():
        key = f"{prefix}{name}"
        if isinstance(value, dict) and not ("other" in value and value.keys() <= FORMS):
            entries += _flat(value, f"{key}.")
        else:
            entries.append((key, value))
    return entries
