"""What a series of days, such as footfall or temperature, does to violations, and a week's change at an equal value.

Within weeks: violations of day d of week w are modelled as

    E(n_wd) = x_wd exp(a_w + b_weekday + beta z_wd),

z the covariate (or its logarithm), x recorded open hours. The terms of weeks take out season and trend, which move
violations and many a series alike without one doing anything to the other; those of weekdays take out that both are
higher on Saturdays. What is left says what a day of higher z has more. beta is the Poisson pseudo-maximum-likelihood
estimate, which is consistent for counts of any spread as long as the mean is right (Gourieroux, Monfort and Trognon,
Econometrica 52, 1984; Santos Silva and Tenreyro, Review of Economics and Statistics 88, 2006). Its variance treats
weeks as clusters, since days in a row resemble each other (Liang and Zeger, Biometrika 73, 1986), on degrees of freedom
that know how evenly weeks say something (Bell and McCaffrey, Survey Methodology 28, 2002).

A series says what goes along with violations, not what causes them. Coverage by simulation: docs/context.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason, State
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.changes import compare_violation_rates
from vsd_analytics.stats.estimates import ChangeEstimate, no_change, verdict_of
from vsd_analytics.stats.quantiles import t_quantile
from vsd_analytics.stats.usual import DECAY, UsualRange, usual_range

Floats = npt.NDArray[np.float64]

MIN_WEEKS: Final = 8
"""Weeks before that an effect needs: with fewer its interval is too often too narrow, or too wide to say anything."""
MIN_EVENTS: Final = 100
"""Violations that an effect needs."""
DEPENDENT_WEEKS: Final = 2.0
"""Degrees of freedom that go because weeks in a row are not independent: as many as bring false effects to 5 %."""
MIN_SPREAD: Final = 1e-6
"""Variance of a covariate within weeks, relative to its square, up to which it says nothing."""
_STEPS: Final = 50
_EXACT: Final = 1e-10


@dataclass(frozen=True, slots=True)
class CovariateEffect:
    """What a covariate does to violations.

    Attributes:
        value: beta, the change of the logarithm of the rate for one unit of z; None where it cannot be estimated.
        lo, hi: Its interval.
        log_se: Its standard error.
        df: Degrees of freedom of Student's t.
        n_days, n_weeks: Days and weeks that it was made from.
        z_lo, z_hi: Least and greatest z of these days.
        z_step: Standard deviation of z within weeks and weekdays.
        state: "ok" where there is a value.
        reason: Why there is none.
    """

    value: float | None
    lo: float | None
    hi: float | None
    log_se: float | None
    df: float | None
    n_days: int
    n_weeks: int
    z_lo: float | None
    z_hi: float | None
    z_step: float | None
    state: State
    reason: Reason | None


def covariate_effect(
    n: npt.ArrayLike, x_h: npt.ArrayLike, z: npt.ArrayLike, *, confidence: float = DEFAULTS.confidence
) -> CovariateEffect:
    """Return what a covariate does to violations, by days of earlier weeks.

    Args:
        n: Violations, shape (n_weeks, 7), Monday first.
        x_h: Recorded open hours, same shape; 0 or NaN = not recorded.
        z: The covariate, or its logarithm, same shape; NaN = unknown.
        confidence: Confidence level.

    Returns:
        beta with its interval. A week counts with at least two days of which all three are known.

    Raises:
        ValueError: Shapes do not fit.
    """
    counts, hours, values = (np.asarray(a, dtype=np.float64) for a in (n, x_h, z))
    if counts.ndim != len(("week", "day")) or not counts.shape == hours.shape == values.shape:
        raise ValueError(f"weeks by days expected: {counts.shape}, {hours.shape}, {values.shape}")
    is_known = (np.nan_to_num(hours) > 0) & np.isfinite(values) & np.isfinite(counts)
    is_known &= (is_known.sum(axis=1) > 1)[:, None]
    is_known &= (np.where(is_known, counts, 0.0).sum(axis=1) > 0)[:, None]  # a week of zeros only tells its own level
    n_weeks, n_days = int(is_known.any(axis=1).sum()), int(is_known.sum())
    week, weekday = np.nonzero(is_known)
    y, x, c = counts[is_known], hours[is_known], values[is_known]
    nothing = CovariateEffect(None, None, None, None, None, n_days, n_weeks, None, None, None, "not_enough_data", None)
    if n_weeks < MIN_WEEKS:
        return replace(nothing, reason=Reason("context.weeks", least=MIN_WEEKS, has=n_weeks))
    if y.sum() < MIN_EVENTS:
        return replace(nothing, reason=Reason("context.events", least=MIN_EVENTS))
    dummies = _dummies(week, weekday)
    scale = float(np.abs(c - c.mean()).max()) or 1.0
    centred = (c - c.mean()) / scale
    fit = _fitted(np.column_stack((dummies, centred)), y, np.log(x))
    if fit is None:
        return replace(nothing, reason=Reason("context.constant"))
    beta, mean = fit
    left = centred - dummies @ _weighted(dummies, centred, mean)
    spread = float(mean @ left**2)
    if spread <= MIN_SPREAD * float(mean.sum()):
        return replace(nothing, reason=Reason("context.constant"))
    se, df = _clustered(left, mean, y - mean, week)
    reach = t_quantile(df, confidence=confidence) * se
    value = beta / scale
    return replace(
        nothing, value=value, lo=value - reach / scale, hi=value + reach / scale, log_se=se / scale, df=df,
        z_lo=float(c.min()), z_hi=float(c.max()), z_step=scale * math.sqrt(spread / float(mean.sum())), state="ok",
    )  # fmt: skip


def _dummies(week: npt.NDArray[np.int64], weekday: npt.NDArray[np.int64]) -> Floats:
    """Return a column for each week, and for each weekday but the first."""
    weeks, weekdays = np.unique(week), np.unique(weekday)[1:]
    dummies: Floats = np.column_stack([*(week == w for w in weeks), *(weekday == d for d in weekdays)]).astype(
        np.float64
    )
    return dummies


def _weighted(columns: Floats, values: Floats, weights: Floats) -> Floats:
    """Return the weighted least-squares coefficients of values on columns."""
    root = np.sqrt(weights)
    return np.asarray(np.linalg.lstsq(columns * root[:, None], values * root, rcond=None)[0], dtype=np.float64)


def _fitted(columns: Floats, y: Floats, offset: Floats) -> tuple[float, Floats] | None:
    """Return the last coefficient and the means of a Poisson fit by iterated weighted least squares; None without."""
    mean: Floats = np.maximum((y + y.mean()) / 2, 1e-3)
    before = math.inf
    for _ in range(_STEPS):
        eta = np.log(mean)
        coefficients = _weighted(columns, eta - offset + (y - mean) / mean, mean)
        mean = np.exp(np.clip(columns @ coefficients + offset, -30, 30))
        deviance = float((mean - y * np.log(mean)).sum())
        if abs(deviance - before) <= _EXACT * (abs(deviance) + 1):
            return float(coefficients[-1]), mean
        before = deviance
    return None


def _clustered(left: Floats, mean: Floats, residual: Floats, week: npt.NDArray[np.int64]) -> tuple[float, float]:
    """Return the standard error of beta with weeks as clusters, and its degrees of freedom.

    Residuals of a week are divided by what the fit takes from them (CR2 of Bell and McCaffrey, by the leverage of the
    week along z), and the sum of their squares is taken n/(n - 1) times. Where a week and the next lean the same way,
    as days in a row do over a Sunday night, that is added. The degrees of freedom are those of Satterthwaite for
    independent weeks, less `DEPENDENT_WEEKS`.
    """
    spread = float(mean @ left**2)
    weeks = np.unique(week)
    shares = np.array([float(mean[week == w] @ left[week == w] ** 2) for w in weeks]) / spread
    scores = np.array([float(left[week == w] @ residual[week == w]) for w in weeks])
    scores /= np.sqrt(np.maximum(1 - shares, 1e-6))
    factor = len(weeks) / (len(weeks) - 1)
    beside = float(scores[1:][np.diff(weeks) == 1] @ scores[:-1][np.diff(weeks) == 1])
    se = math.sqrt(factor * (float(scores @ scores) + 2 * max(beside, 0.0))) / spread
    cross = np.outer(shares, shares)
    moments = np.diag(shares) - cross  # covariance of scores of weeks after the fit, per unit of variance
    root = np.sqrt(np.maximum(1 - shares, 1e-6))
    scaled = moments / np.outer(root, root)
    df = float(np.trace(scaled)) ** 2 / float((scaled**2).sum())
    return se, max(df - DEPENDENT_WEEKS, 1.0)


def change_at_equal_covariate(
    before: tuple[npt.ArrayLike, npt.ArrayLike],
    now: tuple[npt.ArrayLike, npt.ArrayLike],
    z_before: npt.ArrayLike,
    z_now: npt.ArrayLike,
    effect: CovariateEffect,
    *,
    history: Sequence[tuple[npt.ArrayLike, npt.ArrayLike, npt.ArrayLike]] = (),
    confidence: float = DEFAULTS.confidence,
    about_same_share: float = DEFAULTS.about_same_share,
    **rules: Any,
) -> ChangeEstimate:
    """Return the change of violations per open hour (M0) from one week to the next at an equal value of a covariate.

    Recorded hours of day d count as x_d exp(beta (z_d - zbar)), the hours times what the covariate makes of them, in
    both weeks and in the earlier ones; with them the change is that of `compare_violation_rates`. Its interval is wider
    by what is not known of beta: half^2 = half_change^2 + (t se(beta) dz)^2, dz the difference of the weeks' mean z.

    Args:
        before: Violations and recorded open hours of the week before, each of shape (n_cameras, n_pairs).
        now: Those of the week.
        z_before: The covariate of the week before, shape (n_pairs,).
        z_now: That of the week.
        effect: Of `covariate_effect`, by weeks before `now`.
        history: Violations, hours and covariate of weeks before, oldest first.
        confidence: Confidence level.
        about_same_share: "About the same" needs the whole interval within 1 -+ this.
        **rules: Other settings of `compare_violation_rates`.

    Returns:
        The ratio with its interval and verdict. None is given where the effect has none, where a compared day has no
        value, or where a week's mean lies outside the days that the effect was made from.
    """
    if effect.value is None or effect.log_se is None or effect.df is None or effect.z_lo is None or effect.z_hi is None:
        return no_change(effect.reason or Reason("context.constant"), effect.state)
    z_a, z_b = np.asarray(z_before, dtype=np.float64), np.asarray(z_now, dtype=np.float64)
    hours_a, hours_b = (np.nan_to_num(np.asarray(x, dtype=np.float64)) for x in (before[1], now[1]))
    is_used = ((hours_a > 0) & (hours_b > 0)).any(axis=0)
    n_used, n_known = 2 * int(is_used.sum()), int(np.isfinite(z_a[is_used]).sum() + np.isfinite(z_b[is_used]).sum())
    if n_known < n_used:
        return no_change(Reason("context.incomplete", n=n_known, of=n_used), "not_enough_data")
    means = [_mean(hours, z) for hours, z in ((hours_a, z_a), (hours_b, z_b))]
    if not all(effect.z_lo <= mean <= effect.z_hi for mean in means):
        return no_change(Reason("context.outside"), "not_enough_data")
    centre = sum(means) / 2

    def weighed(x_h: npt.ArrayLike, z: npt.ArrayLike) -> Floats:
        assert effect.value is not None
        shift = np.clip(effect.value * (np.nan_to_num(np.asarray(z, np.float64), nan=centre) - centre), -30, 30)
        return np.asarray(x_h, dtype=np.float64) * np.exp(shift)

    known = [(n, weighed(x, z)) for n, x, z in history if _is_known(x, z)]
    estimate = compare_violation_rates(
        before[0], weighed(hours_a, z_a), now[0], weighed(hours_b, z_b),
        history_n=[np.asarray(n) for n, _ in known], history_x_h=[x for _, x in known],
        confidence=confidence, about_same_share=about_same_share, **rules,
    )  # fmt: skip
    if estimate.value is None or estimate.lo is None or estimate.hi is None or estimate.value <= 0 or estimate.lo <= 0:
        return estimate
    shift = t_quantile(effect.df, confidence=confidence) * effect.log_se * (means[1] - means[0])
    lo, hi = (
        estimate.value * math.exp(sign * math.hypot(math.log(limit / estimate.value), shift))
        for sign, limit in ((-1, estimate.lo), (1, estimate.hi))
    )
    verdict = verdict_of(lo, hi, about_same_share=about_same_share)
    log_se = None if estimate.log_se is None else math.hypot(estimate.log_se, effect.log_se * (means[1] - means[0]))
    return replace(estimate, lo=lo, hi=hi, verdict=verdict, log_se=log_se)


def _mean(x_h: Floats, z: Floats) -> float:
    """Return the mean covariate of days, weighted by recorded hours."""
    weights = x_h.sum(axis=0)
    return float(weights @ np.nan_to_num(z) / weights.sum()) if weights.any() else math.nan


def _is_known(x_h: npt.ArrayLike, z: npt.ArrayLike) -> bool:
    """Tell whether every recorded day of a week has a value."""
    is_recorded = (np.nan_to_num(np.asarray(x_h, dtype=np.float64)) > 0).any(axis=0)
    return bool(np.isfinite(np.asarray(z, dtype=np.float64)[is_recorded]).all())


def usual_range_at(
    weeks: Sequence[float],
    z_weeks: Sequence[float],
    z_now: float,
    effect: CovariateEffect,
    *,
    confidence: float = DEFAULTS.confidence,
) -> UsualRange | None:
    """Return the usual range of a weekly rate at this week's value of a covariate.

    Each week before counts as y_w exp(beta (z_now - z_w)), what it would have been at this week's value; of these it is
    `usual_range`, wider by what is not known of beta times the distance of z_now from the weighted mean of the weeks.

    Args:
        weeks: The rate of the weeks before, oldest first, gaps left out.
        z_weeks: Mean covariate of each.
        z_now: Mean covariate of this week.
        effect: Of `covariate_effect`.
        confidence: Level of the range.

    Returns:
        None where the effect has no value, z_now lies outside the days it was made from, or there is no usual range.
    """
    if effect.value is None or effect.log_se is None or effect.df is None or effect.z_lo is None or effect.z_hi is None:
        return None
    if not effect.z_lo <= z_now <= effect.z_hi:
        return None
    rates, values = np.asarray(weeks, dtype=np.float64), np.asarray(z_weeks, dtype=np.float64)
    usual = usual_range((rates * np.exp(effect.value * (z_now - values))).tolist(), confidence=confidence)
    if usual is None:
        return None
    weights = DECAY ** np.arange(len(values))[::-1]
    shift = (
        t_quantile(effect.df, confidence=confidence) * effect.log_se * (z_now - float(weights @ values) / weights.sum())
    )
    middle, reach = (math.log(usual.hi) + math.log(usual.lo)) / 2, math.log(usual.hi / usual.lo) / 2
    half = math.hypot(reach, shift)
    return replace(usual, lo=math.exp(middle - half), hi=math.exp(middle + half))
