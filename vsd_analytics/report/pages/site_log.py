"""What happened at the site, as one list: logged changes, by their letter in the charts, and what was detected."""

from __future__ import annotations

from dataclasses import dataclass

from vsd_analytics.report.model.week import WeekReport
from vsd_analytics.report.words.change_results import ledger_words
from vsd_analytics.wording import format as fmt
from vsd_analytics.wording.catalogue import say


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
    results = {(line.at, line.text): ledger_words(line) for line in report.ledger}
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
