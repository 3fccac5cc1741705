"""The words of a week without any recorded opening hour: because it was closed, nobody looks, or nothing arrived."""

from __future__ import annotations

from dataclasses import dataclass

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say


@dataclass(frozen=True, slots=True, kw_only=True)
class Nothing:
    """What a page says that has no figures.

    Attributes:
        rule: Name of the case: closed, no_camera or no_data.
        headline: The headline.
        lead: What is known, in a sentence or two.
        notes: What to do about it.
        title: The one thing to know.
        text: Its explanation.
        question: The question of the week.
        data_title: Title of the table of recorded hours.
    """

    rule: str
    headline: str
    lead: str
    notes: tuple[str, ...]
    title: str
    text: str
    question: str
    data_title: str


def nothing(report: WeekReport) -> Nothing:
    """Return the words of a week whose state is no_data; a closed week is not called an outage."""
    if not report.coverage.cameras:
        return _texts(report, "no_camera", notes=(say("nothing.no_camera_note"),))
    if report.coverage.scheduled_h == 0:
        return _texts(report, "closed", notes=(say("nothing.closed_note"),))
    return _texts(report, "no_data", notes=(_likely_cause(report),))


def _texts(report: WeekReport, rule: str, *, notes: tuple[str, ...]) -> Nothing:
    first, last = fmt.date_span(report.week.monday, report.week.sunday)
    week = report.week.number
    return Nothing(
        rule=rule,
        headline=say(f"nothing.{rule}", week=week),
        lead=say(f"nothing.{rule}_lead", first=first, last=last),
        notes=notes,
        title=say(f"nothing.{rule}_title", week=week),
        text=say(f"nothing.{rule}_text"),
        question=say(f"nothing.{rule}_question"),
        data_title=say(f"nothing.{rule}_data"),
    )


def _likely_cause(report: WeekReport) -> str:
    last = [c.last_record for c in report.coverage.cameras if c.last_record is not None]
    if not last:
        return say("nothing.cause_never")
    if max(last).date() >= report.week.monday:
        return say("nothing.cause_closed_hours")
    if len(report.coverage.cameras) == 1:
        return say("nothing.cause_one")
    if len(last) > 1 and (max(last) - min(last)).total_seconds() <= 60:
        return say("nothing.cause_all")
    return say("nothing.cause_apart")
