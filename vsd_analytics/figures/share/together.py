"""Hours that readers know as one sum only: in all that is computed for them, each has an equal part of it.

Intervals, verdicts and expected values are made of hours and days. From exact ones, their digits would tell two hours
apart that a timetable hides. So a warehouse that a page for readers is made from says which hours these are
(`Warehouse.counted_together`, `timed_together`), and what reads counts by hour or day from it gives them equal parts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
_WHOLE = 1e-6


def equal_parts(total: int, n_parts: int) -> Ints:
    """Return a total in whole parts that differ by one at most, shape (n_parts,)."""
    return np.diff(np.arange(n_parts + 1) * total // max(1, n_parts))


def evened(values: Array, counted: Flags, groups: Sequence[Ints]) -> Array:
    """Return what cameras counted by hour, with equal parts of each camera's sum in the hours of each group.

    Sums over a group stay. The parts of a whole number are whole numbers, which differ by one at most.

    Args:
        values: Counts or times, shape (n_cameras, n_hours).
        counted: Camera-hours that enter rates, same shape; others have no part, and stay as they are.
        groups: Positions of hours that are known together.
    """
    if not groups:
        return values
    parts = values.copy()
    for group in groups:
        for row, is_counted in zip(parts, counted[:, group], strict=True):
            at = group[is_counted]
            if not len(at):
                continue
            total = float(row[at].sum())
            is_whole = abs(total - np.rint(total)) < _WHOLE
            row[at] = equal_parts(round(total), len(at)) if is_whole else total / len(at)
    return parts


def evened_days(values: Array, recorded: Flags, groups: Sequence[Ints]) -> Array:
    """Return what was counted by day and cell, with equal parts of each cell's sum on the days of each group.

    Args:
        values: Counts or times, shape (n_days, n_rows, n_columns).
        recorded: Which of them count, same shape.
        groups: Positions of days with hours that are known together.
    """
    if not groups:
        return values
    parts = values.copy()
    for group in groups:
        here = recorded[group]
        mean = np.where(here, values[group], 0.0).sum(axis=0) / np.maximum(1, here.sum(axis=0))
        parts[group] = np.where(here, mean, values[group])
    return parts
