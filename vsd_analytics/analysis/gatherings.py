"""Clusters and gatherings of a range: sizes weighted by time (M21), how many gatherings, where and how large (M22).

Definitions: `vsd_analytics.stats.gatherings`. They are computed from the fact `pairs` when asked, one camera and day at
a time; no fact holds them yet, so that purged hours have none. Where views overlap, a cluster and a gathering belong to
the camera that owns their centroid.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import date, datetime
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vsd_analytics.analysis.floor_days import NO_FLOOR
from vsd_analytics.analysis.groups import NOTHING, PURGED
from vsd_analytics.analysis.panels import FloorHours, Period, Place
from vsd_analytics.analysis.rates import level_often, not_measured
from vsd_analytics.errors import UsageError
from vsd_analytics.site import Camera, Floor
from vsd_analytics.stats import gatherings as stats
from vsd_analytics.stats.estimates import RateEstimate, State
from vsd_analytics.stats.gatherings import SizeDistribution
from vsd_analytics.warehouse.figures import local_instant
from vsd_analytics.warehouse.warehouse import Warehouse

HOURS: Final = 100.0
"""Gatherings are told per so many recorded open hours."""
N_TOP: Final = 5
DAY_MS: Final = 86_400_000
_AROUND_MS: Final = 3_600_000  # read beyond the range, so that a gathering at its edge begins and ends where it does

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Gathering:
    """At least three people who stayed close to one another for at least ten seconds.

    Attributes:
        floor_id, camera_id: Where, and the camera that counts it.
        day: Local day it began on.
        start, end: First and last instant, site's zone.
        duration_s: End - start + one frame interval.
        n_people: Most people in it at one instant.
        person_s: Person-seconds in it.
        x_m, y_m: Mean place, floor metres; None without positions.
        diameter_m: Mean largest distance between two of its people: long for its size is a queue; None likewise.
        is_open: It began in opening hours.
    """

    floor_id: str
    camera_id: str
    day: date
    start: datetime
    end: datetime
    duration_s: float
    n_people: int
    person_s: float
    x_m: float | None
    y_m: float | None
    diameter_m: float | None
    is_open: bool


@dataclass(frozen=True, slots=True)
class FloorGatherings:
    """Clusters and gatherings of one floor.

    Attributes:
        floor_id: The floor.
        sizes: Cluster sizes by person-time in opening hours (M21).
        per_100_h: Gatherings that began in opening hours, per 100 recorded open hours, sum over cameras (M22), with its
            day-clustered interval; its state and reason say why not.
        n: Gatherings that began in opening hours; None when they cannot be known.
        gatherings: All of the range, also those outside opening hours, in order of their start.
        top: The five with most person-seconds, in opening hours.
    """

    floor_id: str
    sizes: SizeDistribution
    per_100_h: RateEstimate
    n: int | None
    gatherings: tuple[Gathering, ...]
    top: tuple[Gathering, ...]


@dataclass(frozen=True, slots=True)
class Gatherings:
    """Clusters and gatherings of a range.

    Attributes:
        first, last: First and last local day.
        floors: One of every floor with cameras.
        state, reason: "ok" where gatherings of any floor can be told; else why not of the first.
    """

    first: date
    last: date
    floors: tuple[FloorGatherings, ...]
    state: State
    reason: str | None


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Clusters of one camera: arrays of one length, but for the members."""

    ts_ms: Ints
    size: Ints
    weight_s: Floats
    x_m: Floats
    y_m: Floats
    diameter_m: Floats
    of: Ints
    track: NDArray[Any]


def gatherings(
    warehouse: Warehouse, *, floor_id: str | None = None, first: date | None = None, last: date | None = None
) -> Gatherings:
    """Return the cluster sizes and gatherings of a range.

    Args:
        warehouse: Its days; those before `first` serve as history of the interval.
        floor_id: Only this floor; None = all.
        first: First local day to tell; None = the warehouse's.
        last: Last local day to tell; None = the warehouse's.

    Raises:
        UsageError: E101, the site has no such floor.
    """
    site = warehouse.site
    if floor_id is not None and floor_id not in {f.floor_id for f in site.floors}:
        raise UsageError(f"there is no floor {floor_id!r}", mend=", ".join(f.floor_id for f in site.floors))
    begin, end = first or warehouse.first, last or warehouse.last
    floors = tuple(
        _of_floor(Period(FloorHours(warehouse, floor=floor), begin, end), floor)
        for floor in site.floors
        if floor_id in (None, floor.floor_id) and any(c.floor_id == floor.floor_id for c in site.cameras)
    )
    told = [f for f in floors if f.n is not None]
    if told or not floors:
        reason = None if told else "the site has no camera"
        return Gatherings(begin, end, floors, "ok" if told else "not_enough_data", reason)
    return Gatherings(begin, end, floors, floors[0].per_100_h.state, floors[0].per_100_h.reason)


