"""Logged changes in words: what the log says, what can be said of it, and the figures behind that.

Only a comparison with areas that were left alone may say that a change worked; all else is a range.
"""

from __future__ import annotations

from dataclasses import dataclass

from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import LoggedChangeEffect
from vsd_analytics.planner.logged_changes import ChangeSide, PlannerChange
from vsd_analytics.report.pages.logged_changes import amount, received
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
    result = change.result
    is_ok = result is not None and result.state == "ok"
    sides = [side for side in (change.before, change.after) if side is not None]
    return ChangeWords(
        number=change.number,
        day=fmt.date_short(change.at.date()),
        place=say("planner.log.site") if change.area is None else change.area.name,
        text=fmt.ended(change.text),
        verdict=_verdict(change),
        rows=_rows(result) if result is not None and is_ok else (),
        notes=_notes(result, has_map=bool(sides)) if result is not None and is_ok else (),
        cautions=tuple(reason_text(r) for r in (*result.doubts, *result.cautions)) if result is not None else (),
        spans=tuple(_span(side) for side in sides),
    )


def _span(side: ChangeSide) -> str:
    first, last = side.days
    return say("planner.log.span", first=fmt.date_short(first), last=fmt.date_short(last))


def _verdict(change: PlannerChange) -> str:
    result, area = change.result, "" if change.area is None else change.area.name
    if result is None:
        return say("planner.log.whole_site" if change.before is None else "planner.log.whole_site_map")
    if result.state != "ok":
        return say("planner.log.refused", reason=reason_text(result.reason).rstrip("."))
    running, said = result.running, result.outcome
    size = "" if running is None else fmt.percent(abs(running.change or 0.0))
    if said != "too_early" and not (said == "cannot_tell" and (running is None or running.change_lo is None)):
        low, high = ("", "") if running is None else (amount(e) for e in (running.change_lo, running.change_hi))
        return say(f"planner.log.{said}", area=area, change=size, low=low, high=high, receivers=received(result))
    reason = reason_text(result.reason if running is None else running.reason).rstrip(".")
    return say("planner.log.untold", area=area, reason=reason) if reason else say("came_of.nothing")


def _rows(result: LoggedChangeEffect) -> tuple[ChangeEffectRow, ...]:
    n = result.n_watched or 0
    figures = (
        (say("planner.log.running", plural=n, n=n, area=result.area_name), result.running),
        (say("planner.log.close", area=result.area_name), result.close),
        (say("planner.log.people", area=result.area_name), result.people),
        (say("planner.log.net"), result.net),
    )
    return tuple(_row(name, e, is_judged=e is result.running) for name, e in figures if e is not None)


def _row(name: str, e: Estimate, *, is_judged: bool) -> ChangeEffectRow:
    """Return a figure; only the running one has a verdict: a change has one."""
    return ChangeEffectRow(
        name=name,
        verdict=terms.verdict_words(e) if is_judged else "",
        change=fmt.signed(e.change),
        likely=fmt.likely_signed(e) or reason_text(e.reason),
    )


def _notes(result: LoggedChangeEffect, *, has_map: bool) -> tuple[str, ...]:
    n, notes = result.n_weeks or 0, []
    if result.design == "beside":
        notes.append(say("planner.log.beside", plural=n, n=n, areas=terms.joined(result.compared_with)))
    if result.moved_elsewhere and result.outcome == "moved":  # else nobody can tell whether it moved
        share = fmt.percent(min(1.0, result.moved_elsewhere))
        notes.append(say("planner.log.elsewhere", share=share, area=result.area_name))
    return tuple(notes if has_map else (*notes, say("planner.log.no_map")))
