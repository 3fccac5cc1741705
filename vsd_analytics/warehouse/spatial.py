"""Runs of violation records of engines without track ids: the same place, close in time.

Without ids two records cannot be known to be of one pair. They are taken as one run when their midpoints lie closer than
`PLACE_M` and their instants at most the episode gap apart, so that a run follows people who move together; runs are the
connected components of that graph (scipy.sparse.csgraph). Recipe: analytics, R2. A run is cut at the UTC hour, so that an
hour's facts depend on that hour alone; a run of some ten seconds crosses one about once in 360.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa

if TYPE_CHECKING:
    import duckdb
    from numpy.typing import NDArray

PLACE_M = 1.0

_RECORDS = """
select
    p.hour,
    p.camera_id,
    p.ts_ms,
    p.member_a,
    p.member_b,
    (p.x_a_mm + p.x_b_mm) / 2000.0 as x_m,
    (p.y_a_mm + p.y_b_mm) / 2000.0 as y_m,
    greatest(s.episode_gap_ms, cast(floor(2.5 * i.interval_ms) as bigint)) as gap_ms
from pairs as p
cross join params as s
inner join instants as i on p.camera_id = i.camera_id and p.ts_ms = i.ts_ms
where p.distance_mm < s.distance_mm and (p.track_a is null or p.track_b is null) and p.x_a_mm is not null and p.x_b_mm is not null
order by p.camera_id, p.hour, p.ts_ms, p.member_a, p.member_b
"""


def register_spatial_runs(con: duckdb.DuckDBPyConnection) -> None:
    """Create `spatial_runs` on a connection that has `pairs`, `instants` and `params`.

    Columns: camera_id, ts_ms, member_a, member_b (the violation record), run (text, unique within camera and hour; the
    same records give the same names). Only records without two track ids that have floor positions are in it.
    """
    rows = con.execute(_RECORDS).to_arrow_table()
    hour = rows["hour"].to_numpy()
    camera = rows["camera_id"].combine_chunks().dictionary_encode().indices.to_numpy() if rows.num_rows else hour
    points = np.column_stack([rows[c].to_numpy().astype(np.float64) for c in ("x_m", "y_m", "ts_ms")])
    gaps = rows["gap_ms"].to_numpy().astype(np.float64)
    runs = np.empty(rows.num_rows, dtype=object)
    starts = (
        np.flatnonzero(np.r_[True, (np.diff(hour) != 0) | (np.diff(camera) != 0)])
        if rows.num_rows
        else np.array([], int)
    )
    for first, after in zip(starts, np.r_[starts[1:], rows.num_rows].astype(int), strict=True):
        labels = linked(points[first:after], gap_ms=float(gaps[first:after].max()))
        runs[first:after] = [f"place-{hour[first]}-{label}" for label in labels]
    table = rows.select(["camera_id", "ts_ms", "member_a", "member_b"]).append_column(
        "run", pa.array(runs, pa.string())
    )
    con.register("_spatial_runs", table)
    con.execute("create or replace temp table spatial_runs as select * from _spatial_runs")
    con.unregister("_spatial_runs")


def linked(points: NDArray[np.float64], *, gap_ms: float) -> NDArray[np.int64]:
    """Return the connected component of each record.

    Args:
        points: x in metres, y in metres, instant in milliseconds, shape (n, 3).
        gap_ms: Records at most this far apart, and closer than `PLACE_M`, are linked.

    Returns:
        Component numbers in the order of their first record, shape (n,).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    n = len(points)
    scaled = points / np.array([PLACE_M, PLACE_M, max(gap_ms, 1.0)])
    pairs = cKDTree(scaled).query_pairs(1.0, p=np.inf, output_type="ndarray")
    away = points[pairs[:, 0], :2] - points[pairs[:, 1], :2]
    pairs = pairs[(away**2).sum(axis=1) < PLACE_M**2]
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, labels = connected_components(graph, directed=False)
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    order = np.empty(len(first), dtype=np.int64)
    order[np.argsort(first, kind="stable")] = np.arange(len(first))
    return order[inverse]
