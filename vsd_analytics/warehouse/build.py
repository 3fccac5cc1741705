"""`vsd build`: recompute exactly the facts whose inputs changed, like make, and say why each was stale."""

from __future__ import annotations

import contextlib
import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.errors import StoreError, disk_error
from vsd_analytics.schema import TABLES
from vsd_analytics.site.model import Site
from vsd_analytics.store import Store, removal
from vsd_analytics.store.durable import publish, sweep_temporaries
from vsd_analytics.store.layout import Part, unit_folder
from vsd_analytics.warehouse import superseded
from vsd_analytics.warehouse.build_result import BuildResult
from vsd_analytics.warehouse.compute import day_facts, hour_facts
from vsd_analytics.warehouse.factfiles import INPUTS, fact_bytes, is_undamaged_file
from vsd_analytics.warehouse.input_fingerprint import (
    FactInputs,
    InputHashes,
    SiteInputs,
    fact_inputs,
    stale_reason,
    text_hash,
)
from vsd_analytics.warehouse.sealed import SealedRange, sealed_range
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.units import PartIndex, Unit, day_unit, days_around, fact_path, hour_unit, merged_parts

BATCH_HOURS, BATCH_ROWS = 48, 2_000_000
"""Hours and stored rows per batch. Hours of a busy site are computed one by one, so that memory stays bounded."""
QUIET_HOURS, QUIET_ROWS = 168, 500_000
"""A batch of a quiet site goes on for a week: with so few rows, planning the queries costs more than running them."""


def build(
    site: Site,
    *,
    first_hour: int | None = None,
    last_hour: int | None = None,
    on_hours: Callable[[int], None] | None = None,
    on_plan: Callable[[int], None] | None = None,
    has_lock: bool = False,
    is_trusting: bool = False,
) -> BuildResult:
    """Recompute the stale facts of a range.

    Args:
        site: The project; reads `<root>/store`, writes `<root>/facts`.
        first_hour: First UTC hour number; None = everything stored.
        last_hour: Last one, inclusive.
        on_hours: Called with the number of hours done, for a progress bar.
        on_plan: Called once with the number of stale hours.
        has_lock: The caller holds the locks against removal of records (`store.removal`) and of facts, and removes
            `superseded_files` itself.
        is_trusting: Do not open files of hourly facts whose names are right, and do not search for superseded files
            unless something was stale. Reports use it: they open the files they need later anyway.

    Returns:
        What was recomputed, and why. A second call finds everything fresh. The bytes of a fact file depend on its
        inputs only, not on the range.

    Raises:
        StoreError: E302, a file of the store or of the facts is damaged. No fact is computed from a part whose bytes
            do not match the hash in its name.
        DiskError: E304 to E306, the disk failed.
    """
    import duckdb

    store, root = Store(site.root / "store", site_id=site.site_id), site.root / "facts"
    try:
        if has_lock:
            return _build(site, store, first_hour, last_hour, on_hours, on_plan, is_trusting)
        with removal.reading(store.root):
            with superseded.reading(root):
                result = _build(site, store, first_hour, last_hour, on_hours, on_plan, is_trusting)
            unneeded = list(result.superseded_files)
            if first_hour is None and last_hour is None:
                from vsd_analytics.warehouse.day_files import superseded_anywhere

                unneeded += [*superseded_anywhere(site, result), *superseded.temporaries(root)]
            superseded.clear(root, unneeded)
            return result
    except (duckdb.Error, pa.ArrowException, UnicodeDecodeError, OSError) as error:
        if refused := disk_error(error):
            raise refused from None
        store.refuse_damaged()
        if isinstance(error, pa.ArrowException | UnicodeDecodeError):
            raise damaged_facts(error) from error
        raise


def damaged_facts(error: Exception) -> StoreError:
    """Return the error for a fact file that has its full length but cannot be read."""
    return StoreError(
        "a file of the computed facts is damaged",
        code="E302",
        why=" ".join(str(error).split())[:300],
        fix="delete the folder facts and run vsd build: facts are computed from the store again",
    )


