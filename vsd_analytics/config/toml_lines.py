"""Finds the line of each key in a TOML text: `tomllib` gives values without positions, messages need lines.

Only texts that `tomllib` has accepted are scanned, so the scan needs no grammar of its own: it finds the lines on
which statements begin and lets `tomllib` read their keys.
"""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from vsd_analytics.errors import VsdError, Where

KeyPath = tuple[str | int, ...]
"""Keys and array indices from the root, such as ("camera", 1, "homography")."""

# strings and comments are skipped whole, so that brackets inside them do not count
_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|\'\'\'.*?\'{3,5}|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|\#[^\n]*|[\[\]{}\n]',
    re.DOTALL,
)
_LONG_NUMBER = re.compile(r"[0-9][0-9_]{17,}|0[xob][0-9A-Fa-f_]{15,}")
_HEADER = re.compile(r"\s*(\[\[?)(.*?)\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r'\s*((?:"(?:\\.|[^"\\])*"|\'[^\']*\'|[\w\-.]|\s)+?)\s*=')


@dataclass(frozen=True)
class TomlText:
    """A TOML text that knows the line of each key.

    Attributes:
        file: The name shown in messages.
        text: The whole text.
    """

    file: str
    text: str

    @cached_property
    def lines(self) -> list[str]:
        """Return the text's lines."""
        return self.text.split("\n")

    @cached_property
    def _places(self) -> dict[KeyPath, int]:
        """Map the path of every statement to its 1-based line."""
        places: dict[KeyPath, int] = {}
        counts: dict[KeyPath, int] = {}
        table: KeyPath = ()
        for number in _statement_lines(self.text):
            line = self.lines[number - 1]
            if header := _HEADER.fullmatch(line):
                path = table = _indexed(_keys(header[2]), counts, grows=header[1] == "[[")
            elif key := _KEY.match(line):
                path = table + _keys(key[1])
            else:
                continue
            for length in range(1, len(path) + 1):  # a table around it begins where its first part does
                places.setdefault(path[:length], number)
        return places

    def where(self, path: KeyPath, *, note: str | None = None) -> Where:
        """Return the place of a key, or of the nearest table around it that has a line of its own.

        Args:
            path: Keys and array indices from the root.
            note: Words printed behind the caret.
        """
        for length in range(len(path), 0, -1):
            number = self._places.get(path[:length])
            if number is not None:
                line = self.lines[number - 1].rstrip()
                return Where(self.file, number, line, len(line) - len(line.lstrip()) + 1, note)
        return Where(self.file)

    def syntax_where(self, error: Exception) -> Where:
        """Return the place of a syntax error, from the words of `tomllib`."""
        match = re.search(r"line (\d+), column (\d+)", str(error))
        number, column = (int(match[1]), int(match[2])) if match else (len(self.lines), 1)
        if not isinstance(error, tomllib.TOMLDecodeError):
            number = next((n for n, line in enumerate(self.lines, 1) if _LONG_NUMBER.search(line)), number)
        while number > 1 and not self.lines[number - 1].strip():  # "at end of document" means the last written line
            number, column = number - 1, len(self.lines[number - 2]) + 1
        return Where(self.file, number, self.lines[number - 1].rstrip(), column)


def read_toml(path: Path, *, name: str) -> tuple[TomlText, VsdError | None]:
    """Read a TOML file as text.

    Args:
        path: The file.
        name: The name shown in messages.

    Returns:
        The text, and the reason (E121) why it cannot be used, if there is one.
    """
    try:
        text = TomlText(name, path.read_text(encoding="utf-8-sig"))  # universal newlines: from here on only \n
    except UnicodeDecodeError as error:
        where = Where(name, path.read_bytes()[: error.start].count(b"\n") + 1)
        return TomlText(name, ""), VsdError(
            f"{name} is not UTF-8 text", code="E121", where=where, fix="save it as UTF-8 in your editor"
        )
    except OSError as error:
        return TomlText(name, ""), VsdError(
            f"cannot read {name}", code="E121", where=Where(name), why=error.strerror, fix="check its permissions"
        )
    return text, syntax_problem(text)


def syntax_problem(text: TomlText) -> VsdError | None:
    """Return the reason (E121) why a text is no TOML, if there is one."""
    try:
        values = tomllib.loads(text.text)
        if _beyond_64_bits(values):
            raise ValueError("a whole number needs more than 64 bits")
    except (ValueError, RecursionError) as error:  # TOMLDecodeError, and what int() says of thousands of digits
        return VsdError(
            f"{text.file} is not valid TOML: {str(error).partition(' (at ')[0]}",
            code="E121",
            where=text.syntax_where(error),
            why="a text stands in quotes, a list in [ ], and each key once in its table",
            fix="fix this line; the rest of the file is read after it",
        )
    return None


def _beyond_64_bits(value: Any) -> bool:
    """Tell whether a value holds a whole number that TOML does not know."""
    if isinstance(value, int):
        return not -(1 << 63) <= value < 1 << 63
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return any(_beyond_64_bits(v) for v in inner)


def _statement_lines(text: str) -> list[int]:
    """Return the 1-based lines on which no string, array or inline table of an earlier line is still open."""
    lines, depth, number = [1], 0, 1
    for token in _TOKEN.finditer(text):
        word = token[0]
        if word == "\n":
            number += 1
            if depth == 0:
                lines.append(number)
        elif word in "[{":
            depth += 1
        elif word in "]}":
            depth -= 1
        else:
            number += word.count("\n")
    return lines


def _keys(dotted: str) -> tuple[str, ...]:
    """Split a key such as `ingest."my map"` as TOML does."""
    try:
        value: Any = tomllib.loads(f"{dotted} = 0")
    except tomllib.TOMLDecodeError:
        return ()
    keys = []
    while isinstance(value, dict):
        key, value = next(iter(value.items()))
        keys.append(key)
    return tuple(keys)


def _indexed(keys: tuple[str, ...], counts: dict[KeyPath, int], *, grows: bool) -> KeyPath:
    """Return the path of a table header, with the index of each array of tables it goes through."""
    path: KeyPath = ()
    for position, key in enumerate(keys):
        path = (*path, key)
        if grows and position == len(keys) - 1:
            counts[path] = counts.get(path, -1) + 1
        if path in counts:
            path = (*path, counts[path])
    return path
