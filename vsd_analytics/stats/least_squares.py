"""Least squares of two parts that are not negative, by cases: to import `scipy.optimize` takes a tenth of a second."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def two_parts(design: npt.ArrayLike, y: npt.ArrayLike) -> Floats:
    """Return the x >= 0 for which `design` x is nearest to y.

    Where the free fit has a negative part, the nearest x lies on the border: one of the parts is 0.

    Args:
        design: Shape (n_rows, 2).
        y: Shape (n_rows,).
    """
    a, b = np.asarray(design, dtype=np.float64), np.asarray(y, dtype=np.float64)
    both = _fitted(a, b)
    if both.min() >= 0:
        return both
    alone = [np.array([_fitted(a[:, [k]], b)[0] if j == k else 0.0 for j in (0, 1)]).clip(0.0) for k in (0, 1)]
    return min(alone, key=lambda x: float(np.linalg.norm(a @ x - b)))


def _fitted(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(a, b, rcond=None)[0], dtype=np.float64)
