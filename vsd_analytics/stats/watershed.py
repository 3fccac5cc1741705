"""Watershed segmentation of a map: each basin holds the neighbouring cells that belong to one peak.

Cells are taken from the highest down. A cell without a labelled neighbour (8-neighbourhood) starts a basin. Any other
cell joins the basin of its highest labelled neighbour. Where it touches other basins, it is the saddle between its own
and each of them, from the highest peak down: two basins merge when their saddle is higher than a share of the lower
peak, and stay two otherwise. So the cells of a basin are always connected.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def watershed(height: npt.ArrayLike, inside: npt.ArrayLike, *, saddle_share: float) -> npt.NDArray[np.int64]:
    """Return the basin number of each cell (rules: this module).

    Args:
        height: Shape (n_rows, n_columns); above 0 inside.
        inside: Cells to divide, same shape.
        saddle_share: Two basins merge when the saddle between them is above this share of the lower peak, 0 to 1.

    Returns:
        Numbers from 1 in reading order of the basins' first cells, 0 outside; same shape.
    """
    heights, cells = np.asarray(height, dtype=np.float64), np.asarray(inside, dtype=bool)
    label = np.zeros(cells.shape, dtype=np.int64)
    peak: dict[int, float] = {}
    joined: dict[int, int] = {}

    def basin(k: int) -> int:
        while k in joined:
            k = joined[k]
        return k

    rows, columns = np.nonzero(cells)
    # stable: equal heights go in reading order, so that the same map always gives the same numbers
    for i in np.argsort(-heights[rows, columns], kind="stable"):
        row, column = int(rows[i]), int(columns[i])
        around = np.s_[max(0, row - 1) : row + 2, max(0, column - 1) : column + 2]
        near = sorted(
            (-high, basin(k))
            for high, k in zip(heights[around].ravel().tolist(), label[around].ravel().tolist(), strict=True)
            if k
        )
        # the highest labelled neighbour decides, so that each cell climbs to one peak
        own = near[0][1] if near else len(peak) + 1
        label[row, column] = own
        peak.setdefault(own, float(heights[row, column]))
        for other in sorted({k for _, k in near} - {own}, key=lambda k: (-peak[k], k)):
            # the cell links its own basin with each of the others, and no two of these
            higher, lower = sorted((own, other), key=lambda k: (-peak[k], k))
            if heights[row, column] > saddle_share * peak[lower]:
                joined[lower] = own = higher
    merged = np.array([basin(int(k)) for k in label[cells]], dtype=np.int64)
    _, first, inverse = np.unique(merged, return_index=True, return_inverse=True)
    label[cells] = np.argsort(np.argsort(first))[inverse] + 1
    return label
