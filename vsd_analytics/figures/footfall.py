"""Footfall: how many people cross each counting line in a week, beside its usual range and a year before (M60).

A week is its crossings per recorded open hour, so that an outage lowers nothing. The usual range is made of the weeks
before. Changes are over the hours of the week that both weeks recorded in full. They have no verdict: how much footfall
differs by chance is shown by the range. For readers, crossings outside recorded open time count with the others where
they are few: all crossings less those of open time would tell how few. And few crossings to one side do not count: the
sum less those to the other side would tell them. Ranges, changes and expected numbers are made without weeks whose sums
are hidden, and of hours with few crossings by their sum alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta
from typing import Any, Final

import numpy as np

from vsd_analytics.answer import Answer, Cell, Column, Reason, Row, Value
from vsd_analytics.figures.panels import Flags
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.rates import NOT_RECORDED
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.share.crossings import evened_hours
from vsd_analytics.figures.slots import Floats, open_hours
from vsd_analytics.figures.special_days import days_of_one_week, notes_of_days, special_days
from vsd_analytics.figures.trend import TREND_WEEKS
from vsd_analytics.site.lines import Line
from vsd_analytics.site.model import Site
from vsd_analytics.stats.forecast import forecast_week
from vsd_analytics.stats.usual import MIN_WEEKS, usual_range
from vsd_analytics.warehouse.stored_days import has_records
from vsd_analytics.warehouse.warehouse import Warehouse, open_warehouse

MOST_RECORDED: Final = 0.9
"""Share of the open hours that a week must have recorded to be one of the weeks: the range was measured on such."""
_SLOTS: Final = 168
_YEAR: Final = timedelta(weeks=52)
_ROWS: Final = """
select
    line_id,
    local_date,
    local_hour,
    sum(n_both) filter (where is_open and state = 'full') as n,
    sum(n_to_left) filter (where is_open and state = 'full') as n_left,
    sum(n_to_right) filter (where is_open and state = 'full') as n_right,
    sum(n_both) filter (where not (is_open and state = 'full')) as n_rest,
    sum(n_to_left) filter (where not (is_open and state = 'full')) as n_rest_left,
    sum(n_to_right) filter (where not (is_open and state = 'full')) as n_rest_right,
    count(*) filter (where is_open and state = 'full') / 4 as recorded_h
