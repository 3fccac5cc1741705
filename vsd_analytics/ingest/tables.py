"""Tables of positions or pairs: CSV (plain, gz, bz2, zst; comma, semicolon, tab or blanks) and Parquet.

Our column names are `ts camera_id track_id x_m y_m u_px v_px` for positions and `ts camera_id track_a track_b x_a_m
y_a_m x_b_m y_b_m distance_m distance_sd_m` for pairs. `frame` may replace `ts`. A box (`left top right bottom` or `left
top width height`, pixels) may replace `u_px v_px`, its foot point. `--map ours=theirs` and `--columns` rename columns.

A line is a record: a quote that is not closed on its line spoils that line, never the lines after it.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.adapter import IngestOptions, RawBatch, Rejected, Source, bytes_read, empty
from vsd_analytics.ingest.columns import KNOWN, ColumnPlan, Header, plan_columns, unique_names
from vsd_analytics.ingest.parquet import ParquetTable
from vsd_analytics.ingest.raw import BadRowError, rejected, whole_line
from vsd_analytics.ingest.table_rows import raw_batch
from vsd_analytics.ingest.text_lines import line_blocks
from vsd_analytics.schema import TableName

BLOCK_BYTES = 1 << 20  # a block may be all line ends, or lines of one character, each of them a record
_PARQUET = b"PAR1"
_SUFFIXES = frozenset({".csv", ".tsv", ".parquet"})
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")


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
        first = next((line for line in _text(head).split("\n") if line.strip()), "")
        if first.lstrip().startswith(("{", "[")):
            return False
        try:
            names = [name.strip().lower() for name in _split_by(_delimiter(first))(first)]
        except BadRowError:
            names = []
        return bool(set(source.suffixes) & _SUFFIXES) or any(name in KNOWN for name in names)

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the rows of one file; see `Adapter.read`."""
        if source.head(4) == _PARQUET:
            yield from self._read_parquet(source, options)
        else:
            yield from self._read_text(source, options)

    def _read_parquet(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        table = ParquetTable(source)
        plan = plan_columns(source, options, Header(unique_names(table.names)), kind=self._kind)
        with table.readable():
            for chunk in table.chunks(plan.theirs):
                batch = raw_batch(plan, chunk.columns, chunk.lines, options)
                done_bytes = source.size_bytes * chunk.done // max(1, table.n_rows)
                yield replace(batch, rejected=[*chunk.rejected, *batch.rejected], done_bytes=done_bytes)

    def _read_text(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        layout = _layout(source, options, self._kind)
        if self._is_only_where:
            layout = replace(layout, plan=layout.plan.only_where())
        with source.open() as stream:
            for first, lines in line_blocks(stream, max_bytes=options.line_max_bytes, block_bytes=BLOCK_BYTES):
                numbers, rows, bad = layout.records(first, lines, options.line_max_bytes)
                columns = {o: pa.array([row[i] for row in rows], pa.string()) for o, i in layout.plan.theirs.items()}
                at = np.array(numbers, dtype=np.int64)
                batch = raw_batch(layout.plan, columns, at, options, decimal_comma=layout.delimiter == ";")
                bad += [replace(r, whole=whole_line(lines[r.line - first])) for r in batch.rejected]
                yield replace(batch, rejected=bad, done_bytes=bytes_read(stream), first_line=layout.first_line)


@dataclass(frozen=True, slots=True)
class _Layout:
    """How the lines of a text table are split.

    Attributes:
        plan: Which columns are read.
        delimiter: Character between cells; a blank means any number of blanks and tabs.
        n_cells: Cells of a record.
        n_header: Lines before the first record.
        first_line: The header, or without one the first record.
    """

    plan: ColumnPlan
    delimiter: str
    n_cells: int
    n_header: int
    first_line: str

    def records(
        self, first: int, lines: list[bytes | None], max_bytes: int
    ) -> tuple[list[int], list[list[str]], list[Rejected]]:
        """Return line numbers and cells of the records in some lines, and the lines that are no records."""
        split = _split_by(self.delimiter)
        numbers: list[int] = []
        rows: list[list[str]] = []
        bad: list[Rejected] = []
        for number, line in enumerate(lines, first):
            if number <= self.n_header or line == b"":
                continue
            try:
                if line is None:
                    raise BadRowError("line-too-long", f"the line is longer than {max_bytes:,} bytes")
                text = _text(line)
                cells = split(text)
                if len(cells) != self.n_cells:
                    if not text.strip():
                        continue
                    if len(cells) != self.n_cells + 1 or cells[-1].strip():
                        detail = f"the row has {len(cells)} fields, {self.n_cells} expected"
                        raise BadRowError("wrong-number-of-fields", detail)
                numbers.append(number)
                rows.append(cells)
            except BadRowError as error:
                reason, detail = error.args
                bad.append(rejected(number, reason=reason, detail=detail, record=line or b""))
        return numbers, rows, bad


def _layout(source: Source, options: IngestOptions, kind: TableName | None) -> _Layout:
    head = source.head()
    if head.startswith(_UTF_16):
        raise InputError(
            f"{source.path.name} is text in UTF-16",
            code="E204",
            where=Where(source.name),
            why="tables are read as UTF-8",
            fix=f"iconv -f UTF-16 -t UTF-8 {source.path.name} > utf8.csv   (or save it as CSV UTF-8)",
        )
    lines = _text(head.removeprefix(b"\xef\xbb\xbf")).split("\n")
    # with --columns there is no header line, so lines that start with # before the first record are comments
    skipped = "#" if options.columns is not None else ()
    at = next((i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(skipped)), None)
    if at is None:
        raise empty(source)
    first = lines[at].rstrip("\r")
    delimiter = _delimiter(first, n_cells=len(options.columns or ()))
    try:
        cells = [c.strip() for c in _split_by(delimiter)(first)]
    except BadRowError as error:
        why = f"its first line cannot be split into cells: {error.args[1]}"
        raise InputError(
            f"{source.path.name} cannot be read as a table",
            code="E204",
            where=Where(source.name, at + 1, first),
            why=why,
            fix="check that it is a text table, or name its format with --format",
        ) from None
    if options.columns is None:
        cells[0] = cells[0].lstrip("# ")
        cells = cells[1:] if delimiter == " " and not cells[0] else cells
        header = Header(unique_names(cells), at + 1, first)
    else:
        if len(options.columns) > len(cells):
            raise InputError(
                f"--columns names {len(options.columns)} columns, {source.path.name} has {len(cells)}",
                code="E203",
                where=Where(source.name, at + 1, first),
                fix="one name for each column, in the order of the file; _ for one to ignore",
            )
        header = Header(unique_names([*options.columns, *[""] * (len(cells) - len(options.columns))]), None, first)
    plan = plan_columns(source, options, header, kind=kind)
    return _Layout(plan, delimiter, len(header.names), at + (options.columns is None), first)


def _delimiter(line: str, *, n_cells: int = 0) -> str:
    """Return the delimiter of a line: the most frequent of tab, semicolon and comma, else a blank."""
    counts = {d: line.count(d) for d in ("\t", ";", ",")}
    enough = [d for d, n in counts.items() if n and n + 1 >= n_cells > 0]
    best = enough[0] if enough else max(counts, key=lambda d: counts[d])
    return best if counts[best] else " "


def _split_by(delimiter: str) -> Callable[[str], list[str]]:
    if delimiter == " ":
        return lambda line: line.split() if '"' not in line else _quoted(" ".join(line.split()), " ")
    return lambda line: line.split(delimiter) if '"' not in line else _quoted(line, delimiter)


def _quoted(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True, strict=True))
    except (csv.Error, StopIteration) as error:
        raise BadRowError("bad-quotes", f"quotes do not match on this line: {error}") from None


def positions() -> Tables:
    """Return the adapter of `--format positions`."""
    return Tables("observations")


def pairs() -> Tables:
    """Return the adapter of `--format pairs`."""
    return Tables("pairs")


def _text(line: bytes) -> str:
    return line.decode("utf-8", "backslashreplace")
