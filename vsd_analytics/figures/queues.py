"""Queues: how many people wait (M39), how long, and how many leave before the end (M40), by hour and for the days.

Only areas with `queue = true` in vsd.toml; waiting times need `served_in`, the area into which served people step. How
waiting times are found: `vsd_analytics.stats.waiting`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.panels import Array, Flags, Ints, positions
from vsd_analytics.figures.people_present import (
    NOBODY,
    PeopleQuantile,
    Presence,
    hours_that_stand_for_all,
    why_not_all,
)
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.visits import NO_TRACK_IDS, cameras_without_ids, dwell_of
from vsd_analytics.site.model import Area
from vsd_analytics.stats.durations import QuantileEstimate
from vsd_analytics.stats.dwell import Dwell
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.stats.recorded_hours import RecordedHours
from vsd_analytics.stats.waiting import CUT, LEFT, SERVED, WaitTimes, waiting

BUSY_SHARE: Final = 0.9
NO_END: Final = Reason("waits.no_end")
_OUTCOMES: Final = {"cut": CUT, "served": SERVED, "left": LEFT}
_WAITS: Final = """
select
    area_id,
    camera_id,
    hour_start_ms,
    outcome,
    was_served,
    dwell_s::double as dwell_s,
    wait_s::double as wait_s
from waits
where floor_id = $floor and has_entry and is_counted and is_open and local_date between $first and $last
order by started_ms, camera_id, track_id, area_id
"""


@dataclass(frozen=True, slots=True)
class QueueHour:
    """One hour of the day of a queue.

    Attributes:
        hour: Local hour, 0 to 23.
        people: Mean number of people waiting in it.
        waits: Waiting times of those who entered in it; None without an end of the queue.
    """

    hour: int
    people: RateEstimate
    waits: WaitTimes | None


@dataclass(frozen=True, slots=True)
class QueueWaits:
    """The waiting times of a queue with an end.

    Attributes:
        waits: Of those who entered the queue from elsewhere.
        stays: How long people stay in the queue, however that ends, with the check by Little's law.
        n_back: Stays of people who came out of the area of service: they do not wait.
    """

    waits: WaitTimes
    stays: Dwell
    n_back: int


@dataclass(frozen=True, slots=True)
class AreaQueue:
    """A queue over a period.

    Attributes:
        area: The area.
        people: Mean number of people waiting, with its interval.
        busy: Number of people that is not exceeded for 90 % of the time.
        waiting: Waiting times; None where `why_no_waits` says why.
        why_no_waits: No end is stated, or the engine sends no track ids.
        by_hour: By hour of the day.
        recorded_share: Share of the opening hours in which all its cameras recorded.
        silent_cameras: Cameras that see it and recorded nothing.
        unrecorded_hours: Open hours of the day that were never recorded: the figures are of the other hours.
    """

    area: Area
    people: RateEstimate
    busy: PeopleQuantile
    waiting: QueueWaits | None
    why_no_waits: Reason | None
    by_hour: tuple[QueueHour, ...]
    recorded_share: float
    silent_cameras: tuple[str, ...]
    unrecorded_hours: tuple[int, ...]


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


def queues(period: Period) -> tuple[AreaQueue, ...]:
    """Return each queue of a floor, in the order of vsd.toml."""
    data = period.data
    asked = [a for a in data.areas if a.is_queue]
    if not asked:
        return ()
    rows = data.warehouse.table(_WAITS, {"floor": data.floor.floor_id, "first": period.first, "last": period.last})
    seen = _Waits(
        positions(rows["area_id"], [a.area_id for a in asked], otherwise=-1),
        positions(rows["camera_id"], data.ids, otherwise=-1),
        np.searchsorted(data.hours.start_ms, rows["hour_start_ms"].to_numpy()),
        np.array([_OUTCOMES[o] for o in rows["outcome"].to_pylist()], dtype=np.int64),
        rows["was_served"].to_numpy(zero_copy_only=False).astype(np.bool_),
        rows["dwell_s"].to_numpy(),
        rows["wait_s"].to_numpy(),
    )
    is_used = data.hours.is_counted[seen.camera, seen.hour]
    return tuple(_queue(period, area, seen.of(is_used & (seen.area == k))) for k, area in enumerate(asked))


def _queue(period: Period, area: Area, seen: _Waits) -> AreaQueue:
    present = Presence(period, area)
    why = _why_no_waits(period, area, present)
    recorded = [hours_that_stand_for_all(period, is_known) for is_known in period.data.hours.is_counted]
    of_day = period.data.hours.hour[seen.hour]
    found = None
    if why is None:
        waits = _of_open_hours(_waiting(period, seen, recorded), [recorded[c] for c in np.unique(seen.camera).tolist()])
        found = QueueWaits(waits, _stays(period, area, seen), int(seen.was_served.sum()))
    return AreaQueue(
        area,
        present.mean(),
        present.quantile(BUSY_SHARE),
        found,
        why,
        tuple(
            QueueHour(h, present.mean(hour=h), None if why else _waiting(period, seen.of(of_day == h), recorded))
            for h in present.hours_of_day()
        ),
        present.recorded_share,
        present.silent_cameras,
        present.unrecorded_hours,
    )


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


def _of_open_hours(found: WaitTimes, recorded: Sequence[RecordedHours]) -> WaitTimes:
    """Return waiting times without intervals where they are those of some hours of the day alone."""
    missed = [r for r in recorded if not r.covers_all]
    if not missed or found.reason is not None:
        return found
    why = why_not_all(max(missed, key=lambda r: r.unknown_share))
    median, p90 = (QuantileEstimate(q.q, q.value, None, None) for q in (found.median, found.p90))
    share = replace(found.left_share, lo=None, hi=None, state="not_enough_data", reason=why)
    return replace(found, median=median, p90=p90, left_share=share, state="not_enough_data", reason=why)


def _stays(period: Period, area: Area, seen: _Waits) -> Dwell:
    """Return how long people are in the queue, whoever they are: all of its person-time beside all entries."""
    place, used = period.area(area.area_id), period.data.hours.is_counted & period.is_inside
    long_s = period.data.site.settings.long_visit_s
    return dwell_of(period, place, used, seen.dwell_s, seen.outcome == CUT, seen.hour, long_s=long_s)
