"""Cameras watched over weeks: does one lose or gain people beside its neighbours?

The arithmetic is `vsd_analytics.stats.camera_drift`. A recall that falls in one camera looks like a redesign that works
in its areas; so does an area that people leave. The records cannot tell one from the other, and the words name both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Final, Literal

import numpy as np

from vsd_analytics.answer import Column, Reason, Row, Value
from vsd_analytics.figures.change_weeks import REFERENCE_WEEKS
from vsd_analytics.figures.compare import Days
from vsd_analytics.figures.panels import WEEK, FloorHours
from vsd_analytics.site.model import Floor, Site
from vsd_analytics.stats.camera_drift import MIN_REFERENCE, drifts, is_watched, shares
from vsd_analytics.stats.hour_of_week import SLOTS
from vsd_analytics.stats.period_days import Bools, Floats
from vsd_analytics.warehouse.stored_days import stored_extent
from vsd_analytics.warehouse.warehouse import open_warehouse

STEADY: Final = Reason("watch.steady")
BEGINS: Final = (1, 27)
"""ISO weeks with which the watch starts again: weeks that roll on would give three times as many false alarms."""
DAY: Final = timedelta(days=1)
WATCH: Final = (
    Column("camera_id", "key"),
    Column("name", "fact"),
    Column("share_verdict", "fact", "watch"),
    Column("since", "fact"),
    Column("people_change", "rate", "change", "M29", audience="operator"),
)
"""Columns of `camera_watch`."""


@dataclass(frozen=True, slots=True)
class CameraWatch:
    """What became of a camera's share of the people.

    Attributes:
        camera_id, name: The camera.
        verdict: "loses" or "gains" people beside its neighbours; "steady"; None where it is not watched.
        since: First day of the week from which on; None where it is steady.
        change: Relative change of its people beside them, mean of four weeks; None likewise.
        reason: The sentence on it; None where it is steady.
    """

    camera_id: str
    name: str
    verdict: Literal["loses", "gains", "steady"] | None
    since: date | None = None
    change: float | None = None
    reason: Reason | None = None

    @property
    def is_moved(self) -> bool:
        """Tell whether it loses or gains people beside its neighbours."""
        return self.verdict in ("loses", "gains")


def watch(data: FloorHours, reference: Days, watched: Days) -> tuple[CameraWatch, ...]:
    """Return what became of each camera of a floor, in the order of vsd.toml.

    Hours of public holidays and of the calendar's events are left out: an area may feel them more than others do.

    Args:
        data: The floor.
        reference: Whole weeks that say what is usual.
        watched: Whole weeks after them.
    """
    n_reference, n_watched = (((last - first).days + 1) // 7 for first, last in (reference, watched))
    if len(data.cameras) <= 1:
        return tuple(CameraWatch(c.camera_id, c.name, None, reason=Reason("watch.alone")) for c in data.cameras)
    sides = [_weeks(data, days[0], n) for days, n in ((reference, n_reference), (watched, n_watched))]
    people, is_counted = (np.concatenate(parts, axis=1) for parts in zip(*sides, strict=True))
    share = shares(people, is_counted, n_reference=n_reference)
    known = is_watched(share, n_reference=n_reference)
    few = Reason("watch.weeks", least=MIN_REFERENCE)
    watches = []
    for k, drift in enumerate(drifts(share, n_reference=n_reference)):
        camera = data.cameras[k]
        if not known[k]:
            watches.append(CameraWatch(camera.camera_id, camera.name, None, reason=few))
        elif drift is None:
            watches.append(CameraWatch(camera.camera_id, camera.name, "steady"))
        else:
            verdict: Literal["loses", "gains"] = "loses" if drift.change < 0 else "gains"
            since = watched[0] + drift.since * WEEK
            why = Reason(f"watch.{verdict}", camera=camera.name, beside=_beside(data, k), day=str(since))
            watches.append(CameraWatch(camera.camera_id, camera.name, verdict, since, drift.change, why))
    return tuple(watches)


def watch_days(site: Site, until: date) -> tuple[Days, Days] | None:
    """Return the reference and the weeks watched of a watch that ends with a day, a Sunday; None with too few weeks.

    It begins with the half-year of ISO weeks, after twelve weeks of reference, or after the first twelve stored.
    """
    extent = stored_extent(site, near=until)
    if extent is None:
        return None
    first = extent.first_day + timedelta(days=-extent.first_day.weekday() % 7)
    monday = until - timedelta(days=6)
    year, week, _ = monday.isocalendar()
    begin = date.fromisocalendar(year, max(b for b in BEGINS if b <= week), 1)
    begin = max(begin, first + REFERENCE_WEEKS * WEEK)
    if begin > monday:
        return None
    return (begin - REFERENCE_WEEKS * WEEK, begin - DAY), (begin, until)


def floor_watch(site: Site, floor: Floor, until: date) -> tuple[CameraWatch, ...]:
    """Return what became of each camera of a floor in the half-year of weeks that ends with a Sunday."""
    spans = watch_days(site, until)
    if spans is None or sum(c.floor_id == floor.floor_id for c in site.cameras) == 1:
        why = Reason("watch.stored") if spans is None else Reason("watch.alone")
        cameras = [c for c in site.cameras if c.floor_id == floor.floor_id]
        return tuple(CameraWatch(c.camera_id, c.name, None, reason=why) for c in cameras)
    with open_warehouse(site, spans[0][0], until, relations=("camera_hours",)) as warehouse:
        return watch(FloorHours(warehouse, floor=floor), *spans)


def watch_rows(watches: Sequence[CameraWatch]) -> list[Row]:
    """Return the rows of `camera_watch`: by camera its verdict, since when, and the change of its people."""
    return [
        {
            "camera_id": c.camera_id,
            "name": c.name,
            "share_verdict": c.verdict,
            "since": c.since,
            "people_change": Value(c.change) if c.change is not None else Value.missing(c.reason or STEADY),
        }
        for c in watches
    ]


def watch_notes(watches: Sequence[CameraWatch]) -> tuple[tuple[int | None, Reason], ...]:
    """Return the sentences on the cameras by row."""
    return tuple((k, c.reason) for k, c in enumerate(watches) if c.reason is not None)


def _beside(data: FloorHours, camera: int) -> Reason:
    others = [c for k, c in enumerate(data.cameras) if k != camera]
    return Reason("watch.neighbour", camera=others[0].name) if len(others) == 1 else Reason("watch.neighbours")


def _weeks(data: FloorHours, first: date, n_weeks: int) -> tuple[Floats, Bools]:
    """Return person-hours and what was counted by camera, week and hour of the week from a day on."""
    hours, calendar = data.hours, data.site.calendar
    special = {
        d.toordinal()
        for k in range(7 * n_weeks)
        if calendar.holiday(d := first + timedelta(days=k)) is not None or calendar.event(d) is not None
    }
    week = (hours.day - first.toordinal()) // 7
    inside = (week >= 0) & (week < n_weeks)
    slot = (week * SLOTS + 24 * hours.weekday + hours.hour)[inside]
    is_known = hours.is_counted & hours.knows_people & ~np.isin(hours.day, list(special))

    def by_slot(values: Floats) -> Floats:
        sums = [np.bincount(slot, weights=row[inside], minlength=n_weeks * SLOTS) for row in values]
        return np.array(sums, dtype=np.float64).reshape(len(data.ids), n_weeks, SLOTS)

    people, n_known = by_slot(np.where(is_known, data.everyone.exposure_h, 0.0)), by_slot(is_known.astype(np.float64))
    return people, n_known > 0
