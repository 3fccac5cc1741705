"""The last ten weeks of a floor (M28), each over all hours it recorded, and what was changed when."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date, timedelta
from string import ascii_uppercase
from typing import Final

from vsd_analytics.answer import Reason
from vsd_analytics.figures import trend as analysis
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.special_days import open_holidays
from vsd_analytics.figures.week import estimates
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_estimate import Estimate, level_estimate
from vsd_analytics.figures.week.model_sections import Target, Trend, TrendMark, TrendWeek, Usual
from vsd_analytics.figures.week.results import Level
from vsd_analytics.stats.trend import WeekRates
from vsd_analytics.stats.usual import usual_range
from vsd_analytics.warehouse.provenance import engines

WEEKS: Final = 10
"""Points of the chart: what its width shows legibly."""


def trend(
    data: WeekData, floor_trend: analysis.FloorTrend, *, level: Level, same_engine_since: date | None = None
) -> Trend:
    """Return the last ten weeks.

    The last of them is the week of the report itself, so that the page never has two values for one figure. A
    week whose own report holds the floor's figures back has none here either. The usual range is made from weeks that
    one engine counted.

    Args:
        data: The week.
        floor_trend: The weeks of the analysis room.
        level: The headline numbers, without what must be held back.
        same_engine_since: Monday of the first week that the engine of this week counted; None = all weeks.
    """
    names = {a.area_id: a.name for a in data.areas}
    weeks = tuple(
        _week(
            week,
            mask=data.mask,
            cameras=floor_trend.cameras,
            own=level if week.monday == data.monday else None,
            why_hidden=data.hidden_in(week.monday).why_floor,
        )
        for week in floor_trend.weeks
    )
    shown = weeks[-WEEKS:]
    first = shown[0].monday if shown else data.monday
    marks = [m for m in floor_trend.marks if m.at.astimezone(data.site.zone).date() >= first]
    confidence = float(data.site.settings.confidence)
    since = same_engine_since or date.min
    alike = [w for w in weeks if not w.missing and w.monday >= since]
    holidays = open_holidays(data.site, data.monday)
    if holidays:  # a week with a holiday says nothing beside weeks without
        alike = []
    return Trend(
        weeks=shown,
        marks=tuple(
            TrendMark(
                label=ascii_uppercase[i % 26],
                at=m.at.astimezone(data.site.zone),
                text=m.text,
                area_name=names.get(m.area_id or ""),
            )
            for i, m in enumerate(marks)
        ),
        usual_violation_rate=_usual([w.violation_rate for w in alike], level.violation_rate, confidence=confidence),
        usual_close=_usual([w.close for w in alike], level.close_time_share, confidence=confidence, most=1.0),
        target_violation_rate=_target(data.floor.target_per_open_h, level.violation_rate),
        holidays=holidays,
        left_out=floor_trend.left_out,
        state=floor_trend.state,
        reason=floor_trend.reason,
        encounter_rate_reason=floor_trend.encounter_rate_reason,
    )


def same_engine_since(data: WeekData, weeks: Sequence[WeekRates]) -> date | None:
    """Return the Monday of the first of some weeks that the engines of this week counted; None = all of them."""
    mondays = [week.monday for week in weeks]
    now = engines(data.site, data.monday, data.sunday)
    if not mondays or not now or set(engines(data.site, mondays[0], data.sunday)) <= set(now):
        return None
    since = data.monday
    for monday in reversed(mondays):
        sent = engines(data.site, monday, monday + timedelta(days=6))
        if sent and sent != now:
            break
        since = monday
    return since


def _usual(
    weeks: Sequence[Estimate | None], now: Estimate | None, *, confidence: float, most: float | None = None
) -> Usual | None:
    """Return the usual range of the weeks but the last, and where this week lies; None where either is unknown."""
    before = [e.value for e in weeks[:-1] if e is not None and e.value is not None]
    usual = usual_range(before, confidence=confidence, most=most)
    if usual is None or now is None or now.value is None:
        return None
    return Usual(lo=usual.lo, hi=usual.hi, n_weeks=usual.n_weeks, position=usual.position(now.value))


def _target(value: float | None, now: Estimate | None) -> Target | None:
    """Return the target and where this week lies; it is above or below only if its whole interval is."""
    if value is None:
        return None
    if now is None or now.lo is None or now.hi is None:
        return Target(value=value)
    return Target(value=value, position="above" if now.lo > value else "below" if now.hi < value else "near")


def _week(
    week: WeekRates, *, mask: Mask, cameras: tuple[str, ...], own: Level | None, why_hidden: Reason | None
) -> TrendWeek:
    _, number, _ = week.monday.isocalendar()
    violation_rate, close, encounter_rate = (
        level_estimate(rate, mask=mask) for rate in (week.violation_rate, week.close, week.encounter_rate)
    )
    if own is not None and week.violation_rate is not None:
        violation_rate, close = own.violation_rate, own.close_time_share if week.close is not None else None
        encounter_rate = own.encounter_rate if week.encounter_rate is not None else None
    elif why_hidden is not None:
        violation_rate, close, encounter_rate = (
            None if e is None else estimates.without_figures(e, why_hidden)
            for e in (violation_rate, close, encounter_rate)
        )
    return TrendWeek(
        iso=week.week,
        number=number,
        monday=week.monday,
        violation_rate=violation_rate,
        close=close,
        encounter_rate=encounter_rate,
        missing=tuple(cameras[i] for i in week.missing),
        coverage=week.coverage,
        reason=week.reason,
    )
