"""When it is risky: the hours of the week over the last four weeks, and the highest of them (M13, M14)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import date, timedelta
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason, State
from vsd_analytics.figures.slots import Floats, Slots, iso_week, known, load_slots
from vsd_analytics.stats.hour_of_week import MIN_PROFILE_WEEKS, PeakHours, SlotRates, peaks, slot_rates
from vsd_analytics.warehouse.warehouse import Warehouse

PROFILE_WEEKS: Final = 4
"""Weeks of an hour-of-week profile: definition of M13 and M14; older weeks are another season."""


@dataclass(frozen=True, slots=True)
class HourProfile:
    """One open hour of the week.

    Attributes:
        weekday: 0 Monday to 6 Sunday.
        hour: Local hour, 0 to 23.
        risk: Violations per person-hour, pulled towards the mean hour as far as chance may have made it; None =
            unknown.
        risk_lo, risk_hi: Its interval.
        burden: Violations per recorded open hour, likewise.
        burden_lo, burden_hi: Its interval.
        people: Mean number of people in view, as measured; None = unknown.
        violations: Counted; None = unknown.
        person_h: Person-hours; None = unknown.
        recorded_h: Recorded open hours.
        n_weeks: Weeks that recorded the hour for at least half.
        state: "ok" when at least three of the four weeks recorded it.
    """

    weekday: int
    hour: int
    risk: float | None
    risk_lo: float | None
    risk_hi: float | None
    burden: float | None
    burden_lo: float | None
    burden_hi: float | None
    people: float | None
    violations: float | None
    person_h: float | None
    recorded_h: float
    n_weeks: int
    state: State


@dataclass(frozen=True, slots=True)
class WeekProfile:
    """The hours of the week over four weeks.

    Attributes:
        last_week: ISO week of the last of them.
        floor_id: Floor; None = the whole site.
        rows: Open hours, Monday first.
        by_burden: Highest hours by violations per recorded open hour.
        by_risk: Highest hours by violations per person-hour.
        state: "ok" when at least one hour has a rate per person-hour.
        reason: Why not.
    """

    last_week: str
    floor_id: str | None
    rows: tuple[HourProfile, ...]
    by_burden: PeakHours
    by_risk: PeakHours
    state: State
    reason: Reason | None


def week_profile(
    warehouse: Warehouse,
    monday: date,
    *,
    floor_id: str | None = None,
    as_known: Callable[[Slots], Slots] | None = None,
) -> WeekProfile:
    """Return the hours of the week over the four weeks that end with the one from `monday`.

    Args:
        warehouse: Opened over the four weeks, or from wherever records begin.
        monday: First day of the last week.
        floor_id: Only the cameras of this floor; None = all.
        as_known: As for `forecast.forecast`.

    Raises:
        UsageError: E101, `monday` is no Monday, or the site has no such floor.

    Example:
        >>> len(vsd.week_profile(warehouse, date(2026, 11, 9)).rows)  # the open hours of a week
        86
    """
    slots = load_slots(
        warehouse, monday, n_weeks=PROFILE_WEEKS, floor_id=floor_id, there=(monday, monday + timedelta(days=6))
    )
    slots = slots if as_known is None else as_known(slots)
    confidence = float(warehouse.site.settings.confidence)
    violations, people = slots.violations, slots.people
    n_weeks = (violations.x_h > 0).sum(axis=0)
    is_estimated = n_weeks >= MIN_PROFILE_WEEKS
    burden = slot_rates(violations.n, np.where(is_estimated, violations.x_h, 0), min_weeks=1, confidence=confidence)
    # an hour that was recorded with nobody in view is recorded, but nobody was at risk
    both = (violations.x_h > 0) & (people.x_h > 0) & is_estimated
    exposure = np.where(both, people.n * _same_hours(violations.x_h, people.x_h), 0)
    risk = slot_rates(np.where(exposure > 0, violations.n, 0), exposure, min_weeks=1, confidence=confidence)
    why_violation_rate, why_encounter_rate = slots.why_no_violations, slots.why_no_violations or slots.why_no_people
    return WeekProfile(
        last_week=iso_week(monday),
        floor_id=floor_id,
        rows=_rows(slots, burden, risk),
        by_burden=_peaks(burden, why_violation_rate),
        by_risk=_peaks(risk, why_encounter_rate),
        state=risk.state if why_encounter_rate is None else "not_measurable",
        reason=_reason(risk) if why_encounter_rate is None else why_encounter_rate,
    )


def _same_hours(x_h: Floats, of_h: Floats) -> Floats:
    """Return by what to multiply sums over hours `of_h` so that they are over hours `x_h`; 1 almost always."""
    return np.divide(x_h, of_h, out=np.zeros(x_h.shape), where=of_h > 0)


def _reason(rates: SlotRates) -> Reason | None:
    if rates.state == "ok" or (rates.n.sum() == 0 and rates.x.sum() > 0):
        return rates.reason
    return Reason("hours.open_weeks", least=MIN_PROFILE_WEEKS, of=PROFILE_WEEKS)


def _rows(slots: Slots, burden: SlotRates, risk: SlotRates) -> tuple[HourProfile, ...]:
    violations, people = slots.violations, slots.people
    n_weeks = np.maximum((violations.x_h > 0).sum(axis=0), (people.x_h > 0).sum(axis=0))
    people_h, person_h = people.x_h.sum(axis=0), people.n.sum(axis=0)
    knows_n, knows_p = slots.why_no_violations is None, slots.why_no_people is None
    rows = []
    for s in np.flatnonzero((slots.open_h > 0).any(axis=0)).tolist():
        is_estimated = n_weeks[s] >= MIN_PROFILE_WEEKS
        rows.append(
            HourProfile(
                weekday=s // 24,
                hour=s % 24,
                risk=known(risk.rate[s]),
                risk_lo=known(risk.lo[s]),
                risk_hi=known(risk.hi[s]),
                burden=known(burden.rate[s]),
                burden_lo=known(burden.lo[s]),
                burden_hi=known(burden.hi[s]),
                people=float(person_h[s] / people_h[s]) if is_estimated and people_h[s] > 0 else None,
                violations=float(violations.n[:, s].sum()) if knows_n and n_weeks[s] else None,
                person_h=float(person_h[s]) if knows_p and people_h[s] > 0 else None,
                recorded_h=float(max(violations.x_h[:, s].sum(), people_h[s])),
                n_weeks=int(n_weeks[s]),
                state="ok" if is_estimated else "not_enough_data",
            )
        )  # fmt: skip
    return tuple(rows)


def _peaks(rates: SlotRates, why: Reason | None) -> PeakHours:
    if why is not None:
        return PeakHours((), (), "not_measurable", why)
    peak_hours = peaks(rates)
    return peak_hours if "ok" in (peak_hours.state, rates.state) else replace(peak_hours, reason=_reason(rates))
