"""Counts of door counters: people to either side of a line by interval, a file `counts/LINE.parquet` for each line.

A door counter sends sums and no tracks. They are stored as they were sent, each with its interval; what was not sent is
unknown. A file is replaced as a whole, so that it holds all of an added file or nothing of it, and has a digest of its
bytes.
"""

from __future__ import annotations

import io
import shlex
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, date, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import pyarrow as pa
import pyarrow.parquet as pq

from vsd_analytics.config.context_file import ContextColumns, read_context_file
from vsd_analytics.config.interval_rows import (
    AddedIntervals,
    Interval,
    IntervalRow,
    RefusedRow,
    new_rows,
    nothing_usable,
)
from vsd_analytics.errors import InputError, StoreError, UsageError, Where, nearest
from vsd_analytics.schema import TS
from vsd_analytics.site.lines import Line
from vsd_analytics.site.model import Site
from vsd_analytics.store.own_digest import DIGEST, NO_DIGEST, is_undamaged, with_digest

if TYPE_CHECKING:
    from vsd_analytics.config.count_checks import CountWarning

FOLDER: Final = "counts"
HOUR_MS: Final = 3_600_000
Way = Literal["left", "right", "both"]
"""People to the left of a line, to its right, or one number for both."""
WAYS: Final[tuple[Way, ...]] = ("left", "right", "both")
SCHEMA: Final = pa.schema(
    [
        pa.field("from_ts", TS, nullable=False),
        pa.field("to_ts", TS, nullable=False),
        ("n_to_left", pa.int64()),
        ("n_to_right", pa.int64()),
        ("n_both", pa.int64()),
    ]
)
"""One row per interval of a counter: its ends, end exclusive, and people by `WAYS`; null = the counter says nothing."""
Counts = tuple[int | None, int | None, int | None]
"""Numbers of people by `WAYS`."""


def door_counts(site: Site, line_id: str) -> pa.Table:
    """Return the counts of a line in the columns of `SCHEMA`, by time; empty without any.

    Raises:
        StoreError: E302, their file is damaged.
    """
    path = _file(site, line_id)
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return SCHEMA.empty_table()
    counts, why = _counts(data)
    if why is not None:
        raise StoreError(
            "the counts of a door counter are damaged",
            code="E302",
            where=Where(f"{FOLDER}/{path.name}"),
            why=f"{why}; restore the file from a backup, or remove it and add the counter's files again",
            fix=f"vsd counts remove {shlex.quote(line_id)}",
        )
    return counts


def _counts(data: bytes) -> tuple[pa.Table, str | None]:
    """Return the counts in the bytes of a file, and why they cannot be right, if so."""
    if not is_undamaged(data):
        return SCHEMA.empty_table(), "its bytes do not match the digest in it, or it has none"
    counts = pq.read_table(pa.BufferReader(data)).replace_schema_metadata()
    if not counts.schema.equals(SCHEMA):
        return counts, f"its columns are {_columns(counts.schema)}, not {_columns(SCHEMA)}"
    begins, stops = (counts[name].cast(pa.int64()).to_numpy() for name in ("from_ts", "to_ts"))
    if (begins >= stops).any() or (begins[1:] < stops[:-1]).any():
        return counts, "its intervals overlap or are not in order of time"
    return counts, None


def _columns(schema: pa.Schema) -> str:
    return ", ".join(f"{column.name} {column.type}{'' if column.nullable else ' not null'}" for column in schema)


def stored_lines(site: Site) -> list[str]:
    """Return the ids in the names of all files of counts, also of lines that vsd.toml does not have."""
    return sorted(path.stem for path in (site.root / FOLDER).glob("*.parquet") if path.is_file())


def counted_lines(site: Site) -> list[tuple[str, tuple[date, date], int]]:
    """Return line, first and last local day, and number of intervals of all counts that are stored.

    Raises:
        StoreError: E302, a file is damaged.
    """
    rows = []
    for line_id in stored_lines(site):
        counts = door_counts(site, line_id)
        if len(counts):
            ends_ms = counts["from_ts"][0].value, counts["to_ts"][-1].value - 1
            first, last = (datetime.fromtimestamp(ms / 1000, tz=UTC).astimezone(site.zone).date() for ms in ends_ms)
            rows.append((line_id, (first, last), len(counts)))
    return rows


def counted_days(site: Site) -> tuple[date, date] | None:
    """Return the first and last local day with counts of a line that is counted by a counter, None without any."""
    asked = {line.line_id for line in site.lines if line.is_by_counter}
    if not asked:
        return None
    days = [days for line_id, days, _ in counted_lines(site) if line_id in asked]
    return (min(first for first, _ in days), max(last for _, last in days)) if days else None


def _file(site: Site, line_id: str) -> Path:
    return site.root / FOLDER / f"{line_id}.parquet"


