"""Edits `vsd.toml`, which is its owner's file: a key of one table, or a whole table at the end of the file.

All other lines and comments stay. The file is replaced as a whole, under a lock, and only by one that says exactly what
is wanted and has no mistake; else nothing is written.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from vsd_analytics.config.project import FILE, site_of
from vsd_analytics.config.toml_lines import TomlText
from vsd_analytics.errors import ConfigError
from vsd_analytics.site.model import Site

LOCK: Final = Path("status") / "config.lock"
BOM: Final = "\ufeff"
Tables = dict[str, Any]


def rewrite(
    site: Site,
    edit: Callable[[str, Tables], str | None],
    *,
    refusal: Callable[[], ConfigError],
    before: Callable[[], None] = lambda: None,
) -> bool:
    """Replace the file by one that says something else in one place. Returns False where there is nothing to change.

    Args:
        site: The site.
        edit: Returns the new text of a text, and changes the values of the old one to what the new one must say; None =
            it says so already.
        refusal: Returns the error of a file that is written in a way this program does not edit.
        before: Is called when all is checked, just before the file is replaced.

    Raises:
        ConfigError: What `refusal` returns, or E103: the new file would have mistakes.
        DiskError: E304 to E306, the disk refused; `vsd.toml` is as before.
    """
    from vsd_analytics.store.durable import exclusive, publish, sweep_temporaries

    path = (site.root / FILE).resolve()
    with exclusive(site.root / LOCK):
        sweep_temporaries(path.parent, file_name=path.name)
        text = path.read_bytes().decode("utf-8")
        wanted = values(text)
        new = edit(text, wanted)
        if new is None:
            return False
        try:
            is_right = new != text and values(new) == wanted
        except tomllib.TOMLDecodeError:
            is_right = False
        if not is_right:
            raise refusal()
        site_of(TomlText(FILE, _plain(new)), folder=site.root)
        before()
        publish(path, new.encode(), is_private=not path.stat().st_mode & 0o077)
    return True


def values(text: str) -> Tables:
    """Return what a text says."""
    return tomllib.loads(text.removeprefix(BOM))


def with_table(text: str, key: str, table: Mapping[str, Any]) -> str:
    """Return a text with a table `[[key]]` below it, in its own kind of line ends."""
    end = _end_of_lines(text)
    return text + ("" if not text or text.endswith("\n") else end) + _block(key, table, end=end)


def without_table(text: str, key: str, table: Mapping[str, Any]) -> str:
    """Return a text without the lines that `with_table` wrote; the same text where they are not there as written."""
    return text.replace(_block(key, table, end=_end_of_lines(text)), "", 1)


def drop_table(tables: Tables, key: str, table: Mapping[str, Any]) -> None:
    """Take a table out of what a text says, if it is there."""
    if table in tables.get(key, []):
        tables[key].remove(table)
    if not tables.get(key):
        tables.pop(key, None)


def with_key(text: str, key: str, number: int, name: str, value: Any) -> str:
    """Return a text in which a key of the table `[[key]]` of some number says something else.

    It is written into its line, or into a new line below the head of the table.

    Args:
        text: The text.
        key: Name of the tables.
        number: Number of the table, from 0.
        name: The key of the table.
        value: What it says; None = nothing, the line is deleted.

    Returns:
        The text; the same one where the table has no lines of its own.
    """
    known = TomlText(FILE, _plain(text))
    lines, end = text.split("\n"), "\r" if "\r\n" in text else ""
    head, at = known.where((key, number)).line, known.where((key, number, name)).line
    if head is None or at is None or not re.match(rf"\s*\[\[\s*{key}\s*\]\]", known.lines[head - 1]):
        return text
    is_there = re.match(rf'\s*["\']?{name}["\']?\s*=', known.lines[at - 1]) is not None
    new = None if value is None else f"{name} = {_written(value)}"
    if is_there:
        comment = re.search(r"\s*#.*$", known.lines[at - 1])
        lines[at - 1 : at] = [] if new is None else [f"{new}{comment[0] if comment else ''}{end}"]
    elif new is not None:
        lines[head:head] = [f"{new}{end}"]
    return "\n".join(lines)


def _block(key: str, table: Mapping[str, Any], *, end: str) -> str:
    """Return a table as it is written, an empty line before it."""
    lines = [f"{name} = {_written(value)}" for name, value in table.items()]
    return "".join(f"{line}{end}" for line in ("", f"[[{key}]]", *lines))


def _written(value: Any) -> str:
    if isinstance(value, Mapping):
        inner = ", ".join(f"{name} = {_written(one)}" for name, one in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(_written(one) for one in value)}]"
    return json.dumps(value, ensure_ascii=False).removesuffix(".0")


def _plain(text: str) -> str:
    return text.removeprefix(BOM).replace("\r\n", "\n")


def _end_of_lines(text: str) -> str:
    return "\r\n" if "\r\n" in text else "\n"
