"""Least squares without negative parts: worked by hand, and beside scipy's on random and on degenerate problems."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from vsd_analytics.stats.least_squares import two_parts


def test_a_part_that_would_be_negative_is_0_and_the_other_is_fitted_alone() -> None:
    # without the bound: x = (5/3, -1/3); with it x_2 = 0 and x_1 = (1*1 + 1*2)/(1 + 1)
    design = [[1.0, 2.0], [1.0, -1.0], [0.0, 0.0]]
    assert two_parts(design, [1.0, 2.0, 7.0]) == pytest.approx([1.5, 0.0])


def test_both_parts_of_an_exact_fit_are_found() -> None:
    assert two_parts([[1.0, 0.0], [1.0, 1.0], [0.0, 2.0]], [3.0, 4.0, 2.0]) == pytest.approx([3.0, 1.0])


def test_what_points_the_other_way_and_what_is_all_0_get_nothing() -> None:
    assert two_parts([[1.0, 2.0], [1.0, 0.0]], [-1.0, -2.0]).tolist() == [0.0, 0.0]
    assert two_parts([[0.0, 1.0], [0.0, 1.0]], [2.0, 4.0]) == pytest.approx([0.0, 3.0])
    assert two_parts(np.zeros((3, 2)), [1.0, 2.0, 3.0]).tolist() == [0.0, 0.0]


def test_the_parts_are_those_of_scipy() -> None:
    n_parts = 2
    rng = np.random.default_rng(n_parts)
    n_bound = 0
    for _ in range(300):
        design = rng.gamma(0.5, 1.0, (40, n_parts)) * rng.gamma(1.0, 10.0, n_parts)
        y = design @ np.maximum(rng.normal(size=n_parts), 0) + rng.normal(size=40) * rng.gamma(1.0, 5.0)
        expected, _ = nnls(design, y)
        np.testing.assert_allclose(two_parts(design, y), expected, rtol=1e-9, atol=1e-12)
        n_bound += int((expected == 0).sum())
    assert n_bound > 100  # the bound matters


def test_two_equal_columns_fit_as_well_as_those_of_scipy() -> None:
    rng = np.random.default_rng(0)
    for _ in range(100):
        column = rng.gamma(1.0, 1.0, 20)
        design, y = np.column_stack([column, column]), rng.gamma(1.0, 1.0, 20)
        found, (_, residual) = two_parts(design, y), nnls(design, y)
        assert np.linalg.norm(design @ found - y) == pytest.approx(residual, rel=1e-9)
        assert found.min() >= 0
