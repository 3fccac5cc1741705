"""The language in which pages are written: one at a time, chosen for a block of code; its numbers, days and months.

Separators, days and months are those of the Unicode CLDR (Babel); the sentences are in `reports/wording/`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from babel import Locale

TAGS: Final[dict[str, str]] = {"en": "en-GB", "it": "it-IT"}
"""Languages of pages (`vsd_analytics.site.model.LANGUAGES`), and the tag of each that HTML names."""
DEFAULT: Final = "en"

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
    if language not in TAGS:
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
    return _SPOKEN.get() or DEFAULT


def html_tag() -> str:
    """Return the language in force as HTML and its scripts name it: en-GB."""
    return TAGS[language()]


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

    return Locale.parse(TAGS[language], sep="-")


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
