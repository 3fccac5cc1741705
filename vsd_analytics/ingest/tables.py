"""Tables of positions or pairs: CSV (plain, gz, bz2, zst; comma, semicolon, tab or blanks) and Parquet.

Our column names are `ts camera_id track_id x_m y_m u_px v_px` for positions and `ts camera_id track_a track_b x_a_m
y_a_m x_b_m y_b_m distance_m distance_sd_m` for pairs; `frame` may stand for `ts`, and a box (`left top right bottom` or
`left top width height`, pixels) for `u_px v_px`, its foot point. `--map ours=theirs` and `--columns` rename.

A line is a record: a quote that is not closed on its line spoils that line, never the ones after it.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.adapter import BATCH_ROWS, IngestOptions, RawBatch, Rejected, Source, bytes_read, empty
from vsd_analytics.ingest.columns import KNOWN, Header, Plan, plan_columns, unique_names
from vsd_analytics.ingest.lines import line_blocks
from vsd_analytics.ingest.raw import BadRowError, rejected, whole_line
from vsd_analytics.ingest.table_rows import raw_batch
from vsd_analytics.schema import TableName

_PARQUET = b"PAR1"
_SUFFIXES = frozenset({".csv", ".tsv", ".parquet"})
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")


class Tables:
    """Adapter of tables; `--format positions` and `--format pairs` state what is in them."""

    name = "table"
    coordinates = "floor metres (x_m y_m) or image pixels (u_px v_px, or boxes)"

    def __init__(self, kind: TableName | None = None) -> None:
        self._kind = kind
        if kind is not None:
            self.name = "positions" if kind == "observations" else "pairs"

    def detects(self, source: Source) -> bool:
        """Tell by suffix, or by a first line with a column name we know."""
        if source.path.is_dir():
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
        try:
            file = pq.ParquetFile(source.path)
            there = file.schema_arrow.names
            for i in range(file.metadata.num_columns):
                _ = file.metadata.schema.column(i).path  # a UnicodeDecodeError where a name is no UTF-8
        except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
            raise InputError(
                f"{source.path.name} is not a whole Parquet file",
                code="E205",
                where=Where(source.name),
                why=f"its footer cannot be read, as when a copy was cut short: {str(error)[:200]}",
                mend="copy or export the file again",
            ) from None
        with file:
            plan = plan_columns(source, options, Header(unique_names(there)), kind=self._kind)
            names = sorted({there[i] for i in plan.theirs.values()})
            done = 0
            try:
                for chunk in file.iter_batches(columns=names, batch_size=BATCH_ROWS // 2):
                    columns = {o: _column(chunk, there[i]) for o, i in plan.theirs.items()}
                    lines = np.arange(done + 1, done + chunk.num_rows + 1)
                    batch = raw_batch(plan, columns, lines, options)
                    done += chunk.num_rows
                    yield replace(batch, done_bytes=source.size_bytes * done // max(1, file.metadata.num_rows))
            except (pa.ArrowNotImplementedError, pa.ArrowTypeError, pa.ArrowKeyError) as error:
                raise InputError(
                    f"{source.path.name} has a column of a type that cannot be read",
                    code="E203",
                    where=Where(source.name),
                    why=str(error)[:200],
                    mend="write numbers, texts and timestamps into plain columns; --map names the right ones",
                ) from None
            except (pa.ArrowException, OSError) as error:
                raise InputError(
                    f"{source.path.name} is damaged after record {done:,}",
                    code="E205",
                    where=Where(source.name, done + 1),
                    why=str(error)[:200],
                    mend="copy or export the file again; the records before the damage are kept",
                ) from None

    def _read_text(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        layout = _layout(source, options, self._kind)
        with source.open() as stream:
            for first, lines in line_blocks(stream, max_bytes=options.line_max_bytes):
                numbers, rows, bad = layout.records(first, lines, options.line_max_bytes)
                columns = {o: pa.array([row[i] for row in rows], pa.string()) for o, i in layout.plan.theirs.items()}
                at = np.array(numbers, dtype=np.int64)
                batch = raw_batch(layout.plan, columns, at, options, decimal_comma=layout.delimiter == ";")
                bad += [replace(r, whole=whole_line(lines[r.line - first])) for r in batch.rejected]
                yield replace(batch, rejected=bad, done_bytes=bytes_read(stream), first_line=layout.first_line)


@dataclass(frozen=True, slots=True)
class _Layout:
    """How the lines of a text table are cut.

    Attributes:
        plan: Which columns are read.
        delimiter: Character between cells; a blank stands for any number of blanks and tabs.
        n_cells: Cells a record has.
        n_header: Lines before the first record.
        first_line: The line this was found from: the header, or without one the first record.
    """

    plan: Plan
    delimiter: str
    n_cells: int
    n_header: int
    first_line: str

    def records(
        self, first: int, lines: list[bytes | None], max_bytes: int
    ) -> tuple[list[int], list[list[str]], list[Rejected]]:
        """Return line numbers and cells of the records among some lines, and the lines that are none."""
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
            mend=f"iconv -f UTF-16 -t UTF-8 {source.path.name} > utf8.csv   (or save it as CSV UTF-8)",
        )
    lines = _text(head.removeprefix(b"\xef\xbb\xbf")).split("\n")
    # where --columns name the columns, lines before the first record that start with # are a note of its writer
    skipped = "#" if options.columns is not None else ()
    at = next((i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(skipped)), None)
    if at is None:
        raise empty(source)
    first = lines[at].rstrip("\r")
    delimiter = _delimiter(first, n_cells=len(options.columns or ()))
    try:
        cells = [c.strip() for c in _split_by(delimiter)(first)]
    except BadRowError as error:
        why = f"its first line cannot be cut into cells: {error.args[1]}"
        raise InputError(
            f"{source.path.name} cannot be read as a table",
            code="E204",
            where=Where(source.name, at + 1, first),
            why=why,
            mend="check that it is a text table, or name its format with --format",
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
                mend="one name for each column, in the order of the file; _ for one to ignore",
            )
        header = Header(unique_names([*options.columns, *[""] * (len(cells) - len(options.columns))]), None, first)
    plan = plan_columns(source, options, header, kind=kind)
    return _Layout(plan, delimiter, len(header.names), at + (options.columns is None), first)


def _delimiter(line: str, *, n_cells: int = 0) -> str:
    """Return what stands between the cells of a line: the commonest of tab, semicolon and comma, else blanks."""
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


def _text(line: bytes) -> str:
    return line.decode("utf-8", "backslashreplace")


def _column(chunk: pa.RecordBatch, name: str) -> pa.Array:
    column = chunk.column(chunk.schema.get_all_field_indices(name)[0])
    column = column.dictionary_decode() if pa.types.is_dictionary(column.type) else column
    if not any(check(column.type) for check in (pa.types.is_string, pa.types.is_large_string, pa.types.is_string_view)):
        return column
    try:
        column.validate(full=True)
    except pa.ArrowInvalid:  # Parquet promises UTF-8 and does not look; what it is not is shown as escapes
        return column.cast(pa.large_binary())
    return column
