"""True floor positions, and the frame messages that are compared with them."""

from __future__ import annotations

import gzip
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from vsd_analytics.engine.box_table import instants_ms, numbers, read_table, texts
from vsd_analytics.engine.people import Array, unusable
from vsd_analytics.errors import InputError, Where
from vsd_analytics.ingest.formats.frames import FrameMessage

Clock = Literal["frame", "ts"]
LEAST_CORNERS = 3


@dataclass(frozen=True, slots=True)
class Positions:
    """Floor positions of named people, in order of instants.

    Attributes:
        instant: Frame number or UTC milliseconds of each row, shape (n,).
        track: Track id, shape (n,), text.
        xy: Metres, shape (n, 2); NaN where unknown.
        instants: All instants, also those without people, in order.
        clock: What `instant` is.
        n_bad: Rows that could not be used.
    """

    instant: NDArray[np.int64]
    track: NDArray[np.object_]
    xy: Array
    instants: NDArray[np.int64]
    clock: Clock
    n_bad: int = 0


@dataclass(frozen=True, slots=True)
class FoundPairs:
    """What frame messages say, in order of instants.

    Attributes:
        positions: Persons with an id; without metres their position is NaN.
        instant: Instant of each pair sent, shape (m,).
        a: Track id of its first person.
        b: Of its second.
        distance_m: Its distance.
        has_pairs: Instants whose message carries pairs, so that none are derived.
        n_unnamed: Persons without an id, which cannot be compared.
    """

    positions: Positions
    instant: NDArray[np.int64]
    a: NDArray[np.object_]
    b: NDArray[np.object_]
    distance_m: Array
    has_pairs: NDArray[np.int64]
    n_unnamed: int


def read_positions(path: Path) -> Positions:
    """Read true positions: CSV with `frame` or `ts`, `track_id`, `x_m`, `y_m`.

    Raises:
        InputError: It cannot be read (E205), lacks a column (E203), or has no usable row (E202).
    """
    table = read_table(path, needed=("track_id", "x_m", "y_m"))
    clock: Clock = "frame" if "frame" in table else "ts"
    when = numbers(table["frame"]) if clock == "frame" else instants_ms(table["ts"])
    xy = np.column_stack([numbers(table["x_m"]), numbers(table["y_m"])])
    track = texts(table["track_id"])
    usable = np.isfinite(when) & np.isfinite(xy).all(axis=1) & (track != None)  # noqa: E711 elementwise
    if not usable.any():
        raise unusable(path, f"{path.name} has no usable position", fix="write frame (or ts), track_id, x_m, y_m")
    order = np.flatnonzero(usable)[np.argsort(when[usable], kind="stable")]
    instant = when[order].astype(np.int64)
    return Positions(instant, track[order], xy[order], np.unique(instant), clock, int((~usable).sum()))


def read_messages(path: Path, *, clock: Clock, keeps_unnamed: bool = False) -> FoundPairs:
    """Read frame messages as they are compared with the truth.

    Args:
        path: JSON Lines, plain or gzip.
        clock: `frame` takes the running number `seq` as frame number, `ts` the instant.
        keeps_unnamed: Persons without an id get one that names their place in the file; else they are only counted.

    Raises:
        InputError: A line is no frame message (E204), or has no `seq` where frames are asked for (E203).
    """
    persons: list[tuple[int, str, float, float]] = []
    pairs: list[tuple[int, str, str, float]] = []
    instants: list[int] = []
    has_pairs: list[int] = []
    n_unnamed = 0
    decoder = msgspec.json.Decoder(FrameMessage)
    for number, line in enumerate(_lines(path), start=1):
        try:
            message = decoder.decode(line)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            raise InputError(
                f"{path.name} is no file of frame messages",
                code="E204",
                where=Where(str(path), number, line[:200].decode("utf-8", "replace")),
                why=str(error),
                fix="make it with vsd engine run",
            ) from None
        at = message.seq if clock == "frame" else _ms(message.ts)
        if at is None:
            raise InputError(
                f"{path.name} has no frame numbers",
                code="E203",
                where=Where(str(path), number),
                why="the truth has frame numbers, and seq is missing here",
                fix="give the truth with ts",
            )
        instants.append(at)
        for person in message.persons or ():
            if person.id is None and not keeps_unnamed:
                n_unnamed += 1
                continue
            x, y = (np.nan if v is None else v for v in (person.x_m, person.y_m))
            name = f"unnamed {len(persons)}" if person.id is None else str(person.id)
            persons.append((at, name, x, y))
        if message.pairs is not None:
            has_pairs.append(at)
            pairs += [(at, str(p.a), str(p.b), np.nan if p.distance_m is None else p.distance_m) for p in message.pairs]
    persons.sort(key=lambda row: row[0])
    positions = Positions(
        instant=np.array([row[0] for row in persons], dtype=np.int64),
        track=np.array([row[1] for row in persons], dtype=object),
        xy=np.array([row[2:] for row in persons], dtype=np.float64).reshape(-1, 2),
        instants=np.unique(np.array(instants, dtype=np.int64)),
        clock=clock,
    )
    return FoundPairs(
        positions,
        instant=np.array([p[0] for p in pairs], dtype=np.int64),
        a=np.array([p[1] for p in pairs], dtype=object),
        b=np.array([p[2] for p in pairs], dtype=object),
        distance_m=np.array([p[3] for p in pairs], dtype=np.float64),
        has_pairs=np.unique(np.array(has_pairs, dtype=np.int64)),
        n_unnamed=n_unnamed,
    )


def read_areas_csv(path: Path) -> list[Array]:
    """Read areas: CSV with `area`, `x_m`, `y_m`, the corners of each in order; returns shapes (k, 2).

    Raises:
        InputError: It cannot be read (E205), lacks a column (E203), or an area has fewer than three corners (E202).
    """
    table = read_table(path, needed=("area", "x_m", "y_m"), is_timed=False)
    xy = np.column_stack([numbers(table["x_m"]), numbers(table["y_m"])])
    names = texts(table["area"])
    corners = [xy[names == name] for name in dict.fromkeys(names)]
    if not corners or any(len(area) < LEAST_CORNERS or not np.isfinite(area).all() for area in corners):
        raise unusable(path, f"{path.name} has an area that is none", fix="write three corners or more, in metres")
    return corners


def _lines(path: Path) -> list[bytes]:
    try:
        data = path.read_bytes()
        data = gzip.decompress(data) if data[:2] == b"\x1f\x8b" else data
    except (OSError, EOFError) as error:
        raise InputError(
            f"cannot read {path}", code="E201", where=Where(str(path)), why=str(error), fix="check the path"
        ) from None
    return [line for line in data.splitlines() if line.strip()]


def _ms(ts: datetime) -> int:
    return round((ts if ts.tzinfo else ts.replace(tzinfo=UTC)).timestamp() * 1000)
