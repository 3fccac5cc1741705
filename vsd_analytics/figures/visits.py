"""Visits of areas: how many, and how long they last (dwell time), from tracks that may be cut.

Only areas with `visits = true` in vsd.toml. A visit counts where its entry was seen, at the camera that counts that
place, in opening hours of which enough was recorded. How dwell times are found: `vsd_analytics.stats.dwell`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vsd_analytics.answer import Answer, Column, Reason, Row, Sum, Value, value_of
from vsd_analytics.figures.panels import Array, Flags, FloorHours, Ints, Place, positions
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.rates import NOT_RECORDED
from vsd_analytics.figures.share.times import hidden_times
from vsd_analytics.figures.values import unknown_count
from vsd_analytics.site.model import Area
from vsd_analytics.stats.dwell import Dwell, dwell
from vsd_analytics.stats.estimates import RateEstimate, no_rate
from vsd_analytics.stats.rates import violation_rate

NO_TRACK_IDS: Final = Reason("engine.no_track_ids")
NOBODY: Final = Reason("nobody.on_camera")
_OWN_WORDS: Final = frozenset({"level.none_per_open_h", "level.events", "level.camera"})
"""Reasons of a rate that name what is counted: visits have them under their own code."""
_VISITS: Final = """
select
    area_id,
    counted_by,
    hour_start_ms,
    has_entry,
    has_exit,
    dwell_s::double as dwell_s
from visits
where floor_id = $floor and is_counted and is_open and local_date between $first and $last
order by started_ms, camera_id, track_id, area_id
"""
_TRACKED: Final = """
with tracked as (
    select camera_id, sum(n_records)::double as n
    from track_days
    where site_day between $first and $last
    group by camera_id
),

people as (
    select camera_id, sum(person_records)::double as n
    from camera_hours
    where local_date between $first and $last
    group by camera_id
)

