"""When: hours of the week (M13), the highest (M14), unusual ones (M24), next week (M25), the weeks so far (M28)."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from typing import Final

from vsd_analytics.answer import Answer, Column, Reason, Row, Value
from vsd_analytics.figures.catalogue.form import DAYS, FigureInputs, answers
from vsd_analytics.figures.forecast_answers import UNUSUAL, forecast_answers, unusual_answer
from vsd_analytics.figures.hour_of_week import PROFILE_WEEKS, HourProfile
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.figures.values import known, lack, measured, without
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.stats.hour_of_week import MIN_PROFILE_WEEKS, PeakHours
from vsd_analytics.stats.trend import WeekRates

HOUR_OF_WEEK: Final = (
    Column("weekday", "key"),
    Column("local_hour", "key"),
    Column("violation_rate", "rate", "per_open_hour", "M13", tells=("n_violations",), per="recorded_h"),
    Column("encounter_rate", "rate", "per_person_hour", "M13", tells=("n_violations",)),
    Column("people", "people", "people_in_view", "M13", per="recorded_h"),
    Column("n_violations", "count", "violations", audience="operator"),
    Column("recorded_h", "fact", "h"),
    Column("n_weeks", "fact", "weeks"),
)
"""Columns of `hour_of_week`."""
HIGHEST: Final = (
    Column("by", "key"),
    Column("weekday", "key"),
    Column("local_hour", "key"),
    Column("rank", "fact"),
    Column("is_tied", "fact"),
    Column("hour_rate", "rate", "", "M14", tells=("n_violations",)),
    Column("n_violations", "count", "violations", audience="operator"),
    Column("n_weeks", "fact", "weeks"),
)
"""Columns of `highest_hours`."""
TREND: Final = (
    Column("week", "key"),
    Column("violation_rate", "rate", "per_open_hour", "M28", tells=("n_violations",)),
    Column("close_time_share", "share", "share", "M28"),
    Column("encounter_rate", "rate", "per_person_hour", "M28", tells=("n_encounters",)),
    Column("recorded_share", "share", "share"),
    Column("n_violations", "count", "violations", audience="operator"),
    Column("n_encounters", "count", "violations", audience="operator"),
    Column("cameras_missing", "fact"),
    Column("n_changes", "fact"),
)
"""Columns of `trend`."""


@answers("M13", "M14")
def hours_of_week(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return rates and people in view by hour of the week, over four weeks (M13), and the highest hours (M14).

    `highest_hours`: at most three by each rate, ranked, and those that cannot be distinguished from the first
    (`is_tied`).
    """
    hour_profile = inputs.results.profile
    hidden = _hidden_slots(inputs)
    is_printed = any(hour.state == "ok" for hour in hour_profile.rows)
    rows = [_profile_row(hour, hour_profile.reason, (hour.weekday, hour.hour) in hidden) for hour in hour_profile.rows]
    profile = inputs.list_answer(
        "hour_of_week",
        HOUR_OF_WEEK,
        rows if is_printed else (),
        *([(None, hour_profile.reason)] if hour_profile.reason is not None and is_printed else []),
        nothing=None if is_printed else lack(hour_profile.state, hour_profile.reason),
    )
    return profile, _highest(inputs, hidden)


def _profile_row(hour: HourProfile, why: Reason | None, is_hidden: bool) -> Row:
    reason = why or Reason("hours.weeks", least=MIN_PROFILE_WEEKS)
    hide = GIVES_AWAY if is_hidden else None

    def rate(value: float | None, lo: float | None, hi: float | None) -> Value:
        return without(Value.missing(reason) if value is None else Value(value, lo, hi), hide)

    return {
        "weekday": DAYS[hour.weekday],
        "local_hour": hour.hour,
        "violation_rate": rate(hour.burden, hour.burden_lo, hour.burden_hi),
        "encounter_rate": rate(hour.risk, hour.risk_lo, hour.risk_hi),
        "people": known(hour.people, reason),
        "n_violations": known(hour.violations, reason),
        "recorded_h": hour.recorded_h,
        "n_weeks": hour.n_weeks,
    }


def _hidden_slots(inputs: FigureInputs) -> set[tuple[int, int]]:
    """Return the hours of the week that the report of one of the profile's four weeks hides."""
    hours, weeks = inputs.data.hours, range(PROFILE_WEEKS)
    held = (inputs.data.hidden_in(inputs.data.monday - k * WEEK).hours for k in weeks)
    return {(int(hours.weekday[i]), int(hours.hour[i])) for week in held for i in (*week.small, *week.others)}


