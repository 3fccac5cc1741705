"""The hours of a week and what was counted in them: of all places for the operator, of the whole floor for readers."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from functools import cached_property

import numpy as np
from shapely.geometry.base import BaseGeometry

from vsd_analytics.answer import Reason
from vsd_analytics.figures.panels import Array, Flags, Ints, Place
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.figures.share.merged import merge_small_counts
from vsd_analytics.figures.share.together import equal_parts
from vsd_analytics.figures.week.data import WeekData
from vsd_analytics.figures.week.model_map import Extent
from vsd_analytics.planner.cell_counts import CellsAsked, grid_of
from vsd_analytics.site.model import Area, Floor
from vsd_analytics.warehouse.warehouse import Warehouse


class TwoWeeks(WeekData):
    """A week of a floor and any earlier (or later) one it is compared with.

    Args:
        warehouse: Opened over both weeks and the five before this one.
        floor: The floor.
        monday: First day of the week.
        before: First day of the other.
        clock: The present; None = both weeks are over.
    """

    def __init__(
        self, warehouse: Warehouse, *, floor: Floor, monday: date, before: date, clock: datetime | None = None
    ) -> None:
        super().__init__(warehouse, floor=floor, monday=monday, clock=clock)
        self.pair = TwoPeriods(Period(self, before, before + timedelta(days=6)), self.this)

    @cached_property
    def until_ms(self) -> int | None:
        """Return the UTC start of the first hour that is not over, where one of the two weeks is begun and not over."""
        starts_ms = (period.not_over_ms for period in (self.pair.now, self.pair.before))
        return next((ms for ms in starts_ms if ms is not None), None)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class HourPanel:
    """Hours of some days, and what was counted in them.

    Attributes:
        day: Days since the first day of the period, shape (n_slots,), rising.
        weekday: 0 Monday to 6 Sunday, same shape.
        hour: Local hour, 0 to 23, same shape.
        fold: 1 for the second of two equal local hours, same shape.
        recorded_ms: Recorded opening time, shape (n_cameras, n_slots).
        is_counted: Camera-hours that enter rates, same shape.
        n: Violations, shape (n_places, n_cameras, n_slots); no count is from 1 to under `mask_below`. A page for
            readers has one place, the whole floor, and one row in place of the cameras, all together.
        exposure_ms: Person-milliseconds, same shape.
        close_ms: Those in violation, same shape; with a count that is merged goes the time of its hour.
    """

    day: Ints
    weekday: Ints
    hour: Ints
    fold: Ints
    recorded_ms: Ints
    is_counted: Flags
    n: Ints
    exposure_ms: Ints
    close_ms: Ints


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Counted:
    """What is counted where.

    Attributes:
        places: The whole floor, its areas, the rest.
        areas: The places after the first: areas, and None for the rest.
        close_h: Person-hours in violation of each place, shape (n_cameras, n_hours).
        extent: The floor shown; None without a map.
    """

    places: Sequence[Place]
    areas: Sequence[Area | None]
    close_h: Sequence[Array]
    extent: Extent | None

    def cells_asked(
        self,
        data: WeekData,
        slots: Ints,
        *,
        used: Flags,
        shared: Flags,
        hidden: Collection[int],
        is_by_hour: bool = True,
        untimed: BaseGeometry | None = None,
    ) -> CellsAsked | None:
        """Return what of a week's cells is asked for; None without a map of at most so many squares.

        Args:
            data: The floor.
            slots: As for `CellsAsked`, as `used` and `shared`.
            used: Camera-hours that take part.
            shared: Those that are compared.
            hidden: Places whose counts are not given.
            is_by_hour: As for `CellsAsked`, as `untimed`.
            untimed: See there.
        """
        grid = None if self.extent is None else grid_of(self.extent)
        if self.extent is None or grid is None:
            return None
        return CellsAsked(
            slots=slots,
            used=used,
            shared=shared,
            extent=self.extent,
            grid=grid,
            mask=data.mask,
            hidden=None if 0 in hidden else [a for k, a in enumerate(self.areas, 1) if k in hidden],
            is_by_hour=is_by_hour,
            untimed=untimed,
        )


def open_slots(data: TwoWeeks, days: Sequence[date]) -> Ints:
    """Return which hours of the floor are open, in some days; hours that are not over yet are none of them."""
    ordinals = [d.toordinal() for d in days]
    is_open = np.isin(data.hours.day, ordinals) & (data.hours.open_s > 0)
    if data.until_ms is not None:
        is_open &= data.hours.start_ms < data.until_ms
    return np.flatnonzero(is_open)


def panel_of(
    data: TwoWeeks,
    days: Sequence[date],
    asked: Counted,
    mondays: Sequence[date],
    *,
    hidden: Collection[int],
    shared: Flags | None = None,
) -> HourPanel:
    """Return the open hours of some days; hours that a week's report holds back are given as one sum, in one of them.

    A camera with too small a count in a place is merged with the camera that counts most there.

    Args:
        data: The floor.
        days: The days.
        asked: What is counted where.
        mondays: First days of the weeks, whose timetables hold back the counts of hours; the earliest is day 0.
        hidden: Places whose counts are not given.
        shared: Camera-hours that are compared with another week; small counts stay on their side.
    """
    slots, hours = open_slots(data, days), data.hours
    counted = hours.is_counted[:, slots]
    day = hours.day[slots] - min(mondays).toordinal()
    shape = (len(asked.places), len(data.ids), len(slots))
    n, exposure_ms, close_ms = (np.zeros(shape, dtype=np.int64) for _ in range(3))
    held = _held_hours(data, mondays)
    for k, (place, close_h) in enumerate(zip(asked.places, asked.close_h, strict=True)):
        used = counted & place.cameras[:, None]
        if data.why_no_exposure is None:
            exposure_ms[k] = np.where(counted, np.rint(place.exposure_h[:, slots] * 3_600_000), 0)
        if k in hidden:
            continue
        counts = np.where(used, place.n[:, slots], 0).astype(np.int64)
        close = np.where(counted, np.rint(np.nan_to_num(close_h[:, slots]) * 3_600_000), 0).astype(np.int64)
        for of_week in held if k == 0 else ():
            together = np.isin(slots, list(of_week))
            if not together.any():
                continue
            to = int(np.flatnonzero(together)[np.argmax(counts[:, together].sum(axis=0))])
            for values in (counts, close):
                sums = values[:, together].sum(axis=1)
                values[:, together] = 0
                values[:, to] = sums
        left = np.zeros(2, dtype=np.int64)
        for c, row_n in enumerate(counts):
            side = np.zeros_like(day) if shared is None else shared[c, slots].astype(np.int64)
            order = np.lexsort((side, day))
            groups = (2 * day[order] + side[order], day[order])
            given = merge_small_counts(np.stack((row_n, close[c]))[:, order], groups=groups, mask=data.mask)
            n[k, c, order], close_ms[k, c, order] = given.values
            left += given.n_dropped
        if n[k].any() or (left[0] and not data.mask.hides(int(left[0]))):
            to = int((n[k] if n[k].any() else counts).argmax())
            n[k].flat[to] += left[0]
            close_ms[k].flat[to] += left[1]
    return HourPanel(
        day=day,
        weekday=hours.weekday[slots],
        hour=hours.hour[slots],
        fold=hours.fold[slots],
        recorded_ms=np.rint(hours.recorded_s[:, slots] * 1000).astype(np.int64),
        is_counted=counted,
        n=n,
        exposure_ms=exposure_ms,
        close_ms=close_ms,
    )


def floor_panel(
    data: TwoWeeks, days: Sequence[date], asked: Counted, mondays: Sequence[date], *, is_hidden: bool
) -> HourPanel:
    """Return the open hours of some days for readers: what the report's timetable has, of all cameras together.

    An hour is counted if all cameras recorded it that recorded any of its week. Hours that a timetable hides have equal
    parts of their sum where the week tells that sum, and hours of few people equal parts of their time. All hours that
    are held back are counted, or none: without the hour beside them, the parts would be the time of few people.

    Args:
        data: The floor.
        days: The days.
        asked: What is counted where; only its first place, the whole floor, is.
        mondays: First days of the weeks; the earliest is day 0.
        is_hidden: The floor's counts are not given.
    """
    slots, hours, cameras = open_slots(data, days), data.hours, asked.places[0].cameras
    counted = hours.is_counted[:, slots] & cameras[:, None]
    n, exposure_ms, close_ms = (
        np.where(counted, np.rint(np.nan_to_num(amounts[:, slots]) * scale), 0).sum(axis=0).astype(np.int64)
        for amounts, scale in (
            (asked.places[0].n, 1),
            (asked.places[0].exposure_h, 3_600_000),
            (asked.close_h[0], 3_600_000),
        )
    )
    recorded_ms, is_counted = np.zeros_like(n), np.zeros(len(slots), dtype=np.bool_)
    recorded_s = hours.recorded_s[:, slots] * cameras[:, None]
    for monday in mondays:
        of_week = np.isin(hours.day[slots] - monday.toordinal(), range(7))
        recording = counted[:, of_week].any(axis=1)
        if not recording.any():
            continue
        is_counted[of_week] = counted[np.ix_(recording, of_week)].all(axis=0)
        recorded_ms[of_week] = np.rint(recorded_s[np.ix_(recording, of_week)].mean(axis=0) * 1000)
        week = data.hidden_in(monday)
        hidden = np.isin(slots, list(week.hours.small | week.hours.others))
        is_sum_known = not ((recorded_s > 0) & ~counted)[:, of_week].any()
        untimed = np.isin(slots, list(week.untimed))
        is_held = hidden | untimed
        is_counted[is_held] &= (is_sum_known or not hidden.any()) and bool(is_counted[is_held].all())
        for values, at in ((n, hidden), (exposure_ms, untimed), (close_ms, is_held)):
            values[at] = equal_parts(int(values[at].sum()), int(at.sum()))
        if week.why_untimed is not None:
            exposure_ms[of_week] = close_ms[of_week] = 0
    for values in (n, close_ms) if is_hidden else ():
        values[:] = 0
    for values in (n, exposure_ms, close_ms, recorded_ms):
        values[~is_counted] = 0
    return HourPanel(
        day=hours.day[slots] - min(mondays).toordinal(),
        weekday=hours.weekday[slots],
        hour=hours.hour[slots],
        fold=hours.fold[slots],
        recorded_ms=recorded_ms[None],
        is_counted=is_counted[None],
        n=n[None, None],
        exposure_ms=exposure_ms[None, None],
        close_ms=close_ms[None, None],
    )


def hidden_places(data: TwoWeeks, mondays: Sequence[date], areas: Sequence[Area | None]) -> Mapping[int, Reason]:
    """Return why places are not given: what the report of one of some weeks holds back (`report.hidden`).

    Args:
        data: The floor.
        mondays: First days of the weeks.
        areas: The places after the whole floor, which is the first: areas, and None for the rest.
    """
    reasons: dict[int, Reason] = {}
    for week in map(data.hidden_in, mondays):
        if week.why_floor is not None:
            reasons.setdefault(0, week.why_floor)
        for k, area in enumerate(areas, 1):
            why = data.mask.why_held_back(week.places, None if area is None else area.area_id)
            if why is not None:
                reasons.setdefault(k, why)
    return dict(sorted(reasons.items()))


def _held_hours(data: TwoWeeks, mondays: Sequence[date]) -> list[Collection[int]]:
    """Return the hours whose counts the timetables of some weeks hold back, week by week."""
    weeks = (data.hidden_in(monday).hours for monday in mondays)
    return [week.small | week.others for week in weeks if week.small or week.others]
