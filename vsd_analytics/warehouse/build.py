"""Facts, like make: recompute exactly the stale units and say why each was stale."""

from __future__ import annotations

import contextlib
import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.errors import StoreError, disk_error
from vsd_analytics.schema import TABLES
from vsd_analytics.site import Site
from vsd_analytics.store import Store, removal
from vsd_analytics.store.durable import publish, sweep_temporaries
from vsd_analytics.store.layout import Part, unit_folder
from vsd_analytics.warehouse import leftovers
from vsd_analytics.warehouse.causes import Causes, Needs, SiteTimes, needs, text_hash, told
from vsd_analytics.warehouse.compute import day_facts, hour_facts
from vsd_analytics.warehouse.factfiles import CAUSES, fact_bytes, is_undamaged_file
from vsd_analytics.warehouse.sealed import SealedRange, sealed_range
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.units import PartIndex, Unit, day_unit, days_around, fact_path, hour_unit, merged_parts

BATCH_HOURS = 24
BATCH_ROWS = 2_000_000
"""Rows computed at once: days of quiet sites together, hours of busy ones apart."""


@dataclass(frozen=True, slots=True)
class BuildResult:
    """What a build did.

    Attributes:
        n_fresh: Units that were already right.
        reasons: Number of recomputed hours by reason, such as "new" or "settings changed".
        facts: Number of recomputed hours by fact: what does not depend on a change is kept.
        fingerprints: Fingerprint by UTC hour of all hours in the range, now fresh or sealed.
        day_fingerprints: Fingerprint by UTC day number of the days they lie in or border on, without sealed days.
        sealed: Hours and days whose records were purged: their facts are never computed again.
        leftovers: Fact files of the range that newer ones took the place of.
    """

    n_fresh: int
    reasons: Counter[str]
    fingerprints: Mapping[int, str]
    day_fingerprints: Mapping[int, str]
    sealed: SealedRange = field(default_factory=SealedRange)
    facts: Counter[str] = field(default_factory=Counter)
    leftovers: Sequence[Path] = ()

    @property
    def n_built(self) -> int:
        """Return the number of recomputed hours."""
        return sum(self.reasons.values())


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
    """Make the facts of a range fresh.

    Args:
        site: The project; `<root>/store` is read, `<root>/facts` written.
        first_hour: First UTC hour number; None = everything stored.
        last_hour: Last one, inclusive.
        on_hours: Called with the number of hours done, for a progress bar.
        on_plan: Called once with the number of stale hours.
        has_lock: The caller itself keeps away removals of records (`store.removal`) and of facts, and removes what is
            left over (`leftovers`).
        is_trusting: Take files of hourly facts for whole by their names, and leave leftovers to a build that is not, or
            that has something to do.

    Returns:
        What was recomputed, and why. A second call finds everything fresh. The bytes of a fact file depend on what its
        fingerprint covers alone, not on the range asked for.

    Raises:
        StoreError: E302, a file of the store or of the facts is damaged: no fact is made from a part whose bytes are
            not those of its name.
        DiskError: E304 to E306, the disk refused.
    """
    import duckdb

    store, root = Store(site.root / "store", site_id=site.site_id), site.root / "facts"
    try:
        if has_lock:
            return _build(site, store, first_hour, last_hour, on_hours, on_plan, is_trusting)
        with removal.reading(store.root):
            with leftovers.reading(root):
                result = _build(site, store, first_hour, last_hour, on_hours, on_plan, is_trusting)
            leftovers.clear(root, result.leftovers)
            return result
    except (duckdb.Error, pa.ArrowException, UnicodeDecodeError, OSError) as error:
        if refused := disk_error(error):
            raise refused from None
        store.refuse_damaged()
        if isinstance(error, pa.ArrowException | UnicodeDecodeError):
            raise damaged_facts(error) from error
        raise


