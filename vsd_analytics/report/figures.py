"""The catalogue of a report: its figures by id, M0 to M29, as the JSON twin gives them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from vsd_analytics.report.model import AreaRow, Coverage, Estimate, Figure, Level
from vsd_analytics.report.weekdata import WeekData


def figures(data: WeekData, *, coverage: Coverage, level: Level, areas: Sequence[AreaRow]) -> Mapping[str, Figure]:
    """Return the figures of the week by catalogue id.

    Args:
        data: The week.
        coverage: Recorded hours.
        level: Headline numbers, already without what must be held back.
        areas: Areas, likewise.
    """
    recorded_h = float(data.panel(data.everyone, data.week_days).x_h.sum())
    return {
        "M0": _figure(level.often, "violations per open hour", recorded_h),
        "M1": Figure(
            unit="share of open camera-hours",
            value=coverage.share if coverage.scheduled_h else None,
            denominator=coverage.scheduled_h,
            state="ok" if coverage.scheduled_h else "not_enough_data",
            reason=None if coverage.scheduled_h else "the site was closed all week",
        ),
        "M2": _outages(coverage),
        "M3": _exposure(level, recorded_h),
        "M5": _figure(level.people, "people in view, mean over recorded open hours", recorded_h),
        "M6": _violation_time(data, level),
        "M7": _figure(level.risky, "violations per person-hour", level.exposure_h),
        "M8": _count(level, recorded_h),
        "M15": _areas(data, areas),
    }


def _outages(coverage: Coverage) -> Figure:
    rows = tuple(
        {
            "cameras": list(o.camera_ids),
            "start": o.start.isoformat(),
            "end": o.end.isoformat(),
            "open_h": o.open_h,
            "is_inferred": o.is_inferred,
        }
        for o in coverage.outages
    )
    return Figure(unit="outages of 10 minutes or more", rows=rows)


def _exposure(level: Level, recorded_h: float) -> Figure:
    unit = "person-hours"
    if level.exposure_h is None:
        return _missing(unit, level.people, otherwise="nothing was recorded in opening hours")
    return Figure(unit=unit, value=level.exposure_h, denominator=recorded_h)


def _violation_time(data: WeekData, level: Level) -> Figure:
    unit = f"share of person-time closer than {data.site.settings.distance_m:g} m to somebody"
    if level.exposure_h is None or data.why_no_violations is not None:
        blocked = level.often if data.why_no_violations is not None else level.people
        return _missing(unit, blocked, otherwise="nothing was recorded in opening hours")
    if level.exposure_h == 0:
        reason = "nobody was seen in recorded open hours"
        return Figure(unit=unit, denominator=0.0, state="not_enough_data", reason=reason)
    counted = data.hours.is_counted & data.whole.cameras[:, None]
    violation_h = float((data.violation_h * counted)[:, data.week()].sum())
    return Figure(unit=unit, value=violation_h / level.exposure_h, denominator=level.exposure_h)


def _count(level: Level, recorded_h: float) -> Figure:
    unit = "violations counted in the hours that enter rates"
    if level.violations is None:
        return _missing(unit, level.often, otherwise="nothing was recorded in opening hours")
    return Figure(unit=unit, value=level.violations, denominator=recorded_h)


def _areas(data: WeekData, areas: Sequence[AreaRow]) -> Figure:
    unit = "violations per open hour and per person-hour, by area"
    if areas:
        rows = tuple(
            {
                "area": a.area_id,
                "name": a.name,
                "often": a.often.value,
                "risky": None if a.risky is None else a.risky.value,
                "exposure_h": a.exposure_h,
                "state": a.often.state,
            }
            for a in areas
        )
        return Figure(unit=unit, rows=rows)
    reason = data.why_no_violations or data.why_no_places
    if reason is not None:
        return Figure(unit=unit, state="not_measurable", reason=reason)
    return Figure(unit=unit, state="not_enough_data", reason="no areas are drawn in vsd.toml, or nothing was recorded")


def _figure(estimate: Estimate, unit: str, denominator: float | None) -> Figure:
    return Figure(
        unit=unit,
        value=estimate.value,
        lo=estimate.lo,
        hi=estimate.hi,
        verdict=estimate.verdict,
        denominator=denominator,
        state=estimate.state,
        reason=estimate.reason,
    )


def _missing(unit: str, estimate: Estimate, *, otherwise: str) -> Figure:
    """Return a figure without a value, for the reason of the estimate it hangs on."""
    state = estimate.state if estimate.state != "ok" else "not_enough_data"
    return Figure(unit=unit, state=state, reason=estimate.reason or otherwise)
