"""How far a predicted change may be off: days, the time too close it rests on, and what replayed people miss."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from vsd_analytics.whatif.arrays import Floats

REPLAY_SD: Final = 0.04
"""Standard deviation of replayed over recorded time too close, six places, as a share."""
NO_CHANGE: Final = 0.013
"""The largest change that an edit which touched nobody has given."""
MIN_CLOSE_S: Final = 15.0
"""Places with less person-time too close say nothing."""
PER_SECOND: Final = ((1.0, 1.4), (2.0, 3.1))
"""Variance of the ratio times person-seconds too close, by distance in metres: people meet for seconds, not for one."""
Z: Final = 1.645
"""Of a range that is to hold 90 %."""


@dataclass(frozen=True, slots=True)
class PredictedChange:
    """A change of the time too close, relative: -0.1 = 10 % less.

    Attributes:
        value: Mean over the ways in which people may pass.
        lo, hi: Range that is to hold 90 %.
    """

    value: float
    lo: float
    hi: float


def spread(*, close_s: float, within_m: float, by_day: Floats, extra_sd: float = 0.0) -> float:
    """Return the standard deviation of a predicted ratio of time too close.

    sd^2 = c / E + 0.04^2 + extra_sd^2 + s^2 / D, with E person-seconds too close, c of `PER_SECOND`, and s the standard
    deviation of the ratio over D days.

    Args:
        close_s: Person-seconds too close, recorded.
        within_m: The distance.
        by_day: The ratio by day, shape (n_days,); NaN where nobody was too close.
        extra_sd: Measured error of this kind of edit.
    """
    per_second = float(np.interp(within_m, [d for d, _ in PER_SECOND], [c for _, c in PER_SECOND]))
    days = by_day[np.isfinite(by_day)]
    of_days = float(days.var(ddof=1)) / days.size if days.size > 1 else 0.0
    return math.sqrt(per_second / close_s + REPLAY_SD**2 + extra_sd**2 + of_days)


def predicted_change(changes: Sequence[float], sd: float) -> PredictedChange:
    """Return the range of a change: from the least to the largest model, and beyond both by 1.645 sd.

    Args:
        changes: Relative change of the time too close by each model.
        sd: Of `spread`.
    """
    return PredictedChange(float(np.mean(changes)), max(min(changes) - Z * sd, -1.0), max(changes) + Z * sd)


def reaching_farther(change: PredictedChange, by: float) -> PredictedChange:
    """Return a range that reaches farther on both sides."""
    return PredictedChange(change.value, max(change.lo - by, -1.0), change.hi + by)
