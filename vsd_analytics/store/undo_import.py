"""Taking an import back: its records leave the parts.

What other imports brought of the same records takes their place. The steps are those of a removal (`store.removal`):
each of them can be done twice, and none loses a record that stays. Parts of the tables come first. Only then the notes
of repeats are rewritten, because a step that is done again needs them until its part is right.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.schema import KEYS, SCHEMAS, TableName
from vsd_analytics.store import durable
from vsd_analytics.store.duck import connect
from vsd_analytics.store.owners import OWNER
from vsd_analytics.store.part_files import engines_of, part_bytes, read_owned
from vsd_analytics.store.repeats import AGAIN, key_aliases, same_key


def undo_import(store: Path, path: Path, table: TableName, import_id: str, *, order: Mapping[str, int]) -> Path:
    """Replace a part by the rows that stay when an import is taken back, under its new hash; return its folder.

    A record that others brought as well stays as the first of them brought it.

    Args:
        store: The store folder.
        path: The part.
        table: Its table.
        import_id: The import.
        order: Number of the command that brought each import.
    """
    if path.exists():
        rest, replacing = _without_import(store, path, table, import_id, order)
        replace_part(path, table, _sorted(table, rest, replacing))
    return path.parent


def n_replacing(store: Path, path: Path, table: TableName, import_id: str) -> int:
    """Return how many records of an import in a part would stay, because others brought them as well."""
    if not _same_hour(store / AGAIN / table, path):
        return 0
    return int(_without_import(store, path, table, import_id, {})[1].num_rows)


def _without_import(
    store: Path, path: Path, table: TableName, import_id: str, order: Mapping[str, int]
) -> tuple[pa.Table, pa.Table]:
    """Return the rows of a part that are not the import's, and the rows that take the place of those that are."""
    rows = read_owned(path, table)
    is_gone = pc.equal(rows[OWNER], import_id)
    again = _repeats_beside(store, path, table)
    again = again.filter(pc.not_equal(again[OWNER], import_id))
    return rows.filter(pc.invert(is_gone)), _next(table, rows.filter(is_gone), again, order)


def forget_repeats(store: Path, path: Path, table: TableName, import_id: str) -> Path:
    """Replace a part of the repeats by the rows that are still repeats; return its folder.

    Rows of the import that is taken back go, and rows that now are the stored record of their import.
    """
    if path.exists():
        rows = read_owned(path, table)
        rows = rows.filter(pc.not_equal(rows[OWNER], import_id))
        owned = [read_owned(p, table) for p in _same_hour(store / table, path)]
        if owned:
            rows = _unowned(table, rows, pa.concat_tables(owned))
        replace_part(path, table, rows)
    return path.parent


def _next(table: TableName, gone: pa.Table, again: pa.Table, order: Mapping[str, int]) -> pa.Table:
    """Return for each record that goes the row that the next import brought of it, if one did."""
    if not again.num_rows or not gone.num_rows:
        return again.slice(0, 0)
    columns, key = ", ".join(SCHEMAS[table].names), ", ".join(KEYS[table])
    run = pa.array([order.get(i, 2**53) for i in again[OWNER].to_pylist()], pa.int64())
    with connect() as con:
        con.register("gone", gone)
        con.register("brought", again.append_column("run", run))
        rows = con.sql(
            f"select distinct on ({key}) {columns}, {OWNER} from (select *, {key_aliases(table)} from brought) as f "
            f"semi join (select {key_aliases(table)} from gone) as s on {same_key(table)} "
            f"order by {key}, run, {columns}, {OWNER}"
        ).to_arrow_table()
    return rows.cast(again.schema)


def _unowned(table: TableName, rows: pa.Table, owned: pa.Table) -> pa.Table:
    """Return rows whose import does not own the stored record of their key."""
    names = ", ".join([*SCHEMAS[table].names, OWNER])
    with connect() as con:
        con.register("noted", rows)
        con.register("stored", owned)
        unowned = con.sql(
            f"select {names} from (select *, {key_aliases(table)} from noted) as f "
            f"anti join (select {OWNER}, {key_aliases(table)} from stored) as s "
            f"on f.{OWNER} = s.{OWNER} and {same_key(table)} order by {names}"
        ).to_arrow_table()
    return unowned.cast(rows.schema)


def _sorted(table: TableName, rows: pa.Table, more: pa.Table) -> pa.Table:
    """Return rows of one hour in the order of a part, with more rows among them."""
    if not more.num_rows:
        return rows
    every = pa.concat_tables([rows, more])
    by = [(name, "ascending") for name in SCHEMAS[table].names]
    return every.take(pc.sort_indices(every, sort_keys=by))


def replace_part(path: Path, table: TableName, rows: pa.Table) -> None:
    """Replace a part by rows, then rename it to its own hash; without rows, remove it.

    Each step is one rename, so that even a plain glob never sees a record twice and never misses one that stays.
    Published under its own name first, the new part would be there beside the old one for a moment.
    """
    if not rows.num_rows:
        durable.remove(path)
        return
    data = part_bytes(table, rows, engines_of(path))
    durable.publish(path, data)  # a crash after this leaves a name with another hash; the next run renames it
    path.rename(path.parent / f"{path.name[:2]}-{durable.digest(data)}.parquet")


def _repeats_beside(store: Path, path: Path, table: TableName) -> pa.Table:
    """Return the repeats of a part's hour."""
    repeats = [read_owned(p, table) for p in _same_hour(store / AGAIN / table, path)]
    return pa.concat_tables(repeats) if repeats else SCHEMAS[table].append(pa.field(OWNER, pa.string())).empty_table()


def _same_hour(folder: Path, path: Path) -> list[Path]:
    """Return the parts below another table folder of the same site, UTC date and hour."""
    return sorted((folder / path.parent.parent.name / path.parent.name).glob(f"{path.name[:2]}-*.parquet"))
