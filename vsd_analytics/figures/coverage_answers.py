"""What each camera recorded of the opening hours, as answers: shares, days, outages, lost messages, restarts."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import date, datetime, timedelta
from typing import Any, Final

from vsd_analytics.answer import Answer, Column, HoldsFor, Reason, Row, Value
from vsd_analytics.figures.camera_watch import WATCH, floor_watch, watch_notes, watch_rows
from vsd_analytics.figures.operator_counts import coverage
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.warehouse.warehouse import Warehouse

DAY: Final = timedelta(days=1)
CLOSED: Final = Reason("recorded.closed_then")
NOT_THERE: Final = Reason("camera.not_there")
_ANY_RECORDED: Final = "select 1 from camera_hours where recorded_s > 0 limit 1"
_HOURS: Final = (
    Column("recorded_share", "share", "share", "M1", per="scheduled_h"),
    Column("recorded_h", "fact", "h"),
    Column("scheduled_h", "fact", "h"),
)
CAMERAS: Final = (Column("camera_id", "key"), Column("name", "fact"), *_HOURS)
"""Columns of `recorded`."""
DAYS: Final = (Column("camera_id", "key"), Column("local_date", "key"), *_HOURS)
"""Columns of `recorded_days`."""
OUTAGES: Final = (
    Column("outage", "key"),
    Column("camera_id", "fact"),
    Column("start", "instant"),
    Column("end", "instant"),
    Column("open_h", "rate", "h", "M2"),
    Column("is_inferred", "fact"),
)
"""Columns of `camera_outages`."""
GAPS: Final = (
    Column("gap", "key"),
    Column("camera_id", "fact"),
    Column("start", "instant"),
    Column("end", "instant"),
    Column("n_missing", "number", "messages"),
    Column("first_missing", "fact"),
    Column("last_missing", "fact"),
)
"""Columns of `message_gaps`."""
RESTARTS: Final = (
    Column("restart", "key"),
    Column("camera_id", "fact"),
    Column("start", "instant"),
    Column("end", "instant"),
)
"""Columns of `restarts`."""


def coverage_answers(warehouse: Warehouse, *, until_ms: int | None = None) -> tuple[Answer, ...]:
    """Return how much of the opening time was recorded.

    `recorded`: by camera, and of all where `camera_id` is null; `recorded_days`: by camera and day; `camera_outages`:
    open hours without data; `message_gaps`: messages that never arrived or are in quarantine, by the engine's running
    numbers, from the last message before to the first after; `restarts` of its count, around which losses are unknown;
    `camera_watch`: which cameras lose or gain people beside their neighbours, in the half-year up to the last Sunday.

    Args:
        warehouse: The range.
        until_ms: Hours from this UTC instant on are not over: neither recorded nor missing.
    """
    recording = coverage(warehouse, until_ms=until_ms)
    site = warehouse.site
    until = None if until_ms is None else datetime.fromtimestamp(until_ms / 1000, site.zone)
    holds = HoldsFor(
        *(site.site_id, None, warehouse.first, warehouse.last, until),
        settings=site.settings.settings_id(),
        inputs=warehouse.inputs_digest,
    )
    cameras = recording["cameras"]
    whole = {name: sum(c[name] for c in cameras) for name in ("recorded_h", "scheduled_h")}
    of_all: Row = {
        "camera_id": None,
        "name": site.name,
        **_hours({**whole, "share": recording["share"]}, None, warehouse.first, warehouse.last),
    }
    days: list[Row] = [
        {"camera_id": c["camera_id"], "local_date": day, **_hours(d, site.camera(c["camera_id"]), day, day)}
        for c in cameras
        for d in c["days"]
        for day in (date.fromisoformat(d["date"]),)
    ]
    restarts = tuple(_stretch("restart", k, r) for k, r in enumerate(recording["restarts"], 1))
    return (
        Answer("recorded", CAMERAS, (*(_camera(c, warehouse) for c in cameras), of_all), holds),
        Answer("recorded_days", DAYS, tuple(days), holds),
        Answer(
            "camera_outages",
            OUTAGES,
            tuple(
                {**_stretch("outage", k, o), "open_h": Value(o["open_h"]), "is_inferred": o["is_inferred"]}
                for k, o in enumerate(recording["outages"], 1)
            ),
            holds,
        ),
        _gaps(recording, holds, is_recorded=bool(warehouse.rows(_ANY_RECORDED))),
        Answer("restarts", RESTARTS, restarts, holds),
        _watched(site, warehouse.last if until is None else min(warehouse.last, until.date() - DAY), holds),
    )


def _watched(site: Site, last: date, holds: HoldsFor) -> Answer:
    """Return the watch on the cameras up to the last Sunday."""
    sunday = last - (last.weekday() + 1) % 7 * DAY
    rows: list[Row] = []
    notes: list[tuple[int | None, Reason]] = []
    for floor in site.floors:
        watches = floor_watch(site, floor, sunday)
        notes += [(len(rows) + k, why) for k, why in watch_notes(watches) if k is not None]
        rows += [{"floor_id": floor.floor_id, **row} for row in watch_rows(watches)]
    return Answer("camera_watch", (Column("floor_id", "key"), *WATCH), tuple(rows), holds, notes=tuple(notes))


def _gaps(recording: Mapping[str, Any], holds: HoldsFor, *, is_recorded: bool) -> Answer:
    if not is_recorded:
        return Answer("message_gaps", GAPS, (), holds, nothing=Reason("recorded.nothing"), state="not_enough_data")
    if recording["n_missing"] is None:
        why = Reason("engine.no_numbers")
        return Answer("message_gaps", GAPS, (), holds, nothing=why, state="not_measurable")
    rows = tuple(
        {
            **_stretch("gap", k, gap),
            "n_missing": Value(gap["n_missing"]),
            "first_missing": gap["first_missing"],
            "last_missing": gap["last_missing"],
        }
        for k, gap in enumerate(recording["gaps"], 1)
    )
    return Answer("message_gaps", GAPS, rows, holds)


def _camera(camera: Mapping[str, Any], warehouse: Warehouse) -> Row:
    described = warehouse.site.camera(camera["camera_id"])
    hours = _hours(camera, described, warehouse.first, warehouse.last)
    return {"camera_id": camera["camera_id"], "name": camera["name"], **hours}


def _hours(recorded_time: Mapping[str, Any], camera: Camera | None, first: date, last: date) -> Row:
    is_there = camera is None or camera.is_there(first, last)
    share = (
        Value.missing(CLOSED if is_there else NOT_THERE)
        if recorded_time["share"] is None
        else Value(recorded_time["share"])
    )
    return {
        "recorded_share": share,
        "recorded_h": recorded_time["recorded_h"],
        "scheduled_h": recorded_time["scheduled_h"],
    }


def _stretch(what: str, number: int, span: Mapping[str, Any]) -> Row:
    start, end = (datetime.fromisoformat(span[name]) for name in ("start", "end"))
    return {what: number, "camera_id": span["camera_id"], "start": start, "end": end}
