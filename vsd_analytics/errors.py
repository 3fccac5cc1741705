"""Errors for people: every message says what, where, why and how to fix it, under a code `vsd explain` knows.

All classes inherit `VsdError`, so `except VsdError` catches everything this package raises on purpose.
"""

from __future__ import annotations

import difflib
import errno
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

CONTROL = re.compile(r"[\x00-\x08\x0a-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""Characters that no text of one line may carry to a terminal or a page: control characters other than the tab,
separators of lines, overrides of the direction of writing, lone surrogates."""


@dataclass(frozen=True, slots=True)
class Where:
    """The place a message points at.

    Attributes:
        file: Path as the user gave it.
        line: 1-based line, or record number in files without lines.
        text: The offending line, shortened; control characters are replaced when shown.
        column: 1-based column inside `text` that the caret marks.
        note: Words printed behind the caret.
    """

    file: str
    line: int | None = None
    text: str | None = None
    column: int | None = None
    note: str | None = None


class VsdError(Exception):
    """Root of all errors of this package.

    Args:
        what: One sentence: what could not be done.
        code: `E` and three digits; `vsd explain CODE` tells more.
        where: The place, if there is one.
        why: Why it matters or what was expected and found instead.
        fix: What to do, as a command or a line of vsd.toml where possible.
        in_python: What to do where Python raised it: a notebook has no options of commands. None = `fix`.
    """

    default_code = "E100"

    def __init__(
        self,
        what: str,
        *,
        code: str | None = None,
        where: Where | None = None,
        why: str | None = None,
        fix: str | None = None,
        in_python: str | None = None,
    ) -> None:
        super().__init__(what)
        self.what = what
        self.code = code or self.default_code
        self.where = where
        self.why = why
        self.fix = fix
        self.in_python = in_python

    def __str__(self) -> str:
        """Return what could not be done, why, and how to fix it in Python, on one line, as a notebook shows it."""
        fix = self.in_python or self.fix
        return f"{self.what}{f': {self.why}' if self.why else ''}{f' (fix: {fix})' if fix else ''}"

    def as_dict(self) -> dict[str, Any]:
        """Return the object `--json` prints for an error."""
        where = None
        if self.where is not None:
            where = {"file": self.where.file, "line": self.where.line}
        return {
            "ok": False,
            "code": self.code,
            "message": self.what,
            "why": self.why,
            "fix": self.fix,
            "mend": self.fix,
            "where": where,
        }


def nearest(word: str, known: Iterable[str]) -> str | None:
    """Return the known word closest to `word`, or None when none is close."""
    matches = difflib.get_close_matches(word.lower(), list(known), n=1, cutoff=0.6)
    return matches[0] if matches else None


class UsageError(VsdError):
    """The command was called with something it cannot use (E1xx)."""

    default_code = "E101"


class ConfigError(VsdError):
    """`vsd.toml` has mistakes; all of them are listed at once (E103)."""

    default_code = "E103"

    def __init__(self, what: str, *, problems: tuple[VsdError, ...] = (), **kwargs: Any) -> None:
        super().__init__(what, **kwargs)
        self.problems = problems

    def as_dict(self) -> dict[str, Any]:
        """Return the error with one entry per mistake under `problems`."""
        return {**super().as_dict(), "problems": [p.as_dict() for p in self.problems]}


class InputError(VsdError, ValueError):
    """An input file cannot be used at all (E2xx). Single bad rows are quarantined instead."""

    default_code = "E200"


class StoreError(VsdError):
    """The store refused or found something wrong (E3xx)."""

    default_code = "E300"


class DiskError(StoreError, OSError):
    """The disk refused: full (E304), read-only (E305), or broken (E306). An OSError with its `errno` as well."""


_DISK_FAULTS: Final[Mapping[int, tuple[str, str, str]]] = {
    errno.ENOSPC: ("E304", "the disk is full", "free some space there (df -h shows it)"),
    errno.EDQUOT: ("E304", "the disk is full", "free some space there, or have the quota raised"),
    errno.EROFS: ("E305", "the disk can only be read", "mount it for writing; dmesg tells whether it failed"),
    errno.EIO: ("E306", "the disk reports an error", "look at dmesg and the disk's health, and make a backup"),
}


def disk_error(error: BaseException, *, path: object = None) -> DiskError | None:
    """Return the error for people of a disk that refused, or None when `error` is about something else.

    Args:
        error: An OSError, or an error of a library whose text ends in the system's own words.
        path: What was written or read; None = what the error itself names.
    """
    if isinstance(error, DiskError):
        return error
    text = str(error)
    number: int = getattr(error, "errno", None) or next((n for n in _DISK_FAULTS if os.strerror(n) in text), 0)
    if number not in _DISK_FAULTS:
        return None
    code, what, fix = _DISK_FAULTS[number]
    file = path if path is not None else getattr(error, "filename", None)
    disk_error = DiskError(
        what,
        code=code,
        where=None if file is None else Where(os.fsdecode(file) if isinstance(file, bytes) else str(file)),
        why=f"{os.strerror(number)}: what was not acknowledged is not stored, what was acknowledged is safe",
        fix=f"{fix}, then run the same command again: nothing counts twice",
    )
    disk_error.errno, disk_error.strerror = number, os.strerror(number)
    return disk_error


class CalibrationError(VsdError, ValueError):
    """A homography or its point pairs cannot be used (E4xx)."""

    default_code = "E400"


class ReportError(VsdError):
    """A report could not be made (E5xx)."""

    default_code = "E500"


class SqlError(VsdError):
    """A SQL file breaks its own header, or a query of the user failed (E6xx)."""

    default_code = "E600"


class LiveError(VsdError):
    """The live branch cannot go on (E7xx)."""

    default_code = "E700"


class MailError(VsdError):
    """The weekly mail could not be sent (E8xx)."""

    default_code = "E800"
