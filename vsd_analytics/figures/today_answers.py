"""The card of the day as answers: both days, the hours until tomorrow night, unusual hours, silent cameras."""

from __future__ import annotations

from datetime import timedelta
from typing import Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Sum, Value
from vsd_analytics.figures.forecast_answers import unusual_answer
from vsd_analytics.figures.today import DayLevel, Today, TodayHour
from vsd_analytics.figures.values import known, lack
from vsd_analytics.site.model import Site
from vsd_analytics.stats.forecast import MIN_WEEKS

_COUNTED: Final = Column("n_violations", "count", "violations")
_ESTIMATE: Final = Column("violations_estimate", "rate", "violations", tells=("n_violations",))
DAYS: Final = (
    Column("floor_id", "key"),
    Column("local_date", "key"),
    Column("is_open", "fact"),
    Column("is_over", "fact"),
    Column("until_hour", "fact"),
    Column("n_open_hours", "fact", "hours"),
    Column("n_recorded_hours", "fact", "hours"),
    _COUNTED,
    _ESTIMATE,
    Column("usual_lo", "rate", "violations"),
    Column("usual_hi", "rate", "violations"),
    Column("position", "fact"),
    Column("n_days", "fact", "days"),
)
"""Columns of `today_days`."""
HOURS: Final = (
    Column("floor_id", "key"),
    Column("local_date", "key"),
    Column("local_hour", "key"),
    Column("is_over", "fact"),
    _COUNTED,
    _ESTIMATE,
    Column("usual", "rate", "violations", "M25"),
    Column("people_seen", "people", "people_in_view"),
    Column("people", "people", "people_in_view", "M25"),
)
"""Columns of `today_hours`."""
SILENT: Final = (
    Column("floor_id", "key"),
    Column("camera_id", "key"),
    Column("last_date", "fact"),
    Column("last_hour", "fact"),
    Column("n_open_hours", "fact", "hours"),
)
"""Columns of `silent_cameras`."""
_NOT_OVER: Final = Reason("today.not_over")


def today_answers(today: Today, site: Site, *, inputs: str) -> tuple[Answer, ...]:
    """Return what to know about a floor today.

    `today_days`: yesterday and today, also where the site is closed; violations counted in the open hours that are
    over, and of all cameras in the recorded hours, with the range in which such days lie and where this one lies
    ("below", "within", "above"). `today_hours`: each open hour of yesterday, today and tomorrow; violations counted,
    those of all cameras, those usual, people in view and those expected (M25). `unusual_hours` (M24). `silent_cameras`:
    those that send nothing, the hour they last recorded, and open hours since.

    Args:
        today: The card's numbers.
        site: The site.
        inputs: Hash of the facts.
    """
    day = today.at.date()
    yesterday, tomorrow = day - timedelta(days=1), day + timedelta(days=1)
    settings = site.settings.settings_id()
    holds = HoldsFor(site.site_id, today.floor_id, yesterday, tomorrow, today.at, settings, inputs)
    levels = ((yesterday, today.yesterday), (day, today.so_far))
    days: list[Row] = [{"floor_id": today.floor_id, "local_date": date, **_day(level)} for date, level in levels]
    silent: list[Row] = [
        {
            "floor_id": today.floor_id,
            "camera_id": camera.camera_id,
            "last_date": camera.last_day,
            "last_hour": camera.last_hour,
            "n_open_hours": camera.open_hours,
        }
        for camera in today.silent
    ]
    every_hour = Sum("n_violations", ("today_hours.n_violations",))
    return (
        Answer("today_days", DAYS, tuple(days), holds, (every_hour,)),
        Answer("today_hours", HOURS, tuple(_hour(today, hour) for hour in today.hours), holds),
        unusual_answer(today.unusual, holds),
        Answer("silent_cameras", SILENT, tuple(silent), holds),
    )


def _day(level: DayLevel | None) -> Row:
    if level is None:
        closed = Value.missing(Reason("today.closed"))
        values = dict.fromkeys(("n_violations", "violations_estimate", "usual_lo", "usual_hi"), closed)
        facts = dict.fromkeys(("is_over", "until_hour", "position"))
        return {"is_open": False, **facts, "n_open_hours": 0, "n_recorded_hours": 0, **values, "n_days": 0}
    why, state = level.reason, level.state
    return {
        "is_open": True,
        "is_over": level.is_over,
        "until_hour": level.until_hour,
        "n_open_hours": level.open_hours,
        "n_recorded_hours": level.recorded_hours,
        "n_violations": known(_whole(level.violations), why, state),
        "violations_estimate": known(level.estimate, why, state),
        "usual_lo": known(None if level.usual is None else level.usual.lo, why, state),
        "usual_hi": known(None if level.usual is None else level.usual.hi, why, state),
        "position": level.position,
        "n_days": level.n_days,
    }


def _hour(today: Today, hour: TodayHour) -> Row:
    counts, forecast = today.unusual, lack(today.forecast_state, today.forecast_reason)
    unknown = lack(counts.state, counts.reason) if counts.state == "not_measurable" else None
    few_weeks = Value.missing(Reason("forecast.hour", least=MIN_WEEKS))
    expected = few_weeks if today.forecast_state == "ok" else forecast
    unseen = forecast if today.forecast_state == "not_measurable" else Value.missing(Reason("recorded.nothing"))
    unrecorded = Value.missing(Reason("recorded.nothing"))
    if not hour.is_over:
        unseen = unrecorded = Value.missing(_NOT_OVER)
    return {
        "floor_id": today.floor_id,
        "local_date": hour.day,
        "local_hour": hour.hour,
        "is_over": hour.is_over,
        "n_violations": unknown or _or(_whole(hour.violations), unrecorded),
        "violations_estimate": unknown or _or(hour.estimate, unrecorded),
        "usual": unknown or _or(hour.usual, few_weeks if today.forecast_state == "ok" else forecast, hour.lo, hour.hi),
        "people_seen": _or(hour.seen, unseen),
        "people": _or(hour.people, expected, hour.people_lo, hour.people_hi),
    }


def _or(number: float | None, none: Value, lo: float | None = None, hi: float | None = None) -> Value:
    return none if number is None else Value(number, lo, hi)


def _whole(n: float | None) -> int | None:
    return None if n is None else round(n)
