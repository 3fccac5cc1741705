"""Queues: how many people wait (M39), how long, and how many leave before the end (M40), by hour and for the days.

Only areas with `queue = true` in vsd.toml; waiting times need `served_in`, the area into which served people step. How
waiting times are found: `vsd_analytics.stats.waiting`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vsd_analytics.answer import Answer, Column, Reason, Row, Sum, Value, value_of
from vsd_analytics.figures.panels import Array, Flags, Ints, positions
from vsd_analytics.figures.people_present import (
    NOBODY,
    Presence,
    hours_that_stand_for_all,
    unknown_hours_notes,
    why_not_all,
)
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.times import hidden_hours_of_day, hidden_times
from vsd_analytics.figures.values import unknown_count
from vsd_analytics.figures.visits import NO_TRACK_IDS, cameras_without_ids, dwell_of, timeless
from vsd_analytics.site.model import Area
from vsd_analytics.stats.durations import QuantileEstimate
from vsd_analytics.stats.dwell import Dwell
from vsd_analytics.stats.recorded_hours import RecordedHours
from vsd_analytics.stats.waiting import CUT, LEFT, SERVED, WaitTimes, waiting

BUSY_SHARE: Final = 0.9
NO_END: Final = Reason("waits.no_end")
_OUTCOMES: Final = {"cut": CUT, "served": SERVED, "left": LEFT}
_WAITS: Final = """
select
    area_id,
    counted_by,
    hour_start_ms,
    outcome,
    was_served,
    dwell_s::double as dwell_s,
    wait_s::double as wait_s
from waits
where floor_id = $floor and has_entry and is_counted and is_open and local_date between $first and $last
order by started_ms, camera_id, track_id, area_id
"""


def _people(name: str) -> Column:
    return Column(name, "people", "people", "M39", digits=2, tells=("n_entered",), per="recorded_open_h")


_PEOPLE: Final = _people("people_waiting")
_WAIT_COLUMNS: Final = (
    Column("wait_median_s", "seconds", "s", "M40", tells=("n_entered",), per="n_entered"),
    Column("wait_p90_s", "seconds", "s", "M40", tells=("n_entered",), per="n_entered"),
    Column("left_share", "share", "share", "M40", tells=("n_entered", "n_left", "n_not_left"), per="n_entered"),
)
_ENDS: Final = ("n_served", "n_left", "n_cut")
QUEUE_COLUMNS: Final = (
    Column("floor_id", "key"),
    Column("area_id", "key"),
    Column("name", "fact"),
    _PEOPLE,
    _people("people_waiting_p90"),
    *_WAIT_COLUMNS,
    Column("stay_mean_s", "seconds", "s", "M40", tells=("n_entered",), per="n_entered"),
    Column("stay_mean_little_s", "seconds", "s", "M40", tells=("n_entered",), per="n_entered"),
    Column("little_ratio", "rate", "ratio", tells=("n_entered",)),
    Column("means_agree", "fact"),
    Column("n_entered", "count", "people"),
    *(Column(name, "count", "people", tells=("n_entered",), audience="operator") for name in _ENDS),
    Column("n_not_left", "count", "people", audience="operator"),
    Column("n_back", "count", "people", audience="operator"),
    Column("n_days", "fact", "days"),
    Column("recorded_open_h", "fact", "h"),
    Column("recorded_share", "share", "share"),
    Column("silent_cameras", "fact"),
    Column("unrecorded_hours", "fact", "hour_of_day"),
)
"""Columns of `queues`."""
HOUR_COLUMNS: Final = (
    Column("floor_id", "key"),
    Column("area_id", "key"),
    Column("local_hour", "key", "hour_of_day"),
    Column("name", "fact"),
    _PEOPLE,
    *_WAIT_COLUMNS,
    *(Column(name, "count", "people", audience="operator") for name in ("n_entered", *_ENDS, "n_not_left")),
    Column("recorded_open_h", "fact", "h"),
)
"""Columns of `queue_hours`. How many entered in an hour is the operator's: the hours of a week are too many to hide."""


_HOUR_TIMES: Final = ("people_waiting", "wait_median_s", "wait_p90_s")
_TIMES: Final = (*_HOUR_TIMES, "people_waiting_p90", "stay_mean_s", "stay_mean_little_s", "little_ratio")


@dataclass(frozen=True, slots=True)
class _Waits:
    """Waits of tracks whose entry was seen, one element each; hour is a place in `Hours`."""

    area: Ints
    camera: Ints
    hour: Ints
    outcome: Ints
    was_served: Flags
    dwell_s: Array
    wait_s: Array

    def of(self, chosen: Flags) -> _Waits:
        return _Waits(*(getattr(self, name)[chosen] for name in self.__slots__))


