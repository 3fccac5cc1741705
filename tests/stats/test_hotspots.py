"""The hotspot test against independent oracles, and its rules of fairness."""

from __future__ import annotations

import math

import numpy as np
import pytest
from floor_worlds import PLANTED_M, People, Variation, away, cells, inner, people
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize, stats

from vsd_analytics.stats.false_discovery import benjamini_hochberg
from vsd_analytics.stats.hotspots import PRIOR_DF, Hotspots, hotspots, place_rate
from vsd_analytics.stats.nonnegative import nonnegative_factors

PLANTED = Variation(ratio=2.5)
EVEN = Variation()


def small_floor(seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return time in violation, person-time, that of mixing and recorded cells of 15 days; a part misses 3 days."""
    rng = np.random.default_rng(seed)
    x = rng.gamma(4, 0.5, (15, 5, 7))
    m = x * rng.uniform(0.1, 0.5, (5, 7))
    v = rng.gamma(9, 1 / 9, x.shape) * (0.1 * x + 0.8 * m)
    recorded = np.ones(x.shape, dtype=bool)
    recorded[2:5, :, 5:] = False
    return v, x, m, recorded


def found_in(world: Variation | People, seed: int) -> tuple[Hotspots, tuple[int, int]]:
    rng = np.random.default_rng(seed)
    cube = cells(world, rng) if isinstance(world, Variation) else people(world, rng)
    found = hotspots(cube.violation_h, cube.exposure_h, cube.mixed_h, sigma_cells=1.0, is_eligible=inner())
    return found, cube.place


def smoothed(day: np.ndarray, sigma: float) -> np.ndarray:
    """Smooth by the definition: weights of a Gaussian of three standard deviations sum to one; beyond the edge is 0."""
    reach = int(3 * sigma + 0.5)
    weight = np.array([math.exp(-k * k / (2 * sigma * sigma)) for k in range(-reach, reach + 1)])
    weight /= weight.sum()
    made = np.zeros_like(day)
    for (r, c), _ in np.ndenumerate(day):
        for i in range(-reach, reach + 1):
            for j in range(-reach, reach + 1):
                if 0 <= r + i < day.shape[0] and 0 <= c + j < day.shape[1]:
                    made[r, c] += weight[i + reach] * weight[j + reach] * day[r + i, c + j]
    return made


@pytest.mark.parametrize(("company", "mixing"), [(0.1, 0.8), (-0.2, 0.8), (0.4, -0.3), (-0.1, -0.1), (0.0, 0.5)])
@pytest.mark.parametrize("noise", [1e-6, 0.3])
def test_what_crowding_explains_is_fitted_as_by_scipy(company: float, mixing: float, noise: float) -> None:
    rng = np.random.default_rng(5)
    for n in (2, 3, 40):
        x = rng.gamma(2, 1, n)
        parts = np.column_stack([x, x * rng.uniform(0.1, 0.5, n)])
        whole = parts @ [company, mixing] + rng.normal(0, noise, n)
        fit = optimize.lsq_linear(parts, whole, (0, np.inf), method="bvls", tol=1e-15)  # nnls of SciPy 1.15.0 is wrong
        assert nonnegative_factors(parts, whole) == pytest.approx(fit.x, rel=1e-9, abs=1e-12)
    alone = np.column_stack([x, 0 * x])  # nobody is in view together
    assert nonnegative_factors(alone, 0.3 * x) == pytest.approx((0.3, 0.0))


def test_expected_time_t_and_q_equal_a_recomputation_from_the_definitions() -> None:
    v, x, m, recorded = small_floor()
    found = hotspots(v, x, m, sigma_cells=1.0, is_recorded=recorded, min_days=12)
    v, x, m = (np.where(recorded, a, 0.0) for a in (v, x, m))
    sums = [smoothed(a.sum(axis=0), 1.0).ravel() for a in (v, x, m)]
    fit = optimize.lsq_linear(np.column_stack(sums[1:]) / np.sqrt(sums[2])[:, None], sums[0] / np.sqrt(sums[2]), (0, 9))
    explained = fit.x[0] * x + fit.x[1] * m
    explained *= (v.sum(axis=(1, 2)) / explained.sum(axis=(1, 2)))[:, None, None]
    mu = np.array([smoothed(day, 1.0) for day in explained]) * recorded
    u = np.array([smoothed(day, 1.0) for day in v]) * recorded - mu
    n, total, expected = recorded.sum(axis=0), u.sum(axis=0), mu.sum(axis=0)
    spread = n / (n - 1) * ((u**2).sum(axis=0) - total**2 / n)
    slope, intercept = np.polyfit(expected.ravel(), (spread / expected).ravel(), 1)
    mean = float((spread / expected).mean())
    a, b = (intercept if intercept > 0 else 0.1 * mean, slope) if slope > 0 else (mean, 0.0)
    phi = found.explained.inflation
    own = (n - 1) / phi
    usual = (PRIOR_DF * (a * expected + b * expected**2) + own * spread) / (PRIOR_DF + own)
    t = total / np.sqrt(usual * phi * (n - 1) / (n - phi))
    assert found.cells.is_tested.all()
    np.testing.assert_allclose(found.cells.expected, expected, rtol=1e-4)
    np.testing.assert_allclose(found.cells.t, t, rtol=1e-3, atol=1e-3)
    p = stats.t.sf(found.cells.t, PRIOR_DF + own)
    np.testing.assert_allclose(found.cells.q, stats.false_discovery_control(p.ravel()).reshape(p.shape), rtol=1e-9)


def test_a_place_is_found_where_the_rest_of_the_floor_has_no_time_in_violation() -> None:
    rng = np.random.default_rng(2)
    x = rng.gamma(50, 1 / 50, (28, 10, 12))
    v = np.zeros_like(x)
    v[:, 4:6, 5:7] = 0.4 * x[:, 4:6, 5:7]
    (spot,) = hotspots(v, x, 0.1 * x, sigma_cells=1.0).spots
    assert (spot.row, spot.column) == (pytest.approx(4.5, abs=0.1), pytest.approx(5.5, abs=0.1))


def test_q_values_equal_scipys() -> None:
    rng = np.random.default_rng(1)
    for m in (1, 2, 7, 300):
        p = np.concatenate([rng.uniform(size=m), rng.uniform(size=m // 2) ** 6, [0.5, 0.5]])
        np.testing.assert_allclose(benjamini_hochberg(p), stats.false_discovery_control(p), rtol=1e-12)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.01, 100))
def test_unit_of_time_changes_nothing(scale: float) -> None:
    v, x, m, _ = small_floor()
    first, other = (
        hotspots(v * k, x * k, m * k, sigma_cells=1.0, min_exposure_h=0.0, min_ratio=1.0, q_max=0.5) for k in (1, scale)
    )
    np.testing.assert_allclose(first.cells.t, other.cells.t, rtol=1e-6, atol=1e-9)


def test_a_multiple_of_mixing_and_company_that_people_keep_everywhere_are_explained() -> None:
    _, x, m, _ = small_floor()
    found = hotspots(0.3 * x + 0.7 * m, x, m, sigma_cells=1.0)
    np.testing.assert_allclose(found.cells.ratio, 1.0, rtol=1e-9)


def test_days_that_resemble_each_other_widen_what_counts_as_chance() -> None:
    phi = {
        correlation: np.mean([found_in(Variation(correlation=correlation), s)[0].explained.inflation for s in range(6)])
        for correlation in (0.0, 0.5, 0.8)
    }
    assert phi[0.0] < 1.5 < phi[0.5] < 3 < phi[0.8]


@pytest.mark.parametrize(
    "world",
    [
        EVEN,
        Variation(correlation=0.8),
        Variation(week_sd=0.22),
        People(),
        People(peaks=3),
        People(in_company=1, is_corridor=True),
        People(in_company=0.4, peaks=3),
        People(in_company=0.4, noise_m=(0.1, 0.5)),
    ],
)
def test_crowds_couples_noise_and_patches_of_days_are_no_hotspot(world: Variation | People) -> None:
    assert [found_in(world, seed)[0].spots for seed in range(4)] == [()] * 4


def test_planted_hotspot_is_found_where_it_is() -> None:
    found, place = found_in(PLANTED, 5)
    (spot,) = found.spots
    assert math.dist((spot.row, spot.column), place) <= 1
    assert found.cells.is_hot[away(place) <= PLANTED_M].all()
    assert spot.rate.lo is not None
    assert spot.rate.lo > 1.25


def test_a_place_fixed_a_week_ago_is_no_hotspot_any_more() -> None:
    for seed in range(6):
        assert found_in(Variation(ratio=2.5, fixed_days_ago=7), seed)[0].spots == ()


def test_a_day_on_which_all_is_riskier_is_no_hotspot() -> None:
    cube = cells(EVEN, np.random.default_rng(2))
    close = cube.violation_h.copy()
    close[3] = np.minimum(2.5 * close[3], cube.exposure_h[3])
    assert hotspots(close, cube.exposure_h, cube.mixed_h, sigma_cells=1.0, is_eligible=inner()).spots == ()


def test_missing_days_are_not_zero() -> None:
    cube = cells(PLANTED, np.random.default_rng(5))
    recorded = np.ones(cube.violation_h.shape, dtype=bool)
    recorded[:8, :, max(0, cube.place[1] - 6) : cube.place[1] + 6] = False
    wild = [np.where(recorded, a, 1e4) for a in (cube.violation_h, cube.exposure_h, cube.mixed_h)]
    gone = [np.where(recorded, a, 0.0) for a in (cube.violation_h, cube.exposure_h, cube.mixed_h)]
    found, other, zeros = (
        hotspots(*a, sigma_cells=1.0, is_recorded=ok) for a, ok in ((gone, recorded), (wild, recorded), (gone, None))
    )
    assert found.spots[0].rate.n_days == 20
    np.testing.assert_array_equal(other.cells.t, found.cells.t)
    assert zeros.spots[0].rate.n_days == 28


def test_cells_with_few_days_or_little_exposure_or_left_out_are_not_tested() -> None:
    v, x, m, recorded = small_floor()
    few = hotspots(v, x, m, sigma_cells=1.0, is_recorded=recorded, min_days=13).cells
    assert not few.is_tested[:, 5:].any()
    assert few.is_tested[:, :5].all()
    assert np.isnan(few.ratio[:, 5:]).all()
    assert not hotspots(v / 1e4, x / 1e4, m / 1e4, sigma_cells=1.0).cells.is_tested.any()
    eligible = np.ones(x.shape[1:], dtype=bool)
    eligible[2, 2] = False
    part = hotspots(v, x, m, sigma_cells=1.0, is_eligible=eligible).cells
    assert not part.is_tested[2, 2]
    assert part.is_tested.sum() == part.is_tested.size - 1


def test_nothing_recorded_gives_nothing() -> None:
    none, some = np.zeros((28, 4, 4)), np.ones((28, 4, 4))
    assert hotspots(none, none, none, sigma_cells=1.0).n_days == 0
    for x in (none, some):
        found = hotspots(none, x, none, sigma_cells=1.0)
        assert (found.spots, found.cells.is_tested.any()) == ((), False)


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_impossible_numbers_are_refused(bad: float) -> None:
    v, x, m, _ = small_floor()
    v[0, 0, 0] = bad
    with pytest.raises(ValueError, match="finite"):
        hotspots(v, x, m, sigma_cells=1.0)


def test_shapes_must_fit() -> None:
    a, b = np.zeros((3, 4, 4)), np.zeros((3, 4, 5))
    with pytest.raises(ValueError, match="one shape"):
        hotspots(a, b, a, sigma_cells=1.0)
    with pytest.raises(ValueError, match="is_recorded"):
        hotspots(a, a, a, sigma_cells=1.0, is_recorded=np.ones((3, 4)))


def test_interval_of_a_place_is_that_of_a_ratio_over_days_as_clusters() -> None:
    v, x, m, _ = small_floor()
    found = hotspots(v, x, m, sigma_cells=1.0, min_days=12)
    inside = np.zeros(x.shape[1:], dtype=bool)
    inside[1:3, 1:4] = True
    place = place_rate(found.explained, inside)
    assert place is not None
    v_d, e_d = v[:, inside].sum(axis=1), found.explained.expected_h[:, inside].sum(axis=1)
    assert place.value == pytest.approx(v_d.sum() / e_d.sum())
    phi, rest = found.explained.inflation, v_d - place.value * e_d
    sd = math.sqrt(15 / 14 * float(rest @ rest) * phi * 14 / (15 - phi)) / v_d.sum()
    assert place.lo is not None
    assert math.log(place.value / place.lo) == pytest.approx(stats.t.ppf(0.975, 14) * sd)


def test_a_place_nobody_was_in_has_no_rate() -> None:
    v, x, m, _ = small_floor()
    for a in (v, x, m):
        a[:, 0, 0] = 0
    inside = np.zeros(x.shape[1:], dtype=bool)
    inside[0, 0] = True
    assert place_rate(hotspots(v, x, m, sigma_cells=1.0).explained, inside) is None
