"""Causes: what facts depend on, so that a change makes stale what reads it, where it reads it, and nothing else.

A cause is a kind of thing that may change, and a hash of it as it is now. What a fact depends on stands in the headers
of the SQL files: the relations it reads and the settings it uses, itself or through others.
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
from vsd_analytics.site import Site
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.warehouse.dimensions import FOREVER_MS, calibration_rows, owner_spans, params
from vsd_analytics.warehouse.sqlfiles import Relation, relations

Causes = Mapping[str, str]

WORDS: Final = {
    "records": "late data",
    "sql": "SQL changed",
    "settings": "settings changed",
    "cameras": "cameras changed",
    "calibration": "calibration changed",
    "views": "views changed",
    "frame interval": "frame interval changed",
}
_INPUTS = {
    "cameras": "cameras",
    "calibrations": "calibration",
    "owner_cells": "views",
    "camera_days": "frame interval",
}


def text_hash(value: object) -> str:
    """Return a short hash of a JSON value."""
    return hashlib.blake2b(json.dumps(value, sort_keys=True, default=str).encode(), digest_size=8).hexdigest()


def told(changed: Collection[str]) -> str:
    """Return in words why facts are stale, given the causes that changed; empty if none did.

    Other owners of cells that follow from a new calibration or camera are not told as a reason of their own.
    """
    kinds = set(changed)
    if kinds & {"calibration", "cameras"}:
        kinds.discard("views")
    return ", ".join(words for kind, words in WORDS.items() if kind in kinds)


def made_of(facts: Iterable[str]) -> tuple[dict[str, Relation], set[str]]:
    """Return the relations that facts are computed from, themselves among them, and the inputs all these read.

    The fact `camera_days` is an input of the hourly facts: they depend on its rows, not on how it is made.
    """
    known = relations("staging", "facts")
    made: dict[str, Relation] = {}
    inputs: set[str] = set()

    def add(relation: Relation) -> None:
        if relation.name not in made:
            made[relation.name] = relation
            for name in relation.reads:
                if name in known and known[name].unit == "hour":
                    add(known[name])
                else:
                    inputs.add(name)

    for name in facts:
        add(known[name])
    return made, inputs


@dataclass(frozen=True, slots=True)
class Needs:
    """What facts depend on, the same for every unit.

    Attributes:
        sql: Hash of the queries they are computed with.
        settings: Hash of the settings these use.
        tables: Stored tables these read.
        inputs: What else these read, of `WORDS`.
    """

    sql: str
    settings: str
    tables: tuple[TableName, ...]
    inputs: tuple[str, ...]

    def causes(self, now: Causes) -> Causes:
        """Return the causes of a unit's facts, given hashes of its stored tables and of its inputs."""
        records = {"records": text_hash([now[t] for t in self.tables])}
        return {**records, "sql": self.sql, "settings": self.settings, **{i: now[i] for i in self.inputs}}


def needs(site: Site, facts: Iterable[str]) -> Needs:
    """Return what facts depend on."""
    made, read = made_of(facts)
    values = params(site)
    used = {p for r in made.values() for p in r.params}
    return Needs(
        sql=text_hash(sorted((r.name, r.sql) for r in made.values())),
        settings=text_hash({p: values[p] for p in used}),
        tables=tuple(t for t in TABLES if f"stored_{t}" in read),
        inputs=tuple(sorted(_INPUTS[r] for r in read if r in _INPUTS)),
    )


class SiteTimes:
    """What `vsd.toml` says of cameras, and when.

    Args:
        site: The project.
    """

    def __init__(self, site: Site) -> None:
        self._site = site
        self._made: dict[tuple[frozenset[str], int, int], Causes] = {}

    def of_day(self) -> Causes:
        """Return the hash of the cameras as the facts of days read them: with the frame rates that are set."""
        return {"cameras": text_hash(sorted((c.camera_id, c.hz or 0) for c in self._site.cameras))}

    @cached_property
    def owners(self) -> str:
        """Return the hash of the owners of cells at all times."""
        return text_hash(self._owners)

    def of_hour(self, hour: int, *, present: Collection[str]) -> Causes:
        """Return hashes of cameras, calibrations and owners of cells in force in a UTC hour or one of those beside it.

        Args:
            hour: UTC hour number.
            present: Cameras with records around it: others change nothing there.
        """
        window = ((hour - 1) * HOUR_MS, (hour + 2) * HOUR_MS)
        key = (frozenset(present), bisect_right(self._changes, window[0]), bisect_left(self._changes, window[1]))
        if key not in self._made:
            cameras = [c for c in self._site.cameras if c.camera_id in key[0]]
            calibrations = [row for c in cameras for row in self._calibrations[c.camera_id]]
            floors = {c.floor_id for c in cameras}
            self._made[key] = {
                "cameras": text_hash(sorted((c.camera_id, c.floor_id) for c in cameras)),
                "calibration": text_hash(_within(window, calibrations)),
                "views": text_hash(_within(window, [span for span in self._owners if span[0] in floors])),
            }
        return self._made[key]

    @cached_property
    def _calibrations(self) -> Mapping[str, Sequence[tuple[Any, ...]]]:
        return {c.camera_id: calibration_rows(c) for c in self._site.cameras}

    @cached_property
    def _owners(self) -> Sequence[tuple[Any, ...]]:
        return [(s.floor_id, s.from_ms, s.to_ms, text_hash(sorted(s.cells))) for s in owner_spans(self._site)]

    @cached_property
    def _changes(self) -> Sequence[int]:
        return sorted({row[1] for rows in self._calibrations.values() for row in rows})


def _within(window: tuple[int, int], spans: Iterable[tuple[Any, ...]]) -> list[list[Any]]:
    """Return the spans (name, from_ms, to_ms, ...) that touch a window, cut to it: what lies beyond tells nothing."""
    first, end = window
    return sorted(
        [name, from_ms if from_ms > first else -FOREVER_MS, to_ms if to_ms < end else FOREVER_MS, *rest]
        for name, from_ms, to_ms, *rest in spans
        if from_ms < end and to_ms > first
    )
