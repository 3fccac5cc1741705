"""The hotspot test against independent oracles, and its rules of fairness."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from prove_hotspots import RADIUS_M, World, draw, getis_ord
from scipy import stats

from vsd_analytics.stats.hotspots import PRIOR_DF, benjamini_hochberg, hotspots, place_rate

PLANTED = World(28, 1200.0, 0.10, 2.5)
EVEN = World(28, 1200.0, 0.10)


def smoothed(day: list[list[float]], sigma: float) -> list[list[float]]:
    """Smooth by the definition: weights of a Gaussian of three standard deviations sum to one; beyond the edge is 0."""
    reach = int(3 * sigma + 0.5)
    weight = [math.exp(-k * k / (2 * sigma * sigma)) for k in range(-reach, reach + 1)]
    weight = [w / sum(weight) for w in weight]
    n_rows, n_columns = len(day), len(day[0])
    return [
        [
            sum(
                weight[i + reach] * weight[j + reach] * day[r + i][c + j]
                for i in range(-reach, reach + 1)
                for j in range(-reach, reach + 1)
                if 0 <= r + i < n_rows and 0 <= c + j < n_columns
            )
            for c in range(n_columns)
        ]
        for r in range(n_rows)
    ]


def brute_force(n: np.ndarray, x: np.ndarray, recorded: np.ndarray, sigma: float) -> dict[tuple[int, int], list[float]]:
    """Return D, U, M and s^2 of every cell, straight from the definitions, in plain Python."""
    cells: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for day_n, day_x, day_ok in zip(n.tolist(), x.tolist(), recorded.tolist(), strict=True):
        keep_n = [[v if ok else 0.0 for v, ok in zip(*row, strict=True)] for row in zip(day_n, day_ok, strict=True)]
        keep_x = [[v if ok else 0.0 for v, ok in zip(*row, strict=True)] for row in zip(day_x, day_ok, strict=True)]
        rate = sum(map(sum, keep_n)) / sum(map(sum, keep_x))
        smooth_n, smooth_x = smoothed(keep_n, sigma), smoothed(keep_x, sigma)
        for r, row in enumerate(day_ok):
            for c, is_recorded in enumerate(row):
                if is_recorded:
                    mu = rate * smooth_x[r][c]
                    cells.setdefault((r, c), []).append((smooth_n[r][c] - mu, mu))
    found = {}
    for at, days in cells.items():
        total, expected = sum(u for u, _ in days), sum(m for _, m in days)
        squares = sum(u * u for u, _ in days)
        found[at] = [len(days), total, expected, len(days) / (len(days) - 1) * (squares - total**2 / len(days))]
    return found


def small_floor(seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return violations, person-hours and recorded cells of 15 days on 5 x 7 cells; a column of cells misses 3 days."""
    rng = np.random.default_rng(seed)
    x = rng.gamma(4, 0.5, (15, 5, 7))
    n = rng.poisson(3 * x).astype(float)
    recorded = np.ones(x.shape, dtype=bool)
    recorded[2:5, :, 5:] = False
    return n, x, recorded


def test_u_m_and_t_equal_a_recomputation_in_plain_python() -> None:
    n, x, recorded = small_floor()
    found = hotspots(n, x, sigma_cells=1.0, is_recorded=recorded, min_days=12)
    truth = brute_force(n, x, recorded, 1.0)
    assert found.cells.is_tested.all()
    # the variance function by numpy's own line fit of s^2 / M on M
    m, s2 = (np.array([row[k] for row in truth.values()]) for k in (2, 3))
    slope, intercept = np.polyfit(m, s2 / m, 1)
    b = max(slope, 0.0)
    a = float(np.mean(s2 / m)) if b == 0 else intercept if intercept > 0 else 0.1 * float(np.mean(s2 / m))
    for (r, c), (n_days, total, expected, spread) in truth.items():
        variance = (PRIOR_DF * (a * expected + b * expected**2) + (n_days - 1) * spread) / (PRIOR_DF + n_days - 1)
        assert found.cells.expected[r, c] == pytest.approx(expected, rel=1e-9)
        assert found.cells.observed[r, c] == pytest.approx(total + expected, rel=1e-9)
        assert found.cells.t[r, c] == pytest.approx(total / math.sqrt(variance), rel=1e-8)
    assert {row[0] for row in truth.values()} == {12, 15}


