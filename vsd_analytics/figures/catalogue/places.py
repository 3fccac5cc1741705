"""Where: areas (M15) and hotspots (M20). Maps (M16 to M19) are no tables: `catalogue.view` takes them as they are."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Final

from vsd_analytics.answer import Answer, Cell, Column, Reason, Row, Value
from vsd_analytics.figures.catalogue.form import FigureInputs, answers
from vsd_analytics.figures.floor_space import OF_M2, per_floor, walkable_m2
from vsd_analytics.figures.hotspot_answers import hotspot_answers
from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.values import known, measured
from vsd_analytics.figures.week.results import AreaRow
from vsd_analytics.stats.shrinkage import MIN_PLACES, Pulled, pull

AREAS: Final = (
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("rank", "fact"),
    Column("violation_rate", "rate", "per_open_hour", "M15", per="recorded_h"),
    Column("violation_rate_verdict", "fact"),
    Column("encounter_rate", "rate", "per_person_hour", "M15", per="exposure_h"),
    Column("close_time_share", "share", "share", "M15", per="exposure_h"),
    Column("floor_m2", "fact", "m2"),
    Column("violation_rate_100_m2", "rate", "per_open_hour_100_m2", "M54", per="recorded_h"),
    Column("rates_share", "share", "share", "M15"),
    Column("shrunken_encounter_rate", "rate", "per_person_hour", "M15", per="exposure_h"),
    Column("excess_per_week", "rate", "violations", "M15"),
    Column("exposure_h", "fact", "h"),
    Column("recorded_h", "fact", "h"),
)
"""Columns of `areas`."""


@answers("M15", "M54")
def areas(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return the rates of each area (M15), most violations first; the rest of the floor has no `area_id`.

    Beside the rates: violations on 100 m² of its walkable floor (M54); the area's share of the sum of all areas' rates;
    its rate per person-hour shrunken towards the mean of all, and what that makes above the floor's rate in the week.
    """
    data = inputs.data
    if not inputs.areas:
        none = Value.missing(Reason("areas.none"))
        if (reason := data.why_no_violations or data.why_no_places) is not None:
            none = Value.missing(reason, "not_measurable")
        return (inputs.list_answer("areas", AREAS, (), nothing=none),)
    order = [a.area_id for a in data.areas]
    shown = list(inputs.areas)
    if not inputs.is_ranked:
        shown.sort(key=lambda a: len(order) if a.area_id is None else order.index(a.area_id))
    shrunken = _shrunken(inputs, shown)
    ranks = iter(range(1, len(shown) + 1))
    sizes_m2 = walkable_m2(data.this)
    rows = [
        {
            **_area(inputs, a, shrunken.get(a.area_id), sizes_m2.get(a.area_id)),
            "rank": next(ranks) if _can_rank(inputs, a) else None,
        }
        for a in shown
    ]
    notes: list[tuple[int | None, Reason]] = []
    if not inputs.is_ranked:
        notes.append((None, inputs.why_not_ranked))
    if not shrunken:
        notes.append((None, _not_shrunken()))
    borders = {b.area_id: b.note for b in inputs.results.borders if b.note is not None}
    notes += [(k, borders[a.area_id]) for k, a in enumerate(shown) if a.area_id in borders]
    return (inputs.list_answer("areas", AREAS, rows, *notes),)


def _can_rank(inputs: FigureInputs, area: AreaRow) -> bool:
    return inputs.is_ranked and area.area_id is not None and area.violation_rate.value is not None


def _not_shrunken() -> Reason:
    return Reason("note.not_pulled", least=MIN_PLACES)


def _shrunken(inputs: FigureInputs, areas: Sequence[AreaRow]) -> dict[str | None, Pulled]:
    """Return each area's rate per person-hour shrunken towards the mean of all; empty where they are too few."""
    if not inputs.is_ranked:
        return {}
    rates = {a.area_id: a.encounter_rate for a in areas if a.area_id is not None}
    full = {k: r for k, r in rates.items() if r is not None and r.value and r.lo and r.hi}
    ends = ([getattr(rate, name) for rate in full.values()] for name in ("value", "lo", "hi"))
    shrunken = pull(*ends, confidence=inputs.data.site.settings.confidence)
    return {} if shrunken is None else dict(zip(full, shrunken, strict=True))


def _area(inputs: FigureInputs, area: AreaRow, shrunken: Pulled | None, floor_m2: float | None) -> Row:
    rate, floor = area.violation_rate, inputs.level.encounter_rate.value
    excess = None
    if shrunken is not None and floor is not None and area.exposure_h is not None:
        excess = (shrunken.value - floor) * area.exposure_h
    return {
        "area_id": area.area_id,
        "name": area.name,
        "violation_rate": Value.of(rate),
        "violation_rate_verdict": rate.verdict,
        "encounter_rate": measured(area.encounter_rate),
        "close_time_share": measured(area.close_time_share),
        "floor_m2": floor_m2,
        "violation_rate_100_m2": per_floor(rate, floor_m2, of_m2=OF_M2),
        "rates_share": known(area.share if rate.value is not None else None, rate.reason or NOTHING_OPEN, rate.state),
        "shrunken_encounter_rate": Value.missing(_not_shrunken()) if shrunken is None else measured(shrunken),
        "excess_per_week": known(excess, _not_shrunken()),
        "exposure_h": area.exposure_h,
        "recorded_h": inputs.recorded_h,
    }


@answers("M20")
def hotspots(inputs: FigureInputs) -> tuple[Answer, ...]:
    """Return the places with more time too close than their crowd explains, and those that are none any more (M20)."""
    floor_hotspots = inputs.results.hotspots
    if not inputs.is_ranked:
        floor_hotspots = replace(
            floor_hotspots, state="not_enough_data", reason=inputs.why_not_ranked, spots=(), resolved=(), watching=()
        )
    now, past, _ = hotspot_answers(floor_hotspots, inputs.holds_for)
    return tuple(_without_revealing(answer, inputs.results.revealing_spots) for answer in (now, past))


def _without_revealing(answer: Answer, revealing: Collection[str]) -> Answer:
    """Return hotspots without the figures of those that would tell a small count of another output."""

    def cell(row: Row, name: str) -> Cell:
        is_hidden = row["spot_id"] in revealing and isinstance(row[name], Value)
        return Value.missing(GIVES_AWAY) if is_hidden else row[name]

    return replace(answer, rows=tuple({name: cell(row, name) for name in row} for row in answer.rows))
