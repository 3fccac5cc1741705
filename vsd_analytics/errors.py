"""Errors for people: every message says what, where, why and how to mend it, under a code `vsd explain` knows.

All classes inherit `VsdError`, so `except VsdError` catches everything this package raises on purpose.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Where:
    """The place a message points at.

    Attributes:
        file: Path as the user gave it.
        line: 1-based line, or record number in files without lines.
        text: The offending line, shortened; control characters are replaced when shown.
        column: 1-based column inside `text` at which the caret stands.
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
        mend: What to do, as a command or a line of vsd.toml where possible.
    """

    default_code = "E100"

    def __init__(
        self,
        what: str,
        *,
        code: str | None = None,
        where: Where | None = None,
        why: str | None = None,
        mend: str | None = None,
    ) -> None:
        super().__init__(what)
        self.what = what
        self.code = code or self.default_code
        self.where = where
        self.why = why
        self.mend = mend

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
            "mend": self.mend,
            "where": where,
        }


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


class CalibrationError(VsdError, ValueError):
    """A homography or its point pairs cannot be used (E4xx)."""

    default_code = "E400"


class ReportError(VsdError):
    """A report could not be made (E5xx)."""

    default_code = "E500"


class SqlError(VsdError):
    """A SQL file breaks its own header, or a query of the user failed (E6xx)."""

    default_code = "E600"
