"""What is known of a logged change over many weeks: its running verdict, and what became of the whole floor.

The arithmetic is `vsd_analytics.stats.running_verdict` and `vsd_analytics.stats.net_effect`. Both count person-time in
violation per recorded open hour, by whole weeks from the windows of `change_weeks`. Comparison areas are taken together
as one here: weights fitted to the weeks before would make those weeks look steadier than the weeks to come.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from vsd_analytics.figures.change_weeks import Windows, changed_areas
from vsd_analytics.figures.comparable import recalibrations
from vsd_analytics.figures.panels import WEEK, Array, FloorHours, Panel, Place
from vsd_analytics.result import Reason
from vsd_analytics.site.model import Area
from vsd_analytics.stats.net_effect import NetEffect, net_effect
from vsd_analytics.stats.period_days import PeriodDays
from vsd_analytics.stats.running_verdict import RunningVerdict, running_verdict

Days = tuple[date, date]


@dataclass(frozen=True, slots=True)
class FloorEffect:
    """What became of the floor, and the part of one area in it.

    Attributes:
        net: The change of the floor, after over reference weeks.
        places: Ids of the areas whose parts `net.contributions` gives, in order; None = the rest of the floor.
        share: Share of the floor's change that the changed area holds; None where they moved apart.
        moved_elsewhere: How much of the area's fall the rest of the floor took up, 0 to 1 or more; None without a fall.
        area_min: Person-minutes in violation in the area in a week of the weeks before, on average.
        floor_min: The same of the floor.
    """

    net: NetEffect
    places: tuple[str | None, ...]
    share: float | None
    moved_elsewhere: float | None
    area_min: float | None = None
    floor_min: float | None = None


def floor_effect(data: FloorHours, area: Area, windows: Windows) -> FloorEffect | None:
    """Return the net effect on the floor and the contributions of its areas; None where violation time is unknown."""
    if not np.isfinite(data.violation_h).all():
        return None
    places: list[str | None] = [a.area_id for a in data.areas]
    places.append(None)
    (n_b, x_b), (n_a, x_a) = (_floor_weeks(data, places, span) for span in (windows.trend, windows.after))
    net = net_effect(n_b, x_b, n_a, x_a, confidence=data.site.settings.confidence)
    k = places.index(area.area_id)
    usual_min = 60 * n_b[:, x_b > 0].mean(axis=1) if (x_b > 0).any() else None
    return FloorEffect(
        net,
        tuple(places),
        share=net.share_of(k) if net.state == "ok" else None,
        moved_elsewhere=net.moved_elsewhere(k) if net.state == "ok" else None,
        area_min=None if usual_min is None else float(usual_min[k]),
        floor_min=None if usual_min is None else float(usual_min.sum()),
    )


def running(data: FloorHours, area: Area, others: Sequence[Area], windows: Windows) -> RunningVerdict | None:
    """Return the verdict on a change after all weeks watched so far; None where violation time is unknown.

    Comparison areas that the log names later are left out. Where a camera was recalibrated in these weeks there is
    no verdict: such weeks were not measured alike.
    """
    if not np.isfinite(data.violation_h).all():
        return None
    changed = changed_areas(data.site, windows.trend[0], windows.watched[1])
    left = [a for a in others if a.area_id not in changed]
    reason = None if left else Reason("redesign.no_comparison")
    if _is_recalibrated(data, (area, *left), windows.trend[0], windows.watched[1]):
        reason = Reason("redesign.not_alike")
    if reason is not None:
        return RunningVerdict(None, None, None, None, (), None, 0, 0, "too_little_data", "not_enough_data", reason)
    y = [log_ratios(data, area, left, span) for span in (windows.trend, windows.watched)]
    return running_verdict(*y, confidence=data.site.settings.confidence)


def log_ratios(data: FloorHours, area: Area, others: Sequence[Area], span: Days) -> Array:
    """Return by week the log ratio of an area's violation time per open hour to that of others together.

    Returns:
        Shape (n_weeks,); NaN in a week that recorded too little of the open hours, or in which nothing was counted.
    """
    return log_rates(data, [area], span) - log_rates(data, others, span)


def log_rates(data: FloorHours, areas: Sequence[Area], span: Days) -> Array:
    """Return by week the log of the violation time per open hour of some areas together; NaN as for `log_ratios`."""
    panels = [data.panel(timed(data, a.area_id), days_of(span)) for a in areas]
    n, x_h = (by_week(np.sum([getattr(p, name).sum(axis=0) for p in panels], axis=0)) for name in ("n", "x_h"))
    known = (n > 0) & (x_h > 0) & (x_h >= data.site.settings.min_coverage * x_h.max(initial=0.0))
    return np.log(np.divide(n, x_h, out=np.full_like(n, np.nan), where=known))


def history_of(data: FloorHours, area: Area, others: Sequence[Area], span: Days) -> PeriodDays:
    """Return violation time per open hour of an area and others by day."""
    days = days_of(span)
    panels = [data.panel(timed(data, a.area_id), days) for a in (area, *others)]
    return by_day(panels, days, per="x_h")


def by_day(
    panels: Sequence[Panel], days: Sequence[date], *, per: str, counts: Sequence[Panel] | None = None
) -> PeriodDays:
    """Return panels of the changed place and the comparison areas, summed over cameras.

    Args:
        panels: Numerators and denominators; the first is the changed place.
        days: The columns.
        per: Which denominator: "exposure_h" or "x_h".
        counts: Panels whose `n` counts violations, where that of `panels` is a time.
    """
    n, x_h = (np.array([getattr(p, name).sum(axis=0) for p in panels]) for name in ("n", per))
    events = None if counts is None else np.array([p.n.sum(axis=0) for p in counts])
    first = min(days)
    return PeriodDays(
        n=n[0],
        x_h=x_h[0],
        comparison_n=n[1:],
        comparison_x_h=x_h[1:],
        weekday=np.array([d.weekday() for d in days], dtype=np.int64),
        week=np.array([(d - first).days // 7 for d in days], dtype=np.int64),
        events=None if events is None else events[0],
        comparison_events=None if events is None else events[1:],
    )


def timed(data: FloorHours, area_id: str | None) -> Place:
    """Return an area with person-hours in violation in the place of violations; None is the rest of the floor."""
    n, exposure_h = data.counted_in(area_id)
    violation_h = data.violation_in(area_id)
    cameras = np.asarray((n + exposure_h + violation_h).any(axis=1))
    return Place(violation_h, exposure_h, cameras, data.is_there(area_id))


def days_of(span: Days) -> list[date]:
    """Return the days from the first to the last, both included."""
    first, last = span
    return [date.fromordinal(d) for d in range(first.toordinal(), last.toordinal() + 1)]


def by_week(values: Array) -> Array:
    """Return sums over weeks of the days of whole weeks, the last axis."""
    return np.asarray(values.reshape(*values.shape[:-1], -1, WEEK.days).sum(axis=-1))


def _floor_weeks(data: FloorHours, places: Sequence[str | None], span: Days) -> tuple[Array, Array]:
    """Return violation time by place and week, scaled to all open hours of each camera, and the floor's open hours.

    A week in which a camera recorded too little has 0 hours: it says nothing.
    """
    days = days_of(span)
    hours = data.hours
    open_h = by_week(
        np.array([hours.open_s[hours.day == d.toordinal()].sum() / 3600 for d in days]),
    )
    everyone = data.panel(data.everyone, days)
    recorded_h = by_week(everyone.x_h)
    used = recorded_h.any(axis=1)
    enough = (recorded_h[used] >= data.site.settings.min_coverage * open_h).all(axis=0) & (open_h > 0)
    scale = np.divide(open_h, recorded_h, out=np.zeros_like(recorded_h), where=recorded_h > 0)
    n = np.array([(by_week(data.panel(timed(data, p), days).n) * scale).sum(axis=0) for p in places])
    return n, np.where(enough, open_h, 0.0)


def _is_recalibrated(data: FloorHours, areas: Sequence[Area], first: date, last: date) -> bool:
    """Tell whether a camera that counts in some areas was recalibrated between two days."""
    since, until = data.span_ms(first, last)
    anew = {r.camera_id for r in recalibrations(data.warehouse, cameras=data.cameras, first_ms=since, end_ms=until)}
    counts = np.any([timed(data, a.area_id).cameras for a in areas], axis=0)
    return any(c in anew for c, is_used in zip(data.ids, counts.tolist(), strict=True) if is_used)
