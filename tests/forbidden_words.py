"""The words that no page, message or template may use."""

from __future__ import annotations

import re
from typing import Final

FORBIDDEN: Final = (
    *("infringement", "incident", "offender", "normalised rate", "normalized rate", "per observation"),
    *("sigma", "p-value", "statistically significant", "significant", "significantly", "improved", "worse"),
    *("uptime", "NaN", "null", "cluster", "ROI", "hot zone", "proved", "caused", "because of", "compliance", "family"),
    *("\u00b1", "p < "),
)


def forbidden_in(text: str) -> list[str]:
    """Return the forbidden words of `text`, whole words only, in the order of the list."""
    found = []
    for word in FORBIDDEN:
        start = r"(?<!\w)" if word[0].isalnum() else ""
        end = r"(?!\w)" if word[-1].isalnum() else ""
        flags = 0 if word in ("NaN", "ROI") else re.IGNORECASE
        if re.search(start + re.escape(word) + end, text, flags):
            found.append(word)
    return found
