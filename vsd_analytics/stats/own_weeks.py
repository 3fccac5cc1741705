"""How much areas have weeks of their own: variance between weeks of an area beside the others, beyond its days.

With y_jw the log rate of area j in week w, two-way residuals e_jw (area and week means taken out) have the variance

    s^2 = sum e_jw^2 / ((J-1)(W-1)).

Days explain v of it: with i_jd the influence of day d on y_jw less that on the log rate of all areas together, weekday
means over weeks taken out, v is J/(J-1) W/(W-1) times the mean over areas and weeks of D/(D-1) sum_d i_jd^2. What is
left, max(0, s^2 - v), is pooled with a prior,

    tau^2 = (f (s^2 - v) + f_0 tau_0^2) / (f + f_0),   f = (J-1)(W-1).
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.stats.comparison_weights import influence_on_log, weekly_log_rates
from vsd_analytics.stats.period_days import Floats, PeriodDays

PRIOR_SD: Final = 0.10
"""tau_0: the larger of the two sizes of own weeks with which the proofs of before and after are made."""
PRIOR_DF: Final = 4.0
"""f_0: the prior counts as much as four weekly comparisons of two areas."""
MIN_WEEKS: Final = 2


def own_weeks_variance(history: PeriodDays) -> tuple[float, float]:
    """Return tau^2, the variance of an area's own weeks on the log scale, and its degrees of freedom.

    Args:
        history: The days before the change, all areas. Areas with a week without anything counted do not take part;
            with fewer than two left, or fewer than two weeks, the prior is all there is.
    """
    week, changed, others = weekly_log_rates(history)
    logs = np.vstack([changed, others])
    usable = np.asarray(np.isfinite(logs).all(axis=1))
    n_areas, n_weeks = int(usable.sum()), len(week)
    if n_areas < MIN_WEEKS or n_weeks < MIN_WEEKS:
        return PRIOR_SD**2, PRIOR_DF
    y = logs[usable]
    rest = y - y.mean(axis=1, keepdims=True) - y.mean(axis=0) + y.mean()
    df = float((n_areas - 1) * (n_weeks - 1))
    variance = max(0.0, float((rest**2).sum()) / df - _by_days(history, usable))
    return (df * variance + PRIOR_DF * PRIOR_SD**2) / (df + PRIOR_DF), df + PRIOR_DF


def _by_days(history: PeriodDays, usable: npt.NDArray[np.bool_]) -> float:
    """Return v, the part of the variance between weeks that the differences between days make by themselves."""
    n = np.vstack([history.n, history.comparison_n])[usable]
    x_h = np.vstack([history.x_h, history.comparison_x_h])[usable]
    by_day, n_days = np.zeros_like(n), np.ones(n.shape[1])
    for week in np.unique(history.week):
        days = history.week == week
        site = influence_on_log(n[:, days].sum(axis=0), x_h[:, days].sum(axis=0))
        by_day[:, days] = np.array([influence_on_log(*row) for row in zip(n[:, days], x_h[:, days], strict=True)])
        by_day[:, days] -= site
        n_days[days] = days.sum()
    for weekday in np.unique(history.weekday):
        same = history.weekday == weekday
        by_day[:, same] -= by_day[:, same].mean(axis=1, keepdims=True)
    n_areas, n_weeks = len(n), len(np.unique(history.week))
    squares: Floats = by_day**2 * (n_days / np.maximum(n_days - 1, 1))
    return float(squares.sum()) / (n_areas * n_weeks) * n_areas / (n_areas - 1) * n_weeks / (n_weeks - 1)
