"""Least squares without negative parts, in numpy: to import `scipy.optimize` for it takes a tenth of a second."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def non_negative(design: npt.ArrayLike, y: npt.ArrayLike) -> Floats:
    """Return the x >= 0 for which `design` x is nearest to y.

    Columns come in one by one, the one along which the fit gains most first, and leave when their part turns negative.
    Source: Lawson & Hanson, Solving Least Squares Problems (1974), chapter 23.

    Args:
        design: Shape (n_rows, n_parts).
        y: Shape (n_rows,).
    """
    a, b = np.asarray(design, dtype=np.float64), np.asarray(y, dtype=np.float64)
    n_parts = a.shape[1]
    x, is_in = np.zeros(n_parts), np.zeros(n_parts, dtype=np.bool_)
    nearly_0 = 10 * max(a.shape) * np.finfo(np.float64).eps * float(np.abs(a).sum(axis=0).max(initial=0.0))
    for _ in range(3 * n_parts):
        gain = np.where(is_in, -np.inf, a.T @ (b - a @ x))
        if is_in.all() or gain.max() <= nearly_0:
            break
        is_in[gain.argmax()] = True
        while (trial := _fitted(a, b, is_in))[is_in].min(initial=1.0) <= 0:
            falls = is_in & (trial <= 0)
            apart = x[falls] - trial[falls]
            x = x + float(np.divide(x[falls], apart, out=np.zeros_like(apart), where=apart > 0).min()) * (trial - x)
            x[falls & (x <= nearly_0)] = 0.0
            is_in &= x > 0
        x = trial
    return x


def _fitted(a: Floats, b: Floats, is_in: npt.NDArray[np.bool_]) -> Floats:
    """Return the parts of the columns that are in, by least squares; 0 for the others."""
    x = np.zeros(a.shape[1])
    x[is_in] = np.linalg.lstsq(a[:, is_in], b, rcond=None)[0]
    return x
