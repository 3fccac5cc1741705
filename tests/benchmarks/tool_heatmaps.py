"""One question, asked of every tool: where do people stand, where are they too close, and when?

From the records of a store: how many person records, and how many pairs of persons of one camera and instant closer
than 2 m, lie in each cell of half a metre (of a pair: its midpoint) and in each UTC hour. All counts are whole numbers
of whole millimetres, so that all tools must give the same.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
CELL_MM: Final = 500
CLOSE_MM: Final = 2000
HOUR_MS: Final = 3_600_000
_COLUMNS, _ROWS, _BEFORE = 2048, 64, 4
"""The grid of those who count in one: cells of the made-up site, with four to spare before its first row and column."""


@dataclass(frozen=True, slots=True)
class CountedCells:
    """The answer.

    Attributes:
        cells: One row per cell that has any: cx, cy, person records, pairs too close.
        hours: One row per UTC hour that has any: hour number, person records, pairs too close.
    """

    cells: Ints
    hours: Ints

    def digest(self) -> str:
        """Return a hash of all counts, in order of cells and hours."""
        found = hashlib.blake2b(digest_size=8)
        for rows in (self.cells, self.hours):
            n_keys = rows.shape[1] - 2
            order = np.lexsort(rows[:, :n_keys].T[::-1])
            found.update(np.ascontiguousarray(rows[order], dtype=np.int64).tobytes())
        return found.hexdigest()


def files(root: Path) -> list[str]:
    """Return the files of person records of a project, in order of hours."""
    return [str(p) for p in sorted((root / "store" / "observations").rglob("*.parquet"))]


def ours_first(root: Path) -> CountedCells:
    """Compute the facts behind heatmap and hours, then read these from them."""
    return ours_again(root)


def ours_whole(root: Path) -> CountedCells:
    """Compute all facts of the store, then read heatmap and hours from them."""
    from vsd_analytics.config.project import load_site
    from vsd_analytics.warehouse.build import build

    build(load_site(root, environ={}))
    return ours_again(root)


def ours_again(root: Path) -> CountedCells:
    """Read heatmap and hours from facts that are there; a first time also writes the marts' week files."""
    from vsd_analytics.config.project import load_site
    from vsd_analytics.warehouse.stored_days import stored_extent
    from vsd_analytics.warehouse.warehouse import open_warehouse

    site = load_site(root, environ={})
    extent = stored_extent(site)
    assert extent is not None
    options = {"heat_cell_m": CELL_MM / 1000, "relations": ("heatmap", "camera_hour_records")}
    with open_warehouse(site, extent.first_day, extent.last_day, **options) as warehouse:
        cells = warehouse.table("select cx, cy, person_records, violation_records from heatmap")
        hours = warehouse.table(
            "select hour_start_ms // 3600000, sum(person_records)::bigint, sum(violation_records)::bigint "
            "from camera_hour_records group by hour_start_ms having sum(person_records) > 0"
        )
    return CountedCells(_matrix(cells), _matrix(hours))


def duckdb_scan(root: Path) -> None:
    """Read the four columns that the question needs once, and nothing more: the floor under everything."""
    with _duckdb() as con:
        con.execute(
            "select max(camera_id), max(epoch_ms(ts)), sum(x_mm), sum(y_mm) from read_parquet($files)",
            {"files": files(root)},
        ).fetchall()


def duckdb_sql(root: Path) -> CountedCells:
    """Answer with SQL of one's own in DuckDB: a self join of the records of a camera and instant."""
    with _duckdb() as con:
        con.execute(
            "create temp table o as select camera_id, epoch_ms(ts) as ts_ms, row_number() over () as n, x_mm, y_mm "
            "from read_parquet($files)",
            {"files": files(root)},
        )
        con.execute(
            f"""
            create temp table counted as
            select ts_ms // {HOUR_MS} as hour, floor(x_mm / {CELL_MM})::bigint as cx,
                   floor(y_mm / {CELL_MM})::bigint as cy,
                   count(*) as persons, 0 as pairs
            from o group by all
            union all
            select a.ts_ms // {HOUR_MS}, floor((a.x_mm + b.x_mm) / {2 * CELL_MM})::bigint,
                   floor((a.y_mm + b.y_mm) / {2 * CELL_MM})::bigint, 0, count(*)
            from o as a inner join o as b on a.camera_id = b.camera_id and a.ts_ms = b.ts_ms and a.n < b.n
            where (a.x_mm - b.x_mm)::bigint ** 2 + (a.y_mm - b.y_mm)::bigint ** 2 < {CLOSE_MM**2}
            group by all
            """
        )
        sums = "sum(persons)::bigint, sum(pairs)::bigint from counted"
        cells = con.sql(f"select cx, cy, {sums} group by cx, cy").to_arrow_table()
        hours = con.sql(f"select hour, {sums} group by hour").to_arrow_table()
    return CountedCells(_matrix(cells), _matrix(hours))


