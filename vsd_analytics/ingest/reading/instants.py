"""Times as files write them: unix seconds to nanoseconds, and ISO 8601 with or without offset."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.ingest.reading.cell_values import numbers, trimmed

QUARTER_MS = 900_000

_UNITS: tuple[tuple[float, float, float, float], ...] = (
    # (least number in this unit, factor and divisor to milliseconds, slack). The slack in milliseconds makes up for
    # rounding: a float64 of today's unix seconds is off by up to 2.4e-4 ms, of nanoseconds by 1.3e-4 ms.
    (1e17, 1.0, 1e6, 1e-3),
    (1e14, 1.0, 1e3, 0.0),
    (1e11, 1.0, 1.0, 0.0),
    (0.0, 1e3, 1.0, 1e-3),
)
_ISO = r"^\d{4}-?\d{2}"
_OFFSET = r"(?:[zZ]|[Tt ]\d{2}[^+-]*[+-]\d{2}(?::?\d{2})?)$"
_UTC_NAMES = r"(?:UTC|GMT|Z)"
_DIRECTIVE = re.compile(r"%[-#]?[A-Za-z%]")
_STATED = re.compile(
    r"(?:(?<![A-Za-z])(?:UTC|GMT|Z)|(?=[+\-\u2212]\d{2}:?\d{2}['\")]*$))"
    r" ?(?:(?P<sign>[+\-\u2212])(?P<hours>\d{1,2})(?::?(?P<minutes>\d{2}))?)?['\")]*$",
    re.IGNORECASE,
)
"""An offset from UTC at the end of a text."""
_NAIVE_EPOCH = datetime(1970, 1, 1)
_EPOCH = _NAIVE_EPOCH.replace(tzinfo=UTC)
_FIRST_MS = (datetime(1, 1, 3) - _NAIVE_EPOCH) // timedelta(milliseconds=1)
_LAST_MS = (datetime(9999, 12, 29) - _NAIVE_EPOCH) // timedelta(milliseconds=1)


@dataclass(frozen=True, slots=True)
class Instants:
    """A parsed column of times.

    Attributes:
        ms: Milliseconds since 1970 (UTC), int64; 0 where `is_wrong`.
        is_wrong: Which rows hold no time that can be parsed.
        notes: What the user should know.
        zones: Zone in which each time without an offset was read, null for the others; None when all have one.
    """

    ms: np.ndarray
    is_wrong: np.ndarray
    notes: Sequence[str] = ()
    zones: pa.Array | None = None


def parse_instants(
    values: pa.Array, *, zone: str, time_format: str | None = None, offset_ms: int | None = None
) -> Instants:
    """Parse a column of times.

    Args:
        values: Numbers, texts, dates or timestamps. Unix numbers are seconds below 1e11, milliseconds below 1e14,
            microseconds below 1e17, else nanoseconds, by the median of the column, so that a single wild value does
            not change the unit.
        zone: IANA zone of times without an offset, see `local_to_utc`.
        time_format: How texts are written, in the words of strptime; None = ISO 8601.
        offset_ms: Milliseconds that times without an offset of their own are ahead of UTC, as the column's name states
            it (see `offset_in_text`); it takes the place of `zone`. None = the name states none.

    Raises:
        pyarrow.ArrowException: The column is of a type that cannot be a time, such as a list.
    """
    if pa.types.is_date(values.type):
        values = values.cast(pa.timestamp("ms"))
    if pa.types.is_timestamp(values.type):
        whole = values.cast(pa.timestamp("ms", tz=values.type.tz), safe=False).cast(pa.int64())
        is_wrong = ~_known(whole)
        return _placed(_int64(whole), is_wrong, is_wrong | (values.type.tz is not None), zone, offset_ms)
    if time_format is None:
        unix, is_text = numbers(values)
    else:  # 20251110 may be a date then
        unix, is_text = np.full(len(values), np.nan), np.ones(len(values), dtype=bool)
    is_unix = np.isfinite(unix)
    ms = np.zeros(len(values))
    if is_unix.any():
        with np.errstate(over="ignore"):  # a number that overflows is no time, and is marked wrong below
            magnitude = float(np.median(np.abs(unix[is_unix])))
            times, divided, slack = next(unit[1:] for unit in _UNITS if magnitude >= unit[0])
            ms[is_unix] = np.floor(unix[is_unix] * times / divided + slack)
    is_wrong = ~is_unix
    is_exact = np.ones(len(values), dtype=bool)
    if is_text.any():
        at = np.flatnonzero(is_text)
        texts = trimmed(values).take(pa.array(at))
        ms[at], is_wrong[at], is_exact[at] = (
            _from_texts(texts) if time_format is None else _from_formatted(texts, time_format)
        )
    is_wrong |= ~np.isfinite(ms) | (np.abs(ms) > 2**53)
    return _placed(np.where(is_wrong, 0, ms).astype(np.int64), is_wrong, is_wrong | is_exact, zone, offset_ms)


def ms_of_unix(number: float) -> int:
    """Return the UTC milliseconds of one unix time in seconds, milliseconds, microseconds or nanoseconds by its size.

    Raises:
        ValueError: It is not finite (OverflowError for infinity).
    """
    times, divided, slack = next(unit[1:] for unit in _UNITS if abs(number) >= unit[0] or unit[0] == 0)
    return math.floor(number * times / divided + slack)


def local_to_utc(local_ms: np.ndarray, zone: str) -> tuple[np.ndarray, np.ndarray]:
    """Return UTC milliseconds of local times.

    Args:
        local_ms: Milliseconds since 1970-01-01T00:00 on a wall clock in `zone`, int64.
        zone: IANA zone. Its offset is looked up once a quarter of an hour, because all changes of offset are at the
            start of one. Times in the hour that is skipped in spring are read as by a clock that was not put forward.

    Returns:
        UTC milliseconds, and which times come twice because clocks are set back: the first of the two is taken.
    """
    if zone.upper() == "UTC":
        return local_ms, np.zeros(len(local_ms), dtype=bool)
    quarters, of_row = np.unique(np.clip(local_ms, _FIRST_MS, _LAST_MS) // QUARTER_MS, return_inverse=True)
    offsets = np.zeros((2, len(quarters)), dtype=np.int64)
    info = ZoneInfo(zone)
    for i, quarter in enumerate(quarters.tolist()):
        wall = _NAIVE_EPOCH + timedelta(milliseconds=quarter * QUARTER_MS)
        for fold in (0, 1):
            offset = wall.replace(tzinfo=info, fold=fold).utcoffset() or timedelta()
            offsets[fold, i] = offset // timedelta(milliseconds=1)
    return local_ms - offsets[0][of_row], (offsets[0] > offsets[1])[of_row]


def utc_to_local(utc_ms: np.ndarray, zone: str) -> np.ndarray:
    """Return the wall clock time in `zone` as milliseconds since 1970-01-01T00:00: the inverse of `local_to_utc`.

    Args:
        utc_ms: UTC milliseconds, int64; those beyond the years 1 to 9999 stay as they are.
        zone: IANA zone.
    """
    info = ZoneInfo(zone)
    quarters, of_row = np.unique(utc_ms // QUARTER_MS, return_inverse=True)
    offsets = np.zeros(len(quarters), dtype=np.int64)
    for i, quarter in enumerate(quarters.tolist()):
        if _FIRST_MS < quarter * QUARTER_MS < _LAST_MS:
            wall = _EPOCH + timedelta(milliseconds=quarter * QUARTER_MS)
            offsets[i] = (wall.astimezone(info).utcoffset() or timedelta()) // timedelta(milliseconds=1)
    local: np.ndarray = utc_ms + offsets[of_row]
    return local


def frame_ms(frame: float, *, first: float, fps: float, start_ms: int) -> int | None:
    """Return the instant of a frame, start + (frame - first) / fps, in UTC milliseconds; None beyond any calendar."""
    ms = start_ms + (frame - first) * 1000 / fps
    return round(ms) if abs(ms) < 2**53 else None


def ambiguous_note(zone: str) -> str:
    """Return the warning about times that come twice."""
    return (
        f"W211: some times are in the hour that {zone} has twice when clocks are set back; "
        "the first of the two is taken: log in UTC, or with an offset, to be exact"
    )


def skipped_note(zone: str) -> str:
    """Return the warning about times that no clock of a zone shows."""
    return (
        f"W211: some times are in the hour that {zone} skips when clocks are put forward, so they are not of that "
        "zone's clock: state the zone that they are in, and import again"
    )


def _placed(ms: np.ndarray, is_wrong: np.ndarray, is_exact: np.ndarray, zone: str, offset_ms: int | None) -> Instants:
    if offset_ms is not None:
        ms[~is_exact] -= offset_ms
    if offset_ms is not None or is_exact.all():
        return Instants(ms, is_wrong)
    local_ms = ms[~is_exact]
    ms[~is_exact], is_ambiguous = local_to_utc(local_ms, zone)
    notes = [ambiguous_note(zone)] if is_ambiguous.any() else []
    if (utc_to_local(ms[~is_exact], zone) != local_ms).any():
        notes.append(skipped_note(zone))
    zones = pc.if_else(pa.array(is_exact), pa.scalar(None, pa.string()), zone)
    return Instants(ms, is_wrong, notes, zones)


def _from_texts(texts: pa.Array) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return milliseconds as written, which texts are wrong, and which have an offset."""
    texts = pc.replace_substring_regex(texts, r"(:\d{2}),(\d)", r"\1.\2")  # ISO 8601 allows a comma before fractions
    texts = pc.replace_substring_regex(texts, r"(\d) ?(?:UTC|GMT)$", r"\1Z")  # as databases export them
    is_iso = pc.match_substring_regex(texts, _ISO).to_numpy(zero_copy_only=False)
    has_offset = pc.match_substring_regex(texts, _OFFSET).to_numpy(zero_copy_only=False)
    ms, is_wrong = np.zeros(len(texts)), ~is_iso
    for is_kind in (is_iso & has_offset, is_iso & ~has_offset):
        if is_kind.any():
            chosen = pd.Series(texts.filter(pa.array(is_kind)).to_pylist(), dtype="object")
            times = pd.to_datetime(chosen, errors="coerce", utc=True, format="ISO8601")
            ms[is_kind] = times.dt.as_unit("us").astype("int64").to_numpy() // 1000
            is_wrong[is_kind] = times.isna().to_numpy()
    return ms, is_wrong, has_offset


