"""A sum of money, tickets or the like per visit or person-hour, with days as clusters."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.estimates import RateEstimate, no_rate
from vsd_analytics.stats.rates import encounter_rate

_SCALE: Final = 1e6
"""Sum to which values are brought: a sum of money is no count, so no rule for few events may depend on its unit."""


def value_per(
    values: npt.ArrayLike,
    per: npt.ArrayLike,
    *,
    least: float,
    why_few: Reason,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
) -> RateEstimate:
    """Return a sum per something that people make: r = sum_d v_d / sum_d p_d, with its interval.

    The ratio estimator with days as clusters, as `encounter_rate`; differences between weekdays are in its interval.

    Args:
        values: The sum of each day, shape (n_days,).
        per: Visits or person-hours of the same hours, same shape; 0 = the day says nothing.
        least: Sum of `per` that the ratio needs.
        why_few: Reason where there is less.
        confidence: Confidence level.
        min_days: Days an interval needs.

    Returns:
        The ratio in the unit of the values; 0 has no interval. A negative sum of a day, such as refunds, has none.

    Raises:
        ValueError: Shapes do not fit, or `per` is negative or infinite.
    """
    sums, people = np.asarray(values, dtype=np.float64), np.asarray(per, dtype=np.float64)
    used = people > 0
    if (sums[used] < 0).any():
        return no_rate(Reason("context.negative"), "not_enough_data")
    total, total_people = float(sums[used].sum()), float(people[used].sum())
    if total_people < least or not used.any():
        return no_rate(why_few, "not_enough_data")
    if total == 0:
        nothing = no_rate(Reason("context.zero"), "not_enough_data")
        return replace(nothing, value=0.0, n_days=int(used.sum()), exposure_h=total_people)
    scale = _SCALE / total
    found = encounter_rate(sums * scale, people, confidence=confidence, min_days=min_days, min_exposure_h=0.0)
    value, lo, hi = (None if v is None else v / scale for v in (found.value, found.lo, found.hi))
    return replace(found, value=value, lo=lo, hi=hi, n_events=None)
