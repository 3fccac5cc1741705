"""A change of the log and the weeks around it: whole weeks before and after, equally many, a few days left out."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final

from vsd_analytics.answer import Reason
from vsd_analytics.config.change_log import read_log
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.compare import Days
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.site.calendar import Event
from vsd_analytics.site.model import Area, LogEntry, Site
from vsd_analytics.warehouse.stored_days import stored_extent
from vsd_analytics.warehouse.warehouse import Warehouse

WEEKS: Final = 4
"""Whole weeks compared on either side."""
REFERENCE_WEEKS: Final = 12
"""Weeks before a change that tell how weeks differ and where the area was heading, at most."""
WATCHED_WEEKS: Final = 26
"""Weeks after a change over which its running verdict is read, at most."""
EVENT_SHARE: Final = 0.25
"""An event matters to a change when it covers this much more of one side: a week of four."""
DAY: Final = timedelta(days=1)


@dataclass(frozen=True, slots=True)
class Windows:
    """The days compared.

    Attributes:
        before, after: First and last local day of each; whole weeks, equally many.
        n_weeks: Weeks in each.
        trend: First and last day of the weeks before the change that tell how weeks differ: up to twelve, after the
            latest earlier entry of the area, and `before` at least.
        left_out: First and last day left out around the change; None when none is.
        watched: First and last day of the weeks since the change: up to 26, before the next entry of the area, and
            `after` at least.
    """

    before: Days
    after: Days
    n_weeks: int
    trend: Days
    left_out: Days | None
    watched: Days


def days_needed(site: Site, number: int, *, weeks: int = WEEKS) -> Days:
    """Return the local days a warehouse must hold to look at a log entry.

    Raises:
        UsageError: E101, the log has no such entry.
    """
    day = local_day(site, log_entry(site, number))
    n_out = int(site.settings.washout_days) * DAY
    first, last = day - max(weeks, REFERENCE_WEEKS) * WEEK - n_out, day + max(weeks, WATCHED_WEEKS) * WEEK + n_out
    return days_stored(site, day, first, last)


def days_stored(site: Site, day: date, first: date, last: date) -> Days:
    """Return the days that records can fill, so that page, planner and command compare the same weeks."""
    extent = stored_extent(site, near=day)
    if extent is None:
        return first, last
    return max(first, min(day, extent.first_day)), min(last, max(day, extent.last_day))


def log_entry(site: Site, number: int) -> LogEntry:
    """Return an entry of the change log by its place in it, from 1; UsageError E101 when there is none."""
    entries = read_log(site)
    if not 1 <= number <= len(entries):
        raise UsageError(
            f"the change log has no entry {number}",
            why=f"it has {len(entries)}" if entries else "it is empty",
            fix="vsd log list" if entries else 'vsd log add "what was moved" --at 2026-11-11T12:00 --area ID',
            in_python="site.changes lists them, by number",
        )
    return entries[number - 1]


def windows_of(
    warehouse: Warehouse, entry: LogEntry, *, area_id: str, weeks: int
) -> tuple[Windows | None, Reason | None]:
    """Return whole weeks on both sides, as many as are loaded and equally many, or why there are none.

    Args:
        warehouse: Opened over the days that may be used.
        entry: The change.
        area_id: The area looked at.
        weeks: Whole weeks compared on either side, at most.
    """
    site = warehouse.site
    n_out = int(site.settings.washout_days)
    first, last = days_stored(site, local_day(site, entry), warehouse.first, warehouse.last)
    end_before, start_after = left_out_around(site, entry)
    first_out = end_before + DAY
    n_before, n_after = ((end_before - first).days + 1) // 7, ((last - start_after).days + 1) // 7
    n = min(n_before, n_after, weeks)
    if n < 1:
        side, days = ("before", end_before - first) if n_before < 1 else ("after", last - start_after)
        why = Reason(f"logged_change.week_{side}", days=max(0, days.days + 1))
        return None, Reason("logged_change.washout", reason=why, days=n_out) if n_out else why
    # an entry for the whole site moves the comparison areas as well: it is a caution, and ends no window
    own = [local_day(site, e) for e in read_log(site) if e != entry and e.area_id == area_id]
    earlier, later = max((d for d in own if d <= end_before), default=None), [d for d in own if d >= start_after]
    n_trend = min(n_before, max(weeks, REFERENCE_WEEKS))
    if earlier is not None:
        n_trend = min(n_trend, (end_before - earlier).days // 7)
    n_watched = min(n_after, max(weeks, WATCHED_WEEKS), (min(later, default=last + DAY) - start_after).days // 7)
    return Windows(
        before=(end_before - n * WEEK + DAY, end_before),
        after=(start_after, start_after + n * WEEK - DAY),
        n_weeks=n,
        trend=(end_before - max(n, n_trend) * WEEK + DAY, end_before),
        left_out=(first_out, start_after - DAY) if n_out else None,
        watched=(start_after, start_after + max(n, n_watched) * WEEK - DAY),
    ), None


def left_out_around(site: Site, entry: LogEntry) -> Days:
    """Return the last day before a change and the first day after it, without the days left out around it."""
    day, n_out = local_day(site, entry), int(site.settings.washout_days)
    first_out = day - (n_out - 1) // 2 * DAY if n_out else day
    return first_out - DAY, first_out + n_out * DAY


def changed_areas(site: Site, first: date, last: date) -> dict[str, date]:
    """Return the areas that entries of the log name from one day to another, and when."""
    changed: dict[str, date] = {}
    for entry in read_log(site):
        day = local_day(site, entry)
        if entry.area_id is not None and first <= day <= last:
            changed.setdefault(entry.area_id, day)
    return changed


def other_changes(site: Site, entry: LogEntry, area: Area, windows: Windows) -> list[Reason]:
    """Return what else the log says of the area in the weeks compared, as doubts."""
    return [
        Reason("logged_change.other_change", day=str(local_day(site, other)))
        for other in _others(site, entry, windows)
        if other.area_id == area.area_id
    ]


def events_beside(site: Site, windows: Windows) -> list[Reason]:
    """Return the events of the calendar that lie on one side of a change, as doubts.

    An event lies on one side where the share of days that it covers differs by more than `EVENT_SHARE` between the
    weeks compared, or between the reference and the weeks watched: an area may feel it more than others do.
    """

    def share(event: Event, days: Days) -> float:
        shared = (min(event.last, days[1]) - max(event.first, days[0])).days + 1
        return max(0, shared) / ((days[1] - days[0]).days + 1)

    pairs = ((windows.before, windows.after), (windows.trend, windows.watched))
    return [
        Reason("logged_change.event", name=event.name, first=event.first, last=event.last)
        for event in site.calendar.events
        if any(abs(share(event, one) - share(event, other)) > EVENT_SHARE for one, other in pairs)
    ]


def changes_elsewhere(site: Site, entry: LogEntry, area: Area, windows: Windows) -> list[Reason]:
    """Return what the log says of the whole site and of other areas in the weeks compared, as cautions."""
    names = {a.area_id: a.name for a in site.areas}
    cautions = []
    for other in _others(site, entry, windows):
        day = str(local_day(site, other))
        if other.area_id is None:
            cautions.append(Reason("logged_change.site_wide", day=day))
        elif other.area_id != area.area_id:
            cautions.append(
                Reason("logged_change.change_elsewhere", day=day, area=names.get(other.area_id, other.area_id))
            )
    return cautions


def _others(site: Site, entry: LogEntry, windows: Windows) -> list[LogEntry]:
    first, last = windows.before[0], windows.after[1]
    return [e for e in read_log(site) if e != entry and first <= local_day(site, e) <= last]


def local_day(site: Site, entry: LogEntry) -> date:
    """Return the local day of an entry."""
    return entry.at.astimezone(site.zone).date()
