"""Company within the legal distance: others met (M31), three or more (M32), room (M33), 15 minutes with one (M34)."""

from __future__ import annotations

from vsd_analytics.answer import Reason, State
from vsd_analytics.figures.catalogue.form import FigureInputs, Row, figure, row
from vsd_analytics.figures.neighbours import room_around, three_or_more
from vsd_analytics.figures.others_met import OthersMet, others_met
from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.week.model_estimate import same_fields
from vsd_analytics.figures.week.results import Figure


@figure("M31")
def met(inputs: FigureInputs) -> Figure:
    """Return how many different others a person comes too close to in a day: median and 90 % quantile."""
    found = _met(inputs)
    if not isinstance(found, OthersMet):
        return inputs.missing(*found)
    quantiles = found.met
    if inputs.small(quantiles.n):
        return inputs.held_back()
    if quantiles.quantiles[0].value is None:
        return inputs.missing(quantiles.state, quantiles.reason)
    rows: list[Row] = [
        {"what": Reason(f"row.{what}"), **row(q, "value", "lo", "hi")}
        for what, q in zip(("median", "p90_met"), quantiles.quantiles, strict=True)
    ]
    note = Reason("note.met")
    return Figure(unit=inputs.unit, rows=tuple(rows), denominator=quantiles.n, reason=quantiles.reason, note=note)


@figure("M34")
def long_contacts(inputs: FigureInputs) -> Figure:
    """Return the share of people with 15 minutes or more too close to one other within a day."""
    contacts = inputs.found.episodes.contacts
    if contacts.n is None or contacts.state != "ok":
        return inputs.missing(contacts.state, contacts.reason)
    found = _met(inputs)
    if not isinstance(found, OthersMet):
        return inputs.missing(*found)
    share = found.long_share
    if inputs.small(share.n, share.of - share.n, contacts.n):
        return inputs.held_back()
    if share.value is None:
        return inputs.missing(share.state, share.reason)
    note = Reason("note.contacts")
    return same_fields(Figure, share, unit=inputs.unit, denominator=share.of, state="ok", note=note)


@figure("M32")
def crowded(inputs: FigureInputs) -> Figure:
    """Return the share of person-time with three or more others too close."""
    if (why := inputs.why_no_person_time) is not None:
        return inputs.missing(*why)
    found = three_or_more(inputs.data.this)
    return inputs.of_estimate(inputs.rate(found), found.exposure_h)


@figure("M33")
def room(inputs: FigureInputs) -> Figure:
    """Return the shares of person-time at each of Fruin's levels of service."""
    if (why := inputs.why_no_person_time) is not None:
        return inputs.missing(*why)
    found = room_around(inputs.data.this)
    first = inputs.rate(found[0].share)
    if first.value is None:
        return inputs.missing(first.state, first.reason or NOTHING_OPEN)
    rows: list[Row] = []
    for level in found:
        to = None if level.density_to is None else round(level.density_to, 2)
        edges = {"density_from": round(level.density_from, 2), "density_to": to}
        rows.append({"level": level.level, **edges, **row(inputs.rate(level.share), "value", "lo", "hi")})
    return Figure(unit=inputs.unit, rows=tuple(rows), denominator=found[0].share.exposure_h, note=Reason("note.room"))


def _met(inputs: FigureInputs) -> OthersMet | tuple[State, Reason | None]:
    """Return whom people met, of this floor's cameras whose track ids last; else why there are none."""
    if inputs.data.hidden.why_floor is not None:
        return "not_enough_data", GIVES_AWAY
    here = [c for c in inputs.found.groups.cameras if c.camera_id in inputs.data.ids]
    able = [c.camera_id for c in here if c.lives.state == "ok"]
    if not able:
        worst = max(here, key=lambda c: (c.lives.state == "not_measurable", c.exposure_h), default=None)
        return ("not_enough_data", None) if worst is None else (worst.lives.state, worst.lives.reason)
    return others_met(inputs.data.warehouse, able, first=inputs.data.monday, last=inputs.data.sunday)
