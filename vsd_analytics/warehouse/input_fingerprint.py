"""The input fingerprint of facts: a change makes stale the facts that read what changed, and no other facts.

Each kind of input (records, SQL, settings, cameras, ...) has one hash. The headers of the SQL files say which inputs a
fact has: the relations it reads and the settings it uses, directly or through other relations.
"""

from __future__ import annotations

import hashlib
import json
from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.site.places import joined_floors
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.warehouse.count_lines import line_rows, part_rows
from vsd_analytics.warehouse.dimensions import (
    ASKED_TABLES,
    areas_with_counts,
    areas_with_stays,
    calibration_rows,
    params,
)
from vsd_analytics.warehouse.owner_spans import FOREVER_MS, owner_spans
from vsd_analytics.warehouse.sqlfiles import Relation, relations

InputHashes = Mapping[str, str]
"""Hash of each kind of input, by kind: one of the keys of `STALE_REASONS`."""

DRAWN_AREAS: Final = "drawn areas"
STALE_REASONS: Final = {
    "records": "late data",
    "sql": "SQL changed",
    "settings": "settings changed",
    "cameras": "cameras changed",
    "calibration": "calibration changed",
    "views": "views changed",
    "frame interval": "frame interval changed",
    DRAWN_AREAS: "areas changed",
    "areas": "areas changed",
    "lines": "lines changed",
    "counted areas": "areas or capacities changed",
    "staff": "staff changed",
    "staff classes": "staff_classes changed",
    "joined views": "join_views changed",
}
_KIND_OF_RELATION = {
    "cameras": "cameras",
    "calibrations": "calibration",
    "owner_cells": "views",
    "camera_days": "frame interval",
    "area_cells": DRAWN_AREAS,
    "visit_cells": "areas",
    "count_cells": "counted areas",
    "count_floors": "counted areas",
    "count_lines": "lines",
    "line_parts": "lines",
    "staff": "staff",
    "staff_classes": "staff classes",
    "joined_floors": "joined views",
}


_JSON = json.JSONEncoder(sort_keys=True, default=str)
"""Made once: a report hashes thousands of values."""


def text_hash(value: object) -> str:
    """Return a short hash of a JSON value."""
    return hashlib.blake2b(_JSON.encode(value).encode(), digest_size=8).hexdigest()


def stale_reason(changed: Collection[str]) -> str:
    """Return in words why facts are stale, given the kinds of input that changed; empty if none did."""
    kinds = set(changed)
    # A new calibration or camera changes the owners of cells as well: one change, so one reason.
    if kinds & {"calibration", "cameras"}:
        kinds.discard("views")
    return ", ".join(dict.fromkeys(words for kind, words in STALE_REASONS.items() if kind in kinds))


def dependencies(facts: Iterable[str]) -> tuple[dict[str, Relation], set[str]]:
    """Return the relations that facts are computed with, the facts among them, and the names of what these read."""
    known = relations("staging", "facts")
    computed: dict[str, Relation] = {}
    inputs: set[str] = set()

    def add(relation: Relation) -> None:
        if relation.name not in computed:
            computed[relation.name] = relation
            for name in relation.reads:
                # `camera_days` (unit: day) is an input of the hourly facts. They depend on its rows, not on its SQL:
                # a new query that gives the same rows leaves them fresh.
                if name in known and known[name].unit == "hour":
                    add(known[name])
                else:
                    inputs.add(name)

    for name in facts:
        add(known[name])
    return computed, inputs


@dataclass(frozen=True, slots=True)
class FactInputs:
    """What some facts depend on. SQL and settings are the same for every unit; the other inputs differ by unit.

    Attributes:
        sql: Hash of the queries that compute them. Comments after the header are part of a query, the header is not.
        settings: Hash of the settings that the queries use.
        tables: Stored tables that the queries read.
        kinds: Other kinds of input that the queries read, of `STALE_REASONS`.
    """

    sql: str
    settings: str
    tables: tuple[TableName, ...]
    kinds: tuple[str, ...]

    def of_unit(self, current: InputHashes) -> InputHashes:
        """Return the hashes of all inputs of one unit.

        Args:
            current: Hash of each stored table and of each kind of input that differs by unit.
        """
        records = {"records": text_hash([current[t] for t in self.tables])}
        return {**records, "sql": self.sql, "settings": self.settings, **{k: current[k] for k in self.kinds}}


def fact_inputs(site: Site, facts: Iterable[str]) -> FactInputs:
    """Return what some facts depend on, given their names."""
    computed, read = dependencies(facts)
    values = params(site)
    used = {p for r in computed.values() for p in r.params}
    return FactInputs(
        sql=text_hash(sorted((r.name, r.sql) for r in computed.values())),
        settings=text_hash({p: values[p] for p in used}),
        tables=tuple(t for t in TABLES if f"stored_{t}" in read),
        kinds=tuple(sorted(_KIND_OF_RELATION[r] for r in read if r in _KIND_OF_RELATION)),
    )