def _from_formatted(texts: pa.Array, time_format: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return milliseconds in UTC or as written, which texts are wrong, and which have an offset, of one format."""
    offset_ms = offset_in_text(_DIRECTIVE.sub("", time_format))
    if "%Z" in time_format:
        texts = pc.replace_substring_regex(texts, rf"\b{_UTC_NAMES}\b", "+0000")
        time_format = time_format.replace("%Z", "%z")
    has_offset = "%z" in time_format
    times = pd.to_datetime(
        pd.Series(texts.to_pylist(), dtype="object"), errors="coerce", utc=has_offset, format=time_format
    )
    ms = times.dt.as_unit("us").astype("int64").to_numpy() // 1000 - (0 if has_offset else offset_ms or 0)
    is_exact = has_offset or offset_ms is not None
    return ms.astype(float), times.isna().to_numpy(), np.full(len(texts), is_exact)


def formatted_instant(text: str, time_format: str) -> datetime:
    """Return one time in a format of strptime, with its offset where the text or the format states one.

    Raises:
        ValueError: The text is not written so.
    """
    offset_ms = offset_in_text(_DIRECTIVE.sub("", time_format))
    if "%Z" in time_format:
        text, time_format = re.sub(rf"\b{_UTC_NAMES}\b", "+0000", text), time_format.replace("%Z", "%z")
    at = datetime.strptime(text.strip(), time_format)
    if at.tzinfo is not None or offset_ms is None:
        return at
    return at.replace(tzinfo=timezone(timedelta(milliseconds=offset_ms)))


def offset_in_text(text: str) -> int | None:
    """Return how many milliseconds ahead of UTC a text says that times are; None where it says nothing.

    Args:
        text: The letters of a format of strptime without its directives, such as `-- ::Z`, or the name of a column.
    """
    stated = _STATED.search(text)
    if stated is None:
        return None
    hours, minutes = int(stated["hours"] or 0), int(stated["minutes"] or 0)
    sign = -1 if stated["sign"] in ("-", "\u2212") else 1
    return sign * (hours * 60 + minutes) * 60_000 if hours < 15 and minutes < 60 else None


def offset_in_name(name: str) -> int | None:
    """Return how many milliseconds ahead of UTC the name of a column says that its times are, by a sign and hours.

    `Seen at (UTC+01:00)` gives 3,600,000. A name with UTC alone, as in `utc_time`, gives None: it may mean anything.
    """
    text = name.strip(" )]")
    stated = _STATED.search(text)
    if stated is None or stated["sign"] is None or (stated[0][0] in "+-\u2212" and ":" not in stated[0]):
        return None  # `run-2025` is no offset
    return offset_in_text(text)


def _known(values: pa.Array) -> np.ndarray:
    known: np.ndarray = values.is_valid().to_numpy(zero_copy_only=False)
    return known


def _int64(values: pa.Array) -> np.ndarray:
    return np.array(pc.fill_null(values, 0).to_numpy(zero_copy_only=False), dtype=np.int64)
