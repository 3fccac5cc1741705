"""Waiting times: the estimator by hand and against another formula for it, intervals in simulated weeks."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from queue_worlds import World, see, truth

from vsd_analytics.stats.waiting import CUT, LEFT, SERVED, WaitTimes, cumulative_incidence, waiting
from vsd_analytics.wording.reasons import reason_text

N_DAYS = 7


def test_the_aalen_johansen_estimate_is_the_one_worked_by_hand() -> None:
    """Eight people: served at 2, 5, 5 and 9, left at 3 and 7, lost at 4 and 7 (a tie of an end and a loss)."""
    seconds = [2, 3, 4, 5, 5, 7, 7, 9]
    ends = [SERVED, LEFT, CUT, SERVED, SERVED, LEFT, CUT, SERVED]
    found = cumulative_incidence(seconds, ends, np.ones(8))
    # still waiting just before each time: 1, 7/8, 3/4, 3/4, 9/20, 3/10; followed: 8, 7, 6, 5, 3, 1
    served = [Fraction(1, 8), Fraction(1, 8), Fraction(1, 8), Fraction(17, 40), Fraction(17, 40), Fraction(29, 40)]
    left = [0, Fraction(1, 8), Fraction(1, 8), Fraction(1, 8), Fraction(11, 40), Fraction(11, 40)]
    assert found.time_s.tolist() == [2, 3, 4, 5, 7, 9]
    assert found.served == pytest.approx([float(f) for f in served], abs=1e-12)
    assert found.left == pytest.approx([float(f) for f in left], abs=1e-12)
    assert found.waiting == pytest.approx([0.875, 0.75, 0.75, 0.45, 0.3, 0.0], abs=1e-12)


@given(st.integers(0, 10_000), st.integers(5, 60))
def test_it_equals_the_mean_weighted_by_the_inverse_probability_of_not_being_lost(seed: int, n: int) -> None:
    """F_k(t) = 1/n sum of 1 / G(t_i-) over those who ended so by t, G the Kaplan-Meier curve of being lost.

    Source: Satten and Datta, Am. Stat. 55 (2001).
    """
    rng = np.random.default_rng(seed)
    seconds, ends = rng.integers(1, 25, n), rng.choice([CUT, SERVED, LEFT], n)
    found = cumulative_incidence(seconds, ends, np.ones(n))
    weight = np.zeros(n)
    for i, at in enumerate(seconds):
        kept = 1.0
        for u in np.unique(seconds[seconds < at]):
            # who ends at the very time of a loss is no longer there to be lost
            there = ((seconds > u) | ((seconds == u) & (ends == CUT))).sum()
            kept *= 1 - ((seconds == u) & (ends == CUT)).sum() / there if there else 1.0
        weight[i] = 1 / kept
    for way, curve in ((SERVED, found.served), (LEFT, found.left)):
        expected = [weight[(seconds <= t) & (ends == way)].sum() / n for t in found.time_s]
        assert curve == pytest.approx(expected, abs=1e-6)
    assert found.served + found.left + found.waiting == pytest.approx(np.ones(len(found.time_s)))


def test_without_lost_tracks_they_are_the_quantiles_of_those_served_and_the_share_who_left() -> None:
    seconds = np.arange(1.0, 101.0)
    ends = np.where(np.arange(100) % 4 == 3, LEFT, SERVED)
    found = waiting(seconds, ends, np.arange(100) % N_DAYS)
    served = seconds[ends == SERVED]
    assert found.median.value == np.quantile(served, 0.5, method="inverted_cdf")
    assert found.p90.value == np.quantile(served, 0.9, method="inverted_cdf")
    assert found.left_share.value == pytest.approx(0.25)
    assert (found.n_entered, found.n_served, found.n_left, found.n_cut, found.state) == (100, 75, 25, 0, "ok")


def test_leavers_are_no_censored_observations() -> None:
    """Were those who leave taken for lost ones, everybody would seem to be served in the end."""
    ends = np.where(np.arange(90) % 3 == 0, LEFT, SERVED)
    assert waiting(np.arange(90.0), ends, np.arange(90) % N_DAYS).left_share.value == pytest.approx(1 / 3)


@pytest.mark.parametrize("cut_per_s", [0.0, 0.01])
def test_intervals_hold_the_truth_however_many_tracks_are_cut(cut_per_s: float) -> None:
    world = World("week", per_hour=40, service_s=200.0, cut_per_s=cut_per_s)
    true, held = truth(world, 300), np.zeros(3)
    for seed in range(40):
        seen = see(world, n_days=N_DAYS, seed=seed)
        found = waiting(seen.wait_s, seen.outcome, seen.day)
        for k, (q, value) in enumerate(((found.median, true["median"]), (found.p90, true["p90"]))):
            held[k] += (q.lo or 0) <= value and (q.hi is None or value <= q.hi)
        share = found.left_share
        held[2] += share.lo is not None and share.hi is not None and share.lo <= true["left"] <= share.hi
    assert (held >= 34).all()  # 95 % of 40 is 38; 34 is exceeded with probability .99


def reason(found: WaitTimes) -> str:
    assert found.median.value is None
    assert found.left_share.value is None
    return reason_text(found.reason)


def test_too_few_people_have_a_reason_and_no_number() -> None:
    day = np.arange(60) % N_DAYS
    assert reason(waiting([], [], [])) == "needs at least 30 people who enter, has 0"
    nobody = waiting(np.arange(60.0), np.full(60, LEFT), day)
    assert reason(nobody) == "needs at least 10 people who are served, has 0"
    lost = waiting(np.r_[np.full(20, 5.0), np.full(40, 6.0)], np.r_[np.full(20, SERVED), np.full(40, CUT)], day)
    assert reason(lost) == "67% of those who enter wait longer than all tracks last"
    short = waiting(np.arange(60.0), np.full(60, SERVED), np.arange(60) % 2)
    assert (short.median.value, short.median.lo, short.left_share.hi) == (29.0, None, None)
    assert reason_text(short.reason) == "an interval needs at least 5 days with entries, has 2"


def test_what_lost_tracks_leave_open_is_inside_the_interval() -> None:
    """Ten of 100 were lost after everybody else's end: they may all have left, or none."""
    ends = np.r_[np.full(70, SERVED), np.full(20, LEFT), np.full(10, CUT)]
    seconds = np.r_[np.arange(70.0), np.arange(20.0), np.full(10, 200.0)]
    rng = np.random.default_rng(0)
    found = waiting(seconds, ends, rng.integers(0, N_DAYS, 100)).left_share
    assert found.value == pytest.approx(20 / 90)
    assert found.lo is not None
    assert found.hi is not None
    assert found.lo < 0.2
    assert found.hi > 0.3


@pytest.mark.parametrize(("ends", "day"), [([SERVED, 7], [0, 0]), ([SERVED], [0, 0])])
def test_what_does_not_fit_is_refused(ends: list[int], day: list[int]) -> None:
    with pytest.raises(ValueError, match=r"every wait|a wait is"):
        waiting([1.0, 2.0], ends, day)
