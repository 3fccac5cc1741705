"""Floor people can walk on: heat that runs around fixtures and along walls, never through them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import ceil

import numpy as np
import shapely
from numpy.typing import NDArray

from vsd_analytics.figures.week.model_map import MapBand, Point, Polygon

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_EDGE_CELLS = 2
"""How far values are carried on below fixtures, so that outlines reach their edges before they are cut there."""


class Walkable:
    """The cells of a grid, and which neighbours one can step between.

    A cell is free unless its middle lies in a fixture. A step from one cell to the next is open unless the line
    between their middles touches a fixture, so that a wall thinner than a cell stops it too.

    Args:
        fixtures: Footprints, rings in floor metres; at least one.
        cell_m: Side of a cell.
        origin_m: Lower left corner of cell [0, 0].
        shape: Rows (y) and columns (x).

    Attributes:
        is_free: Which cells are free, shape (n_y, n_x).
        solid: The union of the fixtures.
    """

    def __init__(
        self, fixtures: Sequence[Sequence[Point]], *, cell_m: float, origin_m: Point, shape: tuple[int, int]
    ) -> None:
        self._cell_m, self._origin, self.shape = cell_m, origin_m, shape
        polygons = [shapely.Polygon(ring) for ring in fixtures]
        self.solid = shapely.union_all(polygons)
        self.is_free = np.ones(shape, dtype=np.bool_)
        self._to_right = np.ones((shape[0], max(0, shape[1] - 1)), dtype=np.bool_)
        self._upwards = np.ones((max(0, shape[0] - 1), shape[1]), dtype=np.bool_)
        for polygon in polygons:
            self._block(polygon)
        if not self.is_free.any():  # fixtures all over the grid describe no floor at all
            self.is_free[:] = self._to_right[:] = self._upwards[:] = True

    @property
    def steps(self) -> tuple[Flags, Flags]:
        """Return which steps to the right, shape (n_y, n_x - 1), and upwards, shape (n_y - 1, n_x), are open."""
        return self._to_right, self._upwards

    def on_floor(self, values: Array) -> Array:
        """Return values with those of blocked cells added to the nearest free cell; the sum stays the same.

        A position inside a fixture is the middle of a pair around it, or a position with a small error.
        """
        from scipy.ndimage import distance_transform_edt

        off = np.nonzero(~self.is_free & (values != 0))
        if not len(off[0]):
            return values
        rows, columns = distance_transform_edt(~self.is_free, return_distances=False, return_indices=True)
        moved = np.where(self.is_free, values, 0.0)
        np.add.at(moved, (rows[off], columns[off]), values[off])
        return moved

    def smooth(self, values: Array, *, sigma_cells: float) -> Array:
        """Return values spread over the floor by the heat kernel of standard deviation `sigma_cells`.

        Heat flows between free neighbours with an open step for as long as it takes to spread a point on open floor to
        a Gaussian of that width: n rounds, in each of which a cell gives a share a = sigma^2 / (2 n) to each neighbour
        along x, then along y. With a = 1/6 one round has the variance and the fourth moment of a Gaussian (the known
        choice for the explicit scheme of the heat equation), so open floor agrees with a Gaussian filter, from 1.7
        cells on within 1 % of its peak. What flows out of a cell flows into its neighbour: the sum stays the same. The
        order of rounds (x, y, y, x) keeps x and y alike.

        Args:
            values: Shape of the grid; blocked cells should hold 0, see `on_floor`.
            sigma_cells: Standard deviation in cells.
        """
        rounds = max(1, ceil(3 * sigma_cells**2 - 1e-9))
        share = sigma_cells**2 / (2 * rounds)
        heat = np.array(values, dtype=np.float64)
        right, up = share * self._to_right, share * self._upwards
        for k in range(rounds):
            for axis in (1, 0) if k % 2 == 0 else (0, 1):
                flow = right * np.diff(heat, axis=1) if axis == 1 else up * np.diff(heat, axis=0)
                low, high = _halves(heat, axis)
                low += flow
                high -= flow
        return heat

    def outlined(self, density: Array) -> Array:
        """Return a density for outlining: fixtures take the value of the nearest free cell, a little way in."""
        from scipy.ndimage import binary_dilation, distance_transform_edt

        near = (
            binary_dilation(self.is_free, iterations=_EDGE_CELLS, structure=np.ones((3, 3), dtype=np.bool_))
            & ~self.is_free
        )
        rows, columns = distance_transform_edt(~self.is_free, return_distances=False, return_indices=True)
        return np.where(near, density[rows, columns], density)

    def clipped(self, bands: Iterable[MapBand], density: Array) -> tuple[MapBand, ...]:
        """Return bands without the floor below fixtures.

        Outlines run between the middles of cells, so that one beside a thin wall may reach a little through it. Such a
        piece holds no cell whose own density reaches the band, and is left out.

        Args:
            bands: Outlines of `outlined`.
            density: The density itself, by cell.
        """
        clipped = []
        for band in bands:
            kept: list[Polygon] = []
            rows, columns = np.nonzero(self.is_free & (density >= band.lower))
            x, y = self._middles(rows, columns)
            for rings in band.polygons:
                whole = shapely.Polygon(rings[0], rings[1:]).buffer(0)
                if not whole.intersects(self.solid):
                    kept.append(rings)
                    continue
                parts = shapely.get_parts(whole.difference(self.solid))
                polygons = [p for p in parts if p.geom_type == "Polygon"]
                kept += [_rings(p) for p in polygons if shapely.contains_xy(p, x, y).any()]
            if kept:
                clipped.append(replace(band, polygons=tuple(sorted(kept))))
        return tuple(clipped)

    def _block(self, polygon: shapely.Polygon) -> None:
        """Block the cells and steps of one fixture; only those near it are looked at."""
        x0, y0, x1, y1 = polygon.bounds
        (left, low), (right, high) = (
            ((x - self._origin[0]) / self._cell_m, (y - self._origin[1]) / self._cell_m)
            for x, y in ((x0, y0), (x1, y1))
        )
        rows = np.arange(max(0, int(low) - 1), min(self.shape[0], int(high) + 2))
        columns = np.arange(max(0, int(left) - 1), min(self.shape[1], int(right) + 2))
        if not len(rows) or not len(columns):
            return
        row, column = (a.ravel() for a in np.meshgrid(rows, columns, indexing="ij"))
        x, y = self._middles(row, column)
        shapely.prepare(polygon)
        self.is_free[row, column] &= ~shapely.intersects_xy(polygon, x, y)
        for steps, dx, dy in ((self._to_right, 1, 0), (self._upwards, 0, 1)):
            inside = (row < steps.shape[0]) & (column < steps.shape[1])
            ends = self._middles(row[inside] + dy, column[inside] + dx)
            lines = shapely.linestrings(np.stack([np.stack([x[inside], y[inside]], 1), np.stack(ends, 1)], axis=1))
            steps[row[inside], column[inside]] &= ~shapely.intersects(polygon, lines)

    def _middles(self, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> tuple[Array, Array]:
        x, y = (
            np.asarray(first + (n + 0.5) * self._cell_m, dtype=np.float64)
            for first, n in zip(self._origin, (columns, rows), strict=True)
        )
        return x, y


def _halves(heat: Array, axis: int) -> tuple[Array, Array]:
    """Return views of all but the last and all but the first row or column."""
    return (heat[:, :-1], heat[:, 1:]) if axis == 1 else (heat[:-1], heat[1:])


def _rings(part: shapely.Polygon) -> Polygon:
    """Return a polygon's rings, outer counter-clockwise, rounded like the bands' own outlines."""
    turned = shapely.orient_polygons(part.normalize())
    return tuple(
        tuple((round(float(x), 4), round(float(y), 4)) for x, y in list(ring.coords)[:-1])
        for ring in (turned.exterior, *turned.interiors)
    )
