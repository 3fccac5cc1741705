"""Time too close and people at once, by place, as recorded: what a predicted change is a change of."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from typing import Final

import numpy as np

from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.whatif.arrays import Bools
from vsd_analytics.whatif.floor_records import FloorRecords

HOUR_S: Final = 3600.0
_AREAS: Final = """
select area_id, camera_id, hour_start_ms, exposure_open_s::double as exposure_s, violation_open_s::double as close_s
from area_hours
where floor_id = $floor and local_date between $first and $last
"""
_OPEN: Final = """
select camera_id, sum(recorded_open_s)::double / 3600 as open_h
from camera_hours
where floor_id = $floor and local_date between $first and $last
group by camera_id
order by camera_id
"""


_DAYS: Final = """
with days as (
    select local_date, camera_id, sum(recorded_open_s) as open_s
    from camera_hours
    where floor_id = $floor and local_date between $first and $last
    group by local_date, camera_id
),

cameras as (select distinct camera_id from days where open_s > 0)

select days.local_date
from days
inner join cameras on days.camera_id = cameras.camera_id
group by days.local_date
having
    count(*) = (select count(*) from cameras)
    and min(days.open_s) > 0
    and min(days.open_s) >= $share * max(days.open_s)
order by days.local_date
"""
ALIKE_SHARE: Final = 0.9
"""Of the open hours that the best recorded camera has of a day, to compare the places of other cameras with its own."""


@dataclass(frozen=True, slots=True)
class PlaceTime:
    """What was recorded of a place in opening hours.

    Attributes:
        close_s: Person-seconds too close, by camera id.
        exposure_s: Person-seconds.
        peak_people: People at once in its fullest hour, mean over the hour.
    """

    close_s: Mapping[str, float]
    exposure_s: float
    peak_people: float

    @property
    def total_close_s(self) -> float:
        """Return the person-seconds too close, all cameras."""
        return sum(self.close_s.values())

    def min_per_open_h(self, open_h: Mapping[str, float]) -> float | None:
        """Return person-minutes too close per recorded open hour, sum over cameras; None without a recorded hour."""
        seen = [s / 60 / open_h[c] for c, s in self.close_s.items() if open_h.get(c, 0) > 0]
        return sum(seen) if any(h > 0 for h in open_h.values()) else None


def open_hours(warehouse: Warehouse, floor_id: str, first: date, last: date) -> dict[str, float]:
    """Return the recorded open hours of each camera of a floor."""
    rows = warehouse.rows(_OPEN, {"floor": floor_id, "first": first, "last": last})
    return {row["camera_id"]: row["open_h"] or 0.0 for row in rows}


def days_alike(warehouse: Warehouse, floor_id: str, first: date, last: date) -> tuple[int, ...]:
    """Return the local days (`date.toordinal`) that all cameras of a floor have recorded about equally long."""
    asked = {"floor": floor_id, "first": first, "last": last, "share": ALIKE_SHARE}
    return tuple(row["local_date"].toordinal() for row in warehouse.rows(_DAYS, asked))


def place_times(warehouse: Warehouse, floor_id: str, first: date, last: date) -> dict[str, PlaceTime]:
    """Return what the weekly figures know of each area, by id, and of the floor, by its id after a colon."""
    by_place: dict[str, list[dict[str, float]]] = defaultdict(list)
    for row in warehouse.rows(_AREAS, {"floor": floor_id, "first": first, "last": last}):
        by_place[floor_key(floor_id)].append(row)
        if row["area_id"] is not None:
            by_place[row["area_id"]].append(row)
    times = {}
    for place, rows in by_place.items():
        close_s, at_once = defaultdict[str, float](float), defaultdict[float, float](float)
        for row in rows:
            close_s[str(row["camera_id"])] += row["close_s"] or 0.0
            at_once[row["hour_start_ms"]] += (row["exposure_s"] or 0.0) / HOUR_S
        exposure_s = HOUR_S * sum(at_once.values())
        times[place] = PlaceTime(dict(close_s), exposure_s, max(at_once.values(), default=0.0))
    return times


def floor_key(floor_id: str) -> str:
    """Return the key of a whole floor among places: no area id has a colon."""
    return f"floor:{floor_id}"


def recorded_place(records: FloorRecords, inside: Bools, is_close: Bools) -> PlaceTime:
    """Return the same of any part of the floor, from its records.

    Args:
        records: The records.
        inside: Which lie in the place.
        is_close: Which are too close to somebody.
    """
    weight_s = records.weight_s * records.is_owned * inside
    by_camera = np.bincount(records.camera, weights=weight_s * is_close, minlength=len(records.camera_ids))
    hour = np.unique(records.t_s // HOUR_S, return_inverse=True)[1].ravel()
    at_once = np.bincount(hour, weights=weight_s) / HOUR_S if hour.size else np.zeros(1)
    close_s = dict(zip(records.camera_ids, by_camera.tolist(), strict=True))
    return PlaceTime(close_s, float(weight_s.sum()), float(at_once.max()))
