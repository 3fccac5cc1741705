"""Logged changes on the page: what each did, as the report says it, and the matched weeks before and after it.

The verdicts are those of `vsd_analytics.figures.before_after`. The weeks are its windows, over the hours that both
sides recorded; they are on the operator's page only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import Final

import numpy as np

from vsd_analytics.answer import Answers
from vsd_analytics.config.change_log import read_log
from vsd_analytics.figures.before_after import before_after
from vsd_analytics.figures.change_weeks import WEEKS, local_day, windows_of
from vsd_analytics.figures.compare import Days
from vsd_analytics.figures.panels import WEEK, Flags, Ints
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.figures.week.change_effects import change_effect, shared_change_answers
from vsd_analytics.figures.week.model_sections import JudgedChange
from vsd_analytics.planner import cell_counts
from vsd_analytics.planner.hour_counts import Counted, HourPanel, TwoWeeks, open_slots, panel_of
from vsd_analytics.site.model import Area, LogEntry, Site

MOST_WEEKS: Final = 12
"""Weeks of the log that a page holds, at most: as many as the report's trend has."""
UNIT_MS: Final = 100
"""Unit of person-time in the sums of several weeks."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class CellSums:
    """Counts or times of some weeks by camera and cell.

    Attributes:
        camera, cell: Of each row, by camera and cell, rising.
        values: Columns, shape (n_kinds, n_rows).
    """

    camera: Ints
    cell: Ints
    values: Ints


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ChangeSide:
    """The weeks on one side of a change, over the hours recorded on both.

    Attributes:
        days: First and last day.
        recorded_ms: Recorded opening time, shape (n_cameras,).
        n: Violations, shape (n_places, n_cameras).
        exposure_ms: Person-milliseconds, same shape.
        close_ms: Those in violation, same shape.
        violations: By cell of half a metre; None without a map.
        time: Person-time and person-time in violation by square, in `UNIT_MS`; likewise.
    """

    days: Days
    recorded_ms: Ints
    n: Ints
    exposure_ms: Ints
    close_ms: Ints
    violations: CellSums | None
    time: CellSums | None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PlannerChange:
    """An entry of the log.

    Attributes:
        number: Its place in the log, from 1.
        at: Instant in the site's zone.
        text: Free text.
        area: The area it names; None = the whole site.
        answers: What it did (`shared_change_answers`); None where the whole site is concerned.
        result: The same as the report has it, for the sentence that all outputs say; likewise.
        before, after: The matched weeks; None where there are none yet, and on a page for readers: their sums are over
            the hours that both sides recorded, which no report of a week tells.
    """

    number: int
    at: datetime
    text: str
    area: Area | None
    answers: Answers | None
    result: JudgedChange | None
    before: ChangeSide | None
    after: ChangeSide | None


@dataclass(frozen=True, slots=True, eq=False)
class _Week:
    """A week, and which of the floor's hours it has."""

    slots: Ints
    panel: HourPanel
    cells: cell_counts.CellCounts | None


def entries_of(site: Site, monday: date, *, weeks: int, floor_id: str | None = None) -> list[tuple[int, LogEntry]]:
    """Return the log's entries of the last weeks up to the one from `monday`, with their numbers, in order of time.

    Args:
        site: The project.
        monday: First day of the last week.
        weeks: How many weeks back.
        floor_id: Only entries of this floor's areas and of the whole site; None = of all floors.
    """
    first, last = monday - (weeks - 1) * WEEK, monday + timedelta(days=6)
    floors = {a.area_id: a.floor_id for a in site.areas}
    entries = [
        (number, entry)
        for number, entry in enumerate(read_log(site), 1)
        if first <= local_day(site, entry) <= last
        and (entry.area_id is None or (entry.area_id in floors and floor_id in (None, floors[entry.area_id])))
    ]
    return sorted(entries, key=lambda each: (each[1].at, each[0]))


def logged_changes(data: TwoWeeks, counted: Counted, *, weeks: int) -> tuple[PlannerChange, ...]:
    """Return the logged changes of the last weeks up to this one, in order of time.

    Args:
        data: The floor; its warehouse reaches back to the first day of the report.
        counted: What is counted where.
        weeks: How many weeks of the log.
    """
    floor_weeks = _Weeks(data, counted)
    return tuple(
        _change(data, floor_weeks, number, entry)
        for number, entry in entries_of(data.site, data.monday, weeks=weeks, floor_id=data.floor.floor_id)
    )