def _build(
    site: Site,
    store: Store,
    first_hour: int | None,
    last_hour: int | None,
    on_hours: Callable[[int], None] | None,
    on_plan: Callable[[int], None] | None,
    is_trusting: bool,
) -> BuildResult:
    root = site.root / "facts"
    index, hours, sealed = _range(site, store, first_hour, last_hour)
    check = _Checker(store)
    days = _fresh_days(site, root, day_units(index, [*hours, *sealed.hours], site=site), check)
    files = _Files(site, root)
    units = [hour_unit(index, h, current=_current(h, days, files.times), depends_on=files.all_inputs) for h in hours]
    stale = [u for u in units if not (is_trusting and files.are_named(u)) and files.missing(u)]
    reasons = Counter(files.reason(u) for u in stale)
    if on_plan is not None:
        on_plan(len(stale))
    built: Counter[str] = Counter()
    for batch in _batches(stale):
        check(p for parts in merged_parts(batch).values() for p in parts)
        built += _build_batch(site, files, batch, days)
        if on_hours is not None:
            on_hours(len(batch))
    fresh = {u.number: u.fingerprint for u in units}
    fresh_days = {d: day.unit.fingerprint for d, day in days.items()}
    unneeded: tuple[Path, ...] = ()
    if stale or not is_trusting or files.has_others(units, first_hour, last_hour):
        unneeded = superseded.find(
            root,
            site_id=site.site_id,
            hours=fresh,
            days=fresh_days,
            sealed=sealed,
            first_hour=first_hour,
            last_hour=last_hour,
        )
    return BuildResult(
        len(units) - len(stale),
        reasons,
        {**{h: s.fingerprint for h, s in sealed.hours.items()}, **fresh},
        {d: fingerprint for d, fingerprint in fresh_days.items() if d not in sealed.whole_days},
        sealed,
        built,
        unneeded,
    )


def _range(
    site: Site, store: Store, first_hour: int | None, last_hour: int | None
) -> tuple[PartIndex, list[int], SealedRange]:
    """Return the parts of a range and around it, its hours whose facts are computed, and its sealed facts."""
    # An hour reads its neighbours, and the UTC days of all three for `camera_days`: 25 hours reach all of these.
    around = (None if first_hour is None else first_hour - 25, None if last_hour is None else last_hour + 25)
    index = PartIndex(store, first_hour=around[0], last_hour=around[1])
    sealed = sealed_range(site, first_hour, last_hour)
    hours = [h for h in index.hours() if first_hour is None or h >= first_hour]
    return index, [h for h in hours if (last_hour is None or h <= last_hour) and not sealed.holds(h)], sealed


@dataclass(frozen=True, slots=True)
class BuildPlan:
    """Which fact files a range should have.

    Attributes:
        hours: By UTC hour with records, its files and the input hashes of each; None where the fingerprint is unknown,
            because the fact `camera_days` of a day around it has to be computed first.
        days: By UTC day, the file of `camera_days` and its input hashes.
    """

    hours: Mapping[int, Mapping[Path, InputHashes] | None]
    days: Mapping[int, Mapping[Path, InputHashes]]


