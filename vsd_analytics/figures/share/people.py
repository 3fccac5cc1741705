"""How many people made the person-time of a place on a day, at least: less than `mask_below` of them, and it is hidden.

Track ids are pseudonyms that end with the site day, so who comes every day is another track each day: of several days,
people are those of the day with most of them. Ids of two cameras may be the same people, too, so cameras do not add up.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from vsd_analytics.figures.panels import FloorHours, Ints
from vsd_analytics.figures.periods import Period
from vsd_analytics.settings import FLOOR_CELL_M


def people_of_floor(period: Period) -> Ints:
    """Return how many people were on the floor on each day, at least, shape (n_days,): see `people_by_day`."""
    data = period.data
    rows = data.warehouse.table(
        "select site_day, max(n) as n from (select site_day, camera_id, count(*) as n from track_days "
        "where camera_id in (select unnest($ids)) and site_day between $first and $last group by all) group by all",
        {"ids": data.ids, "first": period.first, "last": period.last},
    )
    seen = dict(zip(rows["site_day"].to_pylist(), rows["n"].to_pylist(), strict=True))
    return np.maximum(_by_days(seen, period.days), _at_once(data, period, data.everyone.exposure_h))


def people_by_day(period: Period) -> Mapping[str | None, Ints]:
    """Return how many people were in each area on each day, at least; None is the rest of the floor.

    It is the largest of three lower bounds: the different tracks of one camera (mart `area_people`), those in one cell
    in an hour (mart `footsteps`, which has days that were sealed before tracks were counted by area), and the mean
    number of people in view in an hour, rounded up (which needs no ids).

    Args:
        period: The days of a floor with areas.

    Returns:
        By area, shape (n_days,).
    """
    data = period.data
    days = {"floor": data.floor.floor_id, "first": period.first, "last": period.last}
    tracks = data.warehouse.table(
        "select area_id, site_day, n_people from area_people "
        "where floor_id = $floor and site_day between $first and $last",
        days,
    ).to_pylist()
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
    found: dict[str | None, Ints] = {}
    for key, is_inside in of_cells.items():
        by_track = {row["site_day"]: row["n_people"] for row in tracks if row["area_id"] == key}
        by_cell: dict[date, int] = {}
        for k in np.flatnonzero(is_inside).tolist():
            by_cell[day[k]] = max(by_cell.get(day[k], 0), int(n[k]))
        bounds = (_by_days(by_track, period.days), _by_days(by_cell, period.days))
        found[key] = np.maximum(np.maximum(*bounds), _at_once(data, period, period.area(key).exposure_h))
    return found


def _by_days(n: Mapping[date, int], days: list[date]) -> Ints:
    return np.array([n.get(day, 0) for day in days], dtype=np.int64)


def _at_once(data: FloorHours, period: Period, exposure_h: NDArray[np.float64]) -> Ints:
    """Return the mean number of people in view of one camera in the busiest hour of each day, rounded up."""
    mean = np.nan_to_num(exposure_h).max(axis=0, initial=0.0)
    of_day = [mean[data.hours.day == day.toordinal()].max(initial=0.0) for day in period.days]
    return np.ceil(np.round(of_day, 6)).astype(np.int64)
