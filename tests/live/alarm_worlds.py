"""Small scripted worlds for alarms: people who stand, walk and join, as messages and as stored tables."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from simulate.small_scenes import START_MS, Message, frame_message, make_empty

from vsd_analytics.ingest.formats.frames import MessageRows
from vsd_analytics.ingest.intake.normalise import Normaliser
from vsd_analytics.ingest.reading.adapter import IngestOptions
from vsd_analytics.live.alarms import AlarmEngine
from vsd_analytics.live.events import AlarmEvent
from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import AlarmRule, Area, Camera, Floor, Point, Site

NOW = datetime(2026, 11, 20, tzinfo=UTC)
QUEUE = Area("queue", "Queue", "ground", ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)))
GATHERING = AlarmRule("crowd", "gathering", for_s=60.0, area_id="queue", n_people=4)
CONTACT = AlarmRule("close", "contact", for_s=30.0)
SILENCE = AlarmRule("dead", "silence", for_s=60.0)
WEEKDAYS = (((480, 1260),),) * 5 + ((), ())
"""Monday to Friday, 8:00 to 21:00."""


def make_site(*rules: AlarmRule, root: Path = Path("/nowhere"), **changes: Any) -> Site:
    given: dict[str, Any] = {
        "floors": (Floor("ground", "Ground"),),
        "cameras": (Camera("cam-1", "One", "ground"), Camera("cam-2", "Two", "ground")),
        "areas": (QUEUE,),
        "settings": Settings().with_values({"pseudonyms": False}),
        "alarms": rules,
        **changes,
    }
    return Site("shop", "Shop", "UTC", root, **given)


def stand(
    places: Sequence[Point], duration_s: float, *, start_s: float = 0, interval_s: float = 1.0, first_id: int = 1
) -> list[Message]:
    """Return frames of people who stand still from `start_s` after START_MS on; both ends are sent."""
    return walk([(p, p) for p in places], duration_s, start_s=start_s, interval_s=interval_s, first_id=first_id)


def walk(
    ways: Sequence[tuple[Point, Point]],
    duration_s: float,
    *,
    start_s: float = 0,
    interval_s: float = 1.0,
    first_id: int = 1,
) -> list[Message]:
    """Return frames of people who walk straight at constant speed."""
    messages = []
    for t in np.arange(0, duration_s + interval_s / 2, interval_s).tolist():
        share = t / duration_s
        persons = [
            {"id": str(first_id + k), "x_m": a[0] + (b[0] - a[0]) * share, "y_m": a[1] + (b[1] - a[1]) * share}
            for k, (a, b) in enumerate(ways)
        ]
        messages.append(frame("cam-1", START_MS + round((start_s + t) * 1000), persons))
    return messages


def frame(camera: str, ts_ms: int, persons: Sequence[Mapping[str, Any]], **more: Any) -> Message:
    return {**frame_message(camera, ts_ms, list(persons)), **more}


def row(n: int, *, x: float = 3.0, y: float = 3.0, apart: float = 1.0) -> list[Point]:
    """Return the places of n people in a row."""
    return [(x + apart * k, y) for k in range(n)]


def quiet(duration_s: float, *, start_s: float = 0, camera: str = "cam-1", interval_s: float = 1.0) -> list[Message]:
    return make_empty(duration_s, start_ms=START_MS + round(start_s * 1000), camera=camera, interval_s=interval_s)


def tables_of(site: Site, messages: Iterable[Message]) -> dict[TableName, pa.Table]:
    """Return messages in stored form, as ingestion makes it."""
    rows = MessageRows(IngestOptions())
    for number, message in enumerate(messages):
        rows.add(number, json.dumps(message).encode())
    ready = Normaliser(site, now=NOW, keys=None).normalise(rows.batch(0))
    assert not ready.rejected
    return {t: ready.tables.get(t, SCHEMAS[t].empty_table()) for t in TABLES}


def run(site: Site, messages: Sequence[Message], *, until_s: float | None = None) -> list[AlarmEvent]:
    """Return the events of messages fed at once, with `until_s` after START_MS as the end."""
    engine = AlarmEngine(site)
    events = engine.feed(tables_of(site, messages))
    return events + engine.close(None if until_s is None else at(until_s))


def at(seconds: float) -> datetime:
    return datetime.fromtimestamp(START_MS / 1000 + seconds, tz=UTC)


def told(events: Iterable[AlarmEvent]) -> list[tuple[str, float]]:
    """Return each event as (step, seconds after START_MS)."""
    return [(e.event, (e.at_ms - START_MS) / 1000) for e in events]
