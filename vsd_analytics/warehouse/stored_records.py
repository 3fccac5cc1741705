"""The stored records of one batch as arrays."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.schema import SCHEMAS, TableName
from vsd_analytics.store.layout import HOUR_MS, Part
from vsd_analytics.store.part_files import unknown_in
from vsd_analytics.warehouse.held import ENUMS, NULL, Columns

DAY_MS = 86_400_000
FRAME_KEYS = ("camera_id", "ts")
PLACES = (*FRAME_KEYS, "x_mm", "y_mm", "u_px", "v_px")
UNUSED = ("quality", "distance_sd_mm")
"""Stored columns that no fact reads."""


def read_records(table: TableName, parts: Sequence[Part], first_ms: int, after_ms: int) -> pa.Table:
    """Return the stored records of a table in [first_ms, after_ms), ids as dictionaries, one of each part.

    Args:
        table: The table.
        parts: Its parts; older ones may lack columns that were added later.
        first_ms: First instant, UTC milliseconds.
        after_ms: The instant after the last one.
    """
    wanted = tuple(f.name for f in SCHEMAS[table] if f.name not in UNUSED)
    read = [_within(PartReader().rows(table, part, wanted), first_ms, after_ms) for part in parts]
    return pa.concat_tables([_schema(table, wanted).empty_table(), *read])


class PartReader:
    """Reads columns of stored parts, and keeps those of the last hours: hour by hour, each part is read once.

    Attributes:
        of_site: Small tables of the site, the same for all batches; empty until somebody puts them here.
    """

    def __init__(self) -> None:
        self._rows: dict[tuple[Part, tuple[str, ...]], pa.Table] = {}
        self.of_site: dict[str, pa.Table] = {}

    def rows(self, table: TableName, part: Part, columns: tuple[str, ...]) -> pa.Table:
        """Return some columns of a part."""
        if (part, columns) not in self._rows:
            with opened(part, table) as file:
                self._rows[part, columns] = read_columns(file, NotedColumns(file.metadata), table, columns)
        return self._rows[part, columns]

    def counted(
        self, parts: Mapping[TableName, Sequence[Part]], first_hour: int, last_hour: int, margin_ms: int
    ) -> dict[str, pa.Table]:
        """Return what counts of some hours are computed from: records of these hours, and the frames around them.

        Args:
            parts: Stored parts of the hours, and of their neighbours those that lie near enough.
            first_hour: First UTC hour number.
            last_hour: Last one, inclusive.
            margin_ms: How far from these hours frames are read.
        """
        for part, columns in [*self._rows]:
            if part.hour < first_hour - 1:
                del self._rows[part, columns]
        edges = (first_hour * HOUR_MS - margin_ms, (last_hour + 1) * HOUR_MS + margin_ms)
        own, beside = (
            {t: [p for p in parts[t] if (first_hour <= p.hour <= last_hour) is is_own] for t in parts}
            for is_own in (True, False)
        )
        frames = [self.rows("frames", p, FRAME_KEYS) for p in own["frames"]]
        frames += [_within(self.rows("frames", p, FRAME_KEYS), *edges) for p in beside["frames"]]
        people = [self.rows("observations", p, PLACES) for p in own["observations"]]
        of_others = [_within(self._frames(p), *edges) for p in beside["observations"]]
        return {
            "frames": _stacked(frames, _schema("frames", FRAME_KEYS)),
            "observations": _stacked(people, _schema("observations", PLACES)),
            "beside": _stacked(of_others, _schema("frames", FRAME_KEYS)),
        }

    def _frames(self, part: Part) -> pa.Table:
        """Return camera and instant of each frame in which a part has people."""
        if (part, FRAME_KEYS) not in self._rows:
            keys = self.rows("observations", part, PLACES).select(FRAME_KEYS).combine_chunks()
            columns = columns_of(keys)
            is_first = np.ones(keys.num_rows, dtype=np.bool_)
            is_first[1:] = False
            for column in columns.values():
                is_first[1:] |= column[1:] != column[:-1]
            self._rows[part, FRAME_KEYS] = keys.take(np.flatnonzero(is_first))
        return self._rows[part, FRAME_KEYS]


def opened(part: Part, table: TableName) -> pq.ParquetFile:
    """Return a part of a table, to read ids as dictionaries."""
    return pq.ParquetFile(part.path, read_dictionary=[f.name for f in SCHEMAS[table] if f.name in ENUMS])


def read_columns(file: pq.ParquetFile, noted: NotedColumns, table: TableName, columns: Collection[str]) -> pa.Table:
    """Return some columns of an opened part; columns that an older part lacks are unknown."""
    rows = file.read(columns=[c for c in columns if not noted.is_empty(c)], use_threads=False)
    schema = _schema(table, columns)
    return pa.table({f.name: _column(rows, f) for f in schema}, schema=schema)


class NotedColumns:
    """What the footer of a part notes about its columns, so that a column with one answer need not be read.

    Args:
        metadata: The footer.
    """

    def __init__(self, metadata: pq.FileMetaData) -> None:
        self.n_rows: int = metadata.num_rows
        self._unknown = unknown_in(metadata.metadata)
        groups = [metadata.row_group(g) for g in range(metadata.num_row_groups)]
        self._noted = {
            name: [group.column(c).statistics for group in groups] for c, name in enumerate(metadata.schema.names)
        }

    @property
    def day(self) -> int | None:
        """The UTC day number of all records; None where it is not noted, or not one."""
        noted = self._noted["ts"]
        if any(s is None or not s.has_min_max for s in noted):
            return None
        days = {at.timestamp() * 1000 // DAY_MS for s in noted for at in (s.min, s.max)}
        return int(days.pop()) if len(days) == 1 else None

    def is_empty(self, column: str) -> bool:
        """Return whether a column is unknown in every record, or not there."""
        return self._n_unknown(column) == self.n_rows

    def are_alike(self, column: str) -> bool:
        """Return whether a column is known in every record, or in none."""
        return self._n_unknown(column) in (0, self.n_rows)

    def is_known(self, column: str) -> bool:
        """Return whether a column whose records are alike is known."""
        return self._n_unknown(column) == 0

    def _n_unknown(self, column: str) -> int | None:
        if column not in self._noted:
            return self.n_rows  # an older part lacks it
        if column in self._unknown:
            return self._unknown[column]
        noted = self._noted[column]
        if any(s is None or not s.has_null_count for s in noted):
            return None
        return int(sum(s.null_count for s in noted))


def _schema(table: TableName, columns: Collection[str]) -> pa.Schema:
    fields = (f for f in SCHEMAS[table] if f.name in columns)
    text = pa.dictionary(pa.int32(), pa.string())
    return pa.schema([f.with_type(text) if f.name in ENUMS else f for f in fields])


def _stacked(pieces: Sequence[pa.Table], schema: pa.Schema) -> pa.Table:
    """Return rows one below the other. A piece alone stays one, so that its columns are arrays without a copy."""
    return pa.concat_tables(pieces) if pieces else schema.empty_table()


def _within(rows: pa.Table, first_ms: int, after_ms: int) -> pa.Table:
    ts = rows["ts"].cast(pa.int64())
    if not len(ts) or (pc.min(ts).as_py() >= first_ms and pc.max(ts).as_py() < after_ms):
        return rows
    return rows.filter(pc.and_(pc.greater_equal(ts, first_ms), pc.less(ts, after_ms)))


def _column(rows: pa.Table, field: pa.Field) -> pa.ChunkedArray | pa.Array:
    if field.name not in rows.column_names:
        return pa.nulls(rows.num_rows, field.type)
    values = rows[field.name]
    if pa.types.is_dictionary(field.type) and not pa.types.is_dictionary(values.type):
        values = values.cast(pa.string()).dictionary_encode()
    return values if values.type == field.type else values.cast(field.type)


def with_names(
    records: Mapping[str, pa.Table], cameras: Iterable[str]
) -> tuple[dict[str, pa.Table], dict[str, pa.Array]]:
    """Return records whose ids are dictionaries of all names of their enum type, and these names by type, in order.

    Args:
        records: Records by table, as they were read.
        cameras: Cameras of the site.
    """
    tables, names = dict(records), {}
    for enum, others in (("camera_name", pa.array(cameras, pa.string())), ("track_name", pa.array([], pa.string()))):
        columns = [(table, c) for table, rows in tables.items() for c in rows.column_names if ENUMS.get(c) == enum]
        pieces = [chunk for table, c in columns for chunk in tables[table][c].chunks]
        every = pa.concat_arrays([*(piece.dictionary for piece in pieces), others]).dictionary_encode()
        order = pc.sort_indices(every.dictionary)  # texts of Arrow are compared by their bytes, as those of DuckDB
        names[enum] = every.dictionary.take(order)
        place = np.empty(len(order), dtype=np.int32)
        place[order] = np.arange(len(order), dtype=np.int32)
        numbers, in_order = pa.array(place[every.indices]), pa.array(np.arange(len(every), dtype=np.int32))
        at = 0
        for table, c in columns:
            kind, pieces = pa.dictionary(pa.int32(), pa.string()), []
            for piece in tables[table][c].chunks:
                own = numbers.slice(at, len(piece.dictionary))
                is_same = own.equals(in_order.slice(0, len(own)))
                own = piece.indices if is_same else own.take(piece.indices)
                pieces.append(pa.DictionaryArray.from_arrays(own, names[enum], safe=False))
                at += len(piece.dictionary)
            rows = tables[table]
            tables[table] = rows.set_column(rows.column_names.index(c), c, pa.chunked_array(pieces, kind))
    return tables, names


def columns_of(rows: pa.Table, *, is_lean: bool = False) -> Columns:
    """Return stored records as columns: `ts` as UTC milliseconds in `ts_ms`, ids as numbers of their names.

    Args:
        rows: The records.
        is_lean: Leave columns of 32 bits that are known in every record as they are.
    """
    columns: Columns = {}
    for column in rows.column_names:
        values = rows[column]
        if column in ENUMS:
            chunks = [chunk.indices for chunk in values.chunks]
            numbers = pa.chunked_array(chunks, pa.int32())
            columns[column] = (numbers.fill_null(-1) if numbers.null_count else numbers).to_numpy()
        elif 0 < len(values) == values.null_count:  # numbers without memory of their own
            is_float = pa.types.is_floating(values.type)
            columns[column] = np.broadcast_to(np.nan if is_float else np.int64(NULL), len(values))
        elif column == "ts":
            columns["ts_ms"] = values.cast(pa.int64()).to_numpy()
        elif pa.types.is_floating(values.type):
            columns[column] = values.to_numpy(zero_copy_only=False).astype(np.float64)
        elif is_lean and not values.null_count:
            columns[column] = values.to_numpy()
        else:
            whole = values.cast(pa.int64())
            columns[column] = (whole.fill_null(NULL) if whole.null_count else whole).to_numpy()
    return columns
