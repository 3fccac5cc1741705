"""How the last twelve weeks went: how often and how much time too close, week by week, and what was changed (M28)."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.answer import Reason, State
from vsd_analytics.config.change_log import read_log
from vsd_analytics.figures.slots import NO_POSITIONS, Floats, Slots, load_slots
from vsd_analytics.site.model import LogEntry
from vsd_analytics.stats.rates import HISTORY_WEEKS
from vsd_analytics.stats.trend import WeekRates, weekly_trend, why_no_trend
from vsd_analytics.warehouse.warehouse import Warehouse

TREND_WEEKS: Final = 12
"""Weeks of the trend: part of its definition, a quarter of a year."""


@dataclass(frozen=True, slots=True)
class FloorTrend:
    """The last weeks.

    Attributes:
        floor_id: Floor; None = the whole site.
        weeks: Oldest first, from the first week with records on, at most twelve; gaps included.
        marks: Entries of the change log in these weeks; their text is free: escape it.
        cameras: Names of the cameras, by the position that `WeekRates.missing` gives; free text: escape them.
        left_out: Names of those that recorded nothing in the last week, so that no week counts them.
        state: "ok" when at least three weeks are no gaps.
        reason: Why not.
        encounter_rate_reason: Why the rate per person-hour cannot be given; None where it can.
    """

    floor_id: str | None
    weeks: tuple[WeekRates, ...]
    marks: tuple[LogEntry, ...]
    cameras: tuple[str, ...]
    left_out: tuple[str, ...]
    state: State
    reason: Reason | None
    encounter_rate_reason: Reason | None


def first_day(monday: date) -> date:
    """Return the first day a warehouse must hold for `trend` up to the week from `monday`, history included."""
    return monday - timedelta(weeks=TREND_WEEKS - 1 + HISTORY_WEEKS)


def trend(warehouse: Warehouse, monday: date, *, floor_id: str | None = None) -> FloorTrend:
    """Return the twelve weeks that end with the one from `monday`.

    Args:
        warehouse: Opened from `first_day(monday)`, or from wherever records begin, to the end of the week.
        monday: First day of the last week.
        floor_id: Only the cameras, and the log entries of the areas, of this floor; None = all.

    Raises:
        UsageError: E101, `monday` is no Monday, or the site has no such floor.
        InputError: E110, a line of the change log is not an entry.

    Example:
        >>> len(vsd.trend(warehouse, date(2026, 11, 9)).weeks)
        1
    """
    slots = load_slots(warehouse, monday, n_weeks=TREND_WEEKS + HISTORY_WEEKS, floor_id=floor_id)
    if (why := slots.why_no_violations) is not None:
        return FloorTrend(floor_id, (), (), (), (), "not_measurable", why, why)
    settings = warehouse.site.settings
    used = slots.is_recorded & ~np.isnan(slots.n_violations)
    is_unknown = slots.why_no_people or np.isnan(slots.violation_h[used]).any()
    why_no_risk = NO_POSITIONS if slots.why_no_people or np.isnan(slots.person_h[used]).any() else None
    seen = np.flatnonzero((slots.recorded_h > 0).any(axis=(0, 2)))
    n_weeks = min(TREND_WEEKS, TREND_WEEKS + HISTORY_WEEKS - int(seen[0])) if len(seen) else 0
    mondays = [monday - timedelta(weeks=i) for i in reversed(range(n_weeks))]
    first, without = first_day(monday), warehouse.withheld_days.get(floor_id or "", ())
    weeks = weekly_trend(
        _by_day(slots.n_violations, used),
        _by_day(slots.recorded_h, used),
        None if why_no_risk else _by_day(slots.person_h, used),
        slots.open_h.reshape(-1, 24).sum(axis=1),
        close_h=None if why_no_risk or is_unknown else _by_day(slots.violation_h, used),
        coverage=_coverage(slots),
        mondays=mondays,
        withheld=[first + timedelta(days=d) in without for d in range(7 * (TREND_WEEKS + HISTORY_WEEKS))],
        min_coverage=float(settings.min_coverage),
        **settings.for_intervals,
        min_exposure_h=float(settings.min_exposure_h),
    )
    marks = _marks(warehouse, mondays[0], monday, floor_id) if mondays else ()
    why = why_no_trend(weeks)
    names = {c.camera_id: c.name for c in warehouse.site.cameras}
    cameras = tuple(names[c] for c in slots.camera_ids)
    is_lost = np.asarray(~used[:, -1].any(axis=1) & (slots.scheduled_h[:, -1] > 0).any(axis=1))
    left_out = tuple(name for name, lost in zip(cameras, is_lost, strict=True) if lost)
    state: State = "ok" if why is None else "not_enough_data"
    return FloorTrend(floor_id, weeks, marks, cameras, left_out, state, why, why_no_risk)


def _by_day(values: Floats, used: NDArray[np.bool_]) -> Floats:
    """Return sums over the used hours of each day, shape (n_cameras, 7 n_weeks)."""
    kept = np.where(used, values, 0.0)
    return np.asarray(kept.reshape(len(kept), -1, 24).sum(axis=2))


def _coverage(slots: Slots) -> Floats:
    """Return the recorded share of open camera-hours of each week; NaN when the site was closed."""
    scheduled = slots.scheduled_h.sum(axis=(0, 2))
    recorded = slots.recorded_h.sum(axis=(0, 2))
    share: Floats = np.divide(recorded, scheduled, out=np.full(len(recorded), np.nan), where=scheduled > 0)
    return share


def _marks(warehouse: Warehouse, first: date, last: date, floor_id: str | None) -> tuple[LogEntry, ...]:
    """Return the entries of the log from the week of one Monday to that of another, those of other floors left out."""
    site = warehouse.site
    here = {None, *(a.area_id for a in site.areas if a.floor_id == floor_id)}
    days = ((entry, entry.at.astimezone(site.zone).date()) for entry in read_log(site))
    return tuple(
        entry
        for entry, day in days
        if first <= day < last + timedelta(weeks=1) and (floor_id is None or entry.area_id in here)
    )
