"""`vsd purge`: removal of records by age (their facts are sealed), by camera and time, and of pseudonym keys.

`retention.purge_import` takes a single import back. This module decides what to remove, seals facts first, and refuses
to remove more than half of the store without `--force`. How removal survives a crash is the job of `store.removal`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

from vsd_analytics.errors import StoreError, UsageError
from vsd_analytics.ingest.intake.quarantine_scope import quarantined_in_scope
from vsd_analytics.ingest.intake.watched_folders import files_read_before
from vsd_analytics.retention.sealing import Sealer, all_parts
from vsd_analytics.schema import TABLES, TableName
from vsd_analytics.site.model import Site
from vsd_analytics.store import durable, quarantine
from vsd_analytics.store.erasures import Erasure, RecordScope, erasures, reason_hash, rows_in_scope
from vsd_analytics.store.imports import LARGEST_SHARE
from vsd_analytics.store.layout import HOUR_MS, Part, date_of_hour
from vsd_analytics.store.removal import Intent, remove_records, removing
from vsd_analytics.store.seals import FOLDER, Seals
from vsd_analytics.store.secrets import DayKeys
from vsd_analytics.store.store import Store
from vsd_analytics.warehouse.build import build
from vsd_analytics.warehouse.day_files import (
    AROUND_H,
    DayFiles,
    facts_around,
    relations_stored_by_day,
    spare_other_days,
)
from vsd_analytics.warehouse.stored_days import calendar_days


@dataclass(frozen=True, slots=True, kw_only=True)
class Purged:
    """What a purge removed, or would remove.

    Attributes:
        records: Number of records by table.
        n_days: UTC days they lie in.
        first, last: First and last of these days.
        n_sealed: Hours whose facts are sealed; in a purge by camera, sealed hours whose facts lose the camera.
        n_quarantined: Records removed from quarantine.
        n_doubtful: Those of n_quarantined whose camera or time cannot be read.
        n_files: Files of watched folders that had been read.
        keys: Site days whose keys were destroyed.
        n_staying: Of an import, records that stay because another import or a broker brought them as well.
        n_again: Of an import, noted records that belong to others: only the note is removed.
    """

    records: Mapping[TableName, int] = field(default_factory=dict)
    n_days: int = 0
    first: date | None = None
    last: date | None = None
    n_sealed: int = 0
    n_quarantined: int = 0
    n_doubtful: int = 0
    n_files: int = 0
    keys: Sequence[date] = ()
    n_staying: int = 0
    n_again: int = 0

    @property
    def is_nothing(self) -> bool:
        """Return whether there was nothing to remove."""
        others = self.n_sealed, self.n_quarantined, self.n_files, self.keys, self.n_staying, self.n_again
        return not (any(self.records.values()) or any(others))


@dataclass(frozen=True, slots=True, kw_only=True)
class Terms:
    """Options of a purge.

    Attributes:
        now: Current time, for the audit line.
        reason: The user's reason, for the audit line.
        is_forced: Allow the removal of more than half of the store.
        is_dry_run: Return what would be removed, and remove nothing.
        on_wait: Called when the purge has to wait for a report or query.
        on_plan, on_hours: Progress of the facts that are computed first; see `warehouse.build.build`.
    """

    now: datetime
    reason: str | None = None
    is_forced: bool = False
    is_dry_run: bool = False
    on_wait: Callable[[], None] | None = None
    on_plan: Callable[[int], None] | None = None
    on_hours: Callable[[int], None] | None = None


def purge_older(site: Site, *, before: date, terms: Terms) -> Purged:
    """Remove the records of all UTC days before a date, and seal their facts first.

    The facts of the first hour of `before` are sealed too, because they were computed from the hour before as well.
    Quarantined records that arrived before the date, or at an unknown time, are removed too, and so are the files of
    watched folders that were read before it.

    Args:
        site: The project.
        before: First UTC date whose records stay.
        terms: Options.

    Raises:
        StoreError: E310, more than half of the stored days would be removed; E311, a reader did not finish in time;
            E302, E313, a file is damaged.
        OSError: A file of a watched folder cannot be removed; the records are.
    """
    site = site.with_own_settings()  # the facts that are sealed are those of vsd.toml
    store = Store(site.root / "store", site_id=site.site_id)
    edge = (before - date(1970, 1, 1)).days * 24
    cutoff = datetime(before.year, before.month, before.day, tzinfo=UTC)
    store.fold()
    if not terms.is_dry_run and any(p.hour < edge for p in all_parts(store)):
        build(site, last_hour=edge, on_plan=terms.on_plan, on_hours=terms.on_hours)  # the long part, without locks
    with removing(store.root, on_wait=terms.on_wait), store.reporting_damage():
        store.fold_held()
        every = all_parts(store)
        going = [p for p in every if p.hour < edge]
        is_old = _came_before(cutoff)
        n_old = _n_quarantined(site.root / quarantine.FOLDER, is_old)
        read = list(files_read_before(site.root, cutoff))
        days = sorted({p.hour // 24 for p in going})
        guard(len(days), len({p.hour // 24 for p in every}), "days", terms)
        sealer = Sealer(site, store, edge)
        purged = Purged(
            records=n_records(store, last_hour=edge - 1),
            n_days=len(days),
            first=date_of_hour(days[0] * 24) if days else None,
            last=date_of_hour(days[-1] * 24) if days else None,
            n_sealed=len(sealer.hours(days)),
            n_quarantined=n_old,
            n_files=len(read),
        )
        if terms.is_dry_run or purged.is_nothing:
            return purged
        if days:
            sealer.seal(days, on=terms.now.astimezone(UTC).date())
        if n_old:
            quarantine.drop(site.root / quarantine.FOLDER, lambda _, entry: entry is not None and is_old(entry))
        again = [p.path for t in TABLES for p in store.repeats(t, last_hour=edge - 1)]
        # Of hours that were purged before, marts come from sealed facts: another purge takes nothing from them.
        hours = sorted({p.hour for p in going})
        spare_other_days(site, hours)
        staying = _marts_that_stay(site, hours)
        around = (path for path in facts_around(site, hours) if path not in staying)
        unlink = [*(p.path for p in going), *again, *around]
        entry = audit_line(terms, purged, {"older_than": before.isoformat()})
        remove_records(store.root, Intent(site_id=site.site_id, entry=entry, unlink=below(site.root, unlink)))
    for path in read:  # after the records: a folder that may not be written keeps none of them
        path.unlink(missing_ok=True)
    return purged


def _marts_that_stay(site: Site, hours: Sequence[int]) -> set[Path]:
    """Return the week files of marts whose rows would be computed again from sealed facts, and would be the same.

    They are those of whole weeks that are fresh now that the hours are sealed. Nothing is computed to find them.
    """
    if not hours:
        return set()
    first, last = (datetime.fromtimestamp(h * 3600, tz=site.zone).date() for h in (hours[0], hours[-1]))
    # a mart of a day reads facts of a day and an hour on either side, which may be in the week beside
    monday = first - timedelta(days=first.weekday(), weeks=1)
    next_monday = last + timedelta(days=-last.weekday(), weeks=2)
    begin, end = (
        int(datetime(day.year, day.month, day.day, tzinfo=site.zone).timestamp()) // 3600
        for day in (monday, next_monday)
    )
    built = build(
        site, first_hour=begin - AROUND_H, last_hour=end - 1 + AROUND_H, facts=(), has_lock=True, is_trusting=True
    )
    files = DayFiles(site, built, extents=calendar_days(site, monday, next_monday - timedelta(days=1)))
    marts = (relation for relation in relations_stored_by_day() if relation.layer == "marts")
    return {week.path for relation in marts for week in files.weeks(relation)}


def purge_range(site: Site, *, camera_id: str | None, first_ms: int, after_ms: int, terms: Terms) -> Purged:
    """Remove the records of one camera, or of all, in [first_ms, after_ms).

    Afterwards the tables are as if these records had never arrived. With a reason the removal is an erasure: records
    of the camera and time do not come back by any way (`store.erasures`). Without one, correct records can be ingested.
    In sealed hours the records are gone already: there the camera's rows are removed from the facts.
    Quarantined records are removed too, unless they are known to be of another camera or time
    (`ingest.quarantine_scope`).

    Args:
        site: The project.
        camera_id: Camera; None = all.
        first_ms: Start, UTC milliseconds.
        after_ms: End, exclusive.
        terms: Options.

    Raises:
        StoreError: E310, more than half of the stored records would be removed; E312, the range covers a sealed hour in
            part; otherwise as `purge_older`.
    """
    store = Store(site.root / "store", site_id=site.site_id)
    which = RecordScope(camera_id, first_ms, after_ms)
    store.fold()
    with removing(store.root, on_wait=terms.on_wait), store.reporting_damage():
        store.fold_held()
        rewrite: dict[TableName, list[Part]] = {}
        again: dict[TableName, list[Part]] = {}
        records: dict[TableName, int] = {}
        first_hour, last_hour = first_ms // HOUR_MS, (after_ms - 1) // HOUR_MS
        for table in TABLES:
            parts = store.parts(table, first_hour=first_hour, last_hour=last_hour)
            store.refuse_damaged(parts)
            counts = {p: n for p in parts if (n := rows_in_scope(p.path, which))}
            rewrite[table], records[table] = list(counts), sum(counts.values())
            noted = store.repeats(table, first_hour=first_hour, last_hour=last_hour)
            again[table] = [p for p in noted if rows_in_scope(p.path, which)]
        sealed = _sealed_hours(site, which)
        in_quarantine = quarantined_in_scope(site, which)
        hours = sorted({p.hour for parts in rewrite.values() for p in parts})
        days = sorted({h // 24 for h in (*hours, *sealed)})
        guard(sum(records.values()), sum(n_records(store).values()), "records", terms)
        purged = Purged(
            records=records,
            n_days=len(days),
            first=date_of_hour(days[0] * 24) if days else None,
            last=date_of_hour(days[-1] * 24) if days else None,
            n_sealed=len(sealed),
            n_quarantined=len(in_quarantine.lines),
            n_doubtful=in_quarantine.n_doubtful,
        )
        erasure = None if terms.reason is None else Erasure(which, reason_hash(terms.reason))
        is_noted = erasure is None or erasure in erasures(store.root)
        if terms.is_dry_run or (purged.is_nothing and is_noted):
            return purged
        what = {"camera_id": camera_id, "from": _iso(first_ms), "to": _iso(after_ms)}
        spare_other_days(site, hours)
        intent = Intent(
            site_id=site.site_id,
            entry=audit_line(terms, purged, what),
            unlink=below(site.root, facts_around(site, hours)),
            which=which,
            rewrite={
                t: below(site.root, [p.path for p in (*parts, *again[t])])
                for t, parts in rewrite.items()
                if parts or again[t]
            },
            unseal=tuple(sealed),
            quarantined=tuple(sorted(map(durable.digest, in_quarantine.lines))),
            erasure=erasure,
        )
        remove_records(store.root, intent)
        return purged


def lift_range(site: Site, *, camera_id: str | None, first_ms: int, after_ms: int, terms: Terms) -> None:
    """Let the records of an erasure come again, when it was made by mistake; purge.jsonl logs it.

    Args:
        site: The project.
        camera_id: Its camera; None = all.
        first_ms: Its start, UTC milliseconds.
        after_ms: Its end, exclusive.
        terms: Its reason is the one that the erasure was made for.

    Raises:
        UsageError: E101, there is no such erasure.
    """
    store = Store(site.root / "store", site_id=site.site_id)
    erasure = Erasure(RecordScope(camera_id, first_ms, after_ms), reason_hash(terms.reason or ""))
    with removing(store.root, on_wait=terms.on_wait):
        if erasure not in erasures(store.root):
            raise UsageError(
                "there is no such erasure",
                why="camera, range and reason must be those of the purge that made it; purge.jsonl has them",
                fix='vsd purge --camera ID --range A..B --reason "TEXT OF THEN" --lift',
            )
        if not terms.is_dry_run:
            what = {"lifted": True, "camera_id": camera_id, "from": _iso(first_ms), "to": _iso(after_ms)}
            entry = audit_line(terms, Purged(), what)
            remove_records(store.root, Intent(site_id=site.site_id, entry=entry, erasure=erasure, is_lifted=True))


def forget_keys(site: Site, *, before: date | None = None, purged: date | None = None, terms: Terms) -> Purged:
    """Destroy the pseudonym keys of site days: nobody can link their pseudonyms to the engine's track ids again.

    Args:
        site: The project.
        before: Destroy the keys of site days that ended before this UTC date, even if records of them are stored;
            None = of site days that began before the end of the last purge by age and have no record any more.
        purged: First UTC date whose records the purge left or, in a dry run, would leave; None = as the seals say.
        terms: Options.
    """
    store = Store(site.root / "store", site_id=site.site_id)
    keys = DayKeys(site.root / "secrets")
    with removing(store.root, on_wait=terms.on_wait):
        store.fold_held()
        if before is None:
            is_over = _purged_days(site, store, purged)
            days = [d for d in keys.days() if is_over(d)]
        else:
            days = [d for d in keys.days() if _site_day_end_ms(site, d) <= _iso_ms(before)]
        removed = Purged(keys=days)
        if not terms.is_dry_run and days:
            remove_records(
                store.root, Intent(site_id=site.site_id, entry=audit_line(terms, removed, {}), forget=tuple(days))
            )
        return removed


def n_records(store: Store, *, last_hour: int | None = None) -> dict[TableName, int]:
    """Return the number of stored records by table, up to a UTC hour number; None = all."""
    return {t: sum(pq.read_metadata(p.path).num_rows for p in store.parts(t, last_hour=last_hour)) for t in TABLES}


def _sealed_hours(site: Site, which: RecordScope) -> list[int]:
    """Return the sealed hours in the range of a purge; E312 where the range covers one in part.

    Sealed facts are sums of an hour, so a part of an hour cannot be taken out of them.
    """
    last_hour = (which.after_ms - 1) // HOUR_MS
    seals = Seals(site.root / FOLDER, site_id=site.site_id).between(which.first_ms // HOUR_MS, last_hour)
    hours = [h for h, unit in seals.items() if unit.last_ms and which.camera_id in (None, *unit.last_ms)]
    cut = [h for h in hours if h * HOUR_MS < which.first_ms or (h + 1) * HOUR_MS > which.after_ms]
    if cut:
        first, after = (datetime.fromtimestamp(s, tz=UTC) for s in (cut[0] * 3600, (cut[-1] + 1) * 3600))
        raise StoreError(
            "the range ends inside an hour whose records were purged",
            code="E312",
            why="of such an hour only sums are stored, so a camera can be removed from the whole hour only",
            fix=f"use whole UTC hours: the range cuts those from {first:%Y-%m-%dT%H:%M}Z to {after:%Y-%m-%dT%H:%M}Z;"
            " include them or leave them out",
        )
    return hours


def guard(n_going: int, n_stored: int, what: str, terms: Terms) -> None:
    """Raise StoreError E310 when more than `LARGEST_SHARE` of what is stored would go and nobody forced it."""
    if terms.is_forced or terms.is_dry_run or n_going <= LARGEST_SHARE * n_stored:
        return
    raise StoreError(
        f"{n_going:,} of {n_stored:,} stored {what} would be removed",
        code="E310",
        why="that is more than half, which is usually a mistake",
        fix="check with --dry-run; if it is right, add --force",
    )


def _came_before(cutoff: datetime) -> Callable[[quarantine.QuarantineEntry], bool]:
    return lambda entry: entry.at is None or entry.at < cutoff


def _n_quarantined(folder: Path, is_old: Callable[[quarantine.QuarantineEntry], bool]) -> int:
    entries = (entry for path in quarantine.files(folder) for _, entry in quarantine.entries(path))
    return sum(entry.n_not_kept or 1 for entry in entries if entry is not None and is_old(entry))


def _purged_days(site: Site, store: Store, purged: date | None) -> Callable[[date], bool]:
    """Return a function: whether a site day began before the end of the purged time and has no record any more."""
    if purged is not None:
        end_ms = _iso_ms(purged)
    else:
        seals = Seals(site.root / FOLDER, site_id=site.site_id)
        whole = (d for d in reversed(seals.days()) if (seal := seals.read(d)) is not None and seal.is_whole)
        end_ms = (next(whole, -1) + 1) * 24 * HOUR_MS
    stored = {p.hour * HOUR_MS for p in all_parts(store)}
    if purged is not None:  # a dry run did not remove the hours before
        stored = {ms for ms in stored if ms >= end_ms}

    def is_over(day: date) -> bool:
        first_ms, after_ms = _site_day_end_ms(site, day - timedelta(days=1)), _site_day_end_ms(site, day)
        return first_ms < end_ms and not any(first_ms - HOUR_MS < ms < after_ms for ms in stored)

    return is_over


def _site_day_end_ms(site: Site, day: date) -> int:
    """Return the instant a site day ends (UTC milliseconds): at `day_starts` of the next local day."""
    midnight = datetime(day.year, day.month, day.day) + timedelta(days=1, minutes=site.day_starts_min)
    return round(midnight.replace(tzinfo=site.zone).timestamp() * 1000)


def audit_line(terms: Terms, purged: Purged, what: Mapping[str, Any]) -> dict[str, Any]:
    """Return the audit line."""
    entry: dict[str, Any] = {"at": terms.now.astimezone(UTC).isoformat(timespec="seconds"), **what}
    entry["records"] = dict(purged.records)
    entry["utc_days"] = [d.isoformat() for d in (purged.first, purged.last) if d is not None]
    entry |= {"sealed_hours": purged.n_sealed, "quarantined": purged.n_quarantined}
    if purged.n_files:
        entry["read_files"] = purged.n_files
    if purged.keys:
        entry["forgotten_days"] = [d.isoformat() for d in purged.keys]
    if terms.reason is not None:
        entry["reason"] = terms.reason
    return entry


def below(root: Path, paths: Sequence[Path]) -> tuple[str, ...]:
    """Return paths as an intent names them: below the project folder."""
    return tuple(str(p.relative_to(root)) for p in paths)


def _iso(ms: int) -> str:
    return datetime.fromtimestamp(ms / 1000, tz=UTC).isoformat(timespec="milliseconds")


def _iso_ms(day: date) -> int:
    return (day - date(1970, 1, 1)).days * 86_400_000
