"""Counting lines: how many people crossed each, in either direction (M57).

Crossings count in all hours, not only in opening hours: staff who come before the doors open are in the building, too.
The net number, in less out, needs every opening hour: one that was not recorded makes it unknown, not smaller.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from vsd_analytics.answer import Answer, Cell, Column, Reason, Row, Sum, Value
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.rates import NOT_RECORDED
from vsd_analytics.figures.visits import NO_TRACK_IDS
from vsd_analytics.site.lines import Line

Rows = Sequence[dict[str, Any]]
_ROWS: Final = """
select line_id, local_date, local_hour, is_open, recorded_s, state, can_count, n_to_left, n_to_right, n_both
from line_counts
where floor_id = $floor and local_date between $first and $last and ($until is null or quarter * 900000 < $until)
order by quarter, line_no
"""
_BOTH: Final = ("n_to_left", "n_to_right")
_WAYS: Final = (*_BOTH, "n_both")
_COUNTS: Final = (
    Column("left", "fact"),
    Column("n_to_left", "count", "crossings", "M57", per="recorded_h"),
    Column("right", "fact"),
    Column("n_to_right", "count", "crossings", "M57", per="recorded_h"),
    Column("n_both", "count", "crossings", "M57", per="recorded_h", tells=_BOTH),
    Column("net_to_left", "people", "people", "M57", digits=6, tells=_BOTH),
    Column("inside", "fact"),
    Column("recorded_h", "fact", "h"),
    Column("unrecorded_open_h", "fact", "h"),
    Column("open_h", "fact", "h"),
    Column("recorded_open_share", "fact", "share"),
)
_KEYS: Final = (Column("floor_id", "key"), Column("line_id", "key"))
_NAME: Final = Column("name", "fact")
LINE_COLUMNS: Final = (*_KEYS, _NAME, *_COUNTS)
"""Columns of `lines`."""
DAY_COLUMNS: Final = (*_KEYS, Column("local_date", "key"), _NAME, *_COUNTS)
"""Columns of `line_days`."""
HOUR_COLUMNS: Final = (*_KEYS, Column("local_hour", "key", "hour_of_day"), _NAME, *_COUNTS)
"""Columns of `line_hours`."""
_DAY_HOUR_COLUMNS: Final = (*DAY_COLUMNS[:3], Column("local_hour", "key", "hour_of_day"), *DAY_COLUMNS[3:])
_SUMS: Final = tuple(Sum(n, (f"{table}.{n}",)) for table in ("line_days", "line_hours") for n in _WAYS)
ONE_NUMBER: Final = Reason("lines.one_number")
"""Why a line has no number for a side: its counter counts both ways, or the other way only."""


def line_answers(period: Period) -> tuple[Answer, Answer, Answer]:
    """Return who crossed each counting line of a floor: over the days, by day, and by hour of the day.

    Columns: names of both sides; crossings to either side and both ways, of all recorded quarter-hours (M57); crossings
    to the left less those to the right, where every opening hour was recorded in full; of a door, the side that is
    inside; recorded hours of the camera of a line that recorded least, or of its counter; opening hours that were not
    recorded in full; all opening hours, and the share of them that was recorded in full (None without opening hours).
    Hours to come are left out.
    """
    lines = lines_of(period)
    names = (("lines", LINE_COLUMNS), ("line_days", DAY_COLUMNS), ("line_hours", HOUR_COLUMNS))
    if not lines:
        nothing = Reason("lines.not_asked")
        whole, by_day, by_hour = (Answer(n, columns, (), period.holds_for, nothing=nothing) for n, columns in names)
        return whole, by_day, by_hour
    rows = line_rows(period)
    return (
        Answer("lines", LINE_COLUMNS, _grouped(period, lines, rows), period.holds_for, _SUMS),
        Answer("line_days", DAY_COLUMNS, _grouped(period, lines, rows, "local_date"), period.holds_for),
        Answer("line_hours", HOUR_COLUMNS, _grouped(period, lines, rows, "local_hour"), period.holds_for),
    )


def line_day_hours(period: Period) -> Answer:
    """Return who crossed each counting line of a floor by day and hour of the day: `line_hours` of each day.

    It is for the operator: hidden days and hours that add up to known numbers in two ways would tell each other.
    """
    rows = _grouped(period, lines_of(period), line_rows(period), "local_date", "local_hour")
    return Answer("line_day_hours", _DAY_HOUR_COLUMNS, rows, period.holds_for)


def lines_of(period: Period) -> list[Line]:
    """Return the counting lines of a period's floor that are there on some of its days."""
    lines = [n for n in period.data.site.lines if n.floor_id == period.data.floor.floor_id]
    return [n for n in lines if n.is_there(period.first, period.last)]


def line_rows(period: Period) -> Rows:
    """Return the quarter-hours of the counting lines of a period's floor, in order, as far as their hours are over."""
    values = {"floor": period.data.floor.floor_id, "first": period.first, "last": period.last}
    return period.data.warehouse.rows(_ROWS, {**values, "until": period.not_over_ms})


def _grouped(period: Period, lines: Sequence[Line], rows: Rows, *keys: str) -> tuple[Row, ...]:
    """Return a row for each line and values of columns of `line_counts`; without columns, for each line."""
    cells = []
    for line in lines:
        of_line = [row for row in rows if row["line_id"] == line.line_id]
        groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
        for row in of_line:
            groups.setdefault(tuple(row[key] for key in keys), []).append(row)
        for values, quarters in sorted(groups.items()):
            ids: dict[str, Cell] = {"floor_id": period.data.floor.floor_id, "line_id": line.line_id}
            cells.append({**ids, **dict(zip(keys, values, strict=True)), **_counts(line, quarters)})
    return tuple(cells)


def _counts(line: Line, quarters: Rows) -> Row:
    """Return the cells of some quarter-hours of a line."""
    open_unrecorded = sum(row["is_open"] and (row["state"] != "full" or not row["can_count"]) for row in quarters)
    n_open = sum(row["is_open"] for row in quarters)
    is_recorded = any(row["recorded_s"] for row in quarters)
    can_count = all(row["can_count"] for row in quarters)
    n_left, n_right, n_both = (_sum(quarters, name) for name in _WAYS)
    if not can_count and n_left is None:
        missing = Value.missing(NO_TRACK_IDS, "not_measurable")
    else:
        missing = Value.missing(ONE_NUMBER, "not_measurable") if is_recorded else Value.of(NOT_RECORDED)
    if n_left is None or n_right is None:
        net = missing
    elif open_unrecorded:
        net = Value.missing(Reason("lines.net_unknown", hours=open_unrecorded / 4))
    else:
        net = Value(n_left - n_right)
    return {
        "name": line.name,
        "left": line.left,
        "n_to_left": missing if n_left is None else Value(n_left),
        "right": line.right,
        "n_to_right": missing if n_right is None else Value(n_right),
        "n_both": missing if n_both is None else Value(n_both),
        "net_to_left": net,
        "inside": line.inside,
        "recorded_h": sum(row["recorded_s"] for row in quarters) / 3600,
        "unrecorded_open_h": open_unrecorded / 4,
        "open_h": n_open / 4,
        "recorded_open_share": (n_open - open_unrecorded) / n_open if n_open else None,
    }


def _sum(quarters: Rows, name: str) -> int | None:
    """Return the sum of what is known of a column, None where nothing is."""
    known = [row[name] for row in quarters if row[name] is not None]
    return sum(known) if known else None
