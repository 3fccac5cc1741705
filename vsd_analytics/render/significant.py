"""How many digits numbers have in files."""

from __future__ import annotations

import math
from typing import Any, Final

DIGITS: Final = 6
"""More digits would differ between machines without meaning anything."""


def significant(value: float) -> float | None:
    """Return `value` with 6 significant digits; None for what is not finite."""
    if not math.isfinite(value):
        return None
    return float(f"{value:.{DIGITS}g}")


def rounded(value: Any) -> Any:
    """Return a JSON value with every float to 6 significant digits; infinity and NaN are None."""
    match value:
        case float():
            return significant(value)
        case dict():
            return {str(k): rounded(v) for k, v in value.items()}
        case list() | tuple():
            return [rounded(v) for v in value]
        case _:
            return value
