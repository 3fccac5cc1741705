"""The rows of parts, audited by SQL: each in the hour of its file's name, sorted, and no key twice."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vsd_analytics.duck import connect, literal_list
from vsd_analytics.schema import SCHEMAS, TABLES, TableName
from vsd_analytics.store.verify import Check, Finding, StoredPart
from vsd_analytics.warehouse.sqlfiles import relations

if TYPE_CHECKING:
    import duckdb

BATCH_ROWS = 1_000_000
"""Rows audited at once: whole hours, so that a key twice in an hour is found."""

_APART = "move one of the files named away, and ingest the files of that hour again: what is stored is recognised"


def audit_rows(parts: Sequence[StoredPart], *, on_rows: Callable[[int], None] | None = None) -> tuple[Check, ...]:
    """Return the checks of hours, order and keys.

    Args:
        parts: Sound parts; those of one hour must all be among them.
        on_rows: Called with the number of rows done, for a progress bar.
    """
    import duckdb

    n_rows = 0
    found: dict[str, list[Finding]] = {"hours": [], "order": [], "keys": []}
    with connect() as con:
        _prepare(con)
        for batch in _batches(sorted(parts, key=lambda p: (p.part, p.table))):
            try:
                _audit(con, batch, found)
            except duckdb.Error as error:
                left = [p for p in batch if p.part.path.exists()]
                if len(left) == len(batch):
                    found["hours"] += [_unreadable(p, error) for p in batch]
                else:  # somebody removed records meanwhile
                    _audit(con, left, found)
            n_rows += sum(p.n_rows for p in batch)
            if on_rows is not None:
                on_rows(sum(p.n_rows for p in batch))
    promises = {
        "hours": "each row lies in the UTC hour of its file's name",
        "order": "the rows of each file are sorted",
        "keys": "no record is stored twice",
    }
    return tuple(Check(name, n_rows, "rows", promises[name], tuple(each)) for name, each in found.items())


def _prepare(con: duckdb.DuckDBPyConnection) -> None:
    con.execute("create temp table parts (path varchar, part integer, part_hour bigint)")
    for table in TABLES:
        con.register(f"_empty_{table}", SCHEMAS[table].empty_table())


def _audit(con: duckdb.DuckDBPyConnection, batch: Sequence[StoredPart], found: dict[str, list[Finding]]) -> None:
    con.execute("delete from parts")
    for number, stored in enumerate(batch):
        con.execute("insert into parts values (?, ?, ?)", (str(stored.part.path), number, stored.part.hour))
    for table in TABLES:
        _view(con, table, [p.part.path for p in batch if p.table == table])
    for row in _rows(con, "rows_outside_hour"):
        found["hours"].append(_outside(batch[row["part"]], row))
    for row in _rows(con, "rows_unsorted"):
        found["order"].append(_unsorted(batch[row["part"]], row))
    for table in TABLES:
        found["keys"] += _twice(table, batch, _rows(con, f"{table}_twice"))


def _view(con: duckdb.DuckDBPyConnection, table: TableName, paths: Sequence[Path]) -> None:
    """Make `part_<table>`: rows as stored, with number of the part, hour of its name, and place in the file."""
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
    """Yield runs of whole hours of at most about BATCH_ROWS rows."""
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


def _outside(stored: StoredPart, row: dict[str, Any]) -> Finding:
    why = f"{row['n_rows']:,} rows from {_utc(row['first_ts'])} to {_utc(row['last_ts'])}"
    return Finding("E302", stored.part.path, "a file holds records of another UTC hour than its name says", why, _APART)


def _unsorted(stored: StoredPart, row: dict[str, Any]) -> Finding:
    why = f"{row['n_rows']:,} rows stand elsewhere than a fold would put them, first row {row['first_row']:,}"
    return Finding("E302", stored.part.path, "a file was not written by a fold of this program", why, _APART)


def _twice(table: TableName, batch: Sequence[StoredPart], rows: Sequence[dict[str, Any]]) -> Iterator[Finding]:
    """Yield one finding for each two files that hold the same keys, and for each that holds one twice."""
    for (first, last), keys in groupby(
        sorted(rows, key=lambda r: (r["first_part"], r["last_part"])), key=lambda r: (r["first_part"], r["last_part"])
    ):
        same = list(keys)
        other = "in it" if first == last else f"in it and in {batch[last].part.path.name}"
        where = f"camera {same[0]['camera_id']}, {_utc(same[0]['ts'])}"
        why = f"{len(same):,} records of {table} stand more than once, {other}; the first: {where}"
        yield Finding("E302", batch[first].part.path, "records are stored twice", why, _APART)


def _unreadable(stored: StoredPart, error: Exception) -> Finding:
    why = " ".join(str(error).split())[:300]
    return Finding("E302", stored.part.path, "the rows of these hours cannot be read", why, _APART)


def _utc(instant: datetime) -> str:
    return instant.astimezone(UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
