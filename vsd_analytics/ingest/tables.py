"""Tables of positions or pairs: CSV (plain, gz, bz2, zst; comma, semicolon, tab or blanks) and Parquet.

Our column names are `ts camera_id track_id x_m y_m u_px v_px` for positions and `ts camera_id track_a track_b x_a_m
y_a_m x_b_m y_b_m distance_m distance_sd_m` for pairs; `frame` may stand for `ts`, and a box (`left top right bottom` or
`left top width height`, pixels) for `u_px v_px`, its foot point. `--map ours=theirs` and `--columns` rename.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.adapter import EXCERPT_CHARS, IngestOptions, RawBatch, Rejected, Source, bytes_read
from vsd_analytics.ingest.instants import parse_instants
from vsd_analytics.schema import RAW_SCHEMAS, TableName

NUMBERS = ("x_m", "y_m", "u_px", "v_px", "x_a_m", "y_a_m", "x_b_m", "y_b_m", "distance_m", "distance_sd_m")
BOX = ("left", "top", "right", "bottom", "width", "height")
TEXTS = ("camera_id", "track_id", "track_a", "track_b")
KNOWN = ("ts", "frame", *TEXTS, *NUMBERS, *BOX)

_PLACES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("floor", ("x_m", "y_m")),
    ("image", ("u_px", "v_px")),
    ("image", ("left", "top", "right", "bottom")),
    ("image", ("left", "top", "width", "height")),
)


@dataclass(frozen=True, slots=True)
class Plan:
    """How the columns of one table are read.

    Attributes:
        kind: "observations" or "pairs".
        theirs: Name of the file's column for each of our names that it has.
        n_header: Lines before the first record.
    """

    kind: TableName
    theirs: Mapping[str, str]
    n_header: int


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
        head = source.head(8192)
        if head[:4] == b"PAR1":
            return True
        first = next((line for line in head.splitlines() if line.strip()), b"").decode("utf-8", "replace")
        if first.lstrip().startswith(("{", "[")):
            return False
        return bool(set(source.suffixes) & {".csv", ".tsv", ".parquet"}) or any(
            name.strip().lower() in KNOWN for name in first.replace(";", ",").replace("\t", ",").split(",")
        )

    def read(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        """Stream the rows of one file; see `Adapter.read`."""
        if source.head(4) == b"PAR1":
            yield from self._read_parquet(source, options)
        else:
            yield from self._read_text(source, options)

    def _read_parquet(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        try:
            file = pq.ParquetFile(source.path)
            names = file.schema_arrow.names
        except (pa.ArrowException, OSError) as error:
            raise InputError(
                f"{source.path.name} is not a whole Parquet file",
                code="E205",
                where=Where(source.name),
                why=f"its footer cannot be read, as when a copy was cut short: {str(error)[:200]}",
                mend="copy or export the file again",
            ) from None
        plan = plan_columns(source, options, names, kind=self._kind, first_line=None, n_header=0)
        done = 0
        try:
            for chunk in file.iter_batches(columns=list(dict.fromkeys(plan.theirs.values())), batch_size=200_000):
                yield _batch(plan, chunk, options, first_line=done + 1, done_bytes=0)
                done += chunk.num_rows
        except (pa.ArrowException, OSError) as error:
            raise InputError(
                f"{source.path.name} is damaged after record {done:,}",
                code="E205",
                where=Where(source.name, done + 1),
                why=str(error)[:200],
                mend="copy or export the file again; the records before the damage are kept",
            ) from None

    def _read_text(self, source: Source, options: IngestOptions) -> Iterator[RawBatch]:
        first_line, n_before = _first_line(source)
        if first_line is None:
            raise InputError(f"{source.path.name} is empty", code="E202", where=Where(source.name), mend="export it again")
        delimiter = _delimiter(first_line)
        cells = [c.strip().strip('"').lstrip("\ufeff") for c in (first_line.split() if delimiter == " " else first_line.split(delimiter))]
        if options.columns is not None:
            names = [*options.columns, *(f"_{i}" for i in range(len(options.columns), len(cells)))]
            n_header = n_before
        else:
            names, n_header = cells, n_before + 1
        names = _unique(names)
        plan = plan_columns(source, options, names, kind=self._kind, first_line=first_line, n_header=n_header)
        bad: list[Rejected] = []

        def keep(row: pacsv.InvalidRow) -> str:
            detail = f"the row has {row.actual_columns} fields, {row.expected_columns} expected"
            line = (row.number or 0) + (0 if options.columns is None else n_header)
            bad.append(Rejected(line, "wrong-number-of-fields", detail, (row.text or "")[:EXCERPT_CHARS]))
            return "skip"

        with source.open() as stream:
            quiet = _UntilDamage(stream, blanks=delimiter == " ")
            quiet.skip_lines(n_header)
            reader = _open_csv(source, quiet, names, plan, delimiter, keep)
            line = n_header + 1
            while reader is not None:
                try:
                    chunk = reader.read_next_batch()
                except StopIteration:
                    break
                except pa.ArrowException as error:
                    raise _unreadable(source, error, line) from None
                batch = _batch(plan, chunk, options, first_line=line, done_bytes=bytes_read(stream))
                line += chunk.num_rows + len(bad)
                yield RawBatch(batch.tables, [*bad, *batch.rejected], batch.n_dropped, batch.notes, batch.done_bytes)
                bad.clear()
            if bad:
                yield RawBatch({}, list(bad))
            if quiet.damage is not None:
                raise quiet.damage


def plan_columns(
    source: Source,
    options: IngestOptions,
    names: list[str],
    *,
    kind: TableName | None,
    first_line: str | None,
    n_header: int,
) -> Plan:
    """Find our columns among a file's.

    Args:
        source: For messages.
        options: `map` renames.
        names: The file's column names.
        kind: What the user said is in the file, or None to tell from the columns.
        first_line: First line of a text file, for messages.
        n_header: Lines before the first record.

    Returns:
        The plan.

    Raises:
        InputError: E203 naming the column that is missing and the nearest one found.
    """
    lower = {n.strip().lower(): n for n in reversed(names)}
    theirs: dict[str, str] = {}
    for ours in KNOWN:
        wanted = options.map.get(ours, ours)
        if wanted in names:
            theirs[ours] = wanted
        elif wanted.strip().lower() in lower:
            theirs[ours] = lower[wanted.strip().lower()]
        elif ours in options.map:
            raise _missing(source, wanted, names, first_line, f"--map says our {ours} is their {wanted!r}")
    if kind is None:
        kind = "pairs" if "track_a" in theirs or "distance_m" in theirs else "observations"
    if "ts" not in theirs and "frame" not in theirs:
        raise _missing(source, "ts", names, first_line, "without a time nothing can be counted by hour")
    if kind == "pairs":
        if "distance_m" not in theirs and not {"x_a_m", "y_a_m", "x_b_m", "y_b_m"} <= set(theirs):
            raise _missing(source, "distance_m", names, first_line, "a pair needs a distance or both positions")
        for column in ("track_a", "track_b"):
            if column not in theirs:
                raise _missing(source, column, names, first_line, "without it a pair cannot be told from another")
    else:
        best = max(_PLACES, key=lambda place: len(set(place[1]) & set(theirs)))
        lacking = [c for c in best[1] if c not in theirs]
        if lacking:
            raise _missing(source, lacking[0], names, first_line, "without a position no distance can be measured")
        best = next(p for p in _PLACES if set(p[1]) <= set(theirs))
        unwanted = {c for _, columns in _PLACES for c in columns} - set(best[1])
        theirs = {o: t for o, t in theirs.items() if o not in unwanted or o in ("u_px", "v_px", "x_m", "y_m")}
    if "ts" not in theirs and (options.fps is None or options.start is None):
        raise InputError(
            f"{source.path.name} has frame numbers but no times",
            code="E207",
            where=Where(source.name),
            why="a frame number becomes a time only with the frame rate and the time of the first frame",
            mend="add --fps 25 --start 2026-11-09T08:00:00+01:00",
        )
    return Plan(kind, theirs, n_header)


def _missing(source: Source, column: str, names: list[str], first_line: str | None, why: str) -> InputError:
    import difflib

    shown = [n for n in names if not n.startswith("_")]
    lower = {n.lower(): n for n in shown}
    close = difflib.get_close_matches(column.lower(), lower, n=1, cutoff=0.3)
    near = lower[close[0]] if close else None
    stem = [n for n in shown if n.lower() in column.lower() or column.lower().split("_")[0] in n.lower()]
    near = near or (stem[0] if stem else None)
    numeric = bool(shown) and all(_is_number(n) for n in shown)
    mend = f"--map {column}={near}" if near and not numeric else f"--map {column}=THEIR_NAME"
    if numeric:
        why = f"{why}; the first line holds numbers, so the file seems to have no header"
        mend = "--columns ts,track_id,x_m,y_m (our names in the order of the file's columns; _ for one to ignore)"
    at = first_line.find(near) + 1 if first_line and near and not numeric else None
    return InputError(
        f"{source.path.name} has no column {column!r}",
        code="E203",
        where=Where(source.name, 1, first_line, at or None, "did you mean this column?" if at else None),
        why=f"{why}; found: {', '.join(shown[:20])}",
        mend=f"{mend}      (or in vsd.toml, under [ingest.map])" if not numeric else mend,
    )


def _batch(plan: Plan, chunk: pa.RecordBatch, options: IngestOptions, *, first_line: int, done_bytes: int) -> RawBatch:
    rows = pd.DataFrame({ours: _column(chunk, theirs) for ours, theirs in plan.theirs.items()})
    lines = np.arange(first_line, first_line + len(rows))
    rejected: list[Rejected] = []
    values: dict[str, Any] = {}
    bad = np.zeros(len(rows), dtype=bool)
    for column in (c for c in rows.columns if c in NUMBERS or c in BOX or c == "frame"):
        values[column], wrong = _numbers(rows[column])
        for i in np.flatnonzero(wrong & ~bad):
            detail = f"{plan.theirs[column]} is not a number: {str(rows[column].iloc[i])[:80]!r}"
            rejected.append(Rejected(int(lines[i]), "not-a-number", detail, _excerpt(rows, i)))
        bad |= wrong
    if "ts" in rows:
        times, wrong, notes = parse_instants(rows["ts"], zone=options.frame_zone)
        for i in np.flatnonzero(wrong & ~bad):
            detail = f"{plan.theirs['ts']} is not a time: {str(rows['ts'].iloc[i])[:80]!r}"
            rejected.append(Rejected(int(lines[i]), "not-a-time", detail, _excerpt(rows, i)))
        bad |= wrong
    else:
        seconds = (values["frame"] - (options.first_frame or 0.0)) / (options.fps or 1.0)
        times, notes = np.rint((options.start or 0) + np.nan_to_num(seconds) * 1000), ()
        bad |= np.isnan(seconds)
    if options.period_s:
        period_ms = options.period_s * 1000
        times = np.floor(times / period_ms) * period_ms
    _foot_points(values)
    keep = ~bad
    ts_ms = np.where(np.abs(times) < 2**53, times, -(2.0**53)).astype("int64")
    columns: dict[str, Any] = {
        "camera": _texts(rows.get("camera_id"), options.camera, len(rows)),
        "ts_ms": ts_ms,
        "quality": np.full(len(rows), _quality(plan, values), dtype=object),
        "line": lines,
        **{c: v for c, v in values.items() if c in NUMBERS},
    }
    if plan.kind == "pairs":
        columns |= {"person_a": np.zeros(len(rows), "int32"), "person_b": np.ones(len(rows), "int32")}
        columns |= {t: _texts(rows[t], None, len(rows)) for t in ("track_a", "track_b")}
    else:
        columns |= {"person": _person_index(ts_ms, columns["camera"])}
        columns |= {"track": _texts(rows.get("track_id"), None, len(rows))}
    schema = RAW_SCHEMAS[plan.kind]
    arrays = [
        pa.array(columns[f.name][keep], type=f.type, from_pandas=f.name not in NUMBERS)
        if f.name in columns
        else pa.nulls(int(keep.sum()), f.type)
        for f in schema
    ]
    arrays = [_blank_to_null(a, rows, f.name, keep) for a, f in zip(arrays, schema, strict=True)]
    return RawBatch({plan.kind: pa.table(arrays, schema=schema)}, rejected, {}, notes, done_bytes)


def _column(chunk: pa.RecordBatch, name: str) -> pd.Series[Any]:
    column = chunk.column(chunk.schema.get_field_index(name))
    if pa.types.is_dictionary(column.type):
        column = column.dictionary_decode()
    return column.to_pandas(types_mapper={pa.int64(): pd.Int64Dtype(), pa.int32(): pd.Int32Dtype()}.get)


def _numbers(values: pd.Series[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Return floats (NaN where blank or wrong) and which rows hold something that is no finite number."""
    numbers = pd.to_numeric(values, errors="coerce").to_numpy(dtype="float64", na_value=np.nan)
    blank = _blank(values)
    return numbers, ~blank & ~np.isfinite(numbers)


