"""What came of logged changes and earlier questions: a sentence each, lines above the question, rows of the log.

A change worked, moved elsewhere, rose, or nobody can tell yet: `vsd_analytics.figures.change_outcome` says which.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from vsd_analytics.answer import Reason
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import LoggedChangeEffect, LoggedChangeResult, ReceivingArea
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.model.week_agenda import PastQuestion
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording import terms
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.reasons import reason_text


def came_of(change: LoggedChangeEffect | None) -> str:
    """Return what became of the time too close in the area of a change; None = nothing is known of it."""
    if change is None:
        return say("came_of.nothing")
    running = change.running
    likely = "" if running is None else between(running)
    match change.outcome:
        case "too_early":
            reason = reason_text(change.reason if running is None else running.reason).rstrip(".")
            return say("came_of.early", reason=reason) if reason else say("came_of.nothing")
        case "works" | "fell" as said:
            none = "_none" if running is not None and is_none(running) else ""
            beside = terms.joined(change.compared_with)
            took_up, why = received(change.receivers), not_yet(change.not_yet)
            return say(f"came_of.{said}{none}", likely=likely, areas=beside, receivers=took_up, why=why)
        case "moved":
            share = fmt.percent(min(1.0, change.moved_elsewhere or 0.0))
            return say("came_of.moved", share=share, receivers=received(change.receivers))
        case said:
            return say(f"came_of.{said}", likely=likely)


def not_yet(reason: Reason | None) -> str:
    """Return why a fall is not said to work, as a sentence; empty where nothing is in its way."""
    return "" if reason is None else terms.sentence(reason_text(reason))


def received(receivers: Sequence[ReceivingArea]) -> str:
    """Return which areas took people up, each with its range, or that none clearly did."""
    if not receivers:
        return say("came_of.nobody_took_up")
    areas = [say("came_of.took_up_area", area=r.area_name, likely=_more(r)) for r in receivers]
    return say("came_of.took_up", areas=terms.joined(areas))


def _more(area: ReceivingArea) -> str:
    low = fmt.signed(area.change if area.change_lo is None else area.change_lo)
    if area.change_hi is None:
        return say("came_of.took_up_from", low=low)
    return say("came_of.took_up_range", low=low, high=fmt.signed(area.change_hi))


def is_none(estimate: Estimate) -> bool:
    """Tell whether a change is a fall to none at all."""
    return estimate.change is not None and estimate.change <= -1


def result_words(line: LoggedChangeResult) -> str:
    """Return what a line of the log says after the change itself; empty for a change of the whole site."""
    if line.outcome == "site_wide":
        return ""
    parts = [_in_area(line), _on_floor(line)]
    if line.watched_until is not None:
        parts.append(say("logged_changes.until", date=fmt.date_short(line.watched_until)))
    return " ".join(part for part in parts if part)


def _in_area(line: LoggedChangeResult) -> str:
    if line.outcome == "alone":
        return say("came_of.alone")
    if line.avoided_min is None or line.avoided_lo is None or line.avoided_hi is None:
        reason = reason_text(line.reason).rstrip(".")
        return say("came_of.early", reason=reason) if reason else say("came_of.nothing")
    low, high = _minutes(line.avoided_lo), _minutes(line.avoided_hi)
    n = fmt.count(_rounded(abs(line.avoided_min)))
    least, most = (fmt.count(_rounded(abs(end))) for end in (line.avoided_lo, line.avoided_hi))
    return say(
        f"logged_changes.{line.outcome}",
        least=least,
        most=most, n=n, low=low, high=high, usual=fmt.count(_rounded(line.usual_min or 0.0)),
        areas=terms.joined(line.compared_with), receivers=received(line.receivers), why=not_yet(line.not_yet),
    )  # fmt: skip


def _on_floor(line: LoggedChangeResult) -> str:
    lo, hi = line.floor_avoided_lo, line.floor_avoided_hi
    if lo is None or hi is None:
        return ""
    way = "fewer" if lo > 0 else "more" if hi < 0 else "either"
    if line.outcome == "cannot_tell" and way == "either":  # what nobody can tell of the area has not moved the floor
        return ""
    return say(f"logged_changes.floor_{way}", low=_minutes(lo), high=_minutes(hi))


def _minutes(avoided: float) -> str:
    """Return an end of a range: 120 fewer, 80 more, no fewer."""
    n = _rounded(abs(avoided))
    if not n:
        return say("logged_changes.none")
    return say("logged_changes.fewer" if avoided > 0 else "logged_changes.more", n=fmt.count(n))


def _rounded(minutes: float) -> float:
    """Return minutes with two digits: a range of hundreds is not known to the minute."""
    return float(f"{minutes:.2g}")


def between(estimate: Estimate) -> str:
    """Return the range of a change of time in words: between 30% less and 50% more, up to 30% less."""
    lo, hi = estimate.change_lo, estimate.change_hi
    if lo is None or hi is None:
        return amount(estimate.change)
    if is_none(estimate):
        return say("came_of.none", most=fmt.percent(1 + hi))
    return say("came_of.between", low=amount(lo), high=amount(hi))


def amount(change: float | None) -> str:
    """Return a change of time in words: 14% less, 8% more, as much as before."""
    return say("came_of.same") if round((change or 0.0) * 100) == 0 else fmt.less_more(change)


LINES_MAX: Final = 3
"""Earlier questions on a page; all are in the JSON file."""
FOLLOWED: Final = timedelta(weeks=12)
"""What was tried is followed for so long; other answers are reported once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AskedLine:
    """One earlier question.

    Attributes:
        asked: Which week asked what.
        answer: What was answered, by whom.
        result: What came of it; empty where nothing was tried.
    """

    asked: str
    answer: str
    result: str


