"""`vsd explain CODE`: what each message means, what usually causes it, how to fix it."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Final

from vsd_analytics.errors import UsageError

EXPLANATIONS: Final[dict[str, str]] = tomllib.loads(
    Path(__file__).with_name("explanations.toml").read_text(encoding="utf-8")
)
"""The texts of `explanations.toml` by code, in its order."""


def explanation(code: str) -> str:
    """Return what a code means, its common causes, and how to fix them.

    Args:
        code: Such as "E201", in any case.

    Raises:
        UsageError: No message has this code (E101).
    """
    from vsd_analytics.config.reader import nearest

    known = EXPLANATIONS.get(code.strip().upper())
    if known is not None:
        return known
    close = nearest(code, [each.lower() for each in EXPLANATIONS])
    fix = f"vsd explain {close.upper()}" if close else "vsd explain   (lists all codes)"
    raise UsageError(f"no message has the code {code!r}", fix=fix)
