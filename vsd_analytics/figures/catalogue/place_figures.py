"""Where: areas (M15), the four maps (M16 to M19), hotspots (M20)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.catalogue.form import FigureInputs, Plain, Row, figure, limits, row
from vsd_analytics.figures.hotspots import FloorSpot, ResolvedSpot
from vsd_analytics.figures.maps import MIN_EXPECTED_S, MIN_EXPOSURE_H, CellMap, ExcessMap
from vsd_analytics.figures.week.results import AreaRow, Figure
from vsd_analytics.stats.shrinkage import MIN_PLACES, pull

NOT_PULLED: Final = Reason("note.not_pulled", least=MIN_PLACES)
MIN_CELL_S: Final = 60.0
"""Person-seconds a square metre needs to be printed: with less, it could show the way of a few people."""

_EXCESS: Final = ("violation_h", "expected_h", "excess_min_per_week", "excess_min_lo", "excess_min_hi")
_OF_SPOT: Final = ("ratio", "lo", "hi", "n", *_EXCESS, "q")
_NO_CELL: Final = {
    "M16": Reason("map.no_cell_seconds", least=MIN_CELL_S),
    "M17": Reason("map.no_cell_seconds", least=MIN_CELL_S),
    "M18": Reason("map.no_cell_hours", least=MIN_EXPOSURE_H),
    "M19": Reason("map.no_cell_expected", least=MIN_EXPECTED_S),
}


@figure("M15")
def area_rates(inputs: FigureInputs) -> Figure:
    """Return both rates of each area, most violations first."""
    data = inputs.data
    if not inputs.areas:
        if (reason := data.why_no_violations or data.why_no_places) is not None:
            return inputs.missing("not_measurable", reason)
        return inputs.missing("not_enough_data", Reason("areas.none"))
    borders = {b.area_id: b for b in inputs.found.borders}
    order = [a.area_id for a in data.areas]
    areas = list(inputs.areas)
    if not inputs.is_ranked:
        areas.sort(key=lambda a: len(order) if a.area_id is None else order.index(a.area_id))
    rows = [_area(a, borders[a.area_id].note if a.area_id in borders else None) for a in areas]
    _pull(inputs, rows, areas)
    ranks = iter(range(1, len(rows) + 1))
    for one, area in zip(rows, areas, strict=True):
        can = inputs.is_ranked and area.area_id is not None and area.violation_rate.value is not None
        one["rank"] = next(ranks) if can else None
    reason = None if inputs.is_ranked else inputs.not_ranked().reason
    note = None if any(r["pulled"] is not None for r in rows) else NOT_PULLED
    return Figure(unit=inputs.unit, rows=tuple(rows), denominator=inputs.recorded_h, reason=reason, note=note)


def _pull(inputs: FigureInputs, rows: list[dict[str, Plain]], areas: Sequence[AreaRow]) -> None:
    """Add each area's rate per person-hour pulled towards the mean of all, and what it has above the floor's rate."""
    known = [
        (one, area.encounter_rate, area.exposure_h)
        for one, area in zip(rows, areas, strict=True)
        if area.area_id is not None
        and area.encounter_rate is not None
        and area.encounter_rate.value
        and area.encounter_rate.lo
        and area.encounter_rate.hi
    ]
    ends = ([getattr(encounter_rate, name) for _, encounter_rate, _ in known] for name in ("value", "lo", "hi"))
    pulled = pull(*ends, confidence=inputs.data.site.settings.confidence) if inputs.is_ranked else None
    floor = inputs.level.encounter_rate.value
    for one in rows:
        one |= {"pulled": None, "pulled_lo": None, "pulled_hi": None, "excess_per_week": None}
    for (one, _, exposure_h), found in zip(known, pulled or (), strict=pulled is not None):
        one |= {"pulled": found.value, "pulled_lo": found.lo, "pulled_hi": found.hi}
        if floor is not None and exposure_h is not None:
            one["excess_per_week"] = (found.value - floor) * exposure_h


def _area(area: AreaRow, border_note: Reason | None) -> dict[str, Plain]:
    violation_rate = area.violation_rate
    return {
        "area": area.area_id,
        "name": area.name,
        **limits("violation_rate", violation_rate),
        **limits("encounter_rate", area.encounter_rate),
        **limits("close_time_share", area.close_time_share),
        "verdict": violation_rate.verdict,
        "share": area.share if violation_rate.value is not None else None,
        "exposure_h": area.exposure_h,
        "state": violation_rate.state,
        "reason": violation_rate.reason,
        "border_note": border_note,
    }


@figure("M16")
def exposure(inputs: FigureInputs) -> Figure:
    """Return where people are."""
    return _map(inputs, inputs.found.maps.exposure)


@figure("M17")
def burden(inputs: FigureInputs) -> Figure:
    """Return where people are too close."""
    return _map(inputs, inputs.found.maps.burden)


@figure("M18")
def risk(inputs: FigureInputs) -> Figure:
    """Return the share of person-time in violation, place by place."""
    return _map(inputs, inputs.found.maps.risk)


@figure("M19")
def excess(inputs: FigureInputs) -> Figure:
    """Return where people are closer than chance makes them."""
    return _map(inputs, inputs.found.maps.excess)


def _map(inputs: FigureInputs, found: CellMap) -> Figure:
    """Return a map as a row for each square metre on which people spent a minute or more."""
    if found.grid is None or found.values is None or found.exposure_h is None:
        return inputs.missing(found.state, found.reason)
    is_printed = np.isfinite(found.values) & (found.exposure_h * 3600 >= MIN_CELL_S)
    if not is_printed.any():
        return inputs.missing("not_enough_data", _NO_CELL[found.metric])
    at = list(zip(*np.nonzero(is_printed), strict=True))
    clear = found.is_clear if isinstance(found, ExcessMap) else None
    rows: list[Row] = []
    for r, c in at:
        one: dict[str, float | bool | None] = {
            "x_m": float(found.grid.x_m(c)),
            "y_m": float(found.grid.y_m(r)),
            "value": float(found.values[r, c]),
        }
        if isinstance(found, ExcessMap):
            one["is_clear"] = None if clear is None else bool(clear[r, c])
        rows.append(one)
    note = Reason("note.cells", side_m=found.grid.cell_m)
    return Figure(unit=inputs.unit, rows=tuple(rows), denominator=found.denominator, note=note)


@figure("M20")
def spots(inputs: FigureInputs) -> Figure:
    """Return the hotspots of the floor, and those that are gone."""
    if not inputs.is_ranked:
        return inputs.not_ranked()
    found = inputs.found.hotspots
    if found.state != "ok":
        return inputs.missing(found.state, found.reason)
    rows = [_spot(inputs, s) for s in found.spots] + [
        _past(inputs, s, state)
        for state, of in (("resolved", found.resolved), ("watching", found.watching))
        for s in of
    ]
    note = Reason("joined", reasons=found.notes) if found.notes else None
    return Figure(unit=inputs.unit, rows=tuple(rows), denominator=found.n_days, note=note)


def _spot(inputs: FigureInputs, spot: FloorSpot) -> Row:
    return {**row(spot, "number", "state", "since"), **_figures_of(inputs, spot, _OF_SPOT)}


def _past(inputs: FigureInputs, spot: ResolvedSpot, state: str) -> Row:
    unknown = dict.fromkeys(("number", "since", *_OF_SPOT))
    past = {"state": state, **row(spot, "changed_on")}
    return {**unknown, **past, **_figures_of(inputs, spot, ("ratio", "lo", "hi", "n"))}


def _figures_of(inputs: FigureInputs, spot: FloorSpot | ResolvedSpot, names: Sequence[str]) -> Row:
    """Return where a spot is, and its figures unless they would tell a small count."""
    is_printed = not inputs.small(spot.n) and spot.spot_id not in inputs.found.revealing_spots
    at = {"spot_id": spot.spot_id, "place": spot.place.name, "area": spot.place.area_id}
    return {
        **at,
        **row(spot.place, "x_m", "y_m", "area_m2"),
        **(row(spot, *names) if is_printed else dict.fromkeys(names)),
    }