def queues(period: Period) -> tuple[Answer, Answer]:
    """Return each queue of a floor, in the order of vsd.toml: over the days, and by hour of the day.

    Columns of both: mean number of people waiting (M39); median and 90 % quantile of the wait of those who are served,
    share of those who enter that leave before the end (M40); entries that were seen, and how they ended. Over the days
    also the number of people that is not exceeded for 90 % of the time, how long people stay in the queue however that
    ends, with the check by Little's law, and people who came back from the area of service, who do not wait.
    Waiting times need an end of the queue (`served_in`) and track ids; where these lack, a reason says so.
    """
    data = period.data
    asked = [a for a in data.areas if a.is_queue]
    if not asked:
        empty = (("queues", QUEUE_COLUMNS), ("queue_hours", HOUR_COLUMNS))
        none, none_by_hour = (
            Answer(name, columns, (), period.holds_for, nothing=Reason("queues.not_asked")) for name, columns in empty
        )
        return none, none_by_hour
    rows = data.warehouse.table(_WAITS, {"floor": data.floor.floor_id, "first": period.first, "last": period.last})
    waits = _Waits(
        positions(rows["area_id"], [a.area_id for a in asked], otherwise=-1),
        positions(rows["counted_by"], data.ids, otherwise=-1),
        np.searchsorted(data.hours.start_ms, rows["hour_start_ms"].to_numpy()),
        np.array([_OUTCOMES[o] for o in rows["outcome"].to_pylist()], dtype=np.int64),
        rows["was_served"].to_numpy(zero_copy_only=False).astype(np.bool_),
        rows["dwell_s"].to_numpy(),
        rows["wait_s"].to_numpy(),
    )
    is_used = data.hours.is_counted[waits.camera, waits.hour]
    hidden = hidden_times(period)
    queue_rows = [_queue(period, area, waits.of(is_used & (waits.area == k))) for k, area in enumerate(asked)]
    whys = [hidden.get(area.area_id) for area in asked]
    of_days = tuple(timeless(row, why, _TIMES) for (row, _), why in zip(queue_rows, whys, strict=True))
    by_hour = tuple(
        timeless(row, why, _HOUR_TIMES)
        for (week, rows), hidden_week in zip(queue_rows, whys, strict=True)
        for row, why in zip(rows, _hidden_hours(period, week, rows, hidden_week), strict=True)
    )
    notes = ((None, Reason("note.queues")), *((k, n) for k, row in enumerate(of_days) for n in _row_notes(row)))
    sums = (Sum("n_entered", _ENDS), Sum("n_entered", ("n_left", "n_not_left")))
    of_hours = (Sum("n_entered", ("queue_hours.n_entered",)), Sum("n_left", ("queue_hours.n_left",)))
    return (
        Answer("queues", QUEUE_COLUMNS, of_days, period.holds_for, (*sums, *of_hours), notes),
        Answer("queue_hours", HOUR_COLUMNS, by_hour, period.holds_for, sums),
    )


def _hidden_hours(period: Period, week: Row, hours: Sequence[Row], why: Reason | None) -> list[Reason | None]:
    """Return why the times of hours of the day are hidden: as those of the week, or as they would be known by it."""
    if why is not None or value_of(week, "people_waiting").value is None:
        return [why] * len(hours)
    times = {int(str(row["local_hour"])): value_of(row, "people_waiting").value or 0.0 for row in hours}
    hidden = hidden_hours_of_day(period, str(week["area_id"]), times)
    return [hidden.get(hour) for hour in times]


def _queue(period: Period, area: Area, waits: _Waits) -> tuple[Row, tuple[Row, ...]]:
    """Return the row of a queue over the days, and its rows by hour."""
    present = Presence(period, area)
    why = _why_no_waits(period, area, present)
    recorded = [hours_that_stand_for_all(period, is_known) for is_known in period.data.hours.is_counted]
    of_day = period.data.hours.hour[waits.hour]
    people = present.mean()
    none = unknown_count(people, len(waits.hour)) if why is None else Value.missing(why, "not_measurable")
    times, stays = None, None
    if none is None:
        every = [recorded[c] for c in np.unique(waits.camera).tolist()]
        times, stays = _of_open_hours(_waiting(period, waits, recorded), every), _stays(period, area, waits)
    place: Row = {"floor_id": period.data.floor.floor_id, "area_id": area.area_id}
    row: Row = {
        **place,
        "name": area.name,
        "people_waiting": Value.of(people),
        "people_waiting_p90": Value.of(present.quantile(BUSY_SHARE), state=people.state, reason=people.reason),
        **_wait_cells(times, none),
        **_stay_cells(stays, none),
        "n_back": none or Value(int(waits.was_served.sum())),
        "n_days": 0 if times is None else times.n_days,
        "recorded_open_h": people.exposure_h,
        "recorded_share": Value(present.recorded_share),
        "silent_cameras": present.silent_cameras,
        "unrecorded_hours": present.unrecorded_hours,
    }
    hours = []
    for hour in sorted({*present.hours_of_day(), *present.unrecorded_hours, *of_day.tolist()}):
        of_hour, here = present.mean(hour=hour), waits.of(of_day == hour)
        unknown = none or unknown_count(of_hour, len(here.hour))
        cells = _wait_cells(None if unknown else _waiting(period, here, recorded), unknown)
        people_cells: Row = {"people_waiting": Value.of(of_hour), "recorded_open_h": of_hour.exposure_h}
        hours.append({**place, "local_hour": hour, "name": area.name, **people_cells, **cells})
    return row, tuple(hours)


