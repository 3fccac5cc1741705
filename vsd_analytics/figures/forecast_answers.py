"""The next week, the score of the last forecast (M25), and unusual hours (M24), as answers."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from datetime import date, timedelta
from typing import Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.figures.forecast import FloorForecast, HourForecast, SeriesForecast
from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.figures.special_days import HOLIDAY
from vsd_analytics.figures.unusual import UnusualWeek
from vsd_analytics.figures.values import known, lack
from vsd_analytics.site.model import Site
from vsd_analytics.stats.forecast import MIN_WEEKS
from vsd_analytics.stats.unusual import UnusualSlots

FORECAST: Final = (
    Column("floor_id", "key"),
    Column("local_date", "key"),
    Column("local_hour", "key"),
    Column("people", "people", "people_in_view", "M25", per="open_h"),
    Column("violation_rate", "rate", "per_open_hour", "M25", per="open_h"),
    Column("gathering_chance", "share", "gathering_chance", "M25", per="open_h"),
    Column("open_h", "fact", "h"),
    Column("people_weeks", "fact", "weeks"),
    Column("violation_weeks", "fact", "weeks"),
    Column("gathering_weeks", "fact", "weeks"),
)
"""Columns of `forecast`."""
SCORE: Final = (
    Column("floor_id", "key"),
    Column("series", "key"),
    Column("scored_week", "fact"),
    Column("off_share", "share", "share"),
    Column("off_share_naive", "share", "share"),
    Column("scaled_error", "rate", "ratio"),
    Column("scaled_error_naive", "rate", "ratio"),
    Column("in_range_share", "share", "share"),
    Column("range_share", "fact", "share"),
    Column("n_hours", "fact", "hours"),
    Column("late_level", "rate", "ratio"),
)
"""Columns of `forecast_score`."""
UNUSUAL: Final = (
    Column("floor_id", "key"),
    Column("local_date", "key"),
    Column("local_hour", "key"),
    Column("n_violations", "count", "violations", "M24"),
    Column("usual", "rate", "violations", "M24"),
    Column("times_usual", "rate", "ratio", "M24", tells=("n_violations",)),
    Column("q", "share", "share", "M24", tells=("n_violations",)),
    Column("recorded_h", "fact", "h"),
    Column("n_weeks", "fact", "weeks"),
    Column("n_tested", "fact", "hours"),
)
"""Columns of `unusual_hours`."""
Hour = tuple[date, int]


def holds_in_week(site: Site, floor_id: str | None, monday: date, *, inputs: str) -> HoldsFor:
    """Return what an answer on one week is about."""
    sunday = monday + timedelta(days=6)
    return HoldsFor(site.site_id, floor_id, monday, sunday, settings=site.settings.settings_id(), inputs=inputs)


def forecast_answers(floor_forecast: FloorForecast, holds: HoldsFor) -> tuple[Answer, Answer]:
    """Return a forecast by hour, and its score.

    Columns of `forecast`: mean number of people in view, violations per open hour and the probability of at least one
    gathering, each with the range that is to hold `range_share` of such hours where it has one (M25). Of
    `forecast_score`, of the forecast for the week just over: sum of errors over what happened, mean error over the
    usual change from week to week, both beside those of the week before repeated, and the share of hours in the range;
    `late_level`: how far late weeks are above the usual.

    Args:
        floor_forecast: The forecast.
        holds: What it is about: the next week.
    """
    series = {
        "people": floor_forecast.people,
        "violation": floor_forecast.violations,
        "gathering": floor_forecast.gatherings,
    }
    by_hour = {name: {(row.day, row.hour): row for row in one.rows} for name, one in series.items()}
    hours = sorted({at for rows in by_hour.values() for at in rows})
    holidays = {note.values["day"] for note in floor_forecast.special if note.code == HOLIDAY}
    rows = tuple(
        _hour(
            floor_forecast.floor_id,
            at,
            series,
            {name: hour_rows.get(at) for name, hour_rows in by_hour.items()},
            holidays,
        )
        for at in hours
    )
    notes: list[tuple[int | None, Reason]] = []
    if (note := _score_note(floor_forecast.people)) is not None:
        notes.append((None, note))
    notes += [(None, note) for note in floor_forecast.special]
    if floor_forecast.left_out:
        notes.append((None, Reason("forecast.left_out", cameras=", ".join(floor_forecast.left_out))))
    if not floor_forecast.has_forecast:
        worst = floor_forecast.people if floor_forecast.people.state != "not_measurable" else floor_forecast.violations
        none = lack(worst.state, worst.reason)
        forecast = Answer("forecast", FORECAST, (), holds, nothing=none.reason, state=none.state)
    else:
        forecast = Answer("forecast", FORECAST, rows, holds, notes=tuple(notes))
    scores = tuple(_score(floor_forecast, name, one) for name, one in series.items() if name != "gathering")
    return forecast, Answer("forecast_score", SCORE, scores, week_before(holds))


def week_before(holds: HoldsFor) -> HoldsFor:
    """Return the week before another one: a score is of the week that is over, not of the week that is forecast."""
    return replace(holds, first=holds.first - timedelta(days=7), last=holds.last - timedelta(days=7))


def _hour(
    floor_id: str | None,
    at: Hour,
    series: dict[str, SeriesForecast],
    rows: dict[str, HourForecast | None],
    holidays: Collection[object],
) -> Row:
    def value(name: str) -> Value:
        row, one = rows[name], series[name]
        if row is None:
            return lack(one.state, one.reason)
        if row.value is None:
            return Value.missing(Reason("forecast.holiday" if at[0] in holidays else "forecast.hour", least=MIN_WEEKS))
        return Value.of(row)

    known_rows = [row for row in rows.values() if row is not None]
    weeks = {f"{name}_weeks": 0 if row is None else row.n_weeks for name, row in rows.items()}
    return {
        "floor_id": floor_id,
        "local_date": at[0],
        "local_hour": at[1],
        "people": value("people"),
        "violation_rate": value("violation"),
        "gathering_chance": value("gathering"),
        "open_h": known_rows[0].open_h,
        **weeks,
    }


def _score(floor_forecast: FloorForecast, name: str, one: SeriesForecast) -> Row:
    score = one.score
    why = one.reason if score is None else score.reason

    def part(field: str) -> Value:
        return known(None if score is None else getattr(score, field), why)

    return {
        "floor_id": floor_forecast.floor_id,
        "series": {"people": "people", "violation": "violations"}[name],
        "scored_week": floor_forecast.last_week,
        "off_share": part("wape"),
        "off_share_naive": part("wape_naive"),
        "scaled_error": part("mase"),
        "scaled_error_naive": part("mase_naive"),
        "in_range_share": part("hit_rate"),
        "range_share": None if score is None else score.share,
        "n_hours": 0 if score is None else score.n_hours,
        "late_level": known(one.level, one.reason),
    }


def _score_note(one: SeriesForecast) -> Reason | None:
    """Return how good the forecast for the week just over was."""
    score = one.score
    if score is None or score.wape is None or score.hit_rate is None:
        return None
    parts = {"error": score.wape, "hit_rate": score.hit_rate, "share": score.share}
    if score.wape_naive is None:
        return Reason("note.score", **parts)
    return Reason("note.score_naive", **parts, naive=score.wape_naive)


def unusual_answer(unusual: UnusualWeek | UnusualSlots, holds: HoldsFor, *, hidden: Collection[Hour] = ()) -> Answer:
    """Return the hours with far more or fewer violations than usual (M24), least likely first.

    Columns: violations; the usual number with the range of four of five such hours; violations over the usual; the
    chance value; how many hours were judged.

    Args:
        unusual: The unusual hours.
        holds: What it is about.
        hidden: Hours whose counts another output of the week holds back.
    """
    if unusual.state != "ok":
        none = lack(unusual.state, unusual.reason)
        return Answer("unusual_hours", UNUSUAL, (), holds, nothing=none.reason, state=none.state)
    rows = tuple(_unusual_rows(unusual, holds.floor_id, frozenset(hidden)))
    tested = Reason("unusual.tested", n_tested=unusual.n_tested, n_unusual=unusual.n_unusual)
    return Answer("unusual_hours", UNUSUAL, rows, holds, notes=((None, tested),))


def _unusual_rows(unusual: UnusualWeek | UnusualSlots, floor_id: str | None, hidden: frozenset[Hour]) -> Iterable[Row]:
    for hour in unusual.rows:
        cells = {
            "n_violations": Value(hour.violations),
            "times_usual": known(hour.ratio, Reason("unusual.usually_none")),
            "q": Value(hour.q),
        }
        if (hour.day, hour.hour) in hidden:
            cells = dict.fromkeys(cells, Value.missing(GIVES_AWAY))
        yield {
            "floor_id": floor_id,
            "local_date": hour.day,
            "local_hour": hour.hour,
            "usual": Value(hour.usual, hour.lo, hour.hi),
            **cells,
            "recorded_h": hour.recorded_h,
            "n_weeks": hour.n_weeks,
            "n_tested": unusual.n_tested,
        }
