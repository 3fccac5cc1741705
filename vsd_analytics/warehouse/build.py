"""`vsd build`: recompute exactly the facts whose inputs changed, like make, and say why each was stale."""

from __future__ import annotations

import contextlib
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa

from vsd_analytics.errors import disk_error
from vsd_analytics.site.model import Site
from vsd_analytics.store import removal
from vsd_analytics.store.durable import publish, sweep_temporaries
from vsd_analytics.store.layout import Part
from vsd_analytics.store.published import publish_links
from vsd_analytics.store.reused_memory import reused_memory
from vsd_analytics.store.seals import DAY_FACT
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse import settings_variants, superseded
from vsd_analytics.warehouse.accelerated.switch import ONLY_COUNTS
from vsd_analytics.warehouse.agreement import refuse_disagreement
from vsd_analytics.warehouse.build_result import BuildResult
from vsd_analytics.warehouse.camera_days import (
    KnownDay,
    day_bytes,
    day_path,
    day_units,
    hour_units,
    joined_days,
    read_days,
    weeks_of_days,
)
from vsd_analytics.warehouse.compute import day_facts, hour_facts
from vsd_analytics.warehouse.distributed import DistributedRun, publish_days
from vsd_analytics.warehouse.fact_days import DayWriter, FactDays, slices
from vsd_analytics.warehouse.factfiles import damaged_facts, is_undamaged_file, is_whole
from vsd_analytics.warehouse.input_fingerprint import InputHashes
from vsd_analytics.warehouse.sealed import SealedRange, sealed_range
from vsd_analytics.warehouse.sqlfiles import Relation, relations
from vsd_analytics.warehouse.staff import FACTS, NOBODY, StaffHours, hours_around, staff_hours
from vsd_analytics.warehouse.stored_records import PartReader
from vsd_analytics.warehouse.units import BATCH_ROWS, COUNTED_ROWS, PartIndex, Unit, batches, days_around, merged_parts


def build(
    site: Site,
    *,
    first_hour: int | None = None,
    last_hour: int | None = None,
    facts: Collection[str] | None = None,
    on_hours: Callable[[int], None] | None = None,
    on_plan: Callable[[int], None] | None = None,
    has_lock: bool = False,
    is_trusting: bool = False,
    is_published: bool = False,
    distributed: DistributedRun | None = None,
) -> BuildResult:
    """Recompute the stale facts of a range.

    Args:
        site: The project; reads `<root>/store`, writes `<root>/facts`.
        first_hour: First UTC hour number; None = everything stored. Facts are computed by whole UTC days.
        last_hour: Last one, inclusive.
        facts: Names of the hourly facts that are asked for; None = all. Files of the others stay as they are.
        on_hours: Called with the number of hours done, for a progress bar.
        on_plan: Called once with the number of stale hours.
        has_lock: The caller holds the locks against removal of records (`store.removal`) and of facts, and removes
            `superseded_files` itself.
        is_trusting: Do not open files of hourly facts whose names are right, and do not search for superseded files
            unless something was stale. Reports use it: they open the files they need later anyway.
        is_published: Swap `published/current` to the facts of everything stored (`store.published`). Needs the whole
            range, and the settings of vsd.toml.
        distributed: Runs units of a day elsewhere (`warehouse.distributed`); None = compute everything here.

    Returns:
        What was recomputed, and why. A second call finds everything fresh. The bytes of a fact file depend on its
        inputs only, not on the range or on which facts are asked for.

    Raises:
        ConfigError: E321, vsd.toml does not describe what is stored (`warehouse.agreement`).
        StoreError: E302, a file of the store or of the facts is damaged. No fact is computed from a part whose bytes
            do not match the hash in its name.
        DiskError: E304 to E306, the disk failed.
    """
    store, root = Store(site.root / "store", site_id=site.site_id), site.root / "facts"
    try:
        if has_lock:
            with reused_memory():
                return _build(site, store, first_hour, last_hour, facts, on_hours, on_plan, is_trusting, distributed)
        with reused_memory(), removal.reading(store.root):
            with superseded.reading(root):
                result = _build(site, store, first_hour, last_hour, facts, on_hours, on_plan, is_trusting, distributed)
                is_published = is_published and first_hour is last_hour is None and _publish(site, result)
            unneeded = list(result.superseded_files)
            if first_hour is None and last_hour is None:
                from vsd_analytics.warehouse.day_files import superseded_anywhere

                fresh = {path for of_day in result.paths.values() for path in of_day.values()}
                unneeded += [*superseded_anywhere(site, fresh), *superseded.temporaries(root)]
            superseded.clear(root, unneeded, has_published=is_published)
            return result
    except (*_errors_of_duckdb(), pa.ArrowException, UnicodeDecodeError, OSError) as error:
        if refused := disk_error(error):
            raise refused from None
        store.refuse_damaged()
        if isinstance(error, pa.ArrowException | UnicodeDecodeError):
            raise damaged_facts(error) from error
        raise


