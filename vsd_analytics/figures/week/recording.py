"""What was recorded: coverage by camera and day, outages, the floor that is seen."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from itertools import groupby

import numpy as np
import shapely

from vsd_analytics.figures.camera_watch import CameraWatch
from vsd_analytics.figures.panels import Ints
from vsd_analytics.figures.week.changes import not_compared
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_recording import CameraDay, CameraRecord, Coverage, Outage
from vsd_analytics.geometry import camera_views
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.warehouse.provenance import last_records


def coverage(data: WeekData, watched: Sequence[CameraWatch] = ()) -> Coverage:
    """Return how much of the week's opening hours each camera recorded; hours that are not over are not among them.

    Args:
        data: The week.
        watched: What became of the cameras beside their neighbours.
    """
    moved = {c.camera_id: c.reason for c in watched if c.is_moved}
    now = np.flatnonzero(data.week_so_far())
    last = last_records(data.site, data.ids, until=data.sunday)
    left_out = not_compared(data)
    missing, gaps = _messages(data)
    cameras = []
    for i, camera in enumerate(data.cameras):
        if camera not in data.present:
            continue
        days = tuple(_camera_day(data, i, day, now[data.hours.day[now] == day.toordinal()]) for day in data.week_days)
        scheduled, recorded = sum(d.scheduled_h for d in days), sum(d.recorded_h for d in days)
        cameras.append(
            CameraRecord(
                camera_id=camera.camera_id,
                name=camera.name,
                label=f"C{i + 1}",
                days=days,
                scheduled_h=scheduled,
                recorded_h=recorded,
                share=recorded / scheduled if scheduled else None,
                is_silent=scheduled > 0 and not data.hours.is_counted[i, now].any(),
                last_record=last.get(camera.camera_id),
                not_counted=data.not_counted.get(camera.camera_id),
                not_compared=left_out.get(camera.camera_id),
                moved=moved.get(camera.camera_id),
            )
        )
    scheduled_h, recorded_h = sum(c.scheduled_h for c in cameras), sum(c.recorded_h for c in cameras)
    seen = data.everyone.exposure_h[:, now].sum(axis=0) > 0
    return Coverage(
        share=recorded_h / scheduled_h if scheduled_h else 0.0,
        recorded_h=recorded_h,
        scheduled_h=scheduled_h,
        not_over_from=None if data.not_over_ms is None else data.local(data.not_over_ms),
        open_h=float(data.hours.open_s[now].sum()) / 3600,
        seen_h=None if data.why_no_exposure else float(seen.sum()),
        cameras=tuple(cameras),
        outages=_outages(data),
        is_inferred=bool(data.hours.is_inferred[:, now].any()),
        missing_messages=missing,
        message_gaps=gaps,
    )


def seen_area_m2(data: WeekData) -> float | None:
    """Return the floor the cameras see, in square metres; None when what some camera sees is unknown."""
    bounds = camera_views.plan_bounds(data.floor)
    if bounds is None:
        return None
    hidden = camera_views.unseen(data.floor, cameras=data.present, bounds=bounds)
    return None if hidden is None else float(shapely.box(*bounds).area - sum(p.area for p in hidden))


def _camera_day(data: WeekData, camera: int, day: date, chosen: Ints) -> CameraDay:
    open_s, recorded_s = data.hours.scheduled_s[camera, chosen], data.hours.recorded_s[camera, chosen]
    shares: list[float | None] = [None] * 24
    for hour in range(24):
        same = data.hours.hour[chosen] == hour
        if (total := float(open_s[same].sum())) > 0:
            shares[hour] = min(1.0, float(recorded_s[same].sum()) / total)
    scheduled_h, recorded_h = float(open_s.sum()) / 3600, float(recorded_s.sum()) / 3600
    return CameraDay(
        day=day,
        scheduled_h=scheduled_h,
        recorded_h=recorded_h,
        share=recorded_h / scheduled_h if scheduled_h else None,
        hourly_share=tuple(shares),
    )


def _messages(data: WeekData) -> tuple[int | None, int]:
    """Return how many messages of the week are missing, None when no engine numbers them, and in how many gaps."""
    first, last = (round(data.midnight(day).timestamp() * 1000) for day in (data.monday, data.monday + data.span))
    values = {"ids": data.ids, "first": first, "last": last}
    numbered = data.warehouse.rows(
        "select 1 from sequence_runs where list_contains($ids::varchar[], camera_id) "
        "and last_ms >= $first and first_ms < $last limit 1",
        values,
    )
    row = data.warehouse.rows(
        "select sum(n_missing)::bigint as n, count(*) as n_gaps from message_gaps "
        "where list_contains($ids::varchar[], camera_id) and not is_restart "
        "and ended_ms >= $first and started_ms < $last",
        values,
    )[0]
    return (row["n"] or 0 if numbered else None), row["n_gaps"]


def _outages(data: WeekData) -> tuple[Outage, ...]:
    first, last = (round(data.midnight(day).timestamp() * 1000) for day in (data.monday, data.monday + data.span))
    [opening] = data.warehouse.rows(
        "select min(quarter) * 900000 as first, (max(quarter) + 1) * 900000 as last from calendar "
        "where is_open and quarter * 900000 >= $first and quarter * 900000 < $last",
        {"first": first, "last": last},
    )
    if opening["first"] is None:
        return ()
    first, last = opening["first"], opening["last"]  # what came before the week's opening is no missed time of it
    if data.not_over_ms is not None:
        last = min(last, data.not_over_ms)
    rows = data.warehouse.rows(
        "select camera_id, started_ms, ended_ms, open_s, is_inferred from outages "
        "where list_contains($ids::varchar[], camera_id) and ended_ms > $first and started_ms < $last "
        "order by started_ms, ended_ms, camera_no",
        {"ids": data.ids, "first": first, "last": last},
    )
    cut = [(max(r["started_ms"], first), min(r["ended_ms"], last), r) for r in rows]
    merged = []
    for (begin, end), group in groupby(sorted(cut, key=lambda c: c[:2]), key=lambda c: c[:2]):
        members = [r for _, _, r in group]
        is_whole = all((m["started_ms"], m["ended_ms"]) == (begin, end) for m in members)
        merged.append(
            Outage(
                camera_ids=tuple(m["camera_id"] for m in members),
                start=data.local(begin),
                end=data.local(end),
                open_h=max(m["open_s"] for m in members) / 3600 if is_whole else _open_h(data, begin, end),
                is_inferred=any(m["is_inferred"] for m in members),
            )
        )
    return tuple(merged)


def _open_h(data: WeekData, begin_ms: int, end_ms: int) -> float:
    """Return the opening hours between two instants, opening time spread evenly over its local hour."""
    start_ms = data.hours.start_ms
    overlap_ms = np.minimum(start_ms + HOUR_MS, end_ms) - np.maximum(start_ms, begin_ms)
    return float((np.clip(overlap_ms, 0, None) / HOUR_MS * data.hours.open_s).sum()) / 3600
