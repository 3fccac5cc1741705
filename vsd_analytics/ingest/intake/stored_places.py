"""Records that are stored already and come again at other places, as a corrected export brings them (W230)."""

from __future__ import annotations

import contextlib
from datetime import datetime
from pathlib import Path
from typing import Final

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from vsd_analytics.schema import PLACES
from vsd_analytics.site.model import Site
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.store.owners import OWNER
from vsd_analytics.store.part_files import read_owned
from vsd_analytics.store.removal import reading
from vsd_analytics.store.store import Store

ROWS_MAX: Final = 2_000
KNOWN_MIN: Final = 10
"""Fewer records that are stored already show no pattern."""
MOVED_SHARE: Final = 0.5
NEAR: Final = 10
"""Millimetres or pixels: an export with rounded places has the same places."""
_KEY: Final = ["camera_id", "ts", "track_id"]
_PLACE: Final = list(PLACES["observations"])


def note_of_other_places(site: Site, rows: pa.Table) -> str | None:
    """Return the warning that most of some records that are stored already come at other places now, or None.

    A record with a track id is identified by camera, instant and id. One that comes again is left out, so a corrected
    export would change nothing, and nobody would notice. The first `ROWS_MAX` records of the busiest UTC hour are
    looked at.

    Args:
        site: The site.
        rows: Normalised rows of the table observations.

    Raises:
        StoreError: E311, a removal did not end in time.
    """
    rows = rows.filter(pc.is_valid(rows["track_id"]))
    if not rows.num_rows:
        return None
    hour_of_row = rows["ts"].cast("int64").to_numpy() // HOUR_MS
    hours, n_of_hour = np.unique(hour_of_row, return_counts=True)
    hour = int(hours[np.argmax(n_of_hour)])
    rows = rows.filter(pa.array(hour_of_row == hour)).slice(0, ROWS_MAX)
    first, last = pc.min_max(rows["ts"]).as_py().values()
    store = Store(site.root / "store", site_id=site.site_id)
    stored = []
    with reading(store.root), contextlib.suppress(pa.ArrowException, ValueError, OSError):  # the fold reports damage
        parts = [part.path for part in store.parts("observations", first_hour=hour, last_hour=hour)]
        stored = [read_owned(path, "observations") for path in parts if _overlaps(path, first, last)]
    if not stored:
        return None
    there = pa.concat_tables(stored).select([*_KEY, *_PLACE, OWNER])
    there = there.filter((pc.field("ts") >= first) & (pc.field("ts") <= last)).to_pandas()
    here = rows.select([*_KEY, *_PLACE]).to_pandas()
    both = here.merge(there, on=_KEY, suffixes=("", "_stored"))
    moved = both[np.logical_or.reduce([_differs(both[name], both[f"{name}_stored"]) for name in _PLACE])]
    if len(both) < KNOWN_MIN or len(moved) <= MOVED_SHARE * len(both):
        return None
    owner = str(moved[OWNER].mode()[0])
    remedy = f"--import {owner}" if owner else "--camera and --range, then the import again"
    return (
        f"W230: {len(moved):,} of {len(both):,} records that were compared are stored already, at other places, and "
        f"their first places stay; vsd purge {remedy} puts the new places in"
    )


def _overlaps(path: Path, first: datetime, last: datetime) -> bool:
    """Return whether a part may have records from one instant to another, by its statistics."""
    metadata = pq.read_metadata(path)
    at = metadata.schema.names.index("ts")
    groups = [metadata.row_group(i).column(at).statistics for i in range(metadata.num_row_groups)]
    return any(s is None or not s.has_min_max or (s.min <= last and s.max >= first) for s in groups)


def _differs(new: pd.Series, stored: pd.Series) -> NDArray[np.bool_]:
    one, other = (values.to_numpy(dtype=float, na_value=np.nan) for values in (new, stored))
    return np.asarray((np.isnan(one) != np.isnan(other)) | (np.abs(one - other) > NEAR))
