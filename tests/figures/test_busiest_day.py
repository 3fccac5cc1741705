"""The busiest day leads in the hours it shares with every other day; being open at busy hours only is not enough."""

from __future__ import annotations

from datetime import date, timedelta

from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.figures.week.timetable import busiest_day

MONDAY = date(2026, 11, 9)
WEEK = [MONDAY + timedelta(days=d) for d in range(7)]
PROFILE = {hour: (10.0 if hour in (11, 12, 13) else 2.0) for hour in range(8, 20)}


def test_a_sunday_open_at_the_busy_hours_only_is_not_the_busiest_day() -> None:
    known = {(day, hour): n for day in WEEK[:6] for hour, n in PROFILE.items()}
    known |= {(WEEK[2], hour): n + 1.0 for hour, n in PROFILE.items()}
    known |= {(WEEK[6], hour): PROFILE[hour] for hour in (11, 12, 13)}
    assert busiest_day(known) == WEEK[2]


def test_no_day_is_busiest_when_two_are_alike() -> None:
    assert busiest_day({(day, hour): n for day in WEEK[:2] for hour, n in PROFILE.items()}) is None


def test_days_without_a_common_hour_cannot_be_compared() -> None:
    assert busiest_day({(WEEK[0], 9): 5.0, (WEEK[1], 10): 50.0}) is None


def test_one_day_alone_is_not_the_busiest() -> None:
    assert busiest_day({(WEEK[0], 9): 5.0}) is None
    assert busiest_day({}) is None


@given(
    st.dictionaries(st.tuples(st.sampled_from(WEEK), st.integers(8, 19)), st.floats(0, 100), max_size=84),
    st.floats(0.5, 20),
)
def test_an_hour_that_only_one_day_has_changes_nothing(known: dict[tuple[date, int], float], n: float) -> None:
    assert busiest_day(known | {(WEEK[3], 22): n}) in (busiest_day(known), None)
