"""Shares by days, and whether track ids last: formulas against independent ones, and the rules in words."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from vsd_analytics.answer import Reason
from vsd_analytics.stats.groups import share_by_days, track_lives
from vsd_analytics.wording.reasons import reason_text

days = st.lists(st.tuples(st.integers(0, 400), st.integers(0, 400)), min_size=5, max_size=30).map(
    lambda rows: (np.array([min(r) for r in rows]), np.array([max(r) for r in rows]))
)


def lives(seconds: float, n: int, *, n_goes_on: int = 0, n_came_before: int = 0) -> object:
    return track_lives([seconds] * n, [seconds] * n, n_ends=n, n_goes_on=n_goes_on, n_came_before=n_came_before)


def test_share_is_the_ratio_estimator_with_days_as_clusters() -> None:
    n, of = np.array([40, 55, 38, 60, 71, 90, 30]), np.array([80, 90, 70, 100, 150, 160, 40])
    found = share_by_days(n, of)
    # the linearised ratio, as survey samplers write it: residuals over the mean size, standard error of their mean
    residual = (n - n.sum() / of.sum() * of) / of.mean()
    se = residual.std(ddof=1) / math.sqrt(7)
    p = n.sum() / of.sum()
    half = stats.t.ppf(0.975, 6) * se / (p * (1 - p))
    expected = [1 / (1 + math.exp(-(math.log(p / (1 - p)) + s * half))) for s in (-1, 1)]
    assert found.value == pytest.approx(p)
    assert [found.lo, found.hi] == pytest.approx(expected)
    assert (found.n, found.of, found.n_days, found.state) == (384, 690, 7, "ok")


@given(days)
def test_interval_holds_the_share_and_stays_between_0_and_1(rows: tuple[np.ndarray, np.ndarray]) -> None:
    found = share_by_days(*rows)
    if found.lo is None or found.hi is None or found.value is None:
        assert found.state == "not_enough_data"
        return
    assert 0 <= found.lo <= found.value <= found.hi <= 1


@given(days)
def test_the_other_share_is_its_mirror_image(rows: tuple[np.ndarray, np.ndarray]) -> None:
    n, of = rows
    here, there = share_by_days(n, of), share_by_days(of - n, of)
    if here.value is not None and there.value is not None:
        assert here.value == pytest.approx(1 - there.value)
    if here.lo is not None and there.hi is not None:
        assert here.lo == pytest.approx(1 - there.hi, abs=1e-12)


@given(days)
def test_a_day_without_violations_says_nothing(rows: tuple[np.ndarray, np.ndarray]) -> None:
    assert share_by_days(np.append(rows[0], 0), np.append(rows[1], 0)) == share_by_days(*rows)


def test_too_little_gives_no_interval_and_says_why() -> None:
    assert share_by_days([], []).reason == Reason("violations.none")
    one_day = share_by_days([5], [10])
    assert (one_day.value, one_day.lo, one_day.state) == (0.5, None, "not_enough_data")
    assert "5 days" in reason_text(one_day.reason)
    assert "5 violations" in reason_text(share_by_days([1, 0, 0, 0, 0], [1, 1, 1, 1, 0], min_days=2).reason)


def test_none_of_many_is_not_zero_for_sure() -> None:
    none, every = share_by_days([0] * 7, [20] * 7), share_by_days([20] * 7, [20] * 7)
    assert (none.value, none.lo, none.hi) == (0.0, 0.0, pytest.approx(3 / 140, rel=0.01))
    assert (every.value, every.lo, every.hi) == (1.0, pytest.approx(1 - 3 / 140, rel=0.01), 1.0)


def test_few_days_that_agree_by_luck_are_not_certain() -> None:
    found = share_by_days([2] * 7, [4] * 7)
    assert found.lo is not None
    assert found.lo < 0.35


@pytest.mark.parametrize(("n", "of"), [([3], [2]), ([-1], [2]), ([1, 2], [3])])
def test_impossible_counts_are_refused(n: list[int], of: list[int]) -> None:
    with pytest.raises(ValueError, match=r"part|day"):
        share_by_days(n, of)


def test_long_ids_tell_whatever_begins_beside_them() -> None:
    found = lives(20.0, 40, n_goes_on=40)
    assert (found.state, found.long_share, found.cut_share) == ("ok", 1.0, 1.0)


def test_short_ids_that_are_not_cut_are_short_visits() -> None:
    assert lives(8.0, 100, n_goes_on=16, n_came_before=4).state == "ok"


def test_short_ids_that_go_on_as_others_are_cut_and_the_filter_says_so_with_the_numbers() -> None:
    found = lives(8.0, 100, n_goes_on=17, n_came_before=4)
    assert (found.state, found.cut_share) == ("not_measurable", 0.13)
    for said in ("group filter not applicable", "8.0 s in the median", "0% of person-time", "13%"):
        assert said in reason_text(found.reason)


def test_few_short_ids_do_not_tell() -> None:
    found = lives(8.0, 29)
    assert (found.state, "29 ends" in reason_text(found.reason)) == ("not_enough_data", True)


def test_half_of_person_time_decides_not_half_of_the_ids() -> None:
    lives_s = [100.0] * 10 + [5.0] * 200
    found = track_lives(lives_s, lives_s, n_ends=210, n_goes_on=200, n_came_before=0)
    assert (found.state, found.median_life_s, found.long_share) == ("ok", 5.0, 0.5)


def test_nobody_is_not_measured() -> None:
    found = track_lives([], [], n_ends=0, n_goes_on=0, n_came_before=0)
    assert (found.state, found.median_life_s, found.cut_share) == ("not_enough_data", None, None)