def _of_floor(period: Period, floor: Floor) -> FloorGatherings:
    data, warehouse = period.data, period.data.warehouse
    if (why := _why_unknown(period)) is not None:
        state: State = "not_enough_data" if why == NOTHING else "not_measurable"
        unknown = replace(stats.size_distribution([], [], min_cluster_s=np.inf), state=state, reason=why)
        return FloorGatherings(floor.floor_id, unknown, replace(not_measured(why), state=state), None, (), ())
    quarters = _Quarters(warehouse)
    n = np.zeros_like(period.whole.n)
    seconds: dict[int, float] = {}
    found: list[Gathering] = []
    for k, camera in enumerate(data.cameras):
        parts = list(_clusters(warehouse, camera))
        for part in parts:
            counts = quarters.is_open(part.ts_ms) & quarters.is_between(part.ts_ms, period.first, period.last)
            counts[counts] = _is_owned(warehouse, camera, part.ts_ms[counts], part.x_m[counts], part.y_m[counts])
            for size in np.unique(part.size[counts]).tolist():
                inside = counts & (part.size == size)
                seconds[size] = seconds.get(size, 0.0) + float(part.weight_s[inside].sum())
        for one in _gatherings(warehouse, camera, parts):
            if (hour := quarters.hour_of(one.started_ms)) is None:
                continue
            day, is_open, hour_start_ms = hour
            if is_open and period.whole.cameras[k]:
                n[k, int(np.searchsorted(data.hours.start_ms, hour_start_ms))] += 1
            if period.first <= day <= period.last:
                found.append(_told(warehouse, camera, one, day=day, is_open=is_open))
    found.sort(key=lambda g: (g.start, g.camera_id))
    has_history = _is_whole(data, warehouse.first, period.first)
    rate = level_often(
        period,
        Place(n, period.whole.exposure_h, period.whole.cameras),
        since=None if has_history else period.span_ms[0],  # purged weeks have no gatherings and are no history
    )
    is_known = period.why_no_violations is None
    counted = [g for g in found if g.is_open]
    return FloorGatherings(
        floor_id=floor.floor_id,
        sizes=stats.size_distribution(list(seconds), list(seconds.values())),
        per_100_h=_per_100_h(rate),
        n=len(counted) if is_known else None,
        gatherings=tuple(found) if is_known else (),
        top=tuple(sorted(counted, key=lambda g: (-g.person_s, g.start))[:N_TOP]) if is_known else (),
    )


