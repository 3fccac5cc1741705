"""Tables of positions or pairs: CSV (plain, gz, bz2, zst; comma, semicolon, tab, blanks), Parquet, Feather, JSON, xlsx.

Our column names are `ts camera_id track_id x_m y_m u_px v_px` for positions and `ts camera_id track_a track_b x_a_m
y_a_m x_b_m y_b_m distance_m distance_sd_m` for pairs. `frame` may replace `ts`. A box (`left top right bottom`, `left
top width height` or `center_x center_y width height`, pixels) may replace `u_px v_px`, its foot point. `--map
ours=theirs` and `--columns` rename columns.
A folder, zip or tar of tables is read file by file.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from vsd_analytics.config.file_columns import FILE_COLUMNS
from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.formats.recognise import kind_of_no_table
from vsd_analytics.ingest.reading import arrow_file, parquet
from vsd_analytics.ingest.reading.adapter import IngestOptions, RawBatch, Rejected, Source
from vsd_analytics.ingest.reading.archive import archive_kind
from vsd_analytics.ingest.reading.cell_values import trimmed
from vsd_analytics.ingest.reading.column_hints import are_columns
from vsd_analytics.ingest.reading.columns import ColumnPlan, other_column_key, plan_columns
from vsd_analytics.ingest.reading.json_guess import guessed_mapping
from vsd_analytics.ingest.reading.json_table import JsonTable
from vsd_analytics.ingest.reading.named_camera import part_with_camera
from vsd_analytics.ingest.reading.raw import BadRowError
from vsd_analytics.ingest.reading.table_file import TableFile
from vsd_analytics.ingest.reading.table_head import LASTING, TableHead, head_of, values_of, watched_columns
from vsd_analytics.ingest.reading.table_parts import PartWithConstants, TablePart, has_parts, parts_of, unread_of
from vsd_analytics.ingest.reading.table_rows import raw_batch
from vsd_analytics.ingest.reading.text_table import TextTable, as_text, delimiter_of, split_by
from vsd_analytics.ingest.reading.time_formats import time_format
from vsd_analytics.ingest.reading.workbook import Workbook
from vsd_analytics.schema import TableName

_HEADS = 20
"""Files of a folder or archive that are searched for columns of cameras and classes."""
_ZIP = b"PK\x03\x04"
_SUFFIXES = frozenset({".csv", ".tsv", ".parquet"})


class Tables:
    """Adapter of tables; `--format positions` and `--format pairs` state what is in them."""

    name = "table"
    coordinates = "floor metres (x_m y_m) or image pixels (u_px v_px, or boxes)"
    uses = frozenset(
        {"columns", "map", "where", "unit", "zone", "time_format", "period_s", "fps", "start", "first_frame", "size_px"}
    )

    def __init__(self, kind: TableName | None = None, *, is_only_where: bool = False) -> None:
        self._kind = kind
        self._is_only_where = is_only_where  # read only camera and time; for text tables
        if kind is not None:
            self.name = "positions" if kind == "observations" else "pairs"
        if kind == "pairs":
            self.coordinates = "distances in metres, or two places in floor metres (x_a_m y_a_m x_b_m y_b_m)"

    def detects(self, source: Source) -> bool:
        """Return whether the suffix is that of a table, or the first line has one of our columns, or telling names."""
        if self._kind is not None:  # only the user can name what is in it
            return False
        if archive_kind(source) is not None:
            return is_workbook(source) or has_parts(source)
        head = source.head(8192)
        if head.startswith((parquet.MAGIC, arrow_file.MAGIC)):
            return True
        first = next((line for line in as_text(head).split("\n") if line.strip()), "")
        if first.lstrip("\ufeff ").startswith("["):
            return "{" in as_text(head)
        if first.lstrip().startswith("{"):
            return False
        try:
            names = [name.strip().lower() for name in split_by(delimiter_of(first))(first.strip())]
        except BadRowError:
            names = []
        is_named = any(name in FILE_COLUMNS for name in names) or are_columns(names)
        return bool(set(source.suffixes) & _SUFFIXES) or is_named

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the rows of a file, or of all files of a folder or archive; see `Adapter.read`."""
        if not is_divided(source):
            yield from self._read(source, options)
            return
        with _parts(source, options) as parts:
            self._check_parts(parts, options)
            done_bytes = 0
            for part in parts:
                for batch in self._read(part.source, options, part):
                    bad = [replace(r, detail=f"{part.name}: {r.detail}") for r in batch.rejected]
                    yield replace(batch, rejected=bad, done_bytes=min(source.size_bytes, done_bytes + batch.done_bytes))
                done_bytes += part.source.size_bytes

    def _check_parts(self, parts: Sequence[TablePart], options: IngestOptions) -> None:
        """Plan the columns of all parts: none of them is stored before all are understood.

        Raises:
            InputError: One of them cannot be read.
        """
        error, n_read = None, 0
        for part in parts:
            try:
                self._planned(part.source, options, part)
                n_read += 1
            except InputError as its_error:
                if error is None:
                    error, name = its_error, part.name
        if error is not None and error.code == "E203" and n_read:
            error.fix = f"take {name} out if it is another table, or read it by a command of its own"
        if error is not None:
            raise error

    def _read(self, source: Source, options: IngestOptions, part: TablePart | None = None) -> Iterator[RawBatch]:
        file, plan = self._planned(source, options, part)
        if self._is_only_where:
            plan = plan.only_where()
        with file.readable():
            beside_ours = {} if self._is_only_where else watched_columns(file, plan, LASTING)
            wanted = {**{other_column_key(name): i for name, i in beside_ours.items()}, **plan.wanted}
            for chunk in file.chunks(wanted):
                batch = raw_batch(plan, chunk.columns, chunk.lines, options, decimal_comma=file.has_decimal_comma)
                bad: list[Rejected] = list(batch.rejected)
                if chunk.whole is not None:
                    bad = [replace(r, whole=chunk.whole[r.line]) for r in bad]
                yield replace(
                    batch,
                    rejected=[*chunk.rejected, *bad],
                    done_bytes=chunk.done_bytes,
                    first_line=file.first_line,
                    values={name: values_of(trimmed(chunk.columns[other_column_key(name)])) for name in beside_ours},
                )

    def head(self, source: Source, options: IngestOptions) -> TableHead:
        """Return how the columns are read, and what the ignored ones hold in the first rows.

        Raises:
            InputError: The file cannot be read as a table, or lacks a column.
        """
        if not is_divided(source):
            return head_of(*self._planned(source, options))
        with _parts(source, options) as parts:
            heads = [head_of(*self._planned(part.source, options, part)) for part in parts[:_HEADS]]
            values: dict[str, Counter[str]] = {}
            for head in heads:
                for name, counts in head.values.items():
                    values.setdefault(name, Counter()).update(counts)
            return replace(heads[0], values=values, parts=[p.name for p in parts], unread=unread_of(source))

    def _planned(
        self, source: Source, options: IngestOptions, part: TablePart | None = None
    ) -> tuple[TableFile, ColumnPlan]:
        file = open_table(source, options)
        if part is not None and part.constants:
            file = PartWithConstants(file, part.constants)
        try:
            plan = plan_columns(source, options, file.header, kind=self._kind)
        except InputError as error:
            has_lists = isinstance(file, parquet.ParquetTable | arrow_file.ArrowTable) and file.has_lists
            if has_lists and error.code == "E203" and (guess := guessed_mapping(source)) is not None:
                error.fix = f"say where its values are, probably: {guess}"
            raise
        return file, replace(plan, time_format=time_format(source, file, plan, options))


