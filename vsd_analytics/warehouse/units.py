"""What facts are made of: units of a UTC hour or day, each known by the fingerprint of all it depends on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.store import Store
from vsd_analytics.store.layout import Part

Causes = Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Unit:
    """One unit of facts and what it is computed from.

    Attributes:
        number: UTC hour number, or UTC day number.
        parts: Stored parts it reads, by table: its own and, for an hour, those of the hours beside it.
        causes: Hashes of what it depends on, by cause ("records", "sql", "settings", "site"), so that a change can be
            explained.
        fingerprint: 16 hexadecimal digits over all of it; stands in the names of the unit's fact files.
        hours: First and last UTC hour of its own.
    """

    number: int
    parts: Mapping[TableName, Sequence[Part]]
    causes: Causes
    fingerprint: str
    hours: tuple[int, int]

    def own_parts(self, table: TableName) -> list[Part]:
        """Return its parts of one table without those of the hours beside it."""
        return [p for p in self.parts[table] if self.hours[0] <= p.hour <= self.hours[1]]


class PartIndex:
    """The store's parts in a range of hours, by table and hour.

    Args:
        store: The store.
        first_hour: First UTC hour number.
        last_hour: Last one, inclusive.
    """

    def __init__(self, store: Store, *, first_hour: int | None, last_hour: int | None) -> None:
        self._by: dict[TableName, dict[int, list[Part]]] = {t: {} for t in TABLES}
        for table in TABLES:
            for part in store.parts(table, first_hour=first_hour, last_hour=last_hour):
                self._by[table].setdefault(part.hour, []).append(part)

    def hours(self) -> list[int]:
        """Return the hours that hold any part, in order."""
        return sorted({h for by_hour in self._by.values() for h in by_hour})

    def between(self, first: int, last: int) -> dict[TableName, list[Part]]:
        """Return the parts of the hours from `first` to `last`, by table."""
        return {t: [p for h in range(first, last + 1) for p in by_hour.get(h, ())] for t, by_hour in self._by.items()}


def day_unit(index: PartIndex, day: int, *, shared: Causes) -> Unit:
    """Return the unit of a UTC day: all its parts."""
    hours = (day * 24, day * 24 + 23)
    parts = index.between(*hours)
    return _unit(day, parts, {**shared, "records": _parts_hash(parts)}, hours)


def hour_unit(index: PartIndex, hour: int, *, shared: Causes, camera_days: str) -> Unit:
    """Return the unit of a UTC hour: its parts and its neighbours', and its cameras' frame intervals."""
    parts = index.between(hour - 1, hour + 1)
    return _unit(hour, parts, {**shared, "records": _parts_hash(parts), "frame interval": camera_days}, (hour, hour))


def merged_parts(units: Sequence[Unit]) -> dict[TableName, list[Part]]:
    """Return the parts several units read, each once, in order."""
    return {t: sorted({p for u in units for p in u.parts[t]}) for t in TABLES}


def text_hash(value: object) -> str:
    """Return a short hash of a JSON value."""
    return hashlib.blake2b(json.dumps(value, sort_keys=True, default=str).encode(), digest_size=8).hexdigest()


def fact_path(root: Path, relation: str, site_id: str, unit: Unit, *, is_day: bool) -> Path:
    """Return where the fact file of a unit stands: `<relation>/site=…/date=…/<HH>-<fingerprint>.parquet`."""
    from vsd_analytics.store.layout import unit_folder

    hour = unit.number * 24 if is_day else unit.number
    return unit_folder(root, relation, site_id, hour) / f"{hour % 24:02d}-{unit.fingerprint}.parquet"


def _unit(number: int, parts: Mapping[TableName, Sequence[Part]], causes: Causes, hours: tuple[int, int]) -> Unit:
    return Unit(number, parts, causes, text_hash([number, sorted(causes.items())]), hours)


def _parts_hash(parts: Mapping[TableName, Sequence[Part]]) -> str:
    return text_hash([(t, p.hour, p.digest) for t, found in sorted(parts.items()) for p in found])
