"""What of a floor's week is held back: the same in its own report and in every later output that reaches back to it.

A count that one report holds back must not come back by another one: as "the week before", in the weeks so far, in four
weeks of hotspots, in the planner. So each of them asks here, week by week.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np
import shapely

from vsd_analytics.answer import Reason
from vsd_analytics.figures.panels import WEEK, Array, FloorHours, Place
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.counts import GIVES_AWAY, HeldBack, K, held_back, is_small, too_few

if TYPE_CHECKING:
    from vsd_analytics.figures.hotspots import FloorHotspots, FloorSpot, ResolvedSpot
    from vsd_analytics.figures.week.data import WeekData

NOTHING: HeldBack[str | None] = HeldBack(frozenset(), frozenset(), is_total_safe=True)


@dataclass(frozen=True, slots=True)
class HiddenWeek:
    """What is held back of a floor's week.

    Attributes:
        places: Areas by id; None is the rest of the floor.
        hours: Hours of the timetable, as positions in the floor's hours.
        why_floor: Why no count of the whole floor is shown, nor any other of this week; None where they are.
    """

    places: HeldBack[str | None]
    hours: HeldBack[int]
    why_floor: Reason | None


def hidden_week(data: FloorHours, period: Period) -> HiddenWeek:
    """Return what is held back of a week.

    Where the count of the whole floor is too small, or would tell a small count of an area or an hour, all counts of
    the week go: areas and hours would sum up to it.

    Args:
        data: The floor.
        period: The week.
    """
    below = int(data.site.settings.mask_below)
    n_floor = int(data.panel(period.whole, period.days).n.sum())
    places, by_place = _places(data, period, below)
    hours, by_hour = _hours(data, period, below, n_floor)
    if not is_small(n_floor, below=below) and places.is_total_safe and hours.is_total_safe:
        return HiddenWeek(places, hours, None)
    why = too_few(below) if is_small(n_floor, below=below) else GIVES_AWAY
    return HiddenWeek(_all(places, by_place), _all(hours, by_hour), why)


def _places(data: FloorHours, period: Period, below: int) -> tuple[HeldBack[str | None], dict[str | None, int]]:
    """Return the areas held back, the rest of the floor first to be given up, and what each counted."""
    if not data.areas or period.why_no_violations is not None or period.why_no_places is not None:
        return NOTHING, {}
    keys: list[str | None] = [*(a.area_id for a in data.areas), None]
    counts = {key: by_camera(data, place := period.area(key), data.panel(place, period.days).n) for key in keys}
    held = held_back(counts, below=below, give=[None, *reversed(keys[:-1])])
    return held, {key: sum(n.values()) for key, n in counts.items()}


def by_camera(data: FloorHours, place: Place, n: Array) -> dict[str, int]:
    """Return what each camera that counts in a place counted, from a panel of cameras x days."""
    return {c: int(of) for c, of, is_able in zip(data.ids, n.sum(axis=1), place.cameras, strict=True) if is_able}


def _hours(data: FloorHours, period: Period, below: int, n_floor: int) -> tuple[HeldBack[int], dict[int, int]]:
    """Return the hours held back, those nearest to the first small one first to be given up, and their counts."""
    seen = (data.hours.recorded_s > 0) & period.whole.cameras[:, None]
    by_hour = {
        i: {c: int(n) for c, n, is_seen in zip(data.ids, period.whole.n[:, i], seen[:, i], strict=True) if is_seen}
        for i in timetable_hours(data, period)
    }
    counts = {i: sum(n.values()) for i, n in by_hour.items()}
    first = min((i for i, n in counts.items() if is_small(n, below=below)), default=0)
    give = sorted(counts, key=lambda i: (abs(i - first), i))
    # camera-hours that enter no rate are part of the timetable but not of the floor's count
    n_off = sum(counts.values()) - n_floor
    return held_back(by_hour, below=below, give=give, n_others=int(is_small(n_off, below=below))), counts


def timetable_hours(data: FloorHours, period: Period) -> list[int]:
    """Return the positions of the hours of a week at which the site opens on any day."""
    inside = np.flatnonzero(period.is_inside)
    open_hours = set(data.hours.hour[inside][data.hours.open_s[inside] > 0].tolist())
    return [int(i) for i in inside if int(data.hours.hour[i]) in open_hours]


def _all(held: HeldBack[K], counts: dict[K, int]) -> HeldBack[K]:
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