select people.camera_id
from people
left join tracked on people.camera_id = tracked.camera_id
where people.n > 0 and coalesce(tracked.n, 0) * 2 < people.n
"""


COLUMNS: Final = (
    Column("floor_id", "key"),
    Column("area_id", "key"),
    Column("name", "fact"),
    Column("visits_per_open_h", "rate", "per_open_h", "M35", tells=("n_visits",), per="recorded_open_h"),
    Column("dwell_median_s", "seconds", "s", "M36", tells=("n_visits",), per="n_visits"),
    Column("dwell_p90_s", "seconds", "s", "M36", tells=("n_visits",), per="n_visits"),
    Column("long_visit_s", "fact", "s"),
    Column("long_share", "share", "share", "M36", tells=("n_visits", "n_long", "n_short"), per="n_visits"),
    Column("dwell_mean_s", "seconds", "s", "M36", tells=("n_visits",), per="n_visits"),
    Column("dwell_mean_little_s", "seconds", "s", "M36", tells=("n_visits",), per="n_visits"),
    Column("little_ratio", "rate", "ratio", tells=("n_visits",)),
    Column("means_agree", "fact"),
    Column("n_visits", "count", "visits"),
    Column("n_followed", "count", "visits", tells=("n_visits",), audience="operator"),
    Column("n_cut", "count", "visits", tells=("n_visits",), audience="operator"),
    Column("n_long", "count", "visits", audience="operator"),
    Column("n_short", "count", "visits", audience="operator"),
    Column("n_began_inside", "count", "tracks", audience="operator"),
    Column("n_days", "fact", "days"),
    Column("recorded_open_h", "fact", "h"),
    Column("recorded_share", "share", "share"),
    Column("silent_cameras", "fact"),
)
"""Columns of `visits`."""
TIMES: Final = ("dwell_median_s", "dwell_p90_s", "long_share", "dwell_mean_s", "dwell_mean_little_s", "little_ratio")
"""Columns of which visits make person-time."""
_STAYS: Final = (*TIMES, "n_visits", "n_followed", "n_cut", "n_long", "n_short")
SUMS: Final = (Sum("n_visits", ("n_followed", "n_cut")), Sum("n_visits", ("n_long", "n_short")))


def visits(period: Period) -> Answer:
    """Return the visits of each area of a floor that asks for them, in the order of vsd.toml.

    Columns: visits per open hour of the area, entries that were seen, sum over cameras, with the interval of M0 (M35);
    median, 90 % quantile and mean of the dwell time, the mean by Little's law beside it, and the share of visits longer
    than `long_visit_s` (M36); visits seen to enter, those followed to their end, those cut, and tracks that begin
    inside (in no figure but person-time); recorded share of the opening hours of the cameras that count people there.
    """
    data = period.data
    asked = [a for a in data.areas if a.has_visits]
    if not asked:
        return Answer("visits", COLUMNS, (), period.holds_for, nothing=Reason("visits.not_asked"))
    stays = _stays(period, asked)
    able = sends_ids(period)
    hidden = hidden_times(period)
    areas = tuple(
        timeless(_area_row(period, a, stays.of(k), able), hidden.get(a.area_id), TIMES) for k, a in enumerate(asked)
    )
    notes = ((None, Reason("note.visits")), *((k, n) for k, row in enumerate(areas) for n in _row_notes(row)))
    return Answer("visits", COLUMNS, areas, period.holds_for, SUMS, notes)


def timeless(row: Row, why: Reason | None, names: Sequence[str]) -> Row:
    """Return a row without its times, where the person-time of its place is hidden; whether they agree tells of them.

    Args:
        row: Of a place.
        why: Why its person-time is hidden; None = it is not.
        names: Columns that tell person-time.
    """
    if why is None:
        return row
    agree: Row = {"means_agree": None} if "means_agree" in row else {}
    return {**row, **dict.fromkeys(names, Value.missing(why)), **agree}


def entries_by_hour(period: Period, area: Area) -> tuple[Ints, Ints]:
    """Return the camera and the hour, as positions, of each visit of an area whose entry was seen."""
    stays = _stays(period, [area]).of(0)
    entered = stays.has_entry.astype(np.bool_)
    return stays.camera[entered], stays.hour[entered]


def sends_ids(period: Period) -> Flags:
    """Return which cameras number most of the people they record, shape (n_cameras,)."""
    without_ids = cameras_without_ids(period)
    return np.array([c not in without_ids for c in period.data.ids], dtype=np.bool_)


def cameras_without_ids(period: Period) -> frozenset[str]:
    """Return the cameras of whose records fewer than half carry a track id."""
    days = {"first": period.first, "last": period.last}
    return frozenset(row["camera_id"] for row in period.data.warehouse.rows(_TRACKED, days))


@dataclass(frozen=True, slots=True)
class _Stays:
    """Stays of tracks in areas, one element each."""

    area: Ints
    camera: Ints
    hour: Ints
    has_entry: Array
    has_exit: Array
    dwell_s: Array

    def of(self, area: int) -> _Stays:
        at = self.area == area
        return _Stays(*(getattr(self, name)[at] for name in self.__slots__))


def _stays(period: Period, areas: Sequence[Area]) -> _Stays:
    """Return the stays of tracks in areas, in the hours that enter rates."""
    data = period.data
    rows = data.warehouse.table(_VISITS, {"floor": data.floor.floor_id, "first": period.first, "last": period.last})
    area = positions(rows["area_id"], [a.area_id for a in areas], otherwise=-1)
    camera = positions(rows["counted_by"], data.ids, otherwise=-1)
    hour = np.searchsorted(data.hours.start_ms, rows["hour_start_ms"].to_numpy())
    is_used = data.hours.is_counted[camera, hour]
    return _Stays(
        *(v[is_used] for v in (area, camera, hour)),
        *(rows[name].to_numpy(zero_copy_only=False)[is_used] for name in ("has_entry", "has_exit", "dwell_s")),
    )


def _area_row(period: Period, area: Area, stays: _Stays, able: Flags) -> Row:
    data, settings = period.data, period.data.site.settings
    place = period.area(area.area_id)
    entered = stays.has_entry.astype(np.bool_)
    counted, why_none = people_counted(place, stays.camera[entered], stays.hour[entered], able)
    used = data.hours.is_counted & period.is_inside & counted.cameras[:, None]
    long_s = area.long_visit_s or settings.long_visit_s
    is_cut = ~stays.has_exit[entered].astype(np.bool_)
    times = dwell_of(period, place, used, stays.dwell_s[entered], is_cut, stays.hour[entered], long_s=long_s)
    rate = per_open_hour(period, counted, what="visits", why_none=why_none)
    recorded_h = data.hours.recorded_s[:, period.is_inside].sum(axis=1) / 3600
    is_able = counted.cameras.any()
    none = unknown_count(rate, len(entered)) if is_able else Value.missing(why_none, "not_measurable")
    return {
        "floor_id": data.floor.floor_id,
        "area_id": area.area_id,
        "name": area.name,
        "visits_per_open_h": Value.of(rate),
        **(_stay_cells(times) if none is None else dict.fromkeys(_STAYS, none)),
        "means_agree": None if none else times.little.agrees,
        "long_visit_s": long_s,
        "n_began_inside": none or Value(int((~entered).sum())),
        "n_days": times.n_days,
        "recorded_open_h": rate.exposure_h,
        "recorded_share": Value(share_of_open_hours(period, counted.cameras)),
        "silent_cameras": _silent(data, counted, recorded_h),
    }


def _stay_cells(times: Dwell) -> Row:
    """Return dwell times as cells, and visits by how they were seen; how many are long is an estimate."""
    little = times.little
    n_long = None if times.long_share.value is None else round(times.long_share.value * times.n_visits)
    return {
        "dwell_median_s": Value.of(times.median, state=times.state, reason=times.reason),
        "dwell_p90_s": Value.of(times.p90, state=times.state, reason=times.reason),
        "long_share": Value.of(times.long_share),
        "dwell_mean_s": Value.of(little.by_tracks),
        "dwell_mean_little_s": Value.of(little.by_little),
        "little_ratio": Value.of(little),
        "n_visits": Value(times.n_visits),
        "n_followed": Value(times.n_visits - times.n_cut),
        "n_cut": Value(times.n_cut),
        "n_long": Value.missing(times.reason) if n_long is None else Value(n_long),
        "n_short": Value.missing(times.reason) if n_long is None else Value(times.n_visits - n_long),
    }


def share_of_open_hours(period: Period, cameras: Flags) -> float:
    """Return the share of the opening hours of some cameras that they recorded; 0 where none counts."""
    hours = period.data.hours
    open_s = float(hours.scheduled_s[cameras][:, period.is_inside].sum())
    return float(hours.recorded_s[cameras][:, period.is_inside].sum()) / open_s if open_s else 0.0


def _row_notes(row: Row) -> list[Reason]:
    """Return what a reader must know of one area."""
    notes = []
    if silent := row["silent_cameras"]:
        notes.append(Reason("visits.silent", cameras=", ".join(map(str, silent)) if isinstance(silent, tuple) else ""))
    if row["means_agree"] is False:
        ratio = value_of(row, "little_ratio").value or 1.0
        notes.append(Reason("visits.entries_missed" if ratio > 1 else "visits.entered_twice"))
    return notes


def dwell_of(
    period: Period, place: Place, used: Flags, dwell_s: Array, is_cut: Flags, hour: Ints, *, long_s: float
) -> Dwell:
    """Return the dwell times of stays in a place.

    Args:
        period: The days.
        place: The place.
        used: Camera-hours whose person-time counts, shape (n_cameras, n_hours).
        dwell_s: Seconds of each stay.
        is_cut: Whether its end was not seen.
        hour: Hour in which it began, as an index.
        long_s: A stay from so many seconds on is long.
    """
    data, days = period.data, np.array([d.toordinal() for d in period.days], dtype=np.int64)
    person_s, day = np.zeros(len(days)), np.searchsorted(days, data.hours.day)
    seconds = (place.exposure_h * used).sum(axis=0)[period.is_inside] * 3600
    np.add.at(person_s, day[period.is_inside], seconds)
    rules = data.site.settings.for_intervals
    return dwell(np.maximum(dwell_s, 0.0), is_cut, day[hour], person_s=person_s, long_s=long_s, **rules)


def people_counted(place: Place, camera: Ints, hour: Ints, able: Flags) -> tuple[Place, Reason]:
    """Return people counted in a place, and why no camera can count there where none can.

    Args:
        place: The place.
        camera: Camera of each of the people, as an index.
        hour: Hour of each, as an index.
        able: Cameras that send ids.
    """
    n = np.zeros_like(place.exposure_h)
    np.add.at(n, (camera, hour), 1.0)
    seen_by = np.asarray((n + place.exposure_h).any(axis=1))
    counted = Place(n, place.exposure_h, seen_by & able, place.is_there)
    return counted, NO_TRACK_IDS if seen_by.any() else NOBODY


def per_open_hour(period: Period, place: Place, *, what: str, why_none: Reason) -> RateEstimate:
    """Return how many people an open hour a place has, with the interval of M0.

    Args:
        period: The days.
        place: What was counted there.
        what: Family of the reasons that name what is counted.
        why_none: Reason where no camera can count there.
    """
    if period.why_no_exposure is not None:
        return no_rate(period.why_no_exposure)
    if not place.cameras.any():
        return no_rate(why_none)
    if not period.knows(place):
        return NOT_RECORDED
    data, panel = period.data, period.data.panel(place, period.days)
    rate = violation_rate(panel.n, panel.x_h, **data.site.settings.for_intervals)
    if rate.reason is None or rate.reason.code not in _OWN_WORDS:
        return rate
    return replace(rate, reason=Reason(rate.reason.code.replace("level", what), **rate.reason.values))


def _silent(data: FloorHours, place: Place, recorded_h: Sequence[float] | Array) -> tuple[str, ...]:
    return tuple(c for c, counts, h in zip(data.ids, place.cameras, recorded_h, strict=True) if counts and not h)
