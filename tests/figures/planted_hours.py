"""A site of two cameras whose hours a test makes: violations 20 and 10 an hour, 6 and 3 people in view."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from planted_marts import plant

from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.warehouse.warehouse import Warehouse

MONDAY = date(2026, 11, 9)
OPENING = ((540, 720),) * 6 + ((600, 630),)  # 9 to 12, on Sunday half an hour from 10
Change = Callable[[pd.DataFrame], None]


def site_of(root: Path, *, opening: Any = tuple((o,) for o in OPENING), **options: Any) -> Site:
    cameras = (Camera("cam-1", "One", "ground"), Camera("cam-2", "Two", "upper"))
    floors = (Floor("ground", "Ground"), Floor("upper", "Upper"))
    return Site("shop", "Shop", "Europe/Rome", root, opening=opening, floors=floors, cameras=cameras, **options)


@contextmanager
def planted(
    site: Site, change: Change | None = None, *, n_weeks: int = 13, monday: date = MONDAY
) -> Iterator[Warehouse]:
    """Open a warehouse whose camera-hours are made: violations 20 and 10 an hour, 6 and 3 people in view."""
    first = monday - timedelta(weeks=n_weeks - 1)
    rng = np.random.default_rng(7)
    with Warehouse(site, first, monday + timedelta(days=6)) as warehouse:
        hours = warehouse.frame(
            "select cameras.camera_id, cameras.camera_no, cameras.floor_id, hour_start_ms, "
            "min(local_date) as local_date, min(local_hour) as local_hour, min(fold) as fold, "
            "min(weekday) as weekday, count(*) * 900 as length_s, "
            "count(*) filter (where is_open) * 900 as open_s from calendar cross join cameras group by all "
            "order by hour_start_ms, camera_no"
        )
        busy = np.where(hours["camera_no"] == 0, 2.0, 1.0) * hours["open_s"] / 3600
        hours["recorded_s"] = hours["recorded_open_s"] = hours["open_s"].astype(float)
        hours["is_inferred"] = False
        hours["n_violations_open"] = rng.poisson(10 * busy).astype(float)
        hours["exposure_open_s"] = 3600 * 3 * busy
        if change is not None:
            change(hours)
        is_missing = hours["recorded_open_s"] == 0
        hours.loc[is_missing, ["n_violations_open", "exposure_open_s"]] = np.nan
        plant(warehouse, "camera_hours", hours)
        warehouse.keep = lambda *marts: None  # type: ignore[method-assign]
        yield warehouse


def of(
    hours: pd.DataFrame, *, day: date | None = None, hour: int | None = None, camera: str | None = None
) -> pd.Series:
    chosen = pd.Series(data=True, index=hours.index)
    for column, value in (("local_date", day), ("local_hour", hour), ("camera_id", camera)):
        if value is not None:
            chosen &= hours[column].astype(str) == str(value)
    return chosen
