"""A reader of classes of squares by hour who also knows all exact sums, and solves for the times of few people."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from scipy.optimize import linprog

from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.share.squares import ClassSteps, SquareClasses, SquareTimes

KNOWN: Final = 0.01
"""A time is known when its least and greatest value differ by less than this part of it."""


def few(times: SquareTimes, mask: Mask) -> Any:
    """Return the squares and hours with few people, shape (n_squares, n_hours)."""
    return (times.by_square(times.time_ms) > 0) & (times.n_people < mask.below)


def known(
    times: SquareTimes, found: SquareClasses, steps: ClassSteps, mask: Mask, *, counted: Any
) -> list[tuple[str, int, int]]:
    """Return the times of few people that classes, hours, areas by time of day and square metres tell a reader.

    The unknowns are the free time of each square metre and hour, then its time too close.
    """
    shape, n = times.time_ms.shape, times.time_ms.size
    free, close = (np.eye(2 * n)[k * n : (k + 1) * n].reshape(*shape, 2 * n) for k in (0, 1))
    sums, values, above, ends = [], [], [], []
    for of, true in ((free + close, times.time_ms), (close, times.close_ms)):
        for unit in range(shape[0]):
            sums.append(of[unit].sum(axis=0))
            values.append(true[unit].sum())
        for hour in range(shape[1]):
            sums.append(of[:, hour].sum(axis=0))
            values.append(true[:, hour].sum())
        for area in np.unique(times.area):
            for at in np.unique(times.hour_of_day):
                part = np.ix_(times.area == area, times.hour_of_day == at)
                sums.append(of[part].sum(axis=(0, 1)))
                values.append(true[part].sum())
    for kind, of, low_ms in (
        (found.time, free + close, steps.time_ms),
        (found.close, close, steps.close_ms),
    ):
        for square, hour in zip(*np.nonzero(found.time), strict=True):
            if kind is found.close and not counted[hour]:
                continue
            row, k = of[times.square == square, hour].sum(axis=0), kind[square, hour]
            low, high = (v * times.recorded_h[hour] for v in ((0, *low_ms)[k], (*low_ms, np.inf)[k]))
            above += [-row] + ([row] if np.isfinite(high) else [])
            ends += [-low] + ([high] if np.isfinite(high) else [])
    worked_out = []
    for name, of, true in (("time", free + close, times.time_ms), ("close", close, times.close_ms)):
        by_square = times.by_square(true)
        for square, hour in zip(*np.nonzero(few(times, mask) & (by_square > 0)), strict=True):
            goal = of[times.square == square, hour].sum(axis=0)
            least, most = (
                sign
                * linprog(
                    sign * goal, A_ub=np.array(above) if above else None, b_ub=ends or None, A_eq=sums, b_eq=values
                ).fun
                for sign in (1, -1)
            )
            assert least - 1e-6 <= by_square[square, hour] <= most + 1e-6
            if most - least < KNOWN * by_square[square, hour]:
                worked_out.append((name, int(square), int(hour)))
    return worked_out
