"""Which raw records a project stores when a report is made, for the report's sentence on privacy."""
# ruff: noqa: RUF009  (`_f` only wraps dataclasses.field)

from __future__ import annotations

from dataclasses import dataclass
from datetime import date, timedelta

from vsd_analytics.figures.week.model_estimate import described as _f
from vsd_analytics.figures.week.model_estimate import optional as _o
from vsd_analytics.site.model import Site
from vsd_analytics.store.layout import date_of_hour
from vsd_analytics.store.seals import FOLDER, Seals
from vsd_analytics.store.store import Store


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRecords:
    """The raw records of a project: positions of people, second by second."""

    first_day: date | None = _o("First UTC day with raw records; None: all were purged.")
    n_overdue_days: int = _f("UTC days with raw records that are older than `retention_days`.", "days", default=0)
    purged_before: date | None = _o("Raw records before this UTC day were purged; None: none were.")
    purged_on: date | None = _o("UTC date of the last purge by age; None: there was none.")
    has_pseudonyms: bool = _f("True: track ids are replaced, by others every day.", default=True)


def stored_records(site: Site, *, at: date) -> StoredRecords:
    """Return which raw records a project stores.

    Args:
        site: The project.
        at: Day from which `retention_days` are counted back.

    Raises:
        StoreError: E313, a seal is damaged.
    """
    store = Store(site.root / "store", site_id=site.site_id)
    days = [date_of_hour(day * 24) for day in sorted(store.days())]
    oldest = at - timedelta(days=site.settings.retention_days)
    # sealed hours of a day that is not whole belong to a purge of the day before
    whole = [s for s in Seals(site.root / FOLDER, site_id=site.site_id).seals(None, None) if s.is_whole]
    last = max(whole, key=lambda seal: seal.day, default=None)
    return StoredRecords(
        first_day=days[0] if days else None,
        n_overdue_days=sum(day < oldest for day in days),
        purged_before=None if last is None else date_of_hour((last.day + 1) * 24),
        purged_on=None if last is None else date.fromisoformat(max(s.sealed_on for s in whole)),
        has_pseudonyms=bool(site.settings.pseudonyms),
    )
