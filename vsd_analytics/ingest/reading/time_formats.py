"""Times that are not ISO 8601: year first with slashes, day or month first, AM and PM.

`10/03/2025` is 10 March in Europe and 3 October in the United States. A format is taken from the file alone only where
its dates leave no doubt; else the user must state it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Final

import pandas as pd

from vsd_analytics.errors import InputError, UsageError, Where
from vsd_analytics.ingest.reading.adapter import IngestOptions, Source, unused_options
from vsd_analytics.ingest.reading.cell_values import trimmed
from vsd_analytics.ingest.reading.columns import TIME_OF_DAY, ColumnPlan
from vsd_analytics.ingest.reading.elapsed import UNITS_MS, elapsed_ms, unit_ms
from vsd_analytics.ingest.reading.table_file import TableFile
from vsd_analytics.ingest.reading.table_rows import date_and_time

SAMPLE_ROWS: Final = 50_000
_LOOKED_AT: Final = 20

_FIRST: Final = {"d": "day", "m": "month", "y": "year"}
_CLOCK = (
    r"(?:(?P<gap>[ T]|, ?)(?P<hour>\d{1,2}):\d{2}(?P<second>:\d{2}(?P<fraction>\.\d{1,9})?)?"
    r"(?P<half>(?P<half_gap> ?)[AaPp][Mm])?)?"
)
_YEAR_FIRST = re.compile(r"\d{4}(?P<sign>[-/.])(\d{1,2})(?P=sign)(\d{1,2})" + _CLOCK)
_YEAR_LAST = re.compile(r"(?P<one>\d{1,2})(?P<sign>[-/.])(?P<two>\d{1,2})(?P=sign)(?P<year>\d{4}|\d{2})" + _CLOCK)
_ISO = re.compile(r"\d{4}-\d{2}-\d{2}(?:[ T]\d{2}:\d{2}(?::\d{2}.*)?)?(?<![AaPp][Mm])")


def checked_format(text: str) -> str:
    """Return a format of strptime that the user states.

    Raises:
        UsageError: E101, it is none, or it has no date.
    """
    if text in UNITS_MS:
        return text
    try:
        pd.to_datetime(pd.Series(["2025-11-10"]), format=text, errors="coerce")
    except (ValueError, re.error) as error:
        raise _bad(text, str(error)) from None
    if "%" not in text or not any(part in text for part in ("%d", "%j", "%x", "%c", "%s", "%D", "%F")):
        raise _bad(text, "it has no day")
    return text


def time_format(source: Source, file: TableFile, plan: ColumnPlan, options: IngestOptions) -> str | None:
    """Return how texts in `ts` are written, in the words of strptime; None = ISO 8601 or numbers.

    Args:
        source: For messages.
        file: The table.
        plan: Its columns.
        options: What the user says.

    Raises:
        InputError: E210, the dates fit two formats.
        UsageError: E101, `--start` is given for times that are instants by themselves.
    """
    stated = options.time_format
    if options.start is not None and "ts" in plan.theirs:
        _refuse_instants(source, file, plan, options)
        return stated
    if stated in UNITS_MS:
        raise unused_options(source, [f"--time-format {stated}"], why="it says how times since --start are counted")
    if stated is not None or "ts" not in plan.theirs or not file.has_text(plan.theirs["ts"]):
        return stated
    texts = _times(file, plan)
    first = next(texts, None)
    if first is None or _ISO.fullmatch(first) or not (_YEAR_FIRST.fullmatch(first) or _YEAR_LAST.fullmatch(first)):
        return None
    formats = formats_of([first, *texts])
    if len(formats) < 2:
        return formats[0] if formats else None
    raise InputError(
        f"the dates of {source.file_name} can be read in two ways, such as {first!r}",
        code="E210",
        where=Where(source.name),
        why=f"no date of the first {SAMPLE_ROWS:,} rows shows whether the day, the month or the year comes first",
        fix="--time-format " + ", or ".join(f'"{form}" ({_FIRST[form[1]]} first)' for form in formats),
    )


def _refuse_instants(source: Source, file: TableFile, plan: ColumnPlan, options: IngestOptions) -> None:
    """Raise UsageError (E101) where times are instants, and no times since `--start`."""
    unit = unit_ms(options.time_format, plan.names["ts"])
    texts = [text for text, _ in zip(_times(file, plan), range(_LOOKED_AT), strict=False)]
    if texts and all(elapsed_ms(text, unit) is None for text in texts):
        why = f"{plan.names['ts'][:80]!r} holds instants such as {texts[0][:40]!r}, and no times since a beginning"
        raise unused_options(source, ["--start"], why=why)


def formats_of(texts: Iterable[str]) -> list[str]:
    """Return the formats that fit all texts: several where day, month and a year of two digits could be any.

    Numbers between dots are day, month, year wherever people write them so.
    """
    shapes: set[tuple[str, ...]] = set()
    is_day_first = is_month_first = is_year_first = True
    for text in dict.fromkeys(texts):
        match = _YEAR_FIRST.fullmatch(text)
        if match is not None:
            shapes.add((f"%Y{match['sign']}%m{match['sign']}%d", _clock(match)))
            continue
        match = _YEAR_LAST.fullmatch(text)
        if match is None:
            continue  # a cell that is no time goes to quarantine
        sign, year = match["sign"], "%Y" if len(match["year"]) == 4 else "%y"
        shapes.add((f"{{}}{sign}{{}}{sign}{year}", _clock(match)))
        is_year_first &= len(match["year"]) == 2 and int(match["two"]) <= 12 and 0 < int(match["year"]) <= 31
        is_day_first &= int(match["two"]) <= 12
        is_month_first &= int(match["one"]) <= 12 and sign != "."
    dates = {date for date, _ in shapes}
    clocks = sorted({clock for _, clock in shapes}, key=len)
    if len(dates) != 1 or len(clocks) > 2 or (len(clocks) == 2 and clocks[1] != f"{clocks[0]}.%f"):
        return []
    date, clock = dates.pop(), clocks[-1]
    if "{}" not in date:
        return [date + clock]
    orders = [o for o, fits in ((("%d", "%m"), is_day_first), (("%m", "%d"), is_month_first)) if fits]
    found_formats = [date.format(*order) + clock for order in orders]
    if is_year_first and orders:  # 24/11/25 is a day of 2025, or one of 2024
        sign = date[2]
        found_formats.append(f"%y{sign}%m{sign}%d{clock}")
    return found_formats


def _clock(match: re.Match[str]) -> str:
    if match["hour"] is None:
        return ""
    hour, half = ("%H", "") if match["half"] is None else ("%I", f"{match['half_gap']}%p")
    return f"{match['gap']}{hour}:%M{':%S' if match['second'] else ''}{'.%f' if match['fraction'] else ''}{half}"


def _times(file: TableFile, plan: ColumnPlan) -> Iterator[str]:
    wanted = {ours: i for ours, i in plan.theirs.items() if ours in ("ts", TIME_OF_DAY)}
    n_rows = 0
    with file.readable():
        for chunk in file.chunks(wanted):
            cells = chunk.columns["ts"]
            if TIME_OF_DAY in wanted:
                cells = date_and_time(cells, chunk.columns[TIME_OF_DAY])
            yield from (text for text in trimmed(cells).to_pylist() if text)
            n_rows += len(cells)
            if n_rows >= SAMPLE_ROWS:
                return


def _bad(text: str, why: str) -> UsageError:
    return UsageError(
        f"--time-format {text[:80]!r} is no format of a date and time",
        why=why,
        fix='--time-format "%d/%m/%Y %H:%M:%S"',
    )
