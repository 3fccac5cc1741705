"""The two headline numbers, and people, for a floor or an area: level, interval, change, verdict (M0, M7, M3)."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date

import numpy as np

from vsd_analytics.report.model import Estimate, Verdict
from vsd_analytics.report.weekdata import Panel, WeekData
from vsd_analytics.stats.changes import compare_exposure, compare_how_often, compare_how_risky
from vsd_analytics.stats.estimates import ChangeEstimate, RateEstimate
from vsd_analytics.stats.rates import how_often, how_risky

VERDICTS: dict[str, Verdict] = {
    "clear fall": "clear_fall",
    "clear rise": "clear_rise",
    "no clear change": "no_clear_change",
    "too little data": "too_little_data",
}

NO_IDS = "the engine sends no track ids, so records cannot be joined to violations"
NO_POSITIONS = "the engine sends no positions"
NO_FLOOR = "the engine sends pixels and its camera has no calibration"


def why_no_violations(data: WeekData) -> str | None:
    """Return why violations cannot be counted on this floor, or None if they can."""
    sent = data.what_is_sent
    if sent["n_pairs"] and sent["n_pairs_without_ids"] * 2 > sent["n_pairs"]:
        return NO_IDS
    if not sent["n_pairs"] and sent["n_unlocated"] * 2 > sent["n_persons"] > 0:
        return NO_FLOOR
    return None


def why_no_exposure(data: WeekData) -> str | None:
    """Return why person-time is unknown on this floor, or None if it is known."""
    sent = data.what_is_sent
    return NO_POSITIONS if sent["n_pairs"] and not sent["n_persons"] else None


def often(
    data: WeekData,
    *,
    area_id: str | None = None,
    is_floor: bool = True,
    is_compared: bool = True,
    since: int | None = None,
) -> Estimate:
    """Return M0 of a floor or area: violations per recorded open hour, with interval and change.

    Args:
        data: The week.
        area_id: Area; with `is_floor` False, None is the rest of the floor.
        is_floor: The whole floor.
        is_compared: Compare with the week before.
        since: Only from this instant on (UTC milliseconds).
    """
    if (why := why_no_violations(data)) is not None:
        return Estimate(value=None, state="not_measurable", reason=why)
    hours = data.current if since is None else data.current[data.current["hour_start_ms"] >= since]
    level = _level_often(
        data, hours if is_floor else data.of_area(hours, area_id), area_id, is_floor, is_history=since is None
    )
    if not is_compared:
        return _estimate(level)
    before, now = data.compared(area_id, is_floor=is_floor, since=since)
    return _estimate(
        level, compare_how_often(before.n, before.x_h, now.n, now.x_h, **_rules(data)), hours=float(now.x_h.sum())
    )


def risky(data: WeekData, *, area_id: str | None = None, is_floor: bool = True, is_compared: bool = True) -> Estimate:
    """Return M7 of a floor or area: violations per person-hour, with interval and change; arguments as for `often`."""
    why = why_no_violations(data) or why_no_exposure(data)
    if why is not None:
        return Estimate(value=None, state="not_measurable", reason=why)
    hours = data.current if is_floor else data.of_area(data.current, area_id)
    panel = data.panel(hours, data.week_days)
    settings = data.site.settings
    past = data.hours if is_floor else data.of_area(data.hours, area_id)
    history = data.panel(past, data.history_days)
    level = how_risky(
        panel.n.sum(axis=0),
        panel.exposure_h.sum(axis=0),
        weekday=_weekdays(data.week_days),
        **_history_risky(history, data.history_days),
        **_rules(data),
        min_exposure_h=settings.min_exposure_h,
    )
    if not is_compared:
        return _estimate(level)
    before, now = data.compared(area_id, is_floor=is_floor)
    change = compare_how_risky(
        before.n.sum(axis=0),
        before.exposure_h.sum(axis=0),
        now.n.sum(axis=0),
        now.exposure_h.sum(axis=0),
        **_rules(data),
        min_exposure_h=settings.min_exposure_h,
    )
    return _estimate(level, change, hours=float(now.x_h.sum()))


def people(data: WeekData, *, is_compared: bool = True) -> Estimate:
    """Return the mean number of people in view of a floor: person-hours per recorded open hour, and its change (M3)."""
    if (why := why_no_exposure(data)) is not None:
        return Estimate(value=None, state="not_measurable", reason=why)
    panel = data.panel(data.current, data.week_days)
    recorded = panel.x_h.sum(axis=1)
    seen = recorded > 0
    if not seen.any():
        return Estimate(value=None, state="not_enough_data", reason="nothing was recorded in opening hours")
    value = float((panel.exposure_h.sum(axis=1)[seen] / recorded[seen]).sum())
    if not is_compared:
        return Estimate(value=value)
    before, now = data.compared()
    change = compare_exposure(before.exposure_h, before.x_h, now.exposure_h, now.x_h, **_rules(data))
    return Estimate(
        value=value,
        previous=change.rate_a,
        change=change.change,
        change_lo=change.change_lo,
        change_hi=change.change_hi,
        verdict=VERDICTS[change.verdict],
        hours_compared=float(now.x_h.sum()),
    )


def _level_often(
    data: WeekData, hours: object, area_id: str | None, is_floor: bool, *, is_history: bool
) -> RateEstimate:
    panel = data.panel(hours, data.week_days)  # type: ignore[arg-type]
    past = data.hours if is_floor else data.of_area(data.hours, area_id)
    days = data.history_days if is_history else []
    history = data.panel(past, days)
    return how_often(
        panel.n,
        panel.x_h,
        weekday=_weekdays(data.week_days),
        **_history_often(history, days),
        **_rules(data),
    )


def _history_often(history: Panel, days: Sequence[date]) -> dict[str, object]:
    if not days:
        return {}
    return {"history_n": history.n, "history_x_h": history.x_h, "history_weekday": _weekdays(days)}


def _history_risky(history: Panel, days: Sequence[date]) -> dict[str, object]:
    if not days:
        return {}
    return {
        "history_n": history.n.sum(axis=0),
        "history_exposure_h": history.exposure_h.sum(axis=0),
        "history_weekday": _weekdays(days),
    }


def _rules(data: WeekData) -> dict[str, object]:
    return {"confidence": data.site.settings.confidence, "min_days": data.site.settings.min_days}


def _weekdays(days: Sequence[date]) -> np.ndarray:
    return np.array([d.weekday() for d in days])


def _estimate(level: RateEstimate, change: ChangeEstimate | None = None, *, hours: float | None = None) -> Estimate:
    return Estimate(
        value=level.rate,
        lo=level.lo,
        hi=level.hi,
        state=level.state if level.rate is None else "ok",
        reason=level.reason if level.lo is None else None,
        previous=None if change is None else change.rate_a,
        change=None if change is None else change.change,
        change_lo=None if change is None else change.change_lo,
        change_hi=None if change is None else change.change_hi,
        verdict=None if change is None else VERDICTS[change.verdict],
        hours_compared=hours,
    )