def kinds_of_places(fact: str) -> frozenset[str]:
    """Return the kinds of input that say what vsd.toml asks of areas and floors, of those that a fact itself reads.

    Such a fact has no files until something is asked.
    """
    reads = relations("facts")[fact].reads
    return frozenset(_KIND_OF_RELATION[name] for name in ASKED_TABLES if name in reads)


class SiteInputs:
    """Hashes of what `vsd.toml` says about cameras, calibrations and cell owners at a given time."""

    def __init__(self, site: Site) -> None:
        self._site = site
        self._computed: dict[tuple[frozenset[str], int, int], InputHashes] = {}

    def of_day(self) -> InputHashes:
        """Return the hash of the cameras as the fact `camera_days` reads them: with their configured frame rates."""
        return {"cameras": text_hash(sorted((c.camera_id, c.hz or 0) for c in self._site.cameras))}

    @cached_property
    def owners(self) -> str:
        """Return the hash of the owners of all cells at all times."""
        return text_hash(self._owners)

    def of_hour(self, hour: int, *, present: Collection[str]) -> InputHashes:
        """Return hashes of cameras, calibrations, owners, areas and lines in force in a UTC hour and those beside it.

        Args:
            hour: UTC hour number.
            present: Cameras with records in these hours. Other cameras cannot change its facts.
        """
        # Facts of an hour read records of the hours on either side (episodes, next frames).
        window = ((hour - 1) * HOUR_MS, (hour + 2) * HOUR_MS)
        # Hours with the same cameras between the same two changes (calibrations, lives of cameras and of lines) share
        # one answer: owner cells are many, and hashing them for every hour of ten years would dominate the build.
        key = (frozenset(present), bisect_right(self._changes, window[0]), bisect_left(self._changes, window[1]))
        if key not in self._computed:
            cameras = [c for c in self._site.cameras if c.camera_id in key[0]]
            calibrations = [row for c in cameras for row in self._calibrations[c.camera_id]]
            floors = {c.floor_id for c in cameras}
            self._computed[key] = {
                "cameras": text_hash(sorted((c.camera_id, c.floor_id) for c in cameras)),
                "calibration": text_hash(_within(window, calibrations)),
                "views": text_hash(_within(window, [span for span in self._owners if span[0] in floors])),
                DRAWN_AREAS: text_hash([area[:-1] for area in self._drawn if area[0] in floors]),
                "areas": text_hash([area for area in self._visited if area[0] in floors]),
                "counted areas": text_hash([area for area in self._counted if area[0] in floors]),
                "lines": text_hash([_within(window, [r for r in rows if r[0] in floors]) for rows in self._lines]),
                "staff classes": text_hash(bool(self._site.settings.staff_classes)),
                "joined views": text_hash([floor for floor in joined_floors(self._site) if floor in floors]),
            }
        return self._computed[key]

    @cached_property
    def _calibrations(self) -> Mapping[str, Sequence[tuple[Any, ...]]]:
        return {c.camera_id: calibration_rows(c) for c in self._site.cameras}

    @cached_property
    def _owners(self) -> Sequence[tuple[Any, ...]]:
        return [(s.floor_id, s.from_ms, s.to_ms, text_hash(sorted(s.cells))) for s in owner_spans(self._site)]

    @cached_property
    def _drawn(self) -> Sequence[tuple[Any, ...]]:
        return self._areas(frozenset(a.area_id for a in self._site.areas))

    @cached_property
    def _visited(self) -> Sequence[tuple[Any, ...]]:
        return self._areas(areas_with_stays(self._site))

    @cached_property
    def _counted(self) -> Sequence[tuple[Any, ...]]:
        floors = [(f.floor_id,) for f in self._site.floors if f.capacity is not None]
        return [*floors, *self._areas(areas_with_counts(self._site))]

    def _areas(self, asking: Collection[str]) -> Sequence[tuple[Any, ...]]:
        """Return the areas of floors with one that asks: cells that two share belong to the first."""
        asked = {a.floor_id for a in self._site.areas if a.area_id in asking}
        return [
            (a.floor_id, a.area_id, a.polygon, a.first_day, a.end_day, a.area_id in asking)
            for a in self._site.areas
            if a.floor_id in asked
        ]

    @cached_property
    def _lines(self) -> tuple[Sequence[tuple[Any, ...]], Sequence[tuple[Any, ...]]]:
        return line_rows(self._site), part_rows(self._site)

    @cached_property
    def _changes(self) -> Sequence[int]:
        spans = (*self._owners, *(row for rows in self._lines for row in rows))
        ends = {ms for span in spans for ms in span[1:3]}
        return sorted(ends | {row[1] for rows in self._calibrations.values() for row in rows})


def _within(window: tuple[int, int], spans: Iterable[tuple[Any, ...]]) -> list[list[Any]]:
    """Return the spans (name, from_ms, to_ms, ...) that touch a window, with ends outside it made infinite.

    So a new calibration that starts after the window leaves the hash of the window as it was.
    """
    first, end = window
    return sorted(
        [name, from_ms if from_ms > first else -FOREVER_MS, to_ms if to_ms < end else FOREVER_MS, *rest]
        for name, from_ms, to_ms, *rest in spans
        if from_ms < end and to_ms > first
    )
