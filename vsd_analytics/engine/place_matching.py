"""Found people and true ones brought together by where they are, for detectors without the truth's ids.

In each frame found persons take the ids of true ones, so that the sum of distances is least among the assignments with
the most pairs within a limit (Hungarian method). Those beyond it keep an id of their own, which no true person has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import Array
from vsd_analytics.engine.truth import FoundPairs, Positions

WITHIN_M: Final = 1.0
"""Two people are rarely nearer, and places of detectors are rarely farther off."""


def matched_by_place(detections: FoundPairs, truth: Positions, *, within_m: float = WITHIN_M) -> FoundPairs:
    """Return what was found with the ids of the true persons at the same place.

    Args:
        detections: What messages say; persons without metres match nobody.
        truth: True positions.
        within_m: Persons farther apart are not the same.
    """
    old, true = detections.positions, truth
    track = np.array([f"unmatched {row}" for row in range(len(old.instant))], dtype=object)
    for instant in np.intersect1d(old.instant, true.instant):
        rows, others = (_rows(part.instant, instant) for part in (old, true))
        apart_m = np.linalg.norm(old.xy[rows][:, None] - true.xy[others][None], axis=2)
        for row, other in assigned(np.where(np.isfinite(apart_m), apart_m, np.inf), within=within_m):
            track[rows.start + row] = true.track[others.start + other]
    name = dict(zip(zip(old.instant.tolist(), old.track, strict=True), track, strict=True))
    sides = [
        np.array(
            [name.get(key, f"absent {key[1]}") for key in zip(detections.instant.tolist(), side, strict=True)], object
        )
        for side in (detections.a, detections.b)
    ]
    return replace(detections, positions=replace(old, track=track), a=sides[0], b=sides[1])


def assigned(cost: Array, *, within: float) -> list[tuple[int, int]]:
    """Return rows and columns that belong together: as many as possible below a limit, then the least cost."""
    from scipy.optimize import linear_sum_assignment

    if not cost.size:
        return []
    padded = np.where(cost < within, cost - 2 * within * min(cost.shape), 0.0)
    rows, columns = linear_sum_assignment(padded)
    return [(int(r), int(c)) for r, c in zip(rows, columns, strict=True) if cost[r, c] < within]


def without_uncounted(
    detections: FoundPairs, truth: Positions, areas: Sequence[Array]
) -> tuple[FoundPairs, Positions, int, int]:
    """Leave out the persons of areas that do not count, and their pairs.

    A true person counts by the true place. A found one counts with the true person it is matched with, and by its own
    place where there is none.

    Args:
        detections: With ids of the truth.
        truth: True positions.
        areas: Corners of each area in floor metres, shape (k, 2).

    Returns:
        What was found, the truth, and how many found and true persons were left out.
    """
    counts = ~_inside(truth.xy, areas)
    kept = replace(truth, instant=truth.instant[counts], track=truth.track[counts], xy=truth.xy[counts])
    is_counted = dict(zip(zip(truth.instant.tolist(), truth.track, strict=True), counts.tolist(), strict=True))
    old = detections.positions
    keys = list(zip(old.instant.tolist(), old.track, strict=True))
    by_place = ~_inside(old.xy, areas)
    stays = np.array([is_counted.get(key, bool(alone)) for key, alone in zip(keys, by_place, strict=True)], dtype=bool)
    gone = {key for key, stay in zip(keys, stays.tolist(), strict=True) if not stay}
    pairs = np.array(
        [
            (instant, a) not in gone and (instant, b) not in gone
            for instant, a, b in zip(detections.instant.tolist(), detections.a, detections.b, strict=True)
        ],
        dtype=bool,
    )
    positions = replace(old, instant=old.instant[stays], track=old.track[stays], xy=old.xy[stays])
    left = replace(
        detections,
        positions=positions,
        instant=detections.instant[pairs],
        a=detections.a[pairs],
        b=detections.b[pairs],
        distance_m=detections.distance_m[pairs],
    )
    return left, kept, int((~stays).sum()), int((~counts).sum())


def _inside(xy: Array, areas: Sequence[Array]) -> NDArray[np.bool_]:
    import shapely

    inside = np.zeros(len(xy), dtype=bool)
    for corners in areas:
        inside |= shapely.intersects_xy(shapely.Polygon(corners), *np.nan_to_num(xy, nan=np.inf).T)
    return inside


def _rows(instants: NDArray[np.int64], instant: int) -> slice:
    return slice(*np.searchsorted(instants, [instant, instant + 1]).tolist())
