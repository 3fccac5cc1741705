"""Which hotspots would tell a small count of one week, and hotspots without them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from datetime import timedelta

import shapely

from vsd_analytics.answer import Reason
from vsd_analytics.figures.hotspots import FloorHotspots, FloorSpot, ResolvedSpot
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.figures.suppression import is_small
from vsd_analytics.figures.week.data import WeekData


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


def without_small(found: FloorHotspots, *, below: int, revealing: Collection[str]) -> FloorHotspots:
    """Return hotspots for a table that leaves your hands: those of fewer than `below` violations are left out.

    So are those that would tell a small count of one week, the cells, whose counts would tell them, and the total.

    Args:
        found: The hotspots.
        below: Counts from 1 to just under this are small.
        revealing: Ids of hotspots that would tell a small count (`revealing_spots`).
    """
    spots = tuple(s for s in found.spots if s.n >= below and s.spot_id not in revealing)
    resolved, watching = (
        tuple(r for r in of if (not r.n or r.n >= below) and r.spot_id not in revealing)
        for of in (found.resolved, found.watching)
    )
    n_held = sum(len(of) for of in (found.spots, found.resolved, found.watching))
    n_held -= len(spots) + len(resolved) + len(watching)
    notes = (*found.notes, Reason("hidden.hotspots", n=n_held, least=below)) if n_held else found.notes
    return replace(found, spots=spots, resolved=resolved, watching=watching, notes=notes, n=None, grid=None, cells=None)
