"""Rows of smart-social-distancing object logs: their cells, and the times of rows that share a second."""

from __future__ import annotations

import ast
import csv
import difflib
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import IO, Any
from zoneinfo import ZoneInfo

import numpy as np

from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.formats.body_distance import LoggedFrame
from vsd_analytics.ingest.reading.adapter import IngestOptions, Rejected
from vsd_analytics.ingest.reading.raw import BadRowError, bounded_lines, rejected, too_many_people
from vsd_analytics.ingest.reading.reasons import TOO_MANY

NEEDED = ("Timestamp", "DetectedObjects", "ViolatingObjects", "Detections")
MAX_COUNT = 10**12
PERSON_MAX_BYTES = 1000
"""One person takes fewer bytes than this of the cell that lists them: a longer cell lists too many persons."""
MAX_ROWS_A_SECOND = 1000

_UNTRACKED = re.compile(r"\d+-\d+")
_NUMPY = re.compile(r"\b(?:np|numpy)\.(?:float|int|uint)\d+\(([^()]*)\)")
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_STEP_BACK = timedelta(minutes=30)


@dataclass(frozen=True, slots=True)
class ObjectLogRow:
    """One row of an object log.

    Attributes:
        line: 1-based line.
        second: Time without a zone, whole seconds.
        frame: Boxes, and what the engine counted.
        tracks: Track id of each person; None for people it did not track.
    """

    line: int
    second: datetime
    frame: LoggedFrame
    tracks: tuple[str | None, ...]


def parsed(
    stream: IO[bytes], *, source_name: str, prefix: str, options: IngestOptions
) -> Iterator[ObjectLogRow | Rejected]:
    """Yield the rows of one log.

    Args:
        stream: Its bytes.
        source_name: What the user named, for messages.
        prefix: Put before the details of rejected rows, to tell several logs apart.
        options: The longest line and the most people in a row.

    Raises:
        InputError: E203 when the header lacks a needed column; E205 from the stream.
    """
    max_bytes = options.line_max_bytes
    csv.field_size_limit(max(csv.field_size_limit(), max_bytes))
    columns: dict[str, int] | None = None
    for number, line in bounded_lines(stream, max_bytes=max_bytes):
        try:
            if line is None:
                raise BadRowError("line-too-long", f"the line is longer than {max_bytes:,} bytes")
            if not line.strip():
                continue
            cells = _cells(line)
            if columns is None:
                columns = _columns(cells, source_name)
            else:
                yield _row(cells, columns, number, options)
        except BadRowError as bad:
            reason, detail = bad.args
            yield rejected(number, reason=reason, detail=prefix + detail, record=line or b"")


def timed(rows: Iterator[ObjectLogRow | Rejected], zone: ZoneInfo) -> Iterator[tuple[ObjectLogRow, int] | Rejected]:
    """Yield each row with its time in UTC milliseconds; rejected rows are passed on.

    The log has whole seconds, so the rows of one second are spread evenly over it. When clocks are set back, an hour
    comes twice: rows after a step back of half an hour or more are in the second one.
    """
    group: list[ObjectLogRow] = []
    fold = 0

    def finished() -> Iterator[tuple[ObjectLogRow, int]]:
        for k, row in enumerate(group):
            second = (row.second.replace(tzinfo=zone, fold=fold) - _EPOCH) // timedelta(milliseconds=1)
            yield row, second + k * 1000 // len(group)

    try:
        for row in rows:
            if isinstance(row, Rejected):
                yield row
            elif group and row.second == group[0].second:
                if len(group) < MAX_ROWS_A_SECOND:
                    group.append(row)
                else:
                    detail = f"more than {MAX_ROWS_A_SECOND:,} rows share the second {row.second}"
                    yield rejected(row.line, reason="too-many-in-a-second", detail=detail)
            else:
                yield from finished()
                fold = 1 if group and group[0].second - row.second >= _STEP_BACK else fold
                fold = fold if _is_twice(row.second, zone) else 0
                group = [row]
    except InputError:
        yield from finished()  # what came before the damage
        raise
    yield from finished()


def _is_twice(local: datetime, zone: ZoneInfo) -> bool:
    first, second = (local.replace(tzinfo=zone, fold=fold).utcoffset() for fold in (0, 1))
    return first is not None and second is not None and first > second


def _columns(cells: list[str], source_name: str) -> dict[str, int]:
    columns = {name.strip(): i for i, name in enumerate(cells)}
    for name in NEEDED:
        if name not in columns:
            near = difflib.get_close_matches(name, [c for c in list(columns)[:1000] if len(c) <= 100], 1)
            raise InputError(
                f"the object log has no column {name}",
                code="E203",
                where=Where(source_name, 1, ",".join(cells)[:500]),
                why=f"nearest found: {near[0]}" if near else "no column has a name like it",
                fix="name a file of the engine's folder objects_log, with its header line",
            )
    return columns


