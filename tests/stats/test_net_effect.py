"""The net effect on the whole floor: by hand, exact contributions, and what only moved is no fall."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from vsd_analytics.stats.net_effect import net_effect

BEFORE = [[30.0, 26.0, 33.0, 29.0], [12.0, 15.0, 11.0, 13.0], [40.0, 44.0, 39.0, 47.0]]
HOURS_BEFORE = [70.0, 70.0, 66.0, 70.0]
AFTER = [[15.0, 18.0, 16.0], [14.0, 12.0, 15.0], [45.0, 40.0, 41.0]]
HOURS_AFTER = [70.0, 68.0, 70.0]


def test_the_net_effect_and_its_interval_equal_the_computation_by_hand() -> None:
    found = net_effect(BEFORE, HOURS_BEFORE, AFTER, HOURS_AFTER)
    squares, rates = 0.0, []
    for n, x in ((BEFORE, HOURS_BEFORE), (AFTER, HOURS_AFTER)):
        weeks = [sum(column) for column in zip(*n, strict=True)]
        rate = sum(weeks) / sum(x)
        rates.append(rate)
        squares += sum(((w - rate * h) / (sum(weeks) / len(weeks))) ** 2 for w, h in zip(weeks, x, strict=True))
    theta = rates[1] / rates[0]
    se = math.sqrt(squares / 5 * (1 / 4 + 1 / 3))
    assert found.value == pytest.approx(theta, rel=1e-12)
    assert (found.log_se, found.df) == (pytest.approx(se, rel=1e-12), 5)
    half = stats.t.ppf(0.975, 5) * se
    assert (found.lo, found.hi) == pytest.approx((theta * math.exp(-half), theta * math.exp(half)), rel=1e-9)


def test_with_equal_hours_it_is_the_t_test_of_two_samples_of_relative_weeks() -> None:
    n_b, n_a = np.array([[50.0, 60, 55, 65]]), np.array([[40.0, 44, 48]])
    found = net_effect(n_b, [70] * 4, n_a, [70] * 3)
    x, y = n_b[0] / n_b.mean(), n_a[0] / n_a.mean()
    pooled = (3 * x.var(ddof=1) + 2 * y.var(ddof=1)) / 5
    assert found.log_se == pytest.approx(math.sqrt(pooled * (1 / 4 + 1 / 3)), rel=1e-12)


def test_contributions_of_areas_add_up_to_the_change_of_the_floor_exactly() -> None:
    found = net_effect(BEFORE, HOURS_BEFORE, AFTER, HOURS_AFTER)
    assert found.value is not None
    assert math.fsum(found.contributions) == pytest.approx(found.value - 1, abs=1e-15)
    share = found.share_of(0)
    assert share is not None
    assert share == pytest.approx(found.contributions[0] / (found.value - 1))
    assert found.share_of(1) is None, "it moved the other way than the floor"


@pytest.mark.parametrize(("taken_up", "moved"), [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0)])
def test_what_moves_to_other_areas_at_any_distance_shows(taken_up: float, moved: float) -> None:
    before = np.array([[100.0] * 6, [50.0] * 6, [80.0] * 6, [60.0] * 6])
    wave = np.array([0.97, 1.03, 1.0, 0.98, 1.02, 1.0])
    after = before.copy()
    after[0] -= 60
    after[1:] += taken_up * 20
    found = net_effect(before * wave, [70] * 6, after * wave, [70] * 6)
    assert found.moved_elsewhere(0) == pytest.approx(moved, abs=1e-12)
    assert found.value == pytest.approx((290 - 60 * (1 - taken_up)) / 290)
    assert (found.verdict == "clear_fall") == (taken_up < 1)


def test_a_place_that_did_not_fall_moved_nothing_elsewhere() -> None:
    assert net_effect(BEFORE, HOURS_BEFORE, AFTER, HOURS_AFTER).moved_elsewhere(1) is None


def test_weeks_without_hours_are_left_out_and_not_zero() -> None:
    with_gap = [[*row[:2], 0.0, *row[2:]] for row in BEFORE]
    hours = [*HOURS_BEFORE[:2], math.nan, *HOURS_BEFORE[2:]]
    gap = net_effect(with_gap, hours, AFTER, HOURS_AFTER)
    assert gap == net_effect(BEFORE, HOURS_BEFORE, AFTER, HOURS_AFTER)


def test_too_few_weeks_or_nothing_at_all_have_their_reason() -> None:
    few = net_effect([[1.0, 2.0]], [70, 70], [[1.0]], [70])
    assert (few.value, few.verdict) == (None, "too_little_data")
    assert few.reason is not None
    assert few.reason.code == "redesign.reference_weeks"
    none = net_effect([[0.0] * 4], [70] * 4, [[1.0]], [70])
    assert none.reason is not None
    assert none.reason.code == "redesign.floor_without"
    with pytest.raises(ValueError, match="same places"):
        net_effect(BEFORE, HOURS_BEFORE, AFTER[:2], HOURS_AFTER)
    with pytest.raises(ValueError, match="not negative"):
        net_effect([[-1.0] * 4], [70] * 4, [[1.0]], [70])
