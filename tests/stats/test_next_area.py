"""Shares of next areas: against weights by the chance of being followed, in simulated weeks, and by the inflow."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats
from flow_worlds import AREAS, FlowWorld, see_flow
from hypothesis import given, settings
from hypothesis import strategies as st

from vsd_analytics.stats.dwell import MIN_FOLLOWED
from vsd_analytics.stats.groups import share_by_days
from vsd_analytics.stats.next_area import Leaving, inflow_checks, next_areas
from vsd_analytics.wording.reasons import reason_text

N_DAYS = 7


@settings(max_examples=10)
@given(st.integers(0, 10_000), st.floats(0.0, 0.06))
def test_shares_are_those_of_the_followed_weighted_by_their_chance_of_it(seed: int, cut_per_s: float) -> None:
    """Another form of the same estimator: 1 / G(t-) for everybody who arrives at t, G the curve of being lost."""
    seen = see_flow(FlowWorld("any", cut_per_s=cut_per_s, per_day=40), n_days=N_DAYS, seed=seed)
    people = seen.leaving[0]
    found = next_areas(people, n_kinds=len(AREAS))
    is_lost = people.kind < 0
    kept = scipy.stats.ecdf(
        scipy.stats.CensoredData(uncensored=people.seconds[is_lost], right=people.seconds[~is_lost])
    ).sf
    followed = (people.seconds[None, :] >= people.seconds[:, None]).sum(axis=1)
    is_lost_later = people.seconds <= people.seconds[is_lost].max(initial=-1.0)
    ends_s = people.seconds[(followed < MIN_FOLLOWED) & is_lost_later].min(initial=np.inf)
    used = ~is_lost & (people.seconds < ends_s)
    weight = 1 / np.maximum(kept.evaluate(people.seconds), 1e-9) / len(is_lost)
    for kind in range(len(AREAS)):
        assert found.reached[kind] == pytest.approx(weight[used & (people.kind == kind)].sum(), abs=0.02)
    assert found.unseen == pytest.approx(max(0.0, 1 - found.reached.sum()))


def test_without_lost_tracks_a_share_is_that_of_counts_with_days_as_clusters() -> None:
    seen = see_flow(FlowWorld("whole"), n_days=N_DAYS, seed=4)
    people = seen.leaving[0]
    found = next_areas(people, n_kinds=len(AREAS)).shares[1]
    n, of = (np.bincount(people.day[at], minlength=N_DAYS) for at in (people.kind == 1, people.kind >= 0))
    by_days = share_by_days(n, of)
    assert found.value == pytest.approx(by_days.value)
    assert (found.lo, found.hi) == (pytest.approx(by_days.lo, abs=0.01), pytest.approx(by_days.hi, abs=0.01))


def test_intervals_hold_the_true_shares_where_half_is_lost_and_naive_shares_are_far_off() -> None:
    world = FlowWorld("half", cut_per_s=0.045)
    truth = world.truth()
    held, far, naive = [], [], []
    for seed in range(16):
        people = see_flow(world, n_days=14, seed=seed).leaving[0]
        shares = next_areas(people, n_kinds=len(AREAS)).shares
        held += [
            s.lo is not None and s.hi is not None and s.lo <= t <= s.hi for s, t in zip(shares, truth[0], strict=True)
        ]
        far.append(shares[3].value)
        naive.append(shares[3].n / sum(s.n for s in shares))
    assert np.mean(held) >= 0.92
    assert np.mean(naive) < 0.55 * truth[0, 3]
    assert np.mean(far) > 0.75 * truth[0, 3]


def test_inflow_disagrees_where_the_till_loses_people_and_not_where_all_floor_does() -> None:
    fair, lossy = (FlowWorld("", cut_per_s=0.01, cut_at_till=share, per_day=200) for share in (0.0, 0.7))
    of_fair, of_lossy = (
        [
            [c.agrees for c in inflow_checks(s.leaving, s.arrived)]
            for s in (see_flow(w, n_days=28, seed=k) for k in range(5))
        ]
        for w in (fair, lossy)
    )
    assert [found.count(False) for found in of_fair] == [0] * 5
    assert sum(found[3] is False for found in of_lossy) >= 4


def test_few_people_and_people_all_lost_have_a_reason_and_no_share() -> None:
    few = next_areas(Leaving(np.ones(29), np.zeros(29, int), np.arange(29) % 7), n_kinds=1)
    assert (few.shares[0].value, reason_text(few.reason)) == (None, "needs at least 30 people who leave, has 29")
    lost = next_areas(Leaving(np.ones(40), np.full(40, -1), np.arange(40) % 7), n_kinds=1)
    assert (lost.shares[0].value, lost.unseen) == (None, None)
    assert reason_text(lost.reason) == "all 40 people who left were lost before they came to an area"
    short = next_areas(Leaving(np.ones(40), np.zeros(40, int), np.arange(40) % 2), n_kinds=2)
    assert [(s.value, s.lo) for s in short.shares] == [(pytest.approx(1.0), None), (0.0, None)]
    assert reason_text(short.reason) == "an interval needs at least 5 days with people who leave, has 2"


def test_shares_are_unknown_where_many_outlast_all_who_were_followed() -> None:
    kind = np.r_[np.zeros(40, int), np.full(60, -1)]
    seconds = np.r_[np.full(40, 5.0), np.full(60, 6.0)]
    found = next_areas(Leaving(seconds, kind, np.arange(100) % N_DAYS), n_kinds=1)
    assert found.unseen == pytest.approx(0.6)
    assert found.shares[0].value is None
    assert "60% of those who left" in reason_text(found.reason)


def test_a_way_nobody_took_has_an_upper_limit() -> None:
    found = next_areas(Leaving(np.ones(60), np.zeros(60, int), np.arange(60) % N_DAYS), n_kinds=2)
    assert (found.shares[1].value, found.shares[1].lo, found.shares[1].hi) == (0.0, 0.0, pytest.approx(0.05, abs=0.001))


@pytest.mark.parametrize("day", [[0, 1], [-1, 0, 0]])
def test_people_without_a_day_are_refused(day: list[int]) -> None:
    with pytest.raises(ValueError, match=r"everybody who leaves|at least 0"):
        Leaving(np.ones(3), np.zeros(3, int), np.array(day))
