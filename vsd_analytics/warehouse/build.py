"""Facts, like make: recompute exactly the stale units and say why each was stale."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.errors import StoreError
from vsd_analytics.schema import TABLES
from vsd_analytics.site import Site
from vsd_analytics.store import Store
from vsd_analytics.store.durable import make_dirs, remove, sweep_temporaries
from vsd_analytics.store.layout import unit_folder
from vsd_analytics.warehouse.compute import day_facts, hour_facts
from vsd_analytics.warehouse.dimensions import site_digest
from vsd_analytics.warehouse.sqlfiles import relations, sql_digest
from vsd_analytics.warehouse.units import (
    Causes,
    PartIndex,
    Unit,
    day_unit,
    fact_path,
    hour_unit,
    merged_parts,
    text_hash,
)

CAUSES = b"vsd.causes"
BATCH_HOURS = 24
BATCH_ROWS = 2_000_000
"""Rows computed at once: days of quiet sites together, hours of busy ones apart."""

_WORDS = {
    "records": "late data",
    "sql": "SQL changed",
    "settings": "settings changed",
    "site": "cameras or calibrations changed",
    "frame interval": "frame interval changed",
}


@dataclass(frozen=True, slots=True)
class BuildResult:
    """What a build did.

    Attributes:
        n_fresh: Units that were already right.
        reasons: Number of recomputed hours by reason, such as "new" or "settings changed".
        fingerprints: Fingerprint by UTC hour of all hours in the range, now fresh.
        day_fingerprints: Fingerprint by UTC day number of the days they lie in or border on.
    """

    n_fresh: int
    reasons: Counter[str]
    fingerprints: Mapping[int, str]
    day_fingerprints: Mapping[int, str]

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
) -> BuildResult:
    """Make the facts of a range fresh.

    Args:
        site: The project; `<root>/store` is read, `<root>/facts` written.
        first_hour: First UTC hour number; None = everything stored.
        last_hour: Last one, inclusive.
        on_hours: Called with the number of hours done, for a progress bar.
        on_plan: Called once with the number of stale hours.

    Returns:
        What was recomputed, and why. A second call finds everything fresh. The bytes of a fact file depend on what its
        fingerprint covers alone, not on the range asked for.

    Raises:
        StoreError: E302, a file of the store or of the facts is damaged.
    """
    import duckdb

    store = Store(site.root / "store", site_id=site.site_id)
    try:
        return _build(site, store, first_hour, last_hour, on_hours, on_plan)
    except (duckdb.Error, pa.ArrowInvalid):
        store.refuse_damaged()
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
) -> BuildResult:
    root = site.root / "facts"
    around = (None if first_hour is None else first_hour - 25, None if last_hour is None else last_hour + 25)
    index = PartIndex(store, first_hour=around[0], last_hour=around[1])
    hours = [h for h in index.hours() if first_hour is None or h >= first_hour]
    hours = [h for h in hours if last_hour is None or h <= last_hour]
    shared = {
        "sql": sql_digest("staging", "facts"),
        "settings": text_hash(site.settings.fact_values()),
        "site": site_digest(site),
    }
    days = _fresh_days(site, root, _day_units(index, sorted({d for h in hours for d in _days_around(h)}), shared))
    units = [
        hour_unit(
            index,
            h,
            shared=shared,
            camera_days=text_hash([days[d].digest for d in _days_around(h) if d in days]),
        )
        for h in hours
    ]
    names = [r.name for r in relations("facts").values() if r.unit == "hour"]
    stale = [u for u in units if not all(_is_whole(fact_path(root, n, site.site_id, u, is_day=False)) for n in names)]
    reasons = Counter(_reason(root, site.site_id, u) for u in stale)
    if on_plan is not None:
        on_plan(len(stale))
    for batch in _batches(stale):
        _build_batch(site, root, batch, days)
        if on_hours is not None:
            on_hours(len(batch))
    return BuildResult(
        len(units) - len(stale),
        reasons,
        {u.number: u.fingerprint for u in units},
        {d: day.unit.fingerprint for d, day in days.items()},
    )


@dataclass(frozen=True, slots=True)
class _Day:
    """The fact `camera_days` of one UTC day."""

    unit: Unit
    rows: pa.Table
    digest: str


def _days_around(hour: int) -> list[int]:
    """Return the UTC days an hour and the hours beside it lie in."""
    return sorted({(hour + k) // 24 for k in (-1, 0, 1)})


def _day_units(index: PartIndex, days: Sequence[int], shared: Causes) -> list[Unit]:
    units = (day_unit(index, day, shared=shared) for day in days)
    return [u for u in units if any(u.parts.values())]


def _fresh_days(site: Site, root: Path, units: Sequence[Unit]) -> dict[int, _Day]:
    """Return the fact `camera_days` of each UTC day, computed where it is stale."""
    relation = relations("facts")["camera_days"]
    paths = {u.number: fact_path(root, relation.name, site.site_id, u, is_day=True) for u in units}
    for batch in _batches([u for u in units if not _is_whole(paths[u.number])]):
        rows = day_facts(site, merged_parts(batch))
        for unit in batch:
            _write(paths[unit.number], _slice(rows, "utc_day", unit.number), unit)
        _sweep([paths[u.number] for u in batch])
    try:
        tables = {u.number: pq.ParquetFile(paths[u.number]).read() for u in units}
    except (pa.ArrowException, OSError) as error:
        raise damaged_facts(error) from None
    return {u.number: _Day(u, tables[u.number], text_hash(tables[u.number].to_pylist())) for u in units}


def _build_batch(site: Site, root: Path, units: Sequence[Unit], days: Mapping[int, _Day]) -> None:
    needed = sorted({d for u in units for d in _days_around(u.number) if d in days})
    facts = hour_facts(
        site,
        parts=merged_parts(units),
        camera_days=pa.concat_tables([days[d].rows for d in needed]),
        first_hour=units[0].number,
        last_hour=units[-1].number,
    )
    for relation, rows in facts:
        paths = [fact_path(root, relation.name, site.site_id, u, is_day=False) for u in units]
        for path, unit in zip(paths, units, strict=True):
            _write(path, _slice(rows, "hour", unit.number), unit)
        _sweep(paths)


def _is_whole(path: Path) -> bool:
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


def _write(path: Path, rows: pa.Table, unit: Unit) -> None:
    """Write a fact file wholly or not at all (facts can be made again, so nothing waits for the disk)."""
    make_dirs(path.parent)
    temporary = path.parent / f".{path.name}.{os.getpid()}.tmp"
    causes = json.dumps(dict(unit.causes), sort_keys=True).encode()
    noted = rows.combine_chunks().replace_schema_metadata({CAUSES: causes})
    pq.write_table(noted, temporary, compression="zstd", write_page_checksum=True)
    temporary.rename(path)


def _sweep(paths: Sequence[Path]) -> None:
    """Remove older facts of the units whose new files are given, and what dead processes left beside them."""
    kept = {p.name: p for p in paths}
    for folder in {p.parent for p in paths}:
        sweep_temporaries(folder)
        hours = {p.name[:3] for p in kept.values() if p.parent == folder}
        for other in folder.glob("??-*.parquet"):
            if other.name[:3] in hours and other.name not in kept:
                remove(other)


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


def _reason(root: Path, site_id: str, unit: Unit) -> str:
    folder = unit_folder(root, "coverage", site_id, unit.number)
    old = sorted(folder.glob(f"{unit.number % 24:02d}-*.parquet"))
    if not old:
        return "new"
    told = (pq.read_metadata(old[0]).metadata or {}).get(CAUSES) if _is_whole(old[0]) else None
    if told is None:
        return "incomplete"
    causes = json.loads(told)
    changed = [c for c, h in unit.causes.items() if causes.get(c) != h]
    return ", ".join(_WORDS[c] for c in changed) if changed else "incomplete"
