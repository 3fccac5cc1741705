"""Where the records of a range came from: their engines, and each camera's last record."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from datetime import UTC, date, datetime, timedelta
from itertools import groupby
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.schema import TABLES
from vsd_analytics.site.model import Site
from vsd_analytics.store.layout import Part
from vsd_analytics.store.part_files import engines_of
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.sealed import sealed_range

MADE_UP_ENGINE = "vsd-demo "
"""What the simulator of `vsd demo` calls itself."""
LOOK_BACK = timedelta(days=60)
"""How far back `last_records` searches. A camera silent for longer is reported as without records."""


def engines(site: Site, first: date, last: date) -> tuple[str, ...]:
    """Return the names of the engines that sent the records of a range of local days, sorted.

    Reads only the first and last part of each UTC day: an engine that was replaced within a day shows in one of them.

    Raises:
        StoreError: E302, a part is damaged.
    """
    noted: set[str] = set()
    hours = _hours(site, first, last)
    sealed = sealed_range(site, *hours).hours
    store = _store(site)
    with store.reporting_damage():
        for table, table_parts in _parts(store, hours).items():
            ordered: list[tuple[int, Path | tuple[str, ...]]] = [
                (p.hour, p.path) for p in table_parts if p.hour not in sealed
            ]
            ordered += [(h, names) for h, unit in sealed.items() for names in unit.engines.get(table, ())]
            ordered.sort(key=lambda part: part[0])
            for _, day in groupby(ordered, key=lambda part: part[0] // 24):
                parts = [part for _, part in day]
                for part in (parts[0], parts[-1]):
                    noted.update(engines_of(part) if isinstance(part, Path) else part)
    return tuple(sorted(noted))


def are_made_up(sent_by: Iterable[str]) -> bool:
    """Tell of names of engines whether one is the simulator of `vsd demo`: its pages say that the data are made up."""
    return any(name.startswith(MADE_UP_ENGINE) for name in sent_by)


def last_records(site: Site, camera_ids: Collection[str], *, until: date) -> dict[str, datetime]:
    """Return the instant of each camera's last record up to a local day, inclusive, in the site's time zone.

    Cameras without a record in the sixty days before that day are left out.

    Raises:
        StoreError: E302, a part is damaged.
    """
    instants: dict[str, datetime] = {}
    hours = _hours(site, until - LOOK_BACK, until)
    sealed = sealed_range(site, *hours).hours
    by_hour: dict[int, list[Path]] = {hour: [] for hour in sealed}
    store = _store(site)
    for parts in _parts(store, hours).values():
        for part in parts:
            if part.hour not in sealed:
                by_hour.setdefault(part.hour, []).append(part.path)
    with store.reporting_damage():
        for hour in sorted(by_hour, reverse=True):
            if len(instants) == len(set(camera_ids)):
                break
            last_ms = sealed[hour].last_ms if hour in sealed else _last_ms(by_hour[hour])
            for camera_id, ms in last_ms.items():
                if camera_id in camera_ids and camera_id not in instants:
                    instants[camera_id] = datetime.fromtimestamp(ms // 1000, tz=UTC).astimezone(site.zone)
    return instants


def _last_ms(paths: Sequence[Path]) -> dict[str, int]:
    """Return the instant of each camera's last record in some parts, in milliseconds."""
    rows = pa.concat_tables(pq.read_table(path, columns=["camera_id", "ts"], partitioning=None) for path in paths)
    last = rows.group_by("camera_id").aggregate([("ts", "max")])
    return dict(zip(last["camera_id"].to_pylist(), last["ts_max"].cast(pa.int64()).to_pylist(), strict=True))


def _hours(site: Site, first: date, last: date) -> tuple[int, int]:
    """Return the first and last UTC hour number of a range of local days."""
    starts = [
        int(datetime(day.year, day.month, day.day, tzinfo=site.zone).timestamp()) // 3600
        for day in (first, last + timedelta(days=1))
    ]
    return starts[0], starts[1] - 1


def _store(site: Site) -> Store:
    return Store(site.root / "store", site_id=site.site_id)


def _parts(store: Store, hours: tuple[int, int]) -> dict[str, list[Part]]:
    """Return the parts of each table over a range of UTC hours, in order of time."""
    return {t: store.parts(t, first_hour=hours[0], last_hour=hours[1]) for t in TABLES}
