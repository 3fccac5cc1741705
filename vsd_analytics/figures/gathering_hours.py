"""Gatherings that began in each hour of the weeks so far, from which the chance of one next week is computed (M25)."""

from __future__ import annotations

from datetime import date, timedelta

import numpy as np

from vsd_analytics.figures.forecast import HISTORY_WEEKS
from vsd_analytics.figures.slots import Floats, load_slots
from vsd_analytics.stats.hour_of_week import recorded_hours
from vsd_analytics.warehouse.warehouse import Warehouse


def gathering_hours(warehouse: Warehouse, monday: date, *, floor_id: str) -> tuple[Floats, Floats]:
    """Return gatherings that began, and the open hours they were recorded in, for `analysis.forecast.forecast`.

    Cameras that were down are weighed as for violations (`stats.hour_of_week.recorded_hours`).

    Args:
        warehouse: Opened from `analysis.forecast.first_day(monday)`, or from wherever records begin.
        monday: First day of the last week.
        floor_id: The floor.

    Returns:
        Two arrays of shape (13, 168), the week from `monday` last.

    Raises:
        UsageError: E101, `monday` is no Monday, or the site has no such floor.
    """
    slots = load_slots(
        warehouse, monday, n_weeks=HISTORY_WEEKS + 1, floor_id=floor_id, there=(monday, monday + timedelta(days=6))
    )
    first = monday - timedelta(weeks=HISTORY_WEEKS)
    rows = warehouse.rows(
        "select g.camera_id, date_diff('day', $first, g.local_date)::bigint as day, h.local_hour::bigint as hour, "
        "count(*)::double as n from gatherings as g inner join camera_hours as h using (camera_id, hour_start_ms) "
        "where g.floor_id = $floor and g.is_owned and g.is_open and g.local_date between $first and $last group by all",
        {"floor": floor_id, "first": first, "last": monday + timedelta(days=6)},
    )
    counts = np.where(np.isnan(slots.n_violations), np.nan, 0.0)
    for row in rows:
        week, day = divmod(row["day"], 7)
        counts[slots.camera_ids.index(row["camera_id"]), week, 24 * day + row["hour"]] += row["n"]
    weeks = recorded_hours(counts, slots.recorded_h, slots.open_h, min_share=slots.min_share)
    return weeks.n, weeks.x_h
