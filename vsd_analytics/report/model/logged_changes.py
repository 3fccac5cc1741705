"""Every logged change: what may be said of it, and until when it is watched."""

from __future__ import annotations

from dataclasses import fields, replace
from datetime import date, timedelta

from vsd_analytics.config.change_log import read_log
from vsd_analytics.figures.before_after import BeforeAfterFigure
from vsd_analytics.figures.change_weeks import WATCHED_WEEKS
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.figures.week.change_effects import change_effect
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.lazy_answers import LazyAnswers
from vsd_analytics.figures.week.model_sections import JudgedChange, LoggedChangeResult
from vsd_analytics.site.model import LogEntry


def logged_changes(data: WeekData, answers: LazyAnswers) -> tuple[LoggedChangeResult, ...]:
    """Return the changes of the log from the first day looked at to the end of the week, oldest first."""
    zone = data.site.zone
    here, everywhere = {a.area_id for a in data.areas}, {a.area_id for a in data.site.areas}
    measured = {f.number: f for f in answers.change_effects}
    lines = []
    for number, entry in enumerate(read_log(data.site), 1):
        day = entry.at.astimezone(zone).date()
        if not answers.shown_from <= day <= data.sunday or entry.area_id in everywhere - here:
            continue
        line = LoggedChangeResult(
            number=number, at=entry.at.astimezone(zone), text=entry.text, area_id=entry.area_id, outcome="site_wide"
        )
        lines.append(line if number not in measured else _measured(data, line, measured[number]))
    return tuple(lines)


def _measured(data: WeekData, line: LoggedChangeResult, figure: BeforeAfterFigure) -> LoggedChangeResult:
    change = change_effect(data, figure)
    is_decided = change.outcome in ("works", "moved", "rose")
    is_over = change.foreseen is not None and change.foreseen.reason is not None
    return replace(
        line,
        **{field.name: getattr(change, field.name) for field in fields(JudgedChange)},
        watched_until=_watched_until(data, figure, is_decided=is_decided or is_over),
    )


def _watched_until(data: WeekData, figure: BeforeAfterFigure, *, is_decided: bool) -> date | None:
    """Return the last day on which a running verdict may still change; None once it is clear or the watch is over."""
    zone, day = data.site.zone, figure.at.astimezone(data.site.zone).date()
    start = day if figure.windows is None else figure.windows.after[0]
    until = start + WATCHED_WEEKS * WEEK - timedelta(days=1)

    def is_later(entry: LogEntry) -> bool:
        return entry.area_id == figure.area_id and entry.at.astimezone(zone).date() > day

    later = [e.at.astimezone(zone).date() for e in read_log(data.site) if is_later(e)]
    until = min([until, *(d - timedelta(days=1) for d in later if d <= data.sunday)])
    return None if is_decided or until <= data.sunday else until