def _blank(values: pd.Series[Any]) -> np.ndarray:
    missing = values.isna().to_numpy()
    if pd.api.types.is_string_dtype(values.dtype) or values.dtype == object:
        return missing | (values.fillna("").astype(str).str.strip() == "").to_numpy()
    if pd.api.types.is_float_dtype(values.dtype):
        return np.zeros(len(values), dtype=bool)
    return missing


def _blank_to_null(array: pa.Array, rows: pd.DataFrame, name: str, keep: np.ndarray) -> pa.Array:
    if name not in NUMBERS or array.null_count == len(array):
        return array
    return pa.array(array.to_numpy(zero_copy_only=False), type=array.type, from_pandas=True)


def _foot_points(values: dict[str, Any]) -> None:
    """Replace boxes by their foot points: u = middle of left and right, v = bottom."""
    if "left" not in values:
        return
    left, top = values.pop("left"), values.pop("top")
    if "right" in values:
        right, bottom = values.pop("right"), values.pop("bottom")
    else:
        right, bottom = left + values.pop("width"), top + values.pop("height")
    values["u_px"], values["v_px"] = (left + right) / 2, np.maximum(top, bottom)


def _quality(plan: Plan, values: Mapping[str, Any]) -> str:
    return "metric" if plan.kind == "pairs" or "x_m" in values else "relative"