def _cells(line: bytes) -> list[str]:
    """Return the cells of one record; the engine writes a record on one line, so bad quotes spoil one row only."""
    try:
        return next(csv.reader([line.decode("utf-8")], strict=True))
    except (UnicodeDecodeError, csv.Error, StopIteration) as error:
        raise BadRowError("bad-csv", f"not a CSV record: {error}") from None


def _row(cells: list[str], columns: dict[str, int], number: int, options: IngestOptions) -> ObjectLogRow:
    if len(cells) != len(columns):
        raise BadRowError("wrong-number-of-cells", f"the header has {len(columns)} columns, the row {len(cells)}")
    try:
        second = datetime.strptime(cells[columns["Timestamp"]].strip(), "%Y-%m-%d %H:%M:%S")
        if not datetime.min + timedelta(days=2) < second < datetime.max - timedelta(days=2):
            raise ValueError("year out of range")
    except ValueError:
        text = cells[columns["Timestamp"]][:40]
        raise BadRowError("bad-time", f"{text!r} is no time as YYYY-MM-DD HH:MM:SS") from None
    try:
        n_persons, n_violations = (int(cells[columns[c]]) for c in ("DetectedObjects", "ViolatingObjects"))
        if not (0 <= n_persons <= MAX_COUNT and 0 <= n_violations <= MAX_COUNT):
            raise ValueError("out of range")
    except ValueError:
        raise BadRowError("not-a-number", "DetectedObjects and ViolatingObjects must be whole numbers from 0") from None
    listed = cells[columns["Detections"]]
    if len(listed) > options.persons_max * PERSON_MAX_BYTES:
        detail = f"Detections has {len(listed):,} characters; {options.persons_max:,} people (persons_max) take fewer"
        raise BadRowError(TOO_MANY, detail)
    people = _literal(listed, "Detections")
    if len(people) > options.persons_max:
        raise BadRowError(TOO_MANY, too_many_people(len(people), options))
    boxes, tracks = _detections(people)
    if len(tracks) != n_persons:
        raise BadRowError("count-mismatch", f"DetectedObjects is {n_persons}, but Detections lists {len(tracks)}")
    violators = None
    if "ViolationsIndexes" in columns:
        indexes = _literal(cells[columns["ViolationsIndexes"]], "ViolationsIndexes")
        if not all(type(i) is int and 0 <= i < n_persons for i in indexes):
            raise BadRowError("bad-index", "ViolationsIndexes names a person that Detections does not list")
        violators = frozenset(indexes)
    return ObjectLogRow(number, second, LoggedFrame(boxes, n_violations, violators), tracks)


def _literal(cell: str, column: str) -> list[Any]:
    """Return the list a cell holds as a Python literal; scalars written by NumPy 2 lose their wrappers."""
    try:
        with warnings.catch_warnings(action="ignore"):  # "1if" is a number to Python, with a SyntaxWarning
            value = ast.literal_eval(_NUMPY.sub(r"\1", cell.strip()))
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError) as error:
        raise BadRowError("bad-literal", f"{column} is no Python list: {str(error)[:200]}") from None
    if not isinstance(value, list):
        raise BadRowError("bad-literal", f"{column} is no list")
    return value


def _detections(people: list[Any]) -> tuple[Any, tuple[str | None, ...]]:
    """Return boxes, shape (n, 4), and the track ids of people the engine tracked."""
    boxes, tracks = [], []
    for i, person in enumerate(people):
        box, track = (person.get("bbox"), person.get("tracking_id")) if isinstance(person, dict) else (None, None)
        if not (
            isinstance(box, list | tuple)
            and len(box) == 4
            and all(type(v) in (int, float) and -1e3 < v < 1e3 for v in box)
            and box[1] < box[3]
        ):
            raise BadRowError("bad-box", f"person {i} has no bbox of four numbers with its bottom below its top")
        if not (
            track is None
            or (type(track) is int and abs(track) < 1 << 63)
            or (type(track) is str and track.isprintable())
        ):
            raise BadRowError("bad-track", f"the tracking_id of person {i} is neither plain text nor a whole number")
        boxes.append(box)
        tracks.append(None if track is None or _UNTRACKED.fullmatch(str(track)) else str(track))
    return np.array(boxes, dtype=np.float64).reshape(-1, 4), tuple(tracks)
