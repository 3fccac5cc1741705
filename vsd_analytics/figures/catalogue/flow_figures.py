"""Flow between areas that ask for visits (M37), and routes from door to door (M38)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from vsd_analytics.answer import Reason
from vsd_analytics.figures.catalogue.form import FigureInputs, Row, figure, row
from vsd_analytics.figures.flow import LEFT_VIEW, AreaFlow, Destination, flow
from vsd_analytics.figures.walks import walking_directions
from vsd_analytics.figures.week.results import Figure
from vsd_analytics.stats.groups import ShareEstimate

OTHER: Final = Reason("row.other")


@figure("M37")
def flow_between_areas(inputs: FigureInputs) -> Figure:
    """Return the share of those who leave an area whose next area is each one; small counts are one sum, "other"."""
    found = flow(inputs.data.this)
    if found is None:
        return inputs.missing("not_enough_data", None)
    rows = [one for of in found.areas for one in _of_area(inputs, of)]
    n_left = sum(of.following.n for of in found.areas if not inputs.small(of.following.n))
    return inputs.of_rows(rows, n_left, _note(found.areas))


@figure("M38")
def routes(inputs: FigureInputs) -> Figure:
    """Return the share of each route of those who come in by a door; rare ones are one sum, "other"."""
    found = flow(inputs.data.this)
    if found is None or not found.routes.has_doors:
        return inputs.missing("not_enough_data", Reason("flow.no_doors"))
    of = found.routes
    why = _hidden(inputs, of.following.n) or of.following.reason
    if inputs.small(of.following.n) or all(r.share.value is None for r in of.routes):
        return inputs.missing("not_enough_data", why)
    rows: list[Row] = [
        {
            "route": " > ".join(a.name for a in route.areas) or OTHER,
            "areas": " ".join(a.area_id for a in route.areas),
            **_limits(route.share),
        }
        for route in of.routes
    ]
    return Figure(unit=inputs.unit, rows=tuple(rows), denominator=of.following.n, note=Reason("note.flow"))


@figure("M42")
def directions(inputs: FigureInputs) -> Figure:
    """Return which way people walk through each cell of the floor that five or more walk through."""
    field = walking_directions(inputs.data.this)
    if not field.cells:
        return inputs.missing("not_enough_data", Reason("flow.no_walkers"))
    rows = tuple(
        row(c, "x_m", "y_m", "ways", "agreement", "n_people", cell_m=field.cell_m, value=c.direction_deg)
        for c in field.cells
    )
    return Figure(unit=inputs.unit, rows=rows, denominator=sum(c.n_people for c in field.cells))


def _of_area(inputs: FigureInputs, of: AreaFlow) -> list[Row]:
    place: Row = {"area": of.area.area_id, "place": of.area.name}
    why = _hidden(inputs, of.following.n) or (of.often.reason if of.often.value is None else of.following.reason)
    lost = of.following.not_followed
    is_in_view_only = of.following.reason is not None and of.following.reason.code == LEFT_VIEW
    is_printed = not inputs.small(of.following.n, lost.n, lost.of - lost.n)
    more: Row = {
        "not_followed_share": lost.value if is_printed else None,
        "fits_arrivals": of.inflow.agrees,
        "in_view_only": is_in_view_only,
    }
    if inputs.small(of.following.n) or of.often.value is None or all(to.share.value is None for to in of.to):
        return [{**place, "to": None, "to_areas": None, "value": None, **more, "reason": why}]
    return [
        {
            **place,
            "to": to.areas[0].name if len(to.areas) == 1 else OTHER,
            "to_areas": " ".join(a.area_id for a in to.areas),
            **_limits(to.share),
            "per_open_h": _per_open_h(inputs, of, to, is_in_view_only=is_in_view_only),
            "followed_per_open_h": None if inputs.small(to.share.n) else to.often.value,
            **more,
        }
        for to in of.to
    ]


def _per_open_h(inputs: FigureInputs, of: AreaFlow, to: Destination, *, is_in_view_only: bool) -> float | None:
    """Return how many go there in an open hour; only those followed, where others are known to go on unseen."""
    if is_in_view_only:
        return None if inputs.small(to.share.n) else to.often.value
    return None if of.often.value is None or to.share.value is None else of.often.value * to.share.value


def _limits(share: ShareEstimate) -> Row:
    return row(share, "value", "lo", "hi", "reason")


def _hidden(inputs: FigureInputs, n: int) -> Reason | None:
    return Reason("hidden.flow", least=inputs.below) if inputs.small(n) else None


def _note(areas: Sequence[AreaFlow]) -> Reason:
    off = ", ".join(of.area.name for of in areas if of.inflow.agrees is False)
    note = Reason("note.flow")
    return Reason("note.flow_disagrees", note=note, places=off) if off else note
