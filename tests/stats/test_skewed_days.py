"""Where coaches come on few days, a rate's range reaches farther up; calm days make it no wider."""

from __future__ import annotations

import numpy as np
import pytest

from vsd_analytics.stats.rates import violation_rate

WEEKDAY = np.arange(42) % 7


def week(n: np.ndarray, *, has_history: bool = True) -> tuple[float, float, float]:
    """Return the rate of the last of six weeks of a camera and its ends."""
    hours = np.full((1, 42), 10.0)
    past = {"weekday": WEEKDAY[35:], "history_n": n[None, :35], "history_x_h": hours[:, :35]}
    given = {**past, "history_weekday": WEEKDAY[:35]} if has_history else {}
    found = violation_rate(n[None, 35:], hours[:, 35:], **given)  # type: ignore[arg-type]
    assert found.value is not None
    assert found.lo is not None
    assert found.hi is not None
    return found.value, found.lo, found.hi


def days(seed: int, *, coach: float) -> tuple[np.ndarray, float]:
    rng = np.random.default_rng(seed)
    mean = 100 * (1 + 0.2 * np.sin(WEEKDAY)) * rng.gamma(100, 0.01, 42)
    parties = (rng.random(42) < 0.2) * rng.gamma(2, 0.5, 42) * coach / 0.2
    return rng.poisson(mean + 100 * parties).astype(float), 10 * (1 + coach + 0.2 * np.sin(np.arange(7)).mean())


def test_ranges_hold_the_truth_where_coaches_make_a_quarter() -> None:
    inside = []
    for seed in range(300):
        n, truth = days(seed, coach=1 / 3)
        _, lo, hi = week(n)
        inside.append(lo <= truth <= hi)
    assert np.mean(inside) >= 0.93


def test_calm_days_have_a_range_as_far_up_as_down() -> None:
    arms = []
    for seed in range(40):
        value, lo, hi = week(days(seed, coach=0.0)[0])
        arms.append(np.log(hi / value) / np.log(value / lo))
    assert np.median(arms) == pytest.approx(1.0, abs=0.1)


def test_equal_days_give_equal_ranges() -> None:
    n, _ = days(1, coach=1 / 3)
    assert week(n) == week(n.copy())
