"""Logged changes in words: what the log says, what can be said of it, and the figures behind that.

Only a comparison with areas that were left alone may say that a change worked; all else is a range.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date

from vsd_analytics.answer import Answers, Cell, Reason, Row, Value, value_of
from vsd_analytics.planner.logged_changes import ChangeSide, PlannerChange
from vsd_analytics.report.pages.change_story import came_of
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeEffectRow:
    """A figure of a change: its verdict in words, the change, its likely range."""

    name: str
    verdict: str
    change: str
    likely: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeWords:
    """A logged change as texts.

    Attributes:
        number: Its place in the log, from 1.
        day: Mon 12 Oct.
        place: The area's name, or the whole site.
        text: What the log says; free text.
        verdict: The sentence that answers whether it helped.
        rows: The area's change and the net effect on the whole floor, with ranges.
        notes: Whom it is compared with, and what moved elsewhere.
        cautions: What the data could not rule out.
        spans: The days before and after; empty where there are none yet.
    """

    number: int
    day: str
    place: str
    text: str
    verdict: str
    rows: tuple[ChangeEffectRow, ...]
    notes: tuple[str, ...]
    cautions: tuple[str, ...]
    spans: tuple[str, ...]


def change_words(change: PlannerChange, *, day: date | None = None) -> ChangeWords:
    """Return a logged change as texts.

    Args:
        change: The change.
        day: Last day of the page.
    """
    answers, sides = change.answers, [side for side in (change.before, change.after) if side is not None]
    is_known = answers is not None and answers["change_places"].state == "ok"
    return ChangeWords(
        number=change.number,
        day=fmt.date_short(change.at.date()),
        place=say("planner.log.site") if change.area is None else change.area.name,
        text=fmt.ended(change.text),
        verdict=_site_verdict(change) if change.result is None else came_of(change.result, day=day),
        rows=_rows(answers) if answers is not None and is_known else (),
        notes=_notes(answers, has_map=bool(sides)) if answers is not None and is_known else (),
        cautions=() if answers is None else _cautions(answers),
        spans=tuple(_span(side) for side in sides),
    )


def _span(side: ChangeSide) -> str:
    first, last = side.days
    return say("planner.log.span", first=fmt.date_short(first), last=fmt.date_short(last))


def _site_verdict(change: PlannerChange) -> str:
    return say("planner.log.whole_site" if change.before is None else "planner.log.whole_site_map")


def _rows(answers: Answers) -> tuple[ChangeEffectRow, ...]:
    """Return the figures of a change; only that of all weeks so far has a verdict: a change has one."""
    [entry] = answers["logged_change"].rows
    so_far, floor = _so_far(answers), _row(answers, "change_parts", whole="floor", part="floor")
    if floor is not None and value_of(floor, "part_change").value is None:
        floor = None
    n = _whole(None if so_far is None else so_far["n_weeks_after"])
    figures = (
        ("running", so_far, "so_far_change"),
        ("people", _row(answers, "change_places", place="area"), "place_people_change"),
        ("net", floor, "part_change"),
    )
    return tuple(
        _figure(
            say(f"planner.log.{name}", plural=n, n=n, area=entry["name"]),
            value_of(row, column),
            verdict=terms.said_verdict(_text(row["so_far_verdict"])) if row is so_far else "",
        )
        for name, row, column in figures
        if row is not None
    )


def _figure(name: str, change: Value, *, verdict: str) -> ChangeEffectRow:
    likely = fmt.likely_between(change.lo, change.hi) or reason_text(change.reason)
    return ChangeEffectRow(name=name, verdict=verdict, change=fmt.signed(change.value), likely=likely)


def _notes(answers: Answers, *, has_map: bool) -> tuple[str, ...]:
    [entry] = answers["logged_change"].rows
    names, so_far, notes = entry["comparison_names"], _so_far(answers), []
    if entry["design"] == "beside" and isinstance(names, tuple):
        notes.append(say("planner.log.beside", areas=terms.joined(map(str, names))))
    taken_up = None if so_far is None else value_of(so_far, "taken_up_share").value
    if taken_up and entry["outcome"] == "moved":  # else nobody can tell whether it moved
        notes.append(say("planner.log.elsewhere", share=fmt.percent(min(1.0, taken_up)), area=entry["name"]))
    return tuple(notes if has_map else (*notes, say("planner.log.no_map")))


def _cautions(answers: Answers) -> tuple[str, ...]:
    """Return what speaks against the comparison, and what the data could not rule out."""
    return tuple(reason_text(why) for why in _whys(answers, "doubt", "caution"))


def _whys(answers: Answers, *kinds: str) -> list[Reason]:
    """Return the reasons in some kinds of notes on the entry."""
    notes = [note for _, note in answers["logged_change"].notes if note.code in {f"logged_change.{k}" for k in kinds}]
    return [why for note in notes if isinstance(why := note.values["why"], Reason)]


def _so_far(answers: Answers) -> Row | None:
    return next(iter(answers["change_so_far"].rows), None)


def _row(answers: Answers, name: str, **keys: str) -> Row | None:
    """Return the row of an answer that has these keys; None where there is none."""
    return next(answers[name].where(**keys), None)


def _text(cell: Cell) -> str | None:
    return cell if isinstance(cell, str) else None


def _whole(cell: Cell) -> int:
    return cell if isinstance(cell, int) else 0