def build_plan(site: Site, *, first_hour: int | None = None, last_hour: int | None = None) -> BuildPlan:
    """Return which fact files a range has after a build, without computing or writing anything."""
    root, store = site.root / "facts", Store(site.root / "store", site_id=site.site_id)
    index, hours, sealed = _range(site, store, first_hour, last_hour)
    low, high = first_hour if first_hour is not None else -(10**9), last_hour if last_hour is not None else 10**9
    begun = [h for h in index.hours() if low <= h // 24 * 24 <= high]  # the file of a day lies in its first hour
    units = day_units(index, [*hours, *sealed.hours, *begun], site=site)
    paths = {u.number: fact_path(root, "camera_days", site.site_id, u, is_day=True) for u in units}
    days = _read_days([u for u in units if is_undamaged_file(paths[u.number])], paths)
    known = {h for h in hours if all(d in days for d in days_around(h) if d in paths)}
    files = _Files(site, root)
    wanted: dict[int, Mapping[Path, InputHashes] | None] = dict.fromkeys(hours)
    for hour in sorted(known):
        unit = hour_unit(index, hour, current=_current(hour, days, files.times), depends_on=files.all_inputs)
        wanted[hour] = {files.path(name, unit): files.inputs(name, unit) for name in files.names}
    return BuildPlan(wanted, {u.number: {paths[u.number]: u.inputs} for u in units})


def hourly_inputs(site: Site) -> FactInputs:
    """Return what the hourly facts together depend on: hashes of SQL and settings, and which other inputs they read."""
    return fact_inputs(site, [r.name for r in relations("facts").values() if r.unit == "hour"])


def day_units(index: PartIndex, hours: Iterable[int], *, site: Site) -> list[Unit]:
    """Return the units of the UTC days of some hours and of their neighbours; days without parts have none."""
    days = sorted({d for h in hours for d in days_around(h)})
    current, depends_on = SiteInputs(site).of_day(), fact_inputs(site, ["camera_days"])
    units = (day_unit(index, day, current=current, depends_on=depends_on) for day in days)
    return [u for u in units if any(u.parts.values())]


@dataclass(frozen=True, slots=True)
class _Day:
    """The fact `camera_days` of one UTC day: its unit, rows, hash of the rows, and cameras."""

    unit: Unit
    rows: pa.Table
    digest: str
    cameras: frozenset[str]


def _current(hour: int, days: Mapping[int, _Day], times: SiteInputs) -> InputHashes:
    """Return the hashes of an hour's inputs besides records, SQL and settings."""
    around = [days[d] for d in days_around(hour) if d in days]
    present = frozenset[str]().union(*(day.cameras for day in around))
    return {**times.of_hour(hour, present=present), "frame interval": text_hash([day.digest for day in around])}


class _Checker:
    """Raises on damaged parts before their rows become facts; reads each part once."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._seen: set[Part] = set()

    def __call__(self, parts: Iterable[Part]) -> None:
        new = set(parts) - self._seen
        self._store.refuse_damaged(sorted(new))
        self._seen |= new


def _fresh_days(
    site: Site, root: Path, units: Sequence[Unit], check: Callable[[Iterable[Part]], None]
) -> dict[int, _Day]:
    """Return the fact `camera_days` of each UTC day, after computing the stale ones."""
    relation = relations("facts")["camera_days"]
    paths = {u.number: fact_path(root, relation.name, site.site_id, u, is_day=True) for u in units}
    for batch in _batches([u for u in units if not is_whole(paths[u.number])]):
        check(p for parts in merged_parts(batch).values() for p in parts)
        rows = day_facts(site, merged_parts(batch), first_day=batch[0].number, last_day=batch[-1].number)
        for unit, own in _slices(rows, "utc_day", batch):
            _write(paths[unit.number], own, unit.inputs)
        for folder in {paths[u.number].parent for u in batch}:
            sweep_temporaries(folder)
    return _read_days(units, paths)


def _read_days(units: Sequence[Unit], paths: Mapping[int, Path]) -> dict[int, _Day]:
    try:
        tables = {u.number: pq.ParquetFile(paths[u.number]).read() for u in units}
    except (pa.ArrowException, OSError) as error:
        raise damaged_facts(error) from None
    cameras = {day: frozenset(rows["camera_id"].to_pylist()) for day, rows in tables.items()}
    digests = {day: text_hash(rows.to_pylist()) for day, rows in tables.items()}
    return {u.number: _Day(u, tables[u.number], digests[u.number], cameras[u.number]) for u in units}


class _Files:
    """The files of the hourly facts: which are fresh, why the others are stale, and which of those can be reused.

    All files of a unit have one fingerprint in their names, over the inputs of all facts together: so one name answers
    whether a unit is fresh. Each file holds the hashes of its own inputs. When the fingerprint changes, the file of a
    fact that does not read what changed is linked to the new name instead of computed again.
    """

    def __init__(self, site: Site, root: Path) -> None:
        self._root, self._site_id = root, site.site_id
        self.names = [r.name for r in relations("facts").values() if r.unit == "hour"]
        self.times = SiteInputs(site)
        self.all_inputs = hourly_inputs(site)
        self._inputs_of = {name: fact_inputs(site, [name]) for name in self.names}
        self._listed: dict[int, list[frozenset[str]]] = {}

    def path(self, name: str, unit: Unit) -> Path:
        """Return the path of the fresh file of a fact and unit."""
        return fact_path(self._root, name, self._site_id, unit, is_day=False)

    def are_named(self, unit: Unit) -> bool:
        """Return whether every fact has a file of the unit's fingerprint, complete or not.

        Lists each day's folders once instead of opening the 24 files of every fact.
        """
        day = unit.number // 24
        if day not in self._listed:
            folders = [unit_folder(self._root, name, self._site_id, unit.number) for name in self.names]
            self._listed[day] = [frozenset(os.listdir(f) if f.is_dir() else ()) for f in folders]
        file = self.path(self.names[0], unit).name
        return all(file in names for names in self._listed[day])

    def has_others(self, units: Sequence[Unit], first_hour: int | None, last_hour: int | None) -> bool:
        """Return whether the folders that `are_named` listed hold a file of the range that belongs to no unit."""
        fresh = {(u.number // 24, self.path(self.names[0], u).name) for u in units}
        found = {(day, name) for day, listed in self._listed.items() for names in listed for name in names} - fresh
        hours = [day * 24 + int(name[:2]) for day, name in found if name[:2].isdecimal()]
        low, high = min(hours, default=0) if first_hour is None else first_hour, last_hour
        return any(low <= h and (high is None or h <= high) for h in hours)

    def missing(self, unit: Unit) -> list[str]:
        """Return the facts with a unit that has no complete fresh file."""
        return [name for name in self.names if not is_whole(self.path(name, unit))]

    def inputs(self, name: str, unit: Unit) -> InputHashes:
        """Return the input hashes of one fact of a unit."""
        return self._inputs_of[name].of_unit(unit.current)

    def reason(self, unit: Unit) -> str:
        """Return in words why a unit is stale."""
        changed, has_any, has_fresh = set[str](), False, False
        for name in self.names:
            paths, fresh = self._any(name, unit), self.path(name, unit)
            has_any, has_fresh = has_any or bool(paths), has_fresh or fresh in paths
            for noted in map(_noted_inputs, () if fresh in paths else paths):
                changed |= {c for c, h in self.inputs(name, unit).items() if noted and noted.get(c) != h}
        if not has_any:
            return "new"
        # No input of an old file changed: a fresh file is torn, or a newer version added a fact.
        return stale_reason(changed) or ("incomplete" if has_fresh else "SQL changed")

    def reuse(self, unit: Unit) -> None:
        """Link the files of facts whose own inputs did not change to the unit's new fingerprint."""
        for name in self.missing(unit):
            for path in self._any(name, unit):
                if _noted_inputs(path) == self.inputs(name, unit):
                    with contextlib.suppress(FileExistsError, FileNotFoundError):  # another build was faster
                        os.link(path, self.path(name, unit))  # not renamed: a reader may still need the old name
                    break

    def _any(self, name: str, unit: Unit) -> list[Path]:
        folder = unit_folder(self._root, name, self._site_id, unit.number)
        return sorted(folder.glob(f"{unit.number % 24:02d}-*.parquet"))


def _build_batch(site: Site, files: _Files, units: Sequence[Unit], days: Mapping[int, _Day]) -> Counter[str]:
    """Make the facts of units fresh; return the number of computed units by fact."""
    for unit in units:
        files.reuse(unit)
    missing = {name: [u for u in units if not is_whole(files.path(name, u))] for name in files.names}
    needed = sorted({d for u in units for d in days_around(u.number) if d in days})
    if wanted := [name for name, stale in missing.items() if stale]:
        computed = hour_facts(
            site,
            facts=wanted,
            parts=merged_parts(units),
            camera_days=pa.concat_tables([days[d].rows for d in needed]),
            first_hour=units[0].number,
            last_hour=units[-1].number,
        )
        for relation, rows in computed:
            name = relation.name
            for unit, own in _slices(rows, "hour", missing[name]):
                _write(files.path(name, unit), own, files.inputs(name, unit))
    for name in files.names:
        for folder in {files.path(name, unit).parent for unit in units}:
            sweep_temporaries(folder)
    return Counter({name: len(stale) for name, stale in missing.items() if stale})


def is_whole(path: Path) -> bool:
    """Return whether a fact file exists to its end: Parquet ends with the length of its footer and `PAR1`.

    Reads 8 bytes. Facts are written without fsync, so a power cut can leave a short file under a right name.
    """
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - 8))
            tail = file.read(8)
    except OSError:
        return False
    return tail[4:] == b"PAR1" and int.from_bytes(tail[:4], "little") + 12 <= size


