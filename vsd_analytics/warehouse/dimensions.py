"""The small tables every query can join: params, cameras, calibrations, owner cells, quarters, calendar, areas."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from datetime import UTC, date, datetime, timedelta
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vsd_analytics.settings import BY_NAME, DEFAULTS, FLOOR_CELL_M, OWNER_CELL_M, SETTINGS
from vsd_analytics.site.calendar import Opening
from vsd_analytics.site.model import Camera, Point, Site
from vsd_analytics.site.places import joined_floors
from vsd_analytics.warehouse.count_lines import count_lines, line_parts
from vsd_analytics.warehouse.counter_lines import counter_lines
from vsd_analytics.warehouse.owner_spans import FOREVER_MS, calibration_spans, camera_life, day_start_ms, owner_spans
from vsd_analytics.warehouse.rules import RULES

if TYPE_CHECKING:
    import duckdb


Ints = NDArray[np.int64]
QUARTER_MS = 900_000
_CAMERAS = pa.schema(
    [
        ("camera_id", pa.string()),
        ("camera_no", pa.int32()),
        ("name", pa.string()),
        ("floor_id", pa.string()),
        ("interval_ms", pa.int64()),
        ("from_ms", pa.int64()),
        ("to_ms", pa.int64()),
    ]
)
_CALIBRATIONS = pa.schema(
    [("camera_id", pa.string()), ("from_ms", pa.int64()), ("to_ms", pa.int64()), ("calibration_id", pa.string())]
    + [(f"h{i}{j}", pa.float64()) for i in (1, 2, 3) for j in (1, 2, 3)]
    + [("w_sign", pa.float64())]
)
_OWNERS = pa.schema(
    [
        ("floor_id", pa.string()),
        ("from_ms", pa.int64()),
        ("to_ms", pa.int64()),
        ("camera_id", pa.string()),
        ("cx", pa.int32()),
        ("cy", pa.int32()),
    ]
)
_AREA_CELLS = _OWNERS.set(3, pa.field("area_id", pa.string()))
_CALENDAR = pa.schema(
    [
        ("quarter", pa.int64()),
        ("local_date", pa.date32()),
        ("local_hour", pa.int32()),
        ("fold", pa.int32()),
        ("weekday", pa.int32()),
        ("hour_start_ms", pa.int64()),
        ("offset_min", pa.int32()),
        ("is_open", pa.bool_()),
    ]
)
_SITE_DAYS = pa.schema([("quarter", pa.int64()), ("site_day", pa.date32())])
_AREAS = pa.schema(
    [
        ("area_id", pa.string()),
        ("area_no", pa.int32()),
        ("name", pa.string()),
        ("floor_id", pa.string()),
        ("is_door", pa.bool_()),
        ("is_staff", pa.bool_()),
        ("is_queue", pa.bool_()),
        ("served_in", pa.string()),
    ]
)
_FLOORS = pa.schema([("floor_id", pa.string())])
STAFF = pa.schema([("hour", pa.int64()), ("camera_id", pa.string()), ("track_id", pa.string())])


def params(site: Site, *, heat_cell_m: float = 1.0) -> dict[str, Any]:
    """Return the one-row relation `params`: the settings and rules that SQL reads, sizes of cells, hours of a bucket.

    Metres become whole millimetres and seconds whole milliseconds, also in the name: `distance_m` is `distance_mm`.

    Args:
        site: Its settings are used.
        heat_cell_m: Side of the cells of the mart `heatmap`, a multiple of `FLOOR_CELL_M`.
    """
    values = site.settings.values
    return {
        **dict(_param(s.name, values[s.name]) for s in SETTINGS if s.is_in_sql),
        "cell_mm": round(FLOOR_CELL_M * 1000),
        "owner_cell_mm": round(OWNER_CELL_M * 1000),
        "heat_cell_mm": round(heat_cell_m * 1000),
        "bucket_quarters": bucket_quarters(site),
        **RULES,
    }


def _param(name: str, value: Any) -> tuple[str, int | float | str]:
    """Return name and value of a setting as SQL reads it."""
    stem, _, unit = name.rpartition("_")
    if unit in ("m", "s"):
        return f"{stem}_m{unit}", round(value * 1000)
    return name, value if isinstance(BY_NAME[name].default, int | str) else float(value)


def bucket_quarters(site: Site) -> int:
    """Return 4 where local hours and opening times fall on UTC hours, else 1 (zones or doors at half past)."""
    edges = [m for opening in site.hours.weeks for day in opening for span in day for m in span]
    return 4 if _has_whole_hours(site.timezone) and all(m % 60 == 0 for m in edges) else 1


@cache
def _has_whole_hours(timezone: str) -> bool:
    """Return whether local hours of the zone start on UTC hours, in all years from which records are accepted."""
    zone = ZoneInfo(timezone)
    first = datetime(DEFAULTS.earliest_year, 1, 1, tzinfo=UTC)
    offsets = {(first + timedelta(weeks=w)).astimezone(zone).utcoffset() for w in range(60 * 53)}
    return all(o is not None and o % timedelta(hours=1) == timedelta() for o in offsets)


def site_relations(site: Site, *, heat_cell_m: float = 1.0) -> dict[str, pa.Table]:
    """Return `params`, `cameras`, `calibrations`, `owner_cells`, `areas`, `area_cells` and cells that are asked for."""
    flags = ((a.is_door, a.is_staff, a.is_queue, a.served_in) for a in site.areas)
    areas = [
        (a.area_id, i, a.name, a.floor_id, *area_flags)
        for i, (a, area_flags) in enumerate(zip(site.areas, flags, strict=True))
    ]
    cells = area_cells(site)
    return {
        "params": pa.table({k: [v] for k, v in params(site, heat_cell_m=heat_cell_m).items()}),
        "cameras": camera_table(site),
        "calibrations": _calibration_table(site),
        "owner_cells": owner_cells(site),
        "areas": _table(_AREAS, areas),
        "area_cells": cells,
        "visit_cells": _of_areas(cells, areas_with_stays(site)),
        "count_cells": _of_areas(cells, areas_with_counts(site)),
        "count_floors": _table(_FLOORS, [(f.floor_id,) for f in site.floors if f.capacity is not None]),
        "count_lines": count_lines(site),
        "line_parts": line_parts(site),
        "counter_lines": counter_lines(site),
        "staff": STAFF.empty_table(),
        "staff_classes": pa.table({"class": pa.array(site.settings.staff_classes, pa.string())}),
        "joined_floors": _table(_FLOORS, [(floor_id,) for floor_id in joined_floors(site)]),
    }


def quarters(*, first_hour: int, last_hour: int) -> pa.Table:
    """Return the relation `quarters`: every UTC quarter-hour number of the hours in [first_hour, last_hour]."""
    return pa.table({"quarter": np.arange(first_hour * 4, last_hour * 4 + 4, dtype="int64")})


def register_site(con: duckdb.DuckDBPyConnection, site: Site, *, heat_cell_m: float = 1.0) -> None:
    """Create `site_relations`."""
    create_tables(con, site_relations(site, heat_cell_m=heat_cell_m))


def create_tables(con: duckdb.DuckDBPyConnection, tables: Mapping[str, pa.Table]) -> None:
    """Create tables of the names and rows given."""
    for name, rows in tables.items():
        con.register(f"_{name}", rows)
        con.execute(f"create or replace temp table {name} as select * from _{name}")
        con.unregister(f"_{name}")


def owner_cells(site: Site) -> pa.Table:
    """Return the relation `owner_cells`: which camera counts where the views of several overlap, by span of time."""
    rows: list[tuple[Any, ...]] = [
        (span.floor_id, span.from_ms, span.to_ms, cell.camera_id, cell.cx, cell.cy)
        for span in owner_spans(site)
        for cell in span.cells
    ]
    return _table(_OWNERS, rows)


def area_cells(site: Site) -> pa.Table:
    """Return the floor cells whose centre lies in each area, by span of time; the first in vsd.toml gets shared cells.

    A new span starts where an area begins or ends to count.
    """
    days = {day for area in site.areas for day in (area.first_day, area.end_day) if day is not None}
    starts = [-FOREVER_MS, *(day_start_ms(site, day) for day in sorted(days))]
    tables = [_AREA_CELLS.empty_table()]
    for from_ms, to_ms, day in zip(starts, [*starts[1:], FOREVER_MS], [date.min, *sorted(days)], strict=True):
        there = tuple((a.area_id, a.floor_id, a.polygon) for a in site.areas if a.is_there(day, day))
        for (area_id, floor_id, _), cells in zip(there, _shared_out(there), strict=True):
            names = ((floor_id, pa.string()), (from_ms, pa.int64()), (to_ms, pa.int64()), (area_id, pa.string()))
            same = [pa.repeat(pa.scalar(value, type), len(cells)) for value, type in names]
            tables.append(pa.table([*same, cells[:, 0], cells[:, 1]], schema=_AREA_CELLS))
    return pa.concat_tables(tables)


@lru_cache(maxsize=64)
def _shared_out(areas: tuple[tuple[str, str, tuple[Point, ...]], ...]) -> tuple[NDArray[np.int32], ...]:
    """Return the floor cells of each area (id, floor, corners) that none before it on the floor has, shape (n, 2).

    Held, since each question asks again, and an area of 5,000 m² has 80,000 cells.
    """
    taken: dict[str, NDArray[np.int64]] = {}
    shared = []
    for _, floor_id, polygon in areas:
        cells = _cells_in(polygon)
        before = taken.get(floor_id, np.zeros(0, np.int64))
        key = cells[:, 0].astype(np.int64) * 2**32 + cells[:, 1]
        is_own = ~np.isin(key, before)
        taken[floor_id] = np.concatenate([before, key[is_own]])
        shared.append(cells[is_own])
    return tuple(shared)


def _cells_in(corners: Sequence[Point]) -> NDArray[np.int32]:
    """Return the floor cells whose centre lies in a polygon, shape (n, 2)."""
    import shapely

    cell_m = FLOOR_CELL_M
    polygon = shapely.Polygon(corners)
    x0, y0, x1, y1 = polygon.bounds
    cx, cy = np.meshgrid(
        np.arange(np.floor(x0 / cell_m), np.ceil(x1 / cell_m)),
        np.arange(np.floor(y0 / cell_m), np.ceil(y1 / cell_m)),
    )
    inside = shapely.contains_xy(polygon, (cx + 0.5) * cell_m, (cy + 0.5) * cell_m)
    return np.stack([cx[inside], cy[inside]], axis=1).astype(np.int32)


def areas_with_stays(site: Site) -> frozenset[str]:
    """Return the areas whose visitors are followed: those of visits, queues, and staff, and where queues lead to."""
    visited = {a.area_id for a in site.areas if a.has_visits or a.is_staff}
    return frozenset(visited.union(*({a.area_id, a.served_in} for a in site.areas if a.served_in is not None)))


def areas_with_counts(site: Site) -> frozenset[str]:
    """Return the areas whose people are counted instant by instant: queues, and those with a capacity."""
    return frozenset(a.area_id for a in site.areas if a.is_queue or a.capacity is not None)


ASKED_TABLES = (
    "area_cells",
    "visit_cells",
    "count_cells",
    "count_floors",
    "count_lines",
    "line_parts",
    "joined_floors",
    "staff_classes",
)
"""Tables of what vsd.toml draws or asks. Facts that read some of them have no rows where all of these are empty."""


def asked_tables(site: Site) -> frozenset[str]:
    """Return those of `ASKED_TABLES` that have rows."""
    has_rows = (
        site.areas,
        areas_with_stays(site),
        areas_with_counts(site),
        any(f.capacity is not None for f in site.floors),
        *([any(not line.is_by_counter for line in site.lines)] * 2),
        joined_floors(site),
        site.settings.staff_classes,
    )
    return frozenset(name for name, is_asked in zip(ASKED_TABLES, has_rows, strict=True) if is_asked)


def _of_areas(cells: pa.Table, area_ids: Collection[str]) -> pa.Table:
    """Return the rows of `area_cells` of some areas."""
    import pyarrow.compute as pc

    return cells.filter(pc.is_in(cells["area_id"], pa.array(sorted(area_ids), pa.string())))


def calendar(site: Site, first: date, last: date) -> pa.Table:
    """Return the site's calendar: one row per UTC quarter-hour of the local days from `first` to `last`.

    A day has 92, 96 or 100 rows. They come from `zoneinfo`, so SQL needs no time-zone function.

    Args:
        site: The project.
        first: First local day.
        last: Last local day, inclusive.

    Returns:
        Columns quarter (UTC quarter-hours since 1970), local_date, local_hour (0 to 23), fold (1 in the second of two
        equal hours), weekday (1 Monday to 7 Sunday), hour_start_ms (UTC instant the local hour starts), offset_min
        (minutes east of UTC), is_open.
    """
    quarters, offset_s, fold = _local_quarters(site, first, last)
    local_s = quarters * 900 + offset_s
    hours, days = local_s // 3600, local_s // 86400
    begins = np.append(True, (np.diff(hours) != 0) | (np.diff(fold) != 0))
    hour_start_ms = quarters[np.maximum.accumulate(np.where(begins, np.arange(len(quarters)), 0))] * QUARTER_MS
    weekdays = (days + 3) % 7  # 1970 began on a Thursday
    opens = np.zeros(len(quarters), np.bool_)
    for since, opening in site.hours.spans:
        holds = days.astype("datetime64[D]") >= np.datetime64(since, "D")  # a later change writes over an earlier one
        times, at = np.unique(weekdays[holds] * 1440 + local_s[holds] % 86400 // 60, return_inverse=True)
        opens[holds] = np.array([_opens(opening, *divmod(int(time), 1440)) for time in times], np.bool_)[at]
    is_closed = np.isin(days, np.array(sorted(site.closed), "datetime64[D]").astype(np.int64))
    columns = (
        *(quarters, days.astype("datetime64[D]"), hours % 24, fold, weekdays + 1),
        *(hour_start_ms, offset_s // 60, opens & ~is_closed),
    )
    return pa.table([pa.array(c, type=f.type) for c, f in zip(columns, _CALENDAR, strict=True)], schema=_CALENDAR)


def site_days(site: Site, first: date, last: date) -> pa.Table:
    """Return the site day of each UTC quarter-hour, for the whole site days that touch local days `first` to `last`.

    A site day starts at `day_starts` local time and ends track ids (`ingest.pseudonyms`); columns quarter, site_day.
    """
    before = first - timedelta(days=1)
    quarters, offset_s, _ = _local_quarters(site, before, last + timedelta(days=1))
    days = ((quarters * 900 + offset_s - site.day_starts_min * 60) // 86400).astype("datetime64[D]")
    chosen = (np.datetime64(before, "D") <= days) & (days <= np.datetime64(last, "D"))
    columns = (quarters[chosen], days[chosen])
    return pa.table([pa.array(c, type=f.type) for c, f in zip(columns, _SITE_DAYS, strict=True)], schema=_SITE_DAYS)


def _local_quarters(site: Site, first: date, last: date) -> tuple[Ints, Ints, Ints]:
    """Return the UTC quarter-hours of local days, their offsets from UTC (seconds, east positive) and folds.

    The zone is asked every six hours, and every quarter-hour where two answers differ: to ask it always takes 15 times
    as long. A day before is asked too, since clocks set back shortly before the first day repeat an hour in it.
    """
    start, end = _quarter_at(first, site), _quarter_at(last + timedelta(days=1), site)
    quarters, zone = np.arange(start - 96, end), site.zone

    def offset_s(quarter: int) -> int:
        return round((datetime.fromtimestamp(quarter * 900, tz=zone).utcoffset() or timedelta()).total_seconds())

    asked = np.append(np.arange(start - 96, end - 1, 24), end - 1)
    answers = np.array([offset_s(int(q)) for q in asked])
    offsets = answers[np.searchsorted(asked, quarters, side="right") - 1]
    for k in np.flatnonzero(np.diff(answers)):
        between = np.arange(asked[k], asked[k + 1])
        offsets[between - (start - 96)] = [offset_s(int(q)) for q in between]
    fold = np.zeros(len(quarters), np.int64)
    for k in np.flatnonzero(np.diff(offsets) < 0) + 1:  # clocks are set back: so much local time comes again
        fold[k : k + (offsets[k - 1] - offsets[k]) // 900] = 1
    return quarters[96:], offsets[96:], fold[96:]


def is_open(site: Site, day: date, minute: int) -> bool:
    """Return whether the site is open at `minute` minutes after local midnight of `day`."""
    return day not in site.closed and _opens(site.hours.on(day), day.weekday(), minute)


def _opens(opening: Opening | None, weekday: int, minute: int) -> bool:
    return opening is None or any(start <= minute < end for start, end in opening[weekday])


def _quarter_at(day: date, site: Site) -> int:
    return day_start_ms(site, day) // QUARTER_MS


def camera_table(site: Site) -> pa.Table:
    """Return the relation `cameras`."""
    rows: list[tuple[Any, ...]] = [
        (c.camera_id, i, c.name, c.floor_id, None if c.hz is None else round(1000 / c.hz), *camera_life(site, c))
        for i, c in enumerate(site.cameras)
    ]
    return _table(_CAMERAS, rows)


def _calibration_table(site: Site) -> pa.Table:
    return _table(_CALIBRATIONS, [row for c in site.cameras for row in calibration_rows(c)])


def calibration_rows(camera: Camera) -> Sequence[tuple[Any, ...]]:
    """Return the rows of the relation `calibrations` of one camera, in order of time."""
    from vsd_analytics.geometry import camera_views

    rows = []
    for from_ms, to_ms, c in calibration_spans(camera):
        h = c.homography
        sign = camera_views.ground_sign(h, picture_px=camera.picture_px)
        rows.append((camera.camera_id, from_ms, to_ms, c.calibration_id, *h[0], *h[1], *h[2], sign))
    return rows


def _table(schema: pa.Schema, rows: list[tuple[Any, ...]]) -> pa.Table:
    columns = list(zip(*rows, strict=True)) if rows else [()] * len(schema)
    return pa.table([pa.array(c, type=f.type) for c, f in zip(columns, schema, strict=True)], schema=schema)
