"""The busiest quarter-hour of each counting line, and how near it is to what the line's width lets through (M59).

Quarter-hours that were not recorded in full are left out, so the busiest may be missed: the answer says how many hours
were recorded in full.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from vsd_analytics.answer import Answer, Column, Reason, Row, Value
from vsd_analytics.figures.lines import line_rows, lines_of
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.rates import NOT_RECORDED
from vsd_analytics.site.lines import Line

QUARTER_MIN: Final = 15
MOST_PER_M_S: Final = 1.3
"""Most people a second that a metre of a level door or corridor lets through in one stream.

SFPE Handbook of Fire Protection Engineering, 5th edition, chapter 59 (Gwynne and Rosenbaum), maximum specific flow.
"""
NOT_DRAWN: Final = Reason("lines.not_drawn")
_TELLS: Final = ("n_least",)
COLUMNS: Final = (
    Column("floor_id", "key"),
    Column("line_id", "key"),
    Column("name", "fact"),
    Column("people_per_min", "rate", "per_min", "M59", tells=_TELLS),
    Column("per_m_s", "rate", "per_m_s", "M59", tells=_TELLS),
    Column("of_most_share", "rate", "share", "M59", tells=_TELLS),
    Column("local_date", "fact", audience="operator"),
    Column("local_hour", "fact", "hour_of_day", audience="operator"),
    Column("n_least", "count", "crossings", audience="operator"),
    Column("width_m", "fact", "m"),
    Column("whole_h", "fact", "h"),
)


def line_peaks(period: Period) -> Answer:
    """Return the quarter-hour with most crossings of each counting line, both ways, of those recorded in full (M59).

    Columns: people a minute; people a second and metre of the line; that as a share of `MOST_PER_M_S`; for the operator
    its day and hour; the length of the line; hours recorded in full. For the operator, too, the smallest number above
    0 that the others tell: of the quarter-hour, of the rest of its day, of its hour of the day and of all days, and of
    the days and hours of either side.
    """
    lines = lines_of(period)
    if not lines:
        return Answer("line_peaks", COLUMNS, (), period.holds_for, nothing=Reason("lines.not_asked"))
    rows, floor_id = line_rows(period), period.data.floor.floor_id
    peaks = ((line, [row for row in rows if row["line_id"] == line.line_id]) for line in lines)
    peak_rows = tuple(
        {"floor_id": floor_id, "line_id": line.line_id, **_peak(line, of_line)} for line, of_line in peaks
    )
    return Answer("line_peaks", COLUMNS, peak_rows, period.holds_for)


def _peak(line: Line, quarters: Sequence[dict[str, Any]]) -> Row:
    whole = [row for row in quarters if row["state"] == "full" and row["n_both"] is not None and row["can_count"]]
    width_m = None if line.points is None else math.dist(*line.points)
    facts: Row = {"name": line.name, "width_m": width_m, "whole_h": len(whole) / 4}
    if not whole:
        unknown = Value.of(NOT_RECORDED)
        empty = dict.fromkeys(("people_per_min", "per_m_s", "of_most_share", "n_least"), unknown)
        return {**facts, **empty, "local_date": None, "local_hour": None}
    busiest = max(whole, key=_both)
    per_min = _both(busiest) / QUARTER_MIN
    per_m_s = None if width_m is None else per_min / 60 / width_m
    return {
        **facts,
        "people_per_min": Value(per_min),
        "per_m_s": Value.missing(NOT_DRAWN) if per_m_s is None else Value(per_m_s),
        "of_most_share": Value.missing(NOT_DRAWN) if per_m_s is None else Value(per_m_s / MOST_PER_M_S),
        "local_date": busiest["local_date"],
        "local_hour": busiest["local_hour"],
        "n_least": Value(_least(busiest, quarters)),
    }


def _both(row: dict[str, Any]) -> int:
    return int(row["n_both"])


def _least(busiest: dict[str, Any], quarters: Sequence[dict[str, Any]]) -> int:
    """Return the smallest number of people above 0 that the busiest quarter-hour and the sums of the line tell."""
    known = [row for row in quarters if row["n_both"] is not None]
    told = [_both(busiest), sum(map(_both, known)) - _both(busiest)]
    for key in ("local_date", "local_hour"):
        sums: dict[Any, list[int]] = {}
        for row in known:
            of_key = sums.setdefault(row[key], [0, 0, 0])
            for k, way in enumerate(("n_both", "n_to_left", "n_to_right")):
                of_key[k] += row[way] or 0
        told += [sums[busiest[key]][0] - _both(busiest), *(n for of_key in sums.values() for n in of_key)]
    return min((n for n in told if n), default=0)
