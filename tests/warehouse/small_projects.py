"""Small projects for tests of the warehouse: a site in a folder, and records put straight into its store."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any
from unittest import mock

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.schema import SCHEMAS, TableName
from vsd_analytics.settings import Settings
from vsd_analytics.site.model import Camera, Floor, Site
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse import build as build_module
from vsd_analytics.warehouse import units
from vsd_analytics.warehouse.build_result import BuildResult
from vsd_analytics.warehouse.factfiles import by_hour, noted_inputs
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.warehouse import Warehouse

HOUR = 3_600_000
DAY = 24 * HOUR


FACTS_OF_AREAS = ["area_counts", "area_stays", "area_tracks", "track_ends", "walk_cells"]
ASKED_FACTS = [*FACTS_OF_AREAS, "joined_tracks", "line_crossings", "staff_tags"]
FACTS_WITHOUT_AREAS = [r.name for r in relations("facts").values() if r.unit == "hour" and r.name not in ASKED_FACTS]
"""Hourly facts that have files where vsd.toml draws no area and no line, joins no views and names no class of staff."""


def at(text: str) -> int:
    """Return the UTC milliseconds of "2026-11-09 08:00:00"."""
    return round(datetime.fromisoformat(text).replace(tzinfo=UTC).timestamp() * 1000)


T0 = at("2026-11-09 08:00")  # a Monday


@dataclass(frozen=True)
class Person:
    """A person record; floor millimetres or pixels."""

    ts: int
    track: str | None = None
    x: int | None = None
    y: int | None = None
    camera: str = "cam"
    u: float | None = None
    v: float | None = None
    is_staff: bool | None = None


@dataclass(frozen=True)
class Pair:
    """A pair record as an engine sends it."""

    ts: int
    a: str | None
    b: str | None
    mm: int
    camera: str = "cam"
    xy: tuple[int | None, int | None, int | None, int | None] = (None, None, None, None)
    persons: tuple[int, int] = (0, 1)


@dataclass(frozen=True)
class Frame:
    """A heartbeat."""

    ts: int
    camera: str = "cam"
    n_persons: int | None = 0
    n_pairs: int | None = None
    seq: int | None = None


def make_site(
    root: Path,
    *,
    timezone: str = "UTC",
    cameras: Sequence[Camera] | None = None,
    opening: Any = None,
    closed: Iterable[date] = (),
    **settings: Any,
) -> Site:
    """Return a site with one floor, cameras at 1 Hz unless `cameras` says otherwise."""
    return Site(
        "shop",
        "Shop",
        timezone,
        root,
        opening=opening,
        closed=frozenset(closed),
        floors=(Floor("ground", "Ground"),),
        cameras=(Camera("cam", "Cam", "ground", hz=1.0),) if cameras is None else tuple(cameras),
        settings=Settings().with_values(settings),
    )


def put(site: Site, records: Iterable[Person | Pair | Frame], *, fold: bool = True) -> None:
    """Append records to the site's store as one delivery, and fold."""
    persons: list[tuple[Any, ...]] = []
    pairs: list[tuple[Any, ...]] = []
    frames: list[tuple[Any, ...]] = []
    for i, r in enumerate(records):
        if isinstance(r, Person):
            persons.append((r.camera, r.ts, i, r.track, r.x, r.y, r.u, r.v, "metric", r.is_staff))
        elif isinstance(r, Pair):
            pairs.append((r.camera, r.ts, *r.persons, r.a, r.b, *r.xy, r.mm, None, "metric"))
        else:
            frames.append((r.camera, r.ts, r.n_persons, r.n_pairs, r.seq))
    store = Store(site.root / "store", site_id=site.site_id)
    for name, rows in (("observations", persons), ("pairs", pairs), ("frames", frames)):
        store.append(name, table(name, rows))  # type: ignore[arg-type]
    if fold:
        store.fold()


def table(name: TableName, rows: list[tuple[Any, ...]]) -> pa.Table:
    schema = SCHEMAS[name]
    columns = list(zip(*rows, strict=True)) if rows else [()] * len(schema)
    arrays = [
        pa.array(c, pa.int64()).cast(f.type) if f.name == "ts" else pa.array(c, f.type)
        for c, f in zip(columns, schema, strict=True)
    ]
    return pa.table(arrays, schema=schema)


def beats(first: int, after: int, *, every: int = 1000, camera: str = "cam") -> list[Frame]:
    """Return heartbeats of [first, after)."""
    return [Frame(ts, camera) for ts in range(first, after, every)]


def open_days(site: Site, first: str = "2026-11-09", last: str | None = None, **options: Any) -> Warehouse:
    """Return a warehouse of some days, one day by default. It writes no files of marts: most tests ask it once."""
    days = date.fromisoformat(first), date.fromisoformat(last or first)
    return Warehouse(site, *days, **{"uses_days": False} | options)


def fact_files(site: Site) -> dict[str, bytes]:
    """Return name and bytes of every fact file of an hour or UTC day, without what days keep of them."""
    root = site.root / "facts"
    paths = [p for p in sorted(root.rglob("*.parquet")) if p.relative_to(root).parts[0] not in ("days", "weeks")]
    return {str(p.relative_to(root)): p.read_bytes() for p in paths}


def fact_hours(site: Site) -> dict[tuple[str, int], tuple[list[dict[str, Any]], dict[str, str]]]:
    """Return rows and input hashes of every hourly fact by fact and UTC hour number."""
    found = {}
    for name in (r.name for r in relations("facts").values() if r.unit == "hour"):
        for path in (site.root / "facts" / name).rglob("*.parquet"):
            day = (date.fromisoformat(path.parent.name.removeprefix("date=")) - date(1970, 1, 1)).days
            rows: list[dict[str, Any]] = pq.ParquetFile(path).read().to_pylist()
            for hour, inputs in by_hour(noted_inputs(path.read_bytes()), day * 24).items():
                found[name, hour] = ([row for row in rows if row["hour"] == hour], inputs)
    return found


def build_hour_by_hour(site: Site) -> BuildResult:
    """Build, computing each hour for itself, as a build does with hours of very many records."""
    with mock.patch.multiple(units, BATCH_HOURS=1, QUIET_HOURS=1):
        return build_module.build(site)


def day_after(day: str) -> str:
    return (date.fromisoformat(day) + timedelta(days=1)).isoformat()
