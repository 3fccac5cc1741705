"""`vsd verify`: checks that every file of a store is undamaged and that facts belong to the stored records."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vsd_analytics.config.door_counts import FOLDER as COUNTS
from vsd_analytics.config.door_counts import door_counts, stored_lines
from vsd_analytics.errors import StoreError
from vsd_analytics.owners import denied
from vsd_analytics.site.model import Site
from vsd_analytics.store import removal
from vsd_analytics.store.durable import file_digest
from vsd_analytics.store.layout import Part, date_of_hour, list_parts
from vsd_analytics.store.own_digest import is_undamaged
from vsd_analytics.store.seals import DAYS as TOGETHER
from vsd_analytics.store.seals import FOLDER, Seals
from vsd_analytics.store.store import Store
from vsd_analytics.store.verify_files import (
    Check,
    StoreFault,
    all_parts,
    check_names,
    check_parts,
    check_repeats,
    check_spool,
    foreign_files,
    is_part,
)
from vsd_analytics.warehouse import agreement, settings_variants
from vsd_analytics.warehouse.audits import audit_rows
from vsd_analytics.warehouse.build import BuildPlan, build_plan
from vsd_analytics.warehouse.day_files import FOLDER as DAYS_FOLDER
from vsd_analytics.warehouse.day_files import day_fingerprint, no_longer_stored, relations_stored_by_day
from vsd_analytics.warehouse.fact_weeks import FactWeeks, fingerprints, inputs_in
from vsd_analytics.warehouse.factfiles import is_undamaged_file, noted_inputs
from vsd_analytics.warehouse.sqlfiles import relations
from vsd_analytics.warehouse.week_files import DAYS, week_fingerprint
from vsd_analytics.warehouse.week_files import FOLDER as WEEKS

_RECOMPUTE = "delete it and run vsd build: facts are computed from the store again"


@dataclass(frozen=True, slots=True)
class Verification:
    """The checks of `vsd verify` and their findings.

    Attributes:
        checks: One entry per kind of check.
        n_fresh, n_stale, n_missing: Number of hours with records whose facts are fresh, stale or not computed. The
            latter two are computed when they are needed. None when facts were not checked.
    """

    checks: tuple[Check, ...]
    n_fresh: int | None = None
    n_stale: int | None = None
    n_missing: int | None = None

    @property
    def is_whole(self) -> bool:
        """Return whether no finding needs action."""
        return not self.damages

    @property
    def damages(self) -> tuple[StoreFault, ...]:
        """Return the findings that need action."""
        return tuple(f for c in self.checks for f in c.damages)

    @property
    def notes(self) -> tuple[StoreFault, ...]:
        """Return the findings that need no action."""
        return tuple(f for c in self.checks for f in c.findings if f.is_note)


def verify(
    site: Site,
    *,
    first_hour: int | None = None,
    last_hour: int | None = None,
    with_facts: bool = True,
    on_bytes: Callable[[int], None] | None = None,
    on_rows: Callable[[int], None] | None = None,
) -> Verification:
    """Check every byte and row of a project's store, and return what is damaged or does not belong there.

    Compares the hash of every part with its name (so one flipped bit shows), its columns with the schema, and every
    row's hour, order and key; every file name with the layout; every fact file, also sealed ones, and every file of
    counts with its digest.
    Changes nothing, except that it first finishes a removal of records that a crash interrupted, as every command does.
    Memory is bounded by the rows of an hour.

    Args:
        site: The project.
        first_hour: First UTC hour number whose parts and facts are checked; None = everything. Spool and names are
            always checked as a whole.
        last_hour: Last one, inclusive.
        with_facts: Check facts as well.
        on_bytes: Called with the number of bytes of parts done.
        on_rows: Called with the number of rows done.
    """
    store = Store(site.root / "store", site_id=site.site_id)
    intents = _check_intents(store)
    with _undisturbed(store, intents):
        parts, columns, sound = check_parts(
            all_parts(store, first_hour=first_hour, last_hour=last_hour), on_bytes=on_bytes
        )
        checks = [
            parts,
            columns,
            *audit_rows(sound, on_rows=on_rows),
            check_repeats(store),
            check_spool(store),
            check_names(store),
            intents,
            check_counts(site),
        ]
        if not with_facts:
            return Verification(tuple(checks))
        checks.append(check_sealed(site))
        try:
            wanted = build_plan(site, first_hour=first_hour, last_hour=last_hour)
        except StoreError as error:
            if error.code != "E313":  # check_sealed reported the damaged seal; without it the facts cannot be judged
                raise
            return Verification(tuple(checks))
        checks += check_facts(site, wanted, first_hour=first_hour, last_hour=last_hour)
        with suppress(StoreError):  # of damage, which the checks above reported
            checks.append(check_agreement(site))
        return Verification(tuple(checks), len(wanted.fresh), len(wanted.stale), len(wanted.missing))


def _check_intents(store: Store) -> Check:
    """Return the check of removals of records that were begun and not finished."""
    pending = removal.pending(store.root)
    findings = [
        StoreFault(
            "E302",
            path,
            "a note of records that shall be removed is damaged",
            "its bytes do not match the hash in its name: no command can finish this removal",
            "move it away, then run the same vsd purge again",
        )
        for path in pending
        if file_digest(path) != path.stem
    ]
    return Check("removals", len(pending), "files", "what shall be removed can be removed", tuple(findings))


def _undisturbed(store: Store, intents: Check) -> AbstractContextManager[None]:
    """Hold off removals while the store is read, unless a damaged note makes that impossible."""
    return nullcontext() if intents.findings or not store.root.is_dir() else removal.reading(store.root)


def check_sealed(site: Site) -> Check:
    """Return the check of sealed facts: all files exist, each with the bytes that were sealed."""
    seals = Seals(site.root / FOLDER, site_id=site.site_id)
    findings = [
        StoreFault(
            "E313",
            path,
            "sealed facts are damaged or gone" if path.suffix == ".parquet" else "a seal is damaged",
            "the bytes are not those that were sealed, and the records they were computed from were removed",
            "restore the folder sealed from a backup",
        )
        for path in seals.damaged()
    ]
    days = {seals.path(day).relative_to(seals.root).as_posix() for day in seals.days()}

    def is_known(name: str) -> bool:
        return name in days or is_part(name.removeprefix(f"{TOGETHER}/").partition("/")[2], site.site_id)

    n, foreign = foreign_files(seals.root, is_known)
    promise = "the facts of purged hours are there as they were sealed"
    return Check("sealed", n, "files", promise, (*findings, *foreign))


def check_counts(site: Site) -> Check:
    """Return the check of what door counters sent: each file of counts has its bytes, its columns, and is by time."""
    findings = []
    for line_id in stored_lines(site):
        try:
            door_counts(site, line_id)
        except (StoreError, OSError) as error:
            findings.append(_damaged_counts(site.root / COUNTS / f"{line_id}.parquet", error))

    def is_known(name: str) -> bool:
        return name.endswith(".parquet") and "/" not in name

    n, foreign = foreign_files(site.root / COUNTS, is_known)
    promise = "they have their bytes and columns, and their intervals are by time, none twice"
    return Check("counts", n, "files", promise, (*findings, *foreign))


def _damaged_counts(path: Path, error: StoreError | OSError) -> StoreFault:
    if isinstance(error, StoreError):
        return StoreFault("E302", path, error.what, error.why or "", error.fix or "")
    why, fix = denied(error, path)
    return StoreFault("E302", path, f"the counts of a door counter cannot be read: {error.strerror}", why or "", fix)


def check_agreement(site: Site) -> Check:
    """Return the check of vsd.toml: no figure is made while it does not describe what is stored."""
    path = site.root / agreement.FILE
    problems = agreement.stored_disagreements(site)
    findings = (StoreFault(agreement.CODE, path, p.what, p.why or "", p.fix or "") for p in problems)
    n = len(site.cameras) + len(site.areas)
    return Check("vsd.toml", n, "cameras and areas", "they describe what is stored", tuple(findings))


def check_facts(
    site: Site, wanted: BuildPlan, *, first_hour: int | None = None, last_hour: int | None = None
) -> tuple[Check, Check]:
    """Return two checks of fact files: that each is undamaged and of its own hour, and that its hour has records.

    Args:
        site: The project.
        wanted: Which files the range should have.
        first_hour: First UTC hour number; None = open.
        last_hour: Last one, inclusive.
    """
    n, damaged, orphans = 0, [], []
    known = relations("facts")
    fresh = {path.parent: path for path in wanted.inputs}
    first = None if first_hour is None else first_hour // 24 * 24  # the file of a day lies in its first hour
    days = [None if hour is None else hour // 24 for hour in (first_hour, last_hour)]
    for relation in sorted(known):
        of_days = list_parts(site.root / "facts", relation, site.site_id, first_hour=first, last_hour=last_hour)
        for part, data in _read((*of_days, *FactWeeks(site.root / "facts", relation, site.site_id).files(*days))):
            n += 1
            if not is_undamaged(data):
                damaged.append(_damaged_fact(part.path))
            elif not _has_inputs(part.path, relation, data, wanted):
                damaged.append(_other_fact(part.path))
            elif wanted.days.isdisjoint(fingerprints(part.path) or [part.hour // 24]) or _is_superseded(part, fresh):
                orphans.append(_orphan(part.path))

    former = {path.relative_to(site.root / "facts").as_posix(): path for path in no_longer_stored(site)}
    orphans += map(_orphan, former.values())
    of_sealed = {r.name for r in relations_stored_by_day() if r.layer == "facts"}
    of_weeks = {r.name for r in relations_stored_by_day() if r.layer == "marts"}
    n_day_files, day_findings = _check_days(site, of_sealed, of_weeks, first_hour=first_hour, last_hour=last_hour)

    n_beside, beside_findings = _check_beside(site)
    below = {DAYS_FOLDER.name: of_sealed, WEEKS: {*of_weeks, *known}}

    def is_known(name: str) -> bool:
        if name in former:
            return True
        for other in settings_variants.folders(site):
            name = name.removeprefix(f"{other.relative_to(site.root / 'facts').as_posix()}/")
        folder, _, rest = name.partition("/")
        relation, _, file = rest.partition("/") if folder in below else (folder, "", rest)
        return relation in below.get(folder, known) and is_part(file, site.site_id)

    n_names, foreign = foreign_files(site.root / "facts", is_known)
    return (
        Check(
            "facts",
            n + n_day_files + n_beside,
            "files",
            "their bytes are those of their digest",
            (*damaged, *day_findings, *beside_findings),
        ),
        Check("fact names", n_names, "files", "each is of an hour with records", (*orphans, *foreign)),
    )


def _check_days(
    site: Site, of_sealed: Collection[str], of_weeks: Collection[str], *, first_hour: int | None, last_hour: int | None
) -> tuple[int, list[StoreFault]]:
    """Return the number of files of sealed days and of weeks of marts, and findings of damage and wrong names."""
    n, faults = 0, []
    first = None if first_hour is None else first_hour - 24  # a local day may begin in the UTC day before
    of_week = None if first is None else first - (DAYS - 1) * 24
    folders = [(DAYS_FOLDER, name, first) for name in sorted(of_sealed)]
    folders += [(DAYS_FOLDER.with_name(WEEKS), name, of_week) for name in sorted(of_weeks)]
    for folder, name, since in folders:
        parts = list_parts(site.root / folder, name, site.site_id, first_hour=since, last_hour=last_hour)
        for part, data in _read(parts):
            n += 1
            if not is_undamaged(data):
                faults.append(_damaged_fact(part.path))
            elif _fingerprint(folder, name, part, noted_inputs(data)) != part.digest:
                faults.append(_other_fact(part.path))
    return n, faults


def _read(parts: Iterable[Part]) -> Iterator[tuple[Part, bytes]]:
    """Yield files with their bytes, none where the disk refuses them; files that are gone meanwhile are left out."""
    for part in parts:
        try:
            yield part, part.path.read_bytes()
        except FileNotFoundError:
            continue
        except OSError:
            yield part, b""


def _fingerprint(folder: Path, name: str, part: Part, inputs: Mapping[str, Any]) -> str:
    """Return the fingerprint that belongs into the name of a file of a day or week."""
    fingerprint = day_fingerprint if folder == DAYS_FOLDER else week_fingerprint
    return fingerprint(name, date_of_hour(part.hour), inputs)


def _check_beside(site: Site) -> tuple[int, list[StoreFault]]:
    """Return the number of files of other settings, and findings of those that are damaged."""
    paths = [path for folder in settings_variants.folders(site) for path in sorted(folder.rglob("*.parquet"))]
    return len(paths), [_damaged_fact(path) for path in paths if path.is_file() and not is_undamaged_file(path)]


def _has_inputs(path: Path, name: str, data: bytes, wanted: BuildPlan) -> bool:
    """Return whether an undamaged file notes the inputs it should; of a week, those of the range."""
    if path not in wanted.inputs:
        return True
    expected, noted = wanted.inputs[path], inputs_in(path, name, noted_inputs(data))
    return expected.items() <= noted.items() if fingerprints(path) else expected == noted


def _is_superseded(part: Part, fresh: Mapping[Path, Path]) -> bool:
    """Return whether the fresh file of the folder exists beside this one, as a stopped build may leave it."""
    wanted = fresh.get(part.path.parent)
    return wanted is not None and part.path != wanted and wanted.exists()


def _damaged_fact(path: Path) -> StoreFault:
    why = "its bytes do not match the digest in it: the disk or a program changed them, or it has no digest"
    return StoreFault("E302", path, "a file of the computed facts is damaged", why, _RECOMPUTE)


def _other_fact(path: Path) -> StoreFault:
    why = "it is undamaged, but was computed from other inputs than the facts of its hour: it was copied or renamed"
    return StoreFault("E302", path, "a fact file has the name of another one", why, _RECOMPUTE)


def _orphan(path: Path) -> StoreFault:
    why = "the store has no record of its hour, a fresh file replaces it, or this version stores no such files"
    fix = "nothing: a build removes it when nobody reads facts"
    return StoreFault("E307", path, "a fact file that belongs to no records of today", why, fix, is_note=True)
