"""What was recorded: coverage by camera and day, outages, last records, engines, the floor that is seen."""

from __future__ import annotations

from datetime import UTC, date, datetime, timedelta
from itertools import groupby

import pandas as pd
import shapely

from vsd_analytics import geometry
from vsd_analytics.duck import connect
from vsd_analytics.report.model import CameraDay, CameraRecord, Coverage, LogLine, Outage
from vsd_analytics.report.weekdata import WEEK, WeekData
from vsd_analytics.store import Store
from vsd_analytics.store.store import engines_of

DETECTED_MIN_H = 2.0
LOOK_BACK_H = 24 * 60


def coverage(data: WeekData) -> Coverage:
    """Return how much of the week's opening hours each camera recorded."""
    current = data.current
    last = last_records(data)
    cameras = []
    for i, camera in enumerate(data.cameras, start=1):
        own = current[current["camera_id"] == camera.camera_id]
        scheduled, recorded = float(own["open_s"].sum()) / 3600, float(own["recorded_open_s"].sum()) / 3600
        cameras.append(
            CameraRecord(
                camera_id=camera.camera_id,
                name=camera.name,
                label=f"C{i}",
                days=tuple(_camera_day(own[own["local_date"] == day], day) for day in data.week_days),
                scheduled_h=scheduled,
                recorded_h=recorded,
                share=recorded / scheduled if scheduled else None,
                last_record=last.get(camera.camera_id),
            )
        )
    scheduled_h, recorded_h = sum(c.scheduled_h for c in cameras), sum(c.recorded_h for c in cameras)
    seen = current[current["open_s"] > 0].groupby("hour_start_ms")["exposure_h"].sum()
    return Coverage(
        share=recorded_h / scheduled_h if scheduled_h else 0.0,
        recorded_h=recorded_h,
        scheduled_h=scheduled_h,
        open_h=scheduled_h / len(cameras) if cameras else 0.0,
        seen_h=float((seen > 0).sum()),
        cameras=tuple(cameras),
        outages=_outages(data),
        is_inferred=bool(current["is_inferred"].eq(True).any()),
    )


def last_records(data: WeekData) -> dict[str, datetime]:
    """Return the instant of each camera's last record up to the end of the week, looking back sixty days of records."""
    sunday = data.sunday + timedelta(days=1)
    end = int(datetime(sunday.year, sunday.month, sunday.day, tzinfo=data.site.zone).timestamp()) // 3600
    store = Store(data.site.root / "store", site_id=data.site.site_id)
    wanted, found = set(data.ids), dict[str, datetime]()
    by_hour: dict[int, list[str]] = {}
    for table in ("frames", "observations"):
        for part in store.parts(table, first_hour=end - LOOK_BACK_H, last_hour=end - 1):  # type: ignore[arg-type]
            by_hour.setdefault(part.hour, []).append(str(part.path))
    con = connect()
    for hour in sorted(by_hour, reverse=True):
        if not wanted:
            break
        rows = con.execute(
            "select camera_id, max(epoch_ms(ts)) from read_parquet($names, union_by_name = true) group by camera_id",
            {"names": by_hour[hour]},
        ).fetchall()
        for camera_id, ms in rows:
            if camera_id in wanted:
                found[camera_id] = datetime.fromtimestamp(ms / 1000, tz=UTC).astimezone(data.site.zone)
                wanted.discard(camera_id)
    con.close()
    return found


def engines(data: WeekData, monday: date) -> tuple[str, ...]:
    """Return the engines noted in the first part of each day of a week, sorted."""
    start = int(datetime(monday.year, monday.month, monday.day, tzinfo=data.site.zone).timestamp()) // 3600
    store = Store(data.site.root / "store", site_id=data.site.site_id)
    noted: set[str] = set()
    for table in ("frames", "observations", "pairs"):
        parts = store.parts(table, first_hour=start, last_hour=start + 24 * 7 - 1)  # type: ignore[arg-type]
        for _, day in groupby(parts, key=lambda p: p.hour // 24):
            noted.update(engines_of(next(iter(day)).path))
    return tuple(sorted(noted))


def seen_area_m2(data: WeekData) -> float | None:
    """Return the floor the cameras see, in square metres; None when what some camera sees is unknown."""
    bounds = geometry.plan_bounds(data.floor)
    if bounds is None:
        return None
    hidden = geometry.unseen(data.floor, cameras=data.cameras, bounds=bounds)
    return None if hidden is None else shapely.box(*bounds).area - sum(p.area for p in hidden)


def detected(data: WeekData, found: Coverage) -> list[LogLine]:
    """Return long outages as lines of the site's log."""
    names = {c.camera_id: c.name for c in data.cameras}
    lines = []
    for outage in found.outages:
        if outage.open_h < DETECTED_MIN_H or outage.is_inferred:
            continue
        who = (
            "All cameras"
            if len(outage.camera_ids) == len(names) > 1
            else ", ".join(names[c] for c in outage.camera_ids)
        )
        lines.append(
            LogLine(
                at=outage.start, text=f"{who}: no data until {outage.end:%a %H:%M}, cause not logged.", kind="detected"
            )
        )
    return lines


def local(data: WeekData, ms: int) -> datetime:
    """Return an instant (UTC milliseconds) in the site's zone."""
    return datetime.fromtimestamp(ms / 1000, tz=data.site.zone)


def _camera_day(hours: pd.DataFrame, day: date) -> CameraDay:
    scheduled, recorded = float(hours["open_s"].sum()) / 3600, float(hours["recorded_open_s"].sum()) / 3600
    shares: list[float | None] = [None] * 24
    for hour, group in hours.groupby("local_hour"):
        open_s = float(group["open_s"].sum())
        if open_s > 0:
            shares[int(hour)] = min(1.0, float(group["recorded_open_s"].sum()) / open_s)  # type: ignore[call-overload]
    return CameraDay(
        day=day,
        scheduled_h=scheduled,
        recorded_h=recorded,
        share=recorded / scheduled if scheduled else None,
        hourly_share=tuple(shares),
    )


def _outages(data: WeekData) -> tuple[Outage, ...]:
    start = datetime(data.monday.year, data.monday.month, data.monday.day, tzinfo=data.site.zone)
    first, last = (round(t.timestamp() * 1000) for t in (start, start + WEEK))
    rows = data.warehouse.rows(
        "select camera_id, started_ms, ended_ms, open_s, is_inferred from outages "
        "where camera_id in (select unnest($ids)) and ended_ms > $first and started_ms < $last order by started_ms, ended_ms, camera_no",
        {"ids": data.ids, "first": first, "last": last},
    )
    merged = []
    for (begin, end), group in groupby(rows, key=lambda r: (r["started_ms"], r["ended_ms"])):
        members = list(group)
        merged.append(
            Outage(
                camera_ids=tuple(m["camera_id"] for m in members),
                start=local(data, max(begin, first)),
                end=local(data, min(end, last)),
                open_h=max(m["open_s"] for m in members) / 3600,
                is_inferred=any(m["is_inferred"] for m in members),
            )
        )
    return tuple(merged)