def test_q_values_equal_scipys() -> None:
    rng = np.random.default_rng(1)
    for m in (1, 2, 7, 300):
        p = np.concatenate([rng.uniform(size=m), rng.uniform(size=m // 2) ** 6, [0.5, 0.5]])
        np.testing.assert_allclose(benjamini_hochberg(p), stats.false_discovery_control(p), rtol=1e-12)


def test_q_of_cells_are_those_of_one_sided_t_tests() -> None:
    n, x, recorded = small_floor()
    cells = hotspots(n, x, sigma_cells=1.0, is_recorded=recorded, min_days=12).cells
    p = stats.t.sf(cells.t, PRIOR_DF + recorded.sum(axis=0) - 1)
    np.testing.assert_allclose(cells.q, stats.false_discovery_control(p.ravel()).reshape(p.shape), rtol=1e-9)


def test_smoothing_conserves_what_is_counted() -> None:
    n, x = np.zeros((14, 15, 15)), np.full((14, 15, 15), 1.0)
    n[:, 7, 7] = 10
    cells = hotspots(n, x, sigma_cells=1.0).cells
    assert cells.observed.sum() == pytest.approx(140)
    assert cells.observed[7, 7] < 140 / 4


@settings(max_examples=20, deadline=None)
@given(st.permutations(range(15)))
def test_order_of_days_changes_nothing(order: list[int]) -> None:
    n, x, recorded = small_floor()
    first = hotspots(n, x, sigma_cells=1.0, is_recorded=recorded, min_days=12, q_max=0.9, min_ratio=1.0)
    other = hotspots(
        n[order], x[order], sigma_cells=1.0, is_recorded=recorded[order], min_days=12, q_max=0.9, min_ratio=1.0
    )
    np.testing.assert_allclose(first.cells.t, other.cells.t, rtol=1e-9)
    assert first.spots
    assert [(s.label, s.rate.n) for s in first.spots] == [(s.label, s.rate.n) for s in other.spots]


@settings(max_examples=20, deadline=None)
@given(st.floats(0.01, 100))
def test_unit_of_exposure_changes_nothing(scale: float) -> None:
    n, x, _ = small_floor()
    first, other = (hotspots(n, v, sigma_cells=1.0, min_exposure_h=0.0) for v in (x, x * scale))
    np.testing.assert_allclose(first.cells.t, other.cells.t, rtol=1e-6, atol=1e-9)


def test_uneven_exposure_alone_is_no_hotspot() -> None:
    for seed in range(8):
        n, x, _ = draw(EVEN, np.random.default_rng(seed))
        assert x.sum(axis=0).max() > 2 * x.sum(axis=0).mean()
        assert hotspots(n, x, sigma_cells=1.0).spots == ()


def test_planted_hotspot_is_found_where_it_is() -> None:
    n, x, place = draw(PLANTED, np.random.default_rng(5))
    found = hotspots(n, x, sigma_cells=1.0)
    (spot,) = found.spots
    assert math.dist((spot.row, spot.column), place) <= 1
    y, column = np.mgrid[: n.shape[1], : n.shape[2]]
    planted = np.hypot(y - place[0], column - place[1]) <= RADIUS_M
    assert found.cells.is_hot[planted].all()
    assert spot.rate.lo is not None
    assert spot.rate.lo > 1.25


def test_a_day_on_which_all_is_riskier_is_no_hotspot() -> None:
    n, x, _ = draw(EVEN, np.random.default_rng(2))
    n[3] *= 6
    assert hotspots(n, x, sigma_cells=1.0).spots == ()


def test_missing_days_are_not_zero() -> None:
    n, x, place = draw(PLANTED, np.random.default_rng(5))
    recorded = np.ones(n.shape, dtype=bool)
    recorded[:8, :, max(0, place[1] - 6) : place[1] + 6] = False
    gone_n, gone_x = np.where(recorded, n, 0.0), np.where(recorded, x, 0.0)
    found = hotspots(gone_n, gone_x, sigma_cells=1.0, is_recorded=recorded)
    (spot,) = found.spots
    assert spot.rate.n_days == 20
    ratio = place_rate(n[8:], x[8:], found.cells.label == spot.label)
    assert ratio is not None
    assert spot.rate.ratio == pytest.approx(ratio.ratio, rel=1e-9)
    # what is in the cells of days that were not recorded is not looked at
    wild = hotspots(np.where(recorded, n, 1e4), np.where(recorded, x, 3.0), sigma_cells=1.0, is_recorded=recorded)
    np.testing.assert_array_equal(wild.cells.t, found.cells.t)
    # and taken for zero, they would count as days
    assert hotspots(gone_n, gone_x, sigma_cells=1.0).spots[0].rate.n_days == 28


def test_cells_with_few_days_or_little_exposure_are_not_tested() -> None:
    n, x, recorded = small_floor()
    cells = hotspots(n, x, sigma_cells=1.0, is_recorded=recorded, min_days=13).cells
    assert not cells.is_tested[:, 5:].any()
    assert cells.is_tested[:, :5].all()
    assert np.isnan(cells.ratio[:, 5:]).all()
    assert not hotspots(n, x / 1e4, sigma_cells=1.0).cells.is_tested.any()


def test_cells_left_out_are_not_tested_and_still_count_for_the_site() -> None:
    n, x, place = draw(PLANTED, np.random.default_rng(5))
    eligible = np.ones(n.shape[1:], dtype=bool)
    eligible[place] = False
    whole, part = hotspots(n, x, sigma_cells=1.0), hotspots(n, x, sigma_cells=1.0, is_eligible=eligible)
    assert not part.cells.is_tested[place]
    assert not part.cells.is_hot[place]
    np.testing.assert_array_equal(part.cells.expected[eligible], whole.cells.expected[eligible])


def test_nothing_recorded_gives_nothing() -> None:
    found = hotspots(np.zeros((28, 4, 4)), np.zeros((28, 4, 4)), sigma_cells=1.0)
    assert (found.n_days, found.spots) == (0, ())
    assert not found.cells.is_tested.any()
    assert hotspots(np.zeros((28, 4, 4)), np.ones((28, 4, 4)), sigma_cells=1.0).spots == ()


@pytest.mark.parametrize("bad", [-1.0, math.nan, math.inf])
def test_impossible_numbers_are_refused(bad: float) -> None:
    n, x, _ = small_floor()
    n[0, 0, 0] = bad
    with pytest.raises(ValueError, match="finite"):
        hotspots(n, x, sigma_cells=1.0)


def test_shapes_must_fit() -> None:
    with pytest.raises(ValueError, match="one shape"):
        hotspots(np.zeros((3, 4, 4)), np.zeros((3, 4, 5)), sigma_cells=1.0)
    with pytest.raises(ValueError, match="is_recorded"):
        hotspots(np.zeros((3, 4, 4)), np.ones((3, 4, 4)), sigma_cells=1.0, is_recorded=np.ones((3, 4)))


def test_interval_of_a_place_is_never_narrower_than_that_of_independent_violations() -> None:
    n, x = np.zeros((10, 1, 2)), np.ones((10, 1, 2))
    n[:, 0, 0], n[:, 0, 1] = 1, 2
    place = place_rate(n, x, [[True, False]])
    assert place is not None
    assert (place.n, place.expected) == (10, 15)
    assert place.lo is not None
    assert math.log(place.ratio / place.lo) == pytest.approx(stats.t.ppf(0.975, 9) / math.sqrt(10))


def test_a_place_nobody_was_in_has_no_rate() -> None:
    n, x, _ = small_floor()
    x[:, 0, 0] = 0
    inside = np.zeros(x.shape[1:], dtype=bool)
    inside[0, 0] = True
    assert place_rate(n, x, inside) is None


def test_getis_ord_of_the_proof_equals_esda() -> None:
    esda = pytest.importorskip("esda")
    libpysal = pytest.importorskip("libpysal")
    for seed in range(5):
        counts = draw(EVEN, np.random.default_rng(seed))[0].sum(axis=0)
        weights = libpysal.weights.lat2W(*counts.shape, rook=False)
        oracle = esda.G_Local(counts.ravel(), weights, transform="B", permutations=0, star=True)
        z, is_hot = getis_ord(counts)
        np.testing.assert_allclose(z.ravel(), oracle.Zs, rtol=1e-9)
        q = stats.false_discovery_control(stats.norm.sf(oracle.Zs))
        np.testing.assert_array_equal(is_hot.ravel(), q <= 0.05)
        assert is_hot.sum() > 20
