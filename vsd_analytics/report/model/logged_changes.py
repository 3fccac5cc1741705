"""Every logged change: what each avoided, what became of the whole floor, and until when it is watched.

No estimator of its own: the running verdict and the net effect of M27, times the person-minutes of a week before.
"""

from __future__ import annotations

from dataclasses import replace
from datetime import date, timedelta

from vsd_analytics.config.change_log import read_log
from vsd_analytics.figures.before_after import BeforeAfterFigure
from vsd_analytics.figures.change_weeks import WATCHED_WEEKS
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.figures.week.change_effects import change_effect, is_held_back
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.lazy_answers import LazyAnswers
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_sections import LoggedChangeResult
from vsd_analytics.site.model import LogEntry


def logged_changes(data: WeekData, found: LazyAnswers) -> tuple[LoggedChangeResult, ...]:
    """Return the changes of the log from the first day looked at to the end of the week, oldest first."""
    zone = data.site.zone
    here, everywhere = {a.area_id for a in data.areas}, {a.area_id for a in data.site.areas}
    measured = {f.number: f for f in found.change_effects}
    lines = []
    for number, entry in enumerate(read_log(data.site), 1):
        day = entry.at.astimezone(zone).date()
        if not found.shown_from <= day <= data.sunday or entry.area_id in everywhere - here:
            continue
        line = LoggedChangeResult(
            number=number, at=entry.at.astimezone(zone), text=entry.text, area_id=entry.area_id, outcome="site_wide"
        )
        lines.append(line if number not in measured else _measured(data, line, measured[number]))
    return tuple(lines)


def _measured(data: WeekData, line: LoggedChangeResult, found: BeforeAfterFigure) -> LoggedChangeResult:
    change = change_effect(data, found)
    said = change.outcome
    running, net, floor = change.running, change.net, found.floor
    line = replace(
        line,
        area_name=change.area_name,
        outcome=said,
        n_watched=change.n_watched,
        watched_until=_watched_until(data, found, is_decided=said in ("works", "moved", "rose")),
        compared_with=change.compared_with,
        receivers=change.receivers,
        not_yet=change.not_yet,
        reason=change.reason if running is None else running.reason,
    )
    if floor is None or floor.area_min is None or floor.floor_min is None or is_held_back(data, found):
        return line
    value, lo, hi = _avoided(running, floor.area_min)
    whole, whole_lo, whole_hi = _avoided(net, floor.floor_min)
    return replace(
        line,
        usual_min=floor.area_min,
        avoided_min=value,
        avoided_lo=lo,
        avoided_hi=hi,
        floor_avoided_min=whole,
        floor_avoided_lo=whole_lo,
        floor_avoided_hi=whole_hi,
    )


def _avoided(effect: Estimate | None, usual_min: float) -> tuple[float | None, float | None, float | None]:
    """Return what a change takes from the minutes of a usual week: best value, least and most."""
    if effect is None or effect.change is None:
        return None, None, None
    lo = None if effect.change_hi is None else -effect.change_hi * usual_min
    hi = None if effect.change_lo is None else -effect.change_lo * usual_min
    return -effect.change * usual_min, lo, hi


def _watched_until(data: WeekData, found: BeforeAfterFigure, *, is_decided: bool) -> date | None:
    """Return the last day on which a running verdict may still change; None once it is clear or the watch is over."""
    zone, day = data.site.zone, found.at.astimezone(data.site.zone).date()
    start = day if found.windows is None else found.windows.after[0]
    until = start + WATCHED_WEEKS * WEEK - timedelta(days=1)

    def is_later(entry: LogEntry) -> bool:
        return entry.area_id == found.area_id and entry.at.astimezone(zone).date() > day

    later = [e.at.astimezone(zone).date() for e in read_log(data.site) if is_later(e)]
    until = min([until, *(d - timedelta(days=1) for d in later if d <= data.sunday)])
    return None if is_decided or until <= data.sunday else until
