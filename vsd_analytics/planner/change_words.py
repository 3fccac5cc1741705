"""Logged changes in words: what the log says, what can be said of it, and the figures behind that.

Only a comparison with areas that were left alone may say that a change worked; all else is a range.
"""

from __future__ import annotations

from dataclasses import dataclass

from vsd_analytics.answer import Answers, Cell, Reason, Row, Value, value_of
from vsd_analytics.figures.week.model_sections import ReceivingArea
from vsd_analytics.planner.logged_changes import ChangeSide, PlannerChange
from vsd_analytics.report.pages.logged_changes import amount, not_yet, received
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


def change_words(change: PlannerChange) -> ChangeWords:
    """Return a logged change as texts."""
    answers, sides = change.answers, [side for side in (change.before, change.after) if side is not None]
    is_known = answers is not None and answers["change_places"].state == "ok"
    return ChangeWords(
        number=change.number,
        day=fmt.date_short(change.at.date()),
        place=say("planner.log.site") if change.area is None else change.area.name,
        text=fmt.ended(change.text),
        verdict=_site_verdict(change) if answers is None else _verdict(answers),
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


def _verdict(answers: Answers) -> str:
    """Return the sentence that answers whether a change of an area helped."""
    [entry] = answers["logged_change"].rows
    places, row = answers["change_places"], _so_far(answers)
    if places.state != "ok":
        return say("planner.log.refused", reason=reason_text(places.nothing).rstrip("."))
    so_far = Value.missing(None) if row is None else value_of(row, "so_far_change")
    if entry["outcome"] != "too_early" and not (entry["outcome"] == "cannot_tell" and so_far.lo is None):
        return say(
            f"planner.log.{entry['outcome']}",
            area=entry["name"],
            change=fmt.percent(abs(so_far.value or 0.0)),
            low=amount(so_far.lo),
            high=amount(so_far.hi),
            receivers=received([_receiver(area) for area in answers["change_receivers"].rows]),
            why=not_yet(next(iter(_whys(answers, "not_yet")), None)),
        )
    reason = reason_text(so_far.reason).rstrip(".")
    return say("planner.log.untold", area=entry["name"], reason=reason) if reason else say("came_of.nothing")


def _receiver(area: Row) -> ReceivingArea:
    more = value_of(area, "received_people_change")
    assert more.value is not None
    return ReceivingArea(area_name=str(area["name"]), change=more.value, change_lo=more.lo, change_hi=more.hi)


def _rows(answers: Answers) -> tuple[ChangeEffectRow, ...]:
    """Return the figures of a change; only that of all weeks so far has a verdict: a change has one."""
    [entry] = answers["logged_change"].rows
    so_far, floor = _so_far(answers), _row(answers, "change_parts", whole="floor", part="floor")
    if floor is not None and value_of(floor, "part_change").value is None:
        floor = None
    n = _whole(None if so_far is None else so_far["n_weeks_after"])
    figures = (
        ("running", so_far, "so_far_change"),
        ("close", _row(answers, "change_effects", effect="close_time_share"), "effect_change"),
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
    n, names, so_far, notes = _whole(entry["n_weeks_each_side"]), entry["comparison_names"], _so_far(answers), []
    if entry["design"] == "beside" and isinstance(names, tuple):
        notes.append(say("planner.log.beside", plural=n, n=n, areas=terms.joined(map(str, names))))
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