def polars_frames(root: Path) -> CountedCells:
    """Answer with lazy frames of polars: the same self join."""
    import polars as pl

    stored = pl.scan_parquet(files(root), hive_partitioning=False)
    places = (pl.col(c).cast(pl.Int64) for c in ("x_mm", "y_mm"))
    o = stored.select("camera_id", pl.col("ts").dt.epoch("ms").alias("ts_ms"), *places)
    o = o.with_row_index("n").collect().lazy()

    def counts(rows: Any, x: Any, y: Any, n_mm: int, name: str) -> Any:
        hour = pl.col("ts_ms") // HOUR_MS
        keys = [hour.alias("hour"), (x // n_mm).alias("cx"), (y // n_mm).alias("cy")]
        return rows.group_by(keys).agg(pl.len().cast(pl.Int64).alias(name))

    persons = counts(o, pl.col("x_mm"), pl.col("y_mm"), CELL_MM, "persons")
    both = o.join(o, on=["camera_id", "ts_ms"], suffix="_b").filter(
        (pl.col("n") < pl.col("n_b"))
        & ((pl.col("x_mm") - pl.col("x_mm_b")) ** 2 + (pl.col("y_mm") - pl.col("y_mm_b")) ** 2 < CLOSE_MM**2)
    )
    x, y = (pl.col(f"{c}_mm") + pl.col(f"{c}_mm_b") for c in "xy")
    pairs = counts(both, x, y, 2 * CELL_MM, "pairs")
    found = pl.concat([persons, pairs], how="diagonal").fill_null(0).collect(engine="streaming")
    sums = [pl.col("persons").sum(), pl.col("pairs").sum()]
    cells, hours = found.group_by("cx", "cy").agg(sums), found.group_by("hour").agg(sums)
    return CountedCells(cells.to_numpy().astype(np.int64), hours.to_numpy().astype(np.int64))


def pandas_numpy(root: Path) -> CountedCells:
    """Answer with pandas and numpy, one file of an hour after the other; `numpy.bincount` counts."""
    cells = np.zeros((2, _COLUMNS * _ROWS), dtype=np.int64)

    def add(kind: int, cx: Ints, cy: Ints) -> None:
        cells[kind] += np.bincount(cy * _COLUMNS + cx, minlength=_COLUMNS * _ROWS)

    hours = _fill(root, add)
    return _gridded(cells.reshape(2, _ROWS, _COLUMNS).transpose(0, 2, 1), hours)


def boost_histogram(root: Path) -> CountedCells:
    """Answer with histograms of boost-histogram, filled hour by hour; pandas reads and numpy finds the pairs."""
    import boost_histogram as bh

    axes = (bh.axis.Integer(0, _COLUMNS), bh.axis.Integer(0, _ROWS))
    histograms = [bh.Histogram(*axes, storage=bh.storage.Int64()) for _ in range(2)]
    hours = _fill(root, lambda kind, cx, cy: histograms[kind].fill(cx, cy))
    return _gridded(np.stack([h.view() for h in histograms]), hours)


HEATMAPS: Final[Mapping[str, Callable[[Path], CountedCells | None]]] = {
    "raw scan of four columns, DuckDB": duckdb_scan,
    "vsd, first time: heatmap and hours": ours_first,
    "vsd, all facts, then heatmap and hours": ours_whole,
    "vsd, again": ours_again,
    "DuckDB, a query of one's own": duckdb_sql,
    "polars": polars_frames,
    "pandas and numpy": pandas_numpy,
    "boost-histogram": boost_histogram,
}
"""By name as the table prints it; the first is the floor, which answers nothing."""


def _duckdb() -> Any:
    from vsd_analytics.store.duck import connect

    return connect()


def _matrix(table: Any) -> Ints:
    columns = [column.to_numpy().astype(np.int64) for column in table.columns]
    return np.stack(columns, axis=1) if table.num_rows else np.zeros((0, table.num_columns), dtype=np.int64)


def _fill(root: Path, add: Callable[[int, Ints, Ints], object]) -> dict[int, list[int]]:
    """Call `add(0, cx, cy)` for the persons and `add(1, cx, cy)` for the pairs of each file; return counts by hour."""
    import pandas as pd

    hours: dict[int, list[int]] = {}
    for path in files(root):
        rows = pd.read_parquet(path, columns=["camera_id", "ts", "x_mm", "y_mm"], partitioning=None)
        rows = rows.sort_values(["camera_id", "ts"], kind="stable")
        ts_ms = rows["ts"].astype("int64").to_numpy()
        camera = rows["camera_id"].astype("category").cat.codes.to_numpy()
        x, y = (rows[c].to_numpy().astype(np.int64) for c in ("x_mm", "y_mm"))
        frame = np.cumsum(np.append(True, (ts_ms[1:] != ts_ms[:-1]) | (camera[1:] != camera[:-1])))
        near: list[tuple[Ints, Ints]] = []
        for k in range(1, int(np.bincount(frame).max())):  # every person with the k-th after it in the frame
            a = np.flatnonzero(frame[k:] == frame[:-k])
            a = a[(x[a] - x[a + k]) ** 2 + (y[a] - y[a + k]) ** 2 < CLOSE_MM**2]
            near.append((a, a + k))
        a, b = (np.concatenate(side) for side in zip(*near, strict=True))
        add(0, x // CELL_MM + _BEFORE, y // CELL_MM + _BEFORE)
        add(1, (x[a] + x[b]) // (2 * CELL_MM) + _BEFORE, (y[a] + y[b]) // (2 * CELL_MM) + _BEFORE)
        for kind, at in enumerate((ts_ms, ts_ms[a])):
            first = int(ts_ms.min()) // HOUR_MS
            for n, found in enumerate(np.bincount(at // HOUR_MS - first).tolist()):
                hours.setdefault(first + n, [0, 0])[kind] += found
    return hours


def _gridded(counts: NDArray[Any], hours: Mapping[int, list[int]]) -> CountedCells:
    """Return the answer from counts of persons and pairs in a grid of columns and rows."""
    cx, cy = np.nonzero(counts.sum(axis=0))
    cells = np.column_stack([cx - _BEFORE, cy - _BEFORE, counts[0][cx, cy], counts[1][cx, cy]]).astype(np.int64)
    return CountedCells(cells, np.array([(h, *n) for h, n in sorted(hours.items()) if any(n)], dtype=np.int64))
