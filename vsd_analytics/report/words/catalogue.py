"""Every sentence of the page, in one catalogue for each language: `reports/wording/en.toml`; code asks for them by key.

A sentence has named places, `{name}`, which callers fill with text that `report.format` has made; a number never
becomes text here. Where a sentence hangs on how many there are, its entry is a table of plural forms. Another language
is another file of the same keys.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import cache
from typing import Any, Final

from markupsafe import Markup, escape

from vsd_analytics.report.words.languages import DEFAULT, language
from vsd_analytics.resources import shipped

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
    return template(key, plural=plural).format(**values)


def say_html(key: str, /, *, plural: float | None = None, **values: object) -> Markup:
    """Return a sentence as HTML: its values are escaped, and text between backticks is set as code."""
    safe = _CODE.sub(r"<code>\1</code>", str(escape(template(key, plural=plural))))
    return Markup(safe).format(**values)


def template(key: str, /, *, plural: float | None = None) -> str:
    """Return a sentence with its places unfilled."""
    entry = catalogue(language())[key]
    if isinstance(entry, str):
        return entry
    if plural is None:
        raise KeyError(f"{key} has plural forms: say how many")
    return entry["one" if plural == 1 else "other"]


def has(key: str) -> bool:
    """Tell whether the catalogue has a sentence."""
    return key in catalogue(language())


@cache
def catalogue(language: str = DEFAULT) -> Mapping[str, str | Mapping[str, str]]:
    """Return all sentences of a language by key; plural forms are tables with `one` and `other`."""
    path = shipped("reports") / "wording" / f"{language}.toml"
    return dict(_flat(tomllib.loads(path.read_text(encoding="utf-8"))))


def _flat(table: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    found: list[tuple[str, Any]] = []
    for name, value in table.items():
        key = f"{prefix}{name}"
        if isinstance(value, dict) and value.keys() != {"one", "other"}:
            found += _flat(value, f"{key}.")
        else:
            found.append((key, value))
    return found
