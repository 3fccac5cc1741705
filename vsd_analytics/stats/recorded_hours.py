"""Weights of recorded hours, which also count for hours not recorded: direct standardisation by hour of the week.

A camera that is dead in the busy hours of some days leaves too many quiet hours. Each recorded hour therefore counts
for the open hours of its weekday and hour of the day (post-stratification). Where a weekday's hour was never recorded,
the same hour of the other weekdays counts for it. For hours of the day that were never recorded nothing does.

Sources: direct standardisation, Kitagawa, J. Am. Stat. Assoc. 50 (1955); post-stratification, Holt and Smith, J. R.
Stat. Soc. A 142 (1979).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

MOST_UNKNOWN: Final = 0.05
"""Share of the open time in hours of the day that were never recorded, above which nothing is said of the whole."""

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class RecordedHours:
    """How much each recorded hour counts.

    Attributes:
        weight: By hour, shape (n_hours,); 0 where not recorded. Recorded open time keeps its sum. 1 everywhere
            where all hours were recorded.
        unknown_share: Share of the open time in hours of the day that were never recorded.
        unknown_hours: These hours of the day.
    """

    weight: Array
    unknown_share: float
    unknown_hours: tuple[int, ...]

    @property
    def covers_all(self) -> bool:
        """Tell whether the recorded hours say something of (nearly) all open hours of the day."""
        return self.unknown_share <= MOST_UNKNOWN


def recorded_hours(
    weekday: npt.ArrayLike, hour: npt.ArrayLike, open_s: npt.ArrayLike, is_recorded: npt.ArrayLike
) -> RecordedHours:
    """Return how much each recorded hour counts.

    With O open and R recorded open time, by weekday and hour of the day (d, h): w = (O_dh / R_dh) (O_h / O'_h), O'_h
    the open time at hour h of weekdays on which it was recorded at all; then scaled to sum w R = sum R.

    Args:
        weekday: Weekday of each hour, any integers, shape (n_hours,).
        hour: Hour of the day, same shape.
        open_s: Open seconds, same shape; 0 = closed, or outside the period.
        is_recorded: The hour counts, same shape.

    Raises:
        ValueError: Shapes do not fit, or open time is negative.
    """
    days, hours = np.asarray(weekday, dtype=np.int64), np.asarray(hour, dtype=np.int64)
    opened, known = np.asarray(open_s, dtype=np.float64), np.asarray(is_recorded, dtype=np.bool_)
    if not days.shape == hours.shape == opened.shape == known.shape or days.ndim != 1:
        raise ValueError("every hour needs a weekday, an hour of the day, its open time and whether it was recorded")
    if (opened < 0).any():
        raise ValueError("open time is at least 0")
    known = known & (opened > 0)
    cells, cell = np.unique(np.column_stack([hours, days]), axis=0, return_inverse=True)
    slots, slot_of_cell = np.unique(cells[:, 0], return_inverse=True)
    of_cell, recorded = (np.bincount(cell, weights=opened * m, minlength=len(cells)) for m in (1.0, known))
    of_slot = np.bincount(slot_of_cell, weights=of_cell, minlength=len(slots))
    in_known = np.bincount(slot_of_cell, weights=of_cell * (recorded > 0), minlength=len(slots))
    per_cell = np.divide(of_cell, recorded, out=np.zeros_like(of_cell), where=recorded > 0)
    per_slot = np.divide(of_slot, in_known, out=np.zeros_like(of_slot), where=in_known > 0)
    weight = np.where(known, (per_cell * per_slot[slot_of_cell])[cell], 0.0)
    total = float((weight * opened).sum())
    if total:
        weight = weight * float(opened[known].sum()) / total
    is_unknown = (of_slot > 0) & (in_known == 0)
    whole = float(of_slot.sum())
    return RecordedHours(
        weight, float(of_slot[is_unknown].sum()) / whole if whole else 0.0, tuple(slots[is_unknown].tolist())
    )
