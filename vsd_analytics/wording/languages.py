"""The language in which pages are written: one at a time, chosen for a block of code; its numbers, days and months.

Separators, days, months and plural forms are those of the Unicode CLDR (Babel); a language is a file of
`reports/wording/`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from typing import TYPE_CHECKING, Any

from vsd_analytics.resources import DEFAULT_LANGUAGE, LANGUAGES, shipped

if TYPE_CHECKING:
    from babel import Locale

_SPOKEN: ContextVar[str | None] = ContextVar("language", default=None)


@contextmanager
def speaking(language: str | None) -> Iterator[None]:
    """Write everything inside the block in a language; None leaves it as it is.

    Raises:
        KeyError: Pages cannot be written in this language.
    """
    if language is None:
        yield
        return
    if language not in LANGUAGES:
        raise KeyError(language)
    before = _SPOKEN.set(language)
    try:
        yield
    finally:
        _SPOKEN.reset(before)


def chosen() -> str | None:
    """Return the language of the block, None where none was chosen."""
    return _SPOKEN.get()


def language() -> str:
    """Return the language in force."""
    return _SPOKEN.get() or DEFAULT_LANGUAGE


def html_tag() -> str:
    """Return the language in force as HTML and its scripts name it: en-GB."""
    return tag_of(language())


@cache
def wording(name: str) -> dict[str, Any]:
    """Return a file of `reports/wording/`: a language's, or "figures"."""
    return tomllib.loads((shipped("reports") / "wording" / f"{name}.toml").read_text(encoding="utf-8"))


def tag_of(language: str) -> str:
    """Return the tag of a language and its country, which rules its numbers, days and plural forms: en-GB."""
    return str(wording(language)["language"]["tag"])


def plural_form(n: float) -> str:
    """Return the plural form of a number in the language in force, as CLDR names it: one, few, many, other."""
    return str(_locale(language()).plural_form(n))


def separated(text: str) -> str:
    """Return a number written as 1,234.5 with the separators of the language in force."""
    return text.translate(_separators(language()))


def days() -> tuple[str, ...]:
    """Return the names of the days, Monday first."""
    return _days(language())


def months() -> tuple[str, ...]:
    """Return the names of the months, January first."""
    return _months(language())


@cache
def _locale(language: str) -> Locale:
    from babel import Locale

    return Locale.parse(tag_of(language), sep="-")


@cache
def _separators(language: str) -> dict[int, str]:
    from babel.numbers import get_decimal_symbol, get_group_symbol

    locale = _locale(language)
    return str.maketrans({",": get_group_symbol(locale), ".": get_decimal_symbol(locale)})


@cache
def _days(language: str) -> tuple[str, ...]:
    names = _locale(language).days["format"]["wide"]
    return tuple(names[k] for k in range(7))


@cache
def _months(language: str) -> tuple[str, ...]:
    names = _locale(language).months["format"]["wide"]
    return tuple(names[k] for k in range(1, 13))
