"""The last weeks side by side: how often and how risky each was, with its interval, and gaps (M28)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.result import Reason, State
from vsd_analytics.settings import Settings
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.stats.rates import how_often, how_risky

DEFAULTS: Final = Settings()
MIN_TREND_WEEKS: Final = 3
HISTORY_WEEKS: Final = 5  # weeks before each week that its weekday profile may use, as the report does


@dataclass(frozen=True, slots=True)
class WeekLevel:
    """One week of a trend.

    Attributes:
        often: How often, M0; None in a gap.
        risky: How risky, M7; None in a gap or where exposure is unknown.
        coverage: Recorded share of the open camera-hours; None when the site was closed all week.
        state: "ok", or why it is a gap.
        reason: Why it is a gap.
    """

    often: RateEstimate | None
    risky: RateEstimate | None
    coverage: float | None
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class WeeklyTrend:
    """Weeks in a row, oldest first.

    Attributes:
        weeks: One for each week, gaps included.
        state: "ok" when at least three weeks are no gaps.
        reason: Why not.
    """

    weeks: tuple[WeekLevel, ...]
    state: State
    reason: Reason | None


def weekly_trend(
    n: npt.ArrayLike,
    x_h: npt.ArrayLike,
    exposure_h: npt.ArrayLike | None,
    open_h: npt.ArrayLike,
    *,
    coverage: npt.ArrayLike,
    n_weeks: int,
    min_coverage: float = DEFAULTS.min_coverage,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
    min_exposure_h: float = DEFAULTS.min_exposure_h,
) -> WeeklyTrend:
    """Return the two headline figures of each of the last weeks, as their own reports would have printed them.

    Each week is `how_often` and `how_risky` of its seven days, with the recorded days of the five weeks before it as
    history. A week recorded for less than `min_coverage` of its open camera-hours is a gap.

    Args:
        n: Violations by camera and day, Monday first, shape (n_cameras, 7 n_all_weeks), oldest first.
        x_h: Recorded open hours that enter rates, same shape.
        exposure_h: Person-hours, same shape; None = the engine sends no positions.
        open_h: Open hours of each day, shape (7 n_all_weeks,).
        coverage: Recorded share of the open camera-hours of each week, shape (n_all_weeks,); NaN = closed all week.
        n_weeks: Weeks to tell, the last ones; those before are history only.
        min_coverage: Share of open camera-hours a week needs.
        confidence: Level of the intervals.
        min_days: Recorded days an interval needs.
        min_exposure_h: Person-hours a rate per person-hour needs.

    Raises:
        ValueError: Days do not make whole weeks, shapes do not fit, or a number is negative or infinite.
    """
    counts, hours = np.asarray(n, dtype=np.float64), np.asarray(x_h, dtype=np.float64)
    open_hours = np.asarray(open_h, dtype=np.float64)
    people = None if exposure_h is None else np.asarray(exposure_h, dtype=np.float64)
    if counts.shape[-1] % 7 or counts.shape != hours.shape or open_hours.shape != counts.shape[-1:]:
        raise ValueError(f"days must make whole weeks, cameras x days: {counts.shape}, {hours.shape}")
    n_all = counts.shape[-1] // 7
    shares = np.asarray(coverage, dtype=np.float64)
    weeks: list[WeekLevel] = []
    for w in range(max(n_all - n_weeks, 0), n_all):
        now = slice(7 * w, 7 * w + 7)
        share = None if np.isnan(shares[w]) else float(shares[w])
        if share is None or share < min_coverage or not hours[:, now].any():
            weeks.append(WeekLevel(None, None, share, "not_enough_data", _gap(share, min_coverage)))
            continue
        days = np.arange(7 * max(w - HISTORY_WEEKS, 0), 7 * w)
        days = days[(hours[:, days] > 0).any(axis=0) & (open_hours[now] > 0)[days % 7]]
        weekday, past_weekday = (np.arange(7), days % 7) if len(days) else (None, None)
        often = how_often(
            counts[:, now],
            hours[:, now],
            weekday=weekday,
            history_n=counts[:, days] if len(days) else None,
            history_x_h=hours[:, days] if len(days) else None,
            history_weekday=past_weekday,
            confidence=confidence,
            min_days=min_days,
        )
        risky = None
        if people is not None:
            risky = how_risky(
                counts[:, now].sum(axis=0),
                people[:, now].sum(axis=0),
                weekday=weekday,
                history_n=counts[:, days].sum(axis=0) if len(days) else None,
                history_exposure_h=people[:, days].sum(axis=0) if len(days) else None,
                history_weekday=past_weekday,
                confidence=confidence,
                min_days=min_days,
                min_exposure_h=min_exposure_h,
            )
        weeks.append(WeekLevel(often, risky, share, "ok", None))
    n_shown = sum(week.state == "ok" for week in weeks)
    if n_shown < MIN_TREND_WEEKS:
        reason = Reason("trend.weeks", least=MIN_TREND_WEEKS, has=n_shown)
        return WeeklyTrend(tuple(weeks), "not_enough_data", reason)
    return WeeklyTrend(tuple(weeks), "ok", None)


def _gap(coverage: float | None, min_coverage: float) -> Reason:
    if coverage is None:
        return Reason("trend.closed")
    if coverage == 0:
        return Reason("recorded.nothing")
    return Reason("trend.coverage", share=coverage, least=min_coverage)
