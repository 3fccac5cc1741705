"""The calendar of a site: opening hours, public holidays of its country, events written by hand, changes of the clock.

Public holidays come from the library `holidays` (extra `calendar`), by country and region (ISO 3166). What happens only
at this site, such as school holidays or a fair, is an event of `vsd.toml`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date, datetime, time, timedelta
from functools import lru_cache
from typing import Final
from zoneinfo import ZoneInfo

WEEK: Final = timedelta(days=7)


Opening = tuple[tuple[tuple[int, int], ...], ...]
"""For weekday 0 (Monday) to 6: (start, end) in minutes after local midnight."""


@dataclass(frozen=True, slots=True)
class OpeningChange:
    """Opening hours that hold from a day on: `[[opening]]`.

    Attributes:
        first: First local day.
        opening: The week from then on.
        by: Who changed them; None = not stated.
    """

    first: date
    opening: Opening
    by: str | None = None


@dataclass(frozen=True, slots=True)
class OpeningHours:
    """The opening hours of a site at all times.

    Attributes:
        until_then: Before the first change; None = always open.
        changes: In the order of their first days.
    """

    until_then: Opening | None
    changes: tuple[OpeningChange, ...] = ()

    @property
    def spans(self) -> tuple[tuple[date, Opening | None], ...]:
        """Return first day and week of all; each holds until the next begins."""
        return ((date.min, self.until_then), *((c.first, c.opening) for c in self.changes))

    @property
    def weeks(self) -> tuple[Opening, ...]:
        """Return each week of opening hours that holds at some time; none = the site is always open."""
        return tuple(opening for _, opening in self.spans if opening is not None)

    def on(self, day: date) -> Opening | None:
        """Return the week that holds on a day; None = always open."""
        return next(opening for first, opening in reversed(self.spans) if first <= day)


@dataclass(frozen=True, slots=True)
class Event:
    """Days that are unlike others at a site, though it is open: `[[event]]`.

    Attributes:
        name: What it is: School holidays.
        first, last: Its local days, both included.
    """

    name: str
    first: date
    last: date


@dataclass(frozen=True, slots=True)
class Calendar:
    """`[calendar]` and `[[event]]` of `vsd.toml`.

    Attributes:
        country: Code of ISO 3166, such as IT; None = no public holidays are known.
        region: Its subdivision, such as BZ; None = only those of the whole country.
        language: Of the names of holidays, where the library has them.
        events: In the order of the file.
    """

    country: str | None = None
    region: str | None = None
    language: str = "en"
    events: tuple[Event, ...] = ()

    def holiday(self, day: date) -> str | None:
        """Return the name of the public holiday on a day; None on any other day."""
        if self.country is None:
            return None
        return public_holidays(self.country, self.region, self.language, day.year).get(day)

    def event(self, day: date) -> Event | None:
        """Return the first event that includes a day."""
        return next((e for e in self.events if e.first <= day <= e.last), None)


@lru_cache(maxsize=64)
def public_holidays(country: str, region: str | None, language: str, year: int) -> Mapping[date, str]:
    """Return the public holidays of a year, names by day.

    Args:
        country: Code of ISO 3166 that the library knows: `vsd_analytics.config.calendar` refuses others.
        region: Its subdivision, likewise; None = the whole country.
        language: Of the names; the country's own where the library lacks it.
        year: The year.

    Raises:
        ImportError: The library is not installed.
    """
    import holidays  # only sites with a country need it

    known = holidays.country_holidays(country, subdiv=region)
    # without a language the library takes that of the machine, and names would differ from one to the next
    own = known.default_language
    chosen = next((code for code in known.supported_languages if code.partition("_")[0] == language), own)
    named = holidays.country_holidays(country, subdiv=region, years=year, language=chosen)
    return {day: str(name) for day, name in sorted(named.items())}


def is_after_clock_change(zone: ZoneInfo, day: date) -> bool:
    """Tell whether the clocks changed in the seven days before a day: sun and habits come an hour earlier or later."""
    now, before = (datetime.combine(d, time(12), zone).utcoffset() for d in (day, day - WEEK))
    return now != before


def touches(first_day: date | None, end_day: date | None, first: date, last: date) -> bool:
    """Tell whether a life of whole days has a day from `first` to `last`; None = without a beginning, or an end."""
    return (first_day is None or first_day <= last) and (end_day is None or end_day > first)