def _highest(inputs: FigureInputs, hidden: set[tuple[int, int]]) -> Answer:
    if not inputs.is_ranked:
        return inputs.list_answer("highest_hours", HIGHEST, (), nothing=Value.missing(inputs.why_not_ranked))
    hour_profile = inputs.results.profile
    peaks = {"violation_rate": hour_profile.by_burden, "encounter_rate": hour_profile.by_risk}
    rows = [row for by, one in peaks.items() for row in _ranked(inputs, by, one, hidden)]
    if not rows:
        nothing = lack(hour_profile.by_burden.state, hour_profile.by_burden.reason)
        return inputs.list_answer("highest_hours", HIGHEST, (), nothing=nothing)
    lacking = [one.reason for one in peaks.values() if one.state != "ok" and one.reason is not None]
    return inputs.list_answer("highest_hours", HIGHEST, rows, *((None, reason) for reason in lacking))


def _ranked(inputs: FigureInputs, by: str, peaks: PeakHours, hidden: set[tuple[int, int]]) -> list[Row]:
    """Return the highest hours that may be named, then those that may be as high as the first."""
    top = [p for p in peaks.top if not inputs.data.mask.hides(p.n) and (p.weekday, p.hour) not in hidden]
    if not top:
        return []
    tied = set(peaks.tied)
    rows: list[Row] = [
        {
            "by": by,
            "weekday": DAYS[hour.weekday],
            "local_hour": hour.hour,
            "rank": rank,
            "is_tied": (hour.weekday, hour.hour) in tied,
            "hour_rate": measured(hour),
            "n_violations": Value(hour.n),
            "n_weeks": hour.n_weeks,
        }
        for rank, hour in enumerate(top, 1)
    ]
    ranked = {(hour.weekday, hour.hour) for hour in top}
    none = Value.missing(Reason("hours.tied"))
    return rows + [
        {
            "by": by,
            "weekday": DAYS[weekday],
            "local_hour": of_day,
            "rank": None,
            "is_tied": True,
            "hour_rate": none,
            "n_violations": none,
            "n_weeks": None,
        }
        for weekday, of_day in peaks.tied
        if (weekday, of_day) not in ranked
    ]


@answers("M24")
def unusual_hours(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return the hours with far more or fewer violations than usual (M24)."""
    if not inputs.is_ranked:
        columns = [c for c in UNUSUAL if c.name != "floor_id"]
        nothing = Value.missing(inputs.why_not_ranked)
        return (inputs.list_answer("unusual_hours", columns, (), nothing=nothing),)
    hidden = {(c.day, c.hour) for c in inputs.when.cells if c.is_masked or c.is_held_back}
    return (unusual_answer(inputs.results.unusual, inputs.holds_for, hidden=hidden),)


@answers("M25")
def next_week(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return the forecast of next week by hour (M25), and how good the last one was."""
    monday = inputs.data.monday + WEEK
    holds = replace(inputs.holds_for, first=monday, last=monday + timedelta(days=6))
    return forecast_answers(inputs.results.outlook, holds)


@answers("M28")
def trend(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return both rates and the share of time too close of each of the last weeks (M28).

    A week that is a gap says why; `cameras_missing` recorded too little of it to compare it with the last one, and
    `n_changes` entries of the change log are of it.
    """
    floor_trend = inputs.results.trend
    if not floor_trend.weeks or floor_trend.state != "ok":
        return (inputs.list_answer("trend", TREND, (), nothing=lack(floor_trend.state, floor_trend.reason)),)
    zone = inputs.data.site.zone
    rows: list[Row] = [
        {
            "week": week.week,
            **_week_rates(inputs, week),
            "recorded_share": known(week.coverage, week.reason),
            "cameras_missing": tuple(floor_trend.cameras[i] for i in week.missing),
            "n_changes": sum(f"{m.at.astimezone(zone):%G-W%V}" == week.week for m in floor_trend.marks),
        }
        for week in floor_trend.weeks
    ]
    why = floor_trend.encounter_rate_reason
    return (inputs.list_answer("trend", TREND, rows, *([(None, why)] if why is not None else [])),)


def _week_rates(inputs: FigureInputs, week: WeekRates) -> dict[str, Value]:
    """Return the figures of a week, without those that the report of that week holds back."""
    rates: dict[str, RateEstimate | None] = {
        "violation_rate": week.violation_rate,
        "close_time_share": week.close,
        "encounter_rate": week.encounter_rate,
    }
    values = {name: lack(week.state, week.reason) if rate is None else measured(rate) for name, rate in rates.items()}
    values |= {
        "n_violations": _n(week.violation_rate, week.reason),
        "n_encounters": _n(week.encounter_rate, week.reason),
    }
    if week.monday == inputs.data.monday and inputs.level.violations is None:
        level = inputs.level
        close = values["close_time_share"] if level.close_time_share is None else Value.of(level.close_time_share)
        of_level = {"violation_rate": Value.of(level.violation_rate), "encounter_rate": Value.of(level.encounter_rate)}
        return {**values, **of_level, "close_time_share": close}
    why = inputs.data.hidden_in(week.monday).why_floor
    return {n: v if v.state == "not_measurable" else without(v, why) for n, v in values.items()}


def _n(rate: RateEstimate | None, why: Reason | None) -> Value:
    return known(None if rate is None else rate.n_events, why)