def _person_index(ts_ms: np.ndarray, camera: np.ndarray) -> np.ndarray:
    return pd.DataFrame({"t": ts_ms, "c": camera}).groupby(["t", "c"], dropna=False).cumcount().to_numpy("int32")


def _texts(values: pd.Series[Any] | None, default: str | None, n: int) -> np.ndarray:
    if values is None:
        return np.full(n, default, dtype=object)
    if pd.api.types.is_float_dtype(values.dtype):
        values = values.map(lambda v: None if pd.isna(v) else f"{v:.15g}")
    texts = values.astype("object").map(lambda v: None if pd.isna(v) else str(v).strip().strip('"'))
    texts = texts.map(lambda v: _plain_id(v) if v else default)
    return texts.to_numpy(dtype=object)


def _plain_id(text: str) -> str:
    """Return an id without a float's tail, so that 7, 7.0 and 7.0000000e+00 are one person."""
    try:
        number = float(text)
    except ValueError:
        return text
    return str(int(number)) if number.is_integer() and abs(number) < 2**63 and not text.isdigit() else text


def _excerpt(rows: pd.DataFrame, i: int) -> str:
    return ", ".join(f"{c}={v}" for c, v in rows.iloc[i].items())[:EXCERPT_CHARS]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _unique(names: list[str]) -> list[str]:
    seen: dict[str, int] = {}
    unique = []
    for i, name in enumerate(names):
        taken = not name or name == "_" or name in seen
        seen[name] = i
        unique.append(f"_{i}" if taken else name)
    return unique


