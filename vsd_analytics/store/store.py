"""The store: append (durable when it returns) and fold (immutable hour parts, no record twice).

At-least-once in, exactly-once in the table: a batch is written to the spool under the hash of its bytes, and folding
puts every record whose key the table does not hold yet into a new part of its UTC hour. A crash anywhere and a re-run
give the same table. Nothing is ever replaced, so any reader sees a part wholly or not at all.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.duck import connect
from vsd_analytics.errors import DiskError, StoreError, Where, disk_error
from vsd_analytics.schema import KEYS, SCHEMAS, TABLES, TableName
from vsd_analytics.store import ballast, durable
from vsd_analytics.store.layout import HOUR_MS, Part, hour_of, list_parts, segment_paths, unit_folder

if TYPE_CHECKING:
    import duckdb

ENGINES = b"vsd.engines"
ENGINES_MAX = 32
"""Engine names kept of one file: who sends a new name with every message shall not fill the metadata."""
SPAN_ROWS = 500_000
"""Rows folded at once: whole days of quiet sites, single hours of busy ones."""


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
        is_ballast_spent: The disk was full, and the ballast was given up so that the fold could be done (W304).
    """

    tables: Mapping[TableName, Counts] = field(default_factory=dict)
    hours: frozenset[int] = frozenset()
    is_ballast_spent: bool = False


