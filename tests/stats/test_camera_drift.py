"""A camera that loses people beside its neighbours is named; what all share and hours missed are no drift."""

from __future__ import annotations

import numpy as np
import pytest

from vsd_analytics.stats.camera_drift import Drift, drifts, is_watched, shares

N_REFERENCE, N_WEEKS, N_HOURS = 12, 20, 14


def people(n_cameras: int = 5, *, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    shape = (n_cameras, N_WEEKS, N_HOURS)
    profile = rng.uniform(0.2, 5.0, (n_cameras, 1, N_HOURS))
    return 100.0 * profile * np.exp(rng.normal(0, 0.02, shape))


def found(counted: np.ndarray, recorded: np.ndarray | None = None) -> list[Drift | None]:
    known = np.ones(counted.shape, dtype=bool) if recorded is None else recorded
    return drifts(shares(counted, known, n_reference=N_REFERENCE), n_reference=N_REFERENCE)


@pytest.mark.parametrize("factor", [0.85, 1.2])
def test_the_camera_that_drifts_is_named_and_no_other(factor: float) -> None:
    counted = people()
    counted[2, 15:] *= factor
    drift = found(counted)
    assert [d is not None for d in drift] == [False, False, True, False, False]
    assert drift[2] is not None
    assert drift[2].since == 3
    assert np.sign(drift[2].change) == np.sign(factor - 1)


def test_what_the_whole_site_shares_is_no_drift() -> None:
    counted = people()
    counted[:, 12:] *= np.linspace(0.9, 0.4, 8)[:, None]
    assert found(counted) == [None] * 5


def test_hours_that_a_camera_missed_are_no_drift_though_they_were_its_busiest() -> None:
    counted = people()
    recorded = np.ones(counted.shape, dtype=bool)
    recorded[1, 13:, counted[1, 0].argmax()] = False
    assert found(counted, recorded) == [None] * 5
    taken_for_empty = np.where(recorded, counted, 0.0)
    assert found(taken_for_empty)[1] is not None


def test_a_camera_that_counts_nobody_any_more_has_drifted() -> None:
    counted = people()
    counted[0, 14:] = 0.0
    drift = found(counted)[0]
    assert drift is not None
    assert drift.change < -0.5


def test_a_shift_too_small_to_matter_is_not_named_however_clear() -> None:
    counted = people()
    counted[0, 12:] *= 0.96
    assert found(counted) == [None] * 5


def test_a_neighbour_that_drifts_does_not_make_others_drift() -> None:
    counted = people(4)
    counted[3, 12:] *= 0.5
    assert [d is not None for d in found(counted)] == [False, False, False, True]


def test_few_weeks_before_or_no_neighbour_is_not_watched() -> None:
    counted = people()
    recorded = np.ones(counted.shape, dtype=bool)
    recorded[4, :5] = False
    share = shares(counted, recorded, n_reference=N_REFERENCE)
    assert is_watched(share, n_reference=N_REFERENCE).tolist() == [True] * 4 + [False]
    alone = shares(counted[:1], recorded[:1], n_reference=N_REFERENCE)
    assert not is_watched(alone, n_reference=N_REFERENCE).any()
    assert drifts(alone, n_reference=N_REFERENCE) == [None]


def test_a_scale_of_counts_changes_nothing() -> None:
    counted = people()
    counted[2, 15:] *= 0.85
    scaled = counted * np.array([1, 7, 0.1, 3, 100.0])[:, None, None]
    one, other = found(counted)[2], found(scaled)[2]
    assert one is not None
    assert other is not None
    assert other.change == pytest.approx(one.change)
    assert other.since == one.since
