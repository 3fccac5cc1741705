"""The files of the hourly facts: one for each fact and UTC day, with the hour as a column.

```
facts/<fact>/site=<site>/date=<YYYY-MM-DD>/00-<fingerprint>.parquet
```

Files of small facts are joined when their week is over (`fact_weeks`).

The fingerprint covers the inputs of every hour of the day, so one name answers whether a day is fresh. The file notes
the inputs of each hour. When the fingerprint changes, the new file takes the rows of the hours whose own inputs did not
change from the old one; only the others are computed.
"""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.site.model import Site
from vsd_analytics.store.durable import publish
from vsd_analytics.store.layout import unit_folder
from vsd_analytics.store.own_digest import is_undamaged
from vsd_analytics.warehouse import settings_variants
from vsd_analytics.warehouse.dimensions import ASKED_TABLES, asked_tables
from vsd_analytics.warehouse.fact_weeks import FactWeeks, fingerprints, first_day_of
from vsd_analytics.warehouse.factfiles import (
    FactWriter,
    by_hour,
    by_kind,
    damaged_facts,
    fact_bytes,
    is_whole,
    noted_inputs,
)
from vsd_analytics.warehouse.input_fingerprint import (
    InputHashes,
    fact_inputs,
    kinds_of_places,
    stale_reason,
    text_hash,
)
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.units import Unit

Write = Callable[[Path, bytes], object]


def stored_facts(site: Site) -> list[str]:
    """Return the hourly facts with files: all but those of areas and floors of which vsd.toml asks nothing."""
    asked = asked_tables(site)
    hourly = [r for r in relations("facts").values() if r.unit == "hour"]
    return [r.name for r in hourly if asked & set(r.reads) or not set(ASKED_TABLES) & set(r.reads)]