def _wait_cells(times: WaitTimes | None, none: Value | None) -> Row:
    """Return waiting times as cells, or why there are none."""
    names = ("wait_median_s", "wait_p90_s", "left_share", "n_entered", *_ENDS, "n_not_left")
    if times is None:
        return dict.fromkeys(names, none or Value.missing(None))
    return {
        "wait_median_s": Value.of(times.median, state=times.state, reason=times.reason),
        "wait_p90_s": Value.of(times.p90, state=times.state, reason=times.reason),
        "left_share": Value.of(times.left_share),
        "n_entered": Value(times.n_entered),
        "n_served": Value(times.n_served),
        "n_left": Value(times.n_left),
        "n_cut": Value(times.n_cut),
        "n_not_left": Value(times.n_entered - times.n_left),
    }


def _stay_cells(stays: Dwell | None, none: Value | None) -> Row:
    if stays is None:
        names = ("stay_mean_s", "stay_mean_little_s", "little_ratio")
        return {**dict.fromkeys(names, none or Value.missing(None)), "means_agree": None}
    little = stays.little
    return {
        "stay_mean_s": Value.of(little.by_tracks),
        "stay_mean_little_s": Value.of(little.by_little),
        "little_ratio": Value.of(little),
        "means_agree": little.agrees,
    }


def _row_notes(row: Row) -> list[Reason]:
    """Return what a reader must know of one queue."""
    notes = [*unknown_hours_notes(row)]
    if row["means_agree"] is False:
        ratio = value_of(row, "little_ratio").value or 1.0
        notes.append(Reason("visits.entries_missed" if ratio > 1 else "visits.entered_twice"))
    return notes


def _why_no_waits(period: Period, area: Area, present: Presence) -> Reason | None:
    if area.served_in is None:
        return NO_END
    if not present.cameras.any():
        return NOBODY
    without = cameras_without_ids(period)
    seeing = [c for c, sees in zip(period.data.ids, present.cameras.tolist(), strict=True) if sees]
    return NO_TRACK_IDS if without.issuperset(seeing) else None


def _waiting(period: Period, seen: _Waits, recorded: Sequence[RecordedHours]) -> WaitTimes:
    """Return the waiting times of those who did not come back from the area of service.

    Who enters in an hour of the week that its camera missed on other days also counts for those who entered then.
    """
    waited, settings = seen.of(~seen.was_served), period.data.site.settings
    return waiting(
        np.maximum(waited.wait_s, 0.0),
        waited.outcome,
        period.data.hours.day[waited.hour],
        weight=np.array([r.weight for r in recorded])[waited.camera, waited.hour] if recorded else None,
        **settings.for_intervals,
    )


def _of_open_hours(times: WaitTimes, recorded: Sequence[RecordedHours]) -> WaitTimes:
    """Return waiting times without intervals where they are those of some hours of the day alone."""
    missed = [r for r in recorded if not r.covers_all]
    if not missed or times.reason is not None:
        return times
    why = why_not_all(max(missed, key=lambda r: r.unknown_share))
    median, p90 = (QuantileEstimate(q.q, q.value, None, None) for q in (times.median, times.p90))
    share = replace(times.left_share, lo=None, hi=None, state="not_enough_data", reason=why)
    return replace(times, median=median, p90=p90, left_share=share, state="not_enough_data", reason=why)


def _stays(period: Period, area: Area, seen: _Waits) -> Dwell:
    """Return how long people are in the queue, whoever they are: all of its person-time beside all entries."""
    place, used = period.area(area.area_id), period.data.hours.is_counted & period.is_inside
    long_s = period.data.site.settings.long_visit_s
    return dwell_of(period, place, used, seen.dwell_s, seen.outcome == CUT, seen.hour, long_s=long_s)
