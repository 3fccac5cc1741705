"""The numbered spots of the map and their cards: tested hotspots (M20) where there are any, else the busiest areas.

A spot says when it is busy, how sure it is, and what to ask about the room. How sure: high when at least
90 % of the hours were recorded, it shows on at least five days, and its camera knows positions to half a metre; medium
when one of these is missed; low when two are, or its camera was down in its usual hours.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vsd_analytics.answer import Reason
from vsd_analytics.figures.cell_places import CellPlace
from vsd_analytics.figures.hotspots import FloorHotspots, FloorSpot
from vsd_analytics.figures.panels import WEEK
from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_estimate import Estimate
from vsd_analytics.figures.week.model_map import FloorMap, MapSpot
from vsd_analytics.figures.week.model_recording import Coverage
from vsd_analytics.figures.week.model_sections import Evidence, SpotCard, Spots, Sureness, UsualHours, WatchedSpot
from vsd_analytics.figures.week.results import AreaRow
from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.site.model import Calibration

SPOTS_MAX: Final = 3
"""Cards on a page; all hotspots are in the JSON file."""
RECORDED_SHARE: Final = 0.9
"""A spot is sure when its cameras recorded this share of the open hours ..."""
DAYS_PRESENT: Final = 5
"""... when it had violations on so many days of the week, or on all that had open hours ..."""
ERROR_M: Final = 0.5
"""... and when its camera's calibration is off by at most this much."""
LOW_FROM: Final = 2
"""A spot that misses so many of the three is of low sureness (help of `Evidence.sureness`)."""
DOWN_SHARE: Final = 0.25
"""A camera that missed this share of a spot's usual hours was down in them."""
USUAL_SHARE: Final = 0.5
"""Usual hours hold at least this share of a spot's violations."""
USUAL_MIN: Final = 30
"""Fewer violations have no usual hours."""
WEEKDAY_RATIO: Final = 1.25
"""A weekday is named when it has so many times the mean of the days."""

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """Violations at a spot: one entry each."""

    day: Ints
    hour: Ints
    camera: list[str]
    xy: NDArray[np.float64]

    def since(self, first: date) -> _Seen:
        """Return those from a day on."""
        kept = self.day >= first.toordinal()
        cameras = [c for c, k in zip(self.camera, kept, strict=True) if k]
        return _Seen(self.day[kept], self.hour[kept], cameras, self.xy[kept])


def spots(
    data: WeekData,
    hotspots: FloorHotspots,
    *,
    revealing: Collection[str],
    areas: Sequence[AreaRow],
    maps: Sequence[FloorMap],
    coverage: Coverage,
) -> Spots:
    """Return the numbered spots of the week; the page names them and asks (`report.model.spot_names`).

    Args:
        data: The week; its warehouse holds the hotspots' window.
        hotspots: The hotspots of the analysis room.
        revealing: Ids of those whose figures would tell a small count; they are shown without.
        areas: The areas, busiest first.
        maps: The maps, whose numbers the busiest areas take over.
        coverage: What was recorded.
    """
    chosen = _material(data, hotspots)[:SPOTS_MAX] if hotspots.state == "ok" else []
    is_tested = bool(chosen)
    why = None if is_tested else Reason("hotspots.none_stand_out") if hotspots.state == "ok" else hotspots.reason
    if is_tested:
        cards = [_tested(data, s, areas, coverage, hotspots) for s in chosen]
        cards = [_without_figures(c) if s.spot_id in revealing else c for c, s in zip(cards, chosen, strict=True)]
    else:
        cards = [_busiest(data, n, a, at, coverage) for n, a, at in _areas(areas, maps)]
    return Spots(
        kind="tested" if is_tested else "busiest",
        reason=why,
        first=hotspots.first if is_tested else None,
        last=hotspots.last if is_tested else None,
        cards=tuple(cards),
        n_more=len(hotspots.spots) - len(cards) if is_tested else len(hotspots.spots) if hotspots.state == "ok" else 0,
        watching=tuple(
            WatchedSpot(name=s.place.area_name or "", area_id=s.place.area_id, changed_on=s.changed_on)
            for s in hotspots.watching
        ),
    )


def _first_recorded(data: WeekData) -> date:
    """Return the first loaded day on which any camera recorded: a window may begin before the data do."""
    days = data.hours.day[data.hours.recorded_s.any(axis=0)]
    return date.fromordinal(int(days.min())) if len(days) else data.monday


