"""A printed fix as something to run: the options, commands of the shell and lines of `vsd.toml` that its words hold."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import click

from vsd_analytics.cli import cli

KNOWN_TO_THE_USER: Final[Mapping[str, str]] = {
    "ID": "cam-1",
    "INSTANT": "2025-11-25T09:00:00Z",
    "WIDTHxHEIGHT": "1280x720",
    "NAME": "name",
    "N": "1",
}
"""What no file tells, and what a user of the tests' sites would write for it."""
OPEN: Final = re.compile(r"\.\.\.|\bTHEIR_NAME\b|\bPATH\b|\bLIST\b|\bTABLE\b|\bFILES?\b")
"""What a fix leaves open although the program has looked at the input: a name of its columns, or the input itself."""
_OPTION: Final = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
_VSD: Final = re.compile(r"\bvsd (?!-C)[a-z][^;`]*?(?=[;`]|  |, or |, and |, then | beside | after |$)")
_SHELL: Final = re.compile(r"(?:^|: |; )((?:tr|iconv|jq|unxz|lz4|sqlite3) [^;]*?)(?=;|$)")
_LINE: Final = re.compile(
    r'(?:^|: |; |, |add )(\w+ = (?:"[^"]*"|\[[^\]]*\]|[\w.+-]+))(?: under (\[\[?\w+\]\]?)(?: ([\w-]+))?)?'
)


@dataclass(frozen=True)
class Fix:
    """One way that a printed fix names.

    Attributes:
        options: Options that are added to the command.
        shell: A command of the shell, run in the folder of the input.
        command: A command of ours.
        line: A line of `vsd.toml`.
        table: The table it belongs to, as it is written; "" = the message says it otherwise.
        name: Id of that table's entry.
    """

    options: tuple[str, ...] = ()
    shell: str = ""
    command: str = ""
    line: str = ""
    table: str = ""
    name: str = ""

    @property
    def is_open(self) -> bool:
        """Return whether it leaves something open."""
        return OPEN.search(" ".join((*self.options, self.shell, self.command, self.line))) is not None


def ways(fix: str, command: str = "check") -> list[Fix]:
    """Return the ways that a printed fix names, in their order; lines of vsd.toml come last."""
    found = [(m.start(), Fix(command=m[0].strip().removeprefix("vsd "))) for m in _VSD.finditer(fix)]
    words = _VSD.sub(lambda m: " " * len(m[0]), fix)
    found += [*_of_options(words, command), *((m.start(), Fix(shell=m[1].strip())) for m in _SHELL.finditer(words))]
    without_options = _OPTION.sub("", words)
    lines = (Fix(line=m[1], table=m[2] or "", name=m[3] or "") for m in _LINE.finditer(without_options))
    return [*(way for _, way in sorted(found, key=lambda each: each[0])), *lines]


def _of_options(fix: str, command: str) -> Iterator[tuple[int, Fix]]:
    """Yield options that stand together, or with "with" between them, as one way, and where they begin."""
    takes_value = _values(command)
    held: list[str] = []
    begin = end = 0
    for match in _OPTION.finditer(fix):
        if match.start() < end or match[0] not in takes_value:
            continue
        if held and fix[end : match.start()].strip() not in ("", "with"):
            yield begin, Fix(tuple(held))
            held = []
        if takes_value[match[0]] and re.match(r"\s+[^\s,;:)]", fix[match.end() :]) is None:
            continue  # it is only mentioned
        begin, end = begin if held else match.start(), match.end()
        held.append(match[0])
        if takes_value[match[0]]:
            value, end = _value(fix, end)
            held.append(KNOWN_TO_THE_USER.get(value, value))
    if held:
        yield begin, Fix(tuple(held))


def _value(text: str, start: int) -> tuple[str, int]:
    """Return the value that follows an option, as a shell reads it, and where it ends."""
    quoted = re.compile(r'\s+(?:"(?:[^"\\]|\\.)*"|\'[^\']*\'|[^\s"\'])+').match(text, start)
    assert quoted is not None, text[start:]
    word = quoted[0].strip()
    return shlex.split(word.rstrip(",;:)"))[0], start + len(quoted[0])


def _values(command: str) -> dict[str, bool]:
    """Return the options of a command, and whether each takes a value."""
    found = cli.get_command(click.Context(cli), command)
    assert found is not None
    options = [p for p in found.params if isinstance(p, click.Option)]
    return {name: not option.is_flag for option in options for name in (*option.opts, *option.secondary_opts)}
