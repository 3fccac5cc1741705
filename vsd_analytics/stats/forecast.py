"""Next week, hour by hour: the usual week times the level of late weeks, with a range; and how good it was (M25).

Nothing here is a model library: the usual week is a median, its level an exponential average, the range a negative
binomial. By rolling origin on simulated years that beats a plain median and the seasonal naive forecast
(docs/statistics.md), and a reader can check any number of it with a pencil.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import gammaincinv

from vsd_analytics.answer import Reason, State
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.hour_of_week import (
    SLOTS,
    Bools,
    Floats,
    Ints,
    Spread,
    Weeks,
    as_weeks,
    between_hours,
    spread,
    usual,
)
from vsd_analytics.stats.negative_binomial import quantile

MIN_WEEKS: Final = 4
"""Recorded weeks a forecast needs: fewer have no median that an odd week leaves alone."""
MAX_WEEKS: Final = 8
"""Recorded weeks of an hour that are used at most: older ones are another season."""
LEVEL_DECAY: Final = 0.5  # each week counts half of the one after it
LEVEL_TRUST: Final = 0.7  # and 0.7 of what they say is believed; both chosen on simulated years
LEVEL_SHARE: Final = 0.5  # a week tells a level when it recorded the hours of half of the usual count
LEVEL_EVENTS: Final = 20.0  # so many usual events are added to a week of counts, so that few say little


HOLIDAY_DOUBT: Final = 0.2
"""How far an hour of a public holiday is from that of a Sunday: standard deviation relative to it, of real streets."""
EVENT_DOUBT: Final = 0.12  # an hour of an event from the same hour without it
CLOCK_DOUBT: Final = 0.05  # an hour in the week after the clocks changed


@dataclass(frozen=True, slots=True, eq=False)
class DayRules:
    """Rules for the seven days that are forecast.

    Attributes:
        like: Position of the day of the week whose usual hours each day has, shape (7,): itself, or that of Sundays.
        doubt: How much wider its range is: standard deviation relative to the mean, same shape.
    """

    like: Ints
    doubt: Floats

    def by_slot(self) -> tuple[Ints, Floats]:
        """Return both by hour, shape (168,): the hour whose usual number each hour has, and its doubt."""
        hours = np.arange(24)
        return (24 * self.like[:, None] + hours).ravel(), np.repeat(self.doubt, 24)


@dataclass(frozen=True, slots=True, eq=False)
class WeekForecast:
    """A week that has not happened yet.

    Attributes:
        mean: Expected per open hour, shape (168,); NaN where the site is closed or the hour was recorded too seldom.
        lo, hi: Range that holds `share` of such hours, same shape.
        naive: The seasonal naive forecast, the last recorded value of the same hour; NaN where `mean` is.
        n_weeks: Recorded weeks behind each hour, same shape.
        level: How far late weeks are above the usual, 1.1 = 10 %.
        scale: Mean absolute difference of successive recorded values of an hour: the unit of MASE.
        spread: How an hour differs from week to week.
        share: Share of hours the range is to hold.
        n_recorded_weeks: Weeks with a recorded hour.
        state: "ok" when at least one hour is forecast.
        reason: Why not.
    """

    mean: Floats
    lo: Floats
    hi: Floats
    naive: Floats
    n_weeks: Ints
    level: float
    scale: float
    spread: Spread
    share: float
    n_recorded_weeks: int
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True, eq=False)
class Chances:
    """How likely it is that something happens at all in each hour.

    Attributes:
        rate: Expected per open hour, shape (168,); NaN where nothing is forecast.
        chance: Probability of at least one in the hour, same shape.
        n_weeks: Recorded weeks behind each hour, same shape.
        n_recorded_weeks: Weeks with a recorded hour.
        state: "ok" when at least one hour is forecast.
        reason: Why not.
    """

    rate: Floats
    chance: Floats
    n_weeks: Ints
    n_recorded_weeks: int
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class ForecastScore:
    """How good a forecast was, compared with the seasonal naive one, over the recorded hours that both predict.

    Attributes:
        wape: Sum of absolute errors / sum of what happened; None when nothing happened.
        mase: Mean absolute error / mean absolute difference from one week to the next in the weeks it was made from.
        hit_rate: Share of hours inside the range.
        share: Share that is to be inside.
        wape_naive, mase_naive: The same of the seasonal naive forecast.
        n_hours: Hours scored.
        state: "ok", or why there is no score.
        reason: Why not.
    """

    wape: float | None
    mase: float | None
    hit_rate: float | None
    share: float
    wape_naive: float | None
    mase_naive: float | None
    n_hours: int
    state: State
    reason: Reason | None


def forecast_week(
    n: npt.ArrayLike,
    x_h: npt.ArrayLike,
    *,
    is_count: bool,
    open_h: npt.ArrayLike | None = None,
    share: float = DEFAULTS.forecast_share,
    days: DayRules | None = None,
) -> WeekForecast:
    """Forecast the week after the last row.

    level_w = what week w counted / what is usual in the hours it recorded; usual week m_s = median over the last
    `MAX_WEEKS` recorded weeks of rate_ws / level_w; forecast m_s exp(0.7 sum_w 2^-age ln level_w / sum_w 2^-age).
    Range: the outer quantiles of a negative binomial (counts) or a gamma (amounts) with that mean and
    var = (noise mean / open hours + dispersion mean^2) (1 + pi / (2 k)) + doubt^2 mean^2, noise and dispersion pooled
    over the hours (see `hour_of_week.spread`), the factor because the median of k weeks is itself uncertain.

    Args:
        n: What was counted, shape (n_weeks, 168), oldest first.
        x_h: Recorded open hours, same shape; 0 or NaN = not recorded, which is never 0.
        is_count: True for counts of events; False for amounts such as person-hours.
        open_h: Open hours of each slot of the next week, shape (168,): nothing is forecast where it is 0. None = 1.
        share: Share of hours the range is to hold.
        days: Days of the next week that are unlike those before; None = none is.

    Returns:
        The forecast per open hour, with state "not_enough_data" and its reason below `MIN_WEEKS`.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    weeks = as_weeks(n, x_h)
    hours = np.ones(SLOTS) if open_h is None else np.asarray(open_h, dtype=np.float64)
    slot, doubt = (np.arange(SLOTS), np.zeros(SLOTS)) if days is None else days.by_slot()
    k = np.minimum((weeks.x_h > 0).sum(axis=0), MAX_WEEKS)[slot]
    is_estimated = (k >= MIN_WEEKS) & (hours > 0)
    if (reason := _why_not(weeks, is_estimated)) is not None:
        nothing = np.full(SLOTS, np.nan)
        unknown = Spread(0.0, 0.0)
        return WeekForecast(
            nothing, nothing, nothing, nothing, k, 1.0, float("nan"), unknown, share, weeks.n_recorded,
            "not_enough_data", reason,
        )  # fmt: skip
    usual_week, levels = _levelled(weeks, is_count=is_count)
    level = _late_level(levels)
    mean = np.where(is_estimated, usual_week[slot] * level, np.nan)
    varies = spread(weeks.latest(MAX_WEEKS), is_count=is_count, min_weeks=MIN_WEEKS)
    more = 1 + np.pi / 2 / np.maximum(k, 1)
    naive = _last(weeks.rate)
    naive = np.where(np.isnan(naive), naive[slot], naive)
    lo, hi = _range(mean, varies, open_h=hours, more=more, doubt=doubt, share=share, is_count=is_count)
    return WeekForecast(
        mean=mean, lo=lo, hi=hi, naive=np.where(is_estimated, naive, np.nan), n_weeks=k, level=level,
        scale=_scale(weeks.rate), spread=varies, share=share, n_recorded_weeks=weeks.n_recorded,
        state="ok", reason=None,
    )  # fmt: skip


