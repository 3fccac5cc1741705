"""Records from before a camera came, or from after it went: `from` and `to` of its `[[camera]]`."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.site.instants import day_start_ms
from vsd_analytics.site.model import Site
from vsd_analytics.store.camera_floors import note_floors

NOT_THERE: Final = "camera-not-there"


class DescribedLives:
    """The lives of those cameras of a site that have a first or a last day; false where none has.

    Args:
        site: The project.

    Attributes:
        detail: What is wrong with a record outside, in words.
    """

    def __init__(self, site: Site) -> None:
        limited = [c for c in site.cameras if c.first_day is not None or c.end_day is not None]
        self._lives = {
            c.camera_id: tuple(None if d is None else day_start_ms(d, site.zone) for d in (c.first_day, c.end_day))
            for c in limited
        }
        spans = (f"{c.camera_id}: {c.first_day or '…'} to {c.end_day or '…'}" for c in limited[:12])
        self.detail = f"its camera was not there, by from and to in vsd.toml ({'; '.join(spans)})"

    def __bool__(self) -> bool:
        return bool(self._lives)

    def are_outside(self, rows: pa.Table) -> pa.Array:
        """Return which rows (`camera_id`, and `ts_ms` or `ts`) are outside the life of their camera."""
        ts_ms = rows["ts_ms"] if "ts_ms" in rows.column_names else rows["ts"].cast(pa.int64())
        instants = pc.fill_null(ts_ms, 0).to_numpy()
        cameras = rows["camera_id"].cast(pa.string())
        is_outside = np.zeros(rows.num_rows, dtype=np.bool_)
        for camera_id, (first_ms, end_ms) in self._lives.items():
            is_its = pc.fill_null(pc.equal(cameras, camera_id), False).to_numpy(zero_copy_only=False)
            if first_ms is not None:
                is_outside |= is_its & (instants < first_ms)
            if end_ms is not None:
                is_outside |= is_its & (instants >= end_ms)
        return pa.array(is_outside)


def note_floors_of(site: Site, cameras: Collection[str]) -> None:
    """Note on which floors cameras are whose records were stored just now; see `store.camera_floors`."""
    floors = {camera_id: site.camera(camera_id).floor_id for camera_id in cameras}
    note_floors(site.root / "store", floors, described={floor.floor_id for floor in site.floors})
