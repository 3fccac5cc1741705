"""Instants, ISO weeks and ranges of days, as people type them."""

from __future__ import annotations

import re
from datetime import date, datetime
from zoneinfo import ZoneInfo

from vsd_analytics.errors import UsageError


def instant(text: str, *, zone: str, what: str) -> datetime:
    """Parse an ISO instant; without an offset it is in `zone`.

    Raises:
        UsageError: E101, naming the option `what`.
    """
    try:
        parsed = datetime.fromisoformat(text)
        _in_reach(parsed.date())
    except ValueError:
        raise UsageError(
            f"{what}: {text!r} is not a date and time", fix=f"{what} 2026-11-11T12:00 or with an offset, …T12:00+01:00"
        ) from None
    return parsed if parsed.tzinfo is not None else parsed.replace(tzinfo=ZoneInfo(zone))


_YEARS = range(1900, 2200)  # weeks before and after, and their instants in any zone, exist as well


def _in_reach(day: date) -> date:
    if day.year not in _YEARS:
        raise ValueError(f"{day} lies outside {_YEARS.start} to {_YEARS.stop - 1}")
    return day


def parse_week(text: str, *, last: date) -> date:
    """Return the Monday of an ISO week.

    Args:
        text: `2026-W46`, `last` (the last whole week of the stored data or clock), `last-2`.
        last: Monday that `last` means.

    Raises:
        UsageError: E101.
    """
    from datetime import timedelta

    try:
        if match := re.fullmatch(r"last(?:-(\d{1,4}))?", text):
            return _in_reach(last - timedelta(weeks=int(match[1] or 0)))
        if re.fullmatch(r"\d{4}-W\d{2}", text):
            return _in_reach(date.fromisoformat(f"{text}-1"))
    except (ValueError, OverflowError):
        pass
    raise UsageError(
        f"{text!r} is not a week",
        why="weeks are ISO weeks, Monday to Sunday",
        fix="--week 2026-W46, or last, or last-2",
        in_python='"2026-W46", "last" or "last-2"',
    )


def day_start_ms(day: date, zone: ZoneInfo) -> int:
    """Return the instant at which a local day begins, UTC milliseconds."""
    return round(datetime(day.year, day.month, day.day, tzinfo=zone).timestamp() * 1000)


def parse_range(text: str) -> tuple[date, date]:
    """Return first and last local day of `2026-11-09..2026-11-15`, `2026-W46` or `2026-11-09`.

    Raises:
        UsageError: E101.
    """
    from datetime import timedelta

    try:
        if re.fullmatch(r"\d{4}-W\d{2}", text):
            monday = _in_reach(date.fromisoformat(f"{text}-1"))
            return monday, monday + timedelta(days=6)
        first, _, last = text.partition("..")
        days = _in_reach(date.fromisoformat(first)), _in_reach(date.fromisoformat(last or first))
    except ValueError:
        days = None
    if days is None or days[0] > days[1]:
        raise UsageError(
            f"{text!r} is not a range of days",
            fix="2026-11-09..2026-11-15, 2026-W46 or 2026-11-09",
            in_python='"2026-11-09..2026-11-15", "2026-W46" or "2026-11-09"',
        )
    return days
