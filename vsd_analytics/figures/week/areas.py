"""The areas of a floor: how often, how risky, their share, and what of it may be printed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import shapely

from vsd_analytics.answer import Reason
from vsd_analytics.figures.area_verdicts import AreaChanges, area_changes
from vsd_analytics.figures.panels import MIN_CAMERA_SHARE, Place
from vsd_analytics.figures.share.counts import GIVES_AWAY, HeldBack, in_week_before
from vsd_analytics.figures.share.times import hidden_times
from vsd_analytics.figures.share.weeks import by_camera
from vsd_analytics.figures.week import estimates, recording
from vsd_analytics.figures.week.changes import difference
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.results import AreaRow, BusiestSpot
from vsd_analytics.site.model import Area

NEW: Final = Reason("area.new")


@dataclass(frozen=True, slots=True, kw_only=True)
class Areas:
    """The areas of a floor, ready to print.

    Attributes:
        rows: Busiest first by violations per open hour, the rest of the floor last.
        is_before_safe: False when the floor's own count of the week before would tell a small one.
    """

    rows: tuple[AreaRow, ...]
    is_before_safe: bool = True


def areas(data: WeekData, *, is_compared: bool, rest: str) -> Areas:
    """Return the areas of the floor; none where none is drawn or violations cannot be placed.

    Args:
        data: The week.
        is_compared: Compare with the week before.
        rest: Name of the rest of the floor.
    """
    if not data.areas or data.why_no_violations is not None or data.why_no_places is not None:
        return Areas(rows=())
    drawn: dict[str | None, Area] = {a.area_id: a for a in data.areas}
    keys = [*drawn, None]
    places = {key: data.area(key) for key in keys}
    measures = {key: estimates.measure(data, place, is_compared=is_compared) for key, place in places.items()}
    judged = area_changes(data.pair) if is_compared else {}
    measures = {key: _with_verdicts(m, judged[key]) if key in judged else m for key, m in measures.items()}
    now = data.hidden.places
    before = _before(data, places) if is_compared else HeldBack(frozenset(), frozenset(), is_total_safe=True)
    total = sum(m.violation_rate.value or 0.0 for m in measures.values())
    times = hidden_times(data.this)
    times_before = hidden_times(data.pair.before) if is_compared else {}
    rows = []
    for key in keys:
        measured, place = measures[key], places[key]
        violation_rate, encounter_rate = measured.violation_rate, measured.encounter_rate
        change = judged[key].close if key in judged else None
        is_new = False
        close = estimates.close_time_share(data, drawn.get(key), change)
        if (why := data.mask.why_held_back(now, key)) is not None:
            violation_rate, encounter_rate, close = (
                estimates.without_figures(e, why) for e in (violation_rate, encounter_rate, close)
            )
        elif is_new := is_compared and _is_new(data, place):
            violation_rate, encounter_rate, close = (
                estimates.without_change(e, NEW) for e in (violation_rate, encounter_rate, close)
            )
        elif (why := data.mask.why_held_back(before, key)) is not None:
            why = in_week_before(why) if key in before.small else why
            violation_rate, encounter_rate, close = (
                estimates.without_change(e, why) for e in (violation_rate, encounter_rate, close)
            )
        elif is_compared and data.is_revealed_by_comparing:
            violation_rate, encounter_rate, close = (
                estimates.without_change(e, GIVES_AWAY) for e in (violation_rate, encounter_rate, close)
            )
        if (why := times.get(key)) is not None:
            encounter_rate, close = (estimates.without_figures(e, why) for e in (encounter_rate, close))
        elif (why := times_before.get(key)) is not None:
            encounter_rate, close = (estimates.without_change(e, why) for e in (encounter_rate, close))
        weights = camera_weights(data, place)
        is_known = bool(data.panel(place, data.week_days).x_h.any()) and data.this.knows(place)
        has_time = is_known and not data.why_no_exposure
        rows.append(
            AreaRow(
                area_id=key,
                name=drawn[key].name if key in drawn else rest,
                counted=measured.n if is_known and key not in now else None,
                is_masked=key in now.small,
                is_held_back=key in now.others,
                violation_rate=violation_rate,
                encounter_rate=encounter_rate,
                close_time_share=close,
                exposure_h=_exposure_h(data, place) if has_time and key not in times else None,
                share=violation_rate.value / total if violation_rate.value is not None and total else None,
                difference=difference(data, place) if is_new or violation_rate.change is not None else None,
                recorded_share=_recorded_share(data, weights),
                cameras=tuple(c for c, w in weights.items() if w >= MIN_CAMERA_SHARE),
                is_material=is_material(data, key) and key not in now,
            )
        )
    rows[:-1] = sorted(rows[:-1], key=lambda r: -(r.violation_rate.value or 0.0))
    return Areas(rows=tuple(rows), is_before_safe=before.is_total_safe)


def _is_new(data: WeekData, place: Place) -> bool:
    """Tell whether an area began to count after the week before."""
    return place.is_there is not None and not (place.is_there & data.pair.before.is_inside).any()


def is_material(data: WeekData, area_id: str | None) -> bool:
    """Tell whether an area held a material share of the floor's time too close, this week or the week before.

    Where that time is unknown, its share of violations decides.
    """
    own, whole = data.violation_in(area_id), data.violation_h
    if not np.isfinite(whole).all():
        own, whole = data.counted_in(area_id)[0], data.whole.n
    weeks = (data.week(), data.week(data.monday - data.span))
    sums = [(float(own[:, w].sum()), float(whole[:, w].sum())) for w in weeks]
    return any(n > 0 and n >= data.site.settings.material_share * total for n, total in sums)


def _with_verdicts(measured: estimates.Measured, judged: AreaChanges) -> estimates.Measured:
    """Return both numbers of an area with the verdicts of its family, where they have one at all."""
    violation_rate, encounter_rate = (
        estimate if estimate.verdict in (None, "too_little_data") else replace(estimate, verdict=change.verdict)
        for estimate, change in (
            (measured.violation_rate, judged.violation_rate),
            (measured.encounter_rate, judged.encounter_rate),
        )
    )
    return replace(measured, violation_rate=violation_rate, encounter_rate=encounter_rate)


def _before(data: WeekData, places: Mapping[str | None, Place]) -> HeldBack[str | None]:
    """Return what is held back of the week before: in the hours compared, and what its own report holds back."""
    keys = list(places)
    counts = {key: by_camera(data, place, data.compared(place)[0].n) for key, place in places.items()}
    held = data.mask.held_back(counts, give=[None, *reversed(keys[:-1])])
    own = data.hidden_before.places
    small = held.small | own.small
    return HeldBack(small, (held.others | own.others) - small, is_total_safe=held.is_total_safe)


def busiest_spot(data: WeekData, rows: Sequence[AreaRow]) -> BusiestSpot | None:
    """Return the busiest of the drawn areas (`busiest_area`), if any may be printed."""
    rates = {a.area_id: a.violation_rate.value for a in rows if a.area_id is not None and a.violation_rate.value}
    area_id = busiest_area(data, rates, total=sum(a.violation_rate.value or 0.0 for a in rows))
    best = next((a for a in rows if a.area_id == area_id is not None), None)
    if best is None:
        return None
    size_m2 = next(shapely.Polygon(a.polygon).area for a in data.areas if a.area_id == area_id)
    seen_m2 = recording.seen_area_m2(data)
    return BusiestSpot(
        area_id=best.area_id,
        name=best.name,
        share=best.share or 0.0,
        floor_share=min(1.0, size_m2 / seen_m2) if seen_m2 else None,
    )


def busiest_area(data: WeekData, violations: Mapping[str, float], *, total: float) -> str | None:
    """Return the area with most violations per square metre, of those with a material share of all.

    By their number alone it would be the largest polygon. Where no area holds such a share, it is the one with most.

    Args:
        data: The week, for the areas' polygons.
        violations: Violations, or their rates, by area; positive.
        total: Those of the whole floor.
    """
    material = {k: n for k, n in violations.items() if n >= data.site.settings.material_share * total}
    if not material:
        return max(violations, key=violations.__getitem__, default=None)
    sizes_m2 = {a.area_id: shapely.Polygon(a.polygon).area for a in data.areas}
    return max(material, key=lambda k: material[k] / sizes_m2[k])


def camera_weights(data: WeekData, place: Place) -> Mapping[str, float]:
    """Return how much of a place each camera counts, the largest part first; see `FloorHours.camera_weights`."""
    weights = data.camera_weights(place)
    order = sorted(range(len(data.ids)), key=lambda i: (-weights[i], i))
    return {data.ids[i]: float(weights[i]) for i in order if weights[i] > 0}


def _recorded_share(data: WeekData, weights: Mapping[str, float]) -> float | None:
    """Return the share of open hours recorded, each camera weighted by how much of the place it counts."""
    now = data.week()
    open_s = data.hours.scheduled_s[:, now].sum(axis=1)
    if not open_s.any() or not weights:
        return None
    shares = data.hours.recorded_s[:, now].sum(axis=1) / np.maximum(open_s, 1.0)
    return float(sum(w * min(1.0, shares[data.ids.index(c)]) for c, w in weights.items()))


def _exposure_h(data: WeekData, place: Place) -> float:
    return float(data.panel(place, data.week_days).exposure_h.sum())
