"""The usual range of a weekly figure: a prediction interval for one more week."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from vsd_analytics.stats.usual import usual_range

WEEKS = st.lists(st.floats(0.1, 1e4), min_size=4, max_size=12)


def test_the_range_is_the_prediction_interval_of_exponential_smoothing_written_out() -> None:
    a, b, c, d = np.log([100.0, 120.0, 90.0, 110.0])
    after_two, after_three = (a + 2 * b) / 3, (a + 2 * b + 4 * c) / 7
    last = (a + 2 * b + 4 * c + 8 * d) / 15
    errors = [(b - a) ** 2 / 2, (c - after_two) ** 2 / (1 + 5 / 9), (d - after_three) ** 2 / (1 + 21 / 49)]
    scale = np.sqrt(np.mean(errors) * (1 + 85 / 225))
    lo, hi = stats.t.interval(0.95, df=3, loc=last, scale=scale)
    found = usual_range([100.0, 120.0, 90.0, 110.0])
    assert found is not None
    assert (found.lo, found.hi, found.n_weeks) == (pytest.approx(np.exp(lo)), pytest.approx(np.exp(hi)), 4)


def test_the_range_follows_weeks_that_rise() -> None:
    rising = usual_range([100.0, 110.0, 121.0, 133.0, 146.0, 161.0, 177.0, 195.0])
    assert rising is not None
    assert rising.position(200.0) == "within"
    assert rising.position(100.0) == "below"


@pytest.mark.parametrize("weeks", [[], [100.0, 110.0, 120.0], [100.0, 0.0, 110.0, 120.0]])
def test_few_weeks_or_a_week_without_any_make_no_range(weeks: list[float]) -> None:
    assert usual_range(weeks) is None


@given(WEEKS, st.floats(0.01, 100))
def test_the_unit_does_not_matter(weeks: list[float], factor: float) -> None:
    plain, scaled = usual_range(weeks), usual_range([factor * w for w in weeks])
    assert plain is not None
    assert scaled is not None
    assert (scaled.lo, scaled.hi) == (pytest.approx(factor * plain.lo), pytest.approx(factor * plain.hi))


@given(WEEKS)
def test_a_surer_range_is_wider_and_its_middle_lies_within(weeks: list[float]) -> None:
    wide, narrow = usual_range(weeks, confidence=0.95), usual_range(weeks, confidence=0.8)
    assert wide is not None
    assert narrow is not None
    assert wide.lo <= narrow.lo <= narrow.hi <= wide.hi
    weights = 0.5 ** np.arange(len(weeks))[::-1]
    middle = float(np.exp(np.average(np.log(weeks), weights=weights)))
    assert narrow.position(middle) == "within" or narrow.lo == pytest.approx(narrow.hi)


def test_a_share_is_never_above_one() -> None:
    found = usual_range([0.7, 0.95, 0.8, 0.6], most=1.0)
    assert found is not None
    assert found.hi == 1.0


@pytest.mark.simulation
@pytest.mark.parametrize("n_weeks", [4, 7, 11])
@pytest.mark.parametrize(("sd", "correlation"), [(0.05, 0.0), (0.22, 0.0), (0.22, 0.3), (0.22, 0.6)])
def test_a_week_like_the_others_lies_outside_in_one_of_twenty(n_weeks: int, sd: float, correlation: float) -> None:
    rng = np.random.default_rng(20260915)
    noise = rng.normal(size=(8000, n_weeks + 1))
    weeks = noise.copy()
    for k in range(1, n_weeks + 1):
        weeks[:, k] = correlation * weeks[:, k - 1] + np.sqrt(1 - correlation**2) * noise[:, k]
    levels = 100 * np.exp(sd * weeks)
    outside = 0
    for row in levels:
        found = usual_range(row[:-1].tolist())
        assert found is not None
        outside += found.position(float(row[-1])) != "within"
    promised = 0.05 if correlation == 0 else 0.075  # weeks that resemble each other make the range a little narrow
    assert outside / len(levels) == pytest.approx(promised, abs=0.012 if correlation == 0 else 0.025)
