"""What a covariate does to violations within weeks, a week's change at an equal value, and the usual range there."""

from __future__ import annotations

import math

import numpy as np
import pytest
from context_worlds import ContextWorld, draw

from vsd_analytics.answer import Reason
from vsd_analytics.stats.changes import compare_violation_rates
from vsd_analytics.stats.covariate import (
    MIN_WEEKS,
    change_at_equal_covariate,
    covariate_effect,
    usual_range_at,
)
from vsd_analytics.stats.usual import usual_range
from vsd_analytics.stats.value_per import value_per

BETA = 0.8
FEW = Reason("context.hours")


def exact(n_weeks: int = 16, *, beta: float = BETA, seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return violations without any noise, hours and covariate: season, weekdays and covariate make all of them."""
    rng = np.random.default_rng(seed)
    z = rng.normal(0, 0.4, (n_weeks, 7)) + np.linspace(0, 3, n_weeks)[:, None]
    x_h = np.full((n_weeks, 7), 10.0)
    season, weekdays = np.linspace(3, 1, n_weeks)[:, None], np.array([0.0, 0.1, 0.1, 0.2, 0.4, 0.8, 0.5])
    return x_h * np.exp(season + weekdays + beta * z), x_h, z


def test_the_effect_is_that_of_days_whatever_season_and_weekdays_do() -> None:
    found = covariate_effect(*exact())
    assert found.value == pytest.approx(BETA, abs=1e-6)
    assert (found.n_weeks, found.n_days, found.state) == (16, 112, "ok")


def test_the_effect_equals_a_poisson_fit_with_dummies_by_another_route() -> None:
    n, x_h, z = exact()
    n = np.random.default_rng(5).poisson(n).astype(float)
    found = covariate_effect(n, x_h, z)
    assert found.value is not None
    # at the estimate the score of z with weeks and weekdays profiled out is 0: profile by iterated scaling
    a, b = np.zeros(16), np.zeros(7)
    base = x_h * np.exp(found.value * z)
    for _ in range(500):
        a = np.log(n.sum(axis=1) / (base * np.exp(b)).sum(axis=1))
        b = np.log(n.sum(axis=0) / (base * np.exp(a[:, None])).sum(axis=0))
    mean = base * np.exp(a[:, None] + b)
    assert float(((n - mean) * z).sum()) == pytest.approx(0, abs=1e-3 * math.sqrt(n.sum()))


def test_the_unit_of_a_covariate_does_not_matter() -> None:
    n, x_h, z = exact()
    n = np.random.default_rng(6).poisson(n).astype(float)
    plain, other = covariate_effect(n, x_h, z), covariate_effect(n, x_h, 1000 * z + 7)
    assert (plain.value, plain.lo, plain.hi) == pytest.approx([1000 * v for v in (other.value, other.lo, other.hi)])


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda n, x, z: (n[: MIN_WEEKS - 1], x[: MIN_WEEKS - 1], z[: MIN_WEEKS - 1]), "context.weeks"),
        (lambda n, x, z: (n / n.sum() * 99, x, z), "context.events"),
        (lambda n, x, z: (n, x, np.repeat(z[:, :1], 7, axis=1)), "context.constant"),
        (lambda n, x, z: (n, x, np.where(np.arange(16)[:, None] < 9, np.nan, z)), "context.weeks"),
    ],
)
def test_an_effect_that_cannot_be_told_is_refused_with_the_reason(change, code) -> None:
    found = covariate_effect(*change(*exact()))
    assert found.value is None
    assert found.reason is not None
    assert found.reason.code == code


def two_weeks(z_now: float) -> tuple:
    n, x_h, z = exact(18)
    z[-1] += z_now - z[-1].mean()
    n[-1] = 10 * np.exp(1.0 + np.array([0.0, 0.1, 0.1, 0.2, 0.4, 0.8, 0.5]) + BETA * z[-1])
    return n, x_h, z


def test_a_change_that_the_covariate_makes_is_none_at_an_equal_value() -> None:
    n, x_h, z = exact(18)
    weekdays = np.array([0.0, 0.1, 0.1, 0.2, 0.4, 0.8, 0.5])
    z[-2], z[-1] = 0.5, 2.0
    n[-2:] = 10 * np.exp(1.0 + weekdays + BETA * z[-2:])
    effect = covariate_effect(n[1:-1], x_h[1:-1], z[1:-1])
    one = [(n[k][None], x_h[k][None]) for k in (-2, -1)]
    plain = compare_violation_rates(*one[0], *one[1])
    equal = change_at_equal_covariate(*one, z[-2], z[-1], effect)
    assert plain.value == pytest.approx(math.exp(1.5 * BETA), rel=1e-6)
    assert equal.value == pytest.approx(1.0, rel=1e-4)


def test_an_uncertain_effect_widens_the_change_by_its_own_interval() -> None:
    n, x_h, z = exact(18)
    n = np.random.default_rng(8).poisson(n).astype(float)
    effect = covariate_effect(n[1:-1], x_h[1:-1], z[1:-1])
    one = [(n[k][None], x_h[k][None]) for k in (-2, -1)]
    shifted = z[-2] + 1.0
    assert effect.z_lo is not None
    assert effect.z_hi is not None
    near = change_at_equal_covariate(*one, z[-2], z[-2], effect)
    far = change_at_equal_covariate(*one, z[-2] - 1.0, z[-2], effect)
    assert shifted.shape == (7,)
    assert near.lo is not None
    assert far.lo is not None
    half = [math.log(c.hi / c.lo) / 2 for c in (near, far)]
    assert half[1] > half[0]


@pytest.mark.parametrize(("z_now", "code"), [(np.nan, "context.incomplete"), (99.0, "context.outside")])
def test_a_day_without_value_or_a_week_outside_is_refused(z_now: float, code: str) -> None:
    n, x_h, z = exact(18)
    effect = covariate_effect(n[1:-1], x_h[1:-1], z[1:-1])
    z[-1, 3:] = z_now
    one = [(n[k][None], x_h[k][None]) for k in (-2, -1)]
    found = change_at_equal_covariate(*one, z[-2], z[-1], effect)
    assert found.value is None
    assert found.reason is not None
    assert found.reason.code == code


def test_the_usual_range_at_a_value_moves_with_the_value() -> None:
    n, x_h, z = exact(17)
    noisy = np.random.default_rng(9).poisson(n).astype(float)
    effect = covariate_effect(noisy[:-1], x_h[:-1], z[:-1])
    rates = [float(n[k].sum() / x_h[k].sum()) for k in range(5, 16)]
    means = [float(z[k].mean()) for k in range(5, 16)]
    low, high = (usual_range_at(rates, means, z_now, effect) for z_now in (1.0, 2.0))
    assert low is not None
    assert high is not None
    assert effect.value is not None
    middles = [math.log(r.lo * r.hi) / 2 for r in (low, high)]
    assert middles[1] - middles[0] == pytest.approx(effect.value, rel=1e-6)
    assert usual_range_at(rates, means, 99.0, effect) is None
    assert usual_range(rates) is not None


@pytest.mark.parametrize("series", ["temperature", "visitors"])
def test_a_series_that_does_nothing_has_a_clear_effect_in_one_of_twenty_at_most(series: str) -> None:
    drawn = draw(ContextWorld("nothing"), 150, 44)
    clear = []
    for site in range(150):
        z = drawn.temperature[site] if series == "temperature" else np.log(drawn.visitors[site])
        for before in (slice(4, 20), slice(35, 51)):
            found = covariate_effect(drawn.violations[site, before], drawn.x_h[site, before], z[before])
            assert found.lo is not None
            assert found.hi is not None
            clear.append(found.lo > 0 or found.hi < 0)
    assert np.mean(clear) <= 0.08  # 5 % and what 300 draws leave open (binomial, 99 %)


def test_a_value_per_visit_does_not_depend_on_the_unit_of_money() -> None:
    values, people = [120.0, 90, 100, 140, 200, 260, 180], [40.0, 31, 33, 45, 70, 85, 61]
    euros = value_per(values, people, least=30, why_few=FEW)
    thousands = value_per(np.array(values) / 1000, people, least=30, why_few=FEW)
    assert euros.value == pytest.approx(sum(values) / sum(people))
    assert [euros.lo, euros.hi] == pytest.approx([1000 * thousands.lo, 1000 * thousands.hi])


@pytest.mark.parametrize(
    ("values", "people", "value", "code"),
    [
        ([1.0] * 7, [4.0] * 7, None, "context.hours"),
        ([-1.0] + [9.0] * 6, [9.0] * 7, None, "context.negative"),
        ([0.0] * 7, [9.0] * 7, 0.0, "context.zero"),
        ([9.0] * 7, [20.0, 20.0, 0, 0, 0, 0, 0], 0.45, "level.days"),
    ],
)
def test_a_value_per_visit_that_cannot_be_told_says_why(values, people, value, code) -> None:
    found = value_per(values, people, least=30, why_few=FEW)
    assert found.value == (value if value is None else pytest.approx(value))
    assert found.lo is None
    assert found.reason is not None
    assert found.reason.code == code
