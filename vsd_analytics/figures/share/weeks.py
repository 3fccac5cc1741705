"""What of a floor's week is held back: the same in its own report and in every later output that reaches back to it.

A count that one report holds back must not come back by another one: as "the week before", in the weeks so far, in four
weeks of hotspots, in the planner. So each of them asks here, week by week.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, timedelta
from typing import TYPE_CHECKING, Generic

import numpy as np
import shapely

from vsd_analytics.answer import Reason
from vsd_analytics.figures.panels import WEEK, Array, FloorHours, Place
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.counts import GIVES_AWAY, HeldBack, K, Mask, held_back, is_small, rough, too_few
from vsd_analytics.figures.share.earlier import REST, Parts, SharedWeek
from vsd_analytics.figures.share.times import hours_without_times

if TYPE_CHECKING:
    from vsd_analytics.figures.hotspots import FloorHotspots, FloorSpot, ResolvedSpot
    from vsd_analytics.figures.week.data import WeekData


CHANGED = Reason("hidden.changed")
OTHER_PEOPLE = Reason("hidden.other_people")
NOT_AGAIN = (CHANGED, OTHER_PEOPLE)
"""Why a week is not shared again: too little changed since it was, or it was shared of other people. Figures of
all less those of visitors are those of the few who work there."""


@dataclass(frozen=True, slots=True)
class HiddenWeek:
    """What is held back of a floor's week.

    Attributes:
        places: Areas by id; None is the rest of the floor.
        hours: Hours of the timetable, as positions in the floor's hours.
        why_floor: Why no count of the whole floor is shown, nor any other of this week; None where they are. Where it
            is one of `NOT_AGAIN`, nothing of the week is shared.
        untimed: Hours whose person-time is not shown, likewise.
        why_untimed: Why no person-time of the whole floor is shown; None where it is.
        shared: The counts behind it, to be remembered where the week is shared; None where nothing was recorded.
    """

    places: HeldBack[str | None]
    hours: HeldBack[int]
    why_floor: Reason | None
    untimed: frozenset[int] = frozenset()
    why_untimed: Reason | None = None
    shared: SharedWeek | None = None

    @property
    def hides_hours(self) -> bool:
        """Tell whether a count of an hour is hidden: then a part of the week tells of it, too."""
        return bool(self.hours.small or self.hours.others)


def hidden_week(
    data: FloorHours, period: Period, earlier: Sequence[SharedWeek] = (), *, unready: Iterable[str | None] = ()
) -> HiddenWeek:
    """Return what is held back of a week.

    Where the count of the whole floor is too small, or would tell a small count of an area or an hour, all counts of
    the week go: areas and hours would sum up to it. If the week was shared before with other counts, what was hidden
    then stays hidden, and so do counts whose change is small, with others so that the changes tell nothing either.

    Args:
        data: The floor.
        period: The week, or its days so far.
        earlier: All that was shared before.
        unready: Places of a week that goes on whose counts do not leave yet (`running.Release`).
    """
    below = int(data.site.settings.mask_below)
    n_floor = int(data.panel(period.whole, period.days).n.sum())
    before = (
        [w for w in earlier if (w.floor_id, w.monday) == (data.floor.floor_id, period.first)] if data.mask.is_on else []
    )
    by_place, by_hour = _by_place(data, period), _by_hour(data, period)
    starts = {i: str(int(data.hours.start_ms[i])) for i in by_hour}
    day = {i: date.fromordinal(int(data.hours.day[i])) for i in by_hour}
    of_same_days = [w for w in before if w.through == period.last]
    place_changes = [_change(by_place, w.places, w.hidden_places, _place_name) for w in of_same_days]
    hour_changes = [
        _change({i: n for i, n in by_hour.items() if day[i] <= w.through}, w.hours, w.hidden_hours, starts.__getitem__)
        for w in before
    ]
    places = _held_places(by_place, place_changes, below, unready)
    ends = [w.through for w in before if w.through < period.last]
    is_unseen = _unseen_hours(_sums(by_hour), day, ends, below)
    hours = _held_hours(by_hour, hour_changes, below, n_floor, is_unseen)
    shared = _shared(data, period, by_place, by_hour) if data.mask.is_on else None
    why = None
    if any(then.people != data.site.settings.people for then in before):
        why = OTHER_PEOPLE
    elif any(_is_too_little(_until(data, period, shared, then), then, below) for then in before):
        why = CHANGED
    elif is_small(n_floor, below=below):
        why = too_few(below)
    elif period.why_few_people is not None:
        why = period.why_few_people
    elif not places.is_total_safe or not hours.is_total_safe:
        why = CHANGED if _is_any(place_changes) or _is_any(hour_changes) else GIVES_AWAY
    if why is not None:
        places, hours = (_all(places, _sums(by_place)), _all(hours, _sums(by_hour)))
    stays = frozenset(int(start) for week in before for start in week.untimed_hours)
    untimed = hours_without_times(period, ends) | {
        int(i) for i in np.flatnonzero(period.is_inside) if int(data.hours.start_ms[i]) in stays
    }
    if shared is not None:
        shared = replace(
            shared,
            hidden_places=frozenset(map(_place_name, places.small | places.others)),
            hidden_hours=frozenset(starts[i] for i in hours.small | hours.others),
            untimed_hours=frozenset(str(int(data.hours.start_ms[i])) for i in untimed),
        )
    return HiddenWeek(places, hours, why, untimed, period.why_few_people, shared)


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
        before = then.get(name(key), {})
        change[key] = {c: abs(n.get(c, 0) - before.get(c, 0)) for c in dict.fromkeys((*n, *before))}
    was_hidden = frozenset(key for key in now if name(key) in hidden)
    return _Change(change, was_hidden, frozenset(k for k, n in change.items() if not any(n.values())) - was_hidden)


def _is_any(changes: Sequence[_Change[K]]) -> bool:
    return any(n for change in changes for counts in change.by_camera.values() for n in counts.values())


def _until(data: FloorHours, period: Period, now: SharedWeek | None, then: SharedWeek) -> SharedWeek | None:
    """Return what is counted now of the days that an earlier version had."""
    if now is None or then.through >= now.through:
        return now
    _, end_ms = data.span_ms(period.first, then.through)
    hours = {start: n for start, n in now.hours.items() if int(start) < end_ms}
    person_ms, n_tracks = _people(data, period.first, then.through)
    return replace(now, hours=hours, person_ms=person_ms, n_tracks=n_tracks)


def _unseen_hours(
    n: Mapping[int, int], day: Mapping[int, date], ends: Sequence[date], below: int
) -> Callable[[int, int], bool]:
    """Return what tells whether one violation could lie in another hour, without any other sum a reader knows.

    They know what was counted up to each of the days `ends`, after which a page of the week left while it went on, and
    the count of each day to a rough number, from the card of the day.
    """
    of_day: dict[date, int] = {}
    for i, n_hour in n.items():
        of_day[day[i]] = of_day.get(day[i], 0) + n_hour

    def is_unseen(more: int, less: int) -> bool:
        if any((day[more] <= end) != (day[less] <= end) for end in ends):
            return False
        return day[more] == day[less] or all(
            rough(of_day[day[i]] + change, below=below) == rough(of_day[day[i]], below=below)
            for i, change in ((more, 1), (less, -1))
        )

    return is_unseen


def _is_too_little(now: SharedWeek | None, then: SharedWeek, below: int) -> bool:
    """Tell whether so little changed since a week was shared that the difference would tell of a few people.

    Rates tell the sums of cameras, so a small change of one camera is too little, whatever the others' are.
    """
    if now is None:
        return False
    sums, sums_then = (_of_cameras(week) for week in (now, then))
    changes = [sums.total() - sums_then.total(), *(sums[c] - sums_then[c] for c in sums | sums_then)]
    n_tracks = abs(now.n_tracks - then.n_tracks)
    few = now.person_ms != then.person_ms and n_tracks < below
    return few or any(is_small(abs(n), below=below) for n in changes)


def _of_cameras(week: SharedWeek) -> Counter[str]:
    totals: Counter[str] = Counter()
    for counts in week.hours.values():
        totals.update(counts)
    return totals


def _shared(
    data: FloorHours,
    period: Period,
    by_place: Mapping[str | None, Mapping[str, int]],
    by_hour: Mapping[int, Mapping[str, int]],
) -> SharedWeek | None:
    if not data.hours.recorded_s[:, period.is_inside].any():
        return None
    person_ms, n_tracks = _people(data, period.first, period.last)
    hours = {str(int(data.hours.start_ms[i])): n for i, n in by_hour.items() if any(n.values())}
    return SharedWeek(
        floor_id=data.floor.floor_id,
        monday=period.first,
        through=period.last,
        person_ms=person_ms,
        n_tracks=n_tracks,
        places={_place_name(key): n for key, n in by_place.items()},
        hours=hours,
        hidden_places=frozenset(),
        hidden_hours=frozenset(),
        people=data.site.settings.people,
    )


def _people(data: FloorHours, first: date, last: date) -> tuple[int, int]:
    """Return the person-milliseconds that enter rates, and the number of track ids, of some days."""
    exposure_h = np.nan_to_num(data.panel(data.everyone, data.warehouse.days(first, last)).exposure_h)
    [row] = data.warehouse.rows(
        "select count(*) as n from track_days where list_contains($ids::varchar[], camera_id) "
        "and site_day between $first and $last",
        {"ids": data.ids, "first": first, "last": last},
    )
    return round(float(exposure_h.sum()) * 3_600_000), int(row["n"])


def _place_name(key: str | None) -> str:
    return REST if key is None else key


def _by_place(data: FloorHours, period: Period) -> dict[str | None, dict[str, int]]:
    """Return what each camera counted in each area and, last, the rest of the floor; nothing without areas."""
    if not data.areas or period.why_no_violations is not None or period.why_no_places is not None:
        return {}
    keys: list[str | None] = [*(a.area_id for a in data.areas), None]
    return {key: by_camera(data, place := period.area(key), data.panel(place, period.days).n) for key in keys}


def _held_places(
    by_place: Mapping[str | None, Mapping[str, int]],
    changes: Sequence[_Change[str | None]],
    below: int,
    unready: Iterable[str | None],
) -> HeldBack[str | None]:
    """Return the areas held back, the rest of the floor first to be given up."""
    keys = list(by_place)
    here = [key for key in unready if key in by_place]
    return _held(by_place, changes, below=below, give=[*keys[-1:], *reversed(keys[:-1])], unready=here)


def by_camera(data: FloorHours, place: Place, n: Array) -> dict[str, int]:
    """Return what each camera that counts in a place counted, from a panel of cameras x days."""
    return {c: int(total) for c, total, is_able in zip(data.ids, n.sum(axis=1), place.cameras, strict=True) if is_able}


def _by_hour(data: FloorHours, period: Period) -> dict[int, dict[str, int]]:
    """Return what each camera that recorded counted in each hour of the timetable."""
    seen = (data.hours.recorded_s > 0) & period.whole.cameras[:, None]
    return {
        i: {c: int(n) for c, n, is_seen in zip(data.ids, period.whole.n[:, i], seen[:, i], strict=True) if is_seen}
        for i in timetable_hours(data, period)
    }


def _held_hours(
    by_hour: Mapping[int, Mapping[str, int]],
    changes: Sequence[_Change[int]],
    below: int,
    n_floor: int,
    is_unseen: Callable[[int, int], bool],
) -> HeldBack[int]:
    """Return the hours held back, those nearest to the first small one first to be given up."""
    counts = _sums(by_hour)
    first = min((i for i, n in counts.items() if is_small(n, below=below)), default=0)
    give = sorted(counts, key=lambda i: (abs(i - first), i))
    # camera-hours that enter no rate are part of the timetable but not of the floor's count
    n_off = sum(counts.values()) - n_floor
    n_others = int(is_small(n_off, below=below))
    return _held(by_hour, changes, below=below, give=give, n_others=n_others, is_unseen=is_unseen)


def _held(
    counts: Mapping[K, Mapping[str, int]],
    changes: Sequence[_Change[K]],
    *,
    below: int,
    give: Sequence[K],
    n_others: int = 0,
    unready: Sequence[K] = (),
    is_unseen: Callable[[K, K], bool] | None = None,
) -> HeldBack[K]:
    """Return what is held back of a partition, of now and of its changes from what was shared before.

    A count that a reader knows from before, because it did not change, hides nothing.
    """
    known = frozenset(key for change in changes for key in change.known)
    give = [key for key in give if key not in known]
    parts = [held_back(counts, below=below, give=give, n_others=n_others, unready=unready, is_unseen=is_unseen)]
    parts += [
        held_back(change.by_camera, below=below, give=[key for key in give if key in change.by_camera])
        for change in changes
    ]
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


def revealing_spots(data: WeekData, hotspots: FloorHotspots) -> frozenset[str]:
    """Return the ids of hotspots whose figures would tell a small count of one week.

    A window of four weeks and the one before it differ by one week, so a hotspot's figures are held back as long as its
    window holds a week in which its own cells have a small count, or in which an area they touch, or the floor, is held
    back.

    Args:
        data: The floor; its range holds the window.
        hotspots: Hotspots of the analysis room.
    """
    below = int(data.site.settings.mask_below)
    monday = hotspots.first - timedelta(days=hotspots.first.weekday())
    weeks = []
    while monday <= hotspots.last:
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

    spots: list[FloorSpot | ResolvedSpot] = [*hotspots.spots, *hotspots.resolved, *hotspots.watching]
    return frozenset(s.spot_id for s in spots if reveals(s))


def shared_spots(hotspots: FloorHotspots, mask: Mask, *, revealing: Collection[str]) -> FloorHotspots:
    """Return hotspots for a page that leaves the operator's hands: those with a small count are left out.

    So are those that would tell a small count of one week, the cells, whose counts would tell them, and the total.

    Args:
        hotspots: The hotspots.
        mask: The site's.
        revealing: Ids of hotspots that would tell a small count (`revealing_spots`).
    """
    spots = tuple(s for s in hotspots.spots if not mask.hides(s.n) and s.spot_id not in revealing)
    resolved, watching = (
        tuple(r for r in listed if not mask.hides(r.n) and r.spot_id not in revealing)
        for listed in (hotspots.resolved, hotspots.watching)
    )
    n_held = sum(len(listed) for listed in (hotspots.spots, hotspots.resolved, hotspots.watching))
    n_held -= len(spots) + len(resolved) + len(watching)
    notes = (*hotspots.notes, Reason("hidden.hotspots", n=n_held, least=mask.below)) if n_held else hotspots.notes
    return replace(
        hotspots, spots=spots, resolved=resolved, watching=watching, notes=notes, n=None, grid=None, cells=None
    )
