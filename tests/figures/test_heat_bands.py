"""Banded heat: outlines against the field they were made from, and against the camera that sees them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon

from vsd_analytics.figures.week.bands import heat_bands, project_polygons
from vsd_analytics.report.draw.svg import smooth_path

STEPS = (0.5, 1.0, 2.0, 4.0, 8.0)


def cone(peak: float, radius_m: float) -> np.ndarray:
    x, y = np.meshgrid(np.arange(80) * 0.25 + 0.125, np.arange(80) * 0.25 + 0.125)
    return np.clip(peak * (1 - np.hypot(x - 10, y - 10) / radius_m), 0, None)


def test_a_cone_gives_circles_of_the_right_size() -> None:
    bands = heat_bands(cone(10.0, 8.0), cell_m=0.25, origin_m=(0.0, 0.0), steps=STEPS)
    assert [b.lower for b in bands] == list(STEPS)
    for band in bands:
        (polygon,) = band.polygons
        shape = Polygon(polygon[0])
        radius = 8.0 * (1 - band.lower / 10.0)
        assert shape.area == pytest.approx(np.pi * radius**2, rel=0.06)
        assert shape.centroid.distance(Point(10, 10)) < 0.1


def test_origin_moves_outlines_by_just_as_much() -> None:
    here = heat_bands(cone(3.0, 4.0), cell_m=0.25, origin_m=(0.0, 0.0), steps=(1.0,))
    there = heat_bands(cone(3.0, 4.0), cell_m=0.25, origin_m=(-60.0, 40.0), steps=(1.0,))
    a, b = np.array(here[0].polygons[0][0]), np.array(there[0].polygons[0][0])
    assert len(a) == len(b)
    np.testing.assert_allclose(a + np.array([-60.0, 40.0]), b, atol=1e-3)


def test_a_ring_keeps_its_hole() -> None:
    x, y = np.meshgrid(np.arange(80) * 0.25, np.arange(80) * 0.25)
    ring = np.where(abs(np.hypot(x - 10, y - 10) - 5) < 1.5, 3.0, 0.0)
    (band,) = heat_bands(ring, cell_m=0.25, origin_m=(0.0, 0.0), steps=(1.0,))
    assert len(band.polygons[0]) == 2


def test_heat_at_the_edge_of_the_grid_is_closed_and_unseen_floor_is_not_heat() -> None:
    grid = np.full((10, 10), 2.0)
    grid[:, :5] = np.nan
    (band,) = heat_bands(grid, cell_m=1.0, origin_m=(0.0, 0.0), steps=(1.0,))
    assert Polygon(band.polygons[0][0]).bounds == pytest.approx((5.0, 0.0, 10.0, 10.0), abs=0.6)


def test_no_heat_no_bands() -> None:
    assert heat_bands(np.zeros((5, 5)), cell_m=1.0, origin_m=(0.0, 0.0), steps=STEPS) == ()


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_stronger_bands_lie_inside_weaker_ones(seed: int) -> None:
    import cv2

    noise = cv2.GaussianBlur(np.random.default_rng(seed).gamma(0.4, 4.0, (40, 50)), (0, 0), 2)
    bands = heat_bands(noise, cell_m=0.25, origin_m=(0.0, 0.0), steps=STEPS, tolerance_m=0.01)
    areas = [sum(Polygon(p[0], p[1:]).area for p in b.polygons) for b in bands]
    assert areas == sorted(areas, reverse=True)


def test_projection_agrees_with_the_homography_and_never_folds_over_the_horizon() -> None:
    homography = np.array([[0.02, 0.0, -12.8], [0.0, 0.0, 12.0], [0.0, 0.004, -1.0]])
    to_px = np.linalg.inv(homography)
    square = ((-1.0, 8.0), (1.0, 8.0), (1.0, 10.0), (-1.0, 10.0))
    (seen,) = project_polygons([(square,)], homography=homography, size_px=(1280, 720))
    expected = [(p[0] / p[2], p[1] / p[2]) for p in (to_px @ (x, y, 1.0) for x, y in square)]
    assert Polygon(seen[0]).symmetric_difference(Polygon(expected)).area < 1.0
    behind = ((-50.0, -50.0), (50.0, -50.0), (50.0, 500.0), (-50.0, 500.0))
    for polygon in project_polygons([(behind,)], homography=homography, size_px=(1280, 720)):
        assert all(0 <= x <= 1280 and 250 <= y <= 720 for x, y in polygon[0])


def test_paths_are_compact_integers() -> None:
    path = smooth_path([[(0, 0), (100.4, 0), (100, 99.6), (0, 100)]])
    assert path.startswith("M")
    assert path.endswith("z")
    assert "." not in path
    assert smooth_path([[(0, 0), (0.2, 0.1), (0.3, 0.2)]]) == ""
