"""Figures that use what else happened, where the site shows it: M50 to M52."""

from __future__ import annotations

from datetime import timedelta
from typing import Final

import numpy as np

from vsd_analytics.answer import Answer, Column, Reason, Row, Value
from vsd_analytics.figures.catalogue.form import FigureInputs, answers
from vsd_analytics.figures.context_figures import NOT_ADDED, change_answer, conversion_answer, value_answer
from vsd_analytics.figures.context_values import series_of, spans
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.figures.values import known
from vsd_analytics.figures.week.trend_weeks import WEEKS

DAYS: Final = (
    Column("series", "key"),
    Column("local_date", "key"),
    Column("value_unit", "fact"),
    Column("area_id", "fact"),
    Column("adds", "fact"),
    Column("series_value", "number"),
)
"""Columns of `context_days`."""


@answers("M50")
def context_conversion(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return sales, tickets or the like per visit of an area (M50)."""
    return (conversion_answer(inputs),)


@answers("M51")
def context_value(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return sales, tickets or the like per person-hour (M51)."""
    return (value_answer(inputs),)


@answers("M52")
def context_change(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return the week's change of violations at an equal value of a series (M52), and the days of each series."""
    return (change_answer(inputs), _days(inputs))


def _days(inputs: FigureInputs) -> Answer:
    """Return the value of each series on each day of the weeks of the trend."""
    data = inputs.data
    first = data.monday - (WEEKS - 1) * WEEK
    of_days = spans(data.site, first, data.sunday, per="day")
    rows: list[Row] = []
    for series, area in series_of(data.site, data.floor, data.areas):
        values, _, open_ms = of_days.values(series)
        for k, value in enumerate(values.tolist()):
            why = Reason("context.unknown_day" if open_ms[k] else "site.closed")
            rows.append(
                {
                    "series": series.name,
                    "local_date": first + timedelta(days=k),
                    "value_unit": series.unit,
                    "area_id": None if area is None else area.area_id,
                    "adds": series.adds,
                    "series_value": known(value if np.isfinite(value) else None, why),
                }
            )
    return inputs.list_answer("context_days", DAYS, rows, nothing=None if rows else Value.missing(NOT_ADDED))
