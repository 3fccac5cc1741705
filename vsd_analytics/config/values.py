"""Single values of `vsd.toml`: zones, instants, dates, the start of a site day, picture sizes.

Each parser returns the value or raises ValueError with a message that can follow "[site] closed: ".
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, date, datetime, time
from typing import Any, Final
from zoneinfo import ZoneInfo

from vsd_analytics.config.opening import parse_clock
from vsd_analytics.config.reader import TableReader
from vsd_analytics.errors import nearest
from vsd_analytics.site.model import Point

LATEST_DAY_START_MIN = 12 * 60


def zone(table: TableReader, key: str, *, required: bool = False) -> str | None:
    """Return the IANA time zone a table names, noting one that does not exist with the nearest that does."""
    name = table.text(key, example='"Europe/Rome"', required=required)
    if name is None:
        return None
    if not is_zone(name):
        close = nearest_zone(name)
        note = f"did you mean {close}?" if close else None
        table.fault(
            key,
            f"there is no time zone {name!r}",
            note=note,
            fix=f'{key} = "{close or "Europe/Rome"}" (an IANA name: continent/city)',
        )
        return None
    return name


def is_zone(name: str) -> bool:
    """Tell whether `name` is an IANA time zone this machine knows."""
    try:
        ZoneInfo(name)
    except (KeyError, ValueError, OSError):
        return False
    return True


def nearest_zone(name: str) -> str | None:
    """Return the IANA zone whose name, or whose city, is closest to `name`."""
    from zoneinfo import available_timezones

    zones = {each.lower(): each for each in sorted(available_timezones())}
    cities = {low.rpartition("/")[2].replace("_", " "): each for low, each in zones.items()}
    whole, city = nearest(name, zones), nearest(name.replace("_", " "), cities)
    return zones[whole] if whole else cities[city] if city else None


def parse_instant(value: Any, *, timezone: str) -> datetime:
    """Return the UTC instant of a date, a date and time, or their ISO text.

    Args:
        value: What TOML or the command line gave; a date is its midnight.
        timezone: IANA zone of times without an offset.

    Raises:
        ValueError: None of these.
    """
    if isinstance(value, str):
        try:
            value = datetime.fromisoformat(value.strip())
        except ValueError:
            raise ValueError(f"{value!r} is no date and time") from None
    if not isinstance(value, date):
        raise ValueError(f"{value!r} is no date and time")
    if not isinstance(value, datetime):
        value = datetime.combine(value, time())
    if value.tzinfo is None:
        value = value.replace(tzinfo=ZoneInfo(timezone))
    try:
        instant: datetime = value.astimezone(UTC)
    except OverflowError:
        raise ValueError(f"{value} is out of range") from None
    return instant


def parse_dates(value: Any) -> frozenset[date]:
    """Return the days of a list of ISO texts or TOML dates."""
    if not isinstance(value, list):
        raise ValueError("must be a list of dates")
    return frozenset(parse_date(each) for each in value)


def parse_date(value: Any) -> date:
    """Return the day of an ISO text or a TOML date."""
    if isinstance(value, date) and not isinstance(value, datetime):
        return value
    try:
        return date.fromisoformat(value)
    except (TypeError, ValueError):
        raise ValueError(f"{value!r} is no date such as 2026-12-25") from None


def parse_day_start(value: Any) -> int:
    """Return minutes after local midnight at which a site day starts: a quarter hour before noon."""
    minutes = parse_clock(value.strftime("%H:%M") if isinstance(value, time) else str(value))
    if minutes >= LATEST_DAY_START_MIN:
        raise ValueError("a site day must start between 00:00 and 11:45")
    return minutes


def parse_empty_hour(value: Any) -> int:
    """Return minutes after local midnight at which a floor is empty: a quarter-hour from 00:00 to 23:45."""
    return parse_clock(value.strftime("%H:%M") if isinstance(value, time) else str(value)) % (24 * 60)


def parse_picture_px(value: Any) -> tuple[int, int]:
    """Return width and height in pixels."""
    match value:
        case [int(width), int(height)] if 0 < width <= 100_000 and 0 < height <= 100_000:
            return width, height
    raise ValueError("must be width and height in whole pixels")


BOX_MAX_M2: Final = 250_000.0
"""Polygons are counted in cells of 0.25 m: beyond, the unit is wrong, or memory ends."""


def is_simple(table: TableReader, key: str, points: Sequence[Point]) -> bool:
    """Tell whether corners make a simple polygon with an area; note it (E128) where they do not."""
    from shapely import Polygon
    from shapely.validation import explain_validity

    shape = Polygon(points)
    if shape.is_valid and shape.area > 0:
        return True
    table.fault(
        key,
        f"{table.label} {key} crosses or touches itself, or has no area",
        code="E128",
        why=explain_validity(shape).replace("[", " at (").replace("]", ")").replace("Valid Geometry", "no area"),
        fix="list the corners once, in the order in which you would walk around it",
    )
    return False