def chances(
    n: npt.ArrayLike,
    x_h: npt.ArrayLike,
    *,
    open_h: npt.ArrayLike | None = None,
    days: DayRules | None = None,
) -> Chances:
    """Tell how likely at least one event is in each hour of the week after the last row: for what is rare.

    Gamma-Poisson empirical Bayes over the hours of the week: m = sum n / sum x, v the variance of rates beyond chance,
    a = m^2 / v, b = m / v; rate = (a + n) / (b + x), P(at least one in h hours) = 1 - ((b + x) / (b + x + h))^(a + n).

    Args:
        n: Events, shape (n_weeks, 168), oldest first.
        x_h: Recorded open hours, same shape; 0 or NaN = not recorded.
        open_h: Open hours of each slot of the next week, shape (168,); None = 1.
        days: Days of the next week that are unlike those before; None = none is. Their doubt is not used.

    Returns:
        Rates and probabilities, with state "not_enough_data" and its reason below `MIN_WEEKS`.

    Raises:
        ValueError: Shapes do not fit, or a number is negative or infinite.
    """
    weeks = as_weeks(n, x_h)
    hours = np.ones(SLOTS) if open_h is None else np.asarray(open_h, dtype=np.float64)
    slot = np.arange(SLOTS) if days is None else days.by_slot()[0]
    latest = weeks.latest(MAX_WEEKS)
    late = Weeks(latest.n[:, slot], latest.x_h[:, slot])
    k = (late.x_h > 0).sum(axis=0)
    is_estimated = (k >= MIN_WEEKS) & (hours > 0)
    nothing = np.full(SLOTS, np.nan)
    if (reason := _why_not(weeks, is_estimated)) is not None:
        return Chances(nothing, nothing, k, weeks.n_recorded, "not_enough_data", reason)
    events, exposure = late.n.sum(axis=0)[is_estimated], late.x_h.sum(axis=0)[is_estimated]
    m = float(events.sum() / exposure.sum())
    rate, chance = nothing.copy(), nothing.copy()
    if m == 0:  # never seen at all: at most the rule of three, and no reason to tell hours apart
        a, b = np.full(events.shape, 1.0 / len(events)), exposure
    else:
        prior = max(between_hours(events, exposure, m), 1e-6 * m * m)
        a, b = m * m / prior + events, m / prior + exposure
    rate[is_estimated] = a / b
    chance[is_estimated] = -np.expm1(-a * np.log1p(hours[is_estimated] / b))
    return Chances(rate, chance, k, weeks.n_recorded, "ok", None)


