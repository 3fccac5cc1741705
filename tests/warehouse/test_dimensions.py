"""The small relations every query may join."""

from __future__ import annotations

from dataclasses import replace
from datetime import date, datetime, timedelta
from pathlib import Path

import pytest
from warehouse.small_projects import T0, Person, make_site, open_days, put

from vsd_analytics.site.model import Area, Calibration, Camera
from vsd_analytics.warehouse.dimensions import area_cells, bucket_quarters, calendar, is_open, site_days
from vsd_analytics.warehouse.input_fingerprint import SiteInputs

ROOT = Path()
DAY = timedelta(days=1)
HALF_PAST = tuple(((8 * 60 + 30, 20 * 60),) for _ in range(7))


@pytest.mark.parametrize(
    ("zone", "quarters"),
    [
        ("UTC", 4),
        ("Europe/Rome", 4),
        ("Asia/Tokyo", 4),
        ("Asia/Kathmandu", 1),
        ("Asia/Kolkata", 1),
        ("Australia/Lord_Howe", 1),
        ("America/Caracas", 1),  # half an hour off from 2007 to 2016
    ],
)
def test_buckets_are_hours_where_local_hours_start_on_utc_hours(zone: str, quarters: int) -> None:
    assert bucket_quarters(make_site(ROOT, timezone=zone)) == quarters


def test_buckets_are_quarters_where_doors_open_at_half_past() -> None:
    assert bucket_quarters(make_site(ROOT, opening=HALF_PAST)) == 1


def test_cells_of_an_opening_at_half_past_are_counted_in_opening_time(tmp_path: Path) -> None:
    site = replace(
        make_site(tmp_path, opening=HALF_PAST),
        areas=(Area("all", "All", "ground", ((-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0))),),
    )
    put(site, [Person(T0 + minutes * 60_000, "a", 0, 0) for minutes in (10, 29, 30, 50)])
    with open_days(site) as warehouse:
        areas = warehouse.rows("select area_id, exposure_open_s from area_hours")
        hours = warehouse.rows("select open_s, person_records from hours where local_hour = 8")
    assert areas == [{"area_id": "all", "exposure_open_s": 2.0}]
    assert hours == [{"open_s": 1800, "person_records": 4}]


@pytest.mark.parametrize(
    ("day", "n_quarters"),
    [("2026-03-29", 92), ("2026-10-25", 100), ("2026-11-09", 96)],
    ids=["spring", "autumn", "plain"],
)
def test_a_day_has_92_96_or_100_quarters(day: str, n_quarters: int) -> None:
    rows = calendar(make_site(ROOT, timezone="Europe/Rome"), date.fromisoformat(day), date.fromisoformat(day))
    assert rows.num_rows == n_quarters
    assert set(rows["local_date"].to_pylist()) == {date.fromisoformat(day)}


