"""The words of the report: one term for one thing, and the list of words it never uses (report brief, 4.2)."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

from vsd_analytics.report import format as fmt
from vsd_analytics.report.model import Estimate, Verdict

# Words and phrases that must not stand on a page, in a message or in a template.
FORBIDDEN: Final = (
    *("infringement", "incident", "offender", "normalised rate", "normalized rate", "per observation"),
    *("sigma", "p-value", "statistically significant", "significant", "significantly", "improved", "worse"),
    *("uptime", "NaN", "null", "cluster", "ROI", "hot zone", "proved", "caused", "because of", "compliance", "family"),
    *("\u00b1", "p < "),
)

VERDICT_WORDS: Final[dict[Verdict, str]] = {
    "clear_fall": "Clear fall",
    "clear_rise": "Clear rise",
    "no_clear_change": "No clear change",
    "too_little_data": "Too little data",
}

# Fractions a headline may use, with the size they stand for.
_FRACTIONS: Final = (
    (1 / 20, "a twentieth"),
    (1 / 10, "a tenth"),
    (1 / 8, "an eighth"),
    (1 / 7, "a seventh"),
    (1 / 6, "a sixth"),
    (1 / 5, "a fifth"),
    (1 / 4, "a quarter"),
    (1 / 3, "a third"),
    (2 / 5, "two fifths"),
    (1 / 2, "half"),
    (3 / 5, "three fifths"),
    (2 / 3, "two thirds"),
    (3 / 4, "three quarters"),
    (4 / 5, "four fifths"),
    (9 / 10, "nine tenths"),
)


def forbidden_in(text: str) -> list[str]:
    """Return the forbidden words that stand in `text`, whole words only, in the order of the list."""
    found = []
    for word in FORBIDDEN:
        start = r"(?<!\w)" if word[0].isalnum() else ""
        end = r"(?!\w)" if word[-1].isalnum() else ""
        flags = 0 if word in ("NaN", "ROI") else re.IGNORECASE
        if re.search(start + re.escape(word) + end, text, flags):
            found.append(word)
    return found


def moved(change: float) -> str:
    """Say by how much violations moved: "fell by about a seventh", "about doubled", "rose slightly".

    Args:
        change: Relative change, -0.14 for 14 % fewer.
    """
    size = abs(change)
    direction = "fell" if change < 0 else "rose"
    if size < 0.03:
        return f"{direction} slightly"
    if change > 0.95:
        return "about doubled" if change < 1.15 else f"rose to about {change + 1:.1f} times last week's"
    if change < -0.95:
        return "almost stopped"
    _, name = min(_FRACTIONS, key=lambda f: abs(f[0] - size))
    return f"{direction} by about {name}"


def direction(verdict: Verdict | None) -> str:
    """Return the class of a verdict: good, bad or same."""
    return {"clear_fall": "good", "clear_rise": "bad"}.get(verdict or "", "same")


def verdict_words(estimate: Estimate) -> str:
    """Return the verdict in words; too little data where there is none."""
    return VERDICT_WORDS[estimate.verdict or "too_little_data"]


def camera_name(name: str) -> str:
    """Return how a sentence speaks of a camera: Camera “Aisles”; names that already say camera stay as they are."""
    return name if name.casefold().startswith(("cam", "sensor")) else f"Camera \u201c{name}\u201d"


def with_people(change: float | None, verdict: Verdict | None) -> str:
    """Say how many more people there were: with 15% more people; empty when it is not known.

    Small changes that are not clear are "about as many people".
    """
    if change is None:
        return ""
    if abs(change) < 0.005 or (abs(change) < 0.05 and verdict not in ("clear_fall", "clear_rise")):
        return "with about as many people"
    return f"with {fmt.fewer_more(change)} people"


def joined(names: Iterable[str]) -> str:
    """Join names as people do: a, b and c."""
    items = list(names)
    return " and ".join([", ".join(items[:-1]), items[-1]] if len(items) > 1 else items)


def n_words(sentence: str) -> int:
    """Count the words of a sentence."""
    return len(sentence.split())


def sentence(text: str) -> str:
    """Return `text` with a capital first letter and one full stop at its end."""
    text = text.strip().rstrip(".")
    return f"{text[:1].upper()}{text[1:]}."
