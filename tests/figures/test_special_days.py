"""Public holidays, events and changes of the clock in forecasts."""

from __future__ import annotations

from datetime import date, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.figures.change_weeks import Windows, events_beside
from vsd_analytics.figures.special_days import day_rules, notes_of_days, special_days
from vsd_analytics.site.calendar import Calendar, Event
from vsd_analytics.site.model import Site
from vsd_analytics.stats.forecast import CLOCK_DOUBT, EVENT_DOUBT, HOLIDAY_DOUBT, DayRules, forecast_week

IMMACULATE = date(2026, 12, 8)  # a Tuesday
FAIR = Event("Fair", date(2026, 12, 8), date(2026, 12, 9))
SITE = Site("shop", "Shop", "Europe/Rome", Path(), calendar=Calendar("IT", events=(FAIR,)))
OPEN = np.tile(np.repeat([0.0, 1.0, 0.0], [8, 12, 4]), 7)


def weeks(n: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Return weeks of 100 an hour, on Sundays of 40, with a little chance."""
    rng = np.random.default_rng(20261208)
    level = np.repeat([100.0] * 6 + [40.0], 24)
    return rng.poisson(level, (n, 168)).astype(float), np.tile(OPEN, (n, 1))


@given(st.integers(-6, 0))
def test_a_holiday_has_the_hours_of_the_sunday_wherever_the_week_begins(shift: int) -> None:
    first = IMMACULATE + timedelta(days=shift)
    rules = day_rules(SITE, first)
    sunday = next(k for k in range(7) if (first + timedelta(days=k)).weekday() == 6)
    like = [sunday if k == -shift else k for k in range(7)]
    assert rules.like.tolist() == like
    assert rules.doubt[-shift] == pytest.approx(np.hypot(HOLIDAY_DOUBT, EVENT_DOUBT))


def test_a_week_after_the_clocks_changed_has_wider_ranges() -> None:
    monday = date(2026, 10, 26)
    assert day_rules(SITE, monday).doubt[:6] == pytest.approx(np.full(6, CLOCK_DOUBT))
    assert day_rules(SITE, monday + timedelta(days=7)).doubt[1:] == pytest.approx(np.zeros(6))  # Sunday was All Saints


def test_a_forecast_holiday_looks_like_a_sunday_with_a_wider_range() -> None:
    n, x_h = weeks()
    plain = forecast_week(n, x_h, is_count=True, open_h=OPEN)
    rules = DayRules(np.array([0, 6, 2, 3, 4, 5, 6]), np.array([0, HOLIDAY_DOUBT, 0, 0, 0, 0, 0]))
    special = forecast_week(n, x_h, is_count=True, open_h=OPEN, days=rules)
    tuesday, sunday = slice(32, 44), slice(152, 164)
    assert special.mean[tuesday] == pytest.approx(plain.mean[sunday])
    assert (special.hi - special.lo)[tuesday].min() > (plain.hi - plain.lo)[sunday].max()
    others = np.r_[8:20, 56:68]
    assert special.hi[others] == pytest.approx(plain.hi[others])


def test_a_holiday_where_sundays_are_closed_is_not_forecast() -> None:
    n, x_h = weeks()
    x_h[:, 144:] = 0.0
    rules = DayRules(np.array([0, 6, 2, 3, 4, 5, 6]), np.zeros(7))
    special = forecast_week(n, x_h, is_count=True, open_h=OPEN, days=rules)
    assert np.isnan(special.mean[32:44]).all()
    assert not np.isnan(special.mean[8:20]).any()


def test_a_past_holiday_teaches_nothing() -> None:
    n, x_h = weeks()
    days = special_days(SITE, IMMACULATE - timedelta(days=1), n_weeks=8)
    assert np.argwhere(days.is_holiday).tolist() == [[1, 6], [7, 1]]  # All Saints, on a Sunday, and the Immaculate
    spoilt = n.copy()
    spoilt[7, 24:48] = 0.0
    learnt = [forecast_week(c, days.ordinary_h(x_h), is_count=True, open_h=OPEN) for c in (n, spoilt)]
    assert learnt[0].mean == pytest.approx(learnt[1].mean, nan_ok=True)


HOLIDAYS = [
    ("begins with the change", (date(2026, 11, 9), date(2026, 11, 22)), True),
    ("began two days before", (date(2026, 11, 7), date(2026, 11, 22)), True),
    ("ended with the change", (date(2026, 10, 26), date(2026, 11, 8)), True),
    ("covers all after and half of the reference", (date(2026, 10, 1), date(2026, 12, 20)), True),
    ("covers both sides alike", (date(2026, 8, 1), date(2026, 12, 31)), False),
    ("a few days", (date(2026, 11, 11), date(2026, 11, 13)), False),
    ("long ago", (date(2026, 9, 1), date(2026, 9, 14)), False),
]


@pytest.mark.parametrize(("name", "days", "is_doubt"), HOLIDAYS)
def test_an_event_on_one_side_of_a_logged_change_is_a_doubt(
    name: str, days: tuple[date, date], *, is_doubt: bool
) -> None:
    windows = Windows(
        before=(date(2026, 10, 12), date(2026, 11, 8)),
        after=(date(2026, 11, 9), date(2026, 12, 6)),
        n_weeks=4,
        trend=(date(2026, 8, 17), date(2026, 11, 8)),
        left_out=None,
        watched=(date(2026, 11, 9), date(2026, 12, 20)),
    )
    site = Site("shop", "Shop", "Europe/Rome", Path(), calendar=Calendar(events=(Event(name, *days),)))
    assert [doubt.code for doubt in events_beside(site, windows)] == ["logged_change.event"] * is_doubt


def test_what_the_calendar_says_of_a_week_leaves_out_days_on_which_the_site_is_closed() -> None:
    monday = IMMACULATE - timedelta(days=1)
    codes = [note.code for note in notes_of_days(SITE, monday)]
    assert codes == ["calendar.holiday", "calendar.event"]
    closed = Site("shop", "Shop", "Europe/Rome", Path(), calendar=SITE.calendar, closed=frozenset({IMMACULATE}))
    assert [note.code for note in notes_of_days(closed, monday)] == ["calendar.event"]
