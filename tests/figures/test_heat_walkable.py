"""Heat runs along the floor people can walk on: not through walls, not below shelves, and none of it is lost."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from vsd_analytics.figures.week.bands import heat_bands
from vsd_analytics.figures.week.density import FloorGrid
from vsd_analytics.figures.week.walkable import Walkable

CELL, N = 0.25, 48
STEPS = (0.5, 1.0, 2.0, 4.0, 8.0)
SIGMA = 2.0
Ring = tuple[tuple[float, float], ...]


def box(x0: float, y0: float, x1: float, y1: float) -> Ring:
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def floor(*fixtures: Ring) -> Walkable:
    return Walkable(fixtures, cell_m=CELL, origin_m=(0.0, 0.0), shape=(N, N))


def point(row: int, column: int, n: float = 1.0) -> np.ndarray:
    values = np.zeros((N, N))
    values[row, column] = n
    return values


FAR = box(11.0, 11.0, 11.5, 11.5)


@pytest.mark.parametrize("sigma", [1.7, 2.0, 3.0, 4.4])
def test_open_floor_agrees_with_a_gaussian(sigma: float) -> None:
    wanted = gaussian_filter(point(20, 22), sigma, mode="constant")
    np.testing.assert_allclose(floor(FAR).smooth(point(20, 22), sigma_cells=sigma), wanted, atol=0.01 * wanted.max())


@pytest.mark.parametrize("thick_m", [0.02, 0.1, 0.25, 0.6])
def test_a_wall_of_any_thickness_stops_heat(thick_m: float) -> None:
    wall = box(6.0, 0.0, 6.0 + thick_m, 12.0)
    heat = floor(wall).smooth(point(24, 22), sigma_cells=SIGMA)
    assert heat[:, int((6.0 + thick_m) / CELL) + 1 :].sum() == 0
    assert heat.sum() == pytest.approx(1)


def test_heat_goes_round_the_end_of_a_wall() -> None:
    wall = box(6.0, 0.0, 6.1, 6.0)  # ends at row 24
    by_the_end, far_from_it = (floor(wall).smooth(point(row, 22), sigma_cells=SIGMA)[:, 25:].sum() for row in (23, 8))
    assert by_the_end > 0.02
    assert far_from_it < 1e-4


@settings(max_examples=25)
@given(
    st.lists(
        st.tuples(st.floats(0, 9), st.floats(0, 9), st.floats(0.05, 4), st.floats(0.05, 4)), min_size=1, max_size=5
    ),
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.4, 1.0, 2.0, 2.6]),
)
def test_nothing_is_lost_and_nothing_lies_below_fixtures(
    rects: list[tuple[float, float, float, float]], seed: int, sigma: float
) -> None:
    walkable = floor(*(box(x, y, x + w, y + h) for x, y, w, h in rects))
    counts = np.random.default_rng(seed).poisson(0.3, (N, N)).astype(float)
    moved = walkable.on_floor(counts)
    heat = walkable.smooth(moved, sigma_cells=sigma)
    assert moved.sum() == counts.sum()
    assert heat.sum() == pytest.approx(counts.sum())
    assert heat.min() >= -1e-12
    assert not moved[~walkable.is_free].any()
    assert not heat[~walkable.is_free].any()


def test_what_lies_in_a_shelf_is_moved_to_the_floor_beside_it() -> None:
    walkable = floor(box(4.0, 2.0, 5.0, 8.0))  # columns 16 to 19
    moved = walkable.on_floor(point(20, 16, 3.0) + point(20, 19, 4.0))
    assert moved[20, 15] == 3
    assert moved[20, 20] == 4


def test_bands_end_at_the_edge_of_a_shelf_and_keep_what_lies_on_its_other_side_apart() -> None:
    shelf = box(4.0, 2.0, 4.9, 8.0)
    walkable = floor(shelf)
    density = walkable.smooth(point(20, 14, 400.0), sigma_cells=SIGMA)
    bands = heat_bands(walkable.outlined(density), cell_m=CELL, origin_m=(0.0, 0.0), steps=STEPS)
    clipped = walkable.clipped(bands, density)
    assert [b.lower for b in clipped] == [b.lower for b in bands]
    for band in clipped:
        shape = shapely.union_all([shapely.Polygon(p[0], p[1:]) for p in band.polygons])
        assert shape.intersection(shapely.Polygon(shelf)).area < 1e-3
        assert shape.bounds[2] <= 4.0 + 1e-3, "nothing beyond the shelf"
    weakest = shapely.Polygon(clipped[0].polygons[0][0])
    assert weakest.bounds[2] == pytest.approx(4.0), "and no gap before it"


def test_a_band_does_not_reach_through_a_thin_wall() -> None:
    walkable = floor(box(5.9, 0.0, 5.95, 12.0))
    density = walkable.smooth(point(24, 21, 400.0), sigma_cells=SIGMA)
    bands = heat_bands(walkable.outlined(density), cell_m=CELL, origin_m=(0.0, 0.0), steps=STEPS)
    assert max(x for b in bands for p in b.polygons for x, _ in p[0]) > 5.96, "outlines of cells do"
    clipped = walkable.clipped(bands, density)
    assert max(x for b in clipped for p in b.polygons for x, _ in p[0]) <= 5.9 + 1e-3


def test_fixtures_all_over_the_floor_describe_none() -> None:
    assert floor(box(-1.0, -1.0, 20.0, 20.0)).smooth(point(20, 20), sigma_cells=SIGMA).sum() == pytest.approx(1)


def test_without_fixtures_the_map_is_smoothed_as_ever() -> None:
    """Bit for bit: sites that describe no fixtures keep the maps they had."""
    site = SimpleNamespace(settings=SimpleNamespace(cell_m=CELL, smoothing_m=0.5), fixtures=())
    monday = date(2026, 11, 9)

    def midnight(day: date) -> datetime:
        return datetime(day.year, day.month, day.day, tzinfo=UTC)

    data: Any = SimpleNamespace(
        site=site, floor=SimpleNamespace(floor_id="f"), monday=monday, span=timedelta(days=7), midnight=midnight
    )
    grid = FloorGrid(data, (0.0, 0.0, 12.0, 12.0))
    counts = np.random.default_rng(5).poisson(0.4, (N, N)).astype(float)
    np.testing.assert_array_equal(grid.smooth(counts), gaussian_filter(counts, 2.0, mode="constant"))
    wanted = heat_bands(counts, cell_m=CELL, origin_m=(0.0, 0.0), steps=STEPS)
    assert grid.bands(counts, steps=STEPS) == wanted
