"""How the changed area moved against the comparison areas before the change, and where that line would have led.

Weekly log ratios y_w, w = 1..W, before the change: slope b by least squares, residual variance s^2 on W - 2 degrees of
freedom, S = sum (w - mean w)^2. The slope that the weeks would have shown with a probability of 80 % is b* with
P(|T| > t) = 0.8 for Student's t with noncentrality b* sqrt(S) / s. The line continued to the middle t of n weeks after
the change has the prediction variance s^2 (1/n + 1/W + (t - mean w)^2 / S).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import nctdtrinc

from vsd_analytics.stats.comparison_weights import log_ratio, weekly_log_ratios
from vsd_analytics.stats.period_days import Floats, PeriodDays
from vsd_analytics.stats.quantiles import t_quantile

MIN_WEEKS: Final = 3
MIN_WEEKS_CONTINUED: Final = 8
"""Weeks before the change from which on their line is continued behind it."""
POWER: Final = 0.8


@dataclass(frozen=True, slots=True)
class PriorTrend:
    """How the ratio of the changed area to the comparison areas moved per week before the change.

    Attributes:
        value: Relative change per week, exp(slope) - 1.
        lo, hi: Its interval.
        n_weeks: Weeks it was fitted over.
        is_flat: The interval holds 0. It says little where `detectable_per_week` is large.
        detectable_per_week: The relative change per week that would have shown with a probability of 80 %: anything
            slower may have gone unseen. None where the weeks lie on a line exactly.
    """

    value: float
    lo: float
    hi: float
    n_weeks: int
    is_flat: bool
    detectable_per_week: float | None


def prior_trend(history: PeriodDays, weights: Floats | None, *, confidence: float) -> PriorTrend | None:
    """Return the slope of the weekly log ratio before the change, or None with fewer than three weeks.

    Also None where a week has nothing counted.

    Args:
        history: The days before the change.
        weights: Of the comparison areas; None = taken together as one.
        confidence: Of the interval.
    """
    weeks, y = weekly_log_ratios(history, weights)
    if len(weeks) < MIN_WEEKS or not np.isfinite(y).all():
        return None
    slope, variance, df, spread = _line(weeks, y)
    se = math.sqrt(variance / spread)
    half = t_quantile(df, confidence=confidence) * se
    lo, hi = slope - half, slope + half
    seen = float(nctdtrinc(df, 1 - POWER, t_quantile(df, confidence=confidence))) * se
    return PriorTrend(
        value=math.expm1(slope),
        lo=math.expm1(lo),
        hi=math.expm1(hi),
        n_weeks=len(weeks),
        is_flat=lo <= 0 <= hi,
        detectable_per_week=math.expm1(seen) if 0 < seen < math.inf else None,
    )


def beside_the_line(
    history: PeriodDays, after: PeriodDays, weights: Floats | None, *, apart_weeks: float, confidence: float
) -> tuple[float, float] | None:
    """Return ln theta beside the line of the weeks before, continued, and the half width of its interval.

    Args:
        history: The days before the change.
        after: The days after it.
        weights: Of the comparison areas; None = taken together as one.
        apart_weeks: From the last week of `history` to the middle of `after`, in weeks.
        confidence: Of the interval.

    Returns:
        None with fewer than eight weeks before, or a week without anything counted.
    """
    weeks, y = weekly_log_ratios(history, weights)
    if len(weeks) < MIN_WEEKS_CONTINUED or not np.isfinite(y).all():
        return None
    slope, variance, df, spread = _line(weeks, y)
    n_after = len(np.unique(after.week))
    reach = float(weeks[-1] - weeks.mean()) + apart_weeks
    log_theta = log_ratio(after, weights) - float(y.mean()) - slope * reach
    se = math.sqrt(variance * (1 / n_after + 1 / len(weeks) + reach**2 / spread))
    return log_theta, t_quantile(df, confidence=confidence) * se


def _line(weeks: Floats | np.typing.NDArray[np.int64], y: Floats) -> tuple[float, float, int, float]:
    """Return slope, residual variance, degrees of freedom and S of a least-squares line."""
    at = weeks - weeks.mean()
    spread = float(at @ at)
    slope = float(at @ y / spread)
    rest = y - y.mean() - slope * at
    df = len(y) - 2
    return slope, float(rest @ rest) / df, df, spread
