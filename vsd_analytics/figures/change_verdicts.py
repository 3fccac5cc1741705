"""What is known of a logged change over many weeks: its running verdict, and what became of the whole floor.

The arithmetic is `vsd_analytics.stats.logged_change` and `vsd_analytics.stats.net_effect`. Both count person-time in
violation per recorded open hour, by whole weeks from the windows of `change_weeks`. Comparison areas are taken together
as one here: weights fitted to the weeks before would make those weeks look steadier than the weeks to come.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import date

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.change_weeks import Windows, changed_areas
from vsd_analytics.figures.comparable import recalibrations
from vsd_analytics.figures.panels import WEEK, Array, FloorHours, Panel, Place
from vsd_analytics.site.model import Area
from vsd_analytics.stats.logged_change import AreaWeeks, TakenUp, taken_up, verdict_of_weeks
from vsd_analytics.stats.net_effect import NetEffect, net_effect
from vsd_analytics.stats.period_days import PeriodDays
from vsd_analytics.stats.running_verdict import RunningVerdict, no_verdict

Days = tuple[date, date]
Summed = Callable[[FloorHours, str | None], Place]


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


@dataclass(frozen=True, slots=True)
class Receiver:
    """An area that took people up since a change.

    Attributes:
        area_id, name: The area.
        more: Relative change of people there, beside the areas left alone: 0.3 = 30 % more.
        lo, hi: Its range; None where it has no end.
    """

    area_id: str
    name: str
    more: float
    lo: float | None
    hi: float | None


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

    Comparison areas that the log names later are left out. Each of the others is also left out in turn, as it may have
    taken up the people who left; of a single one, what then remains is the area by itself. Where a camera was
    recalibrated in these weeks there is no verdict: such weeks were not measured alike.
    """
    if not np.isfinite(data.violation_h).all():
        return None
    left = left_alone(data, others, windows)
    if not left:
        return no_verdict(Reason("logged_change.no_comparison"))
    if _is_recalibrated(data, (area, *left), windows.trend[0], windows.watched[1]):
        return no_verdict(Reason("logged_change.not_alike"))
    places = [a.area_id for a in (area, *left)]
    before, after = (area_weeks(data, places, span) for span in (windows.trend, windows.watched))
    return verdict_of_weeks(before, after, confidence=data.site.settings.confidence)


def moved(data: FloorHours, area: Area, others: Sequence[Area], windows: Windows) -> TakenUp | None:
    """Return what the places of the floor took up of an area's time too close, areas in the floor's order.

    None where violation time is unknown or no area is left to compare with.
    """
    left = left_alone(data, others, windows)
    if not left or not np.isfinite(data.violation_h).all():
        return None
    rest = [a for a in data.areas if a.area_id != area.area_id]
    places = [area.area_id, *(a.area_id for a in rest), None]
    before, after = (area_weeks(data, places, span) for span in (windows.trend, windows.watched))
    return taken_up(before, after, [1 + rest.index(a) for a in left])


def receivers(
    data: FloorHours, area: Area, others: Sequence[Area], windows: Windows, *, of: Summed
) -> tuple[Receiver, ...]:
    """Return the areas that clearly have more since a change, beside those left alone, most first.

    Their ranges hold together: the error is shared by all areas of the floor. An area with an entry of its own in these
    weeks is none: what it has more may be that entry's.

    Args:
        data: The floor.
        area: The changed area.
        others: The areas it is compared with.
        windows: The weeks.
        of: More of what: `peopled` or `timed`.
    """
    left = left_alone(data, others, windows)
    changed = changed_areas(data.site, windows.trend[0], windows.watched[1])
    rest = [a for a in data.areas if a.area_id != area.area_id]
    confidence = 1 - (1 - data.site.settings.confidence) / max(1, len(rest))
    risen_areas = []
    for place in rest:
        beside = [a for a in left if a is not place]
        if not beside or place.area_id in changed:
            continue
        ids = [a.area_id for a in (place, *beside)]
        before, after = (area_weeks(data, ids, span, of=of) for span in (windows.trend, windows.watched))
        more = verdict_of_weeks(before, after, confidence=confidence)
        if more.verdict == "clear_rise" and more.value is not None:
            risen_areas.append(
                Receiver(place.area_id, place.name, more.value - 1, _less_one(more.lo), _less_one(more.hi))
            )
    return tuple(sorted(risen_areas, key=lambda r: -r.more))


