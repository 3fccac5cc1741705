"""The last weeks side by side: how often, time too close and encounters of each, with intervals, and gaps (M28)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from vsd_analytics.answer import Reason, State
from vsd_analytics.settings import DEFAULTS
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.stats.rates import HISTORY_WEEKS, encounter_rate, violation_rate

Floats = npt.NDArray[np.float64]
SECONDS: Final = 3600.0
MIN_TREND_WEEKS: Final = 3
"""Two weeks always lie on a line."""


@dataclass(frozen=True, slots=True)
class WeekRates:
    """One week of a trend.

    Attributes:
        monday: First day.
        violation_rate: Violations per open hour (M0); None in a gap.
        encounter_rate: Violations per person-hour (M7); None in a gap or where exposure is unknown.
        close: Share of person-time too close (M6); None in a gap or where it is unknown.
        coverage: Recorded share of the open camera-hours; None when the site was closed all week.
        state: "ok", or why it is a gap: a line must not be drawn across it.
        reason: Why it is a gap.
        missing: Positions of cameras that recorded too little of this week to compare it with the last one.
    """

    monday: date
    violation_rate: RateEstimate | None
    encounter_rate: RateEstimate | None
    close: RateEstimate | None
    coverage: float | None
    state: State
    reason: Reason | None
    missing: tuple[int, ...] = ()

    @property
    def week(self) -> str:
        """Return the ISO week: 2026-W46."""
        return f"{self.monday:%G-W%V}"


def weekly_trend(
    n: npt.ArrayLike,
    x_h: npt.ArrayLike,
    exposure_h: npt.ArrayLike | None,
    open_h: npt.ArrayLike,
    *,
    close_h: npt.ArrayLike | None = None,
    coverage: npt.ArrayLike,
    mondays: Sequence[date],
    withheld: npt.ArrayLike | None = None,
    min_coverage: float = DEFAULTS.min_coverage,
    confidence: float = DEFAULTS.confidence,
    min_days: int = DEFAULTS.min_days,
    min_exposure_h: float = DEFAULTS.min_exposure_h,
) -> tuple[WeekRates, ...]:
    """Return the headline figures of each of the last weeks, gaps included, over the cameras of the last one.

    Each week is `violation_rate` and `encounter_rate` of its seven days, with the recorded days of five weeks before
    as history. A week recorded for less than `min_coverage` of its open camera-hours is a gap. Cameras that recorded
    nothing in the last week are left out of all weeks, so that a camera that broke does not look like a fall; a week in
    which another one recorded less than `min_coverage` of the open hours names it in `missing`.

    Args:
        n: Violations by camera and day, Monday first, shape (n_cameras, 7 n_all_weeks), oldest first.
        x_h: Recorded open hours that enter rates, same shape.
        exposure_h: Person-hours, same shape; None = the engine sends no positions.
        open_h: Open hours of each day, shape (7 n_all_weeks,).
        close_h: Person-hours too close, shape as `n`; None = unknown.
        coverage: Recorded share of the open camera-hours of each week, shape (n_all_weeks,); NaN = closed all week.
        mondays: First days of the weeks wanted, the last ones; the weeks before are history only.
        withheld: Days that are no history, shape (7 n_all_weeks,); None = none.
        min_coverage: Share of open camera-hours a week needs.
        confidence: Level of the intervals.
        min_days: Recorded days an interval needs.
        min_exposure_h: Person-hours a rate per person-hour needs.

    Raises:
        ValueError: Days do not make whole weeks, shapes do not fit, or a number is negative or infinite.
    """
    counts, hours = np.asarray(n, dtype=np.float64), np.asarray(x_h, dtype=np.float64)
    open_hours = np.asarray(open_h, dtype=np.float64)
    people, close = (None if v is None else np.asarray(v, dtype=np.float64) for v in (exposure_h, close_h))
    if counts.shape[-1] % 7 or counts.shape != hours.shape or open_hours.shape != counts.shape[-1:]:
        raise ValueError(f"days must make whole weeks, cameras x days: {counts.shape}, {hours.shape}")
    n_all = counts.shape[-1] // 7
    used = hours[:, -7:].any(axis=1) if hours[:, -7:].any() else np.ones(len(hours), dtype=np.bool_)
    positions, counts, hours = np.flatnonzero(used), counts[used], hours[used]
    people, close = (None if v is None else v[used] for v in (people, close))
    is_history = (
        np.ones(counts.shape[-1], dtype=np.bool_) if withheld is None else ~np.asarray(withheld, dtype=np.bool_)
    )
    shares = np.asarray(coverage, dtype=np.float64)
    weeks: list[WeekRates] = []
    for w, monday in zip(range(n_all - len(mondays), n_all), mondays, strict=True):
        now = slice(7 * w, 7 * w + 7)
        share = None if np.isnan(shares[w]) else float(shares[w])
        if share is None or share < min_coverage or not hours[:, now].any():
            weeks.append(WeekRates(monday, None, None, None, share, "not_enough_data", _gap(share, min_coverage)))
            continue
        open_now = open_hours[now].sum()
        is_short = hours[:, now].sum(axis=1) < min_coverage * open_now
        missing = tuple(positions[is_short & (w < n_all - 1)].tolist())
        days = np.arange(7 * max(w - HISTORY_WEEKS, 0), 7 * w)
        days = days[(hours[:, days] > 0).any(axis=0) & (open_hours[now] > 0)[days % 7] & is_history[days]]
        weekday, past_weekday = (np.arange(7), days % 7) if len(days) else (None, None)
        per_open_h = violation_rate(
            counts[:, now],
            hours[:, now],
            weekday=weekday,
            history_n=counts[:, days] if len(days) else None,
            history_x_h=hours[:, days] if len(days) else None,
            history_weekday=past_weekday,
            confidence=confidence,
            min_days=min_days,
        )
        rules = {"weekday": weekday, "history_weekday": past_weekday, "confidence": confidence, "min_days": min_days}
        per_person_h = share_close = None
        if people is not None:
            per_person_h = _per_person_hour(counts, people, now, days, min_exposure_h=min_exposure_h, **rules)
        if people is not None and close is not None:
            share_close = _as_share(_per_person_hour(close * SECONDS, people, now, days, min_exposure_h=0.0, **rules))
        weeks.append(WeekRates(monday, per_open_h, per_person_h, share_close, share, "ok", None, missing))
    return tuple(weeks)


def _per_person_hour(
    events: Floats, people: Floats, now: slice, past: npt.NDArray[np.int64], **rules: Any
) -> RateEstimate:
    """Return events per person-hour of the days `now`, with those of the days `past` as history, all cameras."""
    if len(past):
        rules |= {"history_n": events[:, past].sum(axis=0), "history_exposure_h": people[:, past].sum(axis=0)}
    return encounter_rate(events[:, now].sum(axis=0), people[:, now].sum(axis=0), **rules)


def _as_share(close: RateEstimate) -> RateEstimate:
    """Return person-seconds per person-hour as a share; they are no count of violations."""
    rate, lo, hi = (None if v is None else min(1.0, v / SECONDS) for v in (close.value, close.lo, close.hi))
    return replace(close, value=rate, lo=lo, hi=hi, n_events=None)


def why_no_trend(weeks: Sequence[WeekRates]) -> Reason | None:
    """Return why weeks make no trend: fewer than three are no gaps. None when they make one."""
    n_recorded = sum(week.state == "ok" for week in weeks)
    return Reason("trend.weeks", least=MIN_TREND_WEEKS, has=n_recorded) if n_recorded < MIN_TREND_WEEKS else None


def _gap(coverage: float | None, min_coverage: float) -> Reason:
    if coverage is None:
        return Reason("trend.closed")
    if coverage == 0:
        return Reason("recorded.nothing")
    return Reason("trend.coverage", share=coverage, least=min_coverage)
