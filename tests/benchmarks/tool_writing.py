"""How long each tool takes to write the same person records in batches of 10,000, as an engine sends them."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from made_up_site import CAMERAS, FIRST_MS, camera_hour

BATCH_ROWS: Final = 10_000


def records(n_records: int, *, seed: int = 1) -> pa.Table:
    """Return person records of the made-up site in the order in which engines send them: by second, then by camera."""
    rng, pieces, n = np.random.default_rng(seed), list[pa.Table](), 0
    for number in itertools.count():
        start_ms = FIRST_MS + 3_600_000 * (number // CAMERAS)
        rows = dict(camera_hour(rng, number % CAMERAS, start_ms, most=n_records))["observations"]
        pieces.append(rows)
        n += rows.num_rows
        if n >= n_records:
            break
    return pa.concat_tables(pieces).sort_by([("ts", "ascending"), ("camera_id", "ascending")]).slice(0, n_records)


def one_file(rows: pa.Table, folder: Path) -> None:
    """Write one Parquet file with pyarrow, and wait for the disk: no store that keeps the records can be faster."""
    path = folder / "rows.parquet"
    pq.write_table(rows, path)
    with path.open("rb") as file:
        os.fsync(file.fileno())


def ours_append(rows: pa.Table, folder: Path) -> None:
    """Append batches to the store; each is on disk before the next one is taken."""
    from vsd_analytics.store.store import Store

    store = Store(folder / "store", site_id="bench")
    for batch in _batches(rows):
        store.append("observations", batch)


def ours_fold(rows: pa.Table, folder: Path) -> None:
    """Append, then fold: find second deliveries, sort, and write the parts that reports read."""
    from vsd_analytics.store.store import Store

    ours_append(rows, folder)
    Store(folder / "store", site_id="bench").fold()


def delta_rs(rows: pa.Table, folder: Path) -> None:
    """Append batches to a Delta table; delta-rs does not wait for the disk."""
    from deltalake import write_deltalake

    for batch in _batches(rows):
        write_deltalake(str(folder / "table"), batch, mode="append")


WRITERS: Final[Mapping[str, Callable[[pa.Table, Path], None]]] = {
    "one Parquet file, pyarrow, synced": one_file,
    "vsd, append, each batch synced": ours_append,
    "vsd, append and fold": ours_fold,
    "delta-rs, append, nothing synced": delta_rs,
}
"""By name as the table prints it; the first is the floor."""


def _batches(rows: pa.Table) -> list[pa.Table]:
    return [rows.slice(first, BATCH_ROWS) for first in range(0, rows.num_rows, BATCH_ROWS)]
