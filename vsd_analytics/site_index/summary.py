"""The sentences of the index: the headline over all floors, its lead, and one line for each earlier week.

Pure functions of the reports, one branch for each case. Numbers of floors and sites are words, so that every figure on
the page comes from a report.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import date
from typing import Final

from vsd_analytics.report.model.week import Span
from vsd_analytics.site_index.floor_weeks import FloorWeeks, Standing, standing, verdict_of
from vsd_analytics.site_index.read_reports import IndexedReport
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.languages import separated
from vsd_analytics.wording.terms import capital, sentence, verdict_words

NAMED: Final = 3
"""Floors a sentence names; the others are counted."""
_CHANGED: Final = frozenset[Standing]({"fall", "rise"})
_UNCHANGED: Final = frozenset[Standing]({"same", "none"})
_WITHOUT_DATA: Final = frozenset[Standing]({"no_data", "absent"})


def headline(floors: Sequence[FloorWeeks], monday: date) -> str:
    """Return the sentence over all floors for a week: how many changed clearly, how many did not.

    Args:
        floors: All floors.
        monday: First day of the week.
    """
    only = floors[0].report(monday) if len(floors) == 1 else None
    if only is not None:
        return only.story.headline.strip().rstrip(".")
    standings = [standing(f.report(monday)) for f in floors]
    n_changed, n_unchanged = (sum(s in kind for s in standings) for kind in (_CHANGED, _UNCHANGED))
    n_unknown = len(standings) - n_changed - n_unchanged
    if all(s in _WITHOUT_DATA for s in standings):
        return say("index.headline.no_data")
    if n_unknown == len(standings):
        return say("index.headline.nothing_compared")
    if all(s == "none" for s in standings):
        return say("index.headline.none")
    if n_changed == len(standings):
        return say("index.headline.both" if n_changed == 2 else "index.headline.all", n=in_words(n_changed))
    is_all = not n_unknown and not (n_changed and n_unchanged)
    n, plural = in_words(n_changed), max(n_changed, 1)
    parts = [say("index.headline.changed_this_week" if is_all else "index.headline.changed", plural=plural, n=n)]
    if n_changed and n_unchanged:
        parts.append(say("index.headline.did_not", n=in_words(n_unchanged)))
    if n_unknown:
        parts.append(say("index.headline.not_compared", n=in_words(n_unknown)))
    return capital("; ".join(parts))


def lead(floors: Sequence[FloorWeeks], monday: date) -> tuple[Span, ...]:
    """Return the sentences below the headline: how many floors there are, which changed, which lack data.

    Those of a single floor are its report's.
    """
    only = floors[0].report(monday) if len(floors) == 1 else None
    if only is not None:
        return only.story.lead
    floor_standings = [(f, standing(f.report(monday))) for f in floors]
    spans = [Span(text=sentence(_places(floors)))]
    changed = [(f, t) for f, s in floor_standings if s in _CHANGED and (t := f.report(monday)) is not None]
    for floor, report in changed[:NAMED]:
        spans += [Span(text=" "), Span(text=f"{floor.full_name}:", is_strong=True), Span(text=f" {_change(report)}.")]
    if len(changed) > NAMED:
        spans += [Span(text=" "), Span(text=capital(say("index.more_changed", n=in_words(len(changed) - NAMED))))]
    return (*spans, *(Span(text=f" {text}") for text in _lacking(floor_standings)))


def week_line(floors: Sequence[FloorWeeks], monday: date) -> str:
    """Return the one line an earlier week gets: which floors changed clearly and which lack data, if any."""
    if len(floors) == 1:
        only = floors[0].report(monday)
        return "" if only is None else only.story.headline.strip().rstrip(".")
    there = [(f, t, standing(t)) for f in floors if (t := f.report(monday)) is not None]
    named = [
        say(
            "index.changed",
            floor=f.full_name,
            verdict=_small(verdict_words(t.level.violation_rate)),
            change=fmt.signed(t.level.violation_rate.change),
        )
        for f, t, s in there
        if s in _CHANGED
    ]
    named += [f"{f.full_name}: {short_reason(t)}" for f, t, s in there if s in ("no_data", "incomplete")]
    if named:
        return some(named)
    if there and all(s == "none" for _, _, s in there):
        return say("index.headline.none")
    if any(s in _UNCHANGED for _, _, s in there):
        return say("index.no_change")
    return say("index.nothing_compared") if there else ""


def short_reason(report: IndexedReport) -> str:
    """Return in a few words what an abnormal week is: no data, 38% of open hours recorded, first week."""
    match report.state:
        case "no_data":
            return say("index.no_data")
        case "too_incomplete" if report.is_so_far:
            return say("index.not_over")
        case "too_incomplete":
            return say("index.recorded", share=fmt.percent(report.coverage.share))
        case "first_week":
            return say("index.first_week")
        case "settings_changed":
            return say("index.setting_changed")
        case "empty":
            return say("index.no_violations")
        case _:
            return say("index.not_compared") if verdict_of(report.level.violation_rate) is None else ""


def in_words(n: int) -> str:
    """Return a small number as a word.

    Example:
        >>> in_words(0), in_words(3), in_words(13)
        ('no', 'three', '13')
    """
    words = say("index.numbers").split()
    return words[n] if n < len(words) else separated(f"{n:,}")


def _places(floors: Sequence[FloorWeeks]) -> str:
    n_sites = len({(f.key.project, f.key.site_id) for f in floors})
    return say("index.places", plural=n_sites, floors=in_words(len(floors)), sites=in_words(n_sites))


def _change(report: IndexedReport) -> str:
    violation_rate = report.level.violation_rate
    likely = fmt.likely_change(violation_rate)
    if likely:
        return say("index.change_likely", change=fmt.fewer_more(violation_rate.change), likely=likely)
    return say("index.change", change=fmt.fewer_more(violation_rate.change))


def _lacking(floor_standings: Iterable[tuple[FloorWeeks, Standing]]) -> list[str]:
    """Return one sentence for each way in which floors lack data this week."""
    by_kind: dict[Standing, list[str]] = {}
    for floor, floor_standing in floor_standings:
        by_kind.setdefault(floor_standing, []).append(floor.full_name)
    kinds: tuple[Standing, ...] = ("no_data", "incomplete", "absent")
    return [say(f"index.lacking.{kind}", floors=some(by_kind[kind])) for kind in kinds if kind in by_kind]


def some(names: list[str]) -> str:
    """Return names as one text, those beyond the first three counted."""
    text, n_more = "; ".join(names[:NAMED]), len(names) - NAMED
    return say("index.and_more", text=text, n=in_words(n_more)) if n_more > 0 else text


def _small(text: str) -> str:
    return text[:1].lower() + text[1:]