def _change(data: TwoWeeks, floor_weeks: _Weeks, number: int, entry: LogEntry) -> PlannerChange:
    areas = {a.area_id: a for a in data.areas}
    answers = result = None
    if entry.area_id is not None:
        figure = before_after(data.warehouse, number)
        answers, result, windows = shared_change_answers(data, figure), change_effect(data, figure), figure.windows
    else:
        windows, _ = windows_of(data.warehouse, entry, area_id="", weeks=WEEKS)
    sides: list[ChangeSide | None] = [None, None]
    if windows is not None and not data.mask.is_on:
        pair = TwoPeriods(Period(data, *windows.before), Period(data, *windows.after))
        sides = [floor_weeks.side(windows.before, pair.used(0)), floor_weeks.side(windows.after, pair.used(1))]
    return PlannerChange(
        number=number,
        at=entry.at.astimezone(data.site.zone),
        text=entry.text,
        area=None if entry.area_id is None else areas[entry.area_id],
        answers=answers,
        result=result,
        before=sides[0],
        after=sides[1],
    )


class _Weeks:
    """The weeks of a floor, each made once."""

    def __init__(self, data: TwoWeeks, counted: Counted) -> None:
        self._data, self._counted = data, counted
        self._made: dict[date, _Week] = {}

    def side(self, days: Days, used: Flags) -> ChangeSide:
        """Return the sums of some days over camera-hours `used`, shape (n_cameras, n_hours)."""
        shape = (len(self._counted.places), len(self._data.ids))
        sums = {name: np.zeros(shape, dtype=np.int64) for name in ("n", "exposure_ms", "close_ms")}
        recorded_ms = np.zeros(shape[1], dtype=np.int64)
        parts: dict[str, list[Ints]] = {"violations": [], "time": []}
        for monday in _mondays(days):
            week = self._week(monday)
            taken = used[:, week.slots]
            recorded_ms += (week.panel.recorded_ms * taken).sum(axis=1)
            for name in sums:
                sums[name] += (getattr(week.panel, name) * taken).sum(axis=2)
            if week.cells is None:
                continue
            for name, unit in (("violations", 1), ("time", week.cells.unit_ms)):
                rows: cell_counts.Rows = getattr(week.cells, name)
                kept = taken[rows.camera, rows.slot]
                parts[name].append(
                    np.concatenate(([rows.camera[kept]], [rows.cell[kept]], rows.values[:, kept] * unit))
                )
        has_map = bool(parts["time"])
        return ChangeSide(
            days=days,
            recorded_ms=recorded_ms,
            **sums,
            violations=_summed(parts["violations"], unit=1) if has_map else None,
            time=_summed(parts["time"], unit=UNIT_MS) if has_map else None,
        )

    def _week(self, monday: date) -> _Week:
        if monday not in self._made:
            self._made[monday] = self._make(monday)
        return self._made[monday]

    def _make(self, monday: date) -> _Week:
        data, counted = self._data, self._counted
        days = data.warehouse.days(monday, monday + timedelta(days=6))
        panel, slots = panel_of(data, days, counted, [monday], hidden={}), open_slots(data, days)
        nowhere = np.zeros_like(panel.is_counted)
        asked = counted.cells_asked(data, slots, used=panel.is_counted, shared=nowhere, hidden={})
        cells = None if asked is None or not slots.size else cell_counts.counts_by_cell(data, asked)
        return _Week(slots, panel, cells)


def _mondays(days: Days) -> list[date]:
    first = days[0] - timedelta(days=days[0].weekday())
    return [first + k * WEEK for k in range((days[1] - first).days // 7 + 1)]


def _summed(parts: Sequence[Ints], *, unit: int) -> CellSums:
    """Return rows (camera, cell, values) added up by camera and cell, in units."""
    rows = np.concatenate(parts, axis=1)
    keys, at = np.unique(rows[:2], axis=1, return_inverse=True)
    values = np.zeros((len(rows) - 2, keys.shape[1]), dtype=np.int64)
    for total, column in zip(values, rows[2:], strict=True):
        np.add.at(total, at.ravel(), column)
    return CellSums(camera=keys[0], cell=keys[1], values=(values + unit // 2) // unit)
