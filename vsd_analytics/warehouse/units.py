"""Units of facts: a UTC hour or day with its parts and input fingerprint, and how many are computed at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import pyarrow.parquet as pq

from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.store.layout import Part, unit_folder
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.input_fingerprint import DRAWN_AREAS, FactInputs, InputHashes, text_hash

BATCH_HOURS, BATCH_ROWS = 24, 2_000_000
"""Hours and stored rows, of pairs twice, per batch, which begins with a UTC day where it can: so most files are written
at once, and the columns of a day fit into caches. Hours of a busy site are computed one by one, so that memory stays
bounded."""
COUNTED_ROWS = 400_000
"""The rows of a batch of facts that only count: about an hour of a large site, whose columns fit into the caches."""
QUIET_HOURS, QUIET_ROWS = 168, 500_000
"""A batch of a quiet site goes on for a week: with so few rows, planning the queries costs more than running them."""


@dataclass(frozen=True, slots=True)
class Unit:
    """One unit of facts and what it is computed from.

    Attributes:
        number: UTC hour number, or UTC day number.
        parts: Stored parts it reads, by table: its own and, for an hour, those beside it that lie near enough.
        current: Hash of its parts by table, and of each other kind of input that differs by unit.
        inputs: Hash of each kind of input of its facts together, so that a change can be explained.
        fingerprint: 16 hexadecimal digits over all inputs; part of the names of the unit's fact files.
        hours: First and last UTC hour of its own.
    """

    number: int
    parts: Mapping[TableName, Sequence[Part]]
    current: InputHashes
    inputs: InputHashes
    fingerprint: str
    hours: tuple[int, int]

    @property
    def fingerprint_of_marts(self) -> str:
        """Return the fingerprint without the areas that are drawn, which marts that read areas have as an input anyway.

        An outline that changes renews these marts, and others stay.
        """
        return text_hash([self.number, sorted((k, v) for k, v in self.inputs.items() if k != DRAWN_AREAS)])

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


def days_around(hour: int) -> list[int]:
    """Return the UTC day numbers of an hour and its two neighbours."""
    return sorted({(hour + k) // 24 for k in (-1, 0, 1)})


def day_unit(index: PartIndex, day: int, *, current: InputHashes, depends_on: FactInputs) -> Unit:
    """Return the unit of a UTC day: the parts of its 24 hours and the hashes of its other inputs."""
    hours = (day * 24, day * 24 + 23)
    return _unit(day, index.between(*hours), current, depends_on, hours)


def hour_unit(
    index: PartIndex, hour: int, *, near: Collection[Part], current: InputHashes, depends_on: FactInputs
) -> Unit:
    """Return the unit of a UTC hour: its parts, those of its neighbours that are `near`, and its other inputs."""
    around = index.between(hour - 1, hour + 1)
    parts = {t: [p for p in table_parts if p.hour == hour or p in near] for t, table_parts in around.items()}
    return _unit(hour, parts, current, depends_on, (hour, hour))


def merged_parts(units: Sequence[Unit]) -> dict[TableName, list[Part]]:
    """Return the parts that several units read, each once, in order."""
    return {t: sorted({p for u in units for p in u.parts[t]}) for t in TABLES}


def fact_path(root: Path, relation: str, site_id: str, unit: Unit, *, is_day: bool) -> Path:
    """Return the path of a unit's fact file: `<relation>/site=…/date=…/<HH>-<fingerprint>.parquet`."""
    hour = unit.number * 24 if is_day else unit.number
    return unit_folder(root, relation, site_id, hour) / f"{hour % 24:02d}-{unit.fingerprint}.parquet"


def _unit(
    number: int,
    parts: Mapping[TableName, Sequence[Part]],
    current: InputHashes,
    depends_on: FactInputs,
    hours: tuple[int, int],
) -> Unit:
    current = {
        **current,
        **{t: text_hash([(p.hour, p.digest) for p in table_parts]) for t, table_parts in parts.items()},
    }
    inputs = depends_on.of_unit(current)
    # The number is part of the fingerprint, so that equal inputs of two hours never share a file name.
    return Unit(number, parts, current, inputs, text_hash([number, sorted(inputs.items())]), hours)


def batches(units: Sequence[Unit], *, most_rows: int = BATCH_ROWS) -> Iterator[Sequence[Unit]]:
    """Yield runs of units within the limits of hours (or as many days) and rows; each holds at least one unit.

    A run goes on with a further day only if the whole of it fits: then each file is written with the rows of one run.
    """
    n_rows = {u.number: sum(_n_persons(t, p) for t in TABLES for p in u.own_parts(t)) for u in units}
    of_day: Counter[int] = Counter()
    for number, n in n_rows.items():
        of_day[number // BATCH_HOURS] += n
    batch: list[Unit] = []
    held = 0
    for unit in units:
        own, day = n_rows[unit.number], unit.number // BATCH_HOURS
        if batch:
            ahead = own if day == batch[-1].number // BATCH_HOURS else of_day[day]
            is_within = day == batch[0].number // BATCH_HOURS and held + own <= most_rows
            is_quiet = unit.number - batch[0].number < QUIET_HOURS and held + ahead <= min(QUIET_ROWS, most_rows)
            if not is_within and not is_quiet:
                yield batch
                batch, held = [], 0
        batch.append(unit)
        held += own
    if batch:
        yield batch


def _n_persons(table: TableName, part: Part) -> int:
    """Return the rows of a part, of pairs twice: each is of two persons, and takes the room of two while it is held."""
    return 2 * _n_rows(part.path) if table == "pairs" else _n_rows(part.path)


@lru_cache(maxsize=100_000)
def _n_rows(path: Path) -> int:
    """Return the rows of a part. A part is named by the hash of its bytes, so they never change."""
    return int(pq.read_metadata(path).num_rows)
