"""What was recorded on some days, as a notebook shows it."""

from __future__ import annotations

from collections import defaultdict
from datetime import date

from vsd_analytics.api.notebook_html import days_html
from vsd_analytics.figures.operator_counts import n_violations_in, recorded_hours
from vsd_analytics.figures.week.model_recording import CameraDay
from vsd_analytics.warehouse.warehouse import Warehouse
from vsd_analytics.wording import format as fmt

DAYS_SHOWN = 14


def recorded_html(warehouse: Warehouse, *, title: str) -> str:
    """Return strips of recorded hours by camera and day, of the first 14 days.

    Args:
        warehouse: The days.
        title: Site and days, in words.
    """
    hours: dict[tuple[str, date], dict[int, tuple[float, float]]] = defaultdict(dict)
    for row in recorded_hours(warehouse):
        hours[row["camera_id"], row["local_date"]][row["local_hour"]] = (row["open_s"], row["recorded_s"])
    days = sorted({day for _, day in hours})
    cameras = {
        c.name: [_day(day, hours[c.camera_id, day]) for day in days[:DAYS_SHOWN]] for c in warehouse.site.cameras
    }
    open_hours = [h for of_day in hours.values() for h, (open_s, _) in of_day.items() if open_s > 0] or [0, 23]
    scheduled_h, recorded_h = (
        sum(pair[k] for of_day in hours.values() for pair in of_day.values()) / 3600 for k in (0, 1)
    )
    share = fmt.percent(recorded_h / scheduled_h if scheduled_h else None)
    summary = f"{fmt.count(n_violations_in(warehouse))} violations; {share} of the open camera-hours recorded"
    if len(days) > DAYS_SHOWN:
        summary += f"; the first {DAYS_SHOWN} of {len(days):,} days are drawn"
    return days_html(
        title=title, summary=summary, cameras=cameras, first_hour=min(open_hours), last_hour=max(open_hours)
    )


def _day(day: date, hours: dict[int, tuple[float, float]]) -> CameraDay:
    """Return a camera's day; its hours add up to the open and recorded seconds of `hours`."""
    shares = [None if not hours.get(h, (0.0, 0.0))[0] else min(1.0, hours[h][1] / hours[h][0]) for h in range(24)]
    open_s, recorded_s = (sum(pair[k] for pair in hours.values()) for k in (0, 1))
    return CameraDay(
        day=day,
        scheduled_h=open_s / 3600,
        recorded_h=recorded_s / 3600,
        share=recorded_s / open_s if open_s else None,
        hourly_share=tuple(shares),
    )