def _less_one(ratio: float | None) -> float | None:
    return None if ratio is None else ratio - 1


def left_alone(data: FloorHours, others: Sequence[Area], windows: Windows) -> list[Area]:
    """Return the comparison areas of a running verdict: those that the log does not name while it is watched."""
    changed = changed_areas(data.site, windows.trend[0], windows.watched[1])
    return [a for a in others if a.area_id not in changed]


def rests_on(so_far: RunningVerdict | None, left: Sequence[Area]) -> tuple[Reason | None, list[Reason]]:
    """Return how far a running verdict rests on a single comparison area: as a doubt, and as cautions.

    It is a doubt where the area would not have changed, or the other way, beside the others.
    """
    if len(left) == 1:
        return None, [Reason("logged_change.one_area", area=left[0].name)]
    if so_far is None or so_far.all_value is None:
        return None, []
    if (k := so_far.rests_on) is not None and (theta := so_far.without[k]) is not None:
        is_turned = so_far.unclear_without is not None and (theta < 1) != (so_far.all_value < 1)
        code = "logged_change.rests_wholly" if is_turned else "logged_change.rests_on"
        why = Reason(code, area=left[k].name, without=theta - 1, beside=so_far.all_value - 1)
        return (why, []) if is_turned else (None, [why])
    if so_far.unclear_without is not None:
        return None, [Reason("logged_change.unclear_without", area=left[so_far.unclear_without].name)]
    return None, []


def log_rates(data: FloorHours, areas: Sequence[Area], span: Days) -> Array:
    """Return by week the log of the violation time per open hour of some areas together.

    Returns:
        Shape (n_weeks,); NaN in a week that recorded too little of the open hours, or in which nothing was counted.
    """
    weeks = area_weeks(data, [a.area_id for a in areas], span)
    n, x_h = weeks.time_h.sum(axis=0), weeks.open_h.sum(axis=0)
    known = (n > 0) & (x_h > 0)
    return np.asarray(np.log(np.divide(n, x_h, out=np.full_like(n, np.nan), where=known)), dtype=np.float64)


def area_weeks(data: FloorHours, places: Sequence[str | None], span: Days, *, of: Summed | None = None) -> AreaWeeks:
    """Return violation time, recorded open hours and violations of places by week.

    A week in which a place was recorded in less than `min_coverage` of its fullest week has 0 hours: it says nothing.

    Args:
        data: The floor.
        places: Ids of areas; None = the rest of the floor.
        span: Whole weeks.
        of: What is summed: violation time, or people, whose minutes are then what is counted.
    """
    days, summed = days_of(span), of or timed
    place_sums = [summed(data, place) for place in places]
    panels = [data.panel(place, days) for place in place_sums]
    time_h, x_h = (by_week(np.array([getattr(p, name).sum(axis=0) for p in panels])) for name in ("n", "x_h"))
    n = 60 * time_h
    if summed is timed:
        counted = [replace(m, n=data.counted_in(place)[0]) for m, place in zip(place_sums, places, strict=True)]
        n = by_week(np.array([data.panel(place, days).n.sum(axis=0) for place in counted]))
    is_enough = (x_h > 0) & (x_h >= data.site.settings.min_coverage * x_h.max(axis=1, keepdims=True, initial=0.0))
    return AreaWeeks(*(np.where(is_enough, values, 0.0) for values in (time_h, x_h, n)))


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


def peopled(data: FloorHours, area_id: str | None) -> Place:
    """Return an area with person-hours in the place of violations; None is the rest of the floor."""
    n, exposure_h = data.counted_in(area_id)
    return Place(exposure_h, exposure_h, np.asarray((n + exposure_h).any(axis=1)), data.is_there(area_id))


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
