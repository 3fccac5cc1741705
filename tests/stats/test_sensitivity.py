"""What an error of the distance does to a count, against draws with known truth."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsd_analytics.stats.sensitivity import crossings, true_records


def test_expected_crossings_are_those_of_many_draws() -> None:
    rng = np.random.default_rng(3)
    measured = rng.integers(500, 2500, 4000)
    mm, n = np.unique(measured, return_counts=True)
    found = crossings(mm, n, threshold_mm=2000, distance_sd_m=0.15, reach_mm=2500)
    draws = measured + 0.5 + rng.normal(0, 150, (400, len(measured)))
    near = measured < 2000
    assert found.violation_records == near.sum()
    assert found.leaving == pytest.approx((draws[:, near] >= 2000).sum(axis=1).mean(), rel=0.02)
    assert found.entering == pytest.approx((draws[:, ~near] < 2000).sum(axis=1).mean(), rel=0.02)
    assert found.expected == pytest.approx((draws < 2000).sum(axis=1).mean(), rel=0.01)
    assert found.is_reach_full


def test_truth_blurred_by_a_known_error_is_found_again_within_the_bounds() -> None:
    """Crowds thicken towards the threshold from below: the raw count is off, the truth lies between lo and hi."""
    rng = np.random.default_rng(5)
    truth = 2500 - np.abs(rng.normal(0, 500, 50_000))
    measured = np.floor(truth + rng.normal(0, 100, truth.shape)).astype(int)
    mm, n = np.unique(measured[measured <= 2500], return_counts=True)
    found = crossings(mm, n, threshold_mm=2000, distance_sd_m=0.1, reach_mm=2500)
    assert found.lo < (truth < 2000).sum() < found.hi


@given(sd=st.floats(0.01, 0.4), m=st.integers(0, 1999))
def test_a_record_flips_the_likelier_the_nearer_to_the_threshold(sd: float, m: int) -> None:
    one, nearer = (crossings([d], [1], threshold_mm=2000, distance_sd_m=sd, reach_mm=2500) for d in (m, 1999))
    assert 0 <= one.leaving <= nearer.leaving <= 0.5
    assert one.entering == 0


def test_distances_cut_short_say_so() -> None:
    assert not crossings([1900], [1], threshold_mm=2000, distance_sd_m=0.2, reach_mm=2500).is_reach_full


def test_nobody_near_is_no_share() -> None:
    found = crossings([], [], threshold_mm=2000, distance_sd_m=0.1, reach_mm=2500)
    assert (found.violation_records, found.flipped_share) == (0, None)


@pytest.mark.parametrize("sd", [0.0, -1.0, float("nan")])
def test_no_spread_is_refused(sd: float) -> None:
    with pytest.raises(ValueError, match="distance_sd_m"):
        crossings([1], [1], threshold_mm=2000, distance_sd_m=sd, reach_mm=2500)


def test_precision_takes_away_and_recall_adds() -> None:
    assert true_records(1000, precision=0.8, recall=0.8) == pytest.approx(1000)
    assert true_records(1000, precision=0.9, recall=0.75) == pytest.approx(1200)
    with pytest.raises(ValueError, match="recall"):
        true_records(1000, precision=1, recall=0)
