"""Flow between areas: where people go next (M37), and the routes from door to door (M38), from tracks that may be cut.

Only areas with `visits = true` in vsd.toml. Somebody who leaves counts where the last record inside is counted, in
opening hours of which enough was recorded. How shares are found: `vsd_analytics.stats.next_area`. Areas and routes of
fewer than `mask_below` people are one sum, "other", so that no share tells of a few people.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import pyarrow as pa

from vsd_analytics.answer import Reason
from vsd_analytics.figures.links import Links, links
from vsd_analytics.figures.panels import Array, Flags, Ints, Place, positions
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.counts import Mask
from vsd_analytics.figures.visits import people_counted, per_open_hour, sends_ids
from vsd_analytics.site.model import Area
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.stats.groups import ShareEstimate
from vsd_analytics.stats.next_area import InflowCheck, Leaving, NextAreas, inflow_checks, next_areas

LEFT_VIEW: Final = "flow.left_view"
MOST_LINKED: Final = 0.05
"""Share of those who leave an area that may go on unseen, by estimated links, before shares say nothing of them all."""
MAX_ROUTE: Final = 6
"""Routes of more areas than this are one sum: nearly each of them is somebody's own."""
MAX_ROUTES: Final = 12
"""Routes with a line of their own; rarer ones are one sum."""
_MOVES: Final = """
select
    area_id,
    counted_by,
    camera_id,
    track_id,
    site_day,
    visit_no,
    is_last,
    hour_start_ms,
    is_open and is_arrival and is_counted and local_date between $first and $last as is_arrival,
    left_hour_ms,
    is_open_then and is_departure and is_exit_counted and left_date between $first and $last as is_departure,
    is_open and local_date between $first and $last as is_inside,
    is_arrival as was_outside,
    is_departure as goes_on,
    next_area_id,
    until_next_s::double as until_next_s,
    since_began_s::double as since_began_s,
    is_door
from moves
where floor_id = $floor and (local_date between $first and $last or left_date between $first and $last)
order by site_day, camera_id, track_id, visit_no
"""


@dataclass(frozen=True, slots=True)
class Destination:
    """Where some of those who leave an area go next.

    Attributes:
        areas: The area; several where each was entered by too few people for a line of its own.
        share: Share of those who leave.
        followed_per_open_h: People followed there per open hour. Those lost on the way are missing in it.
    """

    areas: tuple[Area, ...]
    share: ShareEstimate
    followed_per_open_h: RateEstimate


@dataclass(frozen=True, slots=True)
class AreaFlow:
    """People who leave one area, and those who come into it.

    Attributes:
        area: The area.
        leave_per_open_h: People who leave it per open hour, with the interval of M0, wherever they go.
        to: Where they go next, most first, others last; empty where nothing is known.
        following: How well they were followed.
        inflow: Those who come into it, beside those that the flows from all areas bring.
    """

    area: Area
    leave_per_open_h: RateEstimate
    to: tuple[Destination, ...]
    following: NextAreas
    inflow: InflowCheck


@dataclass(frozen=True, slots=True)
class Route:
    """A sequence of areas from door to door.

    Attributes:
        areas: The areas in the order in which they are entered; empty for all other routes.
        share: Share of all routes.
    """

    areas: tuple[Area, ...]
    share: ShareEstimate


@dataclass(frozen=True, slots=True)
class DoorRoutes:
    """Routes of those who come in by a door.

    Attributes:
        routes: Routes, most frequent first, others last; empty where nothing is known.
        following: How well the tracks that begin in a door were followed.
        has_doors: An area of the floor is a door that asks for visits.
    """

    routes: tuple[Route, ...]
    following: NextAreas
    has_doors: bool


@dataclass(frozen=True, slots=True)
class Flow:
    """Flow of a floor in a period.

    Attributes:
        areas: One for each area that asks for visits, in the order of vsd.toml.
        routes: Routes from door to door.
        silent_cameras: Cameras of the floor that recorded nothing of the period.
        recorded_share: Recorded share of the opening hours of its cameras.
        links: Estimated links over floor where nobody is followed; in no other figure.
    """

    areas: tuple[AreaFlow, ...]
    routes: DoorRoutes
    silent_cameras: tuple[str, ...]
    recorded_share: float
    links: Links


def flow(period: Period) -> Flow | None:
    """Return the flow between the areas of a floor that ask for visits; None where none does."""
    data = period.data
    asked = [a for a in data.areas if a.has_visits]
    if not asked:
        return None
    rows = data.warehouse.table(_MOVES, {"floor": data.floor.floor_id, "first": period.first, "last": period.last})
    moves = _Moves.of(period, rows, asked)
    recorded = data.hours.recorded_s[:, period.is_inside].sum(axis=1)
    open_s = float(data.hours.scheduled_s[:, period.is_inside].sum())
    unseen = links(period)
    return Flow(
        tuple(_of_those_in_view(area_flow, unseen) for area_flow in _areas(period, moves, asked)),
        _routes(period, moves, asked),
        tuple(c for c, s in zip(data.ids, recorded, strict=True) if not s),
        float(recorded.sum()) / open_s if open_s else 0.0,
        unseen,
    )


