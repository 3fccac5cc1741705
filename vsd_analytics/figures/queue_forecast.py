"""How many people will wait in each hour of the next week, and when another point of service is worth a thought.

The forecast is made as that of people in view (M25), of the number of people in a queue (M39). Only queues with
`queue_limit` in vsd.toml have advice: nobody else knows how many people are too many.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta
from typing import Literal

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.forecast import (
    HISTORY_WEEKS,
    RECORDED_OPEN_HOURS,
    HourForecast,
    SeriesForecast,
    series_forecast,
)
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.people_present import Presence
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.slots import iso_week, open_hours
from vsd_analytics.site.model import Area
from vsd_analytics.stats.hour_of_week import SLOTS, Weeks

Chance = Literal["likely", "expected", "possible"]


@dataclass(frozen=True, slots=True)
class BusyHour:
    """An hour of the next week in which more people may wait than the queue's limit.

    Attributes:
        hour: The forecast of it.
        chance: "likely" where the whole range lies above the limit (nine of ten such hours, with a range that holds
            four of five), "expected" where the expected number does, "possible" where only the range reaches above it.
    """

    hour: HourForecast
    chance: Chance


@dataclass(frozen=True, slots=True)
class QueueForecast:
    """People waiting in a queue in the week after the last one.

    Attributes:
        area: The queue.
        week: ISO week forecast.
        monday: Its first day.
        last_week: ISO week the forecast was made after.
        people: Mean number of people waiting by hour, with range and the score of the last forecast.
        busy: Hours that may exceed its limit, in order; None where it has none, or without a forecast.
    """

    area: Area
    week: str
    monday: date
    last_week: str
    people: SeriesForecast
    busy: tuple[BusyHour, ...] | None


def queue_forecasts(data: FloorHours, monday: date) -> tuple[QueueForecast, ...]:
    """Forecast each queue of a floor for the week after the one that starts on `monday`, in the order of vsd.toml.

    Args:
        data: The floor, loaded from `forecast.first_day(monday)`, or from wherever records begin.
        monday: First day of the last week the forecast knows.
    """
    return tuple(_forecast(data, area, monday) for area in data.areas if area.is_queue)


def _forecast(data: FloorHours, area: Area, monday: date) -> QueueForecast:
    next_monday, site = monday + timedelta(days=7), data.site
    weeks = _weeks(data, area, monday)
    people = series_forecast(
        weeks,
        monday,
        open_h=(open_hours(site, monday), open_hours(site, next_monday)),
        is_count=False,
        share=site.settings.forecast_share,
        unit=Reason("unit.people_waiting"),
        denominator=RECORDED_OPEN_HOURS,
    )
    busy = None
    if area.queue_limit is not None and people.state == "ok":
        judged = ((row, _chance(row, area.queue_limit)) for row in people.rows)
        busy = tuple(BusyHour(row, chance) for row, chance in judged if chance is not None)
    return QueueForecast(area, iso_week(next_monday), next_monday, iso_week(monday), people, busy)


def _weeks(data: FloorHours, area: Area, monday: date) -> Weeks:
    """Return person-hours and recorded hours by week and hour of the week, the week from `monday` last."""
    first = monday - timedelta(weeks=HISTORY_WEEKS)
    present = Presence(Period(data, monday, monday + timedelta(days=6)), area)
    hours = data.hours
    day = hours.day - first.toordinal()
    inside = (day >= 0) & (day < (HISTORY_WEEKS + 1) * 7)
    slot = day[inside] * 24 + hours.hour[inside]

    def grid(values: np.ndarray) -> np.ndarray:
        found = np.bincount(slot, weights=values[inside], minlength=(HISTORY_WEEKS + 1) * SLOTS) / 3600
        return found.reshape(HISTORY_WEEKS + 1, SLOTS)

    return Weeks(grid(present.seconds @ present.numbers), grid(present.seconds.sum(axis=1)))


def _chance(row: HourForecast, limit: float) -> Chance | None:
    if row.value is None or row.lo is None or row.hi is None:
        return None
    return "likely" if row.lo > limit else "expected" if row.value > limit else "possible" if row.hi > limit else None
