"""This week beside the same week a year before: M0, time too close and people over the hours that both recorded (M53).

The week 52 weeks before has the same weekdays and nearly the same season. Public holidays and events may lie in one of
the two only; the answer names them. It gives differences with their intervals and no verdict: how much two weeks a year
apart differ by chance is not known from weeks in a row.
"""

from __future__ import annotations

from datetime import timedelta
from typing import Final

import numpy as np

from vsd_analytics.answer import Answer, Column, Reason, Row, Value
from vsd_analytics.figures import compare
from vsd_analytics.figures.catalogue import YEAR
from vsd_analytics.figures.catalogue.form import FigureInputs
from vsd_analytics.figures.panels import Flags
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.figures.share.weeks import HiddenWeek
from vsd_analytics.figures.special_days import days_of_one_week
from vsd_analytics.figures.values import known, lack, measured, relative
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.warehouse.warehouse import open_warehouse

COLUMNS: Final = (
    Column("week_before", "fact"),
    Column("violation_rate_before", "rate", "per_open_hour", "M53", tells=("n_before", "n_now")),
    Column("violation_rate_change", "rate", "change", "M53", tells=("n_before", "n_now")),
    Column("close_time_share_before", "share", "share", "M53"),
    Column("close_time_share_change", "rate", "change", "M53"),
    Column("people_before", "people", "people", "M53"),
    Column("people_change", "rate", "change", "M53"),
    Column("n_before", "count", "violations", audience="operator"),
    Column("n_now", "count", "violations", audience="operator"),
    Column("special_days", "fact"),
)
"""Columns of `year_before`."""
_VALUES: Final = tuple(c.name for c in COLUMNS if c.figure)


def year_before(inputs: FigureInputs) -> Answer:
    """Return the week 52 weeks before, and the change since, over the camera-hours that both recorded (M53).

    Columns: violations per open hour (M0), share of person-time too close (M6) and mean number of people (M5) of that
    week, each with its relative change; names of public holidays and events that lie in one of the two weeks only.
    """
    site, monday = inputs.data.site, inputs.data.monday
    first = monday - YEAR
    weeks = (first, first + timedelta(days=6)), (monday, monday + timedelta(days=6))
    with open_warehouse(site, *compare.days_needed(site, *weeks), threads=1) as warehouse:
        data = WeekData(warehouse, floor=inputs.data.floor, monday=first)
        pair = TwoPeriods(Period(data, *weeks[0]), Period(data, *weeks[1]))
        cells = _cells(inputs, data, pair)
        data.remember_shared()
    special = days_of_one_week(site, first, monday)
    row: Row = {"week_before": f"{first:%G-W%V}", **cells, "special_days": special}
    return inputs.floor_answer("year_before", COLUMNS, row, Reason("year.weeks"))


def _cells(inputs: FigureInputs, data: WeekData, pair: TwoPeriods) -> Row:
    state, reason = compare.why_not(pair)
    if state != "ok":
        return dict.fromkeys((*_VALUES, "n_before", "n_now"), lack(state, reason))
    change = compare.place_change(pair, data.floor)
    rate, people = change.split.violation_rate, change.split.people
    nothing = Reason("change.not_compared")
    cells: Row = {
        "violation_rate_before": measured(change.violation_rate_a),
        "violation_rate_change": relative(rate, reason=rate.reason or nothing),
        "close_time_share_before": measured(change.close_time_share_a),
        "close_time_share_change": relative(change.close_time_share, reason=change.close_time_share.reason or nothing),
        "people_before": Value.missing(nothing) if people.rate_a is None else Value(people.rate_a),
        "people_change": relative(people, reason=people.reason or nothing),
        "n_before": known(rate.n_a, nothing),
        "n_now": known(rate.n_b, nothing),
    }
    return {**cells, **_hidden(inputs, data, pair)}


def _hidden(inputs: FigureInputs, data: WeekData, pair: TwoPeriods) -> Row:
    """Return the cells that may not leave, each with the reason: what the report of either week holds back."""
    if not data.mask.is_on:
        return {}
    weeks = data.hidden_in(data.monday), inputs.data.hidden
    why = next((week.why_floor for week in weeks if week.why_floor is not None), None)
    if why is None and any(_is_revealed(data, pair, which, weeks[which]) for which in (0, 1)):
        why = GIVES_AWAY
    cells: Row = {} if why is None else dict.fromkeys(_VALUES, Value.missing(why))
    untimed = next((week.why_untimed for week in weeks if week.why_untimed is not None), None)
    if untimed is not None:
        times = [name for name in _VALUES if not name.startswith("violation_rate")]
        cells = {**cells, **dict.fromkeys(times, Value.missing(untimed))}
    return cells


def _is_revealed(data: WeekData, pair: TwoPeriods, which: int, hidden: HiddenWeek) -> bool:
    """Tell whether the count of the hours compared would tell an hour that a week holds back."""
    period = (pair.before, pair.now)[which]
    used = pair.used(0 if which == 0 else 1)
    left_out: Flags = np.asarray((data.hours.is_counted & ~used).any(axis=0))
    return bool(hidden.hours.small or hidden.hours.others) and bool(left_out[period.is_inside].any())
