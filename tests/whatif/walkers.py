"""Walkers on an empty floor, with a known way: for the tests of this folder."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from vsd_analytics.whatif.floor_records import ALONE, FloorRecords, floor_records


def walkers(
    *ways: tuple[Sequence[float], Sequence[float], float], company: Sequence[int] | None = None, step_s: float = 1.0,
    speed_m_per_s: float = 1.2, **more: Any,
) -> FloorRecords:  # fmt: skip
    """Return people who walk straight from one point to another from an instant on, each by its number."""
    rows = []
    for number, (begin, end, start_s) in enumerate(ways):
        length = float(np.hypot(end[0] - begin[0], end[1] - begin[1]))
        share = np.arange(0, length / speed_m_per_s, step_s) * speed_m_per_s / max(length, 1e-9)
        own = ALONE if company is None else company[number]
        for k, s in enumerate(share):
            place = [begin[j] + s * (end[j] - begin[j]) for j in (0, 1)]
            rows.append((number, start_s + k * step_s, *place, own))
    track, t_s, x_m, y_m, groups = np.array(rows, dtype=float).T
    return floor_records(
        track=track, camera=np.zeros(track.size), t_s=t_s, x_m=x_m, y_m=y_m, company=groups, **more
    )  # fmt: skip


def stander(x_m: float, y_m: float, n_s: int, *, start_s: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return times and places of somebody who stands."""
    return start_s + np.arange(n_s), np.full(n_s, x_m), np.full(n_s, y_m)
