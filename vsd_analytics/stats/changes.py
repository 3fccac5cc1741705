"""Changes between two periods, same weekdays paired: violation rate, encounters, people, and how they split.

ln theta = ln r_B - ln r_A. The interval is ln theta +- the larger of two half widths:

* by days, t_df sqrt(k sum_d (i_dB - i_dA)^2) with i_d, k and df of `vsd_analytics.stats.influence` (k = D/(D-1),
  df = D-1 when all cameras recorded all D pairs of days); from four weeks of history on, the usual variance of such
  weeks is pooled in (`vsd_analytics.stats.steadiness`). A weekday that is always busier moves both periods alike and
  cancels.
* by weeks, t_df sqrt(S) with S and df of the site's own weekly steps (`vsd_analytics.stats.weekly_steps`): weeks differ
  by more than their days show. A site with fewer open days than days can speak for is judged by its weeks alone.

Callers pass camera-hours recorded in both periods. Coverage and power by simulation: docs/statistics.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.estimates import ChangeEstimate, ChangeSplit, no_change, verdict_of
from vsd_analytics.stats.influence import (
    DayCounts,
    Floats,
    Influence,
    as_counts,
    equal_weights,
    influence,
    small_sample,
)
from vsd_analytics.stats.quantiles import poisson_limits, t_quantile, z_quantile
from vsd_analytics.stats.rates import MIN_EVENTS, SMALL_COUNT, level
from vsd_analytics.stats.steadiness import pooled, usual_variance
from vsd_analytics.stats.weekly_steps import FULL_STEPS, step_variance, weekly_steps

NO_STEPS: Final = np.zeros(0)

Kind = Literal["violations", "person-hours"]


def compare_violation_rates(
    n_a: npt.ArrayLike,
    x_a_h: npt.ArrayLike,
    n_b: npt.ArrayLike,
    x_b_h: npt.ArrayLike,
    *,
    history_n: npt.ArrayLike | None = None,
    history_x_h: npt.ArrayLike | None = None,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
    about_same_share: float = DEFAULTS.about_same_share,
) -> ChangeEstimate:
    """Return the change in how often violations happen (M0) from period A (before) to period B (after).

    Args:
        n_a: Violations of A that each camera owns, in the camera-hours compared, shape (n_cameras, n_pairs); column j
            of A and of B are the same weekday.
        x_a_h: Recorded open hours of A that were compared, same shape; 0 or NaN = none. A camera-day counts only when
            both periods have hours.
        n_b: Violations of B, same shape.
        x_b_h: Recorded open hours of B that were compared, same shape.
        history_n: Violations of the weeks before A on the same weekdays, oldest first, shape (n_weeks, n_cameras,
            n_pairs): how much days and weeks differ here. Twelve weeks say all that is asked.
        history_x_h: Recorded open hours of these weeks, same shape.
        confidence: Confidence level.
        min_days: Pairs of days an interval by days needs. With fewer, eight weekly steps in the history do instead.
        about_same_share: "About the same" needs the whole interval within 1 -+ this.

    Returns:
        The ratio B / A with interval and verdict. With fewer than 5 violations on one side and 5 or more on the
        other, the interval is made of exact Poisson limits of the small side and the day-clustered limits of the
        other, each at (1 + confidence)/2: conservative, and used only where it is clear. Fewer than 5 on both sides,
        or fewer than `min_days` pairs and eight weekly steps: "too_little_data".

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.

    Example:
        >>> before, hours = [[40, 44, 37, 52, 61, 80, 30]], [[13, 13, 13, 13, 13, 13, 8]]
        >>> after = [[22, 25, 20, 26, 35, 41, 17]]
        >>> change = compare_violation_rates(before, hours, after, hours)
        >>> print(f"{change.change:+.0%} ({change.change_lo:+.0%} to {change.change_hi:+.0%}): {change.verdict}")
        -46% (-49% to -43%): clear_fall
    """
    return _compare(
        n_a, x_a_h, n_b, x_b_h,
        kind="violations", history=_history(history_n, history_x_h), confidence=confidence, min_days=min_days,
        about_same_share=about_same_share,
    )  # fmt: skip


def compare_encounter_rates(
    n_a: npt.ArrayLike,
    exposure_a_h: npt.ArrayLike | None,
    n_b: npt.ArrayLike,
    exposure_b_h: npt.ArrayLike | None,
    *,
    history_n: npt.ArrayLike | None = None,
    history_exposure_h: npt.ArrayLike | None = None,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
    min_exposure_h: float = DEFAULTS.min_exposure_h,
    about_same_share: float = DEFAULTS.about_same_share,
) -> ChangeEstimate:
    """Return the change in violations per person-hour (M7) from period A (before) to period B (after).

    Args:
        n_a: Violations of A in the camera-hours compared, shape (n_pairs,).
        exposure_a_h: Person-hours of A, same shape; None = the engine sends no positions.
        n_b: Violations of B, same shape.
        exposure_b_h: Person-hours of B, same shape; None = the engine sends no positions.
        history_n: Violations of the weeks before A, shape (n_weeks, n_pairs); as for `compare_violation_rates`.
        history_exposure_h: Person-hours of these weeks, same shape.
        confidence: Confidence level.
        min_days: As for `compare_violation_rates`.
        min_exposure_h: Person-hours each period needs.
        about_same_share: As for `compare_violation_rates`.

    Returns:
        As `compare_violation_rates`, with rates per person-hour.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    if exposure_a_h is None or exposure_b_h is None:
        return no_change(Reason("engine.no_positions"))
    history = _history(history_n, history_exposure_h)
    return _compare(
        n_a, exposure_a_h, n_b, exposure_b_h, kind="violations",
        history=None if history is None else (history[0][:, None], history[1][:, None]),
        confidence=confidence, min_days=min_days, min_exposure_h=min_exposure_h, about_same_share=about_same_share,
    )  # fmt: skip


