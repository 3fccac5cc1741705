"""What a node handed on, decoded in bounded memory and checked as files are.

A part is refused whole before anything of it is decoded where it claims too much: bytes, rows, row groups, columns,
pages, decompressed size. Its rows then pass the checks that every file passes (`ingest.intake.normalise`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.errors import VsdError
from vsd_analytics.ingest.reading.adapter import Rejected, Source
from vsd_analytics.ingest.reading.parquet import ParquetTable
from vsd_analytics.schema import LATER, RAW_SCHEMAS, SCHEMAS, TableName
from vsd_analytics.settings import Settings
from vsd_analytics.store.owners import OWNER
from vsd_analytics.store.part_files import ENGINES_MAX, engines_in, with_every_column

PART_MAX_BYTES: Final = 128 << 20
PART_ROWS_MAX: Final = 2_000_000
ROW_GROUPS_MAX: Final = 64
UNPACKED_MAX_MB: Final = 1000.0
"""A node makes parts of about 500,000 rows in one row group."""
TEXT_MAX_CHARS: Final = 200
_RAW_NAMES: Final[Mapping[str, str]] = {"camera_id": "camera", "ts": "ts_ms", "track_id": "track"}


class PartError(ValueError):
    """A part cannot be used; the argument says why, in words."""


@dataclass(frozen=True, slots=True)
class Piece:
    """Some rows of a part.

    Attributes:
        rows: In the columns of the stored table, and `OWNER`.
        rejected: Rows left out, whose cells are too long to be read.
    """

    rows: pa.Table
    rejected: list[Rejected]


class HandedPart:
    """A part of a node.

    Args:
        path: Its file, a copy on this machine.
        table: Table of its rows.
        name: Its name at the place, for messages.
        settings: Bounds of cells and pages.

    Raises:
        PartError: It is no part of this version, or claims too much.
    """

    def __init__(self, path: Path, table: TableName, *, name: str, settings: Settings) -> None:
        self._table = table
        bounds = replace(settings, unpack_free_mb=UNPACKED_MAX_MB, unpack_ratio_max=1.0)
        try:
            with pq.ParquetFile(path) as file:
                metadata, schema = file.metadata, file.schema_arrow
            self._file = ParquetTable(Source(path, settings=bounds, shown=name))
        except (VsdError, pa.ArrowException, OSError, ValueError) as error:
            raise PartError(f"it is no segment of records: {_words(error)}") from None
        columns = [n for n in schema.names if n != OWNER]
        wanted = SCHEMAS[table]
        types = {f.name: f.type for f in wanted} | {OWNER: pa.string()}
        if columns != [n for n in wanted.names if n not in LATER or n in columns] or schema.names.count(OWNER) > 1:
            raise PartError("its columns are those of another version of this program: install one version everywhere")
        if any(schema.field(n).type != types[n] for n in schema.names):
            raise PartError("its columns are those of another version of this program: install one version everywhere")
        if metadata.num_rows > PART_ROWS_MAX or metadata.num_row_groups > ROW_GROUPS_MAX:
            raise PartError(
                f"it claims {metadata.num_rows:,} rows in {metadata.num_row_groups:,} groups; "
                f"at most {PART_ROWS_MAX:,} in {ROW_GROUPS_MAX} are read"
            )
        self._names = schema.names
        self.engines = _engines(schema.metadata)

    def pieces(self) -> Iterator[Piece]:
        """Read the part, a piece of it in memory at a time.

        Raises:
            PartError: It is damaged, or unpacks to too much; pieces before are valid.
        """
        numbers = {name: i for i, name in enumerate(self._names)}
        schema = SCHEMAS[self._table]
        try:
            for chunk in self._file.chunks(numbers):
                columns = dict(chunk.columns)
                owners = columns.pop(OWNER, None)
                given = with_every_column(self._table, pa.table(columns)).select(schema.names)
                rows = given.cast(_nullable(schema))
                is_unknown = pa.repeat("", rows.num_rows) if owners is None else pc.fill_null(owners, "")
                rows = rows.append_column(OWNER, is_unknown.cast(pa.string()))
                rows.validate(full=True)  # a text that is none would end a later command
                self._refuse_missing(rows)
                yield Piece(rows, chunk.rejected)
        except (VsdError, pa.ArrowException, OSError, ValueError) as error:
            raise error if isinstance(error, PartError) else PartError(_words(error)) from None

    def _refuse_missing(self, rows: pa.Table) -> None:
        if any(rows[f.name].null_count for f in SCHEMAS[self._table] if not f.nullable):
            raise PartError("values are missing that every record has")
        if rows.num_rows and pc.max(pc.utf8_length(rows[OWNER])).as_py() > TEXT_MAX_CHARS:
            raise PartError("the id of an import is too long")


def raw_rows(table: TableName, rows: pa.Table) -> pa.Table:
    """Return stored rows in the columns of `RAW_SCHEMAS`: metres, so that the checks of files can be asked."""
    columns: dict[str, pa.Array] = {}
    for name in SCHEMAS[table].names:
        values = rows[name]
        if name == "ts":
            values = values.cast(pa.int64())
        if name.endswith("_mm"):
            columns[f"{name[:-3]}_m"] = pc.divide(values.cast(pa.float64()), 1000.0)
        else:
            columns[_RAW_NAMES.get(name, name)] = values
    columns["zone"] = pa.nulls(rows.num_rows, pa.string())
    columns["line"] = pa.array(np.arange(1, rows.num_rows + 1))
    raw = RAW_SCHEMAS[table]
    return pa.table([columns[f.name].cast(f.type) for f in raw], schema=_nullable(raw))


def _nullable(schema: pa.Schema) -> pa.Schema:
    return pa.schema([f.with_nullable(True) for f in schema])


def _engines(metadata: Mapping[bytes, bytes] | None) -> list[str]:
    """Return the engines that a part names; none where its note is no list."""
    try:
        return [name[:TEXT_MAX_CHARS] for name in engines_in(metadata)[:ENGINES_MAX]]
    except (ValueError, TypeError, RecursionError):
        return []


def _words(error: Any) -> str:
    return str(error.what if isinstance(error, VsdError) else error)[:200]
