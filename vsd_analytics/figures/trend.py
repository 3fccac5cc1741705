"""How the last twelve weeks went: how often and how risky, week by week, and what was changed when (M28)."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, datetime, timedelta
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.config.change_log import read_log
from vsd_analytics.figures.slots import NO_POSITIONS, Floats, Slots, iso_week, load_slots
from vsd_analytics.result import Reason, State
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.stats.trend import HISTORY_WEEKS, weekly_trend
from vsd_analytics.warehouse.warehouse import Warehouse

TREND_WEEKS: Final = 12
"""Weeks of the trend: part of its definition, a quarter of a year."""


@dataclass(frozen=True, slots=True)
class WeekRates:
    """One week.

    Attributes:
        week: ISO week.
        monday: First day.
        often: Violations per open hour (M0); None in a gap.
        risky: Violations per person-hour (M7); None in a gap or where exposure is unknown.
        coverage: Recorded share of open camera-hours; None when the site was closed all week.
        state: "ok", or why it is a gap: a line must not be drawn across it.
        reason: Why it is a gap.
    """

    week: str
    monday: date
    often: RateEstimate | None
    risky: RateEstimate | None
    coverage: float | None
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class ChangeMark:
    """An entry of the change log.

    Attributes:
        at: Instant, local.
        week: ISO week it lies in.
        text: Free text: escape it.
        area_id: Area it concerns; None = the whole site.
    """

    at: datetime
    week: str
    text: str
    area_id: str | None


@dataclass(frozen=True, slots=True)
class FloorTrend:
    """The last weeks.

    Attributes:
        floor_id: Floor; None = the whole site.
        weeks: Oldest first, from the first week with records on, at most twelve; gaps included.
        marks: Changes in these weeks.
        state: "ok" when at least three weeks are no gaps.
        reason: Why not.
        risky_reason: Why the rate per person-hour cannot be given; None where it can.
    """

    floor_id: str | None
    weeks: tuple[WeekRates, ...]
    marks: tuple[ChangeMark, ...]
    state: State
    reason: Reason | None
    risky_reason: Reason | None


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
    """
    slots = load_slots(warehouse, monday, n_weeks=TREND_WEEKS + HISTORY_WEEKS, floor_id=floor_id)
    if (why := slots.why_no_violations) is not None:
        return FloorTrend(floor_id, (), (), "not_measurable", why, why)
    settings = warehouse.site.settings
    used = slots.is_recorded & ~np.isnan(slots.n_violations)
    why_no_risk = NO_POSITIONS if slots.why_no_people or np.isnan(slots.person_h[used]).any() else None
    seen = np.flatnonzero((slots.recorded_h > 0).any(axis=(0, 2)))
    n_weeks = min(TREND_WEEKS, TREND_WEEKS + HISTORY_WEEKS - int(seen[0])) if len(seen) else 0
    found = weekly_trend(
        _by_day(slots.n_violations, used),
        _by_day(slots.recorded_h, used),
        None if why_no_risk else _by_day(slots.person_h, used),
        slots.open_h.reshape(-1, 24).sum(axis=1),
        coverage=_coverage(slots),
        n_weeks=n_weeks,
        min_coverage=float(settings.min_coverage),
        confidence=float(settings.confidence),
        min_days=int(settings.min_days),
        min_exposure_h=float(settings.min_exposure_h),
    )
    mondays = [monday - timedelta(weeks=i) for i in reversed(range(n_weeks))]
    weeks = tuple(
        WeekRates(iso_week(m), m, w.often, w.risky, w.coverage, w.state, w.reason)
        for m, w in zip(mondays, found.weeks, strict=True)
    )
    marks = _marks(warehouse, mondays[0], monday, floor_id) if mondays else ()
    return FloorTrend(floor_id, weeks, marks, found.state, found.reason, why_no_risk)


def _by_day(values: Floats, used: NDArray[np.bool_]) -> Floats:
    """Return sums over the used hours of each day, shape (n_cameras, 7 n_weeks)."""
    kept = np.where(used, values, 0.0)
    return np.asarray(kept.reshape(len(kept), -1, 24).sum(axis=2))


def _coverage(slots: Slots) -> Floats:
    """Return the recorded share of open camera-hours of each week; NaN when the site was closed."""
    scheduled = slots.open_h.sum(axis=1) * len(slots.camera_ids)
    recorded = slots.recorded_h.sum(axis=(0, 2))
    share: Floats = np.divide(recorded, scheduled, out=np.full(len(recorded), np.nan), where=scheduled > 0)
    return share


def _marks(warehouse: Warehouse, first: date, last: date, floor_id: str | None) -> tuple[ChangeMark, ...]:
    site = warehouse.site
    here = {a.area_id for a in site.areas if floor_id in (None, a.floor_id)}
    marks = []
    for entry in read_log(site):
        day = entry.at.astimezone(site.zone).date()
        week = day - timedelta(days=day.weekday())
        if first <= week <= last and (entry.area_id is None or entry.area_id in here or floor_id is None):
            marks.append(ChangeMark(entry.at, iso_week(week), entry.text, entry.area_id))
    return tuple(marks)
