"""Records of the tables as recordings: those that are about to be stored, and those of the store and its spool."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from vsd_analytics.geometry.homography import to_floor
from vsd_analytics.ingest.intake.recording import Bools, Floats, Ints, Recording
from vsd_analytics.schema import TableName
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.store.layout import HOUR_MS, segment_paths
from vsd_analytics.store.owners import OWNER, owners_of
from vsd_analytics.store.removal import reading
from vsd_analytics.store.segments import owners_in, read_segment
from vsd_analytics.store.spans import ends_ms
from vsd_analytics.store.store import Store

ROWS_MAX: Final = 600_000
"""Stored rows that are read; beyond it the hours with fewer incoming records are left out."""
HOURS_MAX: Final = 48
SEGMENTS_HELD: Final = 16
"""Segments of others that are held in memory, up to 9 MB each: a batch lies in the time of the one before."""
PAST_PARTS, PAST_PARTS_OPENED, PAST_ROWS = 2, 200, 5_000
_PIXELS_M: Final = 1_000_000.0
"""Places in pixels and pairs without places lie this far, and twice as far, from all floors."""
_PIXEL_M: Final = 0.01
_PEOPLE_M: Final = 0.5
_COLUMNS: Final[Mapping[TableName, Sequence[str]]] = {
    "observations": ("camera_id", "ts", "track_id", "x_mm", "y_mm", "u_px", "v_px"),
    "pairs": ("camera_id", "ts", "track_a", "track_b", "x_a_mm", "y_a_mm", "x_b_mm", "y_b_mm", "distance_mm"),
}


ReadPart = Callable[[Path, TableName], pa.Table]


@dataclass(frozen=True, eq=False)
class KeyedRecords:
    """Records of one table as a recording, with what identifies each.

    Attributes:
        recording: Places and times, sorted by time.
        key: A hash of what identifies each record in the store (`schema.KEYS`).
        is_metric: Whether each place is in metres.
    """

    recording: Recording
    key: Ints
    is_metric: Bools

    def at(self, rows: Any) -> KeyedRecords:
        """Return some of them."""
        return KeyedRecords(self.recording.at(rows), self.key[rows], self.is_metric[rows])


def on_floors(recording: Recording) -> Recording:
    """Return the records with places in metres: pixels and pairs without places say nothing of what two cameras see."""
    is_on_floor = recording.places[:, 0] < _PIXELS_M / 2
    return recording if is_on_floor.all() else recording.at(is_on_floor)


def table_of(tables: Mapping[TableName, pa.Table]) -> TableName:
    """Return the table that tells where people are: pairs where there are no single people."""
    rows = tables.get("observations")
    return "observations" if rows is not None and rows.num_rows else "pairs"


def rows_of(site: Site, table: TableName, tables: Sequence[pa.Table], *, keyed_ms: Ints | None = None) -> KeyedRecords:
    """Return normalised or stored rows of observations or pairs, perhaps with their owners, as a recording.

    A pair with places is its two people. One without is at a place of its own: its distance, and the number of pairs
    of its frame.

    Args:
        site: The site.
        table: Table of the rows.
        tables: The rows.
        keyed_ms: Instants of the records that need a key; None = all.
    """
    names = [*_COLUMNS[table], OWNER]
    plain = [_plain(rows, table).select(names) for rows in tables if rows.num_rows]
    frame = pd.concat([rows.to_pandas() for rows in plain], ignore_index=True) if plain else _nothing(names)
    if table == "pairs":
        frame = _people_of_pairs(frame)
    cameras = {c.camera_id: c for c in site.cameras}
    camera_no, camera_ids = pd.factorize(frame["camera_id"])
    ts_ms = frame["ts"].to_numpy(dtype="datetime64[ms]").astype(np.int64)
    places, is_metric = _places(frame, camera_no, [cameras.get(c) for c in camera_ids], ts_ms)
    track_no, _ = pd.factorize(frame["track_id"])
    owner_no, owners = pd.factorize(frame[OWNER])
    order = np.argsort(ts_ms, kind="stable")
    recording = Recording(
        ts_ms,
        places,
        camera_no.astype(np.int64),
        track_no.astype(np.int64),
        owner_no.astype(np.int64),
        tuple(camera_ids),
        tuple(owners),
    )
    key = np.zeros(len(frame), dtype=np.int64)
    is_keyed = np.ones(len(frame), dtype=bool) if keyed_ms is None else np.isin(ts_ms, keyed_ms)
    key[is_keyed] = _keys(frame[is_keyed])
    rows = KeyedRecords(recording, key, is_metric)
    return rows.at(order[~np.isnan(places[order, 0])])


def stored_tables(
    site: Site,
    stores: Sequence[Store],
    table: TableName,
    here: Recording,
    *,
    around_s: float,
    spool: Spool,
    read: ReadPart,
) -> list[pa.Table]:
    """Return the rows that are stored at the times of some records, on the floors of their cameras, for `rows_of`.

    Args:
        site: The site.
        stores: Stores to read, their spools included.
        table: Table of the records.
        here: The records.
        around_s: Seconds before the first and behind the last record of an hour that are read, too.
        spool: The spool without the records themselves.
        read: Reads a part, perhaps from memory.

    Raises:
        StoreError: E311, a removal did not end in time.
    """
    around_ms = round(1000 * around_s)
    first_ms, last_ms = int(here.ts_ms[0]) - around_ms, int(here.ts_ms[-1]) + around_ms
    hours, n_of_hour = np.unique(here.ts_ms // HOUR_MS, return_counts=True)
    floors = {c.floor_id for c in site.cameras if c.camera_id in here.cameras}
    cameras = pa.array([c.camera_id for c in site.cameras if c.floor_id in floors])
    tables: list[pa.Table] = []
    n_rows = 0
    for store in stores:
        with reading(store.root), contextlib.suppress(pa.ArrowException, ValueError, OSError):  # a fold names damage
            for rows in spool.rows(store, table, first_ms, last_ms):
                if n_rows > ROWS_MAX:
                    break
                n_rows += rows.num_rows
                tables.append(rows)
            parts = store.parts(table, first_hour=first_ms // HOUR_MS, last_hour=last_ms // HOUR_MS)
            rank = dict(zip(hours[np.argsort(-n_of_hour, kind="stable")].tolist(), range(len(hours)), strict=True))
            near = [p for p in parts if rank.keys() & {p.hour - 1, p.hour, p.hour + 1}]
            near.sort(key=lambda p: min(rank.get(h, len(rank)) for h in (p.hour, p.hour - 1, p.hour + 1)))
            for part in near[:HOURS_MAX]:
                ends = ends_ms(part.path)
                if n_rows > ROWS_MAX or (ends is not None and (ends[0] > last_ms or ends[1] < first_ms)):
                    continue
                rows = read(part.path, table)
                n_rows += rows.num_rows
                tables.append(rows)
    return [_within(rows, first_ms, last_ms, cameras) for rows in tables]


def at_instants(tables: Sequence[pa.Table], ts_ms: Ints) -> list[pa.Table]:
    """Return the rows of some instants."""
    instants = pa.array(np.unique(ts_ms))
    return [rows.filter(pc.is_in(rows["ts"].cast(pa.int64()), instants)) for rows in tables]


def newest_rows(
    site: Site, stores: Sequence[Store], table: TableName, camera: Camera, at_ms: int, spool: Spool, read: ReadPart
) -> KeyedRecords | None:
    """Return some of the records of a camera that are stored nearest to an instant, in one hour; None = none.

    Args:
        site: The site.
        stores: Stores to read, their spools included.
        table: Table of the records.
        camera: The camera.
        at_ms: The instant.
        spool: The spool without the records themselves.
        read: Reads a part, perhaps from memory.
    """
    camera_ids = pa.array([camera.camera_id])
    for store in stores:
        with reading(store.root), contextlib.suppress(pa.ArrowException, ValueError, OSError):
            parts = sorted(store.parts(table), key=lambda part: abs(part.hour - at_ms // HOUR_MS))
            # a part of other cameras tells nothing: one column of it is read to know
            with_camera = (p for p in parts[:PAST_PARTS_OPENED] if _holds_camera(p.path, camera.camera_id))
            tables = (read(part.path, table) for part in islice(with_camera, PAST_PARTS))
            for rows in (*spool.rows(store, table, -(1 << 60), 1 << 60), *tables):
                own = rows.filter(pc.is_in(rows["camera_id"].cast(pa.string()), camera_ids)).slice(0, PAST_ROWS)
                if own.num_rows >= PAST_ROWS // 100:
                    return rows_of(site, table, [own], keyed_ms=np.zeros(0, dtype=np.int64))
    return None


def _holds_camera(path: Path, camera_id: str) -> bool:
    with pq.ParquetFile(path, read_dictionary=["camera_id"]) as file:
        return camera_id in pc.unique(file.read(columns=["camera_id"], use_threads=False)["camera_id"]).to_pylist()


def read_part(path: Path, table: TableName) -> pa.Table:
    """Return the columns of a part that are compared, with the owners of its rows."""
    texts = [name for name in _COLUMNS[table] if name == "camera_id" or name.startswith("track")]
    with pq.ParquetFile(path, read_dictionary=texts) as file:
        rows = file.read(columns=list(_COLUMNS[table]), use_threads=False)
    return rows.append_column(OWNER, owners_of(path))


class Spool:
    """The segments of the spool with rows of others than one import: each is opened once, however often it is asked.

    Args:
        but: Import whose rows are left out; "" = none.
    """

    def __init__(self, but: str) -> None:
        self._but = but
        self._ends: dict[Path, tuple[int, int] | None] = {}
        self._own: set[Path] = set()
        self._read = lru_cache(maxsize=SEGMENTS_HELD)(self._rows)

    def rows(self, store: Store, table: TableName, first_ms: int, last_ms: int) -> Iterator[pa.Table]:
        """Yield the rows of segments that reach into some time."""
        for path in segment_paths(store.root, table):
            if path in self._own:
                continue
            if path not in self._ends:
                if self._but and owners_in(path) == {self._but}:
                    self._own.add(path)
                    continue
                self._ends[path] = ends_ms(path)
            ends = self._ends[path]
            if ends is None or (ends[0] <= last_ms and ends[1] >= first_ms):
                yield self._read(path, table)

    def _rows(self, path: Path, table: TableName) -> pa.Table:
        rows = _plain(read_segment(path), table)
        return rows.filter(pc.not_equal(rows[OWNER], self._but)) if self._but else rows


def _within(rows: pa.Table, first_ms: int, last_ms: int, cameras: pa.Array) -> pa.Table:
    ts_ms = rows["ts"].cast(pa.int64())
    is_near = pc.and_(pc.greater_equal(ts_ms, first_ms), pc.less_equal(ts_ms, last_ms))
    return rows.filter(pc.and_(is_near, pc.is_in(rows["camera_id"].cast(pa.string()), cameras)))


def _plain(rows: pa.Table, table: TableName) -> pa.Table:
    """Return the columns that are compared, with owners."""
    if OWNER not in rows.column_names:
        rows = rows.append_column(OWNER, pa.array([""] * rows.num_rows, pa.string()))
    columns = [rows[name] for name in (*_COLUMNS[table], OWNER)]
    texts = [c.cast(pa.string()) if pa.types.is_dictionary(c.type) else c for c in columns]
    return pa.table(texts, names=[*_COLUMNS[table], OWNER])


def _nothing(names: Sequence[str]) -> pd.DataFrame:
    empty = pd.DataFrame({name: pd.Series(dtype=float) for name in names})
    return empty.assign(ts=pd.Series(dtype="datetime64[ms]"))


def _people_of_pairs(frame: pd.DataFrame) -> pd.DataFrame:
    """Return both people of pairs with places, and one row for a pair without."""
    ends = [
        frame.rename(columns={f"track_{side}": "track_id", f"x_{side}_mm": "x_mm", f"y_{side}_mm": "y_mm"})
        for side in "ab"
    ]
    has_place = frame[["x_a_mm", "y_a_mm", "x_b_mm", "y_b_mm"]].notna().all(axis=1).to_numpy()
    rest = ends[0][~has_place]
    n_pairs = rest.groupby(["camera_id", "ts"])["ts"].transform("size")
    rest = rest.assign(
        u_px=(_PIXELS_M + rest["distance_mm"].fillna(0) / 1000) / _PIXEL_M, v_px=n_pairs * _PEOPLE_M / _PIXEL_M
    )
    both = [rest[name].astype(str).where(rest[name].notna()) for name in ("track_id", "track_b")]
    rest["track_id"] = both[0] + " " + both[1]
    people = [end[has_place].assign(u_px=np.nan, v_px=np.nan) for end in ends]
    columns = ["camera_id", "ts", "track_id", "x_mm", "y_mm", "u_px", "v_px", OWNER]
    return pd.concat([part[columns] for part in (*people, rest)], ignore_index=True)


def _places(
    frame: pd.DataFrame, camera_no: Ints, cameras: Sequence[Camera | None], ts_ms: Ints
) -> tuple[Floats, Bools]:
    places = frame[["x_mm", "y_mm"]].to_numpy(dtype=float) / 1000
    pixels = frame[["u_px", "v_px"]].to_numpy(dtype=float)
    for no, camera in enumerate(cameras):
        is_missing = np.flatnonzero((camera_no == no) & np.isnan(places[:, 0]))
        for calibration in () if camera is None else camera.calibrations:
            valid_ms = -np.inf if calibration.valid_from is None else calibration.valid_from.timestamp() * 1000
            rows = is_missing[ts_ms[is_missing] >= valid_ms]  # a later one takes the place of an earlier one
            picture_px = None if camera is None else camera.picture_px
            places[rows] = to_floor(calibration.homography, pixels[rows], picture_px=picture_px)
    is_metric = ~np.isnan(places[:, 0])
    places[~is_metric] = pixels[~is_metric] * _PIXEL_M + np.array([_PIXELS_M, 0.0])
    return places, is_metric


def _keys(frame: pd.DataFrame) -> Ints:
    """Return a hash of what identifies each record: camera and instant, and its track or else its place."""
    has_track = frame["track_id"].notna().to_numpy()
    values = frame[["camera_id", "ts", "track_id", "x_mm", "y_mm", "u_px", "v_px"]].copy()
    for name in ("x_mm", "y_mm", "u_px", "v_px"):
        values[name] = values[name].astype(float).where(~has_track)
    values["track_id"] = values["track_id"].fillna("").astype(str)
    values["camera_id"] = values["camera_id"].astype(str)
    return np.asarray(pd.util.hash_pandas_object(values, index=False).to_numpy()).view(np.int64)


def evenly(rows: Sequence[pa.Table], n: int) -> list[pa.Table]:
    """Return at most `n` rows, drawn evenly: the same ones each time."""
    whole = pa.concat_tables(rows)
    if whole.num_rows <= n:
        return [whole]
    edges = np.linspace(0, whole.num_rows, n + 1).astype(np.int64)
    at = edges[:-1] + (np.random.default_rng(0).random(n) * np.diff(edges)).astype(np.int64)
    return [whole.take(pa.array(at))]