def damaged_facts(error: Exception) -> StoreError:
    """Return the error of fact files that are whole by their length and cannot be read all the same."""
    return StoreError(
        "a file of the computed facts is damaged",
        code="E302",
        why=" ".join(str(error).split())[:300],
        mend="delete the folder facts and run vsd build: facts are computed from the store again",
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
    now = {h: _now(h, days, files.times) for h in hours}
    units = [hour_unit(index, h, now=now[h], needs=files.all_needs) for h in hours]
    stale = [u for u in units if not (is_trusting and files.are_named(u)) and files.lacking(u)]
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
    left: tuple[Path, ...] = ()
    if stale or not is_trusting:
        left = leftovers.find(
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
        left,
    )


def _range(
    site: Site, store: Store, first_hour: int | None, last_hour: int | None
) -> tuple[PartIndex, list[int], SealedRange]:
    """Return the parts of a range and around it, its hours whose facts are computed, and what is sealed of it."""
    around = (None if first_hour is None else first_hour - 25, None if last_hour is None else last_hour + 25)
    index = PartIndex(store, first_hour=around[0], last_hour=around[1])
    sealed = sealed_range(site, first_hour, last_hour)
    hours = [h for h in index.hours() if first_hour is None or h >= first_hour]
    return index, [h for h in hours if (last_hour is None or h <= last_hour) and not sealed.holds(h)], sealed


@dataclass(frozen=True, slots=True)
class Plan:
    """Which fact files a range should have.

    Attributes:
        hours: By UTC hour with records, its files and the causes noted in each; None where they cannot be known, since
            the fact `camera_days` beside it has to be computed first.
        days: By UTC day, the file of `camera_days` and its causes.
    """

    hours: Mapping[int, Mapping[Path, Causes] | None]
    days: Mapping[int, Mapping[Path, Causes]]


def plan(site: Site, *, first_hour: int | None = None, last_hour: int | None = None) -> Plan:
    """Return which fact files a build of a range would leave, without computing or writing anything."""
    root, store = site.root / "facts", Store(site.root / "store", site_id=site.site_id)
    index, hours, sealed = _range(site, store, first_hour, last_hour)
    low, high = first_hour if first_hour is not None else -(10**9), last_hour if last_hour is not None else 10**9
    begun = [h for h in index.hours() if low <= h // 24 * 24 <= high]  # their days' files stand in the range
    units = day_units(index, [*hours, *sealed.hours, *begun], site=site)
    paths = {u.number: fact_path(root, "camera_days", site.site_id, u, is_day=True) for u in units}
    days = _read_days([u for u in units if is_undamaged_file(paths[u.number])], paths)
    known = {h for h in hours if all(d in days for d in days_around(h) if d in paths)}
    files = _Files(site, root)
    wanted: dict[int, Mapping[Path, Causes] | None] = dict.fromkeys(hours)
    for hour in sorted(known):
        unit = hour_unit(index, hour, now=_now(hour, days, files.times), needs=files.all_needs)
        wanted[hour] = {files.path(name, unit): files.causes(name, unit) for name in files.names}
    return Plan(wanted, {u.number: {paths[u.number]: u.causes} for u in units})


def hour_needs(site: Site) -> Needs:
    """Return what the hourly facts together depend on, the same for every hour."""
    return needs(site, [r.name for r in relations("facts").values() if r.unit == "hour"])


def day_units(index: PartIndex, hours: Iterable[int], *, site: Site) -> list[Unit]:
    """Return the units of the UTC days that hours and those beside them lie in, of days with parts."""
    days = sorted({d for h in hours for d in days_around(h)})
    now, needed = SiteTimes(site).of_day(), needs(site, ["camera_days"])
    return [u for u in (day_unit(index, day, now=now, needs=needed) for day in days) if any(u.parts.values())]


@dataclass(frozen=True, slots=True)
class _Day:
    """The fact `camera_days` of one UTC day."""

    unit: Unit
    rows: pa.Table
    digest: str
    cameras: frozenset[str]


def _now(hour: int, days: Mapping[int, _Day], times: SiteTimes) -> Causes:
    """Return hashes of what the facts of an hour depend on besides records, SQL and settings."""
    around = [days[d] for d in days_around(hour) if d in days]
    present = frozenset[str]().union(*(day.cameras for day in around))
    return {**times.of_hour(hour, present=present), "frame interval": text_hash([day.digest for day in around])}


class _Checker:
    """Refuses damaged parts before their rows become facts, reading each part once."""

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
    """Return the fact `camera_days` of each UTC day, computed where it is stale."""
    relation = relations("facts")["camera_days"]
    paths = {u.number: fact_path(root, relation.name, site.site_id, u, is_day=True) for u in units}
    for batch in _batches([u for u in units if not is_whole(paths[u.number])]):
        check(p for parts in merged_parts(batch).values() for p in parts)
        rows = day_facts(site, merged_parts(batch))
        for unit in batch:
            _write(paths[unit.number], _slice(rows, "utc_day", unit.number), unit.causes)
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
    """The files of the hourly facts: which are right, why the others are not, which of those can be kept.

    A unit's files carry one fingerprint, over the causes of all facts. When it changes, a fact that does not depend on
    what changed keeps its file under the new name.
    """

    def __init__(self, site: Site, root: Path) -> None:
        self._root, self._site_id = root, site.site_id
        self.names = [r.name for r in relations("facts").values() if r.unit == "hour"]
        self.times = SiteTimes(site)
        self.all_needs = hour_needs(site)
        self._needs = {name: needs(site, [name]) for name in self.names}
        self._listed: dict[int, list[frozenset[str]]] = {}

    def path(self, name: str, unit: Unit) -> Path:
        """Return where the fresh file of a fact and unit stands."""
        return fact_path(self._root, name, self._site_id, unit, is_day=False)

    def are_named(self, unit: Unit) -> bool:
        """Tell whether a file of every fact stands under the unit's fingerprint, be it whole or not."""
        day = unit.number // 24
        if day not in self._listed:
            folders = [unit_folder(self._root, name, self._site_id, unit.number) for name in self.names]
            self._listed[day] = [frozenset(os.listdir(f) if f.is_dir() else ()) for f in folders]
        file = self.path(self.names[0], unit).name
        return all(file in names for names in self._listed[day])

    def lacking(self, unit: Unit) -> list[str]:
        """Return the facts of which a unit has no fresh file."""
        return [name for name in self.names if not is_whole(self.path(name, unit))]

    def causes(self, name: str, unit: Unit) -> Causes:
        """Return what a fact of a unit depends on."""
        return self._needs[name].causes(unit.now)

    def reason(self, unit: Unit) -> str:
        """Return in words why a unit is stale."""
        changed, has_any, has_fresh = set[str](), False, False
        for name in self.names:
            paths, fresh = self._any(name, unit), self.path(name, unit)
            has_any, has_fresh = has_any or bool(paths), has_fresh or fresh in paths
            for noted in map(_noted, () if fresh in paths else paths):
                changed |= {c for c, h in self.causes(name, unit).items() if noted and noted.get(c) != h}
        if not has_any:
            return "new"
        return told(changed) or ("incomplete" if has_fresh else "SQL changed")  # a fact was added

    def keep(self, unit: Unit) -> None:
        """Give the files of facts that do not depend on what changed the unit's new fingerprint."""
        for name in self.lacking(unit):
            for path in self._any(name, unit):
                if _noted(path) == self.causes(name, unit):
                    with contextlib.suppress(FileExistsError, FileNotFoundError):  # another build was faster
                        os.link(path, self.path(name, unit))  # whoever reads the old name does not lose it
                    break

    def _any(self, name: str, unit: Unit) -> list[Path]:
        folder = unit_folder(self._root, name, self._site_id, unit.number)
        return sorted(folder.glob(f"{unit.number % 24:02d}-*.parquet"))


def _build_batch(site: Site, files: _Files, units: Sequence[Unit], days: Mapping[int, _Day]) -> Counter[str]:
    """Make the facts of units fresh; return how many units of each were computed."""
    for unit in units:
        files.keep(unit)
    lacking = {name: [u for u in units if not is_whole(files.path(name, u))] for name in files.names}
    needed = sorted({d for u in units for d in days_around(u.number) if d in days})
    if wanted := [name for name, stale in lacking.items() if stale]:
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
            for unit in lacking[name]:
                _write(files.path(name, unit), _slice(rows, "hour", unit.number), files.causes(name, unit))
    for name in files.names:
        for folder in {files.path(name, unit).parent for unit in units}:
            sweep_temporaries(folder)
    return Counter({name: len(stale) for name, stale in lacking.items() if stale})


def is_whole(path: Path) -> bool:
    """Tell whether a fact file is there to its end: Parquet ends with the length of its footer and `PAR1`."""
    try:
        with path.open("rb") as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(0, size - 8))
            tail = file.read(8)
    except OSError:
        return False
    return tail[4:] == b"PAR1" and int.from_bytes(tail[:4], "little") + 12 <= size


def _slice(rows: pa.Table, column: str, number: int) -> pa.Table:
    """Return the rows of one unit out of rows that are ordered by unit."""
    import numpy as np

    numbers = rows[column].to_numpy()
    first, after = np.searchsorted(numbers, [number, number + 1])
    return rows.slice(int(first), int(after - first))


def _write(path: Path, rows: pa.Table, causes: Causes) -> None:
    """Write a fact file wholly or not at all (facts can be made again, so nothing waits for the disk)."""
    publish(path, fact_bytes(rows, causes=causes), is_synced=False)


def _batches(units: Sequence[Unit]) -> Iterator[Sequence[Unit]]:
    """Yield runs of units, each of at most about BATCH_ROWS rows and BATCH_HOURS hours or days."""
    batch: list[Unit] = []
    n_rows = 0
    for unit in units:
        own = sum(pq.read_metadata(p.path).num_rows for t in TABLES for p in unit.own_parts(t))
        if batch and (n_rows + own > BATCH_ROWS or unit.number >= batch[0].number + BATCH_HOURS):
            yield batch
            batch, n_rows = [], 0
        batch.append(unit)
        n_rows += own
    if batch:
        yield batch


def _noted(path: Path) -> Causes | None:
    """Return the causes noted in a fact file; None when it is torn or notes none."""
    noted = (pq.read_metadata(path).metadata or {}).get(CAUSES) if is_whole(path) else None
    return None if noted is None else {str(c): str(h) for c, h in json.loads(noted).items()}
