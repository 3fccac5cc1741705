"""Earlier questions with what came of them, above the question of the week, and the rows of the log."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from vsd_analytics.figures.week.model_sections import LoggedChangeResult
from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.model.week_agenda import PastQuestion
from vsd_analytics.report.pages.change_story import came_of, result_words, story
from vsd_analytics.report.pages.things_to_know import FALLS
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say

LINES_MAX: Final = 3
"""Earlier questions on a page; all are in the JSON file."""
FOLLOWED: Final = timedelta(weeks=9)
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
    remark = "" if past.answer_text in ("", past.text) else say("asked.said", text=fmt.ended(past.answer_text))
    return AskedLine(
        asked=say("asked.week", week=past.number, question=past.text),
        answer=say(f"asked.{kind}", date=date, by=by) + remark,
        result=came_of(change, day=report.week.sunday) if past.change is not None else "",
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
    told = " ".join(thing.text for thing in report.story.things) if report.story is not None else ""
    results = {
        (line.at, line.text): result_words(line, day=report.week.sunday, is_told=_is_told(line, told))
        for line in report.logged_changes
    }
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


def _is_told(line: LoggedChangeResult, told: str) -> bool:
    """Tell whether the things to know have the whole story of a change."""
    return line.outcome in FALLS and story(line) in told


def _about(area: str | None, is_detected: bool) -> str:
    parts = [fmt.ended(area) if area else "", say("changed.detected") if is_detected else ""]
    return " ".join(p for p in parts if p)
