"""Clusters and gatherings of a range: sizes weighted by time (M21), how many gatherings, where and how large (M22).

In one frame two people are joined when they are closer than the legal distance; a **cluster** is a connected component
of that graph. Two clusters of at least three are joined when they share two track ids within 5 s, or two and a half
frame intervals where that is more; a **gathering** is a connected component of that second graph that lasts 10 s. A
cluster is single linkage: six people in a row are one cluster nine metres long, so its diameter is reported with its
size.

The facts `cluster_times`, `gathering_parts` and `gathering_joins` hold them by the hour, so that they outlive records.
Where views overlap, a cluster and a gathering belong to the camera that owns their middle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import date, datetime, timedelta, tzinfo
from typing import Any, Final

import numpy as np
import pyarrow as pa

from vsd_analytics.answer import Reason, State
from vsd_analytics.errors import UsageError
from vsd_analytics.figures.floor_days import NO_FLOOR
from vsd_analytics.figures.forecast import HISTORY_WEEKS
from vsd_analytics.figures.groups import NOTHING
from vsd_analytics.figures.operator_counts import local_instant
from vsd_analytics.figures.panels import FloorHours, Place
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.rates import violation_rate_level
from vsd_analytics.figures.slots import Floats, load_slots
from vsd_analytics.site.model import Floor
from vsd_analytics.stats import gatherings as stats
from vsd_analytics.stats.estimates import RateEstimate, no_rate
from vsd_analytics.stats.gatherings import SizeDistribution
from vsd_analytics.stats.hour_of_week import recorded_hours
from vsd_analytics.warehouse.warehouse import Warehouse

HOURS: Final = 100.0
"""Gatherings are reported per so many recorded open hours."""
N_TOP: Final = 5
"""Rows on a page; all gatherings are counted."""
COUNTED: Final = {f"level.{name}": f"gatherings.{name}" for name in ("none_per_open_h", "events", "camera")}
"""Reasons of a rate that name violations: those of gatherings name gatherings."""
PURGED: Final = Reason("purged.clusters")


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
        ranked: Those that began in opening hours, most person-seconds first.
    """

    floor_id: str
    sizes: SizeDistribution
    per_100_h: RateEstimate
    n: int | None
    gatherings: tuple[Gathering, ...] = field(repr=False)  # there are thousands in a week
    ranked: tuple[Gathering, ...] = field(repr=False)

    @property
    def top(self) -> tuple[Gathering, ...]:
        """Return the five with most person-seconds, in opening hours."""
        return self.ranked[:N_TOP]


