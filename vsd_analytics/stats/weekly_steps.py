"""How much a site's weeks differ: what its own weekly steps say about a change from one week to the next.

Days tell how a week differs from the next as far as days differ. A school holiday, an exhibition or a cold week moves
all days of a week together, and days of a week lean on each other; the days do not show either. The steps of the weeks
before do. With r_t the rate of week t over the weekdays compared and d_t = ln r_t+1 - ln r_t, of the last m (up to 12)
steps

    S = mean of min(d_t^2, (3 scale)^2),   scale = median |d_t| / 0.6745,

on 2 m^2 / (3 m - 1) degrees of freedom: successive differences share a week, so m of them tell less than m independent
ones (von Neumann, Annals of Mathematical Statistics 12, 1941). The cap keeps one week in which something was changed
from making all later weeks uncertain; with fewer than 8 steps nothing is capped.

Before there are 8 steps a prior counts as well, pooled from two real profiles: in a workplace the variance of weekly
steps was what its days explain, in a science museum it was 3.6 times that (day sd .40, week sd .22, lag-1 correlation
.14). The prior is v + 1.3 (v - noise), the mean of the two, with v the variance the days explain and noise the part of
it that any Poisson count has; it counts 6 degrees of freedom without a step and none from 8 steps on.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.stats.influence import DayCounts, Floats, as_history

MAX_STEPS: Final = 12
FULL_STEPS: Final = 8  # from here on the site's own steps speak alone
PRIOR_EXTRA: Final = 1.3  # variance of a step beyond what days explain over that: workplace 0, museum 2.6
PRIOR_DF: Final = 6.0
OUTLIER: Final = 3.0  # steps count at most that many robust standard deviations
MEDIAN_OF_NORMAL: Final = 0.6744897501960817  # median |z|


def weekly_steps(history_n: npt.ArrayLike, history_x_h: npt.ArrayLike, *, of: DayCounts) -> Floats:
    """Return d_t, the log ratios of successive weeks up to and with the first of the two that are compared.

    A week takes part when every camera-day compared was recorded in it and anything was counted. Where one does not,
    the step leads from the week before it to the week after.

    Args:
        history_n: Violations (or person-hours) of the weeks before, oldest first, shape (n_weeks, n_cameras, n_days),
            on the weekdays compared.
        history_x_h: Exposure in hours, same shape; 0 or NaN = not recorded.
        of: The first of the periods compared, with the camera-days that are compared.

    Returns:
        The last 12 steps at most, oldest first.

    Raises:
        ValueError: As for `as_history`.
    """
    is_compared = of.x > 0
    logs = []
    for n, x_h in zip(np.asarray(history_n, dtype=float), np.asarray(history_x_h, dtype=float), strict=True):
        week = as_history(n, x_h, of=of)
        if (week.x > 0)[is_compared].all() and week.n[is_compared].sum() > 0:
            logs.append(_log_rate(week, is_compared))
    if logs and of.n.sum() > 0:
        logs.append(_log_rate(of, is_compared))
    return np.diff(np.array(logs, dtype=np.float64))[-MAX_STEPS:]


def step_variance(steps: Floats, *, day_variance: float, noise: float) -> tuple[float, float]:
    """Return the variance of a weekly step, and its degrees of freedom.

    Args:
        steps: From `weekly_steps`.
        day_variance: Variance of ln theta between two weeks as days explain it.
        noise: The part of it that independent violations make, sum over both weeks of p_c^2 / n_c.
    """
    m = len(steps)
    own, own_df = (mean_square(steps), 2 * m**2 / (3 * m - 1)) if m else (0.0, 0.0)
    prior_df = PRIOR_DF * max(0.0, 1 - m / FULL_STEPS)
    prior = day_variance + PRIOR_EXTRA * max(0.0, day_variance - noise)
    df = own_df + prior_df
    return (own_df * own + prior_df * prior) / df, df


def mean_square(steps: Floats) -> float:
    """Return S: the mean square of steps, from 8 steps on with outliers capped."""
    squares = steps**2
    if len(steps) >= FULL_STEPS:
        squares = np.minimum(squares, (OUTLIER * np.median(np.abs(steps)) / MEDIAN_OF_NORMAL) ** 2)
    return float(squares.mean())


def _log_rate(week: DayCounts, is_compared: npt.NDArray[np.bool_]) -> float:
    n, x_h = (np.where(is_compared, values, 0.0).sum(axis=1) for values in (week.n, week.x))
    return float(np.log((n / x_h).sum()))