def _by_interval(counts: pa.Table) -> dict[Interval, Counts]:
    columns = [counts[name].cast(pa.int64()).to_pylist() for name in SCHEMA.names]
    return {(row[0], row[1]): (row[2], row[3], row[4]) for row in zip(*columns, strict=True)}


def add_counts(
    site: Site,
    path: Path,
    line_id: str,
    columns: Mapping[Way, str],
    *,
    times: ContextColumns,
    is_replacing: bool = False,
    is_believed: bool = False,
) -> AddedIntervals:
    """Add the intervals of a CSV file to the counts of a counting line, durably.

    Args:
        site: The project.
        path: The file.
        line_id: A line of vsd.toml with counted_by = "counter".
        columns: Headers of the columns with people to the left and right of the line, or both together.
        times: How the file says its intervals; its `value` is not read.
        is_replacing: An interval that is stored with other counts gets the new ones; else the line is refused.
        is_believed: Add also what is almost surely wrong.

    Raises:
        UsageError: E101, the line is none that a counter counts, or other columns than before.
        InputError: E201 to E209 the file cannot be used, E202 no line of it can, E211 it is almost surely wrong.
        StoreError: E302, the stored counts are damaged.
        DiskError: E304 to E306, the disk refused; nothing is added.
    """
    from vsd_analytics.store.durable import exclusive, fsync_dir, make_dirs, publish, sweep_temporaries

    line = counted_line(site, line_id)
    if not columns or ("both" in columns and len(columns) > 1):
        raise UsageError(
            "columns of people are missing" if not columns else "--both stands beside --left or --right",
            why="a counter has a number for each direction, or one for both",
            fix="--left in --right out, or --both count",
        )
    rows, refused = _read(site, path, columns, times)
    path_of_line = _file(site, line.line_id)
    with exclusive(site.root / "status" / "counts-add.lock"):  # two files that overlap are not both taken
        before = _by_interval(door_counts(site, line.line_id))
        _refuse_other_ways(before, columns)
        new, n_known, n_replaced = new_rows(rows, before, refused, is_replacing=is_replacing, shown=_shown)
        if not new and not n_known:
            raise nothing_usable(path, refused)
        added = {(row.from_ms, row.to_ms): row.value for row in new}
        warnings = _warnings(site, line.line_id, added, before, is_believed=is_believed)
        if new:
            make_dirs(path_of_line.parent)
            sweep_temporaries(path_of_line.parent, file_name=path_of_line.name)
            publish(path_of_line, _bytes({**before, **added}))
        else:  # who was stopped after the rename left a file whose name may not be on the disk yet
            fsync_dir(path_of_line.parent)
    refused.sort(key=lambda row: row.line)
    return AddedIntervals(len(new), n_known, n_replaced, tuple(refused), warnings)


def _warnings(
    site: Site, line_id: str, new: Mapping[Interval, Counts], stored: Mapping[Interval, Counts], *, is_believed: bool
) -> tuple[CountWarning, ...]:
    """Return what looks wrong about new counts.

    Raises:
        InputError: E211, something is almost surely wrong, and nobody said that it is right.
    """
    from vsd_analytics.config.count_checks import count_warnings

    others: dict[str, dict[Interval, Counts]] = {}
    for other in site.lines:
        if other.is_by_counter and other.line_id != line_id:
            with suppress(StoreError):  # the damage of another line's file is no reason to refuse this one
                others[other.line_id] = _by_interval(door_counts(site, other.line_id))
    left = {interval: ways for interval, ways in stored.items() if interval not in new}
    warnings = count_warnings(line_id, new, left, others, timezone=site.timezone)
    sure = next((warning for warning in warnings if warning.is_sure), None)
    if sure is not None and not is_believed:
        raise InputError(f"{sure.what}; nothing was added", code="E211", why=sure.why, fix=sure.fix)
    return tuple(warnings)


def _bytes(counts: Mapping[Interval, Counts]) -> bytes:
    """Return the bytes of a file of counts: the same for the same counts."""
    rows = sorted((*interval, *ways) for interval, ways in counts.items())
    columns = [
        pa.array(column, pa.int64()).cast(field.type)
        for column, field in zip(zip(*rows, strict=True), SCHEMA, strict=True)
    ]
    sink = io.BytesIO()
    coding = dict.fromkeys(SCHEMA.names, "DELTA_BINARY_PACKED")
    with pq.ParquetWriter(
        sink, SCHEMA, compression="zstd", use_dictionary=False, column_encoding=coding, store_schema=False
    ) as writer:
        writer.write_table(pa.table(columns, schema=SCHEMA))
        writer.add_key_value_metadata({DIGEST: NO_DIGEST})
    return with_digest(sink.getvalue())


