"""Where the shipped SQL, report files and pages of the manual are: inside the wheel, or at the top of a checkout."""

from __future__ import annotations

from pathlib import Path
from typing import Final

_PACKAGE = Path(__file__).resolve().parent


def shipped(folder: str) -> Path:
    """Return the folder `sql`, `reports` or `docs`.

    Args:
        folder: "sql", "reports" or "docs".

    Returns:
        The folder inside the installed wheel when there is one, else the one at the top of the checkout.

    Raises:
        FileNotFoundError: Neither exists (a broken installation).
    """
    for candidate in (_PACKAGE / "_shipped" / folder, _PACKAGE.parent / folder):
        if candidate.is_dir():
            return candidate
    raise FileNotFoundError(f"the shipped folder {folder!r} is missing: reinstall vsd-analytics")


def _languages() -> tuple[str, ...]:
    files = sorted((shipped("reports") / "wording").glob("??.toml"))
    return (DEFAULT_LANGUAGE, *(f.stem for f in files if f.stem != DEFAULT_LANGUAGE))


DEFAULT_LANGUAGE: Final = "en"
LANGUAGES: Final = _languages()
"""Languages of pages, by ISO 639-1: each is a file of sentences. The first is that of a site that chooses none."""
