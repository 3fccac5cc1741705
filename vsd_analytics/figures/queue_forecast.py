"""How many people will wait in each hour of the next week, and when another point of service is worth a thought.

The forecast is made as that of people in view (M25), of the number of people in a queue (M39). Only queues with
`queue_limit` in vsd.toml have advice: nobody else knows how many people are too many.
"""

from __future__ import annotations

from datetime import date, timedelta
from typing import Final, Literal

import numpy as np

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.figures.forecast import (
    HISTORY_WEEKS,
    RECORDED_OPEN_HOURS,
    HourForecast,
    SeriesForecast,
    series_forecast,
)
from vsd_analytics.figures.forecast_answers import week_before
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.people_present import Presence
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.slots import iso_week, open_hours
from vsd_analytics.site.model import Area
from vsd_analytics.stats.hour_of_week import SLOTS, Weeks

Chance = Literal["likely", "expected", "possible"]
COLUMNS: Final = (
    Column("floor_id", "key"),
    Column("area_id", "key"),
    Column("local_date", "key"),
    Column("local_hour", "key", "hour_of_day"),
    Column("name", "fact"),
    Column("people_waiting", "people", "people", digits=2),
    Column("queue_limit", "fact", "people"),
    Column("chance", "fact"),
    Column("open_h", "fact", "h"),
    Column("n_weeks", "fact", "weeks"),
)
"""Columns of `queue_forecast`."""
SCORE_COLUMNS: Final = (
    Column("floor_id", "key"),
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("week", "fact"),
    Column("scored_week", "fact"),
    Column("range_share", "fact", "share"),
    Column("off_share", "share", "share"),
    Column("in_range_share", "share", "share"),
    Column("n_hours", "fact", "hours"),
)
"""Columns of `queue_forecast_score`."""


def queue_forecast(data: FloorHours, monday: date) -> tuple[Answer, Answer]:
    """Forecast each queue of a floor for the week after the one that starts on `monday`, in the order of vsd.toml.

    Columns of the first: mean number of people waiting in each open hour, with the range that is to hold
    `forecast_share` of such hours, and the chance that it exceeds the queue's limit: "likely" where the whole range
    lies above it (nine of ten such hours, with a range that holds four of five), "expected" where the expected number
    does, "possible" where only the range reaches above it. Of the second: how far the forecast of the last week, made
    in the same way, was off (sum of errors / sum of what came), and the share of hours in its range.

    Args:
        data: The floor, loaded from `forecast.first_day(monday)`, or from wherever records begin.
        monday: First day of the last week the forecast knows.
    """
    next_monday = monday + timedelta(days=7)
    settings = data.site.settings
    holds = HoldsFor(
        data.site.site_id,
        data.floor.floor_id,
        next_monday,
        next_monday + timedelta(days=6),
        settings=settings.settings_id(),
        inputs=data.warehouse.inputs_digest,
    )
    asked = [area for area in data.areas if area.is_queue]
    series = [_series(data, area, monday) for area in asked]
    hours = tuple(
        row for area, people in zip(asked, series, strict=True) for row in _hour_rows(data, area, people, next_monday)
    )
    scores = tuple(
        _score_row(data, area, people, monday, next_monday) for area, people in zip(asked, series, strict=True)
    )
    notes = [Reason("note.queue_forecast")] if any(people.rows for people in series) else []
    if no_limit := [area.name for area in asked if area.queue_limit is None]:
        notes.append(Reason("queues.no_limit", places=", ".join(no_limit)))
    return (
        Answer("queue_forecast", COLUMNS, hours, holds, notes=tuple((None, note) for note in notes)),
        Answer("queue_forecast_score", SCORE_COLUMNS, scores, week_before(holds)),
    )


def _series(data: FloorHours, area: Area, monday: date) -> SeriesForecast:
    return series_forecast(
        data.site,
        _weeks(data, area, monday),
        monday,
        open_h=(open_hours(data.site, monday), open_hours(data.site, monday + timedelta(days=7))),
        is_count=False,
        unit=Reason("unit.people_waiting"),
        denominator=RECORDED_OPEN_HOURS,
    )


def _hour_rows(data: FloorHours, area: Area, people: SeriesForecast, monday: date) -> list[Row]:
    """Return a row for each open hour of the next week, without a number where there is no forecast."""
    place: Row = {"floor_id": data.floor.floor_id, "area_id": area.area_id}
    facts: Row = {"name": area.name, "queue_limit": area.queue_limit}
    of_hours = {(row.day, row.hour): row for row in people.rows}
    open_h = open_hours(data.site, monday)
    rows: list[Row] = []
    for slot in np.flatnonzero(open_h > 0).tolist():
        day, hour = monday + timedelta(days=slot // 24), slot % 24
        forecast = of_hours.get((day, hour))
        value = Value.missing(people.reason, people.state) if forecast is None else Value.of(forecast)
        chance = None if forecast is None or area.queue_limit is None else _chance(forecast, area.queue_limit)
        n_weeks = 0 if forecast is None else forecast.n_weeks
        cells: Row = {"people_waiting": value, "chance": chance, "open_h": float(open_h[slot]), "n_weeks": n_weeks}
        rows.append({**place, "local_date": day, "local_hour": hour, **facts, **cells})
    return rows


def _score_row(data: FloorHours, area: Area, people: SeriesForecast, monday: date, next_monday: date) -> Row:
    score = people.score
    off, inside = (None, None) if score is None else (score.wape, score.hit_rate)
    return {
        "floor_id": data.floor.floor_id,
        "area_id": area.area_id,
        "name": area.name,
        "week": iso_week(next_monday),
        "scored_week": iso_week(monday),
        "range_share": people.range_share,
        "off_share": Value.missing(people.reason) if off is None else Value(off),
        "in_range_share": Value.missing(people.reason) if inside is None else Value(inside),
        "n_hours": 0 if score is None else score.n_hours,
    }


def _weeks(data: FloorHours, area: Area, monday: date) -> Weeks:
    """Return person-hours and recorded hours by week and hour of the week, the week from `monday` last."""
    first = monday - timedelta(weeks=HISTORY_WEEKS)
    present = Presence(Period(data, monday, monday + timedelta(days=6)), area)
    hours = data.hours
    day = hours.day - first.toordinal()
    inside = (day >= 0) & (day < (HISTORY_WEEKS + 1) * 7)
    slot = day[inside] * 24 + hours.hour[inside]

    def grid(values: np.ndarray) -> np.ndarray:
        sums_h = np.bincount(slot, weights=values[inside], minlength=(HISTORY_WEEKS + 1) * SLOTS) / 3600
        return sums_h.reshape(HISTORY_WEEKS + 1, SLOTS)

    return Weeks(grid(present.seconds @ present.numbers), grid(present.seconds.sum(axis=1)))


def _chance(row: HourForecast, limit: float) -> Chance | None:
    if row.value is None or row.lo is None or row.hi is None:
        return None
    return "likely" if row.lo > limit else "expected" if row.value > limit else "possible" if row.hi > limit else None
