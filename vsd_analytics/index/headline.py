"""The sentences of the index: the headline over all floors, its lead, and one line for each earlier week.

Pure functions of the twins, one branch each for what floors can amount to. Numbers of floors and sites are words, so
that every figure on the page is a twin's.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import date
from typing import Final

from vsd_analytics.index.floors import Floor, Standing, standing, verdict_of
from vsd_analytics.index.read import Twin
from vsd_analytics.report import format as fmt
from vsd_analytics.report.model import Span

_NUMBERS: Final = (
    *("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"),
)
NAMED: Final = 3
"""Floors a sentence names; the others are counted."""
_CHANGED: Final = frozenset[Standing]({"fall", "rise"})
_UNCHANGED: Final = frozenset[Standing]({"same", "none"})
_WITHOUT_DATA: Final = frozenset[Standing]({"no_data", "absent"})


def headline(floors: Sequence[Floor], monday: date) -> str:
    """Return the sentence over all floors for a week: how many changed clearly, how many did not.

    Args:
        floors: All floors.
        monday: First day of the week.
    """
    only = floors[0].twin(monday) if len(floors) == 1 else None
    if only is not None:
        return only.story.headline.strip().rstrip(".")
    found = [standing(f.twin(monday)) for f in floors]
    n_changed, n_unchanged = (sum(s in kind for s in found) for kind in (_CHANGED, _UNCHANGED))
    n_unknown = len(found) - n_changed - n_unchanged
    if all(s in _WITHOUT_DATA for s in found):
        return "No floor has data for this week"
    if n_unknown == len(found):
        return "No floor can be compared with the week before"
    if all(s == "none" for s in found):
        return "No violations were recorded on any floor"
    if n_changed == len(found):
        return f"{'Both' if n_changed == 2 else f'All {in_words(n_changed)}'} floors changed clearly this week"
    parts = [f"{in_words(n_changed)} {'floor' if n_changed < 2 else 'floors'} changed clearly"]
    if n_changed and n_unchanged:
        parts.append(f"{in_words(n_unchanged)} did not")
    if n_unknown:
        parts.append(f"{in_words(n_unknown)} cannot be compared")
    if len(parts) == 1:
        parts[0] += " this week"
    return _capital("; ".join(parts))


def lead(floors: Sequence[Floor], monday: date) -> tuple[Span, ...]:
    """Return the sentences below the headline: how many floors there are, which changed, which lack data.

    Those of a single floor are its report's.
    """
    only = floors[0].twin(monday) if len(floors) == 1 else None
    if only is not None:
        return only.story.lead
    said = [(f, standing(f.twin(monday))) for f in floors]
    spans = [Span(text=f"{_capital(_places(floors))}.")]
    changed = [(f, t) for f, s in said if s in _CHANGED and (t := f.twin(monday)) is not None]
    for floor, twin in changed[:NAMED]:
        spans += [Span(text=" "), Span(text=f"{floor.full_name}:", is_strong=True), Span(text=f" {_change(twin)}.")]
    if len(changed) > NAMED:
        spans.append(Span(text=f" {_capital(in_words(len(changed) - NAMED))} more changed clearly."))
    return (*spans, *(Span(text=f" {text}") for text in _lacking(said)))


def week_line(floors: Sequence[Floor], monday: date) -> str:
    """Return the one line an earlier week gets: which floors changed clearly and which lack data, if any."""
    if len(floors) == 1:
        only = floors[0].twin(monday)
        return "" if only is None else only.story.headline.strip().rstrip(".")
    there = [(f, t, standing(t)) for f in floors if (t := f.twin(monday)) is not None]
    told = [
        f"{f.full_name}: {'clear fall' if s == 'fall' else 'clear rise'}, {fmt.signed(t.level.often.change)}"
        for f, t, s in there
        if s in _CHANGED
    ]
    told += [f"{f.full_name}: {short_reason(t)}" for f, t, s in there if s in ("no_data", "incomplete")]
    if told:
        rest = len(told) - NAMED
        return "; ".join(told[:NAMED]) + (f"; and {in_words(rest)} more" if rest > 0 else "")
    if there and all(s == "none" for _, _, s in there):
        return "No violations were recorded on any floor"
    if any(s in _UNCHANGED for _, _, s in there):
        return "No clear change on any floor"
    return "Nothing could be compared" if there else ""


def short_reason(twin: Twin) -> str:
    """Return in a few words what an abnormal week is: no data, 38% of open hours recorded, first week."""
    match twin.state:
        case "no_data":
            return "no data"
        case "too_incomplete":
            return f"{fmt.percent(twin.coverage.share)} of open hours recorded"
        case "first_week":
            return "first week"
        case "settings_changed":
            return "a setting changed"
        case "empty":
            return "no violations"
        case _:
            return "not compared" if verdict_of(twin.level.often) is None else ""


def in_words(n: int) -> str:
    """Return a small number as a word.

    Example:
        >>> in_words(0), in_words(3), in_words(13)
        ('no', 'three', '13')
    """
    return _NUMBERS[n] if n < len(_NUMBERS) else f"{n:,}"


def _places(floors: Sequence[Floor]) -> str:
    n_sites = len({(f.key.project, f.key.site_id) for f in floors})
    where = "one site" if n_sites == 1 else f"{in_words(n_sites)} sites"
    return f"{in_words(len(floors))} floors at {where}"


def _change(twin: Twin) -> str:
    often = twin.level.often
    likely = fmt.likely_change(often)
    return f"{fmt.fewer_more(often.change)} violations in an open hour{f' ({likely})' if likely else ''}"


def _lacking(said: Iterable[tuple[Floor, Standing]]) -> list[str]:
    """Return one sentence for each way in which floors lack data this week."""
    by_kind: dict[Standing, list[str]] = {}
    for floor, found in said:
        by_kind.setdefault(found, []).append(floor.full_name)
    forms: tuple[tuple[Standing, str], ...] = (
        ("no_data", "No data from {}."),
        ("incomplete", "Too incomplete to compare: {}."),
        ("absent", "No report of this week: {}."),
    )
    return [form.format(_some(by_kind[kind])) for kind, form in forms if kind in by_kind]


def _some(names: list[str]) -> str:
    """Return the names, those beyond the first three counted."""
    rest = len(names) - NAMED
    return "; ".join(names[:NAMED]) + (f"; and {in_words(rest)} more" if rest > 0 else "")


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
