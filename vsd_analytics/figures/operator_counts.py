"""Plain figures for people and notebooks: hours, coverage, heatmaps; exact counts, for the operator's own eyes."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime, tzinfo
from typing import TYPE_CHECKING, Any, Final, Literal

from vsd_analytics.errors import UsageError
from vsd_analytics.settings import FLOOR_CELL_M
from vsd_analytics.site.places import known_floor
from vsd_analytics.warehouse.warehouse import Warehouse

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

At = Literal["midpoint", "person"]
CELL_MAX_M: Final = 1000.0
"""Larger cells are larger than any floor."""
ROUNDING: Final = 1e-9

_BY: dict[str | None, str] = {
    None: (
        "select hour_start_ms, person_records, violation_records, n_violations, recorded_s, recorded_share, open_s, "
        "exposure_s, violation_s, cameras_down, is_inferred, state from hours order by hour_start_ms"
    ),
    "camera": (
        "select hour_start_ms, camera_id, person_records, violation_records, n_violations, recorded_s, open_s, "
        "exposure_s, violation_s, is_inferred from camera_hours order by hour_start_ms, camera_no"
    ),
    "area": (
        "select hour_start_ms, floor_id, area_id, sum(exposure_open_s) as exposure_s, "
        "sum(violation_open_s) as violation_s, sum(n_violations_open)::bigint as n_violations "
        "from area_hours group by all order by hour_start_ms, floor_id, area_id"
    ),
}
QUARTER_HOUR_MIN: Final = 15
_QUARTER_HOURS: Final = (
    "select quarter * 900000 as start_ms, person_records, violation_records, n_violations, recorded_s, recorded_share, "
    "open_s, exposure_s, violation_s, cameras_down, state from quarter_hours order by quarter"
)


def check_cell_m(cell_m: float) -> None:
    """Refuse a side of cells that stored cells do not add up to.

    Raises:
        UsageError: E101, it is no multiple of `FLOOR_CELL_M` up to 1 km.
    """
    n_stored = cell_m / FLOOR_CELL_M
    if not 0 < cell_m <= CELL_MAX_M or abs(n_stored - round(n_stored)) > ROUNDING:
        raise UsageError(
            f"a cell of {cell_m:g} m is not a multiple of {FLOOR_CELL_M:g} m", fix="--cell 0.5", in_python="cell_m=0.5"
        )


def begun_until_ms(warehouse: Warehouse, *, now: datetime) -> int | None:
    """Return the UTC start of the first hour of a range that is not over, or None when all are.

    Args:
        warehouse: The range.
        now: The clock. Where records are ahead of it (of a demo, say) it says nothing, and all hours count as over.
    """
    (row,) = warehouse.rows(
        "select min(hour_start_ms) filter (hour_start_ms + length_s * 1000 > $now_ms) as not_over_ms, "
        "max(hour_start_ms) filter (recorded_s > 0) as recorded_ms from hours",
        {"now_ms": now.timestamp() * 1000},
    )
    is_ahead = row["recorded_ms"] is not None and row["recorded_ms"] > now.timestamp() * 1000
    return None if row["not_over_ms"] is None or is_ahead else int(row["not_over_ms"])


def silent_cameras(warehouse: Warehouse) -> list[str]:
    """Return the ids of cameras that recorded nothing in a range in which others did."""
    there = "select camera_id, max(recorded_s) as recorded_s from camera_hours where length_s > 0 group by 1 order by 1"
    rows = warehouse.rows(there)
    silent = [row["camera_id"] for row in rows if not row["recorded_s"]]
    return silent if len(silent) < len(rows) else []


def hours(
    warehouse: Warehouse, *, by: Literal["camera", "area"] | None = None, until_ms: int | None = None
) -> pd.DataFrame:
    """Return the hourly table of a range.

    Args:
        warehouse: The range.
        by: None for the whole site, "camera", or "area" (opening hours only).
        until_ms: Leave out unrecorded hours from this UTC instant on, see `begun_until_ms`; None = none.

    Returns:
        One row per local hour (and camera or area): `start` (ISO, local with offset), `person_records`,
        `violation_records`, `n_violations`, `recorded_s` (mean over cameras), `recorded_share`, `open_s`, `exposure_s`
        (person-seconds), `violation_s` (person-seconds), `cameras_down`, `is_inferred`, `state`. Counts of an
        hour in which nothing was recorded are missing, never 0.

    Example:
        >>> hours = vsd.hours(warehouse)
        >>> len(hours), hours["start"].iloc[0]
        (168, '2026-11-09T00:00:00+01:00')
    """
    frame = warehouse.frame(_BY[by])
    recorded: list[int] = []
    if until_ms is not None:
        recorded = [r["ms"] for r in warehouse.rows("select hour_start_ms as ms from hours where recorded_s > 0")]
    return _begun(warehouse, frame.rename(columns={"hour_start_ms": "start_ms"}), until_ms, recorded)


def quarter_hours(warehouse: Warehouse, *, until_ms: int | None = None) -> pd.DataFrame:
    """Return the table of a range by quarter-hours, over all cameras; columns and `until_ms` as in `hours`."""
    frame = warehouse.frame(_QUARTER_HOURS)
    return _begun(warehouse, frame, until_ms, frame["start_ms"][frame["recorded_s"] > 0])


def _begun(warehouse: Warehouse, frame: pd.DataFrame, until_ms: int | None, recorded: Iterable[int]) -> pd.DataFrame:
    """Return rows that began before an instant or were recorded, with their start as ISO, local with offset."""
    if until_ms is not None:
        frame = frame[(frame["start_ms"] < until_ms) | frame["start_ms"].isin(list(recorded))].reset_index(drop=True)
    zone = warehouse.site.zone
    starts = [local_iso(zone, ms) for ms in frame.pop("start_ms")]
    frame.insert(0, "start", starts)
    counts = [c for c in ("person_records", "violation_records", "n_violations") if c in frame]
    return frame.astype(dict.fromkeys(counts, "Int64"))


def heatmap(warehouse: Warehouse, *, floor_id: str | None = None, at: At = "midpoint") -> pd.DataFrame:
    """Return violation records per heat cell of one floor.

    Args:
        warehouse: The range; `heat_cell_m` was given when it was opened.
        floor_id: Floor; None when there is only one.
        at: "midpoint" counts pair records at the middle of the pair; "person" counts person records in violation at the
            place of the person.

    Returns:
        Columns cx, cy (floor(x / cell), floor(y / cell)), records, exposure_s (person-seconds spent in the cell); one
        row per cell in which anybody stood or a record lies, by cy then cx.

    Raises:
        UsageError: E101, there are several floors and none is named.

    Example:
        >>> list(vsd.heatmap(warehouse).columns)
        ['cx', 'cy', 'records', 'exposure_s']
    """
    floor = known_floor(warehouse.site, floor_id)
    column = {"midpoint": "violation_records", "person": "violation_persons"}[at]
    return warehouse.frame(
        f"select cx, cy, {column} as records, exposure_s from heatmap where floor_id = $floor order by cy, cx",
        {"floor": floor.floor_id},
    )


def coverage(warehouse: Warehouse, *, until_ms: int | None = None) -> dict[str, Any]:
    """Return how much of the opening time was recorded.

    Args:
        warehouse: The range.
        until_ms: Hours from this UTC instant on are not over: neither recorded nor missing; see `begun_until_ms`.

    Returns:
        `cameras`: per camera `camera_id`, `name`, `share`, `recorded_h`, `scheduled_h`, `days` (date, share or None
        when closed, recorded_h, scheduled_h); `outages`: camera_id, start, end, open_h, is_inferred; `share` over all;
        `gaps`: camera_id, start (last message before), end (first after), n_missing, first_missing, last_missing
        (running numbers); `n_missing` over all, None when no engine numbers its messages; `restarts`: camera_id, start
        and end of each restart of an engine's count, around which losses are unknown.

    Example:
        >>> [camera["camera_id"] for camera in vsd.coverage(warehouse)["cameras"]]
        ['cam-1', 'cam-2', 'cam-3', 'cam-4']
    """
    days = warehouse.rows(
        "select camera_id, local_date, sum(recorded_open_s) / 3600 as recorded_h, sum(open_s) / 3600 as scheduled_h "
        "from camera_hours where $until_ms is null or hour_start_ms < $until_ms group by all order by local_date",
        {"until_ms": until_ms},
    )
    outages = _outages(warehouse, until_ms)
    numbers = warehouse.rows("select * from message_gaps")
    gaps = [row for row in numbers if not row["is_restart"]]
    is_numbered = bool(warehouse.rows("select 1 from sequence_runs limit 1"))
    cameras = []
    for camera in warehouse.site.cameras:
        own = [d for d in days if d["camera_id"] == camera.camera_id]
        recorded, scheduled = (sum(d[k] for d in own) for k in ("recorded_h", "scheduled_h"))
        cameras.append(
            {
                "camera_id": camera.camera_id,
                "name": camera.name,
                "share": recorded / scheduled if scheduled else None,
                "recorded_h": recorded,
                "scheduled_h": scheduled,
                "days": [
                    {
                        "date": d["local_date"].isoformat(),
                        "share": d["recorded_h"] / d["scheduled_h"] if d["scheduled_h"] else None,
                        "recorded_h": d["recorded_h"],
                        "scheduled_h": d["scheduled_h"],
                    }
                    for d in own
                ],
            }
        )
    scheduled = sum(c["scheduled_h"] for c in cameras)
    return {
        "share": sum(c["recorded_h"] for c in cameras) / scheduled if scheduled else None,
        "cameras": cameras,
        "outages": [
            {
                "camera_id": o["camera_id"],
                "start": local_iso(warehouse.site.zone, o["started_ms"]),
                "end": local_iso(warehouse.site.zone, o["ended_ms"]),
                "open_h": o["open_s"] / 3600,
                "is_inferred": o["is_inferred"],
            }
            for o in outages
        ],
        "n_missing": sum(row["n_missing"] for row in gaps) if is_numbered else None,
        "gaps": [
            {**_between(warehouse, row), **{k: row[k] for k in ("n_missing", "first_missing", "last_missing")}}
            for row in gaps
        ],
        "restarts": [_between(warehouse, row) for row in numbers if row["is_restart"]],
    }


def camera_days(warehouse: Warehouse) -> pa.Table:
    """Return one row per camera and local day: `camera_id`, `local_date`, `open_h`, `recorded_h` of its open hours."""
    return warehouse.table(
        "select camera_id, local_date, sum(open_s) / 3600 as open_h, sum(recorded_open_s) / 3600 as recorded_h "
        "from camera_hours group by all order by camera_id, local_date"
    )


def recorded_hours(warehouse: Warehouse) -> list[dict[str, Any]]:
    """Return one row per camera and local hour: `camera_id`, `local_date`, `local_hour`, `open_s`, `recorded_s`."""
    return warehouse.rows(
        "select camera_id, local_date, local_hour, sum(open_s)::double as open_s, "
        "coalesce(sum(recorded_open_s), 0)::double as recorded_s "
        "from camera_hours group by all order by local_date, local_hour"
    )


def n_violations_in(warehouse: Warehouse) -> int:
    """Return the violations of a range, in all its hours."""
    [row] = warehouse.rows("select coalesce(sum(n_violations), 0)::bigint as n from hours")
    return int(row["n"])


def last_recorded_ms(warehouse: Warehouse) -> int | None:
    """Return when the last record of a range was (UTC milliseconds); None without any."""
    [row] = warehouse.rows("select max(ended_ms) as ms from recorded_spans")
    return None if row["ms"] is None else int(row["ms"])


def _outages(warehouse: Warehouse, until_ms: int | None) -> list[dict[str, Any]]:
    """Return the outages of a range without what lies in hours that are not over."""
    outages = warehouse.rows("select * from outages")
    if until_ms is None:
        return outages
    open_s = {row["hour_start_ms"]: row["open_s"] for row in warehouse.rows("select hour_start_ms, open_s from hours")}
    known_outages = []
    for outage in outages:
        later_s = sum(s for ms, s in open_s.items() if until_ms <= ms < outage["ended_ms"])
        if outage["started_ms"] < until_ms and (rest_s := outage["open_s"] - later_s) > 0:
            known_outages.append({**outage, "ended_ms": min(outage["ended_ms"], until_ms), "open_s": rest_s})
    return known_outages


def _between(warehouse: Warehouse, row: dict[str, Any]) -> dict[str, Any]:
    """Return the camera of a row of `message_gaps` and the messages on either side, as local ISO instants."""
    start, end = (
        local_instant(warehouse.site.zone, row[k]).isoformat(timespec="milliseconds")
        for k in ("started_ms", "ended_ms")
    )
    return {"camera_id": row["camera_id"], "start": start, "end": end}


def local_instant(zone: tzinfo, ms: int) -> datetime:
    """Return an instant (UTC milliseconds) in a zone."""
    return datetime.fromtimestamp(ms / 1000, tz=zone)


def local_iso(zone: tzinfo, ms: int) -> str:
    """Return an instant (UTC milliseconds) as ISO 8601 with the offset of a zone."""
    return local_instant(zone, int(ms)).isoformat(timespec="seconds")
