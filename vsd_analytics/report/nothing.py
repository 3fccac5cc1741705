"""The words of a week without any recorded opening hour: because it was closed, nobody looks, or nothing arrived."""

from __future__ import annotations

from dataclasses import dataclass

from vsd_analytics.report import format as fmt
from vsd_analytics.report.model import WeekReport


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
    number = report.week.number
    if not report.coverage.cameras:
        return Nothing(
            rule="no_camera",
            headline="No camera looks at this floor",
            lead="No camera of vsd.toml belongs to this floor, so nothing is known about it.",
            notes=("Add a [[camera]] with this floor to vsd.toml.",),
            title="Nothing can be said about this floor",
            text="Neither that it was quiet nor that it was busy.",
            question="Should a camera look at this floor?",
            data_title="Nothing could be recorded",
        )
    if report.coverage.scheduled_h == 0:
        return Nothing(
            rule="closed",
            headline=f"The site was closed in week {number}",
            lead="The whole week lies outside the opening hours, so nothing was expected and nothing is counted.",
            notes=("If it was open, mend opening or closed in vsd.toml and run the report again.",),
            title=f"Week {number} is no gap in the data",
            text="No opening hour was missed. The next week has nothing to compare with.",
            question="Are the opening hours in vsd.toml still right?",
            data_title="Nothing was to be recorded",
        )
    first, last = fmt.date_span(report.week.monday, report.week.sunday)
    return Nothing(
        rule="no_data",
        headline=f"We have no data for week {number}",
        lead=(
            f"Nothing was recorded in opening hours between {first} and {last}. "
            "This says nothing about how busy the floor was."
        ),
        notes=(_likely_cause(report),),
        title=f"Nothing can be said about week {number}",
        text="Neither that the floor was quiet nor that it was busy. The next week has nothing to compare with.",
        question="Who is told when the cameras or the engine stop, and who starts them again?",
        data_title="Nothing was recorded",
    )


def _likely_cause(report: WeekReport) -> str:
    last = [c.last_record for c in report.coverage.cameras if c.last_record is not None]
    if not last:
        return "No record of any camera was found. Check that the engine's output reaches vsd ingest."
    if max(last).date() >= report.week.monday:
        return "Records came at closed hours only. Check the opening hours in vsd.toml and the clocks of the cameras."
    if len(last) > 1 and (max(last) - min(last)).total_seconds() <= 60:
        return "All cameras stopped at the same minute, which points to the network or the engine, not the cameras."
    return "The cameras stopped at different times. Look at the one that stopped last first."
