"""Times as files write them: unix seconds, milliseconds or microseconds, and ISO 8601 with or without offset."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

_UNITS: tuple[tuple[float, str, float], ...] = (
    # unix numbers from here on are in this unit; factor to milliseconds
    (1e14, "microseconds", 1e-3),
    (1e11, "milliseconds", 1.0),
    (0.0, "seconds", 1000.0),
)


def parse_instants(values: pd.Series[Any], *, zone: str) -> tuple[np.ndarray, np.ndarray, Sequence[str]]:
    """Parse a column of times.

    Args:
        values: Numbers or texts. Unix numbers are seconds below 1e11, milliseconds below 1e14, else microseconds, by
            the median of the column, so that a single wild value does not change the unit.
        zone: IANA zone of ISO times without an offset; of two equal local times at the end of summer time the first
            is meant, times in the hour that is skipped in spring are moved forward.

    Returns:
        Milliseconds since 1970 (NaN where wrong), which rows are wrong, and notes for the user.
    """
    if pd.api.types.is_datetime64_any_dtype(values.dtype):
        return _from_datetimes(values, zone)
    numbers = pd.to_numeric(values, errors="coerce").to_numpy(dtype="float64", na_value=np.nan)
    numeric = np.isfinite(numbers)
    times = np.full(len(values), np.nan)
    if numeric.any():
        magnitude = float(np.median(np.abs(numbers[numeric])))
        factor = next(f for start, _, f in _UNITS if magnitude >= start)
        times[numeric] = np.floor(numbers[numeric] * factor + 1e-6)
    notes: list[str] = []
    rest = ~numeric
    if rest.any():
        texts = values[rest].astype(str).str.strip()
        times[rest], ambiguous = _from_texts(texts, zone)
        if ambiguous:
            notes.append(
                f"{ambiguous:,} times fall into the hour that {zone} has twice when clocks are set back; "
                "the first of the two is taken: log in UTC, or with an offset, to be exact"
            )
    return times, ~np.isfinite(times), notes


def _from_texts(texts: pd.Series[str], zone: str) -> tuple[np.ndarray, int]:
    offset = texts.str.contains(r"(?:[zZ]|[+-]\d{2}:?\d{2})$", regex=True).to_numpy()
    result = np.full(len(texts), np.nan)
    if offset.any():
        aware = pd.to_datetime(texts[offset], errors="coerce", utc=True, format="ISO8601")
        result[offset] = _milliseconds(aware)
    naive = pd.to_datetime(texts[~offset], errors="coerce", format="ISO8601")
    if not len(naive):
        return result, 0
    local, n_ambiguous = _localised(naive, zone)
    result[~offset] = local
    return result, n_ambiguous


def _from_datetimes(values: pd.Series[Any], zone: str) -> tuple[np.ndarray, np.ndarray, Sequence[str]]:
    if values.dt.tz is not None:
        times, _ = _milliseconds(values.dt.tz_convert("UTC")), 0
    else:
        times, _ = _localised(values, zone)
    return times, ~np.isfinite(times), ()


def _localised(naive: pd.Series[Any], zone: str) -> tuple[np.ndarray, int]:
    if zone.upper() == "UTC":
        return _milliseconds(naive.dt.tz_localize("UTC")), 0
    first = naive.dt.tz_localize(zone, ambiguous=np.ones(len(naive), dtype=bool), nonexistent="shift_forward")
    second = naive.dt.tz_localize(zone, ambiguous=np.zeros(len(naive), dtype=bool), nonexistent="shift_forward")
    n_ambiguous = int((first != second).sum() - first.isna().sum())
    return _milliseconds(first.dt.tz_convert("UTC")), n_ambiguous


def _milliseconds(values: pd.Series[Any]) -> np.ndarray:
    whole = values.dt.as_unit("us").astype("int64").to_numpy() // 1000
    return np.where(values.isna().to_numpy(), np.nan, whole.astype("float64"))