class Store:
    """The three tables of one site.

    Args:
        root: The store folder (`<project>/store`).
        site_id: The site's id, the Hive folder its parts stand in.
        ballast_mb: Ballast a fold takes when there is room, in megabytes; 0 = have none, None = leave it as it is.
    """

    def __init__(self, root: Path, *, site_id: str, ballast_mb: float | None = None) -> None:
        self.root = root
        self.site_id = site_id
        self.ballast_mb = ballast_mb

    def append(self, table: TableName, rows: pa.Table, *, engines: Sequence[str] = ()) -> int:
        """Put a batch into the spool; it is durable when this returns.

        Args:
            table: Which table.
            rows: Rows in `SCHEMAS[table]`.
            engines: Engine names and versions the rows came from, kept in the file's metadata.

        Returns:
            Number of rows acknowledged.

        Raises:
            DiskError: E304 to E306, the disk refused; nothing is acknowledged then.
        """
        if rows.num_rows == 0:
            return 0
        schema = SCHEMAS[table].with_metadata({ENGINES: json.dumps(sorted(set(engines))[:ENGINES_MAX]).encode()})
        data = _parquet_bytes(rows.select(schema.names).cast(schema), compression="lz4")
        durable.publish(self.root / "live" / table / f"{durable.digest(data)}.parquet", data)
        return int(rows.num_rows)

    def fold(self, *, on_rows: Callable[[int], None] | None = None) -> FoldResult:
        """Move the spool into parts.

        Args:
            on_rows: Called with the number of spool rows done, for a progress bar.

        Returns:
            Counts per table and the hours that changed.

        Raises:
            StoreError: E302, a file of the spool or the store is damaged; nothing is removed from the spool then.
            DiskError: E304 to E306, the disk refused; the spool keeps what was acknowledged.
        """
        if not self.root.is_dir() or self._has_nothing_to_do():
            return FoldResult()
        from vsd_analytics.store import removal

        while True:
            removal.complete(self.root)
            with durable.exclusive(self.root / ".lock"):
                if not removal.pending(self.root):
                    return self.fold_held(on_rows=on_rows)

    def fold_held(self, *, on_rows: Callable[[int], None] | None = None) -> FoldResult:
        """Fold for a caller that holds the store's lock already; see `fold`."""
        had_ballast = ballast.is_kept(self.root)
        durable.sweep_temporaries(self.root)
        tables: dict[TableName, Counts] = {}
        hours: set[int] = set()
        for table in TABLES:
            segments = segment_paths(self.root, table)
            if segments:
                tables[table] = self._fold_table(table, segments, hours, on_rows)
        is_spent = had_ballast and not ballast.is_kept(self.root)
        if self.ballast_mb is not None and not is_spent:
            ballast.keep(self.root, n_bytes=int(self.ballast_mb * 1_000_000))
        return FoldResult(tables, frozenset(hours), is_spent)

    def n_spooled(self) -> int:
        """Return the number of rows acknowledged but not yet folded."""
        n_rows = 0
        for path in (p for t in TABLES for p in segment_paths(self.root, t)):
            try:
                n_rows += pq.read_metadata(path).num_rows
            except FileNotFoundError:
                continue  # folded meanwhile
            except (pa.ArrowException, ValueError, OSError) as error:
                if getattr(error, "errno", None):
                    raise
                raise _damaged_segment(path) from None
        return n_rows

    def parts(self, table: TableName, *, first_hour: int | None = None, last_hour: int | None = None) -> list[Part]:
        """Return the parts of one table by hour; see `layout.list_parts`."""
        return list_parts(self.root, table, self.site_id, first_hour=first_hour, last_hour=last_hour)

    def hours(self) -> tuple[int, int] | None:
        """Return the first and last UTC hour number with a part, or None for an empty store."""
        found = [p.hour for t in TABLES for p in self.parts(t)]
        return (min(found), max(found)) if found else None

    def damaged(self) -> list[Path]:
        """Return the parts whose bytes do not match the hash in their name."""
        return [p.path for t in TABLES for p in self.parts(t) if durable.file_digest(p.path) != p.digest]

    def refuse_damaged(self, parts: Iterable[Part] | None = None) -> None:
        """Raise StoreError E302 when a part is damaged: before its rows are used, or after it could not be read.

        Args:
            parts: Parts to look at; None = all.
        """
        for part in parts if parts is not None else (p for t in TABLES for p in self.parts(t)):
            if durable.file_digest(part.path) != part.digest:
                raise _damaged_part(part.path)

    def _fold_table(
        self, table: TableName, segments: list[Path], hours: set[int], on_rows: Callable[[int], None] | None
    ) -> Counts:
        for path in segments:
            if durable.file_digest(path) != path.stem:
                raise _damaged_segment(path)
        done = Counts()
        folders: set[Path] = set()
        with connect() as con:
            for span in _spans(segments):
                rows, n_read, n_second = self._new_rows(con, table, span)
                engines = sorted({e for path in span.segments for e in engines_of(path)})
                for hour, part in _by_hour(rows):
                    data = part_bytes(table, part, engines)
                    folder = unit_folder(self.root, table, self.site_id, hour)
                    self._publish(folder / f"{hour % 24:02d}-{durable.digest(data)}.parquet", data)
                    hours.add(hour)
                done += Counts(rows.num_rows, n_read - rows.num_rows - n_second, n_second)
                parts = self.parts(table, first_hour=span.first_hour, last_hour=span.last_hour)
                folders |= {part.path.parent for part in parts}
                if on_rows is not None:
                    on_rows(n_read)
        for folder in sorted(folders):  # what a fold that was killed renamed and did not sync is durable from here on
            durable.fsync_dir(folder)
        for path in segments:
            durable.remove(path)
        durable.fsync_dir(self.root / "live" / table)
        return done

    def _has_nothing_to_do(self) -> bool:
        """Tell whether nothing is spooled and, the disk being one that can only be read, nothing can be swept."""
        return not os.access(self.root, os.W_OK) and not any(segment_paths(self.root, t) for t in TABLES)

    def _publish(self, path: Path, data: pa.Buffer) -> None:
        """Publish a part; on a full disk once more after the ballast is given up."""
        try:
            durable.publish(path, data)
        except DiskError as error:
            if error.code != "E304" or not ballast.give_up(self.root):
                raise
            durable.publish(path, data)

    def _new_rows(self, con: duckdb.DuckDBPyConnection, table: TableName, span: _Span) -> tuple[pa.Table, int, int]:
        """Return a span's rows that the table lacks, sorted by hour, how many were read, and how many second sightings.

        Of several rows with one key the least by its columns is taken, whatever the order of files. Rows are only
        compared where a 64-bit hash of their keys says that they may be the same.
        """
        import duckdb

        columns, key = ", ".join(SCHEMAS[table].names), ", ".join(KEYS[table])
        known = self.parts(table, first_hour=span.first_hour, last_hour=span.last_hour)
        self.refuse_damaged(known)  # a flipped bit in a key would let a record in twice
        try:
            con.execute(
                f"create or replace temp table spooled as select {columns}, hash({key}) as key_hash "
                "from read_parquet($names) where ts >= to_timestamp($first_s) and ts < to_timestamp($end_s)",
                {
                    "names": [str(path) for path in span.segments],
                    "first_s": span.first_hour * 3600,
                    "end_s": (span.last_hour + 1) * 3600,
                },
            )
            con.execute(
                "create or replace temp table doubtful as "
                "select * from spooled where key_hash in (select key_hash from spooled group by 1 having count(*) > 1)"
            )
            con.execute(
                f"create or replace temp table fresh as select {columns} from spooled "
                "where key_hash not in (select key_hash from doubtful) union all "
                f"(select distinct on ({key}) {columns} from doubtful order by {key}, {columns})"
            )
            n_read, n_second = con.execute(
                "select (select count(*) from spooled), (select count(*) from (select distinct * from doubtful)) "
                f"- (select count(*) from (select distinct {key} from doubtful))"
            ).fetchall()[0]
            if known:
                aliases = [f"key_{i}" for i in range(len(KEYS[table]))]
                aliased = ", ".join(f"{k} as {a}" for k, a in zip(KEYS[table], aliases, strict=True))
                is_same = " and ".join(f"f.{a} is not distinct from s.{a}" for a in aliases)
                con.execute(
                    f"create or replace temp table fresh as select {columns} from (select *, {aliased} from fresh) as f"
                    f" "
                    f"anti join (select {aliased} from read_parquet($names)) as s on {is_same}",
                    {"names": [str(part.path) for part in known]},
                )
            order = f"cast(floor(epoch_ms(ts) / {HOUR_MS}) as bigint), {columns}"
            rows = con.sql(f"select * from fresh order by {order}").to_arrow_table().cast(SCHEMAS[table])
            for name in ("spooled", "doubtful", "fresh"):
                con.execute(f"drop table {name}")
        except duckdb.Error as error:
            if refused := disk_error(error):
                raise refused from None
            raise StoreError(
                "the spool cannot be folded into the store", code="E302", why=str(error)[:300], mend="vsd doctor"
            ) from None
        return rows, n_read, n_second


