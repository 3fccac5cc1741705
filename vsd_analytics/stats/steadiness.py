"""How much a site's days differ from week to week, from the weeks before a comparison.

Two weeks of five open days tell their own day-to-day variance on four degrees of freedom only, and Student's t is wide
there. The weeks before know more. With i_wd the relative influence of day d on the rate of week w
(`vsd_analytics.stats.influence`), W complete weeks of D days, the interaction of a two-way table,

    v = 2 D  sum_wd (i_wd - mean_w i_wd)^2 / ((D-1)(W-1)),

estimates var(ln theta) between two such weeks: weekday means are taken out, and so is each week's level, as influences
of a week sum to 0. It is pooled with the comparison's own variance s on f degrees of freedom, in the manner of
moderated variances (Smyth, Statistical Applications in Genetics and Molecular Biology 3, 2004):

    (f s + f_0 v) / (f + f_0)   on f + f_0,   f_0 = min((D-1)(W-1), f),

so that the weeks compared keep at least half of the say. Weeks less steady than usual, s / v above the 90 % point
of F(f, f_0), are judged by themselves alone. Coverage by simulation, unsteady sites included: docs/statistics.md.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import fdtri

from vsd_analytics.stats.influence import DayCounts, as_history, influence

MIN_WEEKS: Final = 4  # complete weeks before it says anything
SHARE_OF_PAST: Final = 1.0  # the past counts at most this many times the degrees of freedom of the weeks compared
UNSTEADY: Final = 0.90  # quantile of F above which the weeks compared are judged by themselves


def usual_variance(
    history_n: npt.ArrayLike, history_x_h: npt.ArrayLike, *, of: DayCounts
) -> tuple[float, float] | None:
    """Return the usual variance of ln theta between two weeks, and its degrees of freedom.

    Args:
        history_n: Violations (or person-hours) of the weeks before, shape (n_weeks, n_cameras, n_days), the same
            weekdays as the comparison has.
        history_x_h: Exposure in hours, same shape; 0 or NaN = not recorded.
        of: One of the periods compared, limited to the cameras that are compared.

    Returns:
        None with fewer than `MIN_WEEKS` weeks in which every compared camera recorded every day and anything was
        counted.

    Raises:
        ValueError: As for `as_history`.
    """
    by_day = []
    for n, x_h in zip(np.asarray(history_n, dtype=float), np.asarray(history_x_h, dtype=float), strict=True):
        week = as_history(n, x_h, of=of)
        if (week.x > 0).all() and week.n.sum() > 0:
            by_day.append(influence(week).by_day)
    if len(by_day) < MIN_WEEKS:
        return None
    residuals = np.array(by_day) - np.mean(by_day, axis=0)
    n_weeks, n_days = residuals.shape
    df = (n_days - 1) * (n_weeks - 1)
    return 2 * n_days * float((residuals**2).sum()) / df, float(df)


def pooled(variance: float, df: float, *, usual: tuple[float, float]) -> tuple[float, float]:
    """Return a comparison's variance and degrees of freedom with those of the weeks before pooled in.

    Args:
        variance: var(ln theta) from the weeks compared.
        df: Its degrees of freedom.
        usual: From `usual_variance`.
    """
    past, past_df = usual[0], min(usual[1], SHARE_OF_PAST * df)
    if past <= 0 or variance > past * float(fdtri(df, past_df, UNSTEADY)):
        return variance, df
    return (df * variance + past_df * past) / (df + past_df), df + past_df
