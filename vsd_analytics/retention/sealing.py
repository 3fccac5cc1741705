"""Sealing of the facts of hours whose records a purge by age removes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.schema import TABLES
from vsd_analytics.site.model import Site
from vsd_analytics.store.layout import Part
from vsd_analytics.store.owners import brought_by
from vsd_analytics.store.part_files import engines_of
from vsd_analytics.store.seals import DAY_FACT, FOLDER, DaySeal, Seals, UnitSeal
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.build_result import BuildResult
from vsd_analytics.warehouse.fact_days import hour_bytes
from vsd_analytics.warehouse.fact_weeks import day_bytes_of
from vsd_analytics.warehouse.sealed import CurrentRules
from vsd_analytics.warehouse.sqlfiles import relations


class Sealer:
    """Seals the facts of the hours before `edge`, and of the hour at it.

    The facts of the hour at the edge were computed from records of the hour before, which the purge removes: they could
    not be computed the same way again.
    """

    def __init__(self, site: Site, store: Store, edge: int) -> None:
        self._site, self._store, self._edge = site, store, edge
        self._seals = Seals(site.root / FOLDER, site_id=site.site_id)
        self._rules = CurrentRules(site)

    def hours(self, days: Sequence[int]) -> list[int]:
        """Return the hours with records of some UTC days before the edge, and the edge hour if it follows them."""
        present = {p.hour for p in all_parts(self._store) if p.hour <= self._edge}
        hours = sorted(h for h in present if h // 24 in days and h < self._edge)
        return [*hours, self._edge] if self._edge in present and self._edge // 24 - 1 in days else hours

    def seal(self, days: Sequence[int], *, on: date) -> None:
        """Copy the facts of the hours durably, then write each day's seal. Hours sealed before stay as they are.

        A seal is written after all files it names are on disk: a crash before leaves unsealed copies, which `sweep`
        removes next time.
        """
        self._seals.sweep([*days, self._edge // 24])
        hours = self.hours(days)
        built = build(self._site, first_hour=hours[0], last_hour=hours[-1], has_lock=True)
        for day in sorted({h // 24 for h in hours}):
            old = self._seals.read(day)
            is_whole = day < self._edge // 24
            new = [h for h in hours if h // 24 == day and (old is None or not old.holds(h))]
            if (not new and not is_whole) or (old is not None and old.is_whole):
                continue
            facts = self._facts(day, built, is_in_day=is_whole) if new else {}
            units = {h: self._hour(h, built.fingerprints[h], facts, is_in_day=is_whole) for h in new}
            seal = DaySeal(
                day=day,
                is_whole=is_whole,
                sealed_on=on.isoformat(),
                hours={**({} if old is None else old.hours), **units},
                camera_days=self._day(day, built) if is_whole else None,
            )
            self._seals.write(seal)

    def _facts(self, day: int, built: BuildResult, *, is_in_day: bool) -> dict[str, str]:
        """Put the facts of the hours of a UTC day that are not sealed yet, or of the edge; return digests by fact.

        Files of the day have these hours only, because facts of sealed hours are never computed again.
        """
        facts: dict[str, str] = {}
        names = [r.name for r in relations("facts").values() if r.unit == "hour" and r.name in built.paths]
        for name in names:
            path = built.paths[name][day]
            data = day_bytes_of(path, name, day) if is_in_day else hour_bytes(path, self._edge)
            facts[name] = self._seals.put(name, day * 24, data, is_in_day=is_in_day)
        return facts

    def _day(self, day: int, built: BuildResult) -> UnitSeal:
        data = day_bytes_of(built.paths[DAY_FACT][day], DAY_FACT, day)
        digest = self._seals.put(DAY_FACT, day * 24, data)
        return UnitSeal(fingerprint=built.day_fingerprints[day], causes={}, facts={DAY_FACT: digest}, is_as_built=True)

    def _hour(self, hour: int, fingerprint: str, facts: Mapping[str, str], *, is_in_day: bool) -> UnitSeal:
        records: dict[str, int] = {}
        engines: dict[str, tuple[tuple[str, ...], ...]] = {}
        last_ms: dict[str, int] = {}
        imports: set[str] = set()
        for table in TABLES:
            parts = self._store.parts(table, first_hour=hour, last_hour=hour)
            records[table] = sum(pq.read_metadata(p.path).num_rows for p in parts)
            engines[table] = tuple(tuple(engines_of(p.path)) for p in parts)
            for part in parts:
                imports.update(brought_by(part.path))
                for camera_id, ms in _last_ms(part.path):
                    last_ms[camera_id] = max(ms, last_ms.get(camera_id, ms))
        cameras = tuple(sorted(last_ms))
        return UnitSeal(
            fingerprint=fingerprint,
            causes=self._rules.of_hour(hour, present=cameras),
            facts=facts,
            is_in_day=is_in_day,
            records=records,
            engines=engines,
            last_ms=last_ms,
            cameras=cameras,
            imports=tuple(sorted(imports)),
            is_as_built=True,
        )


def all_parts(store: Store) -> list[Part]:
    """Return the stored parts of all tables."""
    return [p for t in TABLES for p in store.parts(t)]


def _last_ms(path: Path) -> list[tuple[str, int]]:
    rows = pq.ParquetFile(path).read(columns=["camera_id", "ts"])
    rows = pa.table({"camera_id": rows["camera_id"], "ms": rows["ts"].cast(pa.int64())})
    last = rows.group_by("camera_id").aggregate([("ms", "max")])
    return list(zip(last["camera_id"].to_pylist(), last["ms_max"].to_pylist(), strict=True))
