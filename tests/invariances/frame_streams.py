"""Streams of frame messages as a listener gets them: a clean one, and what networks and clocks make of it."""

from __future__ import annotations

import io
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow.parquet as pq

from vsd_analytics.live.batches import ReceivedMessage
from vsd_analytics.live.decode import Preparer
from vsd_analytics.schema import TABLES
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.build_result import BuildResult

EVERY_S = 5
MINUTE = timedelta(minutes=1)


@dataclass(frozen=True)
class Message:
    """A message, and when it arrives."""

    arrives: datetime
    payload: bytes


def site(root: Path, zone: str) -> Site:
    """Return a site of two cameras, with pseudonyms as in any shop."""
    cameras = tuple(Camera(c, c, "ground") for c in ("cam-1", "cam-2"))
    return Site("shop", "Shop", zone, root, floors=(Floor("ground", "Ground"),), cameras=cameras)


def frames(start: datetime, *, hours: float, seed: int = 0) -> list[dict[str, Any]]:
    """Return what two cameras send: four people each that wander and change their ids, one without an id."""
    rng = np.random.default_rng(seed)
    sent = []
    for camera in ("cam-1", "cam-2"):
        place = rng.uniform(0, 5, size=(4, 2))
        ids = [f"{camera}-{i}" for i in range(4)]
        for step in range(round(hours * 3600 / EVERY_S)):
            at = start + timedelta(seconds=step * EVERY_S, milliseconds=137 if camera == "cam-2" else 0)
            place = np.clip(place + rng.normal(0, 0.3, size=place.shape), 0, 5)
            if rng.random() < 0.02:
                ids[int(rng.integers(4))] = f"{camera}-{step}"
            seen = [i for i in range(4) if rng.random() < 0.8]
            persons: list[dict[str, Any]] = [
                {"id": ids[i], "x_m": round(float(place[i, 0]), 3), "y_m": round(float(place[i, 1]), 3)} for i in seen
            ]
            if rng.random() < 0.1:
                persons.append({"x_m": 2.5, "y_m": round(float(rng.uniform(0, 5)), 3)})
            sent.append({"v": 1, "camera": camera, "ts": at, "seq": step, "engine": "acme 1.0", "persons": persons})
    return sorted(sent, key=lambda m: m["ts"])


def message(frame: dict[str, Any], *, arrives: datetime, zone: ZoneInfo | None = None) -> Message:
    """Return a frame as it is sent, its time in UTC or in a local zone with its offset."""
    ts = frame["ts"].astimezone(zone or UTC)
    return Message(arrives, json.dumps({**frame, "ts": ts.isoformat(timespec="milliseconds")}).encode())


def clean(sent: Iterable[dict[str, Any]]) -> list[Message]:
    """Return the stream that arrives at once and in order."""
    return [message(frame, arrives=frame["ts"]) for frame in sent]


def disturbed(sent: Sequence[dict[str, Any]], *, zone: ZoneInfo, seed: int) -> list[Message]:
    """Return the stream as it arrives: shuffled within ten minutes, 20 % twice, 3 % hours late, in local times."""
    rng = np.random.default_rng(seed)
    arriving = []
    for frame in sent:
        delay = MINUTE * rng.uniform(0, 10)
        if rng.random() < 0.03:
            delay = timedelta(hours=rng.uniform(1.2, 2.5))
        copies = [delay] + ([delay + MINUTE * rng.uniform(0, 150)] if rng.random() < 0.2 else [])
        arriving += [message(frame, arrives=frame["ts"] + d, zone=zone) for d in copies]
    return sorted(arriving, key=lambda m: m.arrives)


def deliver(
    site: Site, stream: Sequence[Message], *, every: timedelta | None
) -> tuple[Counter[str], list[BuildResult]]:
    """Store a stream as the listener does, fold and build; return quarantined records by reason, and the builds.

    Args:
        site: The project.
        stream: In the order of arrival.
        every: Fold and build this often; None = once, at the end.
    """
    preparer = Preparer(site, now=stream[0].arrives)
    store = Store(site.root / "store", site_id=site.site_id)
    rejected: Counter[str] = Counter()
    builds = []
    due = stream[0].arrives + (every or timedelta(days=999))
    batch: list[Message] = []

    def put() -> None:
        prepared = preparer.prepare(
            [ReceivedMessage("vsd/x/frames", m.payload, len(m.payload)) for m in batch], now=batch[-1].arrives
        )
        for table in reversed(TABLES):
            if table in prepared.tables:
                store.append(table, prepared.tables[table], engines=prepared.engines)
        rejected.update(r.reason for r in prepared.rejected)
        batch.clear()

    for m in stream:
        if batch and (len(batch) >= 2000 or m.arrives >= due or m.arrives > batch[0].arrives + 12 * MINUTE):
            put()
        if m.arrives >= due:
            store.fold()
            builds.append(build(site))
            due += every or timedelta(days=999)
        batch.append(m)
    put()
    store.fold()
    builds.append(build(site))
    return rejected, builds


def fact_rows(site: Site) -> dict[str, bytes]:
    """Return every fact file of an hour or UTC day, by name, as the bytes of a Parquet file of its rows alone.

    What a file notes besides (its fingerprint and the hashes of the parts it was computed from) is left out: the same
    records in other parts have other hashes.
    """
    found = {}
    for path in _computed(site, "facts"):
        bare = io.BytesIO()
        pq.write_table(pq.ParquetFile(path).read().replace_schema_metadata(None), bare)
        found[str(path.relative_to(site.root / "facts")).rpartition("-")[0]] = bare.getvalue()
    return found


def files(site: Site, folder: str) -> dict[str, bytes]:
    """Return every Parquet file below a folder of the project, by name."""
    return {str(p.relative_to(site.root)): p.read_bytes() for p in _computed(site, folder)}


def _computed(site: Site, folder: str) -> list[Path]:
    """Return every Parquet file below a folder of the project, without the rows stored by day."""
    root = site.root / folder
    return [p for p in sorted(root.rglob("*.parquet")) if p.relative_to(root).parts[0] != "days"]
