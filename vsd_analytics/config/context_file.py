"""CSV files of what else happened, such as sales or weather: a value for each interval of time, with its line."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import groupby
from pathlib import Path
from typing import Final
from zoneinfo import ZoneInfo

from vsd_analytics.config.interval_rows import IntervalRow, RefusedRow
from vsd_analytics.errors import InputError, UsageError, Where
from vsd_analytics.site.instants import day_start_ms

BYTES_MAX: Final = 64 * 2**20
_YEARS: Final = range(1970, 2200)
_EVERY: Final = re.compile(r"([1-9][0-9]{0,3})(min|h|d)")


class _BadRowError(ValueError):
    """Why a line cannot be used, and how to fix it."""

    def __init__(self, why: str, fix: str) -> None:
        super().__init__(why)
        self.fix = fix


@dataclass(frozen=True, slots=True)
class ContextColumns:
    """How a file says its intervals.

    Attributes:
        time: Header of the column with the start.
        value: Header of the column with the value.
        end: Header of the column with the end, which counts where no `every` is given.
        every: Length of each interval, such as "1h", "15min" or "1d" (a local day); None = the file has ends.
        zone: Zone of times without an offset, and of days.
    """

    time: str
    value: str
    end: str
    every: str | None
    zone: ZoneInfo


def zone_named(name: str) -> ZoneInfo:
    """Return a zone.

    Raises:
        UsageError: E101, there is none of this name.
    """
    try:
        return ZoneInfo(name)
    except (ValueError, OSError, KeyError):  # ZoneInfoNotFoundError is a KeyError
        raise UsageError(f"--zone: there is no time zone {name!r}", fix="--zone Europe/Rome, or --zone UTC") from None


def read_context_file(path: Path, columns: ContextColumns) -> tuple[list[IntervalRow[float]], list[RefusedRow]]:
    """Return the intervals of a file by time, and the lines that were refused.

    The first line names the columns; cells are separated by commas, semicolons or tabs. Equal lines count once. Lines
    that say different values of one interval are all refused, since nothing says which is right. An interval that
    overlaps the one before it is refused.

    Raises:
        UsageError: E101, `every` is no length of time.
        InputError: E201 no such file, E202 empty, E203 a column is missing, E204 no text in UTF-8, E209 too large.
    """
    length = None if columns.every is None else _length(columns.every)
    rows, refused = [], []
    for line, time_text, end_text, value_text in _cells(path, columns):
        try:
            from_ms, to_ms = _interval(time_text, end_text, length, columns.zone)
            rows.append(IntervalRow(line, from_ms, to_ms, _value(value_text)))
        except _BadRowError as error:
            refused.append(RefusedRow(line, str(error), error.fix))
    rows.sort(key=lambda row: (row.from_ms, row.to_ms, row.line))
    chosen = []
    for _, same in groupby(rows, key=lambda row: (row.from_ms, row.to_ms)):
        rows_of_it = list(same)
        if len({row.value for row in rows_of_it}) == 1:
            chosen.append(rows_of_it[0])
            continue
        lines = ", ".join(str(row.line) for row in rows_of_it)
        why = f"lines {lines} have different values for one interval"
        refused += [RefusedRow(row.line, why, "leave the right one in the file") for row in rows_of_it]
    return _without_overlaps(chosen, refused), sorted(refused, key=lambda row: row.line)


def _without_overlaps(rows: Sequence[IntervalRow[float]], refused: list[RefusedRow]) -> list[IntervalRow[float]]:
    """Return rows, sorted by time, without those that overlap an earlier one; these are added to `refused`."""
    chosen: list[IntervalRow[float]] = []
    for row in rows:
        if chosen and row.from_ms < chosen[-1].to_ms:
            why = f"its interval overlaps that of line {chosen[-1].line}"
            refused.append(RefusedRow(row.line, why, "give each time once, or a shorter --every"))
        else:
            chosen.append(row)
    return chosen


def _cells(path: Path, columns: ContextColumns) -> Iterator[tuple[int, str, str, str]]:
    """Yield line, start, end ("" = none) and value of each line that is not empty."""
    name = str(path)
    try:
        if path.stat().st_size > BYTES_MAX:
            raise InputError(f"{name} is larger than {BYTES_MAX >> 20} MB", code="E209", fix="split the file")
        text = path.read_bytes().decode("utf-8-sig")
    except PermissionError:
        raise
    except IsADirectoryError:
        raise InputError(f"{name} is a folder", code="E201", fix=f"name one file in it: {name}/FILE") from None
    except OSError as error:
        raise InputError(f"there is no file {name} that can be read", code="E201", why=error.strerror) from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"{name} is not text in UTF-8", code="E204", why=error.reason, fix="export it as UTF-8"
        ) from None
    head = text.split("\n", 1)[0]
    if not head.strip():
        raise InputError(f"{name} has no header line", code="E202", fix=f"begin it with {columns.time},{columns.value}")
    lines = csv.reader(io.StringIO(text, newline=""), delimiter=max(",;\t", key=head.count))
    try:
        header = [cell.strip() for cell in next(lines)]
        places = [_place(header, each, name) for each in (columns.time, columns.value)]
        end = None if columns.every is not None else _place(header, columns.end, name, is_end=True)
        for cells in lines:
            if any(cell.strip() for cell in cells):
                padded = [*cells, *[""] * len(header)]
                yield lines.line_num, padded[places[0]], "" if end is None else padded[end], padded[places[1]]
    except csv.Error as error:
        where = Where(name, lines.line_num)
        raise InputError(
            f"{name} is not CSV", code="E204", where=where, why=str(error), fix="export it again"
        ) from None


def _place(header: list[str], column: str, name: str, *, is_end: bool = False) -> int:
    if column in header:
        return header.index(column)
    shown = ", ".join(header)[:200]
    fix = "--every 1h says how long each interval is" if is_end else "--time and --value name the columns"
    raise InputError(f"{name} has no column {column!r}", code="E203", why=f"its columns are {shown}", fix=fix)


def _length(every: str) -> timedelta:
    """Return the length that `every` says; whole days are local days, of 23 to 25 hours."""
    match = _EVERY.fullmatch(every)
    if match is None:
        raise UsageError(f"--every: {every!r} is no length of time", fix="--every 1h, 15min or 1d")
    n = int(match[1])
    return {"min": timedelta(minutes=n), "h": timedelta(hours=n), "d": timedelta(days=n)}[match[2]]


def _interval(time_text: str, end_text: str, length: timedelta | None, zone: ZoneInfo) -> tuple[int, int]:
    start = _time(time_text)
    if length is not None and length % timedelta(days=1) == timedelta():
        local = start if start.tzinfo is None else start.astimezone(zone).replace(tzinfo=None)
        if (local.hour, local.minute, local.second, local.microsecond) != (0, 0, 0, 0):
            raise _BadRowError(f"{time_text!r} is no start of a day in {zone.key}", "give the date alone, or --zone")
        return day_start_ms(local.date(), zone), day_start_ms(local.date() + length, zone)
    from_ms = _ms(start, zone)
    to_ms = _ms(_time(end_text), zone) if length is None else from_ms + length // timedelta(milliseconds=1)
    if to_ms <= from_ms:
        raise _BadRowError(f"it ends at {end_text!r}, not after its start", "the end is exclusive: 09:00 to 10:00")
    return from_ms, to_ms


def _time(text: str) -> datetime:
    try:
        parsed = datetime.fromisoformat(text.strip())
        if parsed.year in _YEARS:
            return parsed
    except ValueError:
        pass
    raise _BadRowError(f"{text[:40]!r} is no date and time", "write 2026-11-09T08:00 or 2026-11-09T08:00+01:00")


def _ms(time: datetime, zone: ZoneInfo) -> int:
    """Return the UTC milliseconds of a time; one without offset must be there once in the zone."""
    if time.tzinfo is None:
        first, second = (time.replace(tzinfo=zone, fold=fold) for fold in (0, 1))
        before, after = first.utcoffset(), second.utcoffset()
        if before != after:
            is_twice = (before or timedelta()) > (after or timedelta())
            why = "comes twice" if is_twice else "does not exist"
            raise _BadRowError(
                f"{time.isoformat()} {why} in {zone.key}: the clocks change",
                "give times with their offset, or export them in UTC and add --zone UTC",
            )
        time = first
    return round(time.timestamp() * 1000)


def _value(text: str) -> float:
    text = text.strip()
    if re.fullmatch(r"[+-]?\d+,\d+", text):
        if re.search(r",\d{3}$", text):
            raise _BadRowError(f"{text!r} can be read in two ways", "write 1234 or 1.234")
        text = text.replace(",", ".")
    try:
        value = float(text)
        if math.isfinite(value) and "_" not in text:
            return value
    except ValueError:
        pass
    why = "the value is missing" if not text else f"{text[:40]!r} is no finite number"
    raise _BadRowError(why, "leave the line out: an interval without a line is unknown, not 0")