@dataclass(frozen=True, slots=True)
class Gatherings:
    """Clusters and gatherings of a range.

    Attributes:
        first, last: First and last local day.
        floors: One of every floor with cameras.
        state, reason: "ok" where gatherings of any floor can be counted; else the reason of the first floor.
    """

    first: date
    last: date
    floors: tuple[FloorGatherings, ...]
    state: State
    reason: Reason | None


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

    Example:
        >>> vsd.gatherings(warehouse).state
        'ok'
    """
    site = warehouse.site
    if floor_id is not None and floor_id not in {f.floor_id for f in site.floors}:
        raise UsageError(f"there is no floor {floor_id!r}", fix=", ".join(f.floor_id for f in site.floors))
    begin, end = first or warehouse.first, last or warehouse.last
    floors = tuple(
        _of_floor(Period(FloorHours(warehouse, floor=floor), begin, end), floor)
        for floor in site.floors
        if floor_id in (None, floor.floor_id) and any(c.floor_id == floor.floor_id for c in site.cameras)
    )
    with_count = [f for f in floors if f.n is not None]
    if with_count or not floors:
        reason = None if with_count else Reason("site.no_camera")
        return Gatherings(begin, end, floors, "ok" if with_count else "not_enough_data", reason)
    return Gatherings(begin, end, floors, floors[0].per_100_h.state, floors[0].per_100_h.reason)


def _of_floor(period: Period, floor: Floor) -> FloorGatherings:
    data, warehouse = period.data, period.data.warehouse
    if (why := _why_unknown(period)) is not None:
        state: State = "not_enough_data" if why == NOTHING else "not_measurable"
        unknown = replace(stats.size_distribution([], [], min_cluster_s=np.inf), state=state, reason=why)
        return FloorGatherings(floor.floor_id, unknown, no_rate(why, state), None, (), ())
    rows = warehouse.table(_GATHERINGS, {"floor": floor.floor_id})
    [n] = data.by_hour(rows, "is_open")
    n *= period.whole.cameras[:, None]
    day = rows["local_date"].to_numpy()
    inside = rows.filter(pa.array((day >= np.datetime64(period.first)) & (day <= np.datetime64(period.last))))
    zone = warehouse.site.zone
    all_gatherings = [_gathering(zone, row) for row in inside.to_pylist()]
    sizes = warehouse.table(_SIZES, {"floor": floor.floor_id, "first": period.first, "last": period.last})
    has_history = _is_whole(data, warehouse.first, period.first)
    rate = violation_rate_level(
        period,
        Place(n, period.whole.exposure_h, period.whole.cameras),
        since=None if has_history else period.span_ms[0],  # hours without the facts have no gatherings: no history
    )
    is_known = period.why_no_violations is None
    counted = [g for g in all_gatherings if g.is_open]
    return FloorGatherings(
        floor_id=floor.floor_id,
        sizes=stats.size_distribution(sizes["n_people"].to_numpy(), sizes["cluster_s"].to_numpy()),
        per_100_h=_per_100_h(rate),
        n=len(counted) if is_known else None,
        gatherings=tuple(all_gatherings) if is_known else (),
        ranked=tuple(sorted(counted, key=lambda g: (-g.person_s, g.start))) if is_known else (),
    )


def _gathering(zone: tzinfo, row: Mapping[str, Any]) -> Gathering:
    same = ("floor_id", "camera_id", "duration_s", "n_people", "person_s", "x_m", "y_m", "diameter_m", "is_open")
    return Gathering(
        day=row["local_date"],
        start=local_instant(zone, row["started_ms"]),
        end=local_instant(zone, row["ended_ms"]),
        **{name: row[name] for name in same},
    )


def _per_100_h(rate: RateEstimate) -> RateEstimate:
    """Return a rate of gatherings an hour as one of gatherings in 100 hours."""
    values: dict[str, Any] = {k: None if (v := getattr(rate, k)) is None else HOURS * v for k in ("value", "lo", "hi")}
    reason = rate.reason
    if reason is not None and reason.code in COUNTED:
        reason = Reason(COUNTED[reason.code], **reason.values)
    return replace(rate, **values, reason=reason)


def _why_unknown(period: Period) -> Reason | None:
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
    """Return whether the clusters of some days are all there: wherever there is a violation record there is one.

    Hours that were sealed before these facts existed have none; all others have them.
    """
    if not data.warehouse.built.sealed.hours:
        return True
    values = {"floor": data.floor.floor_id, "first": first, "last": last}
    return not data.warehouse.rows(_LACKING, values)


_GATHERINGS: Final = """
select
    floor_id,
    camera_id,
    local_date,
    started_ms,
    ended_ms,
    duration_s::double as duration_s,
    n_people,
    person_s::double as person_s,
    x_m,
    y_m,
    diameter_m,
    is_open,
    hour_start_ms
from gatherings
where floor_id = $floor and is_owned
order by started_ms, camera_id, cluster
"""
_SIZES: Final = """
select n_people::bigint as n_people, sum(cluster_s)::double as cluster_s
from cluster_sizes
where floor_id = $floor and local_date between $first and $last
group by n_people
order by n_people
"""
_LACKING: Final = """
select 1 as is_lacking
from violation_time as v
inner join calendar as c on v.quarter = c.quarter
inner join cameras as k on v.camera_id = k.camera_id
left join (select distinct hour, camera_id from cluster_times) as t on v.hour = t.hour and v.camera_id = t.camera_id
where k.floor_id = $floor and c.local_date between $first and $last and t.hour is null
limit 1
"""


def gathering_hours(warehouse: Warehouse, monday: date, *, floor_id: str) -> tuple[Floats, Floats]:
    """Return gatherings that began, and the open hours they were recorded in, for `analysis.forecast.forecast`.

    Cameras that were down are weighed as for violations (`stats.hour_of_week.recorded_hours`).

    Args:
        warehouse: Opened from `analysis.forecast.first_day(monday)`, or from wherever records begin.
        monday: First day of the last week.
        floor_id: The floor.

    Returns:
        Two arrays of shape (13, 168), the week from `monday` last.

    Raises:
        UsageError: E101, `monday` is no Monday, or the site has no such floor.
    """
    slots = load_slots(
        warehouse, monday, n_weeks=HISTORY_WEEKS + 1, floor_id=floor_id, there=(monday, monday + timedelta(days=6))
    )
    first = monday - timedelta(weeks=HISTORY_WEEKS)
    rows = warehouse.rows(
        "select g.camera_id, date_diff('day', $first, g.local_date)::bigint as day, h.local_hour::bigint as hour, "
        "count(*)::double as n from gatherings as g inner join camera_hours as h using (camera_id, hour_start_ms) "
        "where g.floor_id = $floor and g.is_owned and g.is_open and g.local_date between $first and $last group by all",
        {"floor": floor_id, "first": first, "last": monday + timedelta(days=6)},
    )
    counts = np.where(np.isnan(slots.n_violations), np.nan, 0.0)
    for row in rows:
        week, day = divmod(row["day"], 7)
        counts[slots.camera_ids.index(row["camera_id"]), week, 24 * day + row["hour"]] += row["n"]
    weeks = recorded_hours(counts, slots.recorded_h, slots.open_h, min_share=slots.min_share)
    return weeks.n, weeks.x_h
