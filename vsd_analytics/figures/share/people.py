"""How many people made the person-time of a place on a day, at least: less than `mask_below` of them, and it is hidden.

Track ids are pseudonyms that end with the site day, so who comes every day is another track each day: of several days,
people are those of the day with most of them. Ids of two cameras may be the same people, too, so cameras do not add up.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from datetime import date
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from vsd_analytics.answer import Reason
from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.warehouse.dimensions import QUARTER_MS

if TYPE_CHECKING:
    from vsd_analytics.figures.panels import FloorHours, Ints
    from vsd_analytics.figures.periods import Period


def why_few_on_floor(period: Period) -> Reason | None:
    """Return why nothing is given of the people of a floor: fewer than `mask_below` are known to have been there.

    Their time is that of single people, and so is whatever counts or divides by it. Of an engine without track ids it
    is not known how many people came, and the time of its floor is given.
    """
    mask = period.data.mask
    if not mask.is_on or not has_tracks(period) or not mask.hides(int(people_of_floor(period).max(initial=0))):
        return None
    return Reason("hidden.few_on_floor", least=mask.below)


def has_tracks(period: Period) -> bool:
    """Tell whether anybody on the floor had a track id."""
    values = {"ids": period.data.ids, "first": period.first, "last": period.last}
    query = "from track_days where list_contains($ids::varchar[], camera_id) and site_day between $first and $last"
    return bool(period.data.warehouse.rows(f"select 1 {query} limit 1", values))


def people_of_floor(period: Period) -> Ints:
    """Return how many people were on the floor in opening hours of each day, at least, shape (n_days,).

    It is that of the hour with most of them (`people_by_hour`). Where that is small, the different tracks of one camera
    in opening hours of the site day count as well (mart `floor_people`): who comes when it is closed is in no figure.
    """
    data = period.data
    by_hour = [data.people_by_hour[data.hours.day == day.toordinal()].max(initial=0) for day in period.days]
    in_hour = np.array(by_hour, dtype=np.int64)
    if not data.mask.hides(*by_hour):
        return in_hour
    rows = data.warehouse.table(
        "select site_day, max(n_tracks) as n from floor_people "
        "where floor_id = $floor and site_day between $first and $last group by site_day",
        {"floor": data.floor.floor_id, "first": period.first, "last": period.last},
    )
    seen = dict(zip(rows["site_day"].to_pylist(), rows["n"].to_pylist(), strict=True))
    return np.maximum(_by_days(seen, period.days), in_hour)


def people_by_hour(data: FloorHours) -> Ints:
    """Return how many people were on the floor in each hour of the data, at least, shape (n_hours,).

    It is the largest of three lower bounds, each of one camera: its different tracks (mart `track_hours`), and two that
    need no ids, the mean number of people in view, and the mean number that a person in view makes up with those beside
    them: 1 + 2 x pair-time / person-time (mart `crowding_hours`).
    """
    floor = {"floor": data.floor.floor_id}
    tracks = data.warehouse.table(
        "select camera_id, hour_start_ms, n_tracks::double as n_tracks from track_hours where floor_id = $floor", floor
    )
    crowds = data.warehouse.table(
        "select camera_id, hour_start_ms, 1 + 2 * copresent_pair_s / person_s as n_people from crowding_hours "
        "where floor_id = $floor and person_s > 0",
        floor,
    )
    bounds = (
        *data.by_hour(tracks, "n_tracks"),
        *(
            np.ceil(np.round(n, 6))
            for n in (*data.by_hour(crowds, "n_people"), np.nan_to_num(data.everyone.exposure_h))
        ),
    )
    n: Ints = np.max(bounds, axis=(0, 1), initial=0.0).astype(np.int64)
    return n


def people_in_quarter(data: FloorHours, start_ms: int, *, at_once: float) -> int:
    """Return how many people were on the floor in a quarter-hour, at least: tracks that last into it, or at once.

    Args:
        data: The floor.
        start_ms: UTC instant it starts, milliseconds.
        at_once: Mean number of people in view in it.
    """
    [row] = data.warehouse.rows(
        "select coalesce(max(n), 0) as n from (select count(*) as n from track_lives where hour = $hour "
        "and list_contains($ids::varchar[], camera_id) and first_ms < $end and last_ms >= $start group by camera_id)",
        {"hour": start_ms // HOUR_MS, "ids": data.ids, "start": start_ms, "end": start_ms + QUARTER_MS},
    )
    return max(int(row["n"]), math.ceil(round(at_once / max(1, len(data.ids)), 6)))


def people_by_day(period: Period) -> Mapping[str | None, Ints]:
    """Return how many people were in each area on each day, at least; None is the rest of the floor.

    It is the largest of three lower bounds, in opening hours: the different tracks in one cell in an hour (mart
    `footsteps`, which has days that were sealed before tracks were counted by area), the mean number of people in view
    in an hour, rounded up (which needs no ids), and, where one of these is small, the different tracks of one
    camera in the day (mart `area_people`).

    Args:
        period: The days of a floor with areas.

    Returns:
        By area, shape (n_days,).
    """
    data = period.data
    days = {"floor": data.floor.floor_id, "first": period.first, "last": period.last}
    cells = data.warehouse.table(
        "select cx, cy, local_date, n_tracks from footsteps "
        "where floor_id = $floor and local_date between $first and $last",
        days,
    )
    x, y = ((cells[name].to_numpy() + 0.5) * FLOOR_CELL_M for name in ("cx", "cy"))
    day, n = cells["local_date"].to_pylist(), cells["n_tracks"].to_numpy()
    inside = {a.area_id: shapely.contains_xy(shapely.Polygon(a.polygon), x, y) for a in data.areas}
    of_cells: dict[str | None, Any] = dict(inside.items())
    of_cells[None] = ~np.any(list(inside.values()), axis=0)
    people: dict[str | None, Ints] = {}
    for key, is_inside in of_cells.items():
        by_cell: dict[date, int] = {}
        for k in np.flatnonzero(is_inside).tolist():
            by_cell[day[k]] = max(by_cell.get(day[k], 0), int(n[k]))
        people[key] = np.maximum(_by_days(by_cell, period.days), _at_once(data, period, period.area(key).exposure_h))
    if not any(data.mask.hides(*n.tolist()) for n in people.values()):
        return people
    tracks = data.warehouse.table(
        "select area_id, site_day, n_people from area_people "
        "where floor_id = $floor and site_day between $first and $last",
        days,
    ).to_pylist()
    for key, n in people.items():
        by_track = {row["site_day"]: row["n_people"] for row in tracks if row["area_id"] == key}
        people[key] = np.maximum(n, _by_days(by_track, period.days))
    return people


def people_by_hour_of_day(period: Period, area_id: str) -> Mapping[int, int]:
    """Return how many people were in an area in each hour of the day, at least, on the day with most of them.

    It is the larger of two lower bounds, each of one camera: different tracks in the hour (fact `area_tracks`), and the
    mean number in view, rounded up, which needs no ids.

    Args:
        period: The days of a floor.
        area_id: The area.
    """
    data = period.data
    rows = data.warehouse.table(
        "select calendar.local_hour, max(seen.n) as n "
        "from (select hour, count(distinct track_id) as n from area_tracks "
        "where area_id = $area and list_contains($ids::varchar[], camera_id) group by hour, camera_id) as seen "
        "inner join calendar on seen.hour * 4 = calendar.quarter "
        "where calendar.is_open and calendar.local_date between $first and $last group by calendar.local_hour",
        {"area": area_id, "ids": data.ids, "first": period.first, "last": period.last},
    )
    people = {int(h): int(n) for h, n in zip(rows["local_hour"].to_pylist(), rows["n"].to_pylist(), strict=True)}
    at_once = np.ceil(np.round(np.nan_to_num(period.area(area_id).exposure_h).max(axis=0, initial=0.0), 6))
    used = (data.hours.day >= period.first.toordinal()) & (data.hours.day <= period.last.toordinal())
    for hour in np.unique(data.hours.hour[used]).tolist():
        most = int(at_once[used & (data.hours.hour == hour)].max(initial=0.0))
        people[hour] = max(people.get(hour, 0), most)
    return people


def _by_days(n: Mapping[date, int], days: list[date]) -> Ints:
    return np.array([n.get(day, 0) for day in days], dtype=np.int64)


def _at_once(data: FloorHours, period: Period, exposure_h: NDArray[np.float64]) -> Ints:
    """Return the mean number of people in view of one camera in the busiest hour of each day, rounded up."""
    mean = np.nan_to_num(exposure_h).max(axis=0, initial=0.0)
    of_day = [mean[data.hours.day == day.toordinal()].max(initial=0.0) for day in period.days]
    return np.ceil(np.round(of_day, 6)).astype(np.int64)
