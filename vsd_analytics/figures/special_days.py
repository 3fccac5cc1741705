"""Days that are unlike others, by the site's calendar: what a forecast makes of them."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.slots import Floats
from vsd_analytics.site.calendar import is_after_clock_change
from vsd_analytics.site.model import Site
from vsd_analytics.stats.forecast import CLOCK_DOUBT, EVENT_DOUBT, HOLIDAY_DOUBT, DayRules
from vsd_analytics.stats.hour_of_week import SLOTS, Bools

SUNDAY: Final = 6
HOLIDAY: Final = "calendar.holiday"
"""Code of the sentence on a public holiday."""


@dataclass(frozen=True, slots=True, eq=False)
class SpecialDays:
    """What the calendar says of some weeks and of the one after them.

    Attributes:
        is_holiday: Public holidays of the weeks, shape (n_weeks, 7).
        last: Rules of the last of the weeks.
        next: Rules of the week after it.
    """

    is_holiday: Bools
    last: DayRules
    next: DayRules

    def ordinary_h(self, x_h: Floats) -> Floats:
        """Return recorded hours, shape (n_weeks, 168), 0 on public holidays: those say nothing of other weeks."""
        return np.where(np.repeat(self.is_holiday, SLOTS // 7, axis=1), 0.0, x_h)


def special_days(site: Site, first: date, *, n_weeks: int) -> SpecialDays:
    """Return what the calendar says of the week from `first`, those before it, and the one after it.

    Args:
        site: Its calendar and time zone.
        first: First day of the last week, any weekday: what begins on it is called a week here.
        n_weeks: Weeks, that one included.
    """
    begin, after = first - timedelta(weeks=n_weeks - 1), first + timedelta(weeks=1)
    days = [begin + timedelta(days=k) for k in range(7 * n_weeks)]
    is_holiday = np.array([site.calendar.holiday(day) is not None for day in days]).reshape(n_weeks, 7)
    return SpecialDays(is_holiday, day_rules(site, first), day_rules(site, after))


def day_rules(site: Site, first: date) -> DayRules:
    """Return how each of the seven days from `first` on is forecast.

    A public holiday has the usual hours of a Sunday. Days of events, and days in the week after the clocks changed,
    have their own, with a wider range; where several hold, variances add up.

    Args:
        site: Its calendar and time zone.
        first: The first day.
    """
    days = [first + timedelta(days=k) for k in range(7)]
    sunday = next(k for k, day in enumerate(days) if day.weekday() == SUNDAY)
    like, variance = np.arange(7), np.zeros(7)
    for k, day in enumerate(days):
        if site.calendar.holiday(day) is not None:
            like[k] = sunday
            variance[k] += HOLIDAY_DOUBT**2
        if site.calendar.event(day) is not None:
            variance[k] += EVENT_DOUBT**2
        if is_after_clock_change(site.zone, day):
            variance[k] += CLOCK_DOUBT**2
    return DayRules(like, np.sqrt(variance))


def open_holidays(site: Site, first: date) -> tuple[Reason, ...]:
    """Return the public holidays among the seven days from `first` on which the site is not closed, a sentence each."""
    days = [first + timedelta(days=k) for k in range(7)]
    named = [(day, name) for day in days if day not in site.closed and (name := site.calendar.holiday(day))]
    return tuple(Reason(HOLIDAY, day=day, name=name) for day, name in named)


def notes_of_days(site: Site, first: date) -> tuple[Reason, ...]:
    """Return what the calendar says of the seven days from `first`, a sentence each."""
    days = [first + timedelta(days=k) for k in range(7)]
    notes = list(open_holidays(site, first))
    events = dict.fromkeys(event for day in days if (event := site.calendar.event(day)) is not None)
    notes += [Reason("calendar.event", name=event.name, first=event.first, last=event.last) for event in events]
    if is_after_clock_change(site.zone, days[0]) or is_after_clock_change(site.zone, days[-1]):
        notes.append(Reason("calendar.clock"))
    return tuple(notes)


def days_of_one_week(site: Site, *mondays: date) -> tuple[str, ...]:
    """Return the names of public holidays and events that do not lie in all of some weeks, in order of the alphabet."""
    named: list[set[str]] = []
    for monday in mondays:
        days = [monday + timedelta(days=k) for k in range(7)]
        special = [each for day in days for each in (site.calendar.holiday(day), site.calendar.event(day)) if each]
        named.append({str(getattr(each, "name", each)) for each in special})
    return tuple(sorted(set[str]().union(*named) - named[0].intersection(*named)))
