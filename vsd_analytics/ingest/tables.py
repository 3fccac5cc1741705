"""Tables of positions or pairs: CSV (plain, gz, bz2, zst; comma, semicolon, tab or blanks) and Parquet.

Our column names are `ts camera_id track_id x_m y_m u_px v_px` for positions and `ts camera_id track_a track_b x_a_m
y_a_m x_b_m y_b_m distance_m distance_sd_m` for pairs. `frame` may replace `ts`. A box (`left top right bottom` or `left
top width height`, pixels) may replace `u_px v_px`, its foot point. `--map ours=theirs` and `--columns` rename columns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from vsd_analytics.ingest.adapter import IngestOptions, RawBatch, Source
from vsd_analytics.ingest.columns import KNOWN, ColumnPlan, plan_columns
from vsd_analytics.ingest.parquet import ParquetTable
from vsd_analytics.ingest.raw import BadRowError
from vsd_analytics.ingest.table_file import TableFile
from vsd_analytics.ingest.table_head import TableHead, head_of
from vsd_analytics.ingest.table_rows import raw_batch
from vsd_analytics.ingest.text_table import TextTable, as_text, delimiter_of, split_by
from vsd_analytics.ingest.time_formats import time_format
from vsd_analytics.schema import TableName

_PARQUET = b"PAR1"
_SUFFIXES = frozenset({".csv", ".tsv", ".parquet"})


class Tables:
    """Adapter of tables; `--format positions` and `--format pairs` state what is in them."""

    name = "table"
    coordinates = "floor metres (x_m y_m) or image pixels (u_px v_px, or boxes)"

    def __init__(self, kind: TableName | None = None, *, is_only_where: bool = False) -> None:
        self._kind = kind
        self._is_only_where = is_only_where  # read only camera and time; for text tables
        if kind is not None:
            self.name = "positions" if kind == "observations" else "pairs"

    def detects(self, source: Source) -> bool:
        """Return whether the suffix is that of a table, or the first line has one of our column names."""
        if source.path.is_dir() or self._kind is not None:  # only the user can name what is in it
            return False
        head = source.head(8192)
        if head.startswith(_PARQUET):
            return True
        first = next((line for line in as_text(head).split("\n") if line.strip()), "")
        if first.lstrip().startswith(("{", "[")):
            return False
        try:
            names = [name.strip().lower() for name in split_by(delimiter_of(first))(first)]
        except BadRowError:
            names = []
        return bool(set(source.suffixes) & _SUFFIXES) or any(name in KNOWN for name in names)

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the rows of one file; see `Adapter.read`."""
        file, plan = self._planned(source, options)
        if self._is_only_where:
            plan = plan.only_where()
        with file.readable():
            for chunk in file.chunks(plan.wanted):
                batch = raw_batch(plan, chunk.columns, chunk.lines, options, decimal_comma=file.has_decimal_comma)
                bad = batch.rejected
                if chunk.whole is not None:
                    bad = [replace(r, whole=chunk.whole[r.line]) for r in bad]
                yield replace(
                    batch,
                    rejected=[*chunk.rejected, *bad],
                    done_bytes=chunk.done_bytes,
                    first_line=file.first_line,
                )

    def head(self, source: Source, options: IngestOptions) -> TableHead:
        """Return how the columns are read, and what the ignored ones hold in the first rows.

        Raises:
            InputError: The file cannot be read as a table, or lacks a column.
        """
        return head_of(*self._planned(source, options))

    def _planned(self, source: Source, options: IngestOptions) -> tuple[TableFile, ColumnPlan]:
        file = open_table(source, options)
        plan = plan_columns(source, options, file.header, kind=self._kind)
        return file, replace(plan, time_format=time_format(source, file, plan, stated=options.time_format))


def open_table(source: Source, options: IngestOptions) -> TableFile:
    """Return the reader of a table file, by its first bytes.

    Raises:
        InputError: E202 it is empty, E203 to E206 it is no table or damaged.
    """
    if source.head(4) == _PARQUET:
        return ParquetTable(source)
    return TextTable(source, options)


def positions() -> Tables:
    """Return the adapter of `--format positions`."""
    return Tables("observations")


def pairs() -> Tables:
    """Return the adapter of `--format pairs`."""
    return Tables("pairs")