def remove_counts(site: Site, line_id: str) -> bool:
    """Delete the counts of a line, durably. Returns False where a line that a counter counts has none.

    A removal that was stopped may be done and not yet durable: the same command again makes it so, also where vsd.toml
    no longer has the line. `status/counts-remove` names the line that was removed last.

    Raises:
        UsageError: E101, there are none, and no such line.
        DiskError: E304 to E306, the disk refused.
    """
    from vsd_analytics.store.durable import exclusive, fsync_dir, publish, remove, sweep_temporaries

    stored, note = stored_lines(site), site.root / "status" / "counts-remove"
    counted = [line.line_id for line in site.lines if line.is_by_counter]
    began = note.read_text(encoding="utf-8") if note.exists() else None
    if line_id not in {*stored, *counted, began}:
        close = nearest(line_id, stored)
        raise UsageError(
            f"there are no counts of a line {line_id[:60]!r}",
            why=f"there are counts of {', '.join(stored)}" if stored else "nothing was added yet",
            fix=f"vsd counts remove {close}" if close else "vsd counts list",
        )
    with exclusive(site.root / "status" / "counts-add.lock"):
        folder = site.root / FOLDER
        if not folder.is_dir():
            return False
        publish(note, line_id.encode())
        sweep_temporaries(folder, file_name=_file(site, line_id).name)
        remove(_file(site, line_id))
        fsync_dir(folder)
    return line_id in stored


def counted_line(site: Site, line_id: str) -> Line:
    """Return a line that a counter counts.

    Raises:
        UsageError: E101, there is no such line, or cameras count it.
    """
    by_id = {line.line_id: line for line in site.lines}
    counted = [line.line_id for line in site.lines if line.is_by_counter]
    line = by_id.get(line_id)
    if line is not None and line.is_by_counter:
        return line
    if line is not None:
        why = "cameras count it: two numbers for one door would not add up"
        raise UsageError(
            f"the line {line_id!r} is not counted by a counter",
            why=why,
            fix='counted_by = "counter" under its [[line]]',
        )
    close = nearest(line_id, counted)
    why = f"lines that a counter counts: {', '.join(counted) or 'none'}"
    new = f'[[line]] with id = "{line_id[:40]}", name = "Entrance", counted_by = "counter" in vsd.toml'
    raise UsageError(f"--line: there is no line {line_id[:60]!r}", why=why, fix=f"--line {close}" if close else new)


def _read(
    site: Site, path: Path, columns: Mapping[Way, str], times: ContextColumns
) -> tuple[list[IntervalRow[Counts]], list[RefusedRow]]:
    """Return the rows whose numbers are all good, and the lines that were refused, each once."""
    refused: dict[int, RefusedRow] = {}
    by_line: dict[int, dict[Way, IntervalRow[float]]] = {}
    for way, column in columns.items():
        read, bad = read_context_file(path, ContextColumns(times.time, column, times.end, times.every, times.zone))
        for row in bad:
            refused.setdefault(row.line, row)
        for interval in read:
            by_line.setdefault(interval.line, {})[way] = interval
    rows = []
    for line, ways in sorted(by_line.items()):
        one = next(iter(ways.values()))
        if line in refused or len(ways) < len(columns):
            continue
        wrong = next((w for w in ways.values() if w.value < 0 or w.value != round(w.value)), None)
        if wrong is not None:
            why = f"{wrong.value:g} is no number of people"
            refused[line] = RefusedRow(
                line, why, "whole numbers, 0 or more; leave the cell empty where it was not counted"
            )
        elif not _is_in_one_hour(site, one.from_ms, one.to_ms):
            why = "its interval is longer than an hour, or begins in one local hour and ends in the next"
            refused[line] = RefusedRow(line, why, "export counts by hour or shorter: --every 1h or 15min")
        else:
            left, right, both = (round(ways[way].value) if way in ways else None for way in WAYS)
            rows.append(IntervalRow(line, one.from_ms, one.to_ms, (left, right, both)))
    return rows, list(refused.values())


def _is_in_one_hour(site: Site, from_ms: int, to_ms: int) -> bool:
    """Tell whether an interval lies within one local hour."""
    start = datetime.fromtimestamp(from_ms / 1000, tz=UTC).astimezone(site.zone)
    into_ms = (start.minute * 60 + start.second) * 1000 + start.microsecond // 1000
    return into_ms + to_ms - from_ms <= HOUR_MS


def _refuse_other_ways(before: Mapping[Interval, Counts], columns: Mapping[Way, str]) -> None:
    """Raise UsageError where the counts that are stored have other directions than the file."""
    known = next(iter(before.values()), None)
    if known is None:
        return
    stored = [way for way, n in zip(WAYS, known, strict=True) if n is not None]
    if stored != [way for way in WAYS if way in columns]:
        options = " ".join(f"--{way} COLUMN" for way in stored)
        raise UsageError(
            f"the stored counts of this line have other directions: {', '.join(stored)}",
            why="one line has the same directions all the time",
            fix=f"{options}, or another line with from = the day of the new counter",
        )


def _shown(counts: Counts) -> str:
    return " and ".join(f"{n:,}" for n in counts if n is not None)
