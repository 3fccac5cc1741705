"""What next week will be like, hour by hour, and how good last week's forecast was (M25)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from vsd_analytics.answer import Reason, State
from vsd_analytics.figures.slots import Floats, Slots, iso_week, known, load_slots, open_hours
from vsd_analytics.figures.special_days import notes_of_days, special_days
from vsd_analytics.site.model import Site
from vsd_analytics.stats.forecast import (
    Chances,
    ForecastScore,
    WeekForecast,
    chances,
    forecast_week,
    score_forecast,
)
from vsd_analytics.stats.hour_of_week import Weeks
from vsd_analytics.warehouse.warehouse import Warehouse

HISTORY_WEEKS: Final = 12
"""Weeks a forecast looks back, so that eight recorded ones are found across holidays and outages."""
NO_GATHERINGS: Final = Reason("gatherings.not_counted")
OPEN_HOUR: Final = Reason("unit.open_hour")
RECORDED_OPEN_HOURS: Final = Reason("unit.recorded_open_hours")


@dataclass(frozen=True, slots=True)
class HourForecast:
    """One open hour of the next week.

    Attributes:
        day: Local date.
        weekday: 0 Monday to 6 Sunday.
        hour: Local hour, 0 to 23.
        open_h: Open hours in it.
        value: Expected, in the unit of the forecast; None where too few weeks recorded the hour.
        lo, hi: Range of that.
        n_weeks: Recorded weeks it comes from.
    """

    day: date
    weekday: int
    hour: int
    open_h: float
    value: float | None
    lo: float | None
    hi: float | None
    n_weeks: int


@dataclass(frozen=True, slots=True)
class SeriesForecast:
    """The forecast of one quantity.

    Attributes:
        unit: Of the values.
        denominator: What it is divided by.
        rows: The open hours of the week, in order; empty without a forecast.
        range_share: Share of hours the ranges are to hold.
        level: How far late weeks are above the usual, 1.1 = 10 %; None without a forecast.
        n_weeks: Recorded weeks it comes from.
        score: Of the forecast for the week just over, made the same way from the weeks before it; None where nothing is
            measurable.
        state: "ok" when at least one hour is forecast.
        reason: Why not.
    """

    unit: Reason
    denominator: Reason
    rows: tuple[HourForecast, ...]
    range_share: float | None
    level: float | None
    n_weeks: int
    score: ForecastScore | None
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class FloorForecast:
    """The forecast of a week.

    Attributes:
        week: ISO week forecast.
        monday: Its first day.
        last_week: ISO week it was made after, and whose own forecast is scored.
        floor_id: Floor it is for; None = the whole site.
        closed: Days of the week on which the site is closed though it opens on that weekday.
        special: What the calendar says of the week: holidays, events, a change of the clock.
        left_out: Cameras without one recorded hour in the weeks used.
        people: Mean number of people in view.
        violations: Violations per open hour.
        gatherings: Probability of at least one gathering; `lo` and `hi` are None.
    """

    week: str
    monday: date
    last_week: str
    floor_id: str | None
    closed: tuple[date, ...]
    special: tuple[Reason, ...]
    left_out: tuple[str, ...]
    people: SeriesForecast
    violations: SeriesForecast
    gatherings: SeriesForecast

    @property
    def has_forecast(self) -> bool:
        """Tell whether anything is forecast."""
        return "ok" in (self.people.state, self.violations.state, self.gatherings.state)


def first_day(monday: date) -> date:
    """Return the first day a warehouse must hold for `forecast` after the week from `monday`, and for its score."""
    return monday - timedelta(weeks=HISTORY_WEEKS)


def forecast(
    warehouse: Warehouse,
    monday: date,
    *,
    floor_id: str | None = None,
    gatherings: tuple[ArrayLike, ArrayLike] | None = None,
    as_known: Callable[[Slots], Slots] | None = None,
) -> FloorForecast:
    """Forecast the week after the one that starts on `monday`, and score the forecast of that one.

    Closed days are neither trained on nor forecast; public holidays are not trained on, and have the hours of Sundays
    (`vsd_analytics.figures.special_days.day_rules`); hours recorded for less than half are missing, which is not 0; a
    camera that is down does not lower the count (`vsd_analytics.stats.hour_of_week.recorded_hours`).

    Args:
        warehouse: Opened from `first_day(monday)`, or from wherever records begin, to the end of the week.
        monday: First day of the last week the forecast knows.
        floor_id: Only the cameras of this floor; None = all.
        gatherings: Gatherings that began, and the open hours they were recorded in, each of shape (13, 168), this week
            last; None = not counted.
        as_known: Turns the hours into what the readers of the forecast know of them (`share.hours`); None = exact
            hours, for the operator.

    Raises:
        UsageError: E101, `monday` is no Monday, or the site has no such floor.

    Example:
        >>> vsd.forecast(warehouse, date(2026, 11, 9)).week
        '2026-W47'
    """
    next_monday = monday + timedelta(days=7)
    there = next_monday, next_monday + timedelta(days=6)
    slots = load_slots(warehouse, monday, n_weeks=HISTORY_WEEKS + 1, floor_id=floor_id, there=there)
    slots = slots if as_known is None else as_known(slots)
    site = warehouse.site
    open_h = open_hours(site, next_monday)
    return FloorForecast(
        week=iso_week(next_monday),
        monday=next_monday,
        last_week=iso_week(monday),
        floor_id=floor_id,
        closed=tuple(day for day in (next_monday + timedelta(days=i) for i in range(7)) if day in site.closed),
        special=notes_of_days(site, next_monday),
        left_out=slots.left_out,
        people=_series(site, slots, slots.people, open_h, why=slots.why_no_people, is_count=False),
        violations=_series(site, slots, slots.violations, open_h, why=slots.why_no_violations, is_count=True),
        gatherings=_gatherings(site, slots, gatherings, open_h),
    )


def _series(
    site: Site, slots: Slots, weeks: Weeks, open_h: Floats, *, why: Reason | None, is_count: bool
) -> SeriesForecast:
    unit = Reason("unit.violations" if is_count else "unit.people_in_view")
    denominator = OPEN_HOUR if is_count else RECORDED_OPEN_HOURS
    if why is not None:
        return SeriesForecast(unit, denominator, (), None, None, 0, None, "not_measurable", why)
    both = (slots.open_h[-1], open_h)
    return series_forecast(
        site,
        weeks,
        slots.monday,
        open_h=both,
        is_count=is_count,
        unit=unit,
        denominator=denominator,
        scored_h=slots.counted_h if is_count else None,
    )


def series_forecast(
    site: Site,
    weeks: Weeks,
    monday: date,
    *,
    open_h: tuple[Floats, Floats],
    is_count: bool,
    unit: Reason,
    denominator: Reason,
    scored_h: Floats | None = None,
) -> SeriesForecast:
    """Forecast a quantity for the week after the last one, and score the forecast of that one.

    Args:
        site: Its calendar, and the share of hours that ranges are to hold.
        weeks: What was counted, oldest week first.
        monday: First day of the last week.
        open_h: Open hours of the slots of the last week and of the next one, each of shape (168,).
        is_count: True for counts of events; False for amounts such as person-hours.
        unit: Of the values.
        denominator: What it is divided by.
        scored_h: Recorded hours of the last week whose forecast is scored, shape (168,); None = all.
    """
    n, x_h, share = weeks.n, weeks.x_h, site.settings.forecast_share
    days = special_days(site, monday, n_weeks=len(n))
    ordinary_h = days.ordinary_h(x_h)
    week_forecast = forecast_week(
        n[1:], ordinary_h[1:], is_count=is_count, open_h=open_h[1], share=share, days=days.next
    )
    before = forecast_week(n[:-1], ordinary_h[:-1], is_count=is_count, open_h=open_h[0], share=share, days=days.last)
    score = score_forecast(before, n[-1], x_h[-1] if scored_h is None else scored_h)
    rows = _rows(monday, open_h[1], week_forecast) if week_forecast.state == "ok" else ()
    level = week_forecast.level if week_forecast.state == "ok" else None
    return SeriesForecast(
        unit,
        denominator,
        rows,
        week_forecast.share,
        level,
        week_forecast.n_recorded_weeks,
        score,
        week_forecast.state,
        week_forecast.reason,
    )


def _gatherings(
    site: Site, slots: Slots, counted: tuple[ArrayLike, ArrayLike] | None, open_h: Floats
) -> SeriesForecast:
    unit, denominator = Reason("unit.gathering_chance"), OPEN_HOUR
    if counted is None:
        return SeriesForecast(unit, denominator, (), None, None, 0, None, "not_measurable", NO_GATHERINGS)
    n, x_h = (np.asarray(a, dtype=np.float64)[1:] for a in counted)
    days = special_days(site, slots.monday, n_weeks=len(n))
    week_chances = chances(n, days.ordinary_h(x_h), open_h=open_h, days=days.next)
    rows = _rows(slots.monday, open_h, week_chances) if week_chances.state == "ok" else ()
    return SeriesForecast(
        unit,
        denominator,
        rows,
        None,
        None,
        week_chances.n_recorded_weeks,
        None,
        week_chances.state,
        week_chances.reason,
    )


def _rows(monday: date, open_h: Floats, week_forecast: WeekForecast | Chances) -> tuple[HourForecast, ...]:
    """Return a row for each open hour of the week after the one from `monday`."""
    nothing = np.full(len(open_h), np.nan)
    if isinstance(week_forecast, WeekForecast):
        value, lo, hi, n_weeks = week_forecast.mean, week_forecast.lo, week_forecast.hi, week_forecast.n_weeks
    else:
        value, lo, hi, n_weeks = week_forecast.chance, nothing, nothing, week_forecast.n_weeks
    return tuple(
        HourForecast(
            day=monday + timedelta(days=7 + int(s) // 24),
            weekday=int(s) // 24,
            hour=int(s) % 24,
            open_h=float(open_h[s]),
            value=known(value[s]),
            lo=known(lo[s]),
            hi=known(hi[s]),
            n_weeks=int(n_weeks[s]),
        )
        for s in np.flatnonzero(open_h > 0)
    )
