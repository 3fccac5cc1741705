"""Stored tracks of one camera in floor metres, in the columns that PedPy and movingpandas read."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import date, datetime, time, timedelta

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from vsd_analytics.api.table import Table
from vsd_analytics.errors import UsageError
from vsd_analytics.geometry.homography import to_floor
from vsd_analytics.schema import SCHEMAS
from vsd_analytics.site.cameras_by_name import nearest_camera_id
from vsd_analytics.site.model import Camera, Site
from vsd_analytics.store.erasures import RecordScope
from vsd_analytics.store.layout import HOUR_MS
from vsd_analytics.store.part_files import read_part
from vsd_analytics.store.removal import reading
from vsd_analytics.store.store import Store


class TrackTable(Table):
    """Positions of tracked people: `id`, `frame`, `x`, `y` (metres), `t` (UTC, without zone), `track_id`.

    Attributes:
        frame_rate_hz: Frames per second: `frame` counts them from the first record.

    Example:
        >>> walks = site.days("2026-11-09").tracks("cam-1")
        >>> walks.columns
        ['id', 'frame', 'x', 'y', 't', 'track_id']
    """

    def __init__(self, rows: pa.Table, *, title: str, note: str, frame_rate_hz: float) -> None:
        super().__init__(rows, title=title, note=note)
        self.frame_rate_hz = frame_rate_hz


def tracks(site: Site, camera_id: str | None, *, first: date, last: date) -> TrackTable:
    """Return the tracks that a camera recorded on some local days.

    Pixels become metres by the calibration in force. Records without a track id or a place are left out, and so is a
    second record of the same person in a frame; the note counts them.

    Args:
        site: The project.
        camera_id: The camera; None where there is only one.
        first: First local day.
        last: Last local day, inclusive.

    Raises:
        UsageError: E101, there is no such camera.
    """
    camera = _camera(site, camera_id)
    midnights = [datetime.combine(d, time(), tzinfo=site.zone) for d in (first, last + timedelta(days=1))]
    scope = RecordScope(camera.camera_id, *(round(m.timestamp() * 1000) for m in midnights))
    rows = pa.concat_tables([SCHEMAS["observations"].empty_table(), *_stored(site, scope)])
    rows = rows.sort_by([("ts", "ascending"), ("person", "ascending")])
    n_all = rows.num_rows
    ts_ms = rows["ts"].cast(pa.int64()).to_numpy()
    x_m, y_m = _metres(rows, ts_ms, camera)
    has_all = np.isfinite(x_m) & rows["track_id"].is_valid().to_numpy()
    rows, ts_ms, x_m, y_m = rows.filter(pa.array(has_all)), ts_ms[has_all], x_m[has_all], y_m[has_all]
    hz = camera.hz or _median_hz(ts_ms)
    frame = np.round((ts_ms - (ts_ms[0] if ts_ms.size else 0)) * hz / 1000).astype(np.int64)
    track = rows["track_id"].cast(pa.string()).combine_chunks().dictionary_encode()
    ids = track.indices.to_numpy(zero_copy_only=False).astype(np.int64)
    _, is_first = np.unique(np.stack([ids, frame], axis=1), axis=0, return_index=True)
    table = pa.table(
        {
            "id": ids,
            "frame": frame,
            "x": x_m,
            "y": y_m,
            "t": pa.array(ts_ms, pa.timestamp("ms")),
            "track_id": track.cast(pa.string()),
        }
    ).take(pa.array(is_first))
    left_out = n_all - table.num_rows
    note = f"{left_out:,} records without track or place, or second in their frame, are left out" if left_out else ""
    return TrackTable(table, title=f"Tracks of {camera.name}, {first}..{last}", note=note, frame_rate_hz=hz)


def _camera(site: Site, camera_id: str | None) -> Camera:
    cameras = {c.camera_id: c for c in site.cameras}
    if camera_id is None and len(cameras) == 1:
        return site.cameras[0]
    if camera_id not in cameras:
        what = "which camera?" if camera_id is None else f"there is no camera {camera_id!r}"
        near = nearest_camera_id(camera_id or "", site.cameras) or next(iter(cameras), None)
        raise UsageError(what, why=f"this site has {', '.join(cameras)}", fix=f'tracks("{near}")')
    return cameras[camera_id]


def _stored(site: Site, scope: RecordScope) -> Iterator[pa.Table]:
    store = Store(site.root / "store", site_id=site.site_id)
    if store.n_spooled():
        store.fold()
    hours = {"first_hour": scope.first_ms // HOUR_MS, "last_hour": (scope.after_ms - 1) // HOUR_MS}
    with reading(store.root), store.reporting_damage():
        for part in store.parts("observations", **hours):
            rows = read_part(part.path, "observations")
            yield rows.filter(scope.mask(rows))


def _metres(
    rows: pa.Table, ts_ms: NDArray[np.int64], camera: Camera
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions as sent, else feet in the picture through the calibration in force; NaN where unknown."""
    x_m, y_m, u, v = (pc.cast(rows[name], pa.float64()).to_numpy() for name in ("x_mm", "y_mm", "u_px", "v_px"))
    x_m, y_m = x_m / 1000, y_m / 1000
    for calibration in camera.calibrations:  # in order of time: each replaces the one before
        from_ms = -np.inf if calibration.valid_from is None else calibration.valid_from.timestamp() * 1000
        has_px = rows["x_mm"].is_null().to_numpy() & np.isfinite(u) & (ts_ms >= from_ms)
        if has_px.any():
            px = np.stack([u[has_px], v[has_px]], axis=1)
            xy = to_floor(calibration.homography, px, picture_px=camera.picture_px)
            x_m[has_px], y_m[has_px] = xy[:, 0], xy[:, 1]
    return x_m, y_m


def _median_hz(ts_ms: NDArray[np.int64]) -> float:
    steps = np.diff(np.unique(ts_ms))
    return 1000 / float(np.median(steps)) if steps.size else 1.0
