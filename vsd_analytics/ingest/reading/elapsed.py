"""Times counted from the beginning of a recording: seconds, ms, us or ns since `--start`, or hours:minutes:seconds."""

from __future__ import annotations

import math
import re
from typing import Final

import numpy as np
import pyarrow as pa

from vsd_analytics.ingest.reading.cell_values import numbers, trimmed
from vsd_analytics.ingest.reading.instants import Instants

UNITS_MS: Final = {"s": 1000.0, "ms": 1.0, "us": 1e-3, "ns": 1e-6}
"""Milliseconds of one unit; the keys are values of `--time-format`."""
LONGEST_MS: Final = 10 * 365.25 * 86_400_000
"""No recording is longer: larger numbers are counted from another beginning."""
_NAMED: Final = re.compile(
    r"(?:^|[^a-z]|time|stamp)(ms|msec|millis|us|usec|micros|ns|nsec|nanos)$|(milli|micro|nano)s?ec"
)
_SHORT: Final = {"m": "ms", "u": "us", "n": "ns"}
_CLOCK: Final = re.compile(r"(?:(\d{1,6}):)?(\d{1,2}):(\d{2}(?:[.,]\d+)?)")


def unit_ms(time_format: str | None, name: str) -> float:
    """Return the milliseconds of one unit of elapsed times: as the user says, else as the column's name says, else 1 s.

    Args:
        time_format: A key of `UNITS_MS`; other formats say nothing of elapsed times.
        name: The column or path of the times, such as `time_ms`.
    """
    if time_format in UNITS_MS:
        return UNITS_MS[time_format]
    named = _NAMED.search(name.lower())
    if named is None:
        return UNITS_MS["s"]
    word = named[1] or named[2]
    return UNITS_MS["us" if word.startswith("mic") else _SHORT[word[0]]]


def elapsed_ms(value: str | int | float, unit: float) -> float | None:
    """Return the milliseconds of one elapsed time, or None where it is none.

    Args:
        value: A number, also as text, or hours:minutes:seconds with or without hours.
        unit: Milliseconds of one unit, for numbers.
    """
    clock = _CLOCK.fullmatch(value.strip()) if isinstance(value, str) else None
    if clock is not None:
        hours, minutes, seconds = int(clock[1] or 0), int(clock[2]), float(clock[3].replace(",", "."))
        return (hours * 3600 + minutes * 60 + seconds) * 1000
    try:
        ms = float(value) * unit
    except (ValueError, OverflowError):
        return None
    return ms if math.isfinite(ms) and abs(ms) < LONGEST_MS else None


def elapsed_instants(values: pa.Array, *, start_ms: int, unit: float) -> Instants:
    """Return the instants of a column of elapsed times.

    Args:
        values: Numbers, or texts as `elapsed_ms` reads them.
        start_ms: When the recording began, UTC milliseconds.
        unit: Milliseconds of one unit of numbers.
    """
    if pa.types.is_temporal(values.type):  # a date is no time since the beginning
        return Instants(np.zeros(len(values), dtype=np.int64), np.ones(len(values), dtype=bool))
    elapsed, is_text = numbers(values)
    elapsed = np.asarray(elapsed * unit)
    if is_text.any():
        at = np.flatnonzero(is_text)
        texts = trimmed(values).take(pa.array(at)).to_pylist()
        times_ms = [elapsed_ms(text or "", unit) for text in texts]
        elapsed[at] = [math.nan if ms is None else ms for ms in times_ms]
    is_wrong = ~(np.abs(elapsed) < LONGEST_MS)
    ms = np.rint(np.where(is_wrong, 0, elapsed) + start_ms).astype(np.int64)
    return Instants(np.where(is_wrong, 0, ms), is_wrong)