def _at_the_spot(data: WeekData, spot: FloorSpot, evidence: Evidence | None) -> Estimate | None:
    """Return violations at a hotspot per open hour its camera recorded, this week and the week before.

    None where a count is too small to print, or a week was not recorded enough to have a rate.
    """
    if evidence is None or evidence.camera_id not in data.ids:
        return None
    k, least = data.ids.index(evidence.camera_id), data.site.settings.min_coverage
    rates = []
    for n, monday in zip(spot.by_week, (data.monday, data.monday - WEEK), strict=False):
        inside = data.week(monday)
        recorded_h, open_h = (
            data.hours.recorded_s[k, inside].sum() / 3600,
            data.hours.scheduled_s[k, inside].sum() / 3600,
        )
        if not open_h or recorded_h < least * open_h or data.mask.hides(n):
            return None
        rates.append(float(n / recorded_h))
    return Estimate(value=rates[0], previous=rates[-1]) if rates[1:] else None


def _material(data: WeekData, hotspots: FloorHotspots) -> list[FloorSpot]:
    """Return the hotspots that hold a material share of the floor's time too close; the others are in the JSON file."""
    whole_h = float(data.violation_h[:, data.inside(hotspots.first, hotspots.last)].sum())
    return [s for s in hotspots.spots if s.violation_h >= data.site.settings.material_share * whole_h]


def numbered(maps: tuple[FloorMap, ...], week_spots: Spots) -> tuple[FloorMap, ...]:
    """Return the maps with the numbers of tested spots; a picture is in pixels, so it gets none."""
    if week_spots.kind != "tested":
        return maps
    marks = tuple(MapSpot(number=c.number, name=c.name, at=c.at) for c in week_spots.cards if c.at is not None)
    return tuple(replace(m, spots=() if m.kind == "picture" else marks) for m in maps)


def place_shape(place: CellPlace) -> BaseGeometry:
    """Return the floor a hotspot lies on, floor metres."""
    return shapely.union_all([shapely.Polygon(p[0], p[1:]) for p in place.polygons])


def _tested(
    data: WeekData, spot: FloorSpot, areas: Sequence[AreaRow], coverage: Coverage, hotspots: FloorHotspots
) -> SpotCard:
    place = spot.place
    row = next((a for a in areas if a.area_id == place.area_id and place.area_id is not None), None)
    around = place_shape(place).buffer(data.site.settings.distance_m / 2)  # midpoints of those who stand in it
    seen = _inside(data, around, hotspots.first)
    evidence, usual = _evidence(data, seen, coverage, row)
    return SpotCard(
        number=spot.number,
        name=place.area_name or "",
        at=(place.peak_x_m, place.peak_y_m),
        area_id=place.area_id,
        violation_rate=row.violation_rate if row is not None else None,
        ratio=Estimate(value=spot.ratio, lo=spot.lo, hi=spot.hi),
        excess_min_per_week=spot.excess_min_per_week,
        is_new=None if spot.state is None else spot.state == "new",
        since=max(spot.since, _first_recorded(data)) if spot.state is not None else None,
        is_since_first=spot.is_since_first,
        here=_at_the_spot(data, spot, evidence),
        usual=usual,
        evidence=evidence,
    )


def _without_figures(card: SpotCard) -> SpotCard:
    ratio = Estimate(value=None, state="not_enough_data", reason=GIVES_AWAY)
    return replace(card, ratio=ratio, excess_min_per_week=None, here=None)


def _busiest(data: WeekData, number: int, row: AreaRow, at: tuple[float, float] | None, coverage: Coverage) -> SpotCard:
    evidence, usual = _evidence(data, _inside(data, str(row.area_id), data.monday), coverage, row)
    return SpotCard(
        number=number,
        name=row.name,
        at=at,
        area_id=row.area_id,
        violation_rate=row.violation_rate,
        usual=usual,
        evidence=evidence,
    )


def _areas(areas: Sequence[AreaRow], maps: Sequence[FloorMap]) -> list[tuple[int, AreaRow, tuple[float, float] | None]]:
    """Return the areas that the map numbers, with their number and place on it; without a map, the three busiest."""
    drawn = [a for a in areas if a.area_id is not None and a.violation_rate.value]
    if not any(m.kind != "picture" for m in maps):
        return [(n, a, None) for n, a in enumerate(drawn[:SPOTS_MAX], 1)]
    numbered_areas: list[tuple[int, AreaRow, tuple[float, float] | None]] = []
    for mark in (s for m in maps for s in m.spots):
        row = next((a for a in drawn if a.name == mark.name), None)
        if row is not None:
            drawn.remove(row)
            numbered_areas.append((mark.number, row, mark.at))
    return numbered_areas


