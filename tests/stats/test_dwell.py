"""Dwell times: the curve against scipy, intervals by hand and in simulated weeks, and the check by Little's law."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st
from visit_worlds import World, see

from vsd_analytics.stats.dwell import MIN_FOLLOWED, Dwell, dwell
from vsd_analytics.wording.reasons import reason_text

N_DAYS = 7


def dwell_of(world: World, *, seed: int, n_days: int = N_DAYS) -> Dwell:
    seen = see(world, n_days=n_days, seed=seed)
    return dwell(seen.dwell_s, seen.is_cut, seen.day, person_s=seen.person_s, long_s=120.0)


@given(st.integers(0, 10_000), st.floats(0.0, 0.06))
def test_quantiles_are_those_of_the_kaplan_meier_curve_of_scipy(seed: int, cut_per_s: float) -> None:
    seen = see(World("any", cut_per_s=cut_per_s, per_day=40), n_days=N_DAYS, seed=seed)
    found = dwell(seen.dwell_s, seen.is_cut, seen.day, person_s=seen.person_s, long_s=30.0)
    data = scipy.stats.CensoredData(uncensored=seen.dwell_s[~seen.is_cut], right=seen.dwell_s[seen.is_cut])
    curve = scipy.stats.ecdf(data).sf
    order = np.sort(seen.dwell_s)
    is_whole = seen.dwell_s[seen.is_cut].max(initial=0.0) <= order[-MIN_FOLLOWED]
    last_s = order[-1] if is_whole else order[-MIN_FOLLOWED]
    for quantile in (found.median, found.p90):
        reached = curve.quantiles[(curve.probabilities <= 1 - quantile.q + 1e-9) & (curve.quantiles <= last_s)]
        assert quantile.value == (pytest.approx(reached[0]) if len(reached) else None)
    if found.long_share.value is not None:
        assert found.long_share.value == pytest.approx(float(curve.evaluate(30.0)))


def test_whole_tracks_give_the_quantiles_of_their_times() -> None:
    times = np.arange(1.0, 101.0)
    found = dwell(times, np.zeros(100, bool), np.arange(100) % N_DAYS, person_s=np.full(N_DAYS, 100.0), long_s=75.0)
    assert (found.median.value, found.p90.value) == (50.0, 90.0)
    assert found.long_share.value == pytest.approx(0.25)
    assert (found.n_visits, found.n_cut, found.n_days, found.state) == (100, 0, N_DAYS, "ok")


def test_without_cut_tracks_the_variance_is_that_of_a_share_with_days_as_clusters() -> None:
    """1 - S(t) is then the share of visits up to t; its linear variance is D/(D-1) sum_d (n_d - p m_d)^2 / m^2."""
    rng = np.random.default_rng(3)
    day = np.repeat(np.arange(N_DAYS), rng.integers(20, 60, N_DAYS))
    times = np.round(np.exp(rng.normal(3, 1, len(day)) + rng.normal(0, 0.3, N_DAYS)[day]), 1)
    found = dwell(times, np.zeros(len(day), bool), day, person_s=np.bincount(day, weights=times), long_s=30.0)
    over, of = np.bincount(day, weights=times > 30.0), np.bincount(day)
    share = over.sum() / of.sum()
    se_of_log = np.sqrt(N_DAYS / (N_DAYS - 1) * ((over - share * of) ** 2).sum()) / of.sum() / share
    half = scipy.stats.t.ppf(0.975, N_DAYS - 1) * se_of_log / -np.log(share)
    assert found.long_share.value == pytest.approx(share)
    assert found.long_share.lo == pytest.approx(share ** np.exp(half), rel=1e-6)
    assert found.long_share.hi == pytest.approx(share ** np.exp(-half), rel=1e-6)


@pytest.mark.parametrize("cut_per_s", [0.0, 0.02])
def test_intervals_hold_the_true_median_however_many_tracks_are_cut(cut_per_s: float) -> None:
    world = World("half cut", cut_per_s=cut_per_s)
    median_s, p90_s, share, _ = world.truth(120.0)
    held = np.zeros(3)
    for seed in range(60):
        found = dwell_of(world, seed=seed)
        for k, (q, true) in enumerate(((found.median, median_s), (found.p90, p90_s))):
            held[k] += (q.lo or 0) <= true and (q.hi is None or true <= q.hi)
        long = found.long_share
        held[2] += long.value is None or (long.lo is not None and long.hi is not None and long.lo <= share <= long.hi)
    assert (held >= 52).all()  # 95 % of 60 is 57; 52 is exceeded with probability .997


def test_a_naive_median_of_pieces_is_far_too_short_where_tracks_are_cut() -> None:
    world = World("half cut", cut_per_s=0.02)
    true_s = world.truth(120.0)[0]
    seen = see(world, n_days=28, seed=1)
    assert np.median(seen.pieces_s) < 0.7 * true_s
    assert dwell_of(world, seed=1, n_days=28).median.value == pytest.approx(true_s, rel=0.15)


def test_little_agrees_where_all_entries_are_seen_and_not_where_a_third_is_not() -> None:
    cut, unseen = (World("", cut_per_s=0.02, unseen=share) for share in (0.0, 0.33))
    agrees = [dwell_of(cut, seed=seed, n_days=14).little.agrees for seed in range(20)]
    assert agrees.count(False) <= 2
    wrong = [dwell_of(unseen, seed=seed, n_days=14).little for seed in range(20)]
    assert sum(w.agrees is False for w in wrong) >= 18
    assert all(w.value is not None and w.value > 1 for w in wrong)


def test_an_empty_or_small_area_has_a_reason_and_no_number() -> None:
    found = dwell([], [], [], person_s=[0.0] * N_DAYS, long_s=60.0)
    assert (found.state, found.median.value, found.little.value) == ("not_enough_data", None, None)
    assert reason_text(found.reason) == "needs at least 30 visits, has 0"
    every = dwell([5.0] * 40, [True] * 40, np.arange(40) % 5, person_s=[40.0] * 5, long_s=60.0)
    assert reason_text(every.reason) == "all 40 tracks are lost inside the area"
    short = dwell(np.arange(1.0, 41.0), [False] * 40, [0, 1] * 20, person_s=[400.0] * 2, long_s=10.0)
    assert (short.state, short.median.value, short.median.lo) == ("not_enough_data", 20.0, None)
    assert reason_text(short.reason) == "an interval needs at least 5 days with visits, has 2"


def test_what_lies_beyond_the_curve_is_unknown_and_not_its_end() -> None:
    times = np.r_[np.full(60, 10.0), np.full(60, 20.0)]
    cut = np.r_[np.zeros(60, bool), np.ones(60, bool)]
    found = dwell(times, cut, np.arange(120) % N_DAYS, person_s=np.full(N_DAYS, 300.0), long_s=60.0)
    assert found.median.value == 10.0
    assert (found.p90.value, found.long_share.value) == (None, None)
    assert reason_text(found.long_share.reason) == "nobody was followed for longer than 20 s"
    assert reason_text(found.little.by_tracks.reason) == "50% of visits outlast all tracks"


@pytest.mark.parametrize("day", [[0, 1], [0, 9, 0], [-1, 0, 0]])
def test_shapes_that_do_not_fit_are_refused(day: list[int]) -> None:
    with pytest.raises(ValueError, match=r"every visit|a dwell time"):
        dwell([1.0, 2.0, 3.0], [False] * 3, day, person_s=[1.0, 1.0], long_s=60.0)
