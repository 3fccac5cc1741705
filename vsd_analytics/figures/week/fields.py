"""Fields of the report's dataclasses: each carries what it means, its unit and its catalogue id."""

from __future__ import annotations

from dataclasses import MISSING, field
from typing import Any


def described(meaning: str, unit: str | None = None, metric: str | None = None, *, default: Any = MISSING) -> Any:
    """Return a dataclass field that carries its documentation."""
    metadata = {k: v for k, v in (("help", meaning), ("unit", unit), ("metric", metric)) if v is not None}
    return field(metadata=metadata) if default is MISSING else field(default=default, metadata=metadata)