def _errors_of_duckdb() -> tuple[type[Exception], ...]:
    import duckdb  # asked for after an error only: facts without a query need no DuckDB

    return (duckdb.Error,)


def _build(
    site: Site,
    store: Store,
    first_hour: int | None,
    last_hour: int | None,
    facts: Collection[str] | None,
    on_hours: Callable[[int], None] | None,
    on_plan: Callable[[int], None] | None,
    is_trusting: bool,
    distributed: DistributedRun | None,
) -> BuildResult:
    first_day, last_day = _days(first_hour, last_hour)
    index, hours, sealed = _range(site, store, first_day, last_day)
    check = _Checker(store)
    day_units_of = day_units(index, [*hours, *sealed.hours], site=site)
    days = _fresh_days(site, day_units_of, check, distributed)
    refuse_disagreement(site, {number: day.cameras for number, day in days.items()}, sealed)
    staff, outdated = _staff_of(site, store, first_day, last_day, is_trusting)
    units = hour_units(site, index, hours, days, staff)
    files = FactDays(site, units, facts=facts, is_trusting=is_trusting)
    files.split_weeks()
    stale = _stale(files)
    computed = _computed(units, stale)
    reasons = Counter(files.reason(u) for u in computed)
    if on_plan is not None:
        on_plan(len(computed))
    if distributed is not None and len(stale) > 1 and site.settings.people == "all":
        n_hours = Counter(u.number // 24 for u in computed)
        wanted = {d: [files.paths[n][d] for n in stale[d]] for d in sorted(stale, key=lambda d: -n_hours[d])}
        publish_days(hour_work, site, wanted, distributed, on_day=lambda day: on_hours and on_hours(n_hours[day]))
    else:
        _write_hours(site, files, stale, computed, days, staff, check=check, on_hours=on_hours)
    for folder in {files.paths[name][day].parent for day in stale for name in files.names}:
        sweep_temporaries(folder)
    unneeded = outdated
    without = sealed.whole_days | {hour // 24 for hour in sealed.hours}
    unsealed = [u for u in day_units_of if u.number not in sealed.whole_days]
    paths = {
        **files.joined(first_day=first_day, last_day=last_day, without=without),
        DAY_FACT: joined_days(site, unsealed, first_day=first_day, last_day=last_day, without=without),
    }
    if files.missing or not is_trusting or paths != files.paths or files.has_others():
        # Of facts that nobody asked for, older files stay: rows of the hours that did not change are taken from them.
        asked = {DAY_FACT, *files.names, *(relations("facts").keys() - files.paths.keys())}
        superseded_files = superseded.find(
            {name: root for name, root in settings_variants.roots(site).items() if name in asked},
            site_id=site.site_id,
            fresh=paths,
            sealed=sealed,
            first_day=first_day,
            last_day=last_day,
        )
        unneeded = (*unneeded, *superseded_files, *settings_variants.surplus(site))
    settings_variants.note_use(site)
    fingerprints = {h: s.fingerprint for h, s in sealed.hours.items()}
    fingerprints |= {u.number: u.fingerprint_of_marts for u in units}
    return BuildResult(
        len(units) - len(computed),
        reasons,
        {h: fingerprint for h, fingerprint in sorted(fingerprints.items()) if _is_within(h, first_hour, last_hour)},
        {d: day.unit.fingerprint for d, day in days.items() if d not in sealed.whole_days},
        paths,
        sealed,
        +Counter({name: sum(len(of_day.get(name, ())) for of_day in stale.values()) for name in files.names}),
        unneeded,
    )


def day_work(site: Site, day: int) -> dict[str, bytes]:
    """Return the file of the fact `camera_days` of a UTC day by its path below the project: a unit of `distributed`."""
    store = Store(site.root / "store", site_id=site.site_id)
    index = PartIndex(store, first_hour=day * 24, last_hour=day * 24 + 23)
    unit = next(u for u in day_units(index, [day * 24], site=site) if u.number == day)
    parts = merged_parts([unit])
    _Checker(store)(p for of_table in parts.values() for p in of_table)
    (_, rows), *_ = slices(day_facts(site, parts), "utc_day", [day])
    path = day_path(site, unit)
    return {str(path.relative_to(site.root)): day_bytes(unit, rows)}


def hour_work(site: Site, day: int) -> dict[str, bytes]:
    """Return the missing files of the hourly facts of a UTC day by path below the project: a unit of `distributed`.

    Reads the fact `camera_days` of the days around, which must be there.
    """
    store, contents = Store(site.root / "store", site_id=site.site_id), dict[str, bytes]()
    index, hours, sealed = _range(site, store, day, day)
    units_of_days = day_units(index, [*hours, *sealed.hours], site=site)
    days = read_days(site, units_of_days)
    units = hour_units(site, index, hours, days)

    def write(path: Path, data: bytes) -> None:
        contents[str(path.relative_to(site.root))] = data

    files = FactDays(site, units, write=write)
    stale = _stale(files)
    computed = _computed(units, stale)
    _write_hours(site, files, stale, computed, days, NOBODY, check=_Checker(store), on_hours=None)
    return contents


def _stale(files: FactDays) -> dict[int, dict[str, set[int]]]:
    """Return the stale hours of each missing file, by UTC day and fact."""
    missing = files.missing.items()
    return {day: {n: {u.number for u in files.stale(n, day)} for n in names} for day, names in missing}


def _computed(units: Iterable[Unit], stale: Mapping[int, Mapping[str, Collection[int]]]) -> list[Unit]:
    return [u for u in units if any(u.number in numbers for numbers in stale.get(u.number // 24, {}).values())]


def _publish(site: Site, result: BuildResult) -> bool:
    """Publish the fresh and sealed files of each fact; return whether they are current now.

    A full or read-only disk costs nothing but the new generation.
    """
    if settings_variants.folder(site) is not None:
        return False
    with contextlib.suppress(OSError):
        return publish_links(site.root, current_files(site, result))
    return False


def current_files(site: Site, result: BuildResult) -> dict[str, list[Path]]:
    """Return the fresh and sealed files of each fact, given the build of everything stored."""
    sealed = {name: [path for _, path in result.sealed.fact_paths(site, name)] for name in relations("facts")}
    files = {name: [*dict.fromkeys(result.paths.get(name, {}).values()), *paths] for name, paths in sealed.items()}
    return {name: paths for name, paths in files.items() if paths}


def _write_hours(
    site: Site,
    files: FactDays,
    stale: Mapping[int, Mapping[str, Collection[int]]],
    computed: Sequence[Unit],
    days: Mapping[int, KnownDay],
    staff: StaffHours,
    *,
    check: _Checker,
    on_hours: Callable[[int], None] | None,
) -> None:
    """Compute stale hours batch by batch, and publish each missing file once all hours of its day are there."""
    for day, of_day in stale.items():
        for name, hours in of_day.items():
            if not hours:  # an hour fewer than before, or all hours in several files: nothing is computed
                files.writer(name, day).add_reused()
    writers: dict[tuple[str, int], DayWriter] = {}
    reader = PartReader()
    for batch in batches(computed, most_rows=COUNTED_ROWS if ONLY_COUNTS.issuperset(files.names) else BATCH_ROWS):
        own = [u.number for u in batch]
        wanted = {n: [h for h in own if h in stale[h // 24].get(n, ())] for n in files.names}
        for relation, rows in _of_batch(
            site, batch, [n for n, hours in wanted.items() if hours], days, staff, check, reader
        ):
            name = relation.name
            hours_of: dict[int, list[int]] = defaultdict(list)
            for hour in wanted[name]:
                hours_of[hour // 24].append(hour)
            for day, hours in hours_of.items():
                key = (name, day)
                writer = writers.pop(key, None) or files.writer(*key)
                writer.add(hours, rows)
                if not writer.is_done:
                    writers[key] = writer
        if on_hours is not None:
            on_hours(len(batch))


def _of_batch(
    site: Site,
    batch: Sequence[Unit],
    names: Collection[str],
    days: Mapping[int, KnownDay],
    staff: StaffHours,
    check: _Checker,
    reader: PartReader | None = None,
) -> Iterator[tuple[Relation, pa.Table]]:
    """Yield the rows of relations of some hours, computed from undamaged parts; see `hour_facts`."""
    parts, own = merged_parts(batch), [u.number for u in batch]
    check(p for of_table in parts.values() for p in of_table)
    needed = sorted({d for h in own for d in days_around(h) if d in days})
    return hour_facts(
        site,
        facts=names,
        parts=parts,
        camera_days=pa.concat_tables([days[d].rows for d in needed]),
        first_hour=own[0],
        last_hour=own[-1],
        staff=staff,
        reader=reader,
    )


def record_rows(site: Site, name: str, *, first_hour: int, last_hour: int) -> Iterator[pa.Table]:
    """Yield the rows of one of `RECORD_RELATIONS` in a range of hours, a batch of hours at a time.

    The fact `camera_days` of the range must be fresh. Purged hours have no rows.
    """
    store = Store(site.root / "store", site_id=site.site_id)
    index, hours, sealed = _range(site, store, *_days(first_hour, last_hour))
    days = read_days(site, day_units(index, [*hours, *sealed.hours], site=site))
    staff, _ = _staff_of(site, store, *_days(first_hour, last_hour), True)
    units = hour_units(site, index, [h for h in hours if first_hour <= h <= last_hour], days, staff)
    check = _Checker(store)
    for batch in batches(units):
        yield from (rows for _, rows in _of_batch(site, batch, [name], days, staff, check))


def _staff_of(
    site: Site, store: Store, first_day: int | None, last_day: int | None, is_trusting: bool
) -> tuple[StaffHours, tuple[Path, ...]]:
    """Return who is staff in a range of UTC days, and superseded files: facts of all people are built first."""
    if site.settings.people == "all":
        return NOBODY, ()
    everybody = site.with_settings(people="all")
    built = _build(everybody, store, *hours_around(first_day, last_day), FACTS, None, None, is_trusting, None)
    files = {name: set(built.paths.get(name, {}).values()) for name in FACTS}
    return staff_hours(everybody, files), tuple(built.superseded_files)


def _staff_known(site: Site, first_day: int | None, last_day: int | None) -> StaffHours:
    """Return who is staff by the fresh facts of all people that are there: nothing is computed."""
    if site.settings.people == "all":
        return NOBODY
    everybody = site.with_settings(people="all")
    first, last = hours_around(first_day, last_day)
    fresh = [p for p in build_plan(everybody, first_hour=first, last_hour=last).inputs if p.is_file()]
    return staff_hours(everybody, {name: {p for p in fresh if name in p.parts} for name in FACTS})


def _days(first_hour: int | None, last_hour: int | None) -> tuple[int | None, int | None]:
    """Return the UTC days that hold the ends of a range of hours: a file holds the facts of a whole day."""
    return (None if first_hour is None else first_hour // 24, None if last_hour is None else last_hour // 24)


def _range(
    site: Site, store: Store, first_day: int | None, last_day: int | None
) -> tuple[PartIndex, list[int], SealedRange]:
    """Return the parts of a range of UTC days and around it, its hours whose facts are computed, and its seals."""
    first, last = (None if first_day is None else first_day * 24), (None if last_day is None else last_day * 24 + 23)
    # An hour reads its neighbours, and the UTC days of all three for `camera_days`: 25 hours reach all of these.
    around = (None if first is None else first - 25, None if last is None else last + 25)
    index = PartIndex(store, first_hour=around[0], last_hour=around[1])
    sealed = sealed_range(site, first, last)
    return index, [h for h in index.hours() if _is_within(h, first, last) and not sealed.holds(h)], sealed


def _is_within(hour: int, first: int | None, last: int | None) -> bool:
    return (first is None or hour >= first) and (last is None or hour <= last)


@dataclass(frozen=True, slots=True)
class BuildPlan:
    """Which fact files a range should have.

    Attributes:
        days: UTC days with records.
        inputs: By path of a fresh file, input hashes by UTC hour number, of `camera_days` by UTC day number, of what is
            in the range. Files of a day are left out where `camera_days` of a day around it has to be computed first.
        fresh, stale, missing: Hours with records by the state of their facts: all there; some out of date; some not
            computed, because nobody asked for them so far.
    """

    days: Set[int]
    inputs: Mapping[Path, Mapping[int, InputHashes]]
    fresh: Collection[int]
    stale: Collection[int]
    missing: Collection[int]


def build_plan(site: Site, *, first_hour: int | None = None, last_hour: int | None = None) -> BuildPlan:
    """Return which fact files a range has after a build, without computing or writing anything."""
    store = Store(site.root / "store", site_id=site.site_id)
    index, hours, sealed = _range(site, store, *_days(first_hour, last_hour))
    units = day_units(index, [*hours, *sealed.hours], site=site)
    paths = weeks_of_days(site).joined_paths({u.number: day_path(site, u) for u in units})
    is_there = {path: is_undamaged_file(path) for path in set(paths.values())}
    days = read_days(site, [u for u in units if is_there[paths[u.number]]])
    unknown = {h // 24 for h in hours if any(d in paths and d not in days for d in days_around(h))}
    known = [h for h in hours if h // 24 not in unknown]
    files = FactDays(site, hour_units(site, index, known, days, _staff_known(site, *_days(first_hour, last_hour))))
    inputs: dict[Path, dict[int, InputHashes]] = defaultdict(dict)
    for u in units:
        inputs[paths[u.number]][u.number] = u.inputs
    for name, of_day in files.paths.items():
        for day, path in of_day.items():
            inputs[path] |= {u.number: files.inputs(name, u) for u in files.units[day]}
    asked = {h for h in hours if _is_within(h, first_hour, last_hour)}
    stale_units = [(n, u) for day, names in files.missing.items() for n in names for u in files.stale(n, day)]
    outdated = {u.number for n, u in stale_units if files.is_noted(n, u)}
    outdated |= {h for h in hours if h // 24 in unknown and files.holds(h)}
    stale = {u.number for _, u in stale_units} | {h for h in hours if h // 24 in unknown}
    missing = stale - outdated
    numbers = {h // 24 for h in hours} | {u.number for u in units}
    return BuildPlan(numbers, inputs, asked - stale, asked & (stale - missing), asked & missing)


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
    site: Site, units: Sequence[Unit], check: Callable[[Iterable[Part]], None], distributed: DistributedRun | None
) -> dict[int, KnownDay]:
    """Return the fact `camera_days` of each UTC day, after computing the stale ones."""
    paths, weeks = {u.number: day_path(site, u) for u in units}, weeks_of_days(site)
    weeks.split_weeks(paths)
    resting = weeks.joined_paths(paths)
    missing = [u for u in units if not is_whole(resting[u.number])]
    if distributed is not None and len(missing) > 1:
        wanted = {u.number: [paths[u.number]] for u in missing}
        publish_days(day_work, site, wanted, distributed, on_day=lambda day: sweep_temporaries(paths[day].parent))
        missing = []
    for batch in batches(missing):
        check(p for parts in merged_parts(batch).values() for p in parts)
        rows = day_facts(site, merged_parts(batch))
        units_of = {u.number: u for u in batch}
        for day, own in slices(rows, "utc_day", units_of):  # without fsync: facts can be computed again
            publish(paths[day], day_bytes(units_of[day], own), is_synced=False)
        for folder in {paths[u.number].parent for u in batch}:
            sweep_temporaries(folder)
    return read_days(site, units)
