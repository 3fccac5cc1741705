"""What a changed area is compared with: the log rate of the comparison areas taken together, and its weights.

Taken together means one of two things. Without weights the areas are one area: sum of numerators / sum of denominators.
With weights w_j, sum 1, the log rate is sum_j w_j ln r_j. The weights are those of synthetic difference in differences
(Arkhangelsky, Athey, Hirshberg, Imbens & Wager, American Economic Review 111, 2021): they make the weeks before the
change run parallel to those of the changed area,

    minimise  sum_w (y_tw - sum_j w_j y_jw)^2 + zeta^2 W sum_j w_j^2,   w_j >= 0, sum w_j = 1,

y the weekly log rates less their mean over weeks, W the weeks, zeta^2 = sqrt(W_after) times the variance of the
comparison areas' weekly steps. The second term pulls towards equal weights, so that no area is chosen for its noise.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.stats.period_days import Floats, Ints, PeriodDays

MIN_WEEKS: Final = 10
"""Weeks before the change that weights need."""
MIN_AREAS: Final = 2


def synthetic_weights(changed: npt.ArrayLike, others: npt.ArrayLike, *, weeks_after: float) -> Floats:
    """Return the weights of comparison areas that make their weeks run like those of the changed area.

    Args:
        changed: Weekly log rates of the changed area before the change, shape (n_weeks,).
        others: Those of the comparison areas, shape (n_areas, n_weeks).
        weeks_after: Weeks after the change that are to be compared.

    Returns:
        Shape (n_areas,), none negative, sum 1.
    """
    from scipy.optimize import nnls  # takes a tenth of a second to import, and few changes have so many weeks

    y, z = np.asarray(changed, dtype=np.float64), np.asarray(others, dtype=np.float64)
    y, z = y - y.mean(), z - z.mean(axis=1, keepdims=True)
    n_areas, n_weeks = z.shape
    steps = np.diff(z, axis=1)
    zeta = float(weeks_after) ** 0.25 * float(steps.std(ddof=1))
    # with sum w = 1 the residual is sum_j w_j (z_j - y): the point of a convex hull nearest to 0
    apart = np.vstack([(z - y).T, zeta * np.sqrt(n_weeks) * np.eye(n_areas)])
    scale = max(float(np.abs(apart).max()), 1e-300)
    weights, _ = nnls(np.vstack([apart / scale, np.ones(n_areas)]), np.append(np.zeros(len(apart)), 1.0))
    return np.asarray(weights / weights.sum(), dtype=np.float64)


def weights_of(history: PeriodDays, *, weeks_after: float) -> Floats | None:
    """Return the weights of a history's comparison areas, or None where they are taken together as one area.

    Areas with a week without anything counted have weight 0. None with fewer than ten weeks, or fewer than two areas
    that had something in every week.
    """
    week, changed, others = weekly_log_rates(history)
    if len(week) < MIN_WEEKS or not np.isfinite(changed).all():
        return None
    usable = np.isfinite(others).all(axis=1)
    if usable.sum() < MIN_AREAS:
        return None
    weights = np.zeros(history.n_areas)
    weights[usable] = synthetic_weights(changed, others[usable], weeks_after=weeks_after)
    return weights


def weekly_log_rates(period: PeriodDays) -> tuple[Ints, Floats, Floats]:
    """Return the weeks, and the log rates of the changed area and of each comparison area by week.

    Returns:
        Week numbers (n_weeks,), log rates (n_weeks,) and (n_areas, n_weeks); NaN in a week without anything counted.
    """
    weeks, of_week = np.unique(period.week, return_inverse=True)
    member = (of_week[:, None] == np.arange(len(weeks))).astype(np.float64)
    n = np.vstack([period.n, period.comparison_n]) @ member
    x_h = np.vstack([period.x_h, period.comparison_x_h]) @ member
    logs = np.full(n.shape, np.nan)
    seen = (n > 0) & (x_h > 0)
    logs[seen] = np.log(n[seen] / x_h[seen])
    return weeks, logs[0], logs[1:]


def log_ratio(period: PeriodDays, weights: Floats | None = None) -> float:
    """Return ln r_t - ln r_c of a period: the changed area beside the comparison areas; ln r_t without any."""
    own = np.log(period.n.sum() / period.x_h.sum())
    if not period.n_areas:
        return float(own)
    if weights is None:
        return float(own - np.log(period.comparison_n.sum() / period.comparison_x_h.sum()))
    used = weights > 0
    n, x_h = (v[used].sum(axis=1) for v in (period.comparison_n, period.comparison_x_h))
    return float(own - weights[used] @ np.log(n / x_h))


def day_influence(period: PeriodDays, weights: Floats | None = None) -> Floats:
    """Return the influence of each day on `log_ratio`, shape (n_days,); they sum to 0."""
    own = influence_on_log(period.n, period.x_h)
    if not period.n_areas:
        return own
    if weights is None:
        return own - influence_on_log(period.comparison_n.sum(axis=0), period.comparison_x_h.sum(axis=0))
    used = np.flatnonzero(weights > 0)
    each = [influence_on_log(period.comparison_n[j], period.comparison_x_h[j]) for j in used]
    return np.asarray(own - weights[used] @ np.array(each), dtype=np.float64)


def influence_on_log(n: Floats, x_h: Floats) -> Floats:
    """Return the influence of each day on ln(sum n / sum x): (n_d - r x_d) / sum n."""
    total = n.sum()
    return np.asarray((n - total / x_h.sum() * x_h) / total, dtype=np.float64)


def weekly_log_ratios(period: PeriodDays, weights: Floats | None = None) -> tuple[Ints, Floats]:
    """Return the weeks and the log ratio of each; NaN in a week in which an area used has nothing counted."""
    weeks, own, others = weekly_log_rates(period)
    if weights is not None:
        used = weights > 0
        return weeks, np.asarray(own - weights[used] @ others[used], dtype=np.float64)
    member = (period.week[:, None] == weeks).astype(np.float64)
    n, x_h = ((v.sum(axis=0) @ member) for v in (period.comparison_n, period.comparison_x_h))
    logs = np.full(len(weeks), np.nan)
    logs[(n > 0) & (x_h > 0)] = np.log(n[(n > 0) & (x_h > 0)] / x_h[(n > 0) & (x_h > 0)])
    return weeks, np.asarray(own - logs, dtype=np.float64)
