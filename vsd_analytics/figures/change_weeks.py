"""A change of the log and the weeks around it: whole weeks before and after, equally many, a few days left out."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

from vsd_analytics.config.change_log import read_log
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.compare import Days
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.result import Reason
from vsd_analytics.site.model import Area, LogEntry, Site
from vsd_analytics.warehouse.stored_days import stored_extent
from vsd_analytics.warehouse.warehouse import Warehouse

WEEKS: Final = 4
"""Whole weeks looked at on either side."""
DAY: Final = timedelta(days=1)


@dataclass(frozen=True, slots=True)
class Windows:
    """The days compared.

    Attributes:
        before, after: First and last local day of each; whole weeks, equally many.
        n_weeks: Weeks in each.
        trend: First and last day before the change over which the areas' trends are compared.
        left_out: First and last day left out around the change; None when none is.
    """

    before: Days
    after: Days
    n_weeks: int
    trend: Days
    left_out: Days | None


def days_needed(site: Site, number: int, *, weeks: int = WEEKS) -> Days:
    """Return the local days a warehouse must hold to look at a log entry.

    Raises:
        UsageError: E101, the log has no such entry.
    """
    day = local_day(site, log_entry(site, number))
    reach = weeks * WEEK + int(site.settings.washout_days) * DAY
    first, last = day - reach, day + reach
    extent = stored_extent(site, near=day)
    if extent is not None:
        first, last = max(first, min(day, extent.first_day)), min(last, max(day, extent.last_day))
    return first, last


def log_entry(site: Site, number: int) -> LogEntry:
    """Return an entry of the change log by its place in it, from 1; UsageError E101 when there is none."""
    entries = read_log(site)
    if not 1 <= number <= len(entries):
        raise UsageError(
            f"the change log has no entry {number}",
            why=f"it has {len(entries)}" if entries else "it is empty",
            fix="vsd log list" if entries else 'vsd log add "what was moved" --at 2026-11-11T12:00 --area ID',
        )
    return entries[number - 1]


def windows_of(warehouse: Warehouse, entry: LogEntry, *, weeks: int) -> tuple[Windows | None, Reason | None]:
    """Return whole weeks on both sides, as many as are loaded and equally many, or why there are none."""
    site, first, last = warehouse.site, warehouse.first, warehouse.last
    day, n_out = local_day(site, entry), int(site.settings.washout_days)
    first_out = day - (n_out - 1) // 2 * DAY if n_out else day
    end_before, start_after = first_out - DAY, first_out + n_out * DAY
    n_before, n_after = ((end_before - first).days + 1) // 7, ((last - start_after).days + 1) // 7
    n = min(n_before, n_after, weeks)
    if n < 1:
        side, days = ("before", end_before - first) if n_before < 1 else ("after", last - start_after)
        why = Reason(f"redesign.week_{side}", days=max(0, days.days + 1))
        return None, Reason("redesign.washout", reason=why, days=n_out) if n_out else why
    n_trend = min(n_before, max(weeks, n))
    return Windows(
        before=(end_before - n * WEEK + DAY, end_before),
        after=(start_after, start_after + n * WEEK - DAY),
        n_weeks=n,
        trend=(end_before - n_trend * WEEK + DAY, end_before),
        left_out=(first_out, start_after - DAY) if n_out else None,
    ), None


def changed_areas(site: Site, windows: Windows) -> dict[str, date]:
    """Return the areas that entries of the log name between the first day before and the last after, and when."""
    found: dict[str, date] = {}
    for entry in read_log(site):
        day = local_day(site, entry)
        if entry.area_id is not None and windows.trend[0] <= day <= windows.after[1]:
            found.setdefault(entry.area_id, day)
    return found


def other_changes(site: Site, entry: LogEntry, area: Area, windows: Windows) -> list[Reason]:
    """Return what else the log tells of the area in these weeks, as doubts."""
    return [
        Reason("redesign.other_change", day=str(local_day(site, other)))
        for other in read_log(site)
        if other != entry
        and other.area_id == area.area_id
        and windows.before[0] <= local_day(site, other) <= windows.after[1]
    ]


def local_day(site: Site, entry: LogEntry) -> date:
    """Return the local day of an entry."""
    return entry.at.astimezone(site.zone).date()
