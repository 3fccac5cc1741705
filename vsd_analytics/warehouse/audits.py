"""Audits of stored rows in SQL: each row in the UTC hour of its file's name, files sorted, and no key twice."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.store.duck import connect, literal_list
from vsd_analytics.store.verify_files import Check, StoredPart, StoreFault
from vsd_analytics.warehouse.sqlfiles import relations

if TYPE_CHECKING:
    import duckdb

BATCH_ROWS = 1_000_000
"""Rows per batch. A batch holds whole hours, so that a key that occurs twice in an hour is found."""

_FIX = "move one of the files named away, and ingest the files of that hour again: stored records are recognised"


def audit_rows(parts: Sequence[StoredPart], *, on_rows: Callable[[int], None] | None = None) -> tuple[Check, ...]:
    """Return the checks of hours, order and keys.

    Args:
        parts: Undamaged parts; if one of an hour is given, all of that hour must be.
        on_rows: Called with the number of rows done, for a progress bar.
    """
    import duckdb

    n_rows = 0
    faults: dict[str, list[StoreFault]] = {"hours": [], "order": [], "keys": []}
    with connect() as con:
        _prepare(con)
        for batch in _batches(sorted(parts, key=lambda p: (p.part, p.table))):
            try:
                _audit(con, batch, faults)
            except duckdb.Error as error:
                present = [p for p in batch if p.part.path.exists()]
                if len(present) == len(batch):
                    faults["hours"] += [_unreadable(p, error) for p in batch]
                else:  # a fold or purge removed files meanwhile
                    _audit(con, present, faults)
            n_rows += sum(p.n_rows for p in batch)
            if on_rows is not None:
                on_rows(sum(p.n_rows for p in batch))
    promises = {
        "hours": "each row lies in the UTC hour of its file's name",
        "order": "the rows of each file are sorted",
        "keys": "no record is stored twice",
    }
    return tuple(Check(name, n_rows, "rows", promises[name], tuple(each)) for name, each in faults.items())


def _prepare(con: duckdb.DuckDBPyConnection) -> None:
    con.execute("create temp table parts (path varchar, part integer, part_hour bigint)")
    for table in TABLES:
        con.register(f"_empty_{table}", SCHEMAS[table].empty_table())


def _audit(con: duckdb.DuckDBPyConnection, batch: Sequence[StoredPart], faults: dict[str, list[StoreFault]]) -> None:
    con.execute("delete from parts")
    for number, stored in enumerate(batch):
        con.execute("insert into parts values (?, ?, ?)", (str(stored.part.path), number, stored.part.hour))
    for table in TABLES:
        _view(con, table, [p.part.path for p in batch if p.table == table])
    for row in _rows(con, "rows_outside_hour"):
        faults["hours"].append(_outside(batch[row["part"]], row))
    for row in _rows(con, "rows_unsorted"):
        faults["order"].append(_unsorted(batch[row["part"]], row))
    for table in TABLES:
        faults["keys"] += _twice(table, batch, _rows(con, f"{table}_twice"))


def _view(con: duckdb.DuckDBPyConnection, table: TableName, paths: Sequence[Path]) -> None:
    """Create the view `part_<table>`: stored rows with number and hour of the part, and number of the row."""
    rows = f"(select *, 0 as part, 0 as part_hour, 0 as part_row from _empty_{table})"
    if paths:
        files = f"read_parquet({literal_list(paths)}, union_by_name = true, filename = true, file_row_number = true)"
        rows = (
            f"({rows} union all by name select f.*, parts.part, parts.part_hour, f.file_row_number as part_row "
            f"from {files} as f inner join parts on f.filename = parts.path)"
        )
    columns = ", ".join(SCHEMAS[table].names)
    con.execute(f"create or replace temp view part_{table} as select {columns}, part, part_hour, part_row from {rows}")


def _rows(con: duckdb.DuckDBPyConnection, audit: str) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = con.sql(relations("audits")[audit].sql).to_arrow_table().to_pylist()
    return rows


def _batches(parts: Sequence[StoredPart]) -> Iterator[Sequence[StoredPart]]:
    """Yield runs of whole hours of about BATCH_ROWS rows."""
    batch: list[StoredPart] = []
    n_rows = 0
    for _, hour in groupby(parts, key=lambda p: p.part.hour):
        own = list(hour)
        n_own = sum(p.n_rows for p in own)
        if batch and n_rows + n_own > BATCH_ROWS:
            yield batch
            batch, n_rows = [], 0
        batch += own
        n_rows += n_own
    if batch:
        yield batch


def _outside(stored: StoredPart, row: dict[str, Any]) -> StoreFault:
    why = f"{row['n_rows']:,} rows from {_utc(row['first_ts'])} to {_utc(row['last_ts'])}"
    return StoreFault(
        "E302", stored.part.path, "a file holds records of another UTC hour than that of its name", why, _FIX
    )


def _unsorted(stored: StoredPart, row: dict[str, Any]) -> StoreFault:
    why = f"{row['n_rows']:,} rows are out of order, the first at row {row['first_row']:,}"
    return StoreFault("E302", stored.part.path, "a file was not written by a fold of this program", why, _FIX)


def _twice(table: TableName, batch: Sequence[StoredPart], rows: Sequence[dict[str, Any]]) -> Iterator[StoreFault]:
    """Yield one finding for each two files that share keys, and for each file that holds a key twice."""
    for (first, last), keys in groupby(
        sorted(rows, key=lambda r: (r["first_part"], r["last_part"])), key=lambda r: (r["first_part"], r["last_part"])
    ):
        same = list(keys)
        other = "in it" if first == last else f"in it and in {batch[last].part.path.name}"
        where = f"camera {same[0]['camera_id']}, {_utc(same[0]['ts'])}"
        why = f"{len(same):,} records of {table} occur more than once, {other}; the first: {where}"
        yield StoreFault("E302", batch[first].part.path, "records are stored twice", why, _FIX)


def _unreadable(stored: StoredPart, error: Exception) -> StoreFault:
    why = " ".join(str(error).split())[:300]
    return StoreFault("E302", stored.part.path, "the rows of these hours cannot be read", why, _FIX)


def _utc(instant: datetime) -> str:
    return instant.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