def _inside(data: WeekData, where: BaseGeometry | str, first: date) -> _Seen:
    """Return the violations in opening hours, from a day on, in an area or on some floor.

    For readers, without those of hours of which they know only a sum.
    """
    rows = data.warehouse.table(
        "select local_date, local_hour, hour_start_ms, camera_id, cx, cy from violations "
        "where floor_id = $floor and is_open and cx is not null and local_date between $first and $last "
        "and ($area is null or area_id = $area) order by started_ms, camera_id, track_a, track_b",
        {
            "floor": data.floor.floor_id,
            "first": first,
            "last": data.sunday,
            "area": where if isinstance(where, str) else None,
        },
    )
    day = rows["local_date"].to_numpy().astype("datetime64[D]").astype(np.int64) + date(1970, 1, 1).toordinal()
    groups = data.warehouse.counted_together.get(data.floor.floor_id, ())
    kept = ~np.isin(rows["hour_start_ms"].to_numpy(), [ms for hours in groups for ms in hours])
    xy = (np.column_stack([rows[c].to_numpy() for c in ("cx", "cy")]) + 0.5) * FLOOR_CELL_M
    if not isinstance(where, str):
        kept &= shapely.contains_xy(where, xy[:, 0], xy[:, 1])
    cameras = [c for c, k in zip(rows["camera_id"].to_pylist(), kept, strict=True) if k]
    return _Seen(day[kept], rows["local_hour"].to_numpy().astype(np.int64)[kept], cameras, xy[kept])


def _evidence(
    data: WeekData, seen: _Seen, coverage: Coverage, row: AreaRow | None
) -> tuple[Evidence | None, UsualHours | None]:
    week = seen.since(data.monday)
    if not len(seen.day):
        return None, None
    counts = {c: seen.camera.count(c) for c in data.ids}
    camera_id = max(data.ids, key=lambda c: counts[c])
    camera = next(c for c in data.cameras if c.camera_id == camera_id)
    records = {c.camera_id: c for c in coverage.cameras}
    usual = _usual(seen, data)
    shares = [(counts[c], records[c].share or 0.0) for c in data.ids if counts[c]]
    recorded = sum(n * s for n, s in shares) / sum(n for n, _ in shares)
    if row is not None and row.recorded_share is not None:
        recorded = row.recorded_share
    until = data.midnight(data.monday + data.span)
    valid = [c for c in camera.calibrations if c.valid_from is None or c.valid_from < until]
    used = [*valid[-1:], *(plane.calibration for plane in camera.planes)]
    errors_m = [_error_m(calibration, week.xy) for calibration in used]
    error_m = max((e for e in errors_m if e is not None), default=None) if None not in errors_m else None
    lost = open_h = 0.0
    usual_hours = range(0) if usual is None else range(usual.first_hour, usual.last_hour + 1)
    for day in records[camera_id].days:
        for hour in usual_hours:
            if (share := day.hourly_share[hour]) is not None:
                lost, open_h = lost + 1 - share, open_h + 1
    is_down = open_h > 0 and lost > DOWN_SHARE * open_h
    n_days = len(np.unique(week.day))
    n_open = len({day.day for camera in coverage.cameras for day in camera.days if day.scheduled_h})
    missed = sum((recorded < RECORDED_SHARE, n_days < min(DAYS_PRESENT, n_open), error_m is None or error_m > ERROR_M))
    sureness: Sureness = "low" if is_down or missed >= LOW_FROM else "medium" if missed else "high"
    return Evidence(
        sureness=sureness,
        recorded_share=recorded,
        days_present=n_days,
        days_open=n_open,
        error_m=error_m,
        camera_id=camera_id,
        camera_name=camera.name,
        lost_h=lost,
        is_camera_down=is_down,
    ), usual


def _error_m(used: Calibration, xy: NDArray[np.float64]) -> float | None:
    """Return the error of a position where violations were, metres; None where the calibration does not state it.

    A calibration from people states the sd of a distance of 2 m, cell by cell. Two positions make a distance, so the
    error of one is taken as that over the square root of two.
    """
    if not used.error_cells:
        return used.error_m
    stated = {(math.floor(x), math.floor(y)): sd for x, y, sd in used.error_cells}
    sds_m = [stated.get((x, y), math.nan) for x, y in np.floor(xy).astype(int).tolist()]
    typical = float(np.median(sds_m))  # NaN where any is not known
    return None if math.isnan(typical) else typical / math.sqrt(2)


def _usual(seen: _Seen, data: WeekData) -> UsualHours | None:
    """Return the shortest run of hours with half of the violations, and the weekday clearly above others."""
    n = len(seen.day)
    if n < data.mask.least(USUAL_MIN):
        return None
    by_hour = np.bincount(seen.hour, minlength=24)
    total = np.concatenate([[0], np.cumsum(by_hour)])
    runs = [(b - a, -(total[b] - total[a]), a, b) for a in range(24) for b in range(a + 1, 25)]
    _, _, first, end = min(r for r in runs if -r[1] >= USUAL_SHARE * n)
    by_day = np.bincount((seen.day - 1) % 7, minlength=7)
    best, mean = int(by_day.argmax()), n / max(1, int((by_day > 0).sum()))
    return UsualHours(
        weekday=best if by_day[best] >= WEEKDAY_RATIO * mean else None,
        first_hour=first,
        last_hour=end - 1,
        share=float((total[end] - total[first]) / n),
    )
