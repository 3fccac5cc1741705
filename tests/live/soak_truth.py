"""What the soak's store must hold, from the rule its messages were made by, and what it does hold."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from zoneinfo import ZoneInfo

import duckdb
import numpy as np
import pyarrow as pa
from soak_producer import Load

from vsd_analytics.config.project import load_site
from vsd_analytics.warehouse.warehouse import open_warehouse, stored_extent

HASHES = {
    "frames": "hash(camera_id, epoch_ms(ts), seq, n_persons)",
    "observations": "hash(camera_id, epoch_ms(ts), person, x_mm, y_mm)",
}
STEP = 20_000

Sums = dict[str, tuple[int, int, int]]
Ranges = dict[str, list[tuple[int, int]]]


def connect() -> duckdb.DuckDBPyConnection:
    con = duckdb.connect()
    con.execute("set TimeZone = 'UTC'")
    return con


def stored(project: Path, table: str) -> str:
    return f"read_parquet('{project}/store/{table}/**/*.parquet', hive_partitioning = true, union_by_name = true)"


def hashed(con: duckdb.DuckDBPyConnection, relation: str, table: str) -> tuple[int, int, int]:
    """Return count, xor and sum of the hashes of a relation's rows."""
    key = HASHES[table]
    ((n, xor, total),) = con.execute(
        f"select count(*), coalesce(bit_xor({key}), 0), coalesce(sum({key}::hugeint), 0) from {relation}"
    ).fetchall()
    return int(n), int(xor), int(total)


def stored_sums(project: Path) -> Sums:
    return {table: hashed(connect(), stored(project, table), table) for table in HASHES}


def truth_sums(load: Load, *, end: int) -> Sums:
    """Return the same of messages 0 to end - 1 of every camera."""
    sums = dict.fromkeys(HASHES, (0, 0, 0))
    con = connect()
    for camera in range(load.n_cameras):
        for first in range(0, end, STEP):
            seq = np.arange(first, min(end, first + STEP))
            for table, rows in rows_of(load, camera, seq).items():
                con.register("rows", rows)
                n, xor, total = hashed(con, "rows", table)
                sums[table] = (sums[table][0] + n, sums[table][1] ^ xor, sums[table][2] + total)
    return sums


def rows_of(load: Load, camera: int, seq: np.ndarray) -> dict[str, pa.Table]:
    ts = pa.array((load.first_ms + seq * load.step_ms).astype("datetime64[ms]"), pa.timestamp("ms", "UTC"))
    name = pa.array([f"cam-{camera + 1}"] * len(seq))
    n_persons = np.full(len(seq), load.n_people, np.int32)
    x_mm, y_mm = load.positions_mm(camera, seq)
    of_row = pa.array(np.repeat(np.arange(len(seq)), load.n_people))
    return {
        "frames": pa.table({"camera_id": name, "ts": ts, "seq": seq, "n_persons": n_persons}),
        "observations": pa.table(
            {
                "camera_id": name.take(of_row),
                "ts": ts.take(of_row),
                "person": np.tile(np.arange(load.n_people, dtype=np.int32), len(seq)),
                "x_mm": x_mm.ravel().astype(np.int32),
                "y_mm": y_mm.ravel().astype(np.int32),
            }
        ),
    }


def tracks_true(load: Load, *, end: int) -> int:
    """Return the number of tracks: an engine's track is another one in each site day (from 04:00 in Rome)."""
    zone, days = ZoneInfo("Europe/Rome"), set()
    for seq in range(end):
        at = datetime.fromtimestamp((load.first_ms + seq * load.step_ms) / 1000, tz=UTC).astimezone(zone)
        days.add((seq // load.track_frames, (at.replace(tzinfo=None) - timedelta(hours=4)).date()))
    return len(days) * load.n_people * load.n_cameras


def tracks_stored(project: Path) -> int:
    tracks = f"select distinct camera_id, track_id from {stored(project, 'observations')}"
    ((n,),) = connect().execute(f"select count(*) from ({tracks})").fetchall()
    return int(n)


def gaps(project: Path) -> Ranges:
    """Return the missing numbers of each camera as ranges, as `vsd coverage` tells them: by the mart `message_gaps`."""
    site = load_site(project)
    extent = stored_extent(site)
    assert extent is not None
    found: Ranges = {}
    query = "select camera_id, first_missing, last_missing from message_gaps where not is_restart order by 1, 2"
    with open_warehouse(site, extent.first_day, extent.last_day) as warehouse:
        for row in warehouse.rows(query):
            found.setdefault(row["camera_id"], []).append((row["first_missing"], row["last_missing"]))
    return found


def lost(project: Path, load: Load, *, end: int) -> Ranges:
    """Return the same from the producer's side: what the broker acknowledged to it, minus what is stored."""
    con, found = connect(), dict[str, list[tuple[int, int]]]()
    for camera in range(load.n_cameras):
        name = f"cam-{camera + 1}"
        con.execute(f"select seq from {stored(project, 'frames')} where camera_id = ?", [name])
        missing = np.setdiff1d(np.arange(end), np.asarray(con.fetchnumpy()["seq"]))
        if len(missing):
            runs = np.split(missing, np.flatnonzero(np.diff(missing) > 1) + 1)
            found[name] = [(int(run[0]), int(run[-1])) for run in runs]
    return found
