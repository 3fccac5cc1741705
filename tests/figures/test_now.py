"""What the live page tells: bands of a quarter-hour beside earlier days, queues, silent cameras, and a fair record."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from figures.planted_hours import MONDAY, of, planted, site_of
from figures.planted_marts import plant
from figures.test_queues import QUEUE, TILL
from hypothesis import given
from hypothesis import strategies as st
from privacy.live_pages import people_told
from warehouse.small_projects import T0, Person, beats, make_site, open_days, put

from vsd_analytics.figures.now import Now, UsualDay, now, relations, usual_day
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.share.now import Band, beside_limit, beside_usual, in_steps
from vsd_analytics.site.calendar import Calendar
from vsd_analytics.site.model import Site

SATURDAY = MONDAY + timedelta(days=5)
N_WEEKS = 24
MINUTE = 60_000
QUARTER = 15 * MINUTE
Change = Callable[[pd.DataFrame], None]


def people(hours: pd.DataFrame, day: date, hour: int, n: float) -> None:
    """Let so many people be in view of the first camera in an hour."""
    hours.loc[of(hours, day=day, hour=hour, camera="cam-1"), "exposure_open_s"] = 3600.0 * n


def usual(site: Site, day: date = SATURDAY, *, change: Change | None = None) -> UsualDay:
    """Return what 24 weeks of six people in each hour say of a day; each quarter-hour is like its hour."""
    monday = day - timedelta(days=day.weekday())
    made: list[pd.DataFrame] = []

    def noted(hours: pd.DataFrame) -> None:
        if change is not None:
            change(hours)
        made.append(hours.copy())

    with planted(site, noted, n_weeks=N_WEEKS, monday=monday) as warehouse:
        hours = made[0].loc[made[0]["recorded_open_s"] > 0].loc[lambda rows: rows.index.repeat(4)]
        part = hours.groupby(level=0).cumcount()
        is_open = hours["recorded_open_s"] / 900 > part
        quarters = pd.DataFrame(
            {
                "camera_id": hours["camera_id"],
                "quarter": hours["hour_start_ms"] // QUARTER + part,
                "recorded_ms": 900_000,
                "exposure_ms": (hours["exposure_open_s"] * 900_000 / hours["recorded_open_s"]).round().astype("int64"),
            }
        )[is_open]
        plant(warehouse, "coverage", quarters.drop(columns="exposure_ms"))
        plant(warehouse, "exposure", quarters.drop(columns="recorded_ms"))
        return usual_day(warehouse, day, floor_id="ground")


@given(
    n=st.floats(0, 60), lo=st.floats(0, 40), width=st.floats(0, 20), below=st.sampled_from([0, 2, 5, 9]),
    limit=st.floats(0.5, 30),
)  # fmt: skip
def test_every_band_is_as_wide_as_the_mask_and_holds_the_number(
    n: float, lo: float, width: float, below: int, limit: float
) -> None:
    mask = Mask(below)
    limited = beside_limit(n, limit, mask)
    assert limited.hi is not None
    for low, high in (
        people_told(beside_usual(n, lo, lo + width, mask)),
        people_told(in_steps(n, mask)),
        (limited.hi, np.inf) if limited.crowd == "above" else (0.0, limited.hi),
    ):
        assert low <= n <= high
        assert high - low >= below
        assert low == 0 or low >= below


def test_what_is_usual_comes_from_days_before_alone(tmp_path: Path) -> None:
    def later(hours: pd.DataFrame) -> None:
        for hour in (9, 10, 11):
            people(hours, SATURDAY, hour, 50 + hour)

    site = site_of(tmp_path)
    before, after = usual(site), usual(site, change=later)
    for a, b in zip(before.quarters, after.quarters, strict=True):
        np.testing.assert_array_equal(a.lo, b.lo)
    assert before.fullest == after.fullest
    assert before.reason is None
    assert [float(q.mean[24 + 9]) for q in before.quarters] == pytest.approx([6.0] * 4)


def test_a_record_counts_the_days_on_which_the_hour_named_was_the_fullest(tmp_path: Path) -> None:
    """At ten are ten people, at eleven nine; on two of the last ten Saturdays eleven was fuller."""

    def change(hours: pd.DataFrame) -> None:
        for week in range(N_WEEKS):
            day = SATURDAY - timedelta(weeks=week)
            people(hours, day, 10, 10)
            people(hours, day, 11, 12 if week in (3, 7) else 9)

    found = usual(site_of(tmp_path), change=change).fullest[9]
    assert found is not None
    assert (found.hour, found.n_right, found.n_days) == (10, 8, 10)


def test_each_day_of_the_record_is_forecast_from_the_days_before_it(tmp_path: Path) -> None:
    """Five Saturdays ago the fullest hour changed for good: forecasts learn of it only by the weeks that follow."""

    def change(hours: pd.DataFrame) -> None:
        for week in range(N_WEEKS):
            day = SATURDAY - timedelta(weeks=week)
            people(hours, day, 9 if week <= 5 else 11, 30)

    found = usual(site_of(tmp_path), change=change).fullest[9]
    assert found is not None
    assert found.hour == 9
    assert found.n_days == 10
    assert 5 <= found.n_right <= 6  # right before the change, and once the median has seen it; wrong in between


def test_a_day_that_lacks_an_hour_and_a_public_holiday_are_no_part_of_a_record(tmp_path: Path) -> None:
    def change(hours: pd.DataFrame) -> None:
        for week in range(N_WEEKS):
            people(hours, SATURDAY - timedelta(weeks=week), 10, 10)
        lost = of(hours, day=SATURDAY - timedelta(weeks=2), hour=11)
        hours.loc[lost, ["recorded_s", "recorded_open_s"]] = 0.0

    feast = SATURDAY - timedelta(weeks=4)
    with mock.patch.object(Calendar, "holiday", lambda _, day: "Feast" if day == feast else None):
        found = usual(site_of(tmp_path), change=change).fullest[9]
    assert found is not None
    assert (found.n_right, found.n_days) == (8, 8)


def test_no_hour_is_named_where_only_one_is_left(tmp_path: Path) -> None:
    found = usual(site_of(tmp_path)).fullest
    assert found[10] is not None
    assert found[11] is None


# ---- now, from records ----


def shop(root: Path, **of_queue: object) -> Site:
    return replace(make_site(root), areas=(replace(QUEUE, **of_queue), TILL))  # type: ignore[arg-type]


def crowd(n: int, first: int, after: int, *, y: int = 8000) -> list[Person]:
    """Return people who stand two metres apart, a record every two seconds."""
    return [Person(t, f"{y}-{k}", 500 + 400 * k, y) for t in range(first, after, 1000) for k in range(n)]


@contextmanager
def clock(site: Site) -> Iterator[Callable[[int], Now]]:
    """Return a function from a UTC instant to what the page knows then."""
    with open_days(site, "2026-09-01", "2026-11-09", relations=None) as before:
        day = usual_day(before, date(2026, 11, 9), floor_id="ground")
    with open_days(site, relations=relations(site)) as warehouse:
        yield lambda ms: now(warehouse, day, datetime.fromtimestamp(ms / 1000, tz=UTC).astimezone(site.zone))


def test_people_of_the_last_quarter_hour_are_told_in_steps_where_nothing_is_usual(tmp_path: Path) -> None:
    site = shop(tmp_path)
    put(site, [*beats(T0, T0 + 2 * QUARTER), *crowd(11, T0, T0 + QUARTER), *crowd(3, T0 + QUARTER, T0 + 2 * QUARTER)])
    with clock(site) as at:
        first, second = at(T0 + QUARTER + MINUTE), at(T0 + 2 * QUARTER + MINUTE)
    assert first.people == Band(None, 10, None, None, 5)
    assert second.people == Band("few", None, None, None, 5)
    assert first.reason is not None
    assert first.reason.code == "forecast.weeks"


def test_the_page_tells_the_same_in_every_minute_of_a_quarter_hour(tmp_path: Path) -> None:
    """A quarter-hour that goes on says nothing: not when somebody comes, nor how many."""
    site = shop(tmp_path)
    put(site, [*beats(T0, T0 + 2 * QUARTER), *crowd(11, T0, T0 + QUARTER), *crowd(30, T0 + QUARTER, T0 + 2 * QUARTER)])
    with clock(site) as at:
        pages = {replace(at(T0 + QUARTER + k * MINUTE), at=datetime(2026, 11, 9, tzinfo=UTC)) for k in range(1, 16)}
    assert len(pages) == 1


@pytest.mark.parametrize(
    ("n", "queue_limit", "band"),
    [
        (3, None, Band("few", None, None, None, 5)),
        (8, None, Band(None, 10, None, None, 5)),
        (8, 6.0, Band("above", None, None, 6.0, 5)),
        (4, 2.0, Band("within", None, None, 5.0, 5)),
    ],
)
def test_a_queue_is_told_beside_its_limit_or_in_steps(
    n: int, queue_limit: float | None, band: Band, tmp_path: Path
) -> None:
    site = shop(tmp_path, queue_limit=queue_limit)
    put(site, [*beats(T0, T0 + QUARTER), *crowd(n, T0, T0 + QUARTER, y=2000)])
    with clock(site) as at:
        [queue] = at(T0 + QUARTER + MINUTE).queues
    assert queue.band == band


def test_a_camera_that_stopped_is_silent_and_what_it_saw_is_not_zero(tmp_path: Path) -> None:
    site = shop(tmp_path)
    put(site, [*beats(T0, T0 + QUARTER), *crowd(11, T0, T0 + QUARTER)])
    with clock(site) as at:
        found = at(T0 + 2 * QUARTER + MINUTE)
    assert (found.people, [q.band for q in found.queues]) == (None, [None])
    assert [(c.camera_id, c.last) for c in found.silent] == [("cam", found.data_until)]
    assert found.data_until == datetime.fromtimestamp((T0 + QUARTER) / 1000, tz=UTC)


def test_while_the_site_is_closed_nothing_is_told_but_when_it_opens(tmp_path: Path) -> None:
    site = replace(shop(tmp_path), opening=tuple(((540, 720),) for _ in range(7)))
    put(site, [*beats(T0, T0 + 4 * QUARTER), *crowd(11, T0, T0 + 4 * QUARTER)])
    with clock(site) as at:
        midnight = round(datetime(2026, 11, 9, tzinfo=site.zone).timestamp() * 1000)
        early, opened = at(midnight + 6 * 3_600_000), at(midnight + 9 * 3_600_000 + 5 * MINUTE)
    assert (early.is_open, early.was_open, early.people, early.queues, early.silent) == (False, False, None, (), ())
    assert early.opens == datetime(2026, 11, 9, 9, tzinfo=site.zone)
    assert (opened.is_open, opened.was_open, opened.opens) == (True, False, None)