class FactDays:
    """The files of the hourly facts of whole UTC days: which are fresh, and which hours of the others are stale.

    Args:
        site: The project.
        units: All hours of these days whose facts are computed, in order.
        facts: Names of the facts that are asked for; None = all. Of the others only the paths are known.
        is_trusting: Do not open files whose names are right.
        write: Takes path and bytes of each file that is made; None = publish it.
    """

    def __init__(
        self,
        site: Site,
        units: Iterable[Unit],
        *,
        facts: Collection[str] | None = None,
        is_trusting: bool = False,
        write: Write | None = None,
    ) -> None:
        self._roots, self._site_id = settings_variants.roots(site), site.site_id
        every = stored_facts(site)
        self._weeks = {name: FactWeeks(self._roots[name], name, site.site_id) for name in every}
        self.names = every if facts is None else [name for name in every if name in facts]
        self._inputs_of = {name: fact_inputs(site, [name]) for name in every}
        self._of_places = {name: kinds for name in every if (kinds := kinds_of_places(name))}
        self.units: dict[int, list[Unit]] = defaultdict(list)
        for unit in units:
            self.units[unit.number // 24].append(unit)
        self._hashes: dict[tuple[int, tuple[str, ...]], str] = {}
        self._noted: dict[tuple[str, int], dict[Path, Mapping[int, Mapping[str, str]]]] = {}
        self._noted_in: dict[Path, Mapping[int, Mapping[str, str]] | None] = {}
        self._names: dict[int, Mapping[str, frozenset[str]]] = {}
        self._torn_of: dict[int, Collection[str]] = {}
        self._is_trusting, self._write = is_trusting, write or _publish

    @cached_property
    def paths(self) -> Mapping[str, Mapping[int, Path]]:
        """The path of the fresh file of every fact and UTC day, or of its week; a day's whether it exists or not."""
        trusts = self._is_trusting
        return {name: self._weeks[name].joined_paths(own, is_trusting=trusts) for name, own in self._day_paths.items()}

    @cached_property
    def _day_paths(self) -> Mapping[str, Mapping[int, Path]]:
        return {name: {day: self._path(name, day) for day in self.units} for name in self._inputs_of}

    def split_weeks(self) -> None:
        """Write the fresh days of weeks of which other days are stale as files of their own. Asked before `paths`."""
        for name in self.names:
            self._weeks[name].split_weeks(self._day_paths[name])

    def joined(
        self, *, first_day: int | None, last_day: int | None, without: Collection[int]
    ) -> dict[str, Mapping[int, Path]]:
        """Join the files of weeks that are over, now that all are there; return `paths` afterwards.

        Args:
            first_day: First UTC day number of the range; None = everything stored.
            last_day: Last one, inclusive.
            without: UTC days whose weeks are not joined.
        """
        asked = {
            name: self._weeks[name].join(self.paths[name], first_day=first_day, last_day=last_day, without=without)
            for name in self.names
        }
        return {**self.paths, **asked}

    @cached_property
    def missing(self) -> Mapping[int, list[str]]:
        """By UTC day, the facts without a complete fresh file; days with all files are left out."""
        trusted = {day for day in self.units if self._is_trusting and self._are_named(day)}
        missing = {
            day: [n for n in self.names if not self._is_in_week(n, day) and not is_whole(self.paths[n][day])]
            for day in self.units
            if day not in trusted
        }
        return {day: names for day, names in missing.items() if names}

    def stale(self, name: str, day: int) -> list[Unit]:
        """Return the hours of a missing file that no older file of the fact and day holds."""
        older = self._older(name, day).values()
        return [u for u in self.units[day] if not any(n.get(u.number) == self.inputs(name, u) for n in older)]

    def inputs(self, name: str, unit: Unit) -> InputHashes:
        """Return the input hashes of one fact of an hour."""
        return self._inputs_of[name].of_unit(unit.current)

    def reason(self, unit: Unit) -> str:
        """Return in words why an hour is stale."""
        day = unit.number // 24
        changed, has_any, has_fresh = set[str](), False, False
        for name in self.names:
            is_fresh = name not in self.missing.get(day, ())
            has_fresh = has_fresh or is_fresh or name in self._torn(day)
            older = () if is_fresh else self._older(name, day).values()
            noted = [hours[unit.number] for hours in older if unit.number in hours]
            has_any |= is_fresh or bool(noted)
            if not is_fresh and not noted and settings_variants.is_variant(self._roots[name]):
                has_any, changed = True, changed | {"settings"}
            if not is_fresh and not noted and name in self._of_places and name not in self._torn(day):
                changed |= self._of_places[name]
            for inputs in noted:
                changed |= {kind for kind, value in self.inputs(name, unit).items() if inputs.get(kind) != value}
        if not has_any:
            return "incomplete" if has_fresh else "new"
        # No input of an old file changed: a fresh file is torn or gone, or nobody asked for the fact so far.
        return stale_reason(changed) or ("incomplete" if has_fresh else "SQL changed")

    def _torn(self, day: int) -> Collection[str]:
        """Return the facts whose fresh file is there but not whole."""
        if day not in self._torn_of:
            names = self.missing.get(day, ())
            self._torn_of[day] = {name for name in names if self.paths[name][day].exists()}
        return self._torn_of[day]

    def holds(self, hour: int) -> bool:
        """Return whether any fact has a file that holds an hour, computed from whatever inputs."""
        return any(hour in hours for name in self.names for hours in self._older(name, hour // 24).values())

    def is_noted(self, name: str, unit: Unit) -> bool:
        """Return whether a file of a fact holds an hour, computed from whatever inputs."""
        return any(unit.number in hours for hours in self._older(name, unit.number // 24).values())

    def has_others(self) -> bool:
        """Return whether a folder of the days or weeks holds a file that is not the fresh one of its fact and time.

        Folders of days that rest in weeks are not looked into. Asked only where no file was missing, so nothing was
        written since the folders were listed.
        """
        of_weeks = (
            week.path not in set(self.paths[name].values())
            for name in (self.names if self.units else ())
            for week in self._weeks[name].files(min(self.units), max(self.units))
        )
        return any(of_weeks) or any(
            file.endswith(".parquet") and file != self.paths[name][day].name
            for day in self.units
            for name, files in self._listed(day).items()
            for file in files
        )

    def writer(self, name: str, day: int) -> DayWriter:
        """Return the writer of the fresh file of a fact and day; it has the rows that need not be computed."""
        hours = {u.number: self.inputs(name, u) for u in self.units[day]}
        reused: dict[int, pa.Table] = {}
        for path, noted in self._older(name, day).items():
            same = [h for h in hours if h not in reused and noted.get(h) == hours[h]]
            reused |= dict(slices(pq.ParquetFile(path).read(), "hour", same)) if same else {}
        return DayWriter(self.paths[name][day], hours, reused, self._write)

    def _are_named(self, day: int) -> bool:
        return all(self.paths[name][day].name in files for name, files in self._listed(day).items())

    def _listed(self, day: int) -> Mapping[str, frozenset[str]]:
        if day in self._names:
            return self._names[day]
        file_names = {}
        for name in (name for name in self.names if not self._is_in_week(name, day)):
            try:
                file_names[name] = frozenset(os.listdir(self.paths[name][day].parent))
            except FileNotFoundError:
                file_names[name] = frozenset()
        self._names[day] = file_names
        return file_names

    def _is_in_week(self, name: str, day: int) -> bool:
        """Return whether the rows of a fact and day are fresh in the file of their week."""
        return self.paths[name][day] != self._day_paths[name][day]

    def _older(self, name: str, day: int) -> dict[Path, Mapping[int, Mapping[str, str]]]:
        """Return the inputs by hour of each undamaged file with a fact and day; only their rows may be used again."""
        if (name, day) not in self._noted:
            folder = unit_folder(self._roots[name], name, self._site_id, day * 24)
            weeks = [week.path for week in self._weeks[name].files(day, day) if fingerprints(week.path)]
            paths = [*sorted(folder.glob("00-*.parquet")), *weeks]
            self._noted[name, day] = {p: noted for p in paths if (noted := self._read_inputs(p)) is not None}
        return self._noted[name, day]

    def _read_inputs(self, path: Path) -> Mapping[int, Mapping[str, str]] | None:
        """Return the inputs by hour that a file notes; None where it is damaged. The file of a week is read once."""
        if path not in self._noted_in:
            data = path.read_bytes()
            first_hour = first_day_of(path) * 24
            self._noted_in[path] = by_hour(noted_inputs(data), first_hour) if is_undamaged(data) else None
        return self._noted_in[path]

    def _path(self, name: str, day: int) -> Path:
        given = self._inputs_of[name]
        read = (*given.tables, *given.kinds)
        if (day, read) not in self._hashes:  # many facts read the same inputs
            hours = [[u.number, *(u.current[kind] for kind in read)] for u in self.units[day]]
            self._hashes[day, read] = text_hash(hours)
        fingerprint = text_hash([name, day, given.sql, given.settings, self._hashes[day, read]])
        return unit_folder(self._roots[name], name, self._site_id, day * 24) / f"00-{fingerprint}.parquet"


class DayWriter:
    """Collects the rows of one fact and UTC day hour by hour; the last hour publishes them as one file.

    Args:
        path: Its path.
        hours: Input hashes by UTC hour number, of all hours of the file.
        reused: Rows of hours that need not be computed.
        write: Takes path and bytes of the file, whole.
    """

    def __init__(
        self, path: Path, hours: Mapping[int, InputHashes], reused: Mapping[int, pa.Table], write: Write
    ) -> None:
        self._path, self._reused, self._write = path, dict(reused), write
        self._left = sorted(hours, reverse=True)
        self._file = FactWriter(by_kind(hours, min(hours) // 24 * 24))

    def add(self, hours: Sequence[int], rows: pa.Table) -> None:
        """Append the rows of the next hours that are not reused; `rows` may have other hours, too, in order."""
        self.add_reused()
        if self._left[: -len(hours) - 1 : -1] == hours and self._file.has_room(whole := together(rows, "hour", hours)):
            del self._left[-len(hours) :]
            self._file.add(whole)
            self.add_reused()
            return
        for hour, of_hour in slices(rows, "hour", hours):  # a row group may end with any of them
            assert self._left[-1] == hour
            self._left.pop()
            self._file.add(of_hour)
            self.add_reused()

    @property
    def is_done(self) -> bool:
        """Whether the file was published."""
        return not self._left

    def add_reused(self) -> None:
        """Append the rows of the next hours that are reused; publish the file after the last hour of all."""
        while self._left and self._left[-1] in self._reused:
            self._file.add(self._reused.pop(self._left.pop()))
        if self.is_done:
            self._write(self._path, self._file.finish())


def _publish(path: Path, data: bytes) -> None:
    """Publish a file whole or not at all; without fsync, because facts can be computed again."""
    publish(path, data, is_synced=False)


def hour_bytes(path: Path, hour: int) -> bytes:
    """Return the bytes of a fact file of one hour, given the file of its UTC day or week.

    Raises:
        StoreError: E302, the file is damaged.
    """
    data = path.read_bytes() if path.exists() else b""
    if not is_undamaged(data):
        raise damaged_facts(path, "its bytes do not match the digest in it")
    rows, noted = pq.ParquetFile(pa.BufferReader(data)).read(), by_hour(noted_inputs(data), first_day_of(path) * 24)
    ((_, of_hour),) = slices(rows, "hour", [hour])
    return fact_bytes(of_hour, inputs=noted[hour])


def slices(rows: pa.Table, column: str, numbers: Iterable[int]) -> Iterator[tuple[int, pa.Table]]:
    """Yield numbers with their rows, given rows in order of the numbers in `column`."""
    column_of = rows[column].to_numpy()
    for number in numbers:
        first, after = np.searchsorted(column_of, [number, number + 1])
        yield number, rows.slice(int(first), int(after - first))


def together(rows: pa.Table, column: str, numbers: Sequence[int]) -> pa.Table:
    """Return the rows of some numbers, in order, given rows in order of the numbers in `column`."""
    wanted = np.asarray(numbers)
    first, after = np.searchsorted(rows[column].to_numpy(), [wanted, wanted + 1])
    if np.array_equal(first[1:], after[:-1]):
        return rows.slice(int(first[0]), int(after[-1] - first[0]))
    return pa.concat_tables(rows.slice(int(f), int(n)) for f, n in zip(first, after - first, strict=True))
