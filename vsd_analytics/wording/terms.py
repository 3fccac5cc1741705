"""Terms and small parts of sentences: one term for one thing, in the language of the page."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import date, datetime
from typing import TYPE_CHECKING, Final

from vsd_analytics.answer import Verdict
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import is_about_days, say
from vsd_analytics.wording.languages import separated

if TYPE_CHECKING:
    from vsd_analytics.figures.week.model_estimate import Estimate

# Sizes of the fractions a headline may use, and the entry of each.
_FRACTIONS: Final = tuple(
    (a / b, f"words.fraction.{a}_{b}")
    for a, b in (
        *((1, 20), (1, 10), (1, 8), (1, 7), (1, 6), (1, 5), (1, 4), (1, 3)),
        *((2, 5), (1, 2), (3, 5), (2, 3), (3, 4), (4, 5), (9, 10)),
    )
)


_PARTS: Final = ((0.95, "all"), (0.6, "most"), (0.45, "half"), (1 / 3, "third"))
"""Least share of a whole and the name of its words, greatest first."""


def moved(change: float) -> str:
    """Say by how much violations moved: "fell by about a seventh", "about doubled", "rose slightly".

    Args:
        change: Relative change, -0.14 for 14 % fewer.
    """
    size = abs(change)
    if size < 0.03:
        return say("words.fell_slightly" if change < 0 else "words.rose_slightly")
    if change > 0.95:
        return say("words.doubled") if change < 1.15 else say("words.times", n=separated(f"{change + 1:.1f}"))
    if change < -0.95:
        return say("words.stopped")
    _, name = min(_FRACTIONS, key=lambda f: abs(f[0] - size))
    return say("words.fell" if change < 0 else "words.rose", fraction=say(name))


def part(share: float) -> str | None:
    """Say what part of a whole lies in one place: "most", "half"; None under a third."""
    return next((say(f"words.part_{name}") for least, name in _PARTS if share >= least), None)


def direction(verdict: Verdict | None) -> str:
    """Return the class of a verdict: good, bad or same."""
    return {"clear_fall": "good", "clear_rise": "bad"}.get(verdict or "", "same")


def verdict_words(estimate: Estimate) -> str:
    """Return the verdict of an estimate in words; too little data where there is none."""
    return said_verdict(estimate.verdict)


def said_verdict(verdict: str | None) -> str:
    """Return a verdict in words; too little data where there is none."""
    return say(f"words.{verdict or 'too_little_data'}")


def camera_name(name: str) -> str:
    """Return how a sentence speaks of a camera: Camera “Aisles”; names that already say camera stay as they are."""
    return name if name.casefold().startswith(("cam", "sensor", "telecam")) else say("words.camera", name=name)


def joined(names: Iterable[str]) -> str:
    """Join names as people do: a, b and c."""
    items = list(names)
    if len(items) < 2:
        return "".join(items)
    return say("format.and", first=", ".join(items[:-1]), last=items[-1])


def n_words(sentence: str) -> int:
    """Count the words of a sentence."""
    return len(sentence.split())


def capital(text: str) -> str:
    """Return `text` with a capital first letter."""
    return text[:1].upper() + text[1:]


def sentence(text: str) -> str:
    """Return `text` with a capital first letter and one full stop at its end."""
    text = text.strip().rstrip(".")
    return f"{text[:1].upper()}{text[1:]}."


def moment(at: datetime) -> str:
    """Return how a sentence speaks of an hour of the week: Saturday 13:00."""
    return f"{day(at.date())} {fmt.clock(at)}"


def day(local_day: date) -> str:
    """Return how a sentence speaks of a day: Saturday in a week, Sat 14 Nov among other days."""
    return fmt.date_short(local_day) if is_about_days() else fmt.weekday(local_day)
