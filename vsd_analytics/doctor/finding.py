"""One result of a check of `vsd doctor`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

State = Literal["ok", "note", "needs you"]
NEEDS_YOU: Final = "needs you"


@dataclass(frozen=True, slots=True)
class Finding:
    """The result of checking one thing.

    Attributes:
        subject: What was checked, such as "vsd.toml".
        state: "ok", "note" (nothing to do), or "needs you".
        detail: What the check found.
        fix: What to do about it.
    """

    subject: str
    state: State
    detail: str
    fix: str | None = None
