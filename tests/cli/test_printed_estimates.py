"""Estimates as commands print them."""

from __future__ import annotations

import pytest

from vsd_analytics.answer import Reason, State
from vsd_analytics.cli.estimates import why_none, with_limits


@pytest.mark.parametrize(
    ("value", "lo", "hi", "printed"),
    [
        (0.25, 0.125, 0.5, "25% (12% to 50%)"),
        (0.0, 0.0, 0.04, "0% (0% to 4%)"),
        (0.25, None, 0.5, "25%"),
        (0.25, 0.125, None, "25%"),
        (None, 0.125, 0.5, "too few"),
    ],
)
def test_limits_are_printed_where_there_are_both(
    value: float | None, lo: float | None, hi: float | None, printed: str
) -> None:
    assert with_limits(value, lo, hi, "{:.0%}".format, missing="too few") == printed


@pytest.mark.parametrize(
    ("state", "words"), [("not_enough_data", "not enough data"), ("not_measurable", "not measurable")]
)
def test_a_missing_result_says_what_kind_and_why(state: State, words: str) -> None:
    said = why_none(state, Reason("areas.none"))
    assert said.startswith(f"{words}: ")
    assert len(said) > len(words) + 5
