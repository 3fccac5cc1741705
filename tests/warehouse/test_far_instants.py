"""A camera whose clock fell back by decades: the years between take no time and no files, and are never zero."""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path

import pytest
from warehouse.small_projects import HOUR, Person, at, beats, make_site, put

from vsd_analytics.site.model import Site
from vsd_analytics.store.layout import segment_paths
from vsd_analytics.store.spans import spans_of
from vsd_analytics.store.stretches import FAR_DAYS, far_off
from vsd_analytics.warehouse.day_files import NEAR_DAYS
from vsd_analytics.warehouse.stored_days import Extent, stored_extent, stored_stretches
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.warehouse.week_files import DAYS
from vsd_analytics.warehouse.week_files import FOLDER as WEEKS

OLD, NEW = date(1990, 1, 1), date(2026, 11, 9)
DAY = 24 * HOUR


@pytest.fixture
def site(tmp_path: Path) -> Site:
    """Return a site with a minute of 1990 and a minute of two days of 2026."""
    site = make_site(tmp_path / "shop")
    starts = [at(f"{day} 08:00") for day in (OLD, NEW, date(2026, 11, 10))]
    for t in starts:
        put(site, [*(Person(t + s * 1000, "a", 0, 0) for s in range(60)), *beats(t, t + 60_000, every=1000)])
    return site


def test_a_fold_looks_at_days_with_records_and_at_no_day_between(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    put(site, [Person(at("1990-01-01"), "a", 0, 0), Person(at("2026-11-09"), "a", 0, 0)], fold=False)
    spans = list(spans_of(segment_paths(site.root / "store", "observations"), stored_days=set()))
    assert [span.first_hour // 24 for span in spans] == [7305, 20766]


def test_everything_stored_has_no_calendar_for_decades_without_a_record(site: Site) -> None:
    found = stored_extent(site)
    assert found == Extent(OLD, date(2026, 11, 10))
    with Warehouse(site, found.first_day, found.last_day, spare_days=0) as warehouse:
        dates = warehouse.rows("select distinct local_date as d from hours order by 1")
        outages = warehouse.rows("select started_ms, ended_ms from outages")
        (note,) = warehouse.left_out()
    assert [row["d"] for row in dates] == [OLD, NEW, date(2026, 11, 10)]
    assert all(row["ended_ms"] - row["started_ms"] < 2 * DAY for row in outages)
    assert "13,460 days between 1990-01-01 and 2026-11-09" in note


def test_a_range_of_decades_has_weeks_around_records_and_writes_those_near_them_only(site: Site) -> None:
    with Warehouse(site, OLD, date(2026, 11, 20)) as warehouse:
        hours = warehouse.rows("select local_date as d, n_violations, state from hours")
        warehouse.materialise("episodes", "camera_hours")
    assert len({row["d"] for row in hours}) < 3 * FAR_DAYS
    empty = [row for row in hours if row["d"] == date(2026, 11, 2)]
    assert len(empty) == 24
    assert all(row["n_violations"] is None and row["state"] == "no_data" for row in empty)  # missing is not zero
    stored = (OLD, NEW, date(2026, 11, 10))
    files = (site.root / "facts" / WEEKS).rglob("*.parquet")
    mondays = {date.fromisoformat(path.parent.name.removeprefix("date=")) for path in files}
    assert mondays >= {day - timedelta(days=day.weekday()) for day in stored}
    assert all(min(abs((day - s).days) for s in stored) < NEAR_DAYS + DAYS for day in mondays)


def test_a_day_without_facts_has_the_rows_it_has_without_files(site: Site) -> None:
    rows = []
    for uses_days in (True, True, False):
        with Warehouse(site, date(2026, 11, 1), date(2026, 11, 16), uses_days=uses_days) as warehouse:
            rows.append(warehouse.rows("select * from camera_hours"))
    assert rows[0] == rows[1] == rows[2]


def test_a_year_without_records_is_no_gap_to_leave_out(tmp_path: Path) -> None:
    site = make_site(tmp_path)
    first = at("2025-11-09 08:00")
    put(site, [Person(first, "a", 0, 0), Person(first + FAR_DAYS * DAY, "a", 0, 0)])
    assert len(stored_stretches(site)) == 1
    with Warehouse(site, date(2025, 11, 9), date(2026, 11, 10), spare_days=0) as warehouse:
        assert warehouse.rows("select count(distinct local_date)::bigint as n from calendar") == [{"n": FAR_DAYS + 1}]


def test_a_week_knows_the_stretch_it_lies_in(site: Site) -> None:
    assert stored_extent(site, near=date(2026, 11, 30)) == Extent(NEW, date(2026, 11, 10))
    assert stored_extent(site, near=date(1991, 1, 1)) == Extent(OLD, OLD)


def test_the_main_stretch_is_that_with_most_days_and_of_equal_ones_the_last() -> None:
    assert far_off([7305, 20766, 20767]) == [[7305]]
    assert far_off([7305, 20766]) == [[7305]]
    assert far_off([20766, 20767, 20767 + FAR_DAYS + 1]) == [[20767 + FAR_DAYS + 1]]
    assert far_off([]) == []