def _slices(rows: pa.Table, column: str, units: Iterable[Unit]) -> Iterator[tuple[Unit, pa.Table]]:
    """Yield units with their rows, given rows in order of the units' numbers in `column`."""
    import numpy as np

    numbers = rows[column].to_numpy()
    for unit in units:
        first, after = np.searchsorted(numbers, [unit.number, unit.number + 1])
        yield unit, rows.slice(int(first), int(after - first))


def _write(path: Path, rows: pa.Table, inputs: InputHashes) -> None:
    """Write a fact file whole or not at all, without fsync: facts can be computed again."""
    publish(path, fact_bytes(rows, inputs=inputs), is_synced=False)


def _batches(units: Sequence[Unit]) -> Iterator[Sequence[Unit]]:
    """Yield runs of units within the limits of hours (or as many days) and rows; each holds at least one unit."""
    batch: list[Unit] = []
    n_rows = 0
    for unit in units:
        own = sum(pq.read_metadata(p.path).num_rows for t in TABLES for p in unit.own_parts(t))
        span = unit.number - batch[0].number if batch else 0
        is_within = span < BATCH_HOURS and n_rows + own <= BATCH_ROWS
        if batch and not is_within and not (span < QUIET_HOURS and n_rows + own <= QUIET_ROWS):
            yield batch
            batch, n_rows = [], 0
        batch.append(unit)
        n_rows += own
    if batch:
        yield batch


def _noted_inputs(path: Path) -> InputHashes | None:
    """Return the input hashes in a fact file's metadata; None when it is torn or has none."""
    noted = (pq.read_metadata(path).metadata or {}).get(INPUTS) if is_whole(path) else None
    return None if noted is None else {str(c): str(h) for c, h in json.loads(noted).items()}
