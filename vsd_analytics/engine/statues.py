"""People who never move: mannequins, pictures of people, cardboard figures, as a detector finds them for hours.

A statue is a place in the picture where a box of the same size and at the same spot comes back in most frames for
hours, while boxes elsewhere come and go. Somebody who stands or sits shifts by more than that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.people import Array, People

LEAST_S: Final = 2 * 3600.0
"""So long a box must come back."""
STILL_SHARE: Final = 0.04
"""Sd of the middle of a box that does not move, against its height: what the edges of a detector's boxes jitter."""
LEAST_PRESENCE: Final = 0.5
"""And be there in this part of the frames."""
CELL_SHARE: Final = 0.2
"""Boxes are compared with those whose middle is within this much of their height."""
LEAST_OTHERS: Final = 20
"""So many boxes must be elsewhere: where nobody walks, nobody is known to stand."""


@dataclass(frozen=True, slots=True)
class Statue:
    """A place in the picture where somebody never moves.

    Attributes:
        box: Median box in pixels, shape (4,).
        presence: Share of frames in which it was found.
        rows: Its rows among the people.
    """

    box: Array
    presence: float
    rows: NDArray[np.intp]


def statues(people: People, *, ts_ms: NDArray[np.int64]) -> list[Statue]:
    """Return the people who never move, those seen most first.

    Args:
        people: Boxes.
        ts_ms: UTC milliseconds of each of `people.frames`.
    """
    if len(ts_ms) < 2 or (ts_ms[-1] - ts_ms[0]) / 1000 < LEAST_S:
        return []
    box = people.outline
    middle = (box[:, :2] + box[:, 2:]) / 2
    height = box[:, 3] - box[:, 1]
    free = np.asarray(np.isfinite(box).all(axis=1), dtype=np.bool_)
    least = LEAST_PRESENCE * len(people.frames)
    still_places: list[Statue] = []
    while free.sum() > least:
        rows = np.flatnonzero(free)
        near = _nearest_crowd(middle[rows], height[rows])
        rows = rows[near]
        typical = np.median(np.column_stack([middle[rows], height[rows]]), axis=0)
        still = np.abs(middle[rows] - typical[:2]).max(axis=1) < 3 * STILL_SHARE * typical[2]
        still &= np.abs(height[rows] - typical[2]) < 6 * STILL_SHARE * typical[2]
        same = rows[still]
        presence = len(np.unique(people.frame[same])) / len(people.frames)
        spread = middle[same].std(axis=0).max() / typical[2] if len(same) else np.inf
        lasts = np.ptp(ts_ms[np.searchsorted(people.frames, people.frame[same])]) / 1000 if len(same) else 0.0
        if presence >= LEAST_PRESENCE and spread <= STILL_SHARE and lasts >= LEAST_S:
            still_places.append(Statue(np.median(box[same], axis=0), presence, same))
        elif len(rows) <= least:
            break
        free[rows] = False
    others = int(np.isfinite(box).all(axis=1).sum()) - sum(len(statue.rows) for statue in still_places)
    return sorted(still_places, key=lambda statue: -statue.presence) if others >= LEAST_OTHERS else []


def _nearest_crowd(middle: Array, height: Array) -> NDArray[np.intp]:
    """Return the boxes around the spot where most boxes are."""
    size = float(np.median(height)) * CELL_SHARE
    cells = np.floor(middle / max(size, 1.0)).astype(np.int64)
    _, cell, n = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    heart = np.median(middle[cell.ravel() == int(n.argmax())], axis=0)
    return np.flatnonzero(np.abs(middle - heart).max(axis=1) < size)
