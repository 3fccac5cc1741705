"""Violations in two readings, all of them and those between groups of people who walk or stand together (M9)."""

from __future__ import annotations

from vsd_analytics.figures.groups import GroupReadings as Found
from vsd_analytics.figures.groups import Groups, between_groups_by_area
from vsd_analytics.figures.rates import violation_rate_level
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_estimate import Estimate, level_estimate
from vsd_analytics.figures.week.model_sections import AreaReading, Reading, Readings
from vsd_analytics.figures.week.results import AreaRow, Level
from vsd_analytics.stats.estimates import RateEstimate


def readings(data: WeekData, groups: Groups, *, level: Level, areas: tuple[AreaRow, ...]) -> Readings:
    """Return both readings of the floor and its areas, or why there is no second one.

    A count within groups can be worked out from the two readings, so it is held back like any other small count.

    Args:
        data: The week.
        groups: Who was together.
        level: The headline numbers, without what must be held back.
        areas: The areas, likewise.
    """
    mask = data.mask
    own = next((r for r in groups.readings if r.floor_id == data.floor.floor_id), None)
    names = {c.camera_id: c.name for c in data.cameras}
    left_out = tuple(names[c] for c in groups.left_out if c in names)
    if own is None or groups.state != "ok":
        here = [c.lives for c in groups.cameras if c.camera_id in names and c.lives.state != "ok"]
        why = here[0].reason if here and groups.state == "ok" else groups.reason
        is_unknown = any(lives.state == "not_measurable" for lives in here[:1])
        return Readings(state="not_measurable" if is_unknown else "not_enough_data", reason=why, left_out=left_out)
    if level.violation_rate.value is None or _would_reveal(own, mask=mask):
        return Readings(state="not_enough_data", reason=mask.why, left_out=left_out)
    share, whole = groups.between, Reading(violation_rate=level.violation_rate, encounter_rate=level.encounter_rate)
    is_floor = len(data.site.floors) == 1
    return Readings(
        # the first reading is the headline itself where all cameras take part
        all=whole if not left_out else _reading(own.violation_rate, own.encounter_rate, mask=mask),
        between=_reading(own.violation_rate_between, own.encounter_rate_between, mask=mask),
        between_share=share.value if is_floor else None,
        between_lo=share.lo if is_floor else None,
        between_hi=share.hi if is_floor else None,
        areas=_areas(data, groups, areas, mask=mask),
        left_out=left_out,
        precision_lo=groups.accuracy.time_precision[0],
        recall_lo=groups.accuracy.time_recall[0],
    )


def _would_reveal(own: Found, *, mask: Mask) -> bool:
    """Tell whether the count between or within groups is too small to print."""
    n, n_between = own.violation_rate.n_events or 0, own.violation_rate_between.n_events or 0
    return mask.hides(n, n_between, n - n_between)


def _reading(violation_rate: RateEstimate, encounter_rate: RateEstimate, *, mask: Mask) -> Reading:
    """Return both headline numbers, without what is too small to print."""
    none = Estimate(value=None, state="not_enough_data")
    printed = [level_estimate(rate, mask=mask) or none for rate in (violation_rate, encounter_rate)]
    return Reading(violation_rate=printed[0], encounter_rate=printed[1])


def _areas(data: WeekData, groups: Groups, areas: tuple[AreaRow, ...], *, mask: Mask) -> tuple[AreaReading, ...]:
    able = {c.camera_id for c in groups.cameras if c.lives.state == "ok"}
    places = between_groups_by_area(data.this, able)
    rates = {key: violation_rate_level(data.this, place) for key, place in places.items()}
    between = {key: int(rate.n_events or 0) for key, rate in rates.items()}
    within = {a.area_id: (a.counted or 0) - between[a.area_id] for a in areas if a.area_id in between}
    give = sorted(within, key=lambda key: between[key])
    held = [mask.held_back({k: n[k] for k in within}, give=give) for n in (between, within)]
    rows = []
    if not all(h.is_total_safe for h in held):
        return ()
    for area in areas:
        rate = rates.get(area.area_id)
        if rate is None or area.is_masked or area.is_held_back or area.counted is None:
            continue
        if rate.n_events is None or any(area.area_id in h for h in held):
            continue
        violation_rate = level_estimate(rate, mask=mask)
        if violation_rate is not None and violation_rate.value is not None:
            rows.append(AreaReading(area_id=area.area_id, violation_rate=violation_rate))
    return tuple(rows)