def _of_those_in_view(area_flow: AreaFlow, unseen: Links) -> AreaFlow:
    """Return the flow from an area without intervals where links say that people go on where nobody follows them.

    They are lost because of where they go, so that the shares are those of people who stay in view.
    """
    linked = sum(link.share.possible for link in unseen.links if link.origin == area_flow.area)
    share = min(linked, area_flow.following.not_followed.value or 0.0)
    if share <= MOST_LINKED or area_flow.following.reason is not None:
        return area_flow
    why = Reason(LEFT_VIEW, share=share)
    bare = [replace(to.share, lo=None, hi=None, state="not_enough_data", reason=why) for to in area_flow.to]
    return replace(
        area_flow,
        to=tuple(replace(to, share=s) for to, s in zip(area_flow.to, bare, strict=True)),
        following=replace(area_flow.following, reason=why),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Moves:
    """Stays of tracks in areas in the order in which they are entered, one element each.

    Attributes:
        area, next_area: Which of the areas that ask; -1 = none.
        camera: Camera number.
        hour, left_hour: Hour of the first and of the last record.
        day, left_day: Their days in the period.
        is_arrival, is_departure: Comes in from, or goes out to the floor, counted and in hours that count.
        is_inside: Begins in opening hours that count.
        until_next_s: To the next area, or the end of the track.
        since_began_s: Life of the track.
        is_first, is_last: First and last area of its track.
        begins, ends: The track begins or ends in the area.
        is_door: In a door.
    """

    area: Ints
    next_area: Ints
    camera: Ints
    hour: Ints
    left_hour: Ints
    day: Ints
    left_day: Ints
    is_arrival: Flags
    is_departure: Flags
    is_inside: Flags
    until_next_s: Array
    since_began_s: Array
    is_first: Flags
    is_last: Flags
    begins: Flags
    ends: Flags
    is_door: Flags

    @classmethod
    def of(cls, period: Period, rows: pa.Table, asked: Sequence[Area]) -> _Moves:
        hours, ids = period.data.hours, [a.area_id for a in asked]

        def column(name: str) -> np.ndarray:
            return np.asarray(rows[name].to_numpy(zero_copy_only=False))

        camera = positions(rows["counted_by"], period.data.ids, otherwise=-1)
        hour, left_hour = (np.searchsorted(hours.start_ms, column(n)) for n in ("hour_start_ms", "left_hour_ms"))
        at, left_at = (np.minimum(h, len(hours.start_ms) - 1) for h in (hour, left_hour))
        used, used_then = hours.is_counted[camera, at], hours.is_counted[camera, left_at]
        days = np.array([d.toordinal() for d in period.days], dtype=np.int64)
        day, left_day = (np.clip(np.searchsorted(days, hours.day[h]), 0, len(days) - 1) for h in (at, left_at))
        return cls(
            positions(rows["area_id"], ids, otherwise=-1),
            positions(rows["next_area_id"], ids, otherwise=-1),
            camera,
            at,
            left_at,
            day,
            left_day,
            column("is_arrival").astype(np.bool_) & used,
            column("is_departure").astype(np.bool_) & used_then,
            column("is_inside").astype(np.bool_) & used,
            column("until_next_s"),
            column("since_began_s"),
            column("visit_no") == 1,
            column("is_last").astype(np.bool_),
            ~column("was_outside").astype(np.bool_),
            ~column("goes_on").astype(np.bool_),
            column("is_door").astype(np.bool_),
        )


def _areas(period: Period, moves: _Moves, asked: Sequence[Area]) -> tuple[AreaFlow, ...]:
    settings = period.data.site.settings
    confidence, min_days = settings.confidence, int(settings.min_days)
    leaving = [_leaving(moves, k) for k in range(len(asked))]
    arrived = np.zeros((len(asked), len(period.days)))
    came = moves.is_arrival
    np.add.at(arrived, (moves.area[came], moves.day[came]), 1.0)
    checks = inflow_checks(leaving, arrived, confidence=confidence, min_days=min_days)
    able = sends_ids(period)
    flows = []
    for k, area in enumerate(asked):
        place = period.area(area.area_id)
        at = moves.is_departure & (moves.area == k)
        pooled = pooled_kinds(leaving[k].kind, n_kinds=len(asked), mask=period.data.mask)
        kinds = [tuple(np.flatnonzero(pooled == j).tolist()) for j in range(int(pooled.max(initial=-1)) + 1)]
        people = replace(leaving[k], kind=_renamed(leaving[k].kind, pooled))
        following = next_areas(people, n_kinds=len(kinds), confidence=confidence, min_days=min_days)
        to = tuple(
            Destination(
                tuple(asked[j] for j in members),
                share,
                _people_per_open_h(period, moves, at & np.isin(moves.next_area, members), place, able),
            )
            for members, share in zip(kinds, following.shares, strict=True)
        )
        flows.append(AreaFlow(area, _people_per_open_h(period, moves, at, place, able), to, following, checks[k]))
    return tuple(flows)


def _leaving(moves: _Moves, area: int) -> Leaving:
    at = moves.is_departure & (moves.area == area)
    return Leaving(moves.until_next_s[at], moves.next_area[at], moves.left_day[at])


def _people_per_open_h(period: Period, moves: _Moves, at: Flags, place: Place, able: Flags) -> RateEstimate:
    counted, why_none = people_counted(place, moves.camera[at], moves.left_hour[at], able)
    return per_open_hour(period, counted, what="flow", why_none=why_none)


def pooled_kinds(kind: Ints, *, n_kinds: int, mask: Mask, most: int | None = None) -> Ints:
    """Return a number for each kind, most frequent first, so that the mask hides none but the last.

    Rare kinds, and those beyond `most`, share the last number; where their sum is small, the next kind shares it, too,
    so that it does not tell. Kinds that nobody has get -1.

    Args:
        kind: Kind of each person; negative ones are none.
        n_kinds: How many kinds there are.
        mask: Tells which counts are small.
        most: How many numbers of their own at most; None = all.
    """
    n = np.bincount(kind[kind >= 0], minlength=n_kinds)
    order = np.argsort(-n, kind="stable")
    order = order[n[order] > 0]
    n_large = sum(not mask.hides(int(of_kind)) for of_kind in n[order])
    own = n_large if most is None else min(most, n_large)
    while own and mask.hides(int(n[order[own:]].sum())):
        own -= 1
    numbers = np.full(n_kinds, -1, dtype=np.int64)
    numbers[order] = np.minimum(np.arange(len(order)), own)
    return numbers


def _renamed(kind: Ints, pooled: Ints) -> Ints:
    renamed = np.full_like(kind, -1)
    renamed[kind >= 0] = pooled[kind[kind >= 0]]
    return renamed


def _routes(period: Period, moves: _Moves, asked: Sequence[Area]) -> DoorRoutes:
    """Return the routes of tracks that begin in a door; what leaves by no door is lost."""
    settings = period.data.site.settings
    first = np.flatnonzero(moves.is_first)
    ends = (np.append(first[1:], len(moves.is_first)) - 1)[: len(first)]
    # who never leaves the door did not come in
    chosen = [
        (int(a), int(b))
        for a, b in zip(first, ends, strict=True)
        if moves.is_door[a] and moves.begins[a] and moves.is_inside[a] and (a != b or not moves.ends[a])
    ]
    ways: list[tuple[int, ...] | None] = []
    for a, b in chosen:
        if not (moves.is_last[b] and moves.is_door[b] and moves.ends[b]):
            ways.append(None)
            continue
        way = [int(k) for k in moves.area[a : b + 1]]
        short = tuple(k for i, k in enumerate(way) if i == 0 or k != way[i - 1] or (i == 1 and len(way) == 2))  # noqa: PLR2004
        ways.append(short if len(short) <= MAX_ROUTE else ())
    n_by_way = Counter(way for way in ways if way is not None)
    names = sorted(n_by_way, key=lambda way: (-n_by_way[way] if way else 1, way))
    number = {way: k for k, way in enumerate(names)}
    kind = np.array([-1 if way is None else number[way] for way in ways], dtype=np.int64)
    pooled = pooled_kinds(kind, n_kinds=len(names), mask=period.data.mask, most=MAX_ROUTES)
    starts = np.array([a for a, _ in chosen], dtype=np.int64)
    following = next_areas(
        Leaving(moves.since_began_s[starts], _renamed(kind, pooled), moves.day[starts]),
        n_kinds=int(pooled.max(initial=-1)) + 1,
        **settings.for_intervals,
    )
    following = replace(
        following,
        reason=_of_routes(following.reason),
        shares=tuple(replace(s, reason=_of_routes(s.reason)) for s in following.shares),
    )
    routes = []
    for j, share in enumerate(following.shares):
        members = [names[k] for k in np.flatnonzero(pooled == j)]
        areas = tuple(asked[k] for k in members[0]) if len(members) == 1 else ()
        routes.append(Route(areas, share))
    has_doors = any(a.is_door for a in asked)
    return DoorRoutes(tuple(routes), following, has_doors)


def _of_routes(reason: Reason | None) -> Reason | None:
    """Return a reason of those who leave an area in the words of those who come in by a door."""
    return None if reason is None else Reason(reason.code.replace("flow.", "routes."), **reason.values)