def score_forecast(forecast: WeekForecast, n: npt.ArrayLike, x_h: npt.ArrayLike) -> ForecastScore:
    """Score a forecast against what happened, beside the seasonal naive forecast.

    WAPE = sum |y - f| / sum y; MASE = mean |y - f| / scale (Hyndman, Koehler, Another look at measures of forecast
    accuracy, 2006, with the seasonal difference); hit rate = share of hours with lo <= y <= hi.

    Args:
        forecast: Made before.
        n: What was counted, shape (168,).
        x_h: Recorded open hours, same shape; 0 or NaN = not recorded: not scored.
    """
    if forecast.state != "ok":
        return _no_score(forecast, forecast.reason)
    week = as_weeks(np.atleast_2d(n), np.atleast_2d(x_h))
    happened = week.rate[0]
    scored = ~np.isnan(happened) & ~np.isnan(forecast.mean)
    if not scored.any():
        return _no_score(forecast, Reason("forecast.unrecorded"))
    y, total = happened[scored], float(happened[scored].sum())
    wrong, wrong_naive = (np.abs(y - f[scored]) for f in (forecast.mean, forecast.naive))
    has_scale = forecast.scale > 0
    return ForecastScore(
        wape=float(wrong.sum()) / total if total > 0 else None,
        mase=float(wrong.mean()) / forecast.scale if has_scale else None,
        hit_rate=float(((y >= forecast.lo[scored]) & (y <= forecast.hi[scored])).mean()),
        share=forecast.share,
        wape_naive=float(wrong_naive.sum()) / total if total > 0 else None,
        mase_naive=float(wrong_naive.mean()) / forecast.scale if has_scale else None,
        n_hours=int(scored.sum()),
        state="ok",
        reason=None,
    )


