"""People inside by the doors: who came in less who went out since the floor was last empty (M58).

A line of vsd.toml with `inside` is a door. The count of a floor starts at 0 at `[doors] empty_at` and runs over the
quarter-hours that every door of the floor recorded in full. After one that was not, the number is unknown until the
next empty hour. What is left when a day is over should be 0: it is the drift of the doors, and shown.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from itertools import groupby
from typing import Any, Final

from vsd_analytics.answer import Answer, Column, Reason, Row, Sum, Value
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.rates import NOT_RECORDED

_ROWS: Final = """
select
    line_id,
    quarter,
    local_date,
    local_hour,
    (quarter * 900000 - hour_start_ms) / 60000 as minute,
    is_open,
    $until is null or quarter * 900000 < $until as is_over,
    state = 'full' and can_count as is_whole,
    n_to_left,
    n_to_right
from line_counts
where floor_id = $floor and local_date between $first and $last
order by quarter, line_no
"""
_IN_VIEW: Final = """
with hours as (
    select local_date, hour_start_ms, sum(exposure_open_s / recorded_open_s) as people
    from camera_hours
    where floor_id = $floor and local_date between $first and $last and open_s > 0
    group by local_date, hour_start_ms
    having bool_and(recorded_open_s > 0 and exposure_open_s is not null)
)

