"""Many tests at once: the false discovery rate."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def benjamini_hochberg(p: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Return q, the least false discovery rate at which each test passes: min over larger p of p m / rank.

    Source: Benjamini & Hochberg, Controlling the false discovery rate, J. R. Statist. Soc. B 57 (1995).

    Args:
        p: P values, shape (m,).
    """
    values = np.asarray(p, dtype=np.float64)
    order = np.argsort(values, kind="stable")
    stepped = values[order] * len(values) / np.arange(1, len(values) + 1)
    q = np.empty(len(values))
    q[order] = np.minimum(1.0, np.minimum.accumulate(stepped[::-1])[::-1])
    return q