from line_counts
where floor_id = $floor and local_date between $first and $last and n_both is not null
group by line_id, local_date, local_hour
order by line_id, local_date, local_hour
"""
_PARTS: Final = ("n_left", "n_right", "n_rest")
"""Sums that `n_open` tells, beside those of `vsd lines`: to either side, and all crossings less those of open hours."""
_TELLS: Final = ("n_open", *_PARTS)
_SIDES: Final = ("n_left", "n_right")
_OF_REST: Final = ("n_rest_left", "n_rest_right")


def _operator(*names: str) -> tuple[Column, ...]:
    return tuple(Column(name, "count", "crossings", audience="operator") for name in names)


_KEYS: Final = (Column("floor_id", "key"), Column("line_id", "key"))
FOOTFALL: Final = (
    *_KEYS,
    Column("name", "fact"),
    Column("n_open", "count", "crossings", "M60", per="recorded_open_h", tells=_PARTS),
    Column("per_open_h", "rate", "per_open_hour", "M60", tells=_TELLS),
    Column("usual_lo", "rate", "per_open_hour", "M60", tells=_TELLS),
    Column("usual_hi", "rate", "per_open_hour", "M60", tells=_TELLS),
    Column("beside_usual", "fact"),
    Column("change_week", "rate", "change", "M60", tells=(*_TELLS, "n_week_least")),
    Column("change_year", "rate", "change", "M60", tells=(*_TELLS, "n_year_least")),
    Column("special_days", "fact"),
    Column("recorded_open_h", "fact", "h"),
    Column("open_h", "fact", "h"),
    *_operator(*_PARTS, "n_week_least", "n_year", "n_year_least"),
)
"""Columns of `footfall`; for the operator, the fewest crossings that each change tells, and those of a year before."""
WEEKS: Final = (
    *_KEYS,
    Column("week", "key"),
    Column("name", "fact"),
    Column("n_open", "count", "crossings", "M60", per="recorded_open_h", tells=_PARTS),
    Column("per_open_h", "rate", "per_open_hour", "M60", tells=_TELLS),
    Column("recorded_open_h", "fact", "h"),
    Column("open_h", "fact", "h"),
    *_operator(*_PARTS),
)
"""Columns of `footfall_weeks`."""
NEXT: Final = (
    *_KEYS,
    Column("local_date", "key"),
    Column("name", "fact"),
    Column("n_expected", "people", "crossings", "M60", tells=(*_TELLS, "n_of_day")),
    Column("busiest_hour", "fact", "hour_of_day"),
    Column("n_busiest", "people", "crossings", "M60", tells=(*_TELLS, "n_of_hour")),
    Column("open_h", "fact", "h"),
    *_operator("n_open", *_PARTS, "n_of_day", "n_of_hour"),
)
"""Columns of `footfall_next`."""


@dataclass(frozen=True, slots=True, eq=False)
class LineWeeks:
    """The weeks of a counting line, oldest first, by open hour of the week: shape (n_weeks, 168).

    Attributes:
        n: Crossings that count, in quarter-hours that were recorded in full.
        n_few: All others, in closed hours and in quarter-hours that were not recorded in full, of weeks with so few of
            them that they count with the week; shape (n_weeks,).
        n_left, n_right: Those that count, to either side.
        n_rest: Those that do not count.
        recorded_h: Hours of such quarter-hours.
        open_h: Open hours.
    """

    n: Floats
    n_few: Floats
    n_left: Floats
    n_right: Floats
    n_rest: Floats
    recorded_h: Floats
    open_h: Floats

    @property
    def total(self) -> Floats:
        """Return the crossings of each week."""
        return np.asarray(self.n.sum(axis=1) + self.n_few)

    @property
    def by_hour(self) -> Floats:
        """Return the crossings of each hour; few others of a week are spread over its hours like the rest of it."""
        n = self.n.sum(axis=1)
        share = np.divide(self.total, n, out=np.ones(len(n)), where=n > 0)
        return np.asarray(self.n * share[:, None])

    @property
    def per_open_h(self) -> Floats:
        """Return crossings per open hour of each week; NaN where less than `MOST_RECORDED` of it was recorded."""
        recorded_h, open_h = self.recorded_h.sum(axis=1), self.open_h.sum(axis=1)
        is_known = (recorded_h > 0) & (recorded_h >= MOST_RECORDED * open_h)
        nothing = np.full(len(self.n), np.nan)
        return np.asarray(np.divide(self.total, recorded_h, out=nothing, where=is_known))

    def least(self, k: int) -> float:
        """Return the smallest number above 0 that the sums of a week tell, 0 where there is none."""
        parts = (float(grid[k].sum()) for grid in (self.n_left, self.n_right, self.n_rest))
        return _least(float(self.total[k]), *parts)

    def told(self, mask: Mask) -> Flags:
        """Return which weeks' sums the readers of a page may know, shape (n_weeks,)."""
        return np.array([not mask.hides(self.least(k)) for k in range(len(self.n))])


def footfall_answers(week: Period) -> tuple[Answer, ...]:
    """Return the footfall of each counting line: the week, the weeks before it, and the week after it (M60).

    Columns of `footfall`: crossings in recorded open time (for readers with all others, where these are few), and per
    open hour; the usual range of that by the weeks before, and where the week lies beside it; relative changes to the
    week before and to the week 52 weeks before, over the open hours of the week that both recorded in full; names of
    public holidays and events of this week or that one. Of `footfall_weeks`: crossings of up to twelve weeks. Of
    `footfall_next`: crossings expected on each day of next week, and in its busiest hour with the range that is to hold
    `forecast_share` of such hours.
    """
    site, floor, monday = week.data.site, week.data.floor, week.first
    lines = [n for n in site.lines if n.floor_id == floor.floor_id and n.is_there(monday, week.last)]
    mask = week.data.mask
    weeks = line_weeks(week.data.warehouse, floor.floor_id, monday, n_weeks=TREND_WEEKS + 1, mask=mask)
    before = _year_before(site, floor.floor_id, monday, mask)
    special = days_of_one_week(site, monday - _YEAR, monday)
    known = [line for line in lines if line.line_id in weeks]
    rows = tuple(
        {**_keys(line), **_week(weeks[line.line_id], before.get(line.line_id), mask), "special_days": special}
        for line in known
    )
    history = tuple(row for line in known for row in _history(line, weeks[line.line_id], monday))
    coming = tuple(row for line in known for row in _coming(site, line, weeks[line.line_id], monday, mask))
    special_now, special_next = (
        tuple((None, note) for note in notes_of_days(site, first)) for first in (monday, monday + timedelta(weeks=1))
    )
    holds, why_none = week.holds_for, NOT_RECORDED.reason if lines else Reason("lines.not_asked")
    return (
        Answer("footfall", FOOTFALL, rows, holds, notes=special_now, nothing=None if rows else why_none),
        Answer("footfall_weeks", WEEKS, history, holds, nothing=None if history else why_none),
        Answer("footfall_next", NEXT, coming, holds, notes=special_next, nothing=None if coming else why_none),
    )