def _first_line(source: Source) -> tuple[str | None, int]:
    for n, line in enumerate(source.head().split(b"\n")):
        if line.strip():
            return line.decode("utf-8", "replace").rstrip("\r"), n
    return None, 0


def _delimiter(line: str) -> str:
    counts = {d: line.count(d) for d in (",", ";", "\t")}
    best = max(counts, key=lambda d: counts[d])
    return best if counts[best] else " "


def _open_csv(
    source: Source, stream: _UntilDamage, names: list[str], plan: Plan, delimiter: str, keep: Any
) -> pacsv.CSVStreamingReader | None:
    wanted = list(dict.fromkeys(plan.theirs.values()))
    try:
        return pacsv.open_csv(
            pa.PythonFile(stream, mode="r"),
            read_options=pacsv.ReadOptions(use_threads=False, column_names=names, block_size=4 << 20),
            parse_options=pacsv.ParseOptions(delimiter="," if delimiter == " " else delimiter, invalid_row_handler=keep),
            convert_options=pacsv.ConvertOptions(
                column_types=dict.fromkeys(wanted, pa.string()), include_columns=wanted, strings_can_be_null=False,
                check_utf8=False,
            ),
        )  # fmt: skip
    except pa.ArrowException as error:
        if "Empty CSV" in str(error):
            return None
        raise _unreadable(source, error, plan.n_header + 1) from None


def _unreadable(source: Source, error: Exception, line: int) -> InputError:
    return InputError(
        f"{source.path.name} cannot be read as a table",
        code="E204",
        where=Where(source.name, line),
        why=str(error)[:300],
        mend="check that it is a text table in UTF-8, or name its format with --format",
    )


class _UntilDamage:
    """A byte stream for the CSV reader that ends quietly at damage and remembers it; blanks become commas if asked."""

    closed = False

    def __init__(self, stream: Any, *, blanks: bool) -> None:
        self._stream = stream
        self._blanks = blanks
        self._rest = b""
        self.damage: InputError | None = None

    def skip_lines(self, n: int) -> None:
        for _ in range(n):
            self._stream.readline()

    def read(self, n: int = -1) -> bytes:
        try:
            data: bytes = self._stream.read1(n)
        except InputError as error:
            self.damage, data = error, b""
        if not self._blanks:
            return data
        while data and b"\n" not in data:
            more = self._stream.read1(n)
            data += more
            if not more:
                break
        lines, newline, rest = (self._rest + data).rpartition(b"\n")
        if not data:
            lines, rest = self._rest, b""
        self._rest = rest
        return b"\n".join(b",".join(line.split()) for line in lines.split(b"\n")) + newline

    def close(self) -> None:
        self.closed = True
