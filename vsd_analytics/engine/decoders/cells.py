"""The cells of a network's grids, in the order of its outputs: the finest grid first, row by row."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vsd_analytics.engine.people import Array


def cells_of(size_px: tuple[int, int], strides: Sequence[int], *, begin: float) -> tuple[Array, Array]:
    """Return where cells are in the input and how large they are.

    Args:
        size_px: Width and height of the input.
        strides: Pixels of a cell of each grid.
        begin: Point of a cell: 0 for its upper left corner, .5 for its middle.

    Returns:
        Pixels x, y, shape (n, 2), and the stride of each cell, shape (n,).
    """
    points, sizes = [], []
    for stride in strides:
        columns, rows = (-(-side // stride) for side in size_px)
        y, x = np.mgrid[:rows, :columns]
        points.append((np.column_stack([x.ravel(), y.ravel()]) + begin) * stride)
        sizes.append(np.full(rows * columns, float(stride)))
    return np.concatenate(points).astype(np.float64), np.concatenate(sizes)


def n_cells(size_px: tuple[int, int], strides: Sequence[int]) -> int:
    """Return how many cells the grids of an input have."""
    return sum(-(-size_px[0] // stride) * -(-size_px[1] // stride) for stride in strides)