def _no_score(forecast: WeekForecast, reason: Reason | None) -> ForecastScore:
    return ForecastScore(None, None, None, forecast.share, None, None, 0, "not_enough_data", reason)


def _why_not(weeks: Weeks, is_estimated: Bools) -> Reason | None:
    if weeks.n_recorded < MIN_WEEKS:
        return Reason("forecast.weeks", least=MIN_WEEKS, has=weeks.n_recorded)
    if not is_estimated.any():
        return Reason("forecast.hours", least=MIN_WEEKS)
    return None


def _levelled(weeks: Weeks, *, is_count: bool) -> tuple[Floats, Floats]:
    """Return the usual week at level 1, shape (168,), and each week's level, NaN where it recorded too little."""
    plain = usual(weeks.latest(MAX_WEEKS), is_count=is_count)
    levels = np.full(len(weeks.n), np.nan)
    week = plain
    for _ in range(2):  # the usual week needs the levels, the levels the usual week; twice is enough
        levels = _levels(weeks, week, is_count=is_count)
        at_one = np.where(np.isnan(levels), 1.0, levels)[:, None]
        week = usual(Weeks(weeks.n, weeks.x_h * at_one).latest(MAX_WEEKS), is_count=is_count)
    return week, levels


def _levels(weeks: Weeks, week: Floats, *, is_count: bool) -> Floats:
    expected = (np.nan_to_num(week) * weeks.x_h).sum(axis=1)
    whole = float(np.nansum(week))
    more = LEVEL_EVENTS if is_count else 0.0
    is_estimated = (expected > 0) & (expected >= LEVEL_SHARE * whole)
    # recorded hours of a closed or half recorded week are fewer, so the comparison is with what those would have
    level = np.divide(
        weeks.n.sum(axis=1) + more, expected + more, out=np.full(len(weeks.n), np.nan), where=is_estimated
    )
    return np.where(level > 0, level, np.nan)


def _late_level(levels: Floats) -> float:
    known = ~np.isnan(levels)
    if not known.any():
        return 1.0
    weights = LEVEL_DECAY ** np.arange(len(levels))[::-1][known]
    return float(np.exp(LEVEL_TRUST * (weights @ np.log(levels[known])) / weights.sum()))


def _range(
    mean: Floats, varies: Spread, *, open_h: Floats, more: Floats, doubt: Floats, share: float, is_count: bool
) -> tuple[Floats, Floats]:
    """Return the outer quantiles of the hours to come, per open hour."""
    tails = (1 - share) / 2, (1 + share) / 2
    hours = np.where(open_h > 0, open_h, np.nan)
    counts = mean * hours
    if is_count:
        # the excess of var = (mean + d mean^2) more over Poisson, as a dispersion
        wider = varies.dispersion * more + doubt**2 + (more - 1) / np.maximum(counts, 1e-9)
        low, high = (quantile(t, mean=counts, dispersion=wider) / hours for t in tails)
        return low, high
    variance = (varies.noise * mean / hours + varies.dispersion * mean**2) * more + (doubt * mean) ** 2
    is_sure = ~(variance > 0)
    shape = np.where(is_sure, 1.0, mean**2 / np.where(is_sure, 1.0, variance))
    low, high = (
        np.where(is_sure, mean, gammaincinv(shape, t) * np.where(is_sure, 0.0, variance) / np.where(mean > 0, mean, 1))
        for t in tails
    )
    return low, high


def _last(rate: Floats) -> Floats:
    """Return the last known value of each column; NaN where there is none."""
    is_known = ~np.isnan(rate)
    row = np.where(is_known.any(axis=0), len(rate) - 1 - is_known[::-1].argmax(axis=0), len(rate) - 1)
    return np.asarray(rate[row, np.arange(rate.shape[1])])


def _scale(rate: Floats) -> float:
    """Return the mean absolute difference of successive known values of the same hour; NaN without any."""
    total, n = 0.0, 0
    for column in rate.T:
        steps = np.abs(np.diff(column[~np.isnan(column)]))
        total, n = total + float(steps.sum()), n + len(steps)
    return total / n if n else float("nan")
