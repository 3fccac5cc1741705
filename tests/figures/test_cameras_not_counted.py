"""Which cameras' violations cannot be counted, week by week, from what they sent of each local day."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from pathlib import Path

from warehouse.small_projects import Frame, Person, make_site, put

from vsd_analytics.figures.floor_days import NO_IDS
from vsd_analytics.figures.panels import FloorHours
from vsd_analytics.figures.periods import Period
from vsd_analytics.warehouse.warehouse import Warehouse

MONDAY = date(2026, 3, 23)
"""The clocks of Rome change on the Sunday after."""


def two_people(at: datetime, *, has_ids: bool) -> list[Person | Frame]:
    """Return a minute of two people a metre apart."""
    start = round(at.timestamp() * 1000)
    found: list[Person | Frame] = []
    for ts in range(start, start + 60_000, 1000):
        found.append(Frame(ts))
        found += [Person(ts, f"{at:%d%H}-{x}" if has_ids else None, x, 0) for x in (0, 1000)]
    return found


def test_each_week_is_judged_by_the_records_of_its_own_local_days(tmp_path: Path) -> None:
    """The first week ends at 22:00 UTC. Five minutes before it the engine sends ids, five minutes after it none."""
    site = make_site(tmp_path, timezone="Europe/Rome")
    end = datetime(2026, 3, 29, 22, tzinfo=UTC)
    put(site, two_people(end - timedelta(minutes=5), has_ids=True))
    put(site, two_people(end + timedelta(minutes=5), has_ids=False))
    with Warehouse(site, MONDAY, MONDAY + timedelta(days=13)) as warehouse:
        data = FloorHours(warehouse, floor=site.floors[0])
        weeks = [Period(data, day, day + timedelta(days=6)) for day in (MONDAY, MONDAY + timedelta(days=7))]
        assert [week.not_counted for week in weeks] == [{}, {data.ids[0]: NO_IDS}]
        both = data.records_in(MONDAY, MONDAY + timedelta(days=13))
        assert both.tolist() == [[240, 0, 120, 60]]
        assert [data.records_in(w.first, w.last).tolist() for w in weeks] == [[[120, 0, 60, 60]], [[120, 0, 60, 0]]]
