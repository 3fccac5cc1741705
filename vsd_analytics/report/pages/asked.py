"""What earlier weeks asked, as lines above the week's question: the answer, and what came of it."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.model.week_agenda import PastQuestion
from vsd_analytics.report.words.change_results import came_of
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
    change = next((r for r in report.redesigns if r.number == past.change), None)
    date = "" if past.answered_at is None else fmt.date_short(past.answered_at.date())
    kind = (past.answer or "later").replace("-", "_")
    by = say("asked.by", name=past.by) if past.by else ""
    said = "" if past.answer_text in ("", past.text) else say("asked.said", text=fmt.ended(past.answer_text))
    return AskedLine(
        asked=say("asked.week", week=past.number, question=past.text),
        answer=say(f"asked.{kind}", date=date, by=by) + said,
        result=came_of(change) if past.change is not None else "",
    )