@pytest.mark.parametrize(
    ("zone", "first", "last"),
    [
        ("Europe/Rome", "2026-03-27", "2026-04-01"),
        ("Europe/Rome", "2026-10-25", "2026-10-25"),
        ("Europe/Rome", "2026-10-26", "2027-02-01"),
        ("America/Havana", "2026-10-30", "2026-11-03"),  # set back at 01:00
        ("America/Sao_Paulo", "2018-11-01", "2019-02-20"),  # no midnight on 4 November; 23:00 twice on 16 February
        ("America/St_Johns", "2006-10-27", "2006-10-31"),  # set back at 00:01
        ("Australia/Lord_Howe", "2026-04-01", "2026-10-08"),  # by half an hour
        ("Asia/Kathmandu", "2026-01-01", "2026-01-03"),
        ("Pacific/Apia", "2011-12-28", "2012-01-02"),  # 30 December did not happen
        ("Africa/Casablanca", "2026-02-10", "2026-03-30"),
        ("UTC", "1969-12-30", "1970-01-03"),
    ],
)
def test_a_calendar_is_what_the_clocks_of_the_zone_show(zone: str, first: str, last: str) -> None:
    site = replace(
        make_site(ROOT, timezone=zone, opening=(*HALF_PAST[:6], ())),
        day_starts_min=4 * 60,
        closed=frozenset({date.fromisoformat(last)}),
    )
    days = date.fromisoformat(first), date.fromisoformat(last)
    shown, hour_start_ms, hour = [], 0, None
    for row in calendar(site, *days).to_pylist():
        local = datetime.fromtimestamp(row["quarter"] * 900, tz=site.zone)
        if hour != (local.date(), local.hour, local.fold):
            hour, hour_start_ms = (local.date(), local.hour, local.fold), row["quarter"] * 900_000
        offset = local.utcoffset()
        assert offset is not None
        expected = {
            "quarter": row["quarter"],
            "local_date": local.date(),
            "local_hour": local.hour,
            "fold": local.fold,
            "weekday": local.isoweekday(),
            "hour_start_ms": hour_start_ms,
            "offset_min": offset // timedelta(minutes=1),
            "is_open": is_open(site, local.date(), 60 * local.hour + local.minute),
        }
        assert row == expected
        shown.append(row["quarter"])
    ends = [
        round(datetime(d.year, d.month, d.day, tzinfo=site.zone).timestamp()) // 900 for d in (days[0], days[1] + DAY)
    ]
    assert shown == list(range(*ends))
    of_day = {row["quarter"]: row["site_day"] for row in site_days(site, *days).to_pylist()}
    for quarter in range(ends[0] - 96, ends[1] + 192):
        local = datetime.fromtimestamp(quarter * 900, tz=site.zone).replace(tzinfo=None) - timedelta(hours=4)
        is_in = days[0] - DAY <= local.date() <= days[1]
        assert of_day.get(quarter) == (local.date() if is_in else None)


def test_no_days_have_an_empty_calendar() -> None:
    site, day = make_site(ROOT, timezone="Europe/Rome"), date(2026, 11, 9)
    empty, whole = calendar(site, day, day - DAY), calendar(site, day, day)
    assert (empty.num_rows, empty.schema) == (0, whole.schema)


def test_a_cell_in_two_areas_belongs_to_the_first(tmp_path: Path) -> None:
    square = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    wide = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0))
    site = replace(make_site(tmp_path), areas=(Area("a", "A", "ground", square), Area("b", "B", "ground", wide)))
    rows = area_cells(site).to_pylist()
    assert len(rows) == len({(r["cx"], r["cy"]) for r in rows}) == 32
    assert [sum(r["area_id"] == a for r in rows) for a in "ab"] == [16, 16]


def test_what_decides_the_ground_side_of_a_homography_is_part_of_the_digest() -> None:
    """The picture's size tells which side of the horizon is floor: a change of it changes positions."""
    tilted = Calibration(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -0.01, 1.0)), None, "0" * 8)
    camera = Camera("cam", "Cam", "ground", calibrations=(tilted,), picture_px=(640, 90))
    high = replace(camera, picture_px=(640, 480))
    sites = [make_site(ROOT, cameras=[c]) for c in (camera, high)]
    assert len({SiteInputs(site).of_hour(0, present={"cam"})["calibration"] for site in sites}) == 2


@pytest.mark.parametrize("end", [None, date(2026, 11, 10)])
def test_hashes_of_an_hour_do_not_depend_on_the_hours_asked_before(end: date | None) -> None:
    """A camera that is taken down gives its floor to another one: hours after it have other owners."""
    view = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
    cameras = [Camera("a", "", "ground", view=view), Camera("b", "", "ground", view=view, end_day=end)]
    hours = [T0 // 3_600_000 + 24 * days for days in (-3, 3)]
    asked_alone = [SiteInputs(make_site(ROOT, cameras=cameras)).of_hour(hour, present={"a"}) for hour in hours]
    one = SiteInputs(make_site(ROOT, cameras=cameras))
    assert [one.of_hour(hour, present={"a"}) for hour in hours] == asked_alone
    assert (asked_alone[0]["views"] == asked_alone[1]["views"]) is (end is None)
