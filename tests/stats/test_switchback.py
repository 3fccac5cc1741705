"""Days in turn: the test is exact by its coins alone, and the interval is what the test does not reject."""

from __future__ import annotations

from itertools import product

import numpy as np
import numpy.typing as npt
import pytest

from vsd_analytics.stats.switchback import (
    coins,
    log_effects,
    pairs_needed,
    switchback_effect,
    switchback_power,
)

Floats = npt.NDArray[np.float64]


def days(n_pairs: int, *, seed: int = 1, sd: float = 0.3) -> Floats:
    return np.exp(np.random.default_rng(seed).normal(0, sd, (n_pairs, 2)))


def turned(y: Floats, signs: npt.ArrayLike) -> Floats:
    """Return the same days with other coins: where a sign is -1, the two days of the pair change places."""
    return np.where(np.asarray(signs)[:, None] > 0, y, y[:, ::-1])


def test_without_an_effect_each_p_value_is_as_likely_as_the_next() -> None:
    """Days of any kind, all 128 ways in which seven coins may fall: a share a of them has p of at most a."""
    y = np.exp(np.cumsum(np.random.default_rng(3).normal(0, 1, 14))).reshape(7, 2)  # each day resembles the one before
    every = np.stack([turned(y, signs) for signs in product((1, -1), repeat=7)])
    p = np.sort(log_effects(every, confidence=0.95)[3])
    assert p == pytest.approx(np.repeat(np.arange(1, 65) / 64, 2))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_interval_holds_the_ratios_that_the_randomisation_test_does_not_reject(seed: int) -> None:
    y = days(9, seed=seed)
    found = switchback_effect(y)
    assert found.lo is not None
    assert found.hi is not None
    d, signs = np.log(y[:, 0] / y[:, 1]), np.array(list(product((1, -1), repeat=9)))
    for theta in (found.lo * 0.999, found.lo * 1.001, found.hi * 0.999, found.hi * 1.001):
        left = d - np.log(theta)
        sums = signs @ left
        p = min((sums >= sums[0]).mean(), (sums <= sums[0]).mean())  # the first signs are those of the coins
        assert (p > 0.025) == (found.lo <= theta <= found.hi), theta


def test_a_day_without_violations_is_read_by_totals_and_the_interval_is_still_that_of_the_test() -> None:
    y = days(9)
    y[4, 0] = 0.0
    found = switchback_effect(y)
    assert found.is_by_totals
    assert found.value == pytest.approx(y[:, 0].sum() / y[:, 1].sum())
    assert found.lo is not None
    assert found.hi is not None
    signs = np.array(list(product((1, -1), repeat=9)))
    for theta in (found.lo * 0.999, found.lo * 1.001, found.hi * 0.999, found.hi * 1.001):
        left = y[:, 0] / theta - y[:, 1]
        sums = signs @ left
        p = min((sums >= sums[0]).mean(), (sums <= sums[0]).mean())  # the first signs are those of the coins
        assert (p > 0.025) == (found.lo <= theta <= found.hi), theta


def test_what_both_days_of_a_pair_feel_changes_nothing() -> None:
    y = days(8)
    season = np.linspace(0.2, 5, 8)[:, None]
    assert switchback_effect(y * season).value == pytest.approx(switchback_effect(y).value)
    assert switchback_effect(y * season).p_value == switchback_effect(y).p_value


def test_with_and_without_exchanged_give_the_inverse_ratio() -> None:
    one, other = switchback_effect(days(10)), switchback_effect(days(10)[:, ::-1])
    assert (other.value, other.lo, other.hi) == pytest.approx((1 / one.value, 1 / one.hi, 1 / one.lo))  # type: ignore[operator]
    assert other.p_value == one.p_value


def test_a_planted_fall_is_found_and_lies_in_the_interval() -> None:
    y = days(28, sd=0.2)
    y[:, 0] *= 0.7
    found = switchback_effect(y)
    assert found.verdict == "clear_fall"
    assert not found.is_exact
    assert found.lo is not None
    assert found.hi is not None
    assert found.lo < 0.7 < found.hi < 1


def test_drawn_assignments_say_what_all_of_them_say() -> None:
    every = days(14, seed=4)[None]
    exact, drawn = (np.concatenate(log_effects(every, confidence=0.95, most=most)) for most in (20_000, 8000))
    assert drawn == pytest.approx(exact, abs=0.02)
    assert (drawn != exact).any()


@pytest.mark.parametrize(
    ("y", "code"),
    [
        (days(6), "switchback.few_days"),
        (np.zeros((8, 2)), "switchback.no_violation"),
        (np.tile([1.0, 0.0], (8, 1)), "switchback.none_without"),
    ],
)
def test_days_that_cannot_tell_say_why(y: Floats, code: str) -> None:
    found = switchback_effect(y)
    assert (found.value, found.state) == (None, "not_enough_data")
    assert found.reason is not None
    assert found.reason.code == code


def test_seven_pairs_are_needed_and_more_for_a_higher_confidence() -> None:
    assert [pairs_needed(c) for c in (0.8, 0.95, 0.99, 0.999)] == [7, 7, 8, 11]
    for confidence in (0.95, 0.99, 0.999):
        found = switchback_effect(days(pairs_needed(confidence)), confidence=confidence)
        assert found.lo is not None
        assert found.lo > 0


def test_the_same_seed_gives_the_same_coins() -> None:
    assert (coins(40, seed=1) == coins(40, seed=1)).all()
    assert (coins(40, seed=1) != coins(40, seed=2)).any()


def test_power_grows_with_days_and_with_the_effect() -> None:
    past = days(40, sd=0.4)
    powers = [
        switchback_power(past, theta, n_pairs=n).power for theta, n in ((0.9, 10), (0.7, 10), (0.7, 28), (1.5, 28))
    ]
    assert powers[0] < powers[1] < powers[2]
    assert powers[3] > 0.8, "a rise is looked for upwards"
    foreseen = switchback_power(past, 0.7, n_pairs=28)
    assert foreseen.theta_lo < 0.7 < foreseen.theta_hi
