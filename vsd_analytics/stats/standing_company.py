"""Which people stand in company: they stay close to each other, and to those around them (M9).

The rule itself is SQL (`sql/staging/window_company.sql`). This is the same rule for arrays, which alarms use as well.
It knows positions alone: who faces whom is not known. docs/statistics.md has what it finds of true groups.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]


def mean_distances_mm(mm_ms: Ints, close_ms: Ints, seen_ms: Ints, *, reach_mm: int) -> Ints:
    """Return the mean distances of pairs, rounded down: (sum of w d + reach (T - sum of w)) / T.

    Args:
        mm_ms: Sum of w d over their records closer than `reach_mm`: time of a record, times distance.
        close_ms: Sum of w, same shape, positive.
        seen_ms: How long the one was seen that was seen longer: T, at least `close_ms`.
        reach_mm: What counts where they were farther apart.
    """
    both_ms = np.maximum(seen_ms, close_ms)
    means: Ints = (mm_ms + reach_mm * (both_ms - close_ms)) // both_ms
    return means


def stands_together(
    a: Ints, b: Ints, mean_mm: Ints, is_long: npt.NDArray[np.bool_], *, together_mm: int, reach_mm: int
) -> npt.NDArray[np.bool_]:
    """Return which pairs stand together; companies are the connected components of these.

    N(i) are i and all that are near: at most `together_mm` from i on average, and close for long. A pair that was
    close for long is standing together if

        (mean of d_kj over k in N(i) without j + mean of d_ki over k in N(j) without i) / 2 <= together_mm.

    In a circle each is near to all. In a line the neighbours of one are far from the other: people in line, 1.1 m from
    the next, are no company.

    Args:
        a: Number of one person of each pair, not negative; people of different windows have different numbers.
        b: That of the other; each pair is there once.
        mean_mm: Mean distance (`mean_distances_mm`), same shape.
        is_long: Whether they were closer than `reach_mm` for long enough, same shape.
        together_mm: Greatest mean distance.
        reach_mm: Distance of pairs that are not among the rows.
    """
    if not len(a):
        return np.zeros(0, dtype=np.bool_)
    n = int(max(a.max(), b.max())) + 1
    one, other = np.concatenate([a, b]), np.concatenate([b, a])
    mean, is_long = np.tile(mean_mm, 2), np.tile(is_long, 2)
    keys = one * n + other
    order = np.argsort(keys)
    keys, means = keys[order], mean[order]
    near = order[(is_long & (mean <= together_mm))[order]]
    near_one, near_other = one[near], other[near]
    rows = np.flatnonzero(is_long)
    first = np.searchsorted(near_one, one[rows])
    n_near = np.searchsorted(near_one, one[rows], side="right") - first
    row = np.repeat(rows, n_near)
    step = np.arange(len(row)) - np.repeat(np.cumsum(n_near) - n_near - first, n_near)
    third = near_other[step]
    is_other = third != other[row]
    row, third = row[is_other], third[is_other]
    wanted = third * n + other[row]
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    distances = np.where(keys[at] == wanted, means[at], reach_mm)
    n_around = 1 + np.bincount(row, minlength=len(one))
    sum_mm = mean + np.bincount(row, distances, minlength=len(one)).astype(np.int64)
    n_a, n_b = n_around[: len(a)], n_around[len(a) :]
    sum_a, sum_b = sum_mm[: len(a)], sum_mm[len(a) :]
    is_together: npt.NDArray[np.bool_] = sum_a * n_b + sum_b * n_a <= 2 * together_mm * n_a * n_b
    return is_together & is_long[: len(a)]