def line_weeks(warehouse: Warehouse, floor_id: str, monday: date, *, n_weeks: int, mask: Mask) -> dict[str, LineWeeks]:
    """Return the weeks of each counting line of a floor that end with the one from `monday`; none without crossings."""
    first = monday - timedelta(weeks=n_weeks - 1)
    asked = {"floor": floor_id, "first": first, "last": monday + timedelta(days=6)}
    open_h = np.array([open_hours(warehouse.site, first + timedelta(weeks=k)) for k in range(n_weeks)])
    by_line: dict[str, list[dict[str, Any]]] = {}
    for row in warehouse.rows(_ROWS, asked):
        by_line.setdefault(row["line_id"], []).append(row)
    weeks = {}
    for line_id, rows in by_line.items():
        if not any(row["recorded_h"] for row in rows):
            continue
        week, day = np.divmod([(row["local_date"] - first).days for row in rows], 7)
        slot = 24 * day + np.array([row["local_hour"] for row in rows])
        sums = {name: np.zeros((n_weeks, _SLOTS)) for name in ("n", *_PARTS, *_OF_REST, "recorded_h")}
        for name, grid in sums.items():
            np.add.at(grid, (week, slot), [float(row[name] or 0) for row in rows])
        _leave_out_few_to_a_side(sums, mask)
        n_rest = sums["n_rest"].sum(axis=1)
        is_few = np.array([mask.hides(n) for n in n_rest])
        for side, of_rest in zip(_SIDES, _OF_REST, strict=True):
            sums[side][is_few] += sums.pop(of_rest)[is_few]
        sums["n_rest"][is_few] = 0.0
        weeks[line_id] = LineWeeks(**sums, n_few=np.where(is_few, n_rest, 0.0), open_h=open_h)
    return weeks


def _leave_out_few_to_a_side(sums: dict[str, Floats], mask: Mask) -> None:
    """Leave only the crossings to one side in weeks with few to the other."""
    few = np.array(
        [[mask.hides(n) for n in (sums[s] + sums[r]).sum(axis=1)] for s, r in zip(_SIDES, _OF_REST, strict=True)]
    )
    for k, is_few in enumerate(few & ~few[::-1]):
        for name, few_side, other in (("n", _SIDES[k], _SIDES[1 - k]), ("n_rest", _OF_REST[k], _OF_REST[1 - k])):
            sums[name][is_few] = sums[other][is_few]
            sums[few_side][is_few] = 0.0


def _year_before(site: Site, floor_id: str, monday: date, mask: Mask) -> dict[str, LineWeeks]:
    """Return the week 52 weeks before of each line, none where nothing of it is stored."""
    first, last = monday - _YEAR, monday - _YEAR + timedelta(days=6)
    if not has_records(site, first, last):
        return {}
    with open_warehouse(site, first, last, threads=1, relations=("line_counts",)) as warehouse:
        return line_weeks(warehouse, floor_id, first, n_weeks=1, mask=mask)


def _keys(line: Line) -> dict[str, Cell]:
    return {"floor_id": line.floor_id, "line_id": line.line_id, "name": line.name}


def _week(weeks: LineWeeks, year: LineWeeks | None, mask: Mask) -> dict[str, Cell]:
    rates = weeks.per_open_h
    rate = float(rates[-1])
    is_told = weeks.told(mask)
    usual = usual_range(rates[:-1][np.isfinite(rates[:-1]) & is_told[:-1]].tolist())
    few = Value.missing(Reason("footfall.weeks", least=MIN_WEEKS))
    ends = (few, few) if usual is None else (Value(usual.lo), Value(usual.hi))
    is_known = np.isfinite(rate)
    not_recorded = Value.missing(Reason("footfall.recorded", least=MOST_RECORDED))
    recorded_h = float(weeks.recorded_h[-1].sum())
    change_week, week_least = _change(weeks, -2, weeks)
    no_year = Value.missing(Reason("footfall.year"))
    change_year, year_least = (no_year, 0.0) if year is None else _change(year, 0, weeks)
    return {
        "n_open": Value(int(weeks.total[-1])) if recorded_h else Value.of(NOT_RECORDED),
        "per_open_h": Value(rate) if is_known else not_recorded,
        "usual_lo": ends[0],
        "usual_hi": ends[1],
        "beside_usual": usual.position(rate) if usual is not None and is_known and is_told[-1] else None,
        "change_week": change_week,
        "change_year": change_year,
        "n_week_least": Value(week_least),
        "n_year": no_year if year is None else Value(int(year.total[0])),
        "n_year_least": Value(year_least),
        "recorded_open_h": recorded_h,
        "open_h": float(weeks.open_h[-1].sum()),
        **_parts(weeks, -1),
    }


