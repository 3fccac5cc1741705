"""A logged change from weeks of areas: none after is a result, receivers are found, and others' falls are no effect."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from vsd_analytics.stats.few_events import dispersion, exact_limits, log_e, running_limits
from vsd_analytics.stats.logged_change import AreaWeeks, taken_up, verdict_of_weeks
from vsd_analytics.stats.placebos import PRIOR_SD, spread_half_width

OPEN_H = 70.0


def weeks(factors: list[float], *, n: int, seed: int, usual: float = 300.0, of: float | None = None) -> AreaWeeks:
    """Return weeks of areas with so many usual violations (the changed one `of`), times a factor each."""
    rng = np.random.default_rng(seed)
    mean = np.array([usual if of is None else of, *[usual] * (len(factors) - 1)]) * np.array(factors)
    count = rng.poisson(np.broadcast_to(mean[:, None], (len(factors), n))).astype(float)
    time_h = np.where(count > 0, rng.gamma(np.maximum(count, 1), 0.01), 0.0)
    return AreaWeeks(time_h, np.full(count.shape, OPEN_H), count)


def test_an_area_of_470_a_week_that_has_none_is_a_clear_fall_from_the_first_week_on() -> None:
    before, after = weeks([1.0] * 6, n=12, seed=1, of=470), weeks([0.0, *[1.0] * 5], n=6, seed=2, of=470)
    upper = []
    for n in range(1, 7):
        found = verdict_of_weeks(before, after.at(np.arange(6) < n))
        assert (found.value, found.lo, found.verdict, found.n_weeks) == (0.0, 0.0, "clear_fall", n)
        assert found.hi is not None
        assert 0 < found.hi < 0.2
        assert found.is_counted
        assert found.e_value is not None
        assert math.isfinite(found.e_value)
        upper.append(found.hi)
    assert upper[-1] < upper[0]


def test_an_area_of_15_a_week_that_has_none_is_a_clear_fall() -> None:
    before, after = weeks([1.0] * 6, n=12, seed=3, of=15), weeks([0.0, *[1.0] * 5], n=6, seed=4, of=15)
    found = verdict_of_weeks(before, after)
    assert (found.value, found.verdict) == (0.0, "clear_fall")


def test_few_weeks_of_one_violation_say_nothing_when_there_are_none_after() -> None:
    before, after = weeks([1.0] * 6, n=4, seed=6, of=0.8), weeks([0.0, *[1.0] * 5], n=2, seed=7, of=0.8)
    assert before.n[0].sum() > 0
    assert verdict_of_weeks(before, after).verdict == "cannot_tell"


def test_an_area_that_never_had_any_is_refused_for_the_weeks_before() -> None:
    found = verdict_of_weeks(weeks([0.0, 1.0, 1.0], n=12, seed=1), weeks([0.0, 1.0, 1.0], n=4, seed=2))
    assert found.reason is not None
    assert found.reason.code == "logged_change.events_before"


def test_exact_limits_are_those_of_the_binomial_and_none_has_one_side() -> None:
    lo, hi = exact_limits(40, 10, exposure_ratio=0.5, phi=1.0, confidence=0.95)
    ends = stats.binomtest(10, 50).proportion_ci(confidence_level=0.95, method="exact")
    assert (lo, hi) == pytest.approx([p / (1 - p) / 0.5 for p in (ends.low, ends.high)], rel=1e-9)
    lo, hi = exact_limits(40, 0, exposure_ratio=1.0, phi=1.0, confidence=0.95)
    assert lo == 0
    assert (1 / (1 + hi)) ** 40 == pytest.approx(0.05)


def test_the_running_range_of_counts_holds_the_ratios_that_are_not_rejected() -> None:
    at = {"exposure_ratio": 0.6, "phi": 2.0}
    lo, hi = running_limits(300, 90, confidence=0.95, **at)
    assert hi is not None
    for end in (lo, hi):
        assert log_e(300, 90, theta=end, **at) == pytest.approx(math.log(20), abs=1e-6)
    assert running_limits(300, 0, confidence=0.95, **at)[0] == 0


def test_counts_read_every_week_say_clear_of_nothing_in_at_most_one_of_twenty() -> None:
    rng = np.random.default_rng(5)
    ever = 0
    for _ in range(1500):
        before, after = rng.poisson(6.0, 12), np.cumsum(rng.poisson(6.0, 26))
        phi = dispersion(before, np.ones(12))
        e = [log_e(before.sum(), n, exposure_ratio=(k + 1) / 12, phi=phi) for k, n in enumerate(after)]
        ever += max(e) >= math.log(20)
    assert 5 < ever < 75


def test_a_fall_like_those_of_the_comparison_areas_is_not_clear() -> None:
    before = weeks([1.0] * 8, n=12, seed=8)
    uneven = weeks([0.7, 0.5, 0.9, 0.6, 0.8, 0.95, 1.0, 0.75], n=8, seed=9)
    even = weeks([0.7, *[1.0] * 7], n=8, seed=9)
    assert verdict_of_weeks(before, uneven).verdict == "cannot_tell"
    assert verdict_of_weeks(before, even).verdict == "clear_fall"


def test_an_area_that_took_the_people_up_hides_no_fall() -> None:
    before, after = weeks([1.0] * 5, n=12, seed=10), weeks([0.2, 1.8, 1.0, 1.0, 1.0], n=8, seed=11)
    assert verdict_of_weeks(before, after).verdict == "clear_fall"
    taken = taken_up(before, after, [1, 2, 3, 4])
    assert taken.share == pytest.approx(1.0, abs=0.15)
    assert int(np.argmax(taken.taken_h)) == 0
    away = taken_up(before, weeks([0.2, *[1.0] * 4], n=8, seed=12), [1, 2, 3, 4])
    assert away.share is not None
    assert away.share < 0.3


def test_with_few_comparison_areas_a_prior_stands_in_for_their_spread() -> None:
    one = spread_half_width([-1.0], [[0.0]])
    assert one[0] == pytest.approx(stats.t.ppf(0.995, 3) * PRIOR_SD * math.sqrt(2))
    alike = spread_half_width([-1.0], [[0.0]] * 4)
    assert alike[0] == 0


def test_shifts_the_other_way_count_no_farther_than_those_the_same_way() -> None:
    shifts = [[-0.1], [0.0], [0.05], [2.0], [-0.02]]
    capped = spread_half_width([-1.0], shifts)
    assert capped[0] < spread_half_width([1.0], shifts)[0] / 3
    by_hand = np.array([-0.1, 0.0, 0.05, 0.1, -0.02])
    assert capped[0] == pytest.approx(stats.t.ppf(0.995, 4) * by_hand.std(ddof=1) * math.sqrt(1.2))


def test_a_week_in_which_a_camera_was_down_is_left_out_with_its_time() -> None:
    before, after = weeks([1.0] * 5, n=12, seed=13), weeks([0.5, *[1.0] * 4], n=6, seed=14)
    down = AreaWeeks(after.time_h.copy(), after.open_h.copy(), after.n.copy())
    for values in (down.time_h, down.open_h, down.n):
        values[0, 2] = 0.0
    found = verdict_of_weeks(before, down)
    assert found.n_weeks == 5
    assert not found.is_counted, "not recorded is not zero"
