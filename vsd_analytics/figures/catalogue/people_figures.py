"""People in view: how much (M3), how many at once (M5), and how much of their time too close (M6)."""

from __future__ import annotations

from vsd_analytics.answer import Reason
from vsd_analytics.figures.catalogue.form import FigureInputs, Row, figure, row
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.week.results import Figure


@figure("M3")
def exposure(inputs: FigureInputs) -> Figure:
    """Return person-hours; the interval is that of the mean number of people, over the same hours."""
    people, found = inputs.level.people, inputs.found.person_time
    exposure_h = found.exposure_h
    if exposure_h is None:
        return inputs.missing(people.state, people.reason)
    level = inputs.rate(found.people)
    scale = exposure_h / level.value if level.value else None
    lo, hi = (None if v is None or scale is None else v * scale for v in (level.lo, level.hi))
    return Figure(
        unit=inputs.unit,
        value=exposure_h,
        lo=lo,
        hi=hi,
        verdict=people.verdict,
        denominator=inputs.recorded_h,
        reason=level.reason if lo is None else None,
    )


@figure("M5")
def people_in_view(inputs: FigureInputs) -> Figure:
    """Return the mean number of people in view, and the fullest quarter-hour."""
    people = inputs.level.people
    if people.value is None:
        return inputs.missing(people.state, people.reason)
    found = inputs.found.person_time
    rows: list[Row] = [
        {"what": Reason("row.mean"), "people": people.value, "start": None, "recorded_share": None},
    ]
    if found.peak is not None:
        rows.append({"what": Reason("row.fullest"), **row(found.peak, "people", "start", "recorded_share")})
    return Figure(
        unit=inputs.unit,
        value=people.value,
        lo=found.people.lo,
        hi=found.people.hi,
        verdict=people.verdict,
        denominator=inputs.recorded_h,
        rows=tuple(rows),
        reason=found.people.reason if found.people.lo is None else None,
    )


@figure("M6")
def close(inputs: FigureInputs) -> Figure:
    """Return the share of person-time too close, of all people and between groups."""
    if (why := inputs.why_no_person_time) is not None:
        return inputs.missing(*why)
    found = inputs.found.person_time
    level = inputs.rate(found.close)
    if level.value is None:
        return inputs.missing(level.state, level.reason or NOTHING_OPEN)
    rows: list[Row] = []
    for name, reading in (("all", found.close), ("between_groups", found.close_between)):
        values = inputs.rate(reading)
        state = "ok" if values.value is not None else values.state
        rows.append({"reading": Reason(f"row.{name}"), **row(values, "value", "lo", "hi", "reason", state=state)})
    return inputs.of_estimate(level, found.close.exposure_h, rows=rows)