def asked_lines(report: WeekReport) -> tuple[AskedLine, ...]:
    """Return the earlier questions that have something new: a change that is followed, or the answer of this week."""
    if report.agenda is None:
        return ()
    return tuple(_line(p, report) for p in reversed(report.agenda.asked) if _is_news(p, report))[:LINES_MAX]


def _is_news(past: PastQuestion, report: WeekReport) -> bool:
    if past.answered_at is None:
        return False
    age = report.week.sunday - past.answered_at.date()
    return age < (FOLLOWED if past.change is not None else timedelta(days=14))


def _line(past: PastQuestion, report: WeekReport) -> AskedLine:
    change = next((r for r in report.change_effects if r.number == past.change), None)
    date = "" if past.answered_at is None else fmt.date_short(past.answered_at.date())
    kind = (past.answer or "later").replace("-", "_")
    by = say("asked.by", name=past.by) if past.by else ""
    said = "" if past.answer_text in ("", past.text) else say("asked.said", text=fmt.ended(past.answer_text))
    return AskedLine(
        asked=say("asked.week", week=past.number, question=past.text),
        answer=say(f"asked.{kind}", date=date, by=by) + said,
        result=came_of(change) if past.change is not None else "",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class LogRow:
    """One line of the log: texts.

    Attributes:
        label: Its letter in the charts of the weeks; empty without charts and for what only one list knows.
        at: When.
        text: What.
        about: Its area, and whether it was found rather than logged; empty for neither.
        result: What it avoided, or that nobody can tell yet; empty where nothing is compared.
        is_news: It has a result, or falls into the weeks compared and is no gap of this week's cameras, which the page
            shows with the data. The page folds the rest.
    """

    label: str
    at: str
    text: str
    about: str
    result: str
    is_news: bool


def log_rows(report: WeekReport, *, with_weeks: bool) -> tuple[LogRow, ...]:
    """Return the lines, oldest first.

    Args:
        report: The report.
        with_weeks: The list is below the charts of the weeks, so it also explains their marks.
    """
    marks = report.trend.marks if with_weeks and report.trend is not None else ()
    rows = [(m.at, m.label, m.text, m.area_name, False) for m in marks]
    known = {(m.at, m.text) for m in marks}
    rows += [
        (line.at, "", line.text, line.area_name, line.kind == "detected")
        for line in report.log
        if (line.at, line.text) not in known
    ]
    first = (report.previous or report.week).monday
    gaps = {(o.start, True) for o in report.coverage.outages}
    results = {(line.at, line.text): result_words(line) for line in report.logged_changes}
    return tuple(
        LogRow(
            result=results.get((at, text), ""),
            label=label,
            at=fmt.instant_short(at),
            text=fmt.ended(text),
            about=_about(area, is_detected),
            is_news=bool(results.get((at, text))) or (at.date() >= first and (at, is_detected) not in gaps),
        )
        for at, label, text, area, is_detected in sorted(rows, key=lambda row: (row[0], row[1] == "", row[1]))
    )


def _about(area: str | None, is_detected: bool) -> str:
    parts = [fmt.ended(area) if area else "", say("changed.detected") if is_detected else ""]
    return " ".join(p for p in parts if p)
