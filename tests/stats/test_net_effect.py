"""The net effect on the whole floor: by hand, exact contributions, and what only moved is no fall."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vsd_analytics.stats.net_effect import net_effect
from vsd_analytics.stats.running_verdict import running_verdict

BEFORE = [[30.0, 26.0, 33.0, 29.0], [12.0, 15.0, 11.0, 13.0], [40.0, 44.0, 39.0, 47.0]]
HOURS_BEFORE = [70.0, 70.0, 66.0, 70.0]
AFTER = [[15.0, 18.0, 16.0], [14.0, 12.0, 15.0], [45.0, 40.0, 41.0]]
HOURS_AFTER = [70.0, 68.0, 70.0]


def test_the_net_effect_and_its_range_equal_the_computation_by_hand() -> None:
    """With fewer than eight weeks before it is the weekly test, with the variance of weeks that resemble each other."""
    found = net_effect(BEFORE, HOURS_BEFORE, AFTER, HOURS_AFTER)
    logs, rates = [], []
    for n, x in ((BEFORE, HOURS_BEFORE), (AFTER, HOURS_AFTER)):
        weeks = [sum(column) for column in zip(*n, strict=True)]
        rates.append(sum(weeks) / sum(x))
        logs.append(np.log(np.array(weeks) / np.array(x)))
    (b, a), dev = logs, [y - y.mean() for y in logs]
    lag = sum(float(d[1:] @ d[:-1]) for d in dev) / sum(float(d @ d) for d in dev) + 2 / 7
    r = (7 * lag + 8) / 27
    assert found.value == pytest.approx(rates[1] / rates[0], rel=1e-12)
    assert found.correlation == pytest.approx(r, rel=1e-12)
    more = math.sqrt((1 + r) / (1 - r))
    plain = running_verdict(dev[0] * more, a.mean() - b.mean() + dev[1] * more)
    assert (found.lo, found.hi) == pytest.approx((plain.lo, plain.hi), rel=1e-9)


def test_from_eight_weeks_on_a_line_continued_is_no_change_of_the_floor() -> None:
    wave = np.array([0.02, -0.02, 0.01, -0.01, 0.02, -0.02, 0.01, -0.01])
    falling = 100 * np.exp(-0.04 * np.arange(16) + np.tile(wave, 2))
    assert net_effect(falling[None, :8], [70.0] * 8, falling[None, 8:], [70.0] * 8).verdict == "cannot_tell"
    step = np.where(np.arange(16) < 8, 100.0, 50.0) * np.exp(np.tile(wave, 2))
    assert net_effect(step[None, :8], [70.0] * 8, step[None, 8:], [70.0] * 8).verdict == "clear_fall"


def test_a_floor_that_falls_to_none_has_a_range_with_an_end() -> None:
    found = net_effect(BEFORE, HOURS_BEFORE, np.zeros((3, 3)), HOURS_AFTER)
    assert (found.value, found.lo, found.verdict) == (0.0, 0.0, "clear_fall")
    assert found.hi is not None
    assert 0 < found.hi < 1


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
    assert few.reason.code == "logged_change.reference_weeks"
    none = net_effect([[0.0] * 4], [70] * 4, [[1.0]], [70])
    assert none.reason is not None
    assert none.reason.code == "logged_change.floor_without"
    with pytest.raises(ValueError, match="same places"):
        net_effect(BEFORE, HOURS_BEFORE, AFTER[:2], HOURS_AFTER)
    with pytest.raises(ValueError, match="not negative"):
        net_effect([[-1.0] * 4], [70] * 4, [[1.0]], [70])
