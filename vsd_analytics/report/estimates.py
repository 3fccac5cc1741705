"""The two headline numbers, and people, of a place: level, interval, change, verdict (M0, M7, M3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.report import format as fmt
from vsd_analytics.report.model import Estimate, Verdict
from vsd_analytics.report.privacy import is_small
from vsd_analytics.report.weekdata import Panel, Place, WeekData
from vsd_analytics.stats.changes import compare_exposure, compare_how_often, compare_how_risky
from vsd_analytics.stats.estimates import ChangeEstimate, RateEstimate
from vsd_analytics.stats.rates import how_often, how_risky

VERDICTS: dict[str, Verdict] = {
    "clear fall": "clear_fall",
    "clear rise": "clear_rise",
    "no clear change": "no_clear_change",
    "too little data": "too_little_data",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """Both headline numbers of a place and the counts behind them, which decide what may be printed.

    Attributes:
        often: How often, M0.
        risky: How risky, M7.
        n: Violations in the hours that enter rates.
        n_before: Violations of the week before in the hours compared; 0 when nothing is compared.
    """

    often: Estimate
    risky: Estimate
    n: int
    n_before: int


def measure(
    data: WeekData, place: Place, *, is_compared: bool, since: int | None = None, until: int | None = None
) -> Measured:
    """Return the two headline numbers of a place.

    Args:
        data: The week.
        place: The whole floor, an area, or the rest.
        is_compared: Compare with the week before.
        since: Only hours that start at this instant or later (UTC milliseconds, in this week).
        until: Only hours that start before it; not for comparisons.
    """
    panel = data.panel(place, data.week_days, since=since, until=until)
    pair = data.compared(place, since=since) if is_compared else None
    is_part = since is not None or until is not None
    history = data.panel(place, [] if is_part else data.history_days)
    return Measured(
        often=_often(data, panel, pair, history),
        risky=_risky(data, panel, pair, history),
        n=int(panel.n.sum()),
        n_before=0 if pair is None else int(pair[0].n.sum()),
    )


def people(data: WeekData, *, is_compared: bool) -> Estimate:
    """Return the mean number of people in view of the floor: person-hours per recorded open hour, and its change."""
    if (why := data.why_no_exposure) is not None:
        return Estimate(value=None, state="not_measurable", reason=why)
    panel = data.panel(data.everyone, data.week_days)
    recorded = panel.x_h.sum(axis=1)
    seen = recorded > 0
    if not seen.any():
        return Estimate(value=None, state="not_enough_data", reason="nothing was recorded in opening hours")
    value = float((panel.exposure_h.sum(axis=1)[seen] / recorded[seen]).sum())
    if not is_compared:
        return Estimate(value=value)
    before, now = data.compared(data.everyone)
    settings = data.site.settings
    change = compare_exposure(
        before.exposure_h,
        before.x_h,
        now.exposure_h,
        now.x_h,
        confidence=settings.confidence,
        min_days=settings.min_days,
    )
    return _estimate(RateEstimate(value, None, None, None, 0.0, 0, None, None, "ok", None, False), change, now)


def without_figures(estimate: Estimate, reason: str) -> Estimate:
    """Return an estimate of which nothing is told but why."""
    if estimate.state == "not_measurable":
        return estimate
    verdict: Verdict | None = None if estimate.verdict is None else "too_little_data"
    return Estimate(value=None, state="not_enough_data", reason=reason, verdict=verdict)


def without_change(estimate: Estimate, reason: str) -> Estimate:
    """Return an estimate that keeps its level and its verdict, but not the week before."""
    if estimate.verdict is None:
        return estimate
    return replace(estimate, previous=None, change=None, change_lo=None, change_hi=None, reason=reason)


def _often(data: WeekData, panel: Panel, pair: tuple[Panel, Panel] | None, history: Panel) -> Estimate:
    if (why := data.why_no_violations) is not None:
        return Estimate(value=None, state="not_measurable", reason=why)
    settings = data.site.settings
    has_history = history.n.shape[1] > 0
    level = how_often(
        panel.n,
        panel.x_h,
        weekday=_weekdays(data.week_days),
        history_n=history.n if has_history else None,
        history_x_h=history.x_h if has_history else None,
        history_weekday=_weekdays(data.history_days) if has_history else None,
        confidence=settings.confidence,
        min_days=settings.min_days,
    )
    if level.rate is None and data.hours.recorded_s[:, data.week()].any():
        share = fmt.percent(settings.partial_hour_share)
        return Estimate(value=None, state="not_enough_data", reason=f"no open hour was recorded to {share} or more")
    if pair is None:
        return _estimate(level)
    before, now = pair
    change = compare_how_often(
        before.n, before.x_h, now.n, now.x_h, confidence=settings.confidence, min_days=settings.min_days
    )
    return _without_small_counts(_estimate(level, change, now), change, below=settings.mask_below)


def _risky(data: WeekData, panel: Panel, pair: tuple[Panel, Panel] | None, history: Panel) -> Estimate:
    if (why := data.why_no_violations or data.why_no_exposure) is not None:
        return Estimate(value=None, state="not_measurable", reason=why)
    settings = data.site.settings
    has_history = history.n.shape[1] > 0
    level = how_risky(
        panel.n.sum(axis=0),
        panel.exposure_h.sum(axis=0),
        weekday=_weekdays(data.week_days),
        history_n=history.n.sum(axis=0) if has_history else None,
        history_exposure_h=history.exposure_h.sum(axis=0) if has_history else None,
        history_weekday=_weekdays(data.history_days) if has_history else None,
        confidence=settings.confidence,
        min_days=settings.min_days,
        min_exposure_h=settings.min_exposure_h,
    )
    if pair is None:
        return _estimate(level)
    before, now = pair
    change = compare_how_risky(
        before.n.sum(axis=0),
        before.exposure_h.sum(axis=0),
        now.n.sum(axis=0),
        now.exposure_h.sum(axis=0),
        confidence=settings.confidence,
        min_days=settings.min_days,
        min_exposure_h=settings.min_exposure_h,
    )
    return _without_small_counts(_estimate(level, change, now), change, below=settings.mask_below)


def _weekdays(days: Sequence[date]) -> NDArray[np.int64]:
    return np.array([d.weekday() for d in days], dtype=np.int64)


def _estimate(level: RateEstimate, change: ChangeEstimate | None = None, now: Panel | None = None) -> Estimate:
    reason = level.reason if level.lo is None else None
    if reason is None and change is not None and change.state != "ok":
        reason = change.reason
    plain = Estimate(
        value=level.rate,
        lo=level.lo,
        hi=level.hi,
        state=level.state if level.rate is None else "ok",
        reason=reason,
    )
    if change is None or now is None:
        return plain
    if level.rate is None:  # without a level no change is told either
        return replace(plain, verdict="too_little_data")
    return replace(
        plain,
        previous=change.rate_a,
        change=change.change,
        change_lo=change.change_lo,
        change_hi=change.change_hi,
        verdict=VERDICTS[change.verdict],
        hours_compared=float(now.x_h.sum()),
    )


def _without_small_counts(estimate: Estimate, change: ChangeEstimate, *, below: int) -> Estimate:
    """Return an estimate whose reason names no count under `below`."""
    if estimate.reason is None or not any(is_small(n or 0, below=below) for n in (change.n_a, change.n_b)):
        return estimate
    return replace(estimate, reason="too few violations to compare")