def _damaged_segment(path: Path) -> StoreError:
    return _damaged(path, "records acknowledged earlier", mend="move it away and ingest their source again")


def _damaged_part(path: Path) -> StoreError:
    return _damaged(path, "stored records", mend="restore it from a backup, or move it away")


def _damaged(path: Path, what: str, *, mend: str) -> StoreError:
    return StoreError(
        f"a file with {what} is damaged",
        code="E302",
        where=Where(str(path)),
        why="its bytes are not those whose hash stands in its name: the disk or a program changed them",
        mend=mend,
    )


def engines_of(path: Path) -> list[str]:
    """Return the engine names and versions noted in a part's or segment's metadata."""
    noted = (pq.read_metadata(path).metadata or {}).get(ENGINES)
    return [str(e) for e in json.loads(noted)] if noted else []


def part_bytes(table: TableName, rows: pa.Table, engines: Sequence[str]) -> pa.Buffer:
    """Return the bytes of a part: zstd, dictionary for ids and millimetres, delta coding for time, page checksums."""
    schema = SCHEMAS[table].with_metadata({ENGINES: json.dumps(list(engines)[:ENGINES_MAX]).encode()})
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


@dataclass(frozen=True, slots=True)
class _Span:
    """Hours that are folded together, and the segments that may hold records of them."""

    segments: Sequence[Path]
    first_hour: int
    last_hour: int


def _spans(segments: Sequence[Path]) -> Iterator[_Span]:
    """Yield the days of a spool, or the hours of days with more than SPAN_ROWS rows."""
    ranges = []
    for path in segments:
        meta = pq.read_metadata(path)
        column = meta.schema.names.index("ts")
        statistics = [meta.row_group(i).column(column).statistics for i in range(meta.num_row_groups)]
        first, last = min(s.min for s in statistics), max(s.max for s in statistics)
        ranges.append((hour_of(_ms(first)), hour_of(_ms(last)), meta.num_rows, path))
    for day in sorted({d for first, last, _, _ in ranges for d in range(first // 24, last // 24 + 1)}):
        inside = [r for r in ranges if r[0] // 24 <= day <= r[1] // 24]
        if sum(n_rows for _, _, n_rows, _ in inside) <= SPAN_ROWS:
            yield _Span([path for *_, path in inside], day * 24, day * 24 + 23)
            continue
        for hour in range(day * 24, day * 24 + 24):
            if paths := [path for first, last, _, path in inside if first <= hour <= last]:
                yield _Span(paths, hour, hour)


def _ms(instant: datetime) -> int:
    return round(instant.timestamp() * 1000)


def _by_hour(rows: pa.Table) -> Iterator[tuple[int, pa.Table]]:
    """Cut rows that are sorted by UTC hour into hours."""
    import numpy as np

    hours = rows["ts"].cast(pa.int64()).to_numpy() // HOUR_MS
    starts = np.flatnonzero(np.diff(hours, prepend=hours[:1] - 1))
    lengths = np.diff(starts, append=len(hours))
    for start, length in zip(starts.tolist(), lengths.tolist(), strict=True):
        yield int(hours[start]), rows.slice(start, length)
