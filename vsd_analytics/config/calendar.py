"""`[calendar]` and `[[event]]` of `vsd.toml`: country and region of the public holidays, and events of the site."""

from __future__ import annotations

from datetime import date
from typing import Final

from vsd_analytics.config.reader import DATE, TableReader
from vsd_analytics.config.values import parse_date
from vsd_analytics.errors import nearest
from vsd_analytics.site.calendar import Calendar, Event, public_holidays

A_YEAR: Final = 2026
"""Any year: a country that the library knows has holidays in each."""
INSTALL: Final = 'pip install "vsd-analytics[calendar]"'


def read_calendar(root: TableReader, language: str) -> Calendar:
    """Return what `[calendar]` and `[[event]]` say; an empty calendar without them.

    Args:
        root: Reader of the file.
        language: In which holidays are named.
    """
    table = root.inner("calendar")
    country = table.text("country", example='"IT"')
    region = table.text("region", example='"BZ"')
    if region is not None and country is None and "country" not in table.values:
        table.missing("country", '"IT"', why="a region belongs to a country")
    if country is not None and not _is_known(table, country, region):
        country = region = None
    events = tuple(event for entry in root.each("event") if (event := _event(entry)) is not None)
    table.close()
    return Calendar(country, region, language, events)


def _is_known(table: TableReader, country: str, region: str | None) -> bool:
    try:
        import holidays
    except ImportError:
        why = "public holidays come from the library holidays, which is not installed"
        table.fault("country", f"[calendar] country = {country!r} cannot be looked up", why=why, fix=f"run: {INSTALL}")
        return False
    countries = holidays.list_supported_countries(include_aliases=True)
    if country not in countries:
        close = nearest(country, countries)
        what = f"country {country!r} is no country whose holidays are known"
        table.unknown("country", what, close, instead='country = "IT" (a code of ISO 3166)', code="E124")
        return False
    if region is not None and region not in (regions := _regions(country)):
        close = nearest(region, regions)
        some = f"one of {', '.join(regions)}" if regions else "no region: delete the line"
        table.unknown("region", f"region {region!r} is none of {country}", close, instead=some, code="E124")
        return False
    public_holidays(country, region, "en", A_YEAR)  # what cannot be looked up ends here, not on a page
    return True


def _regions(country: str) -> list[str]:
    """Return the codes and other names of the regions of a country."""
    import holidays

    calendar = holidays.country_holidays(country)
    return sorted({*calendar.subdivisions, *getattr(calendar, "subdivisions_aliases", {})})


def _event(entry: TableReader) -> Event | None:
    name = entry.text("name", example='"School holidays"', required=True)
    first, last = (_day(entry, key) for key in ("from", "to"))
    entry.close()
    if name is None or first is None or last is None:
        return None
    if last < first:
        entry.fault("to", f"{entry.label} ends on {last}, before it begins on {first}", fix=f'to = "{first}" or later')
        return None
    return Event(name, first, last)


def _day(entry: TableReader, key: str) -> date | None:
    """Return a date; a missing one is noted."""
    example = '"2026-12-23"'
    value = entry.parsed(key, example=example, parse=parse_date, form=DATE)
    if value is None and key not in entry.values:
        entry.missing(key, example)
    return value