def compare_exposure(
    exposure_a_h: npt.ArrayLike,
    x_a_h: npt.ArrayLike,
    exposure_b_h: npt.ArrayLike,
    x_b_h: npt.ArrayLike,
    *,
    history_h: npt.ArrayLike | None = None,
    history_x_h: npt.ArrayLike | None = None,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
    about_same_share: float = DEFAULTS.about_same_share,
) -> ChangeEstimate:
    """Return the change in people in view per open hour from period A (before) to period B (after).

    The rate is sum over cameras of person-hours over recorded open hours: the mean number of people in view.

    Args:
        exposure_a_h: Person-hours of A in the camera-hours compared, shape (n_cameras, n_pairs).
        x_a_h: Recorded open hours of A that were compared, same shape.
        exposure_b_h: Person-hours of B, same shape.
        x_b_h: Recorded open hours of B that were compared, same shape.
        history_h: Person-hours of the weeks before A, shape (n_weeks, n_cameras, n_pairs).
        history_x_h: Recorded open hours of these weeks, same shape.
        confidence: Confidence level.
        min_days: As for `compare_violation_rates`.
        about_same_share: As for `compare_violation_rates`.

    Returns:
        As `compare_violation_rates`; `n_a` and `n_b` are person-hours, the rates mean numbers of people.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    return _compare(
        exposure_a_h, x_a_h, exposure_b_h, x_b_h,
        kind="person-hours", history=_history(history_h, history_x_h), confidence=confidence, min_days=min_days,
        about_same_share=about_same_share,
    )  # fmt: skip


def split_change(
    *, violation_rate: ChangeEstimate, people: ChangeEstimate, encounter_rate: ChangeEstimate
) -> ChangeSplit:
    """Split a change in how often into more people and more violations per person-hour.

    theta_violation_rate = theta_people theta_risk rest; people_share = ln theta_people / ln theta_violation_rate.

    Args:
        violation_rate: From `compare_violation_rates`.
        people: From `compare_exposure` over the same camera-hours.
        encounter_rate: From `compare_encounter_rates` over the same camera-hours.

    Returns:
        The three changes, the rest, and the share people explain (None unless `violation_rate` is a clear fall or
        rise).
    """
    rest = share = None
    if violation_rate.value and people.value and encounter_rate.value:
        rest = violation_rate.value / (people.value * encounter_rate.value)
        if violation_rate.verdict in {"clear_fall", "clear_rise"}:
            share = math.log(people.value) / math.log(violation_rate.value)
    return ChangeSplit(
        violation_rate=violation_rate, people=people, encounter_rate=encounter_rate, rest=rest, people_share=share
    )


@dataclass(frozen=True, slots=True)
class _Width:
    """Half the width of an interval of ln theta, its standard error and degrees of freedom."""

    half: float
    log_se: float
    df: float


def _compare(
    n_a: npt.ArrayLike,
    x_a: npt.ArrayLike,
    n_b: npt.ArrayLike,
    x_b: npt.ArrayLike,
    *,
    kind: Kind,
    history: tuple[Floats, Floats] | None,
    confidence: float,
    min_days: int,
    about_same_share: float,
    min_exposure_h: float = 0.0,
) -> ChangeEstimate:
    hours_a, hours_b = np.asarray(x_a, dtype=np.float64), np.asarray(x_b, dtype=np.float64)
    if hours_a.shape != hours_b.shape:
        raise ValueError(f"periods {hours_a.shape} and {hours_b.shape} must have the same cameras and pairs of days")
    in_both = (np.nan_to_num(hours_a) > 0) & (np.nan_to_num(hours_b) > 0)
    a, b = as_counts(n_a, x_a, mask=in_both), as_counts(n_b, x_b, mask=in_both)
    events_a, events_b = float(a.n.sum()), float(b.n.sum())
    least_h = min(float(a.x.sum()), float(b.x.sum()))
    steps = NO_STEPS if history is None or not a.kept else weekly_steps(*history, of=a)
    has_days = a.n_days >= min_days
    if not has_days and (a.n_days == 0 or len(steps) < FULL_STEPS):
        return _without_interval(a, b, Reason("change.pairs", least=min_days, has=a.n_days))
    if least_h < min_exposure_h:
        return _without_interval(a, b, Reason("change.person_hours", least=min_exposure_h, has=least_h))
    if kind == "person-hours":
        if min(events_a, events_b) == 0:
            return _without_interval(a, b, Reason("change.nobody"))
    elif max(events_a, events_b) < MIN_EVENTS:
        return _without_interval(a, b, Reason("change.events", least=MIN_EVENTS, before=events_a, after=events_b))
    elif min(events_a, events_b) < MIN_EVENTS:
        return _one_small_side(a, b, confidence=confidence, min_days=min_days, about_same_share=about_same_share)

    before, after = influence(a), influence(b)
    if has_days:
        width = _width(a, before, after, history=history, steps=steps, confidence=confidence)
        if width is None:
            return _without_interval(a, b, Reason("change.camera"))
    else:
        width = _by_weeks(steps, day_variance=0.0, noise=0.0, n_days=a.n_days, confidence=confidence)
    half = width.half
    if kind == "violations" and min(events_a, events_b) < SMALL_COUNT:
        noise = float((before.noise + after.noise).sum())
        half = max(half, z_quantile(confidence=confidence) * math.sqrt(noise))
    theta = after.rate / before.rate
    lo, hi = theta * math.exp(-half), theta * math.exp(half)
    verdict = verdict_of(lo, hi, about_same_share=about_same_share)
    estimate = _without_interval(a, b, None)
    return replace(estimate, lo=lo, hi=hi, verdict=verdict, state="ok", df=width.df, log_se=width.log_se)


def _width(
    a: DayCounts,
    before: Influence,
    after: Influence,
    *,
    history: tuple[Floats, Floats] | None,
    steps: Floats,
    confidence: float,
) -> _Width | None:
    """Return the wider of what days and weeks allow; None where no camera with violations has two days."""
    noise = before.noise + after.noise
    factor, df = small_sample(equal_weights(a), shares=(before.shares + after.shares) / 2, noise=noise)
    if not math.isfinite(factor):
        return None
    by_day = after.by_day - before.by_day
    variance = day_variance = factor * float(by_day @ by_day)
    usual = None if history is None or not (a.x > 0).all() else usual_variance(*history, of=a)
    if usual is not None:
        day_variance = usual[0]
        variance, df = pooled(variance, df, usual=usual)
    log_se = math.sqrt(variance)
    by_days = _Width(t_quantile(df, confidence=confidence) * log_se, log_se, df)
    by_weeks = _by_weeks(
        steps, day_variance=day_variance, noise=float(noise.sum()), n_days=a.n_days, confidence=confidence
    )
    return max(by_days, by_weeks, key=lambda width: width.half)


def _by_weeks(steps: Floats, *, day_variance: float, noise: float, n_days: int, confidence: float) -> _Width:
    variance, df = step_variance(steps, day_variance=day_variance, noise=noise, n_days=n_days)
    log_se = math.sqrt(variance)
    return _Width(t_quantile(df, confidence=confidence) * log_se, log_se, df)


def _history(n: npt.ArrayLike | None, x_h: npt.ArrayLike | None) -> tuple[Floats, Floats] | None:
    """Return both as arrays, weeks first; None without a week."""
    if n is None or x_h is None:
        return None
    counts, hours = np.asarray(n, dtype=np.float64), np.asarray(x_h, dtype=np.float64)
    return (counts, hours) if len(counts) else None


def _one_small_side(
    a: DayCounts, b: DayCounts, *, confidence: float, min_days: int, about_same_share: float
) -> ChangeEstimate:
    """Return a change where one side has fewer than `MIN_EVENTS` violations (Bonferroni over the two limits)."""
    (lo_a, hi_a), (lo_b, hi_b) = (
        _limits(counts, confidence=(1 + confidence) / 2, min_days=min_days) for counts in (a, b)
    )
    lo, hi = (lo_b / hi_a), (hi_b / lo_a if lo_a > 0 else None)
    verdict = verdict_of(lo, hi, about_same_share=about_same_share)
    small = int(min(a.n.sum(), b.n.sum()))
    if verdict not in {"clear_fall", "clear_rise"}:
        return _without_interval(a, b, Reason("change.small", n=small))
    estimate = _without_interval(a, b, Reason("change.poisson", n=small))
    return replace(estimate, lo=lo, hi=hi, verdict=verdict, state="ok", is_conservative=True)


def _limits(counts: DayCounts, *, confidence: float, min_days: int) -> tuple[float, float]:
    n_events = float(counts.n.sum())
    hours = counts.x.sum(axis=1)
    if n_events >= MIN_EVENTS:
        estimate = level(counts, kind="violation_rate", confidence=confidence, min_days=min_days)
        return estimate.lo or 0.0, math.inf if estimate.hi is None else estimate.hi
    rate_per_event = float((counts.n.sum(axis=1) / hours).sum()) / n_events if n_events else 1 / float(hours.min())
    lo, hi = poisson_limits(n_events, confidence=confidence)
    return lo * rate_per_event, hi * rate_per_event


def _without_interval(a: DayCounts, b: DayCounts, reason: Reason | None) -> ChangeEstimate:
    rate_a, rate_b = (
        float((counts.n.sum(axis=1) / counts.x.sum(axis=1)).sum()) if counts.kept else None for counts in (a, b)
    )
    return ChangeEstimate(
        value=rate_b / rate_a if rate_a and rate_b is not None else None, lo=None, hi=None, rate_a=rate_a,
        rate_b=rate_b, n_a=float(a.n.sum()), n_b=float(b.n.sum()), exposure_a_h=float(a.x.sum()),
        exposure_b_h=float(b.x.sum()), n_days=a.n_days, df=None, log_se=None, verdict="too_little_data",
        state="not_enough_data", reason=reason, is_conservative=False, left_out=a.left_out,
    )  # fmt: skip
