"""A tracker that cuts another share of ids widens what is known of counts; days that differ by chance do not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from vsd_analytics.answer import Reason
from vsd_analytics.stats.changes import compare_violation_rates
from vsd_analytics.stats.cut_share import MOST_SHIFT, changed_cut_share, widened
from vsd_analytics.stats.estimates import ChangeEstimate, no_change


def days(share: float, *, seed: int, n: int = 7, spread: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    ends = rng.integers(300, 900, n).astype(float)
    return ends * (share + rng.normal(0, spread, n)), ends


def test_a_share_that_rises_clearly_is_named_with_both_values() -> None:
    found = changed_cut_share(days(0.05, seed=1), days(0.15, seed=2))
    assert found is not None
    assert (found.before, found.now) == (pytest.approx(0.05, abs=0.02), pytest.approx(0.15, abs=0.02))


def test_a_small_or_a_noisy_difference_is_none() -> None:
    assert changed_cut_share(days(0.05, seed=1), days(0.07, seed=2)) is None
    assert changed_cut_share(days(0.05, seed=1, spread=0.1), days(0.12, seed=2, spread=0.1)) is None


def test_periods_without_ids_or_with_one_day_say_nothing() -> None:
    none = np.zeros(0), np.zeros(0)
    assert changed_cut_share(none, days(0.3, seed=1)) is None
    assert changed_cut_share(days(0.01, seed=1, n=1), days(0.3, seed=2)) is None


def fall(share: float) -> ChangeEstimate:
    n, x = np.full((1, 7), 100.0) + np.arange(7), np.full((1, 7), 10.0)
    return compare_violation_rates(n, x, n * (1 - share), x)


def test_a_fall_within_what_cuts_can_do_is_no_longer_clear_and_a_large_one_is() -> None:
    large = fall(0.5)
    small = replace(large, value=0.9, lo=0.85, hi=0.95)
    assert (small.verdict, large.verdict) == ("clear_fall", "clear_fall")
    assert widened(small, confidence=0.95).verdict != "clear_fall"
    assert widened(large, confidence=0.95).verdict == "clear_fall"
    wide = widened(large, confidence=0.95)
    assert wide.value == large.value
    assert large.hi is not None
    assert wide.hi == pytest.approx(large.hi * (1 + MOST_SHIFT))


def test_what_has_no_range_stays_without_one() -> None:
    missing = no_change(Reason("change.few"))
    assert widened(missing, confidence=0.95) == missing
    bare = replace(fall(0.1), hi=None)
    assert widened(bare, confidence=0.95) == bare
