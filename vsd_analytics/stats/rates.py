"""Levels with intervals: violation rate (M0) and encounters per person-hour (M7), day-clustered.

The unit of replication is the day: violations of one day share its weather, staff and crowds, so intervals come from
how days differ (formula and sources: `vsd_analytics.stats.influence`), never from the number of records. Days in a row
resemble each other, which widens intervals, and a few may have much more than the others, which moves their upper end
(`vsd_analytics.stats.earlier_days`). Coverage by simulation: docs/statistics.md. Changes between periods:
`vsd_analytics.stats.changes`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.earlier_days import PRIOR_CORRELATION, day_correlation, day_skewness, inflation, skewed
from vsd_analytics.stats.estimates import RateEstimate, no_rate
from vsd_analytics.stats.influence import (
    DayCounts,
    Profile,
    as_counts,
    as_history,
    equal_weights,
    influence,
    small_sample,
    weekday_profile,
)
from vsd_analytics.stats.quantiles import t_quantile, z_quantile, zero_events_limit

MIN_EVENTS: Final = 5  # fewer violations get no interval from days
HISTORY_WEEKS: Final = 5  # weeks before a period that its weekday profile may use
MIN_HISTORY_WEEKS: Final = 4  # weekday profiles need that many weeks before the period
WIDEST_LOG: Final = 50.0  # an interval that reaches to e^50 times a rate says nothing, and soon no float holds its end
SMALL_COUNT: Final = 30  # below it days may agree by luck: an interval is never narrower than a Poisson count's


RateKind = Literal["violation_rate", "encounter_rate"]


def violation_rate(
    n: npt.ArrayLike,
    x_h: npt.ArrayLike,
    *,
    weekday: npt.ArrayLike | None = None,
    history_n: npt.ArrayLike | None = None,
    history_x_h: npt.ArrayLike | None = None,
    history_weekday: npt.ArrayLike | None = None,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
) -> RateEstimate:
    """Return how often violations happen: M0, violations per open hour of a place, with its interval.

    rate = sum over cameras of n_c / x_c, so that a camera that was down half the week does not pull it down;
    interval rate * exp(+-t_df sqrt(a k sum_d i_d^2)) with i_d, k and df of `vsd_analytics.stats.influence`, and a what
    days that resemble each other do to it (`vsd_analytics.stats.earlier_days`). With four weeks of history the
    influences are measured from each camera's weekday profile, and the upper end has t + g (2 t^2 + 1)/(6 sqrt(D)) in
    place of t, g the skewness of earlier days; without, differences between weekdays are in the interval, which is
    then conservative and says so. Where a camera missed weekdays, the interval
    also reaches to what the rate would usually be with them: rate * exp(ln sum_c p_c gap_c), p_c the camera's share.

    Args:
        n: Violations that each camera owns, shape (n_cameras, n_days).
        x_h: Recorded open hours, same shape; 0 or NaN = not recorded (its violations are not counted either).
        weekday: Weekday of each day, shape (n_days,), any integers; needed with a history.
        history_n: Violations of the weeks before, shape (n_cameras, n_history_days).
        history_x_h: Recorded open hours of the weeks before, same shape.
        history_weekday: Weekday of each history day, shape (n_history_days,). Leave out weekdays on which the site
            was closed in the period: a weekday the history knows and the period lacks counts as missed.
        confidence: Confidence level.
        min_days: Recorded days an interval needs.

    Returns:
        The rate in violations per open hour, and its interval. Without violations: 0, lo 0 and hi by the rule of
        three, 3 / x with x the recorded hours of the camera that recorded least. With fewer than `min_days` days or 5
        violations: the rate without an interval, and the reason.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.

    Example:
        >>> estimate = violation_rate([[40, 44, 37, 52, 61, 80, 30]], [[13, 13, 13, 13, 13, 13, 8]])
        >>> print(f"{estimate.rate:.2f} ({estimate.lo:.2f} to {estimate.hi:.2f})")
        4.00 (3.03 to 5.28)
    """
    counts = as_counts(n, x_h)
    if not counts.kept:
        return _without_interval(counts, None, Reason("level.unrecorded"))
    past = _past(counts, weekday, history_n, history_x_h, history_weekday)
    return level(counts, past=past, confidence=confidence, min_days=min_days, kind="violation_rate")


def encounter_rate(
    n: npt.ArrayLike,
    exposure_h: npt.ArrayLike | None,
    *,
    weekday: npt.ArrayLike | None = None,
    history_n: npt.ArrayLike | None = None,
    history_exposure_h: npt.ArrayLike | None = None,
    history_weekday: npt.ArrayLike | None = None,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
    min_exposure_h: float = DEFAULTS.min_exposure_h,
) -> RateEstimate:
    """Return encounters per person-hour (M7): violations per person-hour of exposure, with its interval.

    r = sum_d n_d / sum_d x_d; var(ln r) = a D/(D-1) sum_d (n_d - r x_d)^2 / (sum n)^2; r * exp(+-t_{D-1} sqrt(var)):
    the ratio estimator with days as clusters. Weekday profiles and a as for `violation_rate`.

    Args:
        n: Violations, shape (n_days,).
        exposure_h: Person-hours in view, same shape; 0 or NaN = nobody, or not recorded: the day says nothing. None =
            the engine sends no positions.
        weekday: Weekday of each day, shape (n_days,); needed with a history.
        history_n: Violations of the weeks before, shape (n_history_days,).
        history_exposure_h: Person-hours of the weeks before, same shape.
        history_weekday: Weekday of each history day, same shape.
        confidence: Confidence level.
        min_days: Days with exposure an interval needs.
        min_exposure_h: Person-hours the rate needs.

    Returns:
        The rate in violations per person-hour and its interval; `rate` is None below `min_exposure_h`.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    if exposure_h is None:
        return no_rate(Reason("engine.no_positions"))
    counts = as_counts(n, exposure_h)
    total_h = float(counts.x.sum())
    if not counts.kept or total_h < min_exposure_h:
        return _without_interval(counts, None, Reason("level.person_hours", least=min_exposure_h, has=total_h))
    past = _past(counts, weekday, history_n, history_exposure_h, history_weekday)
    return level(counts, past=past, confidence=confidence, min_days=min_days, kind="encounter_rate")


