"""Facts, like make: recompute exactly the stale units and say why each was stale."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.duck import connect
from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.site import Site
from vsd_analytics.store import Store
from vsd_analytics.store.durable import make_dirs, remove, sweep_temporaries
from vsd_analytics.store.layout import list_parts
from vsd_analytics.warehouse.dimensions import register_quarters, register_site, site_digest
from vsd_analytics.warehouse.sqlfiles import Relation, relations, sql_digest
from vsd_analytics.warehouse.units import PartIndex, Unit, day_unit, fact_path, hour_unit, text_hash

CAUSES = b"vsd.causes"
BATCH_HOURS = 24
BATCH_ROWS = 3_000_000


@dataclass(frozen=True, slots=True)
class BuildResult:
    """What a build did.

    Attributes:
        n_fresh: Units that were already right.
        reasons: Number of recomputed hours by reason, such as "new" or "settings changed".
        fingerprints: Fingerprint by UTC hour of all hours in the range, now fresh.
    """

    n_fresh: int
    reasons: Counter[str]
    fingerprints: dict[int, str]

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
        What was recomputed, and why. A second call finds everything fresh.
    """
    store = Store(site.root / "store", site_id=site.site_id)
    root = site.root / "facts"
    sweep_temporaries(root) if root.is_dir() else None
    wide = (None if first_hour is None else first_hour - 25, None if last_hour is None else last_hour + 25)
    index = PartIndex(store, first_hour=wide[0], last_hour=wide[1])
    hours = [h for h in index.hours() if (first_hour is None or h >= first_hour) and (last_hour is None or h <= last_hour)]
    shared = {
        "sql": sql_digest("staging", "facts"),
        "settings": text_hash(site.settings.fact_values()),
        "site": site_digest(site),
    }
    facts = [r for r in relations("facts").values() if r.unit == "hour"]
    days = _camera_days(site, root, index, sorted({d for h in hours for d in ((h - 1) // 24, h // 24, (h + 1) // 24)}), shared)
    units = [
        hour_unit(index, h, shared=shared, camera_days=text_hash([days[d].to_pylist() for d in sorted({(h - 1) // 24, h // 24, (h + 1) // 24}) if d in days]))
        for h in hours
    ]
    stale = [u for u in units if not all(fact_path(root, r.name, site.site_id, u, is_day=False).exists() for r in facts)]
    reasons = Counter(_reason(root, site.site_id, u) for u in stale)
    if on_plan is not None:
        on_plan(len(stale))
    for batch in _batches(stale):
        _build_batch(site, root, batch, facts, days)
        if on_hours is not None:
            on_hours(len(batch))
    return BuildResult(len(units) - len(stale), reasons, {u.number: u.fingerprint for u in units})


def _camera_days(
    site: Site, root: Path, index: PartIndex, days: Sequence[int], shared: dict[str, str]
) -> dict[int, pa.Table]:
    """Return the fact `camera_days` of each UTC day with records, computed where it is stale."""
    relation = relations("facts")["camera_days"]
    found: dict[int, pa.Table] = {}
    for day in days:
        unit = day_unit(index, day, shared=shared)
        if not any(unit.parts.values()):
            continue
        path = fact_path(root, relation.name, site.site_id, unit, is_day=True)
        if not path.exists():
            con = connect()
            register_site(con, site)
            _load(con, unit.parts)
            _write(path, con.sql(relation.sql).to_arrow_table(), unit)
            con.close()
        found[day] = pq.ParquetFile(path).read()
    return found


def _build_batch(site: Site, root: Path, units: Sequence[Unit], facts: Sequence[Relation], days: dict[int, pa.Table]) -> None:
    con = connect()
    register_site(con, site)
    register_quarters(con, first_hour=units[0].number - 1, last_hour=units[-1].number + 1)
    parts: dict[TableName, list[object]] = {t: list({p.path: p for u in units for p in u.parts[t]}.values()) for t in TABLES}
    _load(con, parts)
    con.register("_camera_days", pa.concat_tables(days.values()))
    con.execute("create temp table camera_days as select * from _camera_days")
    for relation in relations("staging").values():
        con.execute(f"create or replace temp table {relation.name} as {relation.sql}")
    wanted = pa.array([u.number for u in units], pa.int64())
    for relation in facts:
        con.execute(f"create or replace temp table {relation.name} as {relation.sql}")
        rows = con.sql(f"select * from {relation.name} order by {', '.join(relation.grain)}").to_arrow_table()
        rows = rows.filter(pc.is_in(rows["hour"], value_set=wanted))
        hour = rows["hour"].to_numpy()
        for unit in units:
            path = fact_path(root, relation.name, site.site_id, unit, is_day=False)
            _write(path, rows.filter(pa.array(hour == unit.number)), unit)
    con.close()


def _load(con: object, parts: object) -> None:
    """Create `stored_frames`, `stored_observations`, `stored_pairs` from parts."""
    for table in TABLES:
        names = [str(p.path) for p in parts[table]]  # type: ignore[index]
        columns = ", ".join(SCHEMAS[table].names)
        if names:
            con.execute(  # type: ignore[attr-defined]
                f"create or replace temp table stored_{table} as select {columns} from read_parquet($names, union_by_name = true)",
                {"names": names},
            )
        else:
            con.register("_empty", SCHEMAS[table].empty_table())  # type: ignore[attr-defined]
            con.execute(f"create or replace temp table stored_{table} as select * from _empty")  # type: ignore[attr-defined]


def _write(path: Path, rows: pa.Table, unit: Unit) -> None:
    """Write a fact file wholly or not at all (facts can be made again, so nothing waits for the disk), drop older ones."""
    make_dirs(path.parent)
    temporary = path.parent / f".{path.name}.{os.getpid()}.tmp"
    schema = rows.schema.with_metadata({CAUSES: json.dumps(unit.causes, sort_keys=True).encode()})
    pq.write_table(rows.cast(schema), temporary, compression="zstd", write_page_checksum=True)
    temporary.rename(path)
    for other in path.parent.glob(f"{path.name[:3]}*.parquet"):
        if other.name != path.name:
            remove(other)


def _batches(units: Sequence[Unit]) -> Iterator[Sequence[Unit]]:
    """Yield runs of hours of one UTC day, shorter where there is much to read."""
    for _, run in groupby(units, key=lambda u: u.number // BATCH_HOURS):
        batch: list[Unit] = []
        n_rows = 0
        for unit in run:
            own = sum(
                pq.read_metadata(p.path).num_rows for t in TABLES for p in unit.parts[t] if p.hour == unit.number
            )
            if batch and n_rows + own > BATCH_ROWS:
                yield batch
                batch, n_rows = [], 0
            batch.append(unit)
            n_rows += own
        if batch:
            yield batch


def _reason(root: Path, site_id: str, unit: Unit) -> str:
    old = list_parts(root, "coverage", site_id, first_hour=unit.number, last_hour=unit.number)
    if not old:
        return "new"
    told = (pq.read_metadata(old[0].path).metadata or {}).get(CAUSES)
    causes = json.loads(told) if told else {}
    changed = [c for c, h in unit.causes.items() if causes.get(c) != h]
    words = {
        "records": "late data",
        "sql": "SQL changed",
        "settings": "settings changed",
        "site": "cameras or calibrations changed",
        "frame interval": "frame interval changed",
    }
    return ", ".join(words[c] for c in changed) if changed else "incomplete"