select local_date, avg(people) as people
from hours
group by local_date
order by local_date
"""
_BOTH: Final = ("n_in", "n_out")
_LEAST: Final = ("n_in_least", "n_out_least", "n_day_least")
_NUMBERS: Final = (
    Column("n_in", "count", "people", tells=_LEAST[:1]),
    Column("n_out", "count", "people", tells=_LEAST[1:2]),
    Column("people", "people", "people", "M58", tells=_BOTH, per="known_open_h"),
    Column("people_in_view", "people", "people", tells=_BOTH),
    Column("most_people", "people", "people", "M58", tells=(*_BOTH, "n_most")),
    Column("drift", "people", "people", "M58", tells=_BOTH + _LEAST[2:]),
    Column("drift_per_1000", "rate", "per_1000_crossings", "M58", tells=_BOTH + _LEAST[2:]),
    Column("n_in_least", "count", "people", audience="operator"),
    Column("n_out_least", "count", "people", audience="operator"),
    Column("n_day_least", "count", "people", audience="operator"),
    Column("n_most", "count", "people", audience="operator"),
    Column("known_open_h", "fact", "h"),
    Column("open_h", "fact", "h"),
)
DOOR_COLUMNS: Final = (Column("floor_id", "key"), *_NUMBERS, Column("n_days", "fact", "days"))
"""Columns of `doors`."""
DAY_COLUMNS: Final = (Column("floor_id", "key"), Column("local_date", "key"), *_NUMBERS)
"""Columns of `door_days`."""
_SUMS: Final = tuple(Sum(n, (f"door_days.{n}",)) for n in _BOTH)


@dataclass(frozen=True, slots=True)
class DoorQuarter:
    """A quarter-hour of a floor whose doors are counted.

    Attributes:
        day: Local day on which the last empty hour before it was.
        is_open: Opening time.
        is_over: Its hour is over.
        n_in, n_out: People through all doors, as far as recorded; None where no door was.
        before, after: People inside when it begins and ends; None where unknown.
    """

    day: date
    is_open: bool
    is_over: bool
    n_in: int | None
    n_out: int | None
    before: int | None
    after: int | None


def door_answers(period: Period) -> tuple[Answer, Answer]:
    """Return the people inside a floor by its doors: over the days, and by day.

    Columns: people in and out; people inside, mean of recorded opening time, beside people in view; the most at the
    end of a quarter-hour; the drift, people who are inside by the doors when the day is over, and that by 1,000
    crossings (M58); opening hours in which the number is known. A day begins at `[doors] empty_at`. Over the days the
    drift is the mean without sign. For the operator: the fewest people above 0 whom one door counted in and out, in
    `door_days` on one day, and the fewer of these on one day; where they are few, numbers of all doors less those of
    the others would tell them. People before the empty hour of a date are among these: lines count them on that date.
    """
    data = period.data
    doors = {n.line_id: n.inside for n in data.site.lines if n.floor_id == data.floor.floor_id and n.inside}
    empty_min = data.site.doors_empty_min
    if not doors or empty_min is None:
        nothing = Reason("doors.not_asked" if not doors else "doors.no_empty_hour")
        return (
            Answer("doors", DOOR_COLUMNS, (), period.holds_for, nothing=nothing),
            Answer("door_days", DAY_COLUMNS, (), period.holds_for, nothing=nothing),
        )
    # the empty hour may be after midnight, so that a day ends on the next local date
    asked = {"floor": data.floor.floor_id, "first": period.first - timedelta(days=1), "last": period.last}
    rows = data.warehouse.rows(_ROWS, {**asked, "until": period.not_over_ms})
    in_view = {row["local_date"]: row["people"] for row in data.warehouse.rows(_IN_VIEW, asked)}
    quarters = [q for q in inside_by_doors(rows, doors, empty_min=empty_min) if q.day >= period.first]
    of_days = {day: list(of_day) for day, of_day in groupby(quarters, key=lambda q: q.day)}
    days = {day: of_day for day, of_day in of_days.items() if of_day[0].is_over}
    crossed = [row for row in rows if row["line_id"] in doors and row["local_date"] >= period.first]
    early = _before_empty(crossed, doors, empty_min)
    of_day, of_all = (least_of_doors(crossed, doors, by_day=by_day, early=early) for by_day in (True, False))
    day_least = _least([n for n in of_day if n is not None])
    key: Row = {"floor_id": data.floor.floor_id}
    by_day = tuple(
        {**key, "local_date": day, **_numbers([of_one], {day: in_view.get(day)}, (*of_day, day_least))}
        for day, of_one in days.items()
    )
    seen = {day: in_view.get(day) for day in days}
    whole: Row = {**key, **_numbers(list(days.values()), seen, (*of_all, day_least)), "n_days": len(days)}
    return (
        Answer("doors", DOOR_COLUMNS, (whole,), period.holds_for, _SUMS),
        Answer("door_days", DAY_COLUMNS, by_day, period.holds_for),
    )


def inside_by_doors(
    rows: Sequence[Mapping[str, Any]], doors: Mapping[str, str], *, empty_min: int
) -> Iterator[DoorQuarter]:
    """Yield the quarter-hours of a floor from its first empty hour on, with the people inside.

    Args:
        rows: Rows of `line_counts` of the floor, in order of their quarter-hours, with `minute` of the local hour and
            `is_whole`; `is_over`: the hour is over.
        doors: The side that is inside, by line.
        empty_min: Minutes after local midnight at which the floor is empty.
    """
    inside: int | None = None
    day: date | None = None
    for _, of_quarter in groupby(rows, key=lambda row: row["quarter"]):
        door_rows = [row for row in of_quarter if row["line_id"] in doors]
        if not door_rows:
            continue
        one = door_rows[0]
        if one["local_hour"] * 60 + one["minute"] == empty_min:
            inside, day = 0, one["local_date"]
        if day is None:
            continue
        n_in, n_out = (
            [row["n_to_left"] if (doors[row["line_id"]] == "left") is is_in else row["n_to_right"] for row in door_rows]
            for is_in in (True, False)
        )
        before = inside
        known_in, known_out = (sum(n for n in ways if n is not None) for ways in (n_in, n_out))
        is_known = inside is not None and all(row["is_whole"] for row in door_rows) and None not in (*n_in, *n_out)
        inside = inside + known_in - known_out if is_known and inside is not None else None
        counts = _known_sum(n_in), _known_sum(n_out)
        yield DoorQuarter(day, one["is_open"], one["is_over"], *counts, before if is_known else None, inside)


def least_of_doors(
    rows: Sequence[Mapping[str, Any]],
    doors: Mapping[str, str],
    *,
    by_day: bool,
    early: tuple[Mapping[date, int], Mapping[date, int]] = ({}, {}),
) -> tuple[int | None, int | None]:
    """Return the fewest people above 0 that one door counted in, and out; 0 without any, None where none is known.

    Args:
        rows: Rows of `line_counts` of doors.
        doors: The side that is inside, by line.
        by_day: Of one door and local day; else of one door over all rows.
        early: People in and out through all doors before the empty hour of each local date, which are fewest, too.
    """
    sums: tuple[dict[Any, int], dict[Any, int]] = ({}, {})
    for row in rows:
        place = (row["line_id"], row["local_date"] if by_day else None)
        for of_way, n in zip(sums, _in_and_out(row, doors), strict=True):
            if n is not None:
                of_way[place] = of_way.get(place, 0) + n
    n_in, n_out = (_least([*of_way.values(), *of_early.values()]) for of_way, of_early in zip(sums, early, strict=True))
    return n_in, n_out


def _in_and_out(row: Mapping[str, Any], doors: Mapping[str, str]) -> tuple[int | None, int | None]:
    counts = row["n_to_left"], row["n_to_right"]
    return counts if doors[row["line_id"]] == "left" else counts[::-1]


def _before_empty(
    rows: Sequence[Mapping[str, Any]], doors: Mapping[str, str], empty_min: int
) -> tuple[dict[date, int], dict[date, int]]:
    """Return people in and out before the empty hour of each local date, which door counts give to the day before.

    A date has none where nothing was counted then: what is unknown is no 0.
    """
    in_and_out: tuple[dict[date, int], dict[date, int]] = ({}, {})
    for row in rows:
        if row["local_hour"] * 60 + row["minute"] < empty_min:
            for of_way, n in zip(in_and_out, _in_and_out(row, doors), strict=True):
                if n is not None:
                    of_way[row["local_date"]] = of_way.get(row["local_date"], 0) + n
    return in_and_out


def _least(counts: Sequence[int]) -> int | None:
    """Return the smallest count above 0; 0 where all are 0, None without any."""
    return min((n for n in counts if n), default=0) if counts else None


def drift_of(quarters: Sequence[DoorQuarter]) -> int | None:
    """Return the people inside by the doors when a day is over: the last known number after it closed, else None."""
    last_open = max((k for k, q in enumerate(quarters) if q.is_open), default=0)
    return next((q.after for q in reversed(quarters[last_open:]) if q.after is not None), None)


def _known_sum(counts: Sequence[int | None]) -> int | None:
    known = [n for n in counts if n is not None]
    return sum(known) if known else None


def _numbers(
    days: Sequence[Sequence[DoorQuarter]], in_view: Mapping[date, float | None], least: Sequence[int | None]
) -> Row:
    """Return the cells of some days."""
    quarters = [q for day in days for q in day if q.is_over]
    is_open = [q for q in quarters if q.is_open]
    known = [(q.before + q.after) / 2 for q in is_open if q.before is not None and q.after is not None]
    n_in, n_out = _known_sum([q.n_in for q in quarters]), _known_sum([q.n_out for q in quarters])
    drifts = [(abs(left), left, day) for day in days if (left := drift_of(day)) is not None]
    crossings = sum((q.n_in or 0) + (q.n_out or 0) for _, _, day in drifts for q in day)
    seen = [n for n in in_view.values() if n is not None]
    unknown = Value.of(NOT_RECORDED) if n_in is None else Value.missing(Reason("doors.unrecorded"))
    mean_drift = sum(size for size, _, _ in drifts) / len(drifts) if drifts else None
    drift = drifts[0][1] if len(days) == 1 and drifts else mean_drift
    per_1000 = 1000 * sum(size for size, _, _ in drifts) / crossings if crossings else None
    peaks = [q.after for q in quarters if q.after is not None]
    return {
        "n_in": unknown if n_in is None else Value(n_in),
        "n_out": unknown if n_out is None else Value(n_out),
        "people": Value(sum(known) / len(known)) if known else unknown,
        "people_in_view": Value(sum(seen) / len(seen)) if seen else unknown,
        "most_people": Value(max(peaks)) if known else unknown,
        "n_most": Value(max(peaks)) if known else unknown,
        "drift": unknown if drift is None else Value(drift),
        "drift_per_1000": unknown if per_1000 is None else Value(per_1000),
        **{name: unknown if n is None else Value(n) for name, n in zip(_LEAST, least, strict=True)},
        "known_open_h": len(known) / 4,
        "open_h": len(is_open) / 4,
    }
