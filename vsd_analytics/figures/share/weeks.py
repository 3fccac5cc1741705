"""What of a floor's week is held back: the same in its own report and in every later output that reaches back to it.

A count that one report holds back must not come back by another one: as "the week before", in the weeks so far, in four
weeks of hotspots, in the planner. So each of them asks here, week by week.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import TYPE_CHECKING, Generic

import numpy as np
import shapely

from vsd_analytics.answer import Reason
from vsd_analytics.figures.panels import WEEK, Array, FloorHours, Place
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.counts import GIVES_AWAY, HeldBack, K, held_back, is_small, too_few
from vsd_analytics.figures.share.earlier import REST, Parts, SharedWeek
from vsd_analytics.settings import FLOOR_CELL_M

if TYPE_CHECKING:
    from vsd_analytics.figures.hotspots import FloorHotspots, FloorSpot, ResolvedSpot
    from vsd_analytics.figures.week.data import WeekData


CHANGED = Reason("hidden.changed")
"""Why a week is not shared again: too little changed since it was."""


@dataclass(frozen=True, slots=True)
class HiddenWeek:
    """What is held back of a floor's week.

    Attributes:
        places: Areas by id; None is the rest of the floor.
        hours: Hours of the timetable, as positions in the floor's hours.
        why_floor: Why no count of the whole floor is shown, nor any other of this week; None where they are. Where it
            is `CHANGED`, nothing of the week is shared.
        shared: The counts behind it, to be remembered where the week is shared; None where nothing was recorded.
    """

    places: HeldBack[str | None]
    hours: HeldBack[int]
    why_floor: Reason | None
    shared: SharedWeek | None = None

    @property
    def hides_hours(self) -> bool:
        """Tell whether a count of an hour is hidden: then a part of the week tells of it, too."""
        return bool(self.hours.small or self.hours.others)


def hidden_week(data: FloorHours, period: Period, earlier: Sequence[SharedWeek] = ()) -> HiddenWeek:
    """Return what is held back of a week.

    Where the count of the whole floor is too small, or would tell a small count of an area or an hour, all counts of
    the week go: areas and hours would sum up to it. If the week was shared before with other counts, what was hidden
    then stays hidden, and so do counts whose change is small, with others so that the changes tell nothing either.

    Args:
        data: The floor.
        period: The week.
        earlier: All that was shared before.
    """
    below = int(data.site.settings.mask_below)
    n_floor = int(data.panel(period.whole, period.days).n.sum())
    before = [w for w in earlier if (w.floor_id, w.monday) == (data.floor.floor_id, period.first)] if below > 1 else []
    by_place, by_hour = _by_place(data, period), _by_hour(data, period)
    starts = {i: str(int(data.hours.start_ms[i])) for i in by_hour}
    place_changes = [_change(by_place, w.places, w.hidden_places, _place_name) for w in before]
    hour_changes = [_change(by_hour, w.hours, w.hidden_hours, starts.__getitem__) for w in before]
    places = _held_places(by_place, place_changes, below)
    hours = _held_hours(by_hour, hour_changes, below, n_floor)
    shared = _shared(data, period, by_place, by_hour) if below > 1 else None
    why = None
    if any(_is_too_little(shared, then, below) for then in before):
        why = CHANGED
    elif is_small(n_floor, below=below):
        why = too_few(below)
    elif not places.is_total_safe or not hours.is_total_safe:
        why = CHANGED if _is_any(place_changes) or _is_any(hour_changes) else GIVES_AWAY
    if why is not None:
        places, hours = (_all(places, _sums(by_place)), _all(hours, _sums(by_hour)))
    if shared is not None:
        shared = replace(
            shared,
            hidden_places=frozenset(map(_place_name, places.small | places.others)),
            hidden_hours=frozenset(starts[i] for i in hours.small | hours.others),
        )
    return HiddenWeek(places, hours, why, shared)


@dataclass(frozen=True, slots=True)
class _Change(Generic[K]):
    """How counts differ from an earlier version: by how much, which were hidden then, which a reader knows."""

    by_camera: Mapping[K, Mapping[str, int]]
    hidden: frozenset[K]
    known: frozenset[K]


def _change(
    now: Mapping[K, Mapping[str, int]], then: Parts, hidden: frozenset[str], name: Callable[[K], str]
) -> _Change[K]:
    change: dict[K, dict[str, int]] = {}
    for key, n in now.items():
        of = then.get(name(key), {})
        change[key] = {c: abs(n.get(c, 0) - of.get(c, 0)) for c in dict.fromkeys((*n, *of))}
    was_hidden = frozenset(key for key in now if name(key) in hidden)
    return _Change(change, was_hidden, frozenset(k for k, n in change.items() if not any(n.values())) - was_hidden)


def _is_any(changes: Sequence[_Change[K]]) -> bool:
    return any(n for change in changes for of in change.by_camera.values() for n in of.values())


def _is_too_little(now: SharedWeek | None, then: SharedWeek, below: int) -> bool:
    """Tell whether so little changed since a week was shared that the difference would tell of a few people."""
    if now is None:
        return False
    n, n_then = (sum(n for of in week.hours.values() for n in of.values()) for week in (now, then))
    n_tracks = abs(now.n_tracks - then.n_tracks)
    return is_small(abs(n - n_then), below=below) or (now.person_ms != then.person_ms and n_tracks < below)


def _shared(
    data: FloorHours,
    period: Period,
    by_place: Mapping[str | None, Mapping[str, int]],
    by_hour: Mapping[int, Mapping[str, int]],
) -> SharedWeek | None:
    if not data.hours.recorded_s[:, period.is_inside].any():
        return None
    exposure_h = np.nan_to_num(data.panel(data.everyone, period.days).exposure_h)
    [row] = data.warehouse.rows(
        "select count(*) as n from track_days where camera_id in (select unnest($ids)) "
        "and site_day between $first and $last",
        {"ids": data.ids, "first": period.first, "last": period.last},
    )
    hours = {str(int(data.hours.start_ms[i])): n for i, n in by_hour.items() if any(n.values())}
    return SharedWeek(
        floor_id=data.floor.floor_id,
        monday=period.first,
        person_ms=round(float(exposure_h.sum()) * 3_600_000),
        n_tracks=int(row["n"]),
        places={_place_name(key): n for key, n in by_place.items()},
        hours=hours,
        hidden_places=frozenset(),
        hidden_hours=frozenset(),
    )


def _place_name(key: str | None) -> str:
    return REST if key is None else key


def _by_place(data: FloorHours, period: Period) -> dict[str | None, dict[str, int]]:
    """Return what each camera counted in each area and, last, the rest of the floor; nothing without areas."""
    if not data.areas or period.why_no_violations is not None or period.why_no_places is not None:
        return {}
    keys: list[str | None] = [*(a.area_id for a in data.areas), None]
    return {key: by_camera(data, place := period.area(key), data.panel(place, period.days).n) for key in keys}


def _held_places(
    by_place: Mapping[str | None, Mapping[str, int]], changes: Sequence[_Change[str | None]], below: int
) -> HeldBack[str | None]:
    """Return the areas held back, the rest of the floor first to be given up."""
    keys = list(by_place)
    return _held(by_place, changes, below=below, give=[*keys[-1:], *reversed(keys[:-1])])


def hidden_times(data: WeekData, period: Period) -> Mapping[str | None, Reason]:
    """Return why the person-time of areas is held back, by area; None is the rest of the floor.

    Fewer than `mask_below` people made it, as far as is known: the lower bound of the different tracks of one day in
    the busiest cell of 0.25 m (mart `footsteps`); who comes every day has another track each day. Another place goes
    with them, since the floor's time less that of all others is theirs: the rest of the floor, or the last area with
    enough people.

    Args:
        data: The floor.
        period: The week.
    """
    below = int(data.site.settings.mask_below)
    if below <= 1 or not data.areas:
        return {}
    rows = data.warehouse.table(
        "select cx, cy from footsteps where floor_id = $floor "
        "and local_date between $first and $last group by cx, cy having max(n_tracks) >= $below",
        {"floor": data.floor.floor_id, "first": period.first, "last": period.last, "below": below},
    )
    x, y = ((rows[name].to_numpy() + 0.5) * FLOOR_CELL_M for name in ("cx", "cy"))
    inside = {a.area_id: shapely.contains_xy(shapely.Polygon(a.polygon), x, y) for a in data.areas}
    is_rest = ~np.any(list(inside.values()), axis=0)
    has_people: dict[str | None, bool] = {key: bool(of.any()) for key, of in inside.items()}
    has_people[None] = bool(is_rest.any())
    times_h = {key: float(np.nansum(data.panel(period.area(key), period.days).exposure_h)) for key in has_people}
    few = [key for key, is_enough in has_people.items() if not is_enough and times_h[key] > 0]
    others = [key for key in (None, *reversed(inside)) if has_people[key] and times_h[key] > 0] if few else []
    return {key: Reason("hidden.few_people", least=below) for key in few} | dict.fromkeys(others[:1], GIVES_AWAY)


def by_camera(data: FloorHours, place: Place, n: Array) -> dict[str, int]:
    """Return what each camera that counts in a place counted, from a panel of cameras x days."""
    return {c: int(of) for c, of, is_able in zip(data.ids, n.sum(axis=1), place.cameras, strict=True) if is_able}


def _by_hour(data: FloorHours, period: Period) -> dict[int, dict[str, int]]:
    """Return what each camera that recorded counted in each hour of the timetable."""
    seen = (data.hours.recorded_s > 0) & period.whole.cameras[:, None]
    return {
        i: {c: int(n) for c, n, is_seen in zip(data.ids, period.whole.n[:, i], seen[:, i], strict=True) if is_seen}
        for i in timetable_hours(data, period)
    }


def _held_hours(
    by_hour: Mapping[int, Mapping[str, int]], changes: Sequence[_Change[int]], below: int, n_floor: int
) -> HeldBack[int]:
    """Return the hours held back, those nearest to the first small one first to be given up."""
    counts = _sums(by_hour)
    first = min((i for i, n in counts.items() if is_small(n, below=below)), default=0)
    give = sorted(counts, key=lambda i: (abs(i - first), i))
    # camera-hours that enter no rate are part of the timetable but not of the floor's count
    n_off = sum(counts.values()) - n_floor
    return _held(by_hour, changes, below=below, give=give, n_others=int(is_small(n_off, below=below)))


def _held(
    counts: Mapping[K, Mapping[str, int]],
    changes: Sequence[_Change[K]],
    *,
    below: int,
    give: Sequence[K],
    n_others: int = 0,
) -> HeldBack[K]:
    """Return what is held back of a partition, of now and of its changes from what was shared before.

    A count that a reader knows from before, because it did not change, hides nothing.
    """
    known = frozenset(key for change in changes for key in change.known)
    give = [key for key in give if key not in known]
    parts = [held_back(counts, below=below, give=give, n_others=n_others)]
    parts += [held_back(change.by_camera, below=below, give=give) for change in changes]
    small = parts[0].small
    stays = frozenset(key for change in changes for key in change.hidden)
    others = stays.union(*(p.small | p.others for p in parts)) - small
    return HeldBack(small, others, is_total_safe=all(p.is_total_safe for p in parts))


def _sums(by_key: Mapping[K, Mapping[str, int]]) -> dict[K, int]:
    return {key: sum(n.values()) for key, n in by_key.items()}


def timetable_hours(data: FloorHours, period: Period) -> list[int]:
    """Return the positions of the hours of a week at which the site opens on any day."""
    inside = np.flatnonzero(period.is_inside)
    open_hours = set(data.hours.hour[inside][data.hours.open_s[inside] > 0].tolist())
    return [int(i) for i in inside if int(data.hours.hour[i]) in open_hours]


def _all(held: HeldBack[K], counts: Mapping[K, int]) -> HeldBack[K]:
    """Return all counts but zeros as held back."""
    others = frozenset(key for key, n in counts.items() if n > 0 and key not in held.small)
    return HeldBack(held.small, others, is_total_safe=False)


def revealing_spots(data: WeekData, found: FloorHotspots) -> frozenset[str]:
    """Return the ids of hotspots whose figures would tell a small count of one week.

    A window of four weeks and the one before it differ by one week, so a hotspot's figures are held back as long as its
    window holds a week in which its own cells have a small count, or in which an area they touch, or the floor, is held
    back.

    Args:
        data: The floor; its range holds the window.
        found: Hotspots of the analysis room.
    """
    below = int(data.site.settings.mask_below)
    monday = found.first - timedelta(days=found.first.weekday())
    weeks = []
    while monday <= found.last:
        weeks.append(data.hidden_in(monday))
        monday += WEEK
    hidden = {key for week in weeks for key in (*week.places.small, *week.places.others)}
    is_floor_hidden = any(week.why_floor for week in weeks)
    drawn = {a.area_id: shapely.Polygon(a.polygon) for a in data.areas}
    every = shapely.union_all(list(drawn.values()))

    def reveals(spot: FloorSpot | ResolvedSpot) -> bool:
        if is_floor_hidden or any(is_small(n, below=below) for n in spot.by_week):
            return True
        shape = shapely.union_all([shapely.Polygon(p[0], p[1:]) for p in spot.place.polygons])
        touched = {key for key, polygon in drawn.items() if shapely.relate_pattern(shape, polygon, "T********")}
        is_on_rest = not shapely.covers(every, shape)
        return any(key in touched if key is not None else is_on_rest for key in hidden)

    spots: list[FloorSpot | ResolvedSpot] = [*found.spots, *found.resolved, *found.watching]
    return frozenset(s.spot_id for s in spots if reveals(s))
