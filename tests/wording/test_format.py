"""How numbers, dates and ranges are written."""

from __future__ import annotations

import doctest
from datetime import date

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.wording import format as fmt


def test_examples_in_the_docstrings_hold() -> None:
    assert doctest.testmod(fmt).failed == 0


@pytest.mark.parametrize("absurd", [1e308, -1e308, float("inf"), float("nan")])
def test_a_share_that_no_percentage_can_hold_is_missing(absurd: float) -> None:
    estimate = Estimate(value=1.0, change=absurd, change_lo=absurd, change_hi=0.1)
    assert {fmt.percent(absurd), fmt.signed(absurd), fmt.fewer_more(absurd)} == {fmt.MISSING}
    assert fmt.likely_change(estimate) == ""


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (121.3, "121"),
        (9.94, "9.9"),
        (9.96, "10"),
        (1.0, "1.0"),
        (0.997, "1.0"),
        (0.0412, "0.041"),
        (12345.6, "12,346"),
        (-3.2, "−3.2"),
    ],
)
def test_integers_from_ten_up_one_decimal_below(value: float, text: str) -> None:
    assert fmt.number(value) == text


@given(st.floats(min_value=0.001, max_value=1e9))
def test_a_written_number_is_within_half_of_its_last_digit(value: float) -> None:
    written = float(fmt.number(value).replace(",", ""))
    assert written == pytest.approx(value, rel=0.051)


def test_missing_is_a_dash_and_never_zero() -> None:
    for write in (fmt.number, fmt.count, fmt.percent, fmt.signed, fmt.fewer_more):
        assert write(None) == "–"


@given(st.floats(min_value=0, max_value=1))
def test_what_is_not_all_or_none_never_looks_like_it(share: float) -> None:
    assert (fmt.percent(share) == "100%") == (share == 1)
    assert (fmt.percent(share) == "0%") == (share == 0)


def test_intervals_in_words() -> None:
    fall = Estimate(value=1.0, change=-0.14, change_lo=-0.18, change_hi=-0.1)
    assert fmt.likely_change(fall) == "likely between 10% and 18% fewer"
    assert fmt.likely_signed(fall) == "likely −18% to −10%"
    rise = Estimate(value=1.0, change=0.14, change_lo=0.1, change_hi=0.18)
    assert fmt.likely_change(rise) == "likely between 10% and 18% more"
    both = Estimate(value=1.0, change=0.08, change_lo=-0.01, change_hi=0.17)
    assert fmt.likely_change(both) == "likely between 1% fewer and 17% more"
    assert fmt.likely_change(Estimate(value=1.0)) == ""


def test_dates_do_not_repeat_what_they_share() -> None:
    assert fmt.date_span(date(2026, 11, 9), date(2026, 11, 15)) == ("Monday 9", "Sunday 15 November 2026")
    assert fmt.date_span(date(2026, 9, 28), date(2026, 10, 4))[0] == "Monday 28 September"
    assert fmt.date_span(date(2026, 12, 28), date(2027, 1, 3))[0] == "Monday 28 December 2026"


def test_units_are_written_once_and_plainly() -> None:
    assert (fmt.metres(2.0), fmt.metres(1.83), fmt.metres(1.8288)) == ("2 m", "1.83 m", "1.83 m")
    assert (fmt.seconds(3.0), fmt.seconds(1.0)) == ("3 seconds", "1 second")
    assert fmt.one_in(3 / 86) == "1 in 28"
