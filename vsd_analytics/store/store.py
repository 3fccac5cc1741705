"""The store: append (durable when it returns) and fold (immutable hour parts, no record twice).

At-least-once in, exactly-once in the table: a batch is written to the spool under the hash of its bytes, and folding
puts every record whose key the table does not hold yet into a new part of its UTC hour. A crash anywhere and a re-run
give the same table. Nothing is ever replaced, so any reader sees a part wholly or not at all.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.duck import connect
from vsd_analytics.schema import KEYS, SCHEMAS, TABLES, TableName
from vsd_analytics.store import durable
from vsd_analytics.store.layout import HOUR_MS, Part, hour_of, list_parts, segment_paths, unit_folder

if TYPE_CHECKING:
    import duckdb

ENGINES = b"vsd.engines"
SPAN_ROWS = 3_000_000
"""Rows folded at once: days of quiet sites together, hours of busy ones apart."""


@dataclass(frozen=True, slots=True)
class Counts:
    """What a fold did with one table's spool.

    Attributes:
        n_new: Records added to the table.
        n_known: Records the table (or the same spool) already held.
        n_second: Records with the key of another one in the spool but other values: second sightings, left out.
    """

    n_new: int = 0
    n_known: int = 0
    n_second: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(self.n_new + other.n_new, self.n_known + other.n_known, self.n_second + other.n_second)


@dataclass(frozen=True, slots=True)
class FoldResult:
    """What a fold did.

    Attributes:
        tables: Counts by table.
        hours: UTC hour numbers that gained a part.
    """

    tables: Mapping[TableName, Counts] = field(default_factory=dict)
    hours: frozenset[int] = frozenset()


class Store:
    """The three tables of one site.

    Args:
        root: The store folder (`<project>/store`).
        site_id: The site's id, the Hive folder its parts stand in.
    """

    def __init__(self, root: Path, *, site_id: str) -> None:
        self.root = root
        self.site_id = site_id

    def append(self, table: TableName, rows: pa.Table, *, engines: Sequence[str] = ()) -> int:
        """Put a batch into the spool; it is durable when this returns.

        Args:
            table: Which table.
            rows: Rows in `SCHEMAS[table]`.
            engines: Engine names and versions the rows came from, kept in the file's metadata.

        Returns:
            Number of rows acknowledged.

        Raises:
            OSError: The disk refused; nothing is acknowledged then.
        """
        if rows.num_rows == 0:
            return 0
        schema = SCHEMAS[table].with_metadata({ENGINES: json.dumps(sorted(set(engines))).encode()})
        data = _parquet_bytes(rows.select(schema.names).cast(schema), compression="lz4")
        durable.publish(self.root / "live" / table / f"{durable.digest(data)}.parquet", data)
        return rows.num_rows

    def fold(self, *, on_rows: Callable[[int], None] | None = None) -> FoldResult:
        """Move the spool into parts.

        Args:
            on_rows: Called with the number of spool rows done, for a progress bar.

        Returns:
            Counts per table and the hours that changed.
        """
        with durable.exclusive(self.root / ".lock"):
            durable.sweep_temporaries(self.root)
            tables: dict[TableName, Counts] = {}
            hours: set[int] = set()
            for table in TABLES:
                segments = segment_paths(self.root, table)
                if segments:
                    tables[table] = self._fold_table(table, segments, hours, on_rows)
            return FoldResult(tables, frozenset(hours))

    def n_spooled(self) -> int:
        """Return the number of rows acknowledged but not yet folded."""
        return sum(pq.read_metadata(p).num_rows for t in TABLES for p in segment_paths(self.root, t))

    def parts(self, table: TableName, *, first_hour: int | None = None, last_hour: int | None = None) -> list[Part]:
        """Return the parts of one table by hour; see `layout.list_parts`."""
        return list_parts(self.root, table, self.site_id, first_hour=first_hour, last_hour=last_hour)

    def hours(self) -> tuple[int, int] | None:
        """Return the first and last UTC hour number with a part, or None for an empty store."""
        found = [p.hour for t in TABLES for p in self.parts(t)]
        return (min(found), max(found)) if found else None

    def damaged(self) -> list[Path]:
        """Return the parts whose bytes do not match the hash in their name."""
        return [
            p.path for t in TABLES for p in self.parts(t) if durable.digest(p.path.read_bytes()) != p.digest
        ]

    def _fold_table(
        self, table: TableName, segments: list[Path], hours: set[int], on_rows: Callable[[int], None] | None
    ) -> Counts:
        con = connect()
        done = Counts()
        for names, first, last in _spans(segments):
            done += self._fold_span(con, table, names, first, last, hours)
            if on_rows is not None:
                on_rows(sum(pq.read_metadata(n).num_rows for n in names))
        con.close()
        for path in segments:
            durable.remove(path)
        durable.fsync_dir(self.root / "live" / table)
        return done

    def _fold_span(
        self, con: duckdb.DuckDBPyConnection, table: TableName, names: list[Path], first: int, last: int, hours: set[int]
    ) -> Counts:
        columns = ", ".join(SCHEMAS[table].names)
        key = ", ".join(KEYS[table])
        con.execute(
            f"create or replace temp table spooled as select {columns} from read_parquet($names) "
            "where epoch_ms(ts) >= $first and epoch_ms(ts) < $after",
            {"names": [str(n) for n in names], "first": first * HOUR_MS, "after": (last + 1) * HOUR_MS},
        )
        n_rows, n_distinct = con.execute(
            f"select (select count(*) from spooled), (select count(*) from (select distinct {columns} from spooled))"
        ).fetchall()[0]
        if not n_rows:
            return Counts()
        con.execute(
            f"create or replace temp table fresh as select distinct on ({key}) {columns} from spooled order by {key}, {columns}"
        )
        n_keys = con.execute("select count(*) from fresh").fetchall()[0][0]
        known = self.parts(table, first_hour=first, last_hour=last)
        if known:
            con.execute(
                f"create or replace temp table stored as select {columns} from read_parquet($names)",
                {"names": [str(p.path) for p in known]},
            )
            same = " and ".join(f"{_qualified(k, 'fresh')} is not distinct from {_qualified(k, 'stored')}" for k in KEYS[table])
            con.execute(f"create or replace temp table fresh as select fresh.* from fresh anti join stored on {same}")
        rows = con.sql(f"select * from fresh order by {columns}").to_arrow_table().cast(SCHEMAS[table])
        engines = sorted({e for n in names for e in engines_of(n)})
        for hour, part in _by_hour(rows):
            data = part_bytes(table, part, engines)
            folder = unit_folder(self.root, table, self.site_id, hour)
            durable.publish(folder / f"{hour % 24:02d}-{durable.digest(data)}.parquet", data)
            hours.add(hour)
        return Counts(rows.num_rows, n_rows - rows.num_rows - (n_distinct - n_keys), n_distinct - n_keys)


def engines_of(path: Path) -> list[str]:
    """Return the engine names and versions noted in a part's or segment's metadata."""
    noted = (pq.read_metadata(path).metadata or {}).get(ENGINES)
    return [str(e) for e in json.loads(noted)] if noted else []


def part_bytes(table: TableName, rows: pa.Table, engines: Sequence[str]) -> pa.Buffer:
    """Return the bytes of a part: zstd, dictionary for ids and millimetres, delta coding for time, page checksums."""
    schema = SCHEMAS[table].with_metadata({ENGINES: json.dumps(list(engines)).encode()})
    dictionary = [f.name for f in schema if pa.types.is_string(f.type) or f.name.endswith(("_mm", "_px"))]
    return _parquet_bytes(
        rows.select(schema.names).cast(schema),
        compression="zstd",
        compression_level=3,
        row_group_size=1_000_000,
        write_page_checksum=True,
        use_dictionary=dictionary,
        column_encoding={"ts": "DELTA_BINARY_PACKED"},
    )


def _parquet_bytes(rows: pa.Table, **options: object) -> pa.Buffer:
    sink = pa.BufferOutputStream()
    pq.write_table(rows, sink, **options)
    return sink.getvalue()


def _spans(segments: list[Path]) -> Iterator[tuple[list[Path], int, int]]:
    """Yield (segments that may hold them, first hour, last hour) so that no span holds more than about SPAN_ROWS rows."""
    ranges = []
    for path in segments:
        meta = pq.read_metadata(path)
        index = meta.schema.names.index("ts")
        stats = [meta.row_group(i).column(index).statistics for i in range(meta.num_row_groups)]
        first = min(_ms(s.min) for s in stats)
        last = max(_ms(s.max) for s in stats)
        ranges.append((hour_of(first), hour_of(last), meta.num_rows, path))
    if not ranges:
        return
    day = min(r[0] for r in ranges) // 24
    last_day = max(r[1] for r in ranges) // 24
    days = sorted({d for r in ranges for d in range(r[0] // 24, r[1] // 24 + 1)}) if last_day - day < 100_000 else []
    for d in days:
        inside = [r for r in ranges if r[0] // 24 <= d <= r[1] // 24]
        if sum(r[2] for r in inside) <= SPAN_ROWS:
            yield [r[3] for r in inside], d * 24, d * 24 + 23
            continue
        for hour in range(d * 24, d * 24 + 24):
            names = [r[3] for r in inside if r[0] <= hour <= r[1]]
            if names:
                yield names, hour, hour


def _ms(value: object) -> int:
    return round(value.timestamp() * 1000)  # type: ignore[attr-defined]


def _by_hour(rows: pa.Table) -> Iterator[tuple[int, pa.Table]]:
    """Split rows into UTC hours, keeping their order."""
    import numpy as np

    hours = rows["ts"].cast(pa.int64()).to_numpy() // HOUR_MS
    for hour in np.unique(hours):
        yield int(hour), rows.filter(pa.array(hours == hour))


def _qualified(expression: str, relation: str) -> str:
    if not expression.startswith("case"):
        return f"{relation}.{expression}"
    condition, column = expression.removeprefix("case when ").removesuffix(" end").split(" then ")
    return f"case when {' or '.join(f'{relation}.{c}' for c in condition.split(' or '))} then {relation}.{column} end"
