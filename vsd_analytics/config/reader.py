"""Typed reading of one TOML table that notes every mistake with its line instead of stopping at the first.

A reader remembers what it was asked for, so that the JSON Schema of the file follows from it (`config.schema`).
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable, Iterable
from datetime import date, datetime
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from vsd_analytics.config.toml_lines import KeyPath, TomlText
from vsd_analytics.errors import CONTROL, VsdError, nearest
from vsd_analytics.owners import denied, is_there
from vsd_analytics.settings import SETTINGS

ID_PATTERN = "[a-z0-9][a-z0-9_-]{0,62}"
NAME_MAX_CHARS = 200

T = TypeVar("T")
Word = TypeVar("Word", bound=str)

Form: TypeAlias = dict[str, Any]
"""A JSON Schema of the value of a key."""

EXAMPLE = "example"
"""Key of a `Form`: a value as `vsd.toml` writes it."""

DATE: Form = {"type": "string"}
"""A date, a time, or both: editors see those of TOML as texts."""

REFUSED: Form = {"not": {}}
"""A key that is known to be a mistake."""

_NUMBER: Form = {"type": "number"}


def suggest_id(text: str) -> str:
    """Return an allowed id that looks like `text`."""
    plain = re.sub(r"[^a-z0-9_-]+", "-", text.lower()).strip("-_")[:63].strip("-_")
    return plain or "cam-1"


class Mistakes:
    """The mistakes of one text, in the order of their lines.

    Args:
        text: The TOML text with its lines.
    """

    def __init__(self, text: TomlText) -> None:
        self.text = text
        self._found: list[VsdError] = []

    def add(
        self,
        path: KeyPath,
        what: str,
        *,
        code: str,
        why: str | None = None,
        fix: str | None = None,
        note: str | None = None,
    ) -> None:
        """Note a mistake at the line of `path`."""
        self._found.append(VsdError(what, code=code, where=self.text.where(path, note=note), why=why, fix=fix))

    def take(self, others: Iterable[VsdError]) -> None:
        """Note mistakes found in another file."""
        self._found.extend(others)

    @property
    def all(self) -> tuple[VsdError, ...]:
        """Return the mistakes by file and line."""

        def place(error: VsdError) -> tuple[str, int]:
            return (error.where.file, error.where.line or 0) if error.where else ("", 0)

        return tuple(sorted(self._found, key=place))


class TableReader:
    """One table while it is read.

    Every method returns the value, or its default after noting what is wrong. A key nobody asked for is unknown.

    Args:
        values: The table as `tomllib` gives it.
        path: Its path from the root.
        label: How messages call it, such as `[[camera]] "cam-1"`.
        mistakes: Where to note.
        folder: Folder that relative paths start from.

    Attributes:
        asked: What each key looked at may be: the schema of a value, the reader of a table, the readers of `[[key]]`.
        needed: Keys found missing; of several in one entry, one is enough.
    """

    def __init__(self, values: dict[str, Any], *, path: KeyPath, label: str, mistakes: Mistakes, folder: Path) -> None:
        self.values, self.path, self.label, self.mistakes, self.folder = values, path, label, mistakes, folder
        self.asked: dict[str, Form | TableReader | list[TableReader]] = {}
        self.needed: list[tuple[str, ...]] = []

    def fault(
        self,
        key: str,
        what: str,
        *,
        code: str = "E124",
        why: str | None = None,
        fix: str | None = None,
        note: str | None = None,
    ) -> None:
        """Note a mistake at a key of this table."""
        self.mistakes.add((*self.path, key), what, code=code, why=why, fix=fix, note=note)

    def raw(self, key: str, form: Form | None = None, *, example: str | None = None) -> Any:
        """Return the value as it is, or None.

        Args:
            key: The key.
            form: What it may be; None = it is asked for again.
            example: A value as TOML.
        """
        if form is not None or key not in self.asked:
            known = {} if example is None else {EXAMPLE: example}
            self.asked[key] = {**(form or {}), **known}
        return self.values.get(key)

    def missing(self, key: str, example: str, *, why: str | None = None, instead: str | tuple[str, ...] = ()) -> None:
        """Note that a needed key, or one that may be there instead, is not there."""
        self.needed.append((key, *((instead,) if isinstance(instead, str) else instead)))
        fix = f"add a line such as: {key} = {example}"
        self.mistakes.add(self.path, f"{self.label} has no {key}", code="E123", why=why, fix=fix)

    def wrong_type(self, key: str, expected: str, example: str) -> None:
        """Note that a value is of another kind."""
        kind = _kind(self.values[key])
        self.refuse(key, f"must be {expected}, not {kind}", example)

    def refuse(self, key: str, what: str, example: str, *, code: str = "E124") -> None:
        """Note what a value must be, or is, and how it is written."""
        self.fault(key, f"{self.label} {key} {what}", code=code, fix=f"write it as: {key} = {example}")

    def unknown(self, key: str, what: str, close: str | None, *, instead: str | None, code: str = "E125") -> None:
        """Note a value that names nothing there is; `close` is what may have been meant, `instead` helps without it."""
        note, fix = (f"did you mean {close}?", f'{key} = "{close}"') if close else (None, instead)
        self.fault(key, f"{self.label} {what}", code=code, note=note, fix=fix)

    def _typed(self, key: str, form: Form, is_right: Callable[[Any], bool], expected: str, example: str | None) -> Any:
        """Return a value of the kind that `is_right` knows; None when there is none, or it is of another kind."""
        value = self.raw(key, form, example=example)
        if value is None or is_right(value):
            return value
        self.wrong_type(key, expected, example or "true")
        return None

    def text(self, key: str, *, example: str, required: bool = False) -> str | None:
        """Return a text that is not empty."""
        form = {"type": "string", "minLength": 1, "maxLength": NAME_MAX_CHARS}
        value: str | None = self._typed(key, form, lambda v: isinstance(v, str), "a text in quotes", example)
        if value is None:
            if required and key not in self.values:
                self.missing(key, example)
            return None
        if not value.strip() or len(value) > NAME_MAX_CHARS or CONTROL.search(value) or "\t" in value:
            self.refuse(key, f"must be one line of 1 to {NAME_MAX_CHARS} characters", example)
            return None
        return value

    def word(
        self, key: str, words: tuple[Word, ...], *, example: Word, fix: Word | None = None, required: bool = False
    ) -> Word | None:
        """Return one of some words; a word that is close to none of them is answered with `fix`."""
        value = self.text(key, example=f'"{example}"', required=required)
        self.raw(key, {"enum": list(words)})
        for word in words:
            if value == word:
                return word
        if value is not None:
            what, instead = f"{key} {value!r} is not one of {', '.join(words)}", f'{key} = "{fix}"' if fix else None
            self.unknown(key, what, nearest(value, words), instead=instead, code="E124")
        return None

    def id(self, key: str, *, example: str) -> str | None:
        """Return an identifier: lower-case letters, digits, - and _, at most 63."""
        form = {"type": "string", "pattern": f"^{ID_PATTERN}$"}
        value: str | None = self._typed(key, form, lambda v: isinstance(v, str), "a text in quotes", example)
        if key not in self.values:
            self.missing(key, example)
        if value is not None and not re.fullmatch(ID_PATTERN, value):
            self.fault(
                key,
                f"{value!r} cannot be an id",
                code="E125",
                why="ids become folder and file names: a-z, 0-9, - and _, at most 63, first a letter or digit",
                fix=f'{key} = "{suggest_id(value)}" (name = ... may be any text)',
            )
            return None
        return value

    def number(
        self, key: str, *, minimum: float, maximum: float, unit: str, example: str, whole: bool = False
    ) -> float | int | None:
        """Return a finite number within [minimum, maximum]."""
        form = {"type": "integer" if whole else "number", "minimum": minimum, "maximum": maximum}
        kinds = (int,) if whole else (int, float)
        expected = "a whole number" if whole else "a number"
        value: float | int | None = self._typed(key, form, lambda v: type(v) in kinds, expected, example)
        if value is not None and not (math.isfinite(value) and minimum <= value <= maximum):
            span = f"{minimum:,.10g} to {maximum:,.10g}" if minimum < maximum else f"{minimum:,.10g}"
            self.refuse(key, f"= {value} is outside {f'{span} {unit}'.rstrip()}", example)
            return None
        return value

    def flag(self, key: str) -> bool | None:
        """Return true or false."""
        value: bool | None = self._typed(key, {"type": "boolean"}, lambda v: isinstance(v, bool), "true or false", None)
        return value

    def points(self, key: str, *, least: int, example: str) -> tuple[tuple[float, float], ...] | None:
        """Return a list of at least `least` finite [x, y]."""
        form = {"type": "array", "items": _numbers(2), "minItems": least}
        value = self._typed(key, form, lambda v: _is_list(v, _is_pair), "a list of [x, y] in metres", example)
        if value is not None and len(value) < least:
            self.refuse(key, f"has {len(value)} points, needs at least {least}", example, code="E128")
            return None
        return None if value is None else tuple((float(x), float(y)) for x, y in value)

    def pair(self, key: str, *, example: str) -> tuple[float, float] | None:
        """Return two finite numbers."""
        value = self._typed(key, _numbers(2), _is_pair, "two numbers", example)
        return None if value is None else (float(value[0]), float(value[1]))

    def texts(self, key: str, *, example: str) -> tuple[str, ...]:
        """Return a list of texts; () when absent."""
        form = {"type": "array", "items": {"type": "string", "minLength": 1}}
        return tuple(self._typed(key, form, lambda v: _is_list(v, _is_word), "a list of texts", example) or ())

    def table(self, key: str, *, example: str, form: Form) -> dict[str, Any]:
        """Return a table inside this one; {} when absent.

        Args:
            key: Its key.
            example: Such a table as TOML.
            form: What its keys and values may be.
        """
        return self._typed(key, {"type": "object", **form}, lambda v: isinstance(v, dict), "a table", example) or {}

    def inner(self, key: str) -> TableReader:
        """Return a reader of the table `[key]`; empty when absent."""
        values = self.table(key, example="{}", form={})
        path = (*self.path, key)
        reader = TableReader(values, path=path, label=f"[{key}]", mistakes=self.mistakes, folder=self.folder)
        self.asked[key] = reader
        return reader

    def each(self, key: str) -> list[TableReader]:
        """Return a reader per table of `[[key]]`."""
        entries = self.raw(key, {"type": "array"})
        if entries is None:
            return []
        if not (isinstance(entries, list) and all(isinstance(values, dict) for values in entries)):
            self.fault(key, f"{key} must be a list of tables", fix=f"write [[{key}]] with two brackets, once per {key}")
            return []
        readers = []
        for i, values in enumerate(entries):
            name = repr(values["id"]) if isinstance(values.get("id"), str) else f"number {i + 1}"
            label = f"[[{key}]] {name}"
            path = (*self.path, key, i)
            readers.append(TableReader(values, path=path, label=label, mistakes=self.mistakes, folder=self.folder))
        self.asked[key] = readers
        return readers

    def file(self, key: str, *, example: str, fix: str | None = None) -> Path | None:
        """Return an existing file; a relative path starts at the project folder."""
        value = self.text(key, example=example)
        if value is None:
            return None
        path = self.folder / value
        try:
            exists = is_there(path) and path.is_file()
        except PermissionError as error:
            why, fix = denied(error)
            self.fault(key, f"{self.label} {key}: {value!r} may not be read", code="E126", why=why, fix=fix)
            return None
        if not exists:
            self.fault(
                key,
                f"{self.label} {key}: there is no file {value!r}",
                code="E126",
                why="paths start at the folder of vsd.toml",
                fix=_similar_file(path) or fix or f"put the file there, or take the line {key} = ... out",
            )
            return None
        return path

    def parsed(self, key: str, *, example: str, parse: Callable[[Any], T], form: Form) -> T | None:
        """Return `parse(value)`; a ValueError it raises is noted in its own words."""
        value = self.raw(key, form, example=example)
        if value is None:
            return None
        try:
            return parse(value)
        except ValueError as error:
            self.fault(key, f"{self.label} {key}: {error}", fix=f"write it as: {key} = {example}")
            return None

    def close(self) -> None:
        """Note every key nobody asked for, with the nearest one that exists."""
        for key in self.values:
            if key not in self.asked:
                section = next((s.section for s in SETTINGS if s.name == key), None)
                close = None if section is not None else nearest(key, self.asked)
                known = f"rename it to {close}" if close else f"known keys: {', '.join(sorted(self.asked))}"
                self.fault(
                    key,
                    f"{self.label} knows no key {key!r}",
                    code="E122",
                    note=f"did you mean {close}?" if close else None,
                    fix=known if section is None else f"move the line under [{section}]",
                )


def _numbers(count: int) -> Form:
    return {"type": "array", "items": _NUMBER, "minItems": count, "maxItems": count}


def _is_list(value: Any, is_right: Callable[[Any], bool]) -> bool:
    return isinstance(value, list) and all(map(is_right, value))


def _is_word(value: Any) -> bool:
    return isinstance(value, str) and value != ""


def _is_pair(value: Any) -> bool:
    return _is_list(value, lambda v: type(v) in (int, float) and math.isfinite(v)) and len(value) == 2


def _kind(value: Any) -> str:
    names: tuple[tuple[type | tuple[type, ...], str], ...] = (
        (bool, "true or false"),
        ((int, float), f"the number {value}"),
        (str, f"the text {value!r}"[:80]),
        (list, "a list"),
        (dict, "a table"),
        (datetime, "a date and time"),
        (date, "a date"),
    )
    return next((name for kind, name in names if isinstance(value, kind)), type(value).__name__)


def _similar_file(path: Path) -> str | None:
    """Return a fix that names the most similar file of the same folder, if there is one."""
    try:
        names = sorted(p.name for p in path.parent.iterdir() if p.is_file())
    except (OSError, ValueError):
        names = []
    close = difflib.get_close_matches(path.name, names, n=1, cutoff=0.5)
    return f"did you mean {close[0]!r}, which is in the same folder?" if close else None