@contextmanager
def _parts(source: Source, options: IngestOptions) -> Iterator[list[TablePart]]:
    with parts_of(source) as parts:
        yield [part_with_camera(part, options) for part in parts]


def open_table(source: Source, options: IngestOptions) -> TableFile:
    """Return the reader of a table file, by its first bytes.

    Raises:
        InputError: E202 it is empty, E203 to E206 it is no table or damaged.
    """
    head = source.head(4096)
    if head.startswith(parquet.MAGIC):
        return parquet.ParquetTable(source)
    if head.startswith(arrow_file.MAGIC):
        return arrow_file.ArrowTable(source)
    if head.startswith(_ZIP) and is_workbook(source):
        return Workbook(source)
    known = kind_of_no_table(source)
    if known is not None or b"\0" in head.partition(b"\n")[0]:
        what, fix = known or ("a binary file", "export the table as CSV or Parquet")
        raise InputError(f"{source.file_name} is {what}, no table", code="E204", where=Where(source.name), fix=fix)
    if head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith((b"[", b"{")) and options.columns is None:
        return JsonTable(source, options)
    return TextTable(source, options)


def is_workbook(source: Source) -> bool:
    """Return whether a file is an Excel workbook (xlsx): a zip whose first entry is one of its own."""
    head = source.head(4096) if source.path.is_file() else b""
    return head.startswith(_ZIP) and (b"[Content_Types].xml" in head or b"xl/" in head or source.suffixes == (".xlsx",))


def is_divided(source: Source) -> bool:
    """Return whether a source is a folder or archive of tables."""
    # lines of the quarantine are a source of their own, whatever their path is by now
    return type(source) is Source and archive_kind(source) is not None and not is_workbook(source)


def positions() -> Tables:
    """Return the adapter of `--format positions`."""
    return Tables("observations")


def pairs() -> Tables:
    """Return the adapter of `--format pairs`."""
    return Tables("pairs")
