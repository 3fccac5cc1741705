"""Flow as answers: where people go next (M37), routes between doors (M38), links unseen, walking directions (M42)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from vsd_analytics.answer import Answer, Column, Reason, Row, Sum, Value
from vsd_analytics.figures.flow import LEFT_VIEW, AreaFlow, Destination, Flow, flow
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.figures.values import unknown_count
from vsd_analytics.figures.walks import walking_directions

NO_WAY: Final = Reason("flow.any_way")
NOT_ASKED: Final = Reason("visits.not_asked")
FLOW_COLUMNS: Final = (
    Column("floor_id", "key"),
    Column("area_id", "key"),
    Column("to_area_ids", "key"),
    Column("name", "fact"),
    Column("to_name", "fact"),
    Column("next_area_share", "share", "share", "M37", tells=("n_followed",), per="n_left"),
    Column("per_open_h", "rate", "per_open_h", tells=("n_followed",)),
    Column("followed_per_open_h", "rate", "per_open_h", tells=("n_followed",)),
    Column("n_followed", "count", "people", audience="operator"),
    Column("n_left", "count", "people", audience="operator"),
    Column("in_view_only", "fact"),
    Column("fits_arrivals", "fact"),
)
"""Columns of `flow`."""
AREA_COLUMNS: Final = (
    Column("floor_id", "key"),
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("leave_per_open_h", "rate", "per_open_h", tells=("n_left",), per="recorded_open_h"),
    Column("not_followed_share", "share", "share", tells=("n_left", "n_lost", "n_not_lost"), per="n_left"),
    Column("unseen_share", "share", "share", tells=("n_left",)),
    Column("inflow_ratio", "rate", "ratio", tells=("n_arrived",)),
    Column("fits_arrivals", "fact"),
    Column("n_left", "count", "people"),
    Column("n_lost", "count", "people", audience="operator"),
    Column("n_not_lost", "count", "people", audience="operator"),
    Column("n_arrived", "count", "people", audience="operator"),
    Column("n_days", "fact", "days"),
    Column("recorded_open_h", "fact", "h"),
    Column("recorded_share", "share", "share"),
)
"""Columns of `flow_areas`; the recorded share is that of all cameras of the floor."""
ROUTE_COLUMNS: Final = (
    Column("floor_id", "key"),
    Column("route_area_ids", "key"),
    Column("route", "fact"),
    Column("route_share", "share", "share", "M38", tells=("n_people", "n_began"), per="n_began"),
    Column("n_people", "count", "people", audience="operator"),
    Column("n_began", "count", "people", audience="operator"),
)
"""Columns of `flow_routes`."""
LINK_COLUMNS: Final = (
    Column("floor_id", "key"),
    Column("area_id", "key"),
    Column("to_area_ids", "key"),
    Column("name", "fact"),
    Column("to_name", "fact"),
    Column("linked_share", "share", "share"),
)
"""Columns of `flow_links`: estimates, whose counts are counts of pairs and not of people."""
DIRECTION_COLUMNS: Final = (
    Column("floor_id", "key"),
    Column("x_m", "key", "m"),
    Column("y_m", "key", "m"),
    Column("cell_m", "fact", "m"),
    Column("ways", "fact"),
    Column("direction_deg", "rate", "deg", "M42", tells=("n_people",), per="n_people"),
    Column("agreement", "fact"),
    Column("n_people", "count", "people"),
)
"""Columns of `walking_directions`."""
_FOLLOWED: Final = (
    *("not_followed_share", "unseen_share", "inflow_ratio"),
    *("n_left", "n_lost", "n_not_lost", "n_arrived"),
)
OTHERS: Final = "others"


def flow_answers(period: Period) -> tuple[Answer, ...]:
    """Return flow between the areas of a floor that ask for visits.

    Returns:
        `flow`: of those who leave an area, the share that each other one is the next area of (M37), and how many go
        there an open hour; areas of fewer than `mask_below` people are one row, with several ids in `to_area_ids`.
        `flow_areas`: how many leave an area, how well they were followed, and those who come in beside those that the
        flows bring. `flow_routes`: routes of those who come in by a door (M38). `flow_links`: estimates over floor
        where nobody is followed, in no other share.
    """
    place = {"floor_id": period.data.floor.floor_id}
    of_floor, holds = flow(period), period.holds_for
    if of_floor is None:
        tables = (("flow", FLOW_COLUMNS), ("flow_areas", AREA_COLUMNS), ("flow_routes", ROUTE_COLUMNS))
        return tuple(
            Answer(n, columns, (), holds, nothing=NOT_ASKED) for n, columns in (*tables, ("flow_links", LINK_COLUMNS))
        )
    to = tuple({**place, **row} for area in of_floor.areas for row in _destinations(area))
    recorded: Row = {"recorded_share": Value(of_floor.recorded_share)}
    areas = tuple({**place, **_area(area), **recorded} for area in of_floor.areas)
    notes = tuple((k, n) for k, a in enumerate(of_floor.areas) for n in _notes(a))
    silent = Reason("flow.silent", cameras=", ".join(of_floor.silent_cameras))
    general = ((None, silent),) if of_floor.silent_cameras else ()
    lost = (Sum("n_left", ("n_lost", "n_not_lost")), Sum("n_not_lost", ("flow.n_followed",)))
    return (
        Answer("flow", FLOW_COLUMNS, to, holds, notes=((None, _note(of_floor.areas)),)),
        Answer("flow_areas", AREA_COLUMNS, areas, holds, lost, (*notes, *general)),
        _routes(of_floor, place, period),
        _links(of_floor, place, period),
    )


def direction_answer(period: Period) -> Answer:
    """Return which way people walk through each cell of the floor that five or more walk through (M42)."""
    field = walking_directions(period)
    rows: tuple[Row, ...] = tuple(
        {
            "floor_id": period.data.floor.floor_id,
            "x_m": cell.x_m,
            "y_m": cell.y_m,
            "cell_m": field.cell_m,
            "ways": cell.ways,
            "direction_deg": Value(cell.direction_deg) if cell.direction_deg is not None else Value.missing(NO_WAY),
            "agreement": cell.agreement,
            "n_people": Value(cell.n_people),
        }
        for cell in field.cells
    )
    is_recorded = period.data.hours.recorded_s[:, period.is_inside].any()
    nothing = None if rows else Reason("flow.no_walkers") if is_recorded else NOTHING_OPEN
    return Answer("walking_directions", DIRECTION_COLUMNS, rows, period.holds_for, nothing=nothing)


def _destinations(area: AreaFlow) -> list[Row]:
    """Return the rows of one area; one without a destination where nobody is known to go anywhere."""
    why = area.leave_per_open_h.reason if area.leave_per_open_h.value is None else area.following.reason
    is_in_view_only = area.following.reason is not None and area.following.reason.code == LEFT_VIEW
    about: Row = {
        "area_id": area.area.area_id,
        "name": area.area.name,
        "n_left": _unknown(area) or Value(area.following.n),
        "in_view_only": is_in_view_only,
        "fits_arrivals": area.inflow.agrees,
    }
    if not area.to:
        none = dict.fromkeys(("next_area_share", "per_open_h", "followed_per_open_h", "n_followed"), Value.missing(why))
        return [{**about, "to_area_ids": "", "to_name": None, **none}]
    return [
        {
            **about,
            "to_area_ids": " ".join(a.area_id for a in to.areas),
            "to_name": ", ".join(a.name for a in to.areas),
            "next_area_share": Value.of(to.share, reason=to.share.reason or (why if to.share.value is None else None)),
            "per_open_h": _per_open_h(area, to, is_in_view_only=is_in_view_only),
            "followed_per_open_h": Value.of(to.followed_per_open_h),
            "n_followed": Value(to.share.n),
        }
        for to in area.to
    ]


def _per_open_h(area: AreaFlow, to: Destination, *, is_in_view_only: bool) -> Value:
    """Return how many go there in an open hour; only those followed, where others are known to go on unseen."""
    if is_in_view_only:
        return Value.of(to.followed_per_open_h)
    if area.leave_per_open_h.value is None or to.share.value is None:
        return Value.missing(to.share.reason or area.following.reason)
    return Value(area.leave_per_open_h.value * to.share.value)


def _unknown(area: AreaFlow) -> Value | None:
    """Return why nothing is known of an area whose hours were not recorded; None where something is."""
    return unknown_count(area.leave_per_open_h, area.following.n + area.inflow.n_arrived)


def _area(area: AreaFlow) -> Row:
    return {
        "area_id": area.area.area_id,
        "name": area.area.name,
        "leave_per_open_h": Value.of(area.leave_per_open_h),
        **(_followed(area) if (none := _unknown(area)) is None else dict.fromkeys(_FOLLOWED, none)),
        "fits_arrivals": area.inflow.agrees,
        "n_days": area.following.n_days,
        "recorded_open_h": area.leave_per_open_h.exposure_h,
    }


def _followed(area: AreaFlow) -> Row:
    """Return how well those who leave an area were followed, and how many they and those who come are."""
    following, check = area.following, area.inflow
    lost, why = following.not_followed, following.reason
    return {
        "not_followed_share": Value.of(lost, reason=lost.reason if following.n else why),
        "unseen_share": Value.missing(why) if following.unseen is None else Value(following.unseen),
        "inflow_ratio": Value.of(check, reason=None if check.value is not None else Reason("flow.no_inflow")),
        "n_left": Value(following.n),
        "n_lost": Value(lost.n),
        "n_not_lost": Value(following.n - lost.n),
        "n_arrived": Value(check.n_arrived),
    }


def _notes(area: AreaFlow) -> list[Reason]:
    """Return what a reader must know of those who leave one area."""
    notes = [] if area.following.reason is None or _unknown(area) else [area.following.reason]
    if area.inflow.agrees is False and area.inflow.value is not None:
        code = "flow.more_come" if area.inflow.value > 1 else "flow.fewer_come"
        notes.append(Reason(code, ratio=area.inflow.value))
    return notes


def _note(areas: Sequence[AreaFlow]) -> Reason:
    off = ", ".join(area.area.name for area in areas if area.inflow.agrees is False)
    note = Reason("note.flow")
    return Reason("note.flow_disagrees", note=note, places=off) if off else note


def _routes(of_floor: Flow, place: Row, period: Period) -> Answer:
    routes, following = of_floor.routes, of_floor.routes.following
    if not routes.has_doors:
        nothing = Reason("flow.no_doors")
        return Answer("flow_routes", ROUTE_COLUMNS, (), period.holds_for, nothing=nothing)
    if not routes.routes:
        is_known = bool(following.n or of_floor.recorded_share)
        none = Value.missing(following.reason if is_known else NOTHING_OPEN)
        began = Value(following.n) if is_known else none
        row = {**place, "route_area_ids": "", "route": None, "route_share": none, "n_people": none, "n_began": began}
        return Answer("flow_routes", ROUTE_COLUMNS, (row,), period.holds_for)
    rows = tuple(
        {
            **place,
            "route_area_ids": " ".join(a.area_id for a in route.areas) or OTHERS,
            "route": " > ".join(a.name for a in route.areas) or OTHERS,
            "route_share": Value.of(route.share, reason=route.share.reason or following.reason),
            "n_people": Value(route.share.n),
            "n_began": Value(following.n),
        }
        for route in routes.routes
    )
    return Answer("flow_routes", ROUTE_COLUMNS, rows, period.holds_for, notes=((None, Reason("note.flow")),))


def _links(of_floor: Flow, place: Row, period: Period) -> Answer:
    rows = tuple(
        {
            **place,
            "area_id": link.origin.area_id,
            "to_area_ids": link.to.area_id,
            "name": link.origin.name,
            "to_name": link.to.name,
            "linked_share": Value.of(link.share),
        }
        for link in of_floor.links.links
    )
    nothing = None if rows else Reason("flow.no_links") if of_floor.links.recorded_share else NOTHING_OPEN
    notes = ((None, Reason("note.links", share=of_floor.links.recorded_share)),) if rows else ()
    return Answer("flow_links", LINK_COLUMNS, rows, period.holds_for, (), notes, nothing)
