"""`vsd verify`: the proof that a store is whole, and that its facts are those of its records."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from vsd_analytics.errors import StoreError
from vsd_analytics.site import Site
from vsd_analytics.store import Store, removal
from vsd_analytics.store.durable import file_digest
from vsd_analytics.store.layout import Part, date_of_hour, list_parts, unit_folder
from vsd_analytics.store.seals import DAY_FACT, FOLDER, Seals
from vsd_analytics.store.verify import (
    Check,
    Finding,
    all_parts,
    check_names,
    check_parts,
    check_spool,
    is_part,
    strangers,
)
from vsd_analytics.warehouse.audits import audit_rows
from vsd_analytics.warehouse.build import Plan, plan
from vsd_analytics.warehouse.days import FOLDER as DAYS_FOLDER
from vsd_analytics.warehouse.days import day_fingerprint, kept_relations
from vsd_analytics.warehouse.factfiles import causes_of, is_undamaged
from vsd_analytics.warehouse.sqlfiles import relations

_REMAKE = "delete it and run vsd build: facts are computed from the store again"


@dataclass(frozen=True, slots=True)
class Verification:
    """What was looked at, and what was found.

    Attributes:
        checks: One entry per kind of check.
        n_fresh, n_stale, n_missing: Hours with records whose facts are those of today's records and rules, are others,
            or are not there; the last two are computed when they are needed. None without facts.
    """

    checks: tuple[Check, ...]
    n_fresh: int | None = None
    n_stale: int | None = None
    n_missing: int | None = None

    @property
    def is_whole(self) -> bool:
        """Return whether nothing needs somebody."""
        return not self.damages

    @property
    def damages(self) -> tuple[Finding, ...]:
        """Return all findings that need somebody."""
        return tuple(f for c in self.checks for f in c.damages)

    @property
    def notes(self) -> tuple[Finding, ...]:
        """Return all findings that do not."""
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
    """Prove that the store of a project is whole, or say what is not.

    Every part and segment is read and its hash compared with its name (a flipped bit anywhere shows), its columns
    compared with the schema; every row is looked at for hour, order and key; every file must be one that belongs
    there; every fact file, sealed ones too, is compared with its digest. Nothing is changed, except that a removal of
    records that a crash cut short is finished first, as by any other command. Memory is bounded by the rows of an hour.

    Args:
        site: The project.
        first_hour: First UTC hour number whose parts and facts are looked at; None = everything. Spool and names are
            always looked at as a whole.
        last_hour: Last one, inclusive.
        with_facts: Look at facts as well.
        on_bytes: Called with the number of bytes of parts done.
        on_rows: Called with the number of rows done.
    """
    store = Store(site.root / "store", site_id=site.site_id)
    intents = _check_intents(store)
    with _undisturbed(store, intents):
        parts, columns, sound = check_parts(
            all_parts(store, first_hour=first_hour, last_hour=last_hour), on_bytes=on_bytes
        )
        checks = [parts, columns, *audit_rows(sound, on_rows=on_rows), check_spool(store), check_names(store), intents]
        if not with_facts:
            return Verification(tuple(checks))
        checks.append(check_sealed(site))
        try:
            wanted = plan(site, first_hour=first_hour, last_hour=last_hour)
        except StoreError as error:
            if error.code != "E313":  # a damaged seal was told above; nothing can be said about facts
                raise
            return Verification(tuple(checks))
        checks += check_facts(site, wanted, first_hour=first_hour, last_hour=last_hour)
        n_fresh = sum(files is not None and all(p.exists() for p in files) for files in wanted.hours.values())
        n_missing = sum(not any(_files_of(site, hour)) for hour in wanted.hours)
        return Verification(tuple(checks), n_fresh, len(wanted.hours) - n_fresh - n_missing, n_missing)


def _check_intents(store: Store) -> Check:
    """Return the check of removals that were noted and not finished."""
    pending = removal.pending(store.root)
    findings = [
        Finding(
            "E302",
            path,
            "a note of records that shall be removed is damaged",
            "its bytes are not those whose hash stands in its name: no command can finish this removal",
            "move it away, then run the same vsd purge again",
        )
        for path in pending
        if file_digest(path) != path.stem
    ]
    return Check("removals", len(pending), "files", "what shall be removed can be removed", tuple(findings))


def _undisturbed(store: Store, intents: Check) -> AbstractContextManager[None]:
    """Keep removals away, unless a damaged note makes that impossible."""
    return nullcontext() if intents.findings or not store.root.is_dir() else removal.reading(store.root)


def check_sealed(site: Site) -> Check:
    """Return the check of the facts of hours whose records were removed: all there, each with the bytes sealed."""
    seals = Seals(site.root / FOLDER, site_id=site.site_id)
    findings = [
        Finding(
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
        return name in days or is_part(name.partition("/")[2], site.site_id)

    n, foreign = strangers(seals.root, is_known)
    promise = "the facts of purged hours are there as they were sealed"
    return Check("sealed", n, "files", promise, (*findings, *foreign))


def check_facts(
    site: Site, wanted: Plan, *, first_hour: int | None = None, last_hour: int | None = None
) -> tuple[Check, Check]:
    """Return the checks of the fact files: undamaged and of their own hour; and each of an hour with records.

    Args:
        site: The project.
        wanted: Which files the range should have.
        first_hour: First UTC hour number; None = open.
        last_hour: Last one, inclusive.
    """
    n, damaged, orphans = 0, [], []
    causes = {
        path: noted
        for files in (*wanted.hours.values(), *wanted.days.values())
        for path, noted in (files or {}).items()
    }
    known = relations("facts")
    for relation in sorted(known):
        numbers = {d * 24 for d in wanted.days} if relation == DAY_FACT else set(wanted.hours)
        for part in list_parts(site.root / "facts", relation, site.site_id, first_hour=first_hour, last_hour=last_hour):
            try:
                data = part.path.read_bytes()
            except FileNotFoundError:
                continue
            except OSError:
                data = b""
            n += 1
            if not is_undamaged(data):
                damaged.append(_damaged_fact(part.path))
            elif part.path in causes and causes_of(data) != causes[part.path]:
                damaged.append(_other_fact(part.path))
            elif part.hour not in numbers or _is_left_over(part, relation, wanted):
                orphans.append(_orphan(part.path))

    kept = {r.name for r in kept_relations()}
    n_kept, unlike = _check_days(site, kept, first_hour=first_hour, last_hour=last_hour)

    def is_known(name: str) -> bool:
        relation, _, rest = name.partition("/")
        if relation == DAYS_FOLDER.name:
            relation, _, rest = rest.partition("/")
            return relation in kept and is_part(rest, site.site_id)
        return relation in known and is_part(rest, site.site_id)

    n_names, foreign = strangers(site.root / "facts", is_known)
    return (
        Check("facts", n + n_kept, "files", "their bytes are those of their digest", (*damaged, *unlike)),
        Check("fact names", n_names, "files", "each is of an hour with records", (*orphans, *foreign)),
    )


def _check_days(
    site: Site, names: Collection[str], *, first_hour: int | None, last_hour: int | None
) -> tuple[int, list[Finding]]:
    """Return how many day files were looked at, and those that are damaged or of something else."""
    n, found = 0, []
    first = None if first_hour is None else first_hour - 24  # the file of a day stands at its start
    for name in sorted(names):
        for part in list_parts(site.root / DAYS_FOLDER, name, site.site_id, first_hour=first, last_hour=last_hour):
            n += 1
            try:
                data = part.path.read_bytes()
            except FileNotFoundError:
                continue
            except OSError:
                data = b""
            if not is_undamaged(data):
                found.append(_damaged_fact(part.path))
            elif day_fingerprint(name, date_of_hour(part.hour), causes_of(data)) != part.digest:
                found.append(_other_fact(part.path))
    return n, found


def _is_left_over(part: Part, relation: str, wanted: Plan) -> bool:
    """Tell whether a file stands beside the fresh one of its unit: what a stopped build left."""
    files = wanted.days[part.hour // 24] if relation == DAY_FACT else wanted.hours[part.hour]
    fresh = [p for p in files or {} if p.parent == part.path.parent]
    return part.path not in fresh and bool(fresh) and fresh[0].exists()


def _files_of(site: Site, hour: int) -> Iterator[Path]:
    for relation in relations("facts").values():
        if relation.unit == "hour":
            folder = unit_folder(site.root / "facts", relation.name, site.site_id, hour)
            yield from folder.glob(f"{hour % 24:02d}-*.parquet")


def _damaged_fact(path: Path) -> Finding:
    why = "its bytes are not those whose digest stands in it: the disk or a program changed them, or it has no digest"
    return Finding("E302", path, "a file of the computed facts is damaged", why, _REMAKE)


def _other_fact(path: Path) -> Finding:
    why = "it is undamaged and notes other causes than the facts of its hour have: it was copied or renamed"
    return Finding("E302", path, "a fact file of something else stands under this name", why, _REMAKE)


def _orphan(path: Path) -> Finding:
    why = "the store holds no record of its hour, or has fresh facts of it beside this file; it is not read here"
    mend = "nothing: a build removes it when nobody reads facts"
    return Finding("E307", path, "a fact file that belongs to no records of today", why, mend, is_note=True)