def _gatherings(warehouse: Warehouse, camera: Camera, parts: list[_Found]) -> list[stats.Lasting]:
    """Return the gatherings of a camera that it counts, whenever they began."""
    import pandas as pd

    big: list[_Found] = [_of_size(part, stats.MIN_PEOPLE) for part in parts]
    if not any(len(part.ts_ms) for part in big):
        return []
    offsets = np.cumsum([0, *(len(part.ts_ms) for part in big)])
    of = np.concatenate([part.of + offset for part, offset in zip(big, offsets[:-1], strict=True)])
    track = np.concatenate([part.track for part in big])
    ts_ms, size, weight_s, x_m, y_m, diameter_m = (
        np.concatenate([getattr(part, name) for part in big])
        for name in ("ts_ms", "size", "weight_s", "x_m", "y_m", "diameter_m")
    )
    interval_ms = _intervals(warehouse, camera.camera_id, ts_ms)
    named = ~pd.isna(track)
    gap_ms = np.maximum(round(stats.LINK_S * 1000), 5 * interval_ms // 2)
    label = stats.link(of[named], pd.factorize(track[named])[0], ts_ms=ts_ms, gap_ms=gap_ms)
    made = stats.lasting(
        label,
        ts_ms=ts_ms,
        interval_ms=interval_ms,
        size=size,
        weight_s=weight_s,
        x_m=x_m,
        y_m=y_m,
        diameter_m=diameter_m,
    )
    place = np.array([(g.x_m, g.y_m) for g in made], dtype=np.float64).reshape(-1, 2)
    start_ms = np.array([g.started_ms for g in made], dtype=np.int64)
    owned = _is_owned(warehouse, camera, start_ms, place[:, 0], place[:, 1])
    return [g for g, counts in zip(made, owned.tolist(), strict=True) if counts]


def _clusters(warehouse: Warehouse, camera: Camera) -> Iterator[_Found]:
    """Yield the clusters of a camera, day by UTC day."""
    limit_mm = round(warehouse.site.settings.distance_m * 1000)
    ends = warehouse.rows("select min(quarter)::bigint as low, max(quarter)::bigint as high from calendar")[0]
    first_ms, after_ms = ends["low"] * 900_000 - _AROUND_MS, (ends["high"] + 1) * 900_000 + _AROUND_MS
    for day in range(first_ms // DAY_MS, (after_ms - 1) // DAY_MS + 1):
        span = {"start_ms": max(first_ms, day * DAY_MS), "after_ms": min(after_ms, (day + 1) * DAY_MS)}
        rows = warehouse.table(_PAIRS, {"camera": camera.camera_id, "mm": limit_mm, **span})
        if rows.num_rows:
            yield _clusters_of(rows)


def _clusters_of(rows: pa.Table) -> _Found:
    ts_ms = rows["ts_ms"].to_numpy()
    at, frame = np.unique(ts_ms, return_inverse=True)
    weight_s = np.zeros(len(at))
    weight_s[frame] = rows["weight_s"].to_numpy()
    found = stats.clusters(frame, rows["member_a"].to_numpy(), rows["member_b"].to_numpy())
    order = np.argsort(found.of, kind="stable")
    of, seen_at = found.of[order], found.seen_at[order]

    def both(name: str) -> NDArray[Any]:
        sides = [rows[f"{name}{side}"].to_numpy() for side in ("_a", "_b")]
        return np.concatenate(sides)[seen_at]

    x_m, y_m = both("x_m").astype(np.float64), both("y_m").astype(np.float64)
    known = ~np.isnan(x_m) & ~np.isnan(y_m)
    n = np.bincount(of[known], minlength=len(found.size)).astype(np.float64)
    n[n == 0] = np.nan
    middle = [np.bincount(of[known], weights=v[known], minlength=len(found.size)) / n for v in (x_m, y_m)]
    return _Found(
        ts_ms=at[found.frame],
        size=found.size,
        weight_s=weight_s[found.frame],
        x_m=middle[0],
        y_m=middle[1],
        diameter_m=stats.diameters(of, x_m, y_m, n_clusters=len(found.size)),
        of=of,
        track=both("track"),
    )


def _of_size(found: _Found, least: int) -> _Found:
    """Return the clusters of at least so many people."""
    chosen = found.size >= least
    number = np.cumsum(chosen) - 1
    member = chosen[found.of]
    return _Found(
        ts_ms=found.ts_ms[chosen],
        size=found.size[chosen],
        weight_s=found.weight_s[chosen],
        x_m=found.x_m[chosen],
        y_m=found.y_m[chosen],
        diameter_m=found.diameter_m[chosen],
        of=number[found.of[member]],
        track=found.track[member],
    )


def _intervals(warehouse: Warehouse, camera_id: str, ts_ms: Ints) -> Ints:
    """Return the frame interval at each instant."""
    rows = warehouse.rows(
        "select utc_day, interval_ms from camera_days where camera_id = $camera order by utc_day", {"camera": camera_id}
    )
    days = np.array([r["utc_day"] for r in rows], dtype=np.int64)
    interval = np.array([r["interval_ms"] for r in rows], dtype=np.int64)
    return interval[np.searchsorted(days, ts_ms // DAY_MS)]


def _is_owned(warehouse: Warehouse, camera: Camera, ts_ms: Ints, x_m: Floats, y_m: Floats) -> NDArray[np.bool_]:
    """Return whether a camera counts at each instant and place; it does where no other is known to see it better."""
    owned = np.ones(len(ts_ms), dtype=np.bool_)
    spans = warehouse.table(
        "select camera_id = $camera as is_own, from_ms, to_ms, cx::bigint as cx, cy::bigint as cy from owner_cells "
        "where floor_id = $floor",
        {"camera": camera.camera_id, "floor": camera.floor_id},
    )
    if not spans.num_rows or not len(ts_ms):
        return owned
    cell_m = float(warehouse.site.settings.owner_cell_m)
    known = ~np.isnan(x_m) & ~np.isnan(y_m)
    cells = [np.floor(np.where(known, v, 0.0) / cell_m).astype(np.int64) for v in (x_m, y_m)]
    at = pa.table({"i": np.flatnonzero(known), "ts_ms": ts_ms[known], "cx": cells[0][known], "cy": cells[1][known]})
    warehouse.con.register("_clusters_at", at)
    warehouse.con.register("_owner_spans", spans)
    lost = warehouse.table(
        "select i from _clusters_at as c inner join _owner_spans as o on c.cx = o.cx and c.cy = o.cy "
        "and c.ts_ms >= o.from_ms and c.ts_ms < o.to_ms where not o.is_own"
    )
    warehouse.con.unregister("_clusters_at")
    warehouse.con.unregister("_owner_spans")
    owned[lost["i"].to_numpy()] = False
    return owned


class _Quarters:
    """The calendar of a warehouse, looked up by instant."""

    def __init__(self, warehouse: Warehouse) -> None:
        rows = warehouse.table(
            "select quarter::bigint as quarter, is_open, local_date, hour_start_ms from calendar order by quarter"
        )
        self._quarter = rows["quarter"].to_numpy()
        self._open = rows["is_open"].to_numpy()
        self._hour = rows["hour_start_ms"].to_numpy()
        self._date = rows["local_date"].to_numpy().astype("datetime64[D]")

    def is_open(self, ts_ms: Ints) -> NDArray[np.bool_]:
        """Return which instants lie in opening hours of the range."""
        at, inside = self._at(ts_ms)
        return np.asarray(self._open[at].astype(np.bool_) & inside)

    def is_between(self, ts_ms: Ints, first: date, last: date) -> NDArray[np.bool_]:
        """Return which instants lie in the local days from `first` to `last`."""
        at, inside = self._at(ts_ms)
        day = self._date[at]
        return np.asarray(inside & (day >= np.datetime64(first)) & (day <= np.datetime64(last)))

    def hour_of(self, ts_ms: int) -> tuple[date, bool, int] | None:
        """Return local day, whether it is open, and start of the local hour of an instant; None outside the range."""
        at, inside = self._at(np.array([ts_ms]))
        if not inside[0]:
            return None
        return self._date[at[0]].astype(object), bool(self._open[at[0]]), int(self._hour[at[0]])

    def _at(self, ts_ms: Ints) -> tuple[Ints, NDArray[np.bool_]]:
        quarter = ts_ms // 900_000
        at = np.minimum(np.searchsorted(self._quarter, quarter), len(self._quarter) - 1)
        return at, self._quarter[at] == quarter


def _told(warehouse: Warehouse, camera: Camera, one: stats.Lasting, *, day: date, is_open: bool) -> Gathering:
    return Gathering(
        floor_id=camera.floor_id,
        camera_id=camera.camera_id,
        day=day,
        start=local_instant(warehouse, one.started_ms),
        end=local_instant(warehouse, one.ended_ms),
        duration_s=one.duration_s,
        n_people=one.n_people,
        person_s=one.person_s,
        x_m=one.x_m,
        y_m=one.y_m,
        diameter_m=one.diameter_m,
        is_open=is_open,
    )


def _per_100_h(rate: RateEstimate) -> RateEstimate:
    """Return a rate of gatherings an hour as one of gatherings in 100 hours."""
    values: dict[str, Any] = {k: None if (v := getattr(rate, k)) is None else HOURS * v for k in ("rate", "lo", "hi")}
    reason = None if rate.reason is None else rate.reason.replace("violation", "gathering")
    return replace(rate, **values, reason=reason if rate.state != "not_measurable" else rate.reason)


def _why_unknown(period: Period) -> str | None:
    """Return why not even clusters can be known; None if they can."""
    row = period.data.warehouse.rows(
        "select coalesce(bool_or(recorded_s > 0), false) as is_recorded, "
        "bool_or(violation_records is not null) as is_known from camera_hours "
        "where floor_id = $floor and local_date between $first and $last",
        {"floor": period.data.floor.floor_id, "first": period.first, "last": period.last},
    )[0]
    if not row["is_recorded"]:
        return NOTHING
    if not row["is_known"]:
        return NO_FLOOR
    return None if _is_whole(period.data, period.first, period.last) else PURGED


def _is_whole(data: FloorHours, first: date, last: date) -> bool:
    """Return whether the pairs of some days are all there: as many as violation records were counted."""
    limit_mm = round(data.site.settings.distance_m * 1000)
    values = {"floor": data.floor.floor_id, "mm": limit_mm, "first": first, "last": last}
    row = data.warehouse.rows(
        "select (select coalesce(sum(violation_records), 0) from camera_hours where floor_id = $floor "
        "and local_date between $first and $last)::bigint as n, "
        "(select count(*) from pairs as p inner join calendar as c on floor(p.ts_ms / 900000) = c.quarter "
        "inner join cameras as k on p.camera_id = k.camera_id where k.floor_id = $floor and p.is_owned "
        "and p.distance_mm < $mm and c.local_date between $first and $last)::bigint as n_present",
        values,
    )[0]
    return bool(row["n"] == row["n_present"])


_PAIRS: Final = """
select
    ts_ms,
    member_a::bigint as member_a,
    member_b::bigint as member_b,
    track_a,
    track_b,
    x_a_mm / 1000.0::double as x_m_a,
    y_a_mm / 1000.0::double as y_m_a,
    x_b_mm / 1000.0::double as x_m_b,
    y_b_mm / 1000.0::double as y_m_b,
    weight_ms / 1000.0::double as weight_s
from pairs
where camera_id = $camera and distance_mm < $mm and ts_ms >= $start_ms and ts_ms < $after_ms
order by ts_ms, member_a, member_b
"""
