"""Who with whom and why: clusters (M21), gatherings (M22), crowding, layout and behaviour (M23), redesigns (M27)."""

from __future__ import annotations

from vsd_analytics.answer import Reason
from vsd_analytics.figures.before_after import BeforeAfterFigure
from vsd_analytics.figures.catalogue.form import FigureInputs, Row, figure, row
from vsd_analytics.figures.gatherings import FloorGatherings
from vsd_analytics.figures.share.counts import too_few
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.week.change_effects import is_held_back
from vsd_analytics.figures.week.results import Figure
from vsd_analytics.stats.decomposition import Mixing, MixingChange


def _own(inputs: FigureInputs) -> FloorGatherings | None:
    floor_id = inputs.data.floor.floor_id
    return next((f for f in inputs.found.gatherings.floors if f.floor_id == floor_id), None)


@figure("M21")
def sizes(inputs: FigureInputs) -> Figure:
    """Return how the time people spent in clusters is shared out by the size of the cluster."""
    found = _own(inputs)
    if found is None or found.sizes.state != "ok":
        state = "not_enough_data" if found is None else found.sizes.state
        return inputs.missing(state, NOTHING_OPEN if found is None else found.sizes.reason)
    rows = tuple(row(s, "least", "most", "share") for s in found.sizes.sizes)
    return Figure(unit=inputs.unit, rows=rows, denominator=found.sizes.person_s / 3600)


@figure("M22")
def gatherings(inputs: FigureInputs) -> Figure:
    """Return gatherings per 100 recorded open hours, the longest of them as rows."""
    found = _own(inputs)
    if found is None or found.n is None or found.per_100_h.value is None:
        state = "not_enough_data" if found is None else found.per_100_h.state
        return inputs.missing(state, NOTHING_OPEN if found is None else found.per_100_h.reason)
    if inputs.small(found.n):
        return inputs.missing("not_enough_data", Reason("hidden.gatherings", least=inputs.below))
    rate = found.per_100_h
    names = ("start", "end", "duration_s", "n_people", "person_s", "x_m", "y_m", "diameter_m")
    rows = tuple(row(g, *names) for g in found.top) if inputs.is_ranked else ()
    return Figure(
        unit=inputs.unit,
        value=rate.value,
        lo=rate.lo,
        hi=rate.hi,
        denominator=inputs.recorded_h,
        rows=rows,
        reason=rate.reason if rate.lo is None else None,
        note=Reason("note.gatherings", n=found.n) if rows else None,
    )


@figure("M23")
def causes(inputs: FigureInputs) -> Figure:
    """Return the three factors of the week, and how each moved since the week before."""
    found = inputs.found.mixing_now
    if found.layout is None or found.behaviour is None:
        return inputs.missing(found.state, found.reason)
    change = inputs.found.mixing if inputs.level.violation_rate.verdict is not None else None
    is_compared = change is not None and change.state == "ok"
    rows = _factors(found, change if is_compared else None)
    reason = found.reason if found.lo is None else None
    if change is not None and not is_compared:
        reason = change.reason
    return Figure(
        unit=inputs.unit, value=found.behaviour, lo=found.lo, hi=found.hi, rows=tuple(rows),
        denominator=found.copresent_h, reason=reason, note=Reason("note.behaviour"),
    )  # fmt: skip


def _factors(found: Mixing, change: MixingChange | None) -> list[Row]:
    uniform = found.layout_uniform
    behaviour = None if change is None else change.behaviour
    moved: tuple[tuple[float | None, float | None], ...] = ((None, None),) * 3
    if change is not None:
        moved = (
            (change.crowding, change.crowding_share),
            (change.layout, change.layout_share),
            (None if behaviour is None else behaviour.value, change.behaviour_share),
        )
    values = (
        ("crowding", found.copresent_h),
        ("layout", found.layout),
        ("behaviour", found.behaviour),
    )
    rows: list[Row] = []
    for (what, value), (ratio, share) in zip(values, moved, strict=True):
        is_behaviour = what == "behaviour"
        rows.append(
            {
                "what": what,
                "unit": Reason(f"unit.{what}"),
                "value": value,
                "over_uniform": found.layout / uniform if what == "layout" and found.layout and uniform else None,
                "change": None if ratio is None else ratio - 1,
                "change_lo": behaviour.change_lo if is_behaviour and behaviour is not None else None,
                "change_hi": behaviour.change_hi if is_behaviour and behaviour is not None else None,
                "share_of_change": share,
            }
        )
    return rows


@figure("M27")
def change_effects(inputs: FigureInputs) -> Figure:
    """Return what each logged change of the floor did to its area."""
    found = inputs.found.change_effects
    if not found:
        return inputs.missing("not_enough_data", Reason("redesign.none"))
    rows = [_redesign(inputs, one) for one in found]
    computed = [r for r in rows if r["state"] == "ok"]
    if computed:
        return Figure(unit=inputs.unit, rows=tuple(rows), denominator=len(computed))
    state = found[-1].state if found[-1].state != "ok" else "not_enough_data"
    return Figure(unit=inputs.unit, rows=tuple(rows), state=state, reason=found[-1].reason)


def _redesign(inputs: FigureInputs, found: BeforeAfterFigure) -> Row:
    ratio = found.effect or found.alone
    state, reason = found.state, found.reason
    if state == "ok" and is_held_back(inputs.data, found):
        state, reason = "not_enough_data", too_few(inputs.below)
    elif state == "ok" and (ratio is None or ratio.value is None):
        state, reason = "not_enough_data", None if ratio is None else ratio.reason
    is_printed = state == "ok"
    ratio = ratio if is_printed else None
    effect, violation_rate = (e if is_printed else None for e in (found.effect, found.violation_rate))
    shrunken = None if effect is None else effect.shrunken
    return {
        "entry": found.number,
        "at": found.at.isoformat(),
        "area": found.area_id,
        "name": found.area_name,
        "design": Reason(f"design.{found.design}"),
        "ratio": None if ratio is None else ratio.value,
        "lo": None if ratio is None else ratio.lo,
        "hi": None if ratio is None else ratio.hi,
        "verdict": None if ratio is None else ratio.verdict,
        "violation_rate_ratio": None if violation_rate is None else violation_rate.value,
        "violation_rate_lo": None if violation_rate is None else violation_rate.lo,
        "violation_rate_hi": None if violation_rate is None else violation_rate.hi,
        "placebo_lo": None if effect is None else effect.placebo_lo,
        "placebo_hi": None if effect is None else effect.placebo_hi,
        "shrunken": None if shrunken is None else shrunken.value,
        "comparison_areas": len(found.comparison_areas),
        "is_credible": found.is_credible if is_printed else None,
        "doubts": Reason("joined", reasons=found.doubts) if found.doubts else None,
        "assumes": Reason("joined", reasons=found.assumptions) if found.assumptions else None,
        "state": state,
        "reason": reason,
    }
