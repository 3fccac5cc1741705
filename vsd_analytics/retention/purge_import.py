"""`vsd purge --import`: take one import back, as if its file had never come."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

from vsd_analytics.errors import StoreError, UsageError
from vsd_analytics.retention.purge import Purged, Terms, audit_line, below, guard, n_records
from vsd_analytics.schema import TABLES
from vsd_analytics.site.model import Site
from vsd_analytics.store import durable, quarantine
from vsd_analytics.store.imports import ImportLine, holdings, imports_of
from vsd_analytics.store.layout import Part, date_of_hour
from vsd_analytics.store.owners import brought_by
from vsd_analytics.store.removal import Intent, remove_records, removing
from vsd_analytics.store.seals import FOLDER, Seals
from vsd_analytics.store.store import Store
from vsd_analytics.store.undo_import import n_replacing
from vsd_analytics.warehouse.day_files import facts_around, spare_other_days

SHORTEST_ID = 4
"""Digits of an id that must be given at least."""


def find_import(store: Store, given: str) -> str:
    """Return the whole id of an import from its beginning.

    Raises:
        UsageError: E101, no import or more than one begins like this.
    """
    listed = imports_of(store.root)
    known = sorted({*listed, *holdings(store)})
    matching = [i for i in known if i.startswith(given)] if len(given) >= SHORTEST_ID else []
    if len(matching) == 1:
        return matching[0]
    raise UsageError(
        f"--import {given!r}: {'no import' if not matching else 'more than one import'} has an id that begins so",
        why=f"an id has 16 digits, of which the first {SHORTEST_ID} or more are needed",
        fix="vsd imports --all lists them",
    )


def purge_import(site: Site, given: str, *, terms: Terms) -> tuple[ImportLine | None, Purged]:
    """Remove what one import alone brought.

    Records that another import or a broker brought as well stay, as that one brought them. Quarantined records of the
    import are removed. Afterwards the tables are as if its file had never been imported.

    Args:
        site: The project.
        given: The import's id, or its first digits.
        terms: Options.

    Returns:
        The import's line in the list (None = the list lost it), and what was or would be removed.

    Raises:
        UsageError: E101, there is no such import.
        StoreError: E310, more than half of the stored records would be removed; E314, hours of it are sealed; E311, a
            reader did not finish in time; E302, a file is damaged.
    """
    store = Store(site.root / "store", site_id=site.site_id)
    store.fold()
    with removing(store.root, on_wait=terms.on_wait), store.reporting_damage():
        store.fold_held()
        import_id = find_import(store, given)
        line = imports_of(store.root).get(import_id)
        _refuse_sealed(site, import_id)
        rewrite = {t: _parts_of(store.parts(t), import_id) for t in TABLES}
        going = {p.hour for parts in rewrite.values() for p in parts}
        # a repeat that takes the place of a removed record is no repeat any more, so all notes of these hours change
        repeats = {
            t: [p for p in store.repeats(t) if p.hour in going or import_id in brought_by(p.path)] for t in TABLES
        }
        store.refuse_damaged(p for purged in (rewrite, repeats) for parts in purged.values() for p in parts)
        staying = {t: sum(n_replacing(store.root, p.path, t, import_id) for p in parts) for t, parts in rewrite.items()}
        records = {t: _n_rows(parts, import_id) - staying[t] for t, parts in rewrite.items()}
        quarantined = _quarantined(site, import_id)
        guard(sum(records.values()), sum(n_records(store).values()), "records", terms)
        days = sorted({hour // 24 for hour in going})
        purged = Purged(
            records=records,
            n_days=len(days),
            first=date_of_hour(days[0] * 24) if days else None,
            last=date_of_hour(days[-1] * 24) if days else None,
            n_quarantined=len(quarantined),
            n_staying=sum(staying.values()),
            n_again=sum(_n_rows(_parts_of(parts, import_id), import_id) for parts in repeats.values()),
        )
        if terms.is_dry_run or purged.is_nothing:
            return line, purged
        what = {"import_id": import_id, "source": None if line is None else line.source}
        spare_other_days(site, going)
        intent = Intent(
            site_id=site.site_id,
            entry=audit_line(terms, purged, what),
            unlink=below(site.root, facts_around(site, sorted(going))),
            rewrite={t: below(site.root, [p.path for p in parts]) for t, parts in rewrite.items() if parts},
            import_id=import_id,
            repeats={t: below(site.root, [p.path for p in parts]) for t, parts in repeats.items() if parts},
            quarantined=tuple(sorted(map(durable.digest, quarantined))),
        )
        remove_records(store.root, intent)
        return line, purged


def _parts_of(parts: Sequence[Part], import_id: str) -> list[Part]:
    return [p for p in parts if import_id in brought_by(p.path)]


def _n_rows(parts: Sequence[Part], import_id: str) -> int:
    return sum(brought_by(p.path)[import_id].n_rows for p in parts)


def _quarantined(site: Site, import_id: str) -> list[bytes]:
    """Return the lines of the quarantine that came with an import."""
    entries = (each for path in quarantine.files(site.root / quarantine.FOLDER) for each in quarantine.entries(path))
    return list(dict.fromkeys(text for text, entry in entries if entry is not None and entry.import_id == import_id))


def _refuse_sealed(site: Site, import_id: str) -> None:
    """Raise StoreError E314 where an hour that the import brought records of is sealed and still holds a camera."""
    sealed = Seals(site.root / FOLDER, site_id=site.site_id).between(None, None)
    hours = sorted(h for h, unit in sealed.items() if import_id in unit.imports and unit.last_ms)
    if not hours:
        return
    first, last = (datetime.fromtimestamp(s, tz=UTC) for s in (hours[0] * 3600, (hours[-1] + 1) * 3600))
    raise StoreError(
        f"this import cannot be taken back: {len(hours):,} of its hours {'is' if len(hours) == 1 else 'are'} sealed",
        code="E314",
        why="their records were purged by age; of them only sums are stored, which name no import",
        fix=f"first remove what the sums hold of its cameras: vsd purge --camera ID --range {first:%Y-%m-%dT%H:%M}Z"
        f"..{last:%Y-%m-%dT%H:%M}Z; then run this command again",
    )