def _change(before: LineWeeks, k: int, now: LineWeeks) -> tuple[Value, float]:
    """Return the relative change of crossings over the hours of the week that both weeks recorded in full.

    And the smallest number above 0 that it tells: of the week before, of these hours, and of the hours left out.
    """
    is_whole = [(w.recorded_h[at] > 0) & (w.recorded_h[at] >= w.open_h[at]) for w, at in ((before, k), (now, -1))]
    both = is_whole[0] & is_whole[1]
    n_before, n_now = (float(w.n[at][both].sum() + w.n_few[at]) for w, at in ((before, k), (now, -1)))
    if now.open_h[-1][both].sum() < MOST_RECORDED * now.open_h[-1].sum() or not n_before:
        return Value.missing(Reason("footfall.compared", least=MOST_RECORDED)), 0.0
    left_out = before.n[k][~both].sum(), now.n[-1][~both].sum()
    return Value(n_now / n_before - 1), _least(before.least(k), n_before, n_now, *map(float, left_out))


def _least(*counts: float) -> float:
    return min((n for n in counts if n > 0), default=0.0)


def _parts(weeks: LineWeeks, k: int) -> dict[str, Cell]:
    """Return what the crossings of a week tell beside the numbers of `vsd lines`."""
    grids = (weeks.n_left, weeks.n_right, weeks.n_rest)
    return {name: Value(int(grid[k].sum())) for name, grid in zip(_PARTS, grids, strict=True)}


def _history(line: Line, weeks: LineWeeks, monday: date) -> list[Row]:
    """Return the rows of the last weeks, from the first that recorded anything."""
    n_weeks = len(weeks.n)
    recorded_h = weeks.recorded_h.sum(axis=1)
    first = max(int(np.flatnonzero(recorded_h > 0)[0]), n_weeks - TREND_WEEKS)
    rates = weeks.per_open_h
    missing = Value.missing(Reason("footfall.recorded", least=MOST_RECORDED))
    return [
        {
            **_keys(line),
            "week": f"{monday - timedelta(weeks=n_weeks - 1 - k):%G-W%V}",
            "n_open": Value(int(weeks.total[k])) if recorded_h[k] else Value.of(NOT_RECORDED),
            "per_open_h": Value(float(rates[k])) if np.isfinite(rates[k]) else missing,
            "recorded_open_h": float(recorded_h[k]),
            "open_h": float(weeks.open_h[k].sum()),
            **_parts(weeks, k),
        }
        for k in range(first, n_weeks)
    ]


def _coming(site: Site, line: Line, weeks: LineWeeks, monday: date, mask: Mask) -> list[Row]:
    """Return the days of next week: crossings expected, and those of the busiest hour with their range."""
    following = monday + timedelta(weeks=1)
    open_h = open_hours(site, following)
    recorded_h = np.where((weeks.recorded_h >= weeks.open_h) & weeks.told(mask)[:, None], weeks.recorded_h, 0.0)[1:]
    n = evened_hours(weeks.by_hour[1:], recorded_h, mask=mask)
    recorded_h = np.where(np.isnan(n), 0.0, recorded_h)
    days = special_days(site, monday, n_weeks=len(n))
    forecast = forecast_week(
        np.where(recorded_h > 0, n, 0.0),
        days.ordinary_h(recorded_h),
        is_count=False,
        open_h=open_h,
        share=site.settings.forecast_share,
        days=days.next,
    )
    rows: list[Row] = []
    for k in range(7):
        hours = slice(24 * k, 24 * k + 24)
        is_open = open_h[hours] > 0
        if not is_open.any():
            continue
        n_h = (forecast.mean * open_h)[hours]
        row: dict[str, Cell] = {
            **_keys(line),
            "local_date": following + timedelta(days=k),
            "open_h": float(open_h[hours].sum()),
            "n_open": Value(int(weeks.total[-1])),
            **_parts(weeks, -1),
        }
        if not np.isfinite(n_h[is_open]).all():
            why = Value.missing(forecast.reason or Reason("footfall.hours"))
            rows.append(
                {**row, "n_expected": why, "busiest_hour": None, "n_busiest": why, "n_of_day": why, "n_of_hour": why}
            )
            continue
        busiest = int(np.argmax(np.where(is_open, n_h, -1.0)))
        at = 24 * k + busiest
        ends = float(forecast.lo[at] * open_h[at]), float(forecast.hi[at] * open_h[at])
        n_busiest, n_expected = float(n_h[busiest]), float(n_h[is_open].sum())
        rows.append(
            {
                **row,
                "n_expected": Value(n_expected),
                "busiest_hour": None if mask.hides(n_busiest) or not weeks.told(mask)[-1] else busiest,
                "n_busiest": Value(n_busiest, *ends),
                "n_of_day": Value(n_expected),
                "n_of_hour": Value(n_busiest),
            }
        )
    return rows
