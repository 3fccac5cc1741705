"""Boxes of people as a CSV table: frame or ts, track_id (may be absent), left, top, right, bottom in pixels."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from vsd_analytics.engine.people import N_JOINTS, People, unusable
from vsd_analytics.errors import InputError, Where

if TYPE_CHECKING:
    import pandas as pd

SIDES = ("left", "top", "right", "bottom")
EPOCH_MS_FROM = 1e11
"""Numbers of `ts` from here on are milliseconds since 1970, smaller ones are seconds."""


def read_table(path: Path, *, needed: tuple[str, ...], is_timed: bool = True) -> pd.DataFrame:
    """Read a CSV table as text, plain or compressed.

    Args:
        path: The file.
        needed: Columns it must have.
        is_timed: It must have `frame` or `ts` as well.

    Raises:
        InputError: It cannot be read (E205) or lacks a column (E203).
    """
    try:
        table = pd.read_csv(path, dtype=str, keep_default_na=False, encoding="utf-8-sig", on_bad_lines="skip")
    except (OSError, ValueError, EOFError) as error:
        why = str(error).splitlines()[0] if str(error) else type(error).__name__
        fix = "write a CSV file in UTF-8 with a header line"
        raise InputError(
            f"cannot read {path.name} as a table", code="E205", where=Where(str(path)), why=why, fix=fix
        ) from None
    table.columns = [str(name).strip().lower() for name in table.columns]
    missing = [name for name in needed if name not in table]
    if is_timed and "frame" not in table and "ts" not in table:
        missing.insert(0, "frame (or ts)")
    if missing:
        raise InputError(
            f"{path.name} has no column {', '.join(missing)}",
            code="E203",
            where=Where(str(path), 1, ",".join(table.columns)[:200]),
            fix=f"the first line must be frame,{','.join(needed)}, or ts in place of frame"
            if is_timed
            else f"the first line must be {','.join(needed)}",
        )
    return table


def numbers(column: pd.Series) -> NDArray[np.float64]:
    """Return a column of text as numbers, NaN where it is none."""
    return np.asarray(pd.to_numeric(column, errors="coerce"), dtype=np.float64)


def instants_ms(column: pd.Series) -> NDArray[np.float64]:
    """Return a column of instants as UTC milliseconds, NaN where it is none; ISO 8601 without an offset is UTC."""
    plain = numbers(column)
    if np.isfinite(plain).any():
        return np.asarray(np.round(np.where(plain >= EPOCH_MS_FROM, plain, plain * 1000)), dtype=np.float64)
    parsed = pd.to_datetime(column, utc=True, errors="coerce", format="ISO8601")
    ms = (parsed - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(milliseconds=1)
    return np.asarray(np.round(np.asarray(ms)), dtype=np.float64)


def texts(column: pd.Series) -> NDArray[np.object_]:
    """Return a column as text, None where it is empty."""
    values = np.array([value.strip() or None for value in column], dtype=object)
    return values.reshape(-1)


def read_boxes(path: Path) -> People:
    """Read boxes of people.

    A frame number that is absent between the first and the last, in steps of the file, is a frame without people:
    detectors write no row then. Frames by `ts` are those with people only.

    Args:
        path: CSV with the columns `frame` or `ts`, `left`, `top`, `right`, `bottom` and perhaps `track_id`.

    Raises:
        InputError: It cannot be read (E205), lacks a column (E203), or has no usable row (E202).
    """
    table = read_table(path, needed=SIDES)
    box = np.column_stack([numbers(table[side]) for side in SIDES])
    is_timed = "frame" not in table
    when = instants_ms(table["ts"]) if is_timed else numbers(table["frame"])
    no_time = ~np.isfinite(when) | (when != np.round(when))
    no_number = ~no_time & ~np.isfinite(box).all(axis=1)
    empty = ~no_time & ~no_number & ((box[:, 2] <= box[:, 0]) | (box[:, 3] <= box[:, 1]))
    named = {
        "ts that is no instant" if is_timed else "frame that is no whole number": no_time,
        "side that is no number": no_number,
        "box without width or height": empty,
    }
    bad = Counter({why: int(rows.sum()) for why, rows in named.items() if rows.any()})
    usable = np.flatnonzero(~(no_time | no_number | empty))
    if not len(usable):
        raise unusable(
            path,
            f"{path.name} has no usable box",
            why="; ".join(f"{n:,} rows: {why}" for why, n in bad.items()) or "it has a header and no rows",
            fix="left, top, right, bottom are pixels, right and down; right > left and bottom > top",
        )
    usable = usable[np.argsort(when[usable], kind="stable")]
    instants = when[usable].astype(np.int64)
    tracks = texts(table["track_id"])[usable] if "track_id" in table else np.full(len(usable), None, dtype=object)
    seen, row = np.unique(instants, return_inverse=True)
    if is_timed:
        frames, frame, ts_ms = np.arange(len(seen)), row.astype(np.int64), seen
    else:
        step = int(np.gcd.reduce(np.diff(seen))) if len(seen) > 1 else 1
        frames, frame, ts_ms = np.arange(seen[0], seen[-1] + 1, step), instants, None
    joints = np.full((len(usable), N_JOINTS, 2), np.nan)
    return People(frame, tracks, box[usable], joints, frames, ts_ms, dict(bad))
