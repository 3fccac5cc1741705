"""What the marts say about one floor and one week, as arrays the statistics take: cameras x days, hours compared.

A camera-hour enters rates when it was recorded for at least `partial_hour_share` of its opening time; it enters a
comparison when that holds in both weeks.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from vsd_analytics.site import Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import Warehouse

Array = NDArray[np.float64]
WEEK = timedelta(days=7)
HOUR_OF_WEEK = ["camera_id", "weekday", "local_hour", "fold"]


@dataclass(frozen=True, slots=True)
class Panel:
    """Counts and what they are divided by, one row per camera, one column per day.

    Attributes:
        n: Violations, shape (n_cameras, n_days).
        x_h: Recorded open hours, same shape.
        exposure_h: Person-hours, same shape.
    """

    n: Array
    x_h: Array
    exposure_h: Array


class WeekData:
    """The marts of a floor around one week.

    Args:
        warehouse: Opened over the week and the weeks before it that are to be used.
        floor: The floor.
        monday: First day of the week.
    """

    def __init__(self, warehouse: Warehouse, *, floor: Floor, monday: date) -> None:
        self.warehouse, self.floor, self.monday = warehouse, floor, monday
        self.site: Site = warehouse.site
        self.cameras: Sequence[Camera] = [c for c in self.site.cameras if c.floor_id == floor.floor_id]
        self.ids = [c.camera_id for c in self.cameras]
        share = self.site.settings.partial_hour_share
        hours = warehouse.frame(
            "select * from camera_hours where floor_id = $floor order by hour_start_ms, camera_no",
            {"floor": floor.floor_id},
        )
        hours["local_date"] = pd.to_datetime(hours["local_date"]).dt.date
        hours["is_counted"] = (
            (hours["open_s"] > 0)
            & (hours["recorded_open_s"] >= share * hours["open_s"])
            & (hours["recorded_open_s"] > 0)
        )
        hours["x_h"] = hours["recorded_open_s"] / 3600
        hours["n"] = hours["n_violations_open"].astype("float64")
        hours["exposure_h"] = hours["exposure_open_s"].astype("float64") / 3600
        self.hours = hours
        self.areas = warehouse.frame("select * from area_hours where floor_id = $floor", {"floor": floor.floor_id})

    @property
    def sunday(self) -> date:
        """Return the last day of the week."""
        return self.monday + timedelta(days=6)

    def week(self, monday: date) -> pd.DataFrame:
        """Return the camera-hours of the week starting on `monday`."""
        return self.hours[(self.hours["local_date"] >= monday) & (self.hours["local_date"] < monday + WEEK)]

    @cached_property
    def current(self) -> pd.DataFrame:
        """Return the camera-hours of this week."""
        return self.week(self.monday)

    @cached_property
    def before(self) -> pd.DataFrame:
        """Return the camera-hours of the week before."""
        return self.week(self.monday - WEEK)

    def panel(self, hours: pd.DataFrame, days: Sequence[date]) -> Panel:
        """Return sums by camera and day over camera-hours that enter rates; what was not recorded is 0 hours."""
        counted = hours[hours["is_counted"]]
        sums = counted.groupby(["camera_id", "local_date"])[["n", "x_h", "exposure_h"]].sum()
        return Panel(*(self._grid(sums[column], days) for column in ("n", "x_h", "exposure_h")))

    def compared(
        self, area_id: str | None = None, *, is_floor: bool = True, since: int | None = None
    ) -> tuple[Panel, Panel]:
        """Return the panels of the week before and of this week over camera-hours that count in both.

        Args:
            area_id: Area; with `is_floor` False, None is the rest of the floor.
            is_floor: The whole floor, not an area.
            since: Only hours from this instant on (UTC milliseconds, in this week), and the same of the week before.
        """
        now = self.current if since is None else self.current[self.current["hour_start_ms"] >= since]
        matched = now[now["is_counted"]].merge(
            self.before[self.before["is_counted"]], on=HOUR_OF_WEEK, suffixes=("_now", "_then")
        )
        panels = []
        for side, monday in (("then", self.monday - WEEK), ("now", self.monday)):
            hours = matched[
                ["camera_id", *(f"{c}_{side}" for c in ("local_date", "hour_start_ms", "n", "x_h", "exposure_h"))]
            ]
            hours.columns = pd.Index(["camera_id", "local_date", "hour_start_ms", "n", "x_h", "exposure_h"])
            if not is_floor:
                hours = self.of_area(hours, area_id)
            days = [monday + timedelta(days=i) for i in range(7)]
            panels.append(self.panel(hours.assign(is_counted=True), days))
        return panels[0], panels[1]

    def of_area(self, hours: pd.DataFrame, area_id: str | None) -> pd.DataFrame:
        """Return camera-hours with counts and exposure of one area only, for the cameras that count anybody there."""
        own = self.areas[self.areas["area_id"].isna() if area_id is None else self.areas["area_id"] == area_id]
        hours = hours[hours["camera_id"].isin(own["camera_id"].unique())].drop(columns=["n", "exposure_h"])
        counted = pd.DataFrame(
            {
                "camera_id": own["camera_id"],
                "hour_start_ms": own["hour_start_ms"],
                "n": own["n_violations_open"].astype("float64"),
                "exposure_h": own["exposure_open_s"].astype("float64") / 3600,
            }
        )
        joined = hours.merge(counted, on=["camera_id", "hour_start_ms"], how="left")
        return joined.fillna({"n": 0.0, "exposure_h": 0.0})

    @cached_property
    def history_days(self) -> list[date]:
        """Return the days of the weeks before that were loaded and have recorded hours."""
        past = self.hours[(self.hours["local_date"] < self.monday) & self.hours["is_counted"]]
        return sorted(past["local_date"].unique())

    @cached_property
    def week_days(self) -> list[date]:
        """Return Monday to Sunday."""
        return [self.monday + timedelta(days=i) for i in range(7)]

    @cached_property
    def what_is_sent(self) -> Mapping[str, Any]:
        """Return what the floor's engines send this week: records with and without positions, ids, pairs."""
        first_ms, last_ms = self.current["hour_start_ms"].min(), self.current["hour_start_ms"].max() + 3_600_000
        row = self.warehouse.rows(
            "select (select coalesce(sum(person_records + n_doubled), 0)::bigint from exposure where camera_id in "
            "(select unnest($ids)) and quarter * 900000 >= $first and quarter * 900000 < $last) as n_persons, "
            "(select coalesce(sum(n_unlocated), 0)::bigint from exposure where camera_id in (select unnest($ids)) "
            "and quarter * 900000 >= $first and quarter * 900000 < $last) as n_unlocated, "
            "count(*) as n_pairs, count(*) filter (where track_a is null or track_b is null) as n_pairs_without_ids "
            "from pairs where camera_id in (select unnest($ids)) and ts_ms >= $first and ts_ms < $last",
            {"ids": self.ids, "first": int(first_ms), "last": int(last_ms)},
        )
        return row[0]

    def _grid(self, sums: pd.Series[float], days: Sequence[date]) -> Array:
        grid = sums.unstack("local_date") if len(sums) else pd.DataFrame()
        return grid.reindex(index=self.ids, columns=list(days)).fillna(0.0).to_numpy(dtype="float64")
