"""Which local days have records, and for which days a range needs a calendar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from itertools import pairwise

from vsd_analytics.config.door_counts import counted_days
from vsd_analytics.schema import TABLES
from vsd_analytics.site.model import Site
from vsd_analytics.store.layout import day_folders
from vsd_analytics.store.seals import FOLDER, Seals
from vsd_analytics.store.store import Store
from vsd_analytics.store.stretches import FAR_DAYS, stretches

SPARE_DAYS = 180
"""Days that the calendar adds on either side of a stretch of records, so that the weeks in which records begin or end,
and the weeks they are compared with, are whole. Less than half of FAR_DAYS, or two stretches would overlap."""


@dataclass(frozen=True, slots=True)
class Extent:
    """Consecutive local days.

    Attributes:
        first_day, last_day: First and last of them, inclusive.
    """

    first_day: date
    last_day: date


def stored_stretches(site: Site) -> list[Extent]:
    """Return the stretches of local days with records, stored or sealed, or counts of door counters.

    Spooled records are folded first.
    """
    counted = counted_days(site)
    return _joined([*_recorded(site), *([] if counted is None else [Extent(*counted)])])


def _joined(extents: list[Extent]) -> list[Extent]:
    """Return stretches in order of time, as one where they are less than `FAR_DAYS` apart."""
    joined: list[Extent] = []
    for extent in sorted(extents, key=lambda e: e.first_day):
        if joined and (extent.first_day - joined[-1].last_day).days <= FAR_DAYS:
            joined[-1] = Extent(joined[-1].first_day, max(joined[-1].last_day, extent.last_day))
        else:
            joined.append(extent)
    return joined


def _recorded(site: Site) -> list[Extent]:
    """Return the stretches of local days with records."""
    store = Store(site.root / "store", site_id=site.site_id)
    if store.n_spooled():
        store.fold()
    seals = Seals(site.root / FOLDER, site_id=site.site_id)
    folders = {d for t in TABLES for d in day_folders(store.root, t, site.site_id)}
    extents = []
    for days in stretches(folders | set(seals.days())):
        # Only days at the ends are opened, so a year of records costs no more than a week.
        ends: list[int] = []
        for order in (days, days[::-1]):
            ends += next(filter(None, (_hours_of(store, day) for day in order)), [])
        ends += seals.hours(first_day=days[0], last_day=days[-1]) or ()
        if ends:
            extents.append(Extent(_local(site, min(ends) * 3600), _local(site, max(ends) * 3600 + 3599)))
    return extents


def _hours_of(store: Store, day: int) -> list[int]:
    return [p.hour for t in TABLES for p in store.parts(t, first_hour=day * 24, last_hour=day * 24 + 23)]


def stored_extent(site: Site, *, near: date | None = None) -> Extent | None:
    """Return the local days from the first to the last with records, or None without any.

    Args:
        site: The project.
        near: Only the stretch of records that contains this day or is nearest to it.
    """
    extents = stored_stretches(site)
    if not extents:
        return None
    if near is None:
        return Extent(extents[0].first_day, extents[-1].last_day)
    return min(extents, key=lambda e: max(e.first_day - near, near - e.last_day, timedelta()))


def has_records(site: Site, first: date, last: date) -> bool:
    """Tell whether a stretch of stored records reaches into some local days."""
    return any(e.first_day <= last and e.last_day >= first for e in stored_stretches(site))


def calendar_days(site: Site, first: date, last: date, *, spare_days: int = SPARE_DAYS) -> list[Extent]:
    """Return the parts of a range of local days for which a calendar is made: not the years between two stretches.

    A wrong clock can put one record decades away from the others; a calendar of all days between would be huge.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.
        spare_days: Days of the calendar before and after each gap.
    """
    if (last - first).days <= FAR_DAYS:
        return [Extent(first, last)]
    inside = [e for e in stored_stretches(site) if e.first_day <= last and e.last_day >= first]
    spare = timedelta(days=spare_days)
    starts = [first, *(e.first_day - spare for e in inside[1:])]
    ends = [*(e.last_day + spare for e in inside[:-1]), last]
    return [Extent(start, end) for start, end in zip(starts, ends, strict=True)]


def days_of(extents: Sequence[Extent], first: date, last: date) -> list[date]:
    """Return the days from `first` to `last`, in order, without those in a gap between two extents."""
    gaps = [(a.last_day, b.first_day) for a, b in pairwise(extents)]
    days, day = [], first
    while day <= last:
        after = next((end for start, end in gaps if start < day < end), None)
        if after is None:
            days.append(day)
        day = day + timedelta(days=1) if after is None else after
    return days


def _local(site: Site, second: int) -> date:
    return datetime.fromtimestamp(second, tz=site.zone).date()
