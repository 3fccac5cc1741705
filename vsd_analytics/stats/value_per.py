"""A sum of money, tickets or the like per visit or person-hour, with days as clusters."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

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
    history: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
) -> RateEstimate:
    """Return a sum per something that people make: r = sum_d v_d / sum_d p_d, with its interval.

    The ratio estimator with days as clusters, as `encounter_rate`. Without four weeks of history, differences between
    weekdays are in its interval, and days are taken to resemble each other little.

    Args:
        values: The sum of each day of a week, Monday first, shape (7,).
        per: Visits or person-hours of the same hours, same shape; 0 = the day says nothing.
        least: Sum of `per` that the ratio needs.
        why_few: Reason where there is less.
        history: Values and `per` of the weeks before, oldest first, each of shape (n_weeks, 7); None = no weeks.
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
    estimate = encounter_rate(
        sums * scale, people, **_past(history, used, scale),
        confidence=confidence, min_days=min_days, min_exposure_h=0.0,
    )  # fmt: skip
    value, lo, hi = (None if v is None else v / scale for v in (estimate.value, estimate.lo, estimate.hi))
    return replace(estimate, value=value, lo=lo, hi=hi, n_events=None)


def _past(
    history: tuple[npt.ArrayLike, npt.ArrayLike] | None, used: npt.NDArray[np.bool_], scale: float
) -> dict[str, Any]:
    """Return the arguments that give weeks before to a rate: their days with people, on weekdays of the week."""
    if history is None:
        return {}
    sums, people = (np.asarray(each, dtype=np.float64) for each in history)
    is_used = (people > 0) & (sums >= 0) & used
    if not is_used.any():
        return {}
    weekday = np.broadcast_to(np.arange(people.shape[1]), people.shape)[is_used]
    return {
        "weekday": np.arange(people.shape[1]),
        "history_n": sums[is_used] * scale,
        "history_exposure_h": people[is_used],
        "history_weekday": weekday,
    }