@dataclass(frozen=True, slots=True)
class Past:
    """What the weeks before say of a period.

    Attributes:
        profile: What they expect of each day.
        correlation: Of a day with the one before it.
        skewness: Of days, at least 0.
    """

    profile: Profile
    correlation: float
    skewness: float


def level(
    counts: DayCounts,
    *,
    kind: RateKind,
    confidence: float,
    min_days: int,
    past: Past | None = None,
) -> RateEstimate:
    """Return the rate of checked counts with its interval: what `violation_rate` and `encounter_rate` have in common.

    Args:
        counts: Cameras with exposure, at least one.
        kind: What exposure is measured in: open hours (often) or person-hours (risky). Reasons name it.
        confidence: Confidence level.
        min_days: Days with exposure an interval needs.
        past: What earlier weeks say; None = no history.
    """
    n_events, n_days = float(counts.n.sum()), counts.n_days
    rate = float((counts.n.sum(axis=1) / counts.x.sum(axis=1)).sum())
    if n_days < min_days:
        return _without_interval(counts, rate, Reason("level.days", least=min_days, has=n_days))
    if n_events == 0:
        least_h = float(counts.x.sum(axis=1).min())
        hi = zero_events_limit(confidence=confidence) / least_h
        reason = Reason(
            "level.none_per_open_h" if kind == "violation_rate" else "level.none_per_person_h", hours=least_h
        )
        return replace(_without_interval(counts, 0.0, reason), lo=0.0, hi=hi, state="ok")
    if n_events < MIN_EVENTS:
        return _without_interval(counts, rate, Reason("level.events", least=MIN_EVENTS, has=n_events))

    weights, missed, profile = equal_weights(counts), 0.0, None
    if past is None:
        days, correlation, skewness = influence(counts), PRIOR_CORRELATION, 0.0
    else:
        profile, correlation, skewness = past.profile, past.correlation, past.skewness
        days = influence(counts, expected=profile.expected, scale=profile.scale)
        weights = np.where(profile.is_known[:, None], profile.expected, weights)
        missed = math.log1p(float(days.shares @ (profile.gap - 1)))
    factor, df = small_sample(weights, shares=days.shares, noise=days.noise)
    if not math.isfinite(factor):
        return _without_interval(counts, rate, Reason("level.camera"))
    factor *= inflation(correlation, n_days=n_days)
    log_se = math.sqrt(factor * float(days.by_day @ days.by_day))
    t = t_quantile(df, confidence=confidence)
    below, above = t * log_se, skewed(t, skewness=skewness, n_days=n_days) * log_se
    if n_events < SMALL_COUNT:
        least = z_quantile(confidence=confidence) * math.sqrt(float(days.noise.sum()))
        below, above = max(below, least), max(above, least)
    if abs(missed) + above > WIDEST_LOG:
        return _without_interval(counts, rate, Reason("level.wide"))
    is_plain = profile is None or not bool(profile.is_known[days.totals > 0].all())
    return replace(
        _without_interval(counts, rate, None), lo=rate * math.exp(min(missed, 0.0) - below),
        hi=rate * math.exp(max(missed, 0.0) + above), state="ok", df=df, log_se=log_se,
        is_conservative=is_plain or missed != 0,
    )  # fmt: skip


def _past(
    counts: DayCounts,
    weekday: npt.ArrayLike | None,
    history_n: npt.ArrayLike | None,
    history_x_h: npt.ArrayLike | None,
    history_weekday: npt.ArrayLike | None,
) -> Past | None:
    if history_n is None or history_x_h is None:
        return None
    if weekday is None or history_weekday is None:
        raise ValueError("a history needs the weekdays of the period and its own")
    history = as_history(history_n, history_x_h, of=counts)
    now, then = np.asarray(weekday, dtype=np.int64), np.asarray(history_weekday, dtype=np.int64)
    if now.shape != counts.n.shape[1:] or then.shape != history.n.shape[1:]:
        raise ValueError("every day needs a weekday")
    profile = weekday_profile(counts, history, weekday=now, history_weekday=then, min_weeks=MIN_HISTORY_WEEKS)
    return Past(profile, day_correlation(history, then), day_skewness(history, then))


def _without_interval(counts: DayCounts, rate: float | None, reason: Reason | None) -> RateEstimate:
    return RateEstimate(
        value=rate, lo=None, hi=None, n_events=float(counts.n.sum()), exposure_h=float(counts.x.sum()),
        n_days=counts.n_days, df=None, log_se=None, state="not_enough_data", reason=reason, is_conservative=False,
        left_out=counts.left_out,
    )  # fmt: skip
