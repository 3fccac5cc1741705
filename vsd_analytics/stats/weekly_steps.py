"""How much a site's weeks differ: what its own weekly steps say about a change from one week to the next.

Days tell how a week differs from the next as far as days differ. A school holiday, an exhibition or a cold week moves
all days of a week together, and days of a week lean on each other; the days do not show either. The steps of the weeks
before do. With r_t the rate of week t over the weekdays compared and d_t = ln r_t+1 - ln r_t, of the last m (up to 12)
steps

    S = mean of min(d_t^2, (3 scale)^2),   scale = median |d_t| / 0.6745,

on 2 m^2 / (3 m - 1) degrees of freedom: successive differences share a week, so m of them tell less than m independent
ones (von Neumann, Annals of Mathematical Statistics 12, 1941). The cap keeps one week in which something was changed
from making all later weeks uncertain; with fewer than 8 steps nothing is capped.

Before there are 4 steps a prior counts as well, pooled from two real profiles. In a workplace the variance of weekly
steps was what its days explain: weeks had no effect of their own. In a science museum it was 3.6 times that (day sd
.40, week sd .22, lag-1 correlation .14). The prior is

    v + max(2.6 (v - noise), 2 .08^2 / W),

with v the variance the days explain, noise the part of it that any Poisson count has, and W the weeks in each period: a
site without history may be as restless for its days as the museum, and calm days do not prove calm weeks. A week sd
of .08 lies between the two profiles. It is the least with which false verdicts stay below 5 % in every world of
docs/statistics.md; with .075 they reach 6.6 %. The prior counts 6 degrees of freedom without a step and none from
4 steps on: from there on the site's own steps have fewer false verdicts, and in calm sites far more power.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.stats.influence import DayCounts, Floats, as_history

MAX_STEPS: Final = 12
FULL_STEPS: Final = 8  # from here on outliers are capped, and steps suffice without an interval by days
PRIOR_STEPS: Final = 4  # from here on the prior does not count
PRIOR_EXTRA: Final = 2.6  # variance of a step beyond what days explain over that, in the museum; workplace 0
PRIOR_WEEK_SD: Final = 0.08  # of a week's own effect, at least; workplace 0, museum .22
PRIOR_DF: Final = 6.0
DAYS_A_WEEK: Final = 7
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


def step_variance(
    steps: Floats, *, day_variance: float, noise: float, n_days: int = DAYS_A_WEEK
) -> tuple[float, float]:
    """Return the variance of the change from one period to the next as weeks differ, and its degrees of freedom.

    Args:
        steps: From `weekly_steps`; empty for periods of more than one week.
        day_variance: Variance of ln theta between two weeks as days explain it.
        noise: The part of it that independent violations make, sum over both weeks of p_c^2 / n_c.
        n_days: Days in each period; W = n_days / 7, at least 1.
    """
    m = len(steps)
    own, own_df = (mean_square(steps), 2 * m**2 / (3 * m - 1)) if m else (0.0, 0.0)
    prior_df = PRIOR_DF * max(0.0, 1 - m / PRIOR_STEPS)
    own_weeks = 2 * PRIOR_WEEK_SD**2 / max(1.0, n_days / DAYS_A_WEEK)
    prior = day_variance + max(PRIOR_EXTRA * (day_variance - noise), own_weeks)
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
