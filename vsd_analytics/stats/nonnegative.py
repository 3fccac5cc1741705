"""Least squares of two parts, none negative: what `scipy.optimize.nnls` gives, which takes .1 s to import."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def nonnegative_factors(parts: Floats, whole: Floats) -> tuple[float, float]:
    """Return the two factors, none negative, of the columns whose sum is nearest to a third column by least squares.

    Where the nearest sum has a negative factor, one of the two is 0 (Lawson & Hanson, Solving Least Squares
    Problems, 1974, chapter 23).

    Args:
        parts: Two columns, shape (n, 2).
        whole: What they should add up to, shape (n,).
    """
    first, second = map(float, np.linalg.lstsq(parts, whole)[0])
    if first >= 0 and second >= 0:
        return first, second
    along, size = parts.T @ whole, (parts**2).sum(axis=0)
    alone = np.maximum(np.divide(along, size, out=np.zeros(2), where=size > 0), 0.0)
    is_first = alone[0] * along[0] >= alone[1] * along[1]
    return (float(alone[0]), 0.0) if is_first else (0.0, float(alone[1]))
