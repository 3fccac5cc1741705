"""The marts of one floor around one week, and the week beside the week before (`vsd_analytics.figures.periods`).

A study of other days in a row is made of the same parts: its "week" is these days, and the week before as many days.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import date, datetime, timedelta
from functools import cached_property

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.panels import WEEK, Flags, FloorHours, Panel, Place
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.figures.share import earlier
from vsd_analytics.figures.share.running import Release
from vsd_analytics.figures.share.times import hidden_times
from vsd_analytics.figures.share.weeks import NOT_AGAIN, HiddenWeek, hidden_week
from vsd_analytics.site.model import Calibration, Camera, Floor
from vsd_analytics.warehouse.warehouse import Warehouse


class WeekData(FloorHours):
    """The marts of a floor around one week.

    Args:
        warehouse: Opened over the week and the weeks before it that are to be used.
        floor: The floor.
        monday: First day of the week.
        last: Last day of a range that is no week; None = the week's Sunday.
        clock: The present; None = the week is over.
        released: What leaves of a week that goes on, whose last day is then `last`; None = the days are over.

    Attributes:
        sunday: Its last day.
        span: How long it is.
        is_week: False where `last` was given.
        this: The week.
        pair: The week before and this week.
    """

    def __init__(
        self,
        warehouse: Warehouse,
        *,
        floor: Floor,
        monday: date,
        last: date | None = None,
        clock: datetime | None = None,
        released: Release | None = None,
    ) -> None:
        super().__init__(warehouse, floor=floor, clock=clock)
        self._released = released
        self.monday, self.sunday = monday, monday + timedelta(days=6) if last is None else last
        self.is_week = last is None
        self.span = self.sunday + timedelta(days=1) - monday
        self.areas = [a for a in self.areas if a.is_there(monday, self.sunday)]
        # a camera that comes later or is gone is no row of the page; without any, the page says what is missing
        self.present = [c for c in self.cameras if c.is_there(monday, self.sunday)] or self.cameras
        self.this = Period(self, monday, self.sunday)
        self.pair = TwoPeriods(Period(self, monday - self.span, monday - timedelta(days=1)), self.this)
        self._hidden: dict[date, HiddenWeek] = {}
        self._left: set[date] = set()
        if self.mask.is_on:
            self._tell_warehouse()

    @property
    def week_days(self) -> list[date]:
        """Return Monday to Sunday."""
        return self.this.days

    def week(self, monday: date | None = None) -> Flags:
        """Return which hours lie in the week that starts on `monday`; None = this week."""
        first = monday or self.monday
        return self.inside(first, first + self.span - timedelta(days=1))

    @cached_property
    def not_over_ms(self) -> int | None:
        """Return the UTC start of the first hour of this week that is not over (`Period.not_over_ms`)."""
        return self.this.not_over_ms

    def week_so_far(self) -> Flags:
        """Return which hours of this week are over."""
        return self.week() if self.not_over_ms is None else self.week() & (self.hours.start_ms < self.not_over_ms)

    def compared(self, place: Place, *, since: int | None = None) -> tuple[Panel, Panel]:
        """Return the panels of the week before and of this week; see `TwoPeriods.compared`."""
        return self.pair.compared(place, since=since)

    @cached_property
    def hidden(self) -> HiddenWeek:
        """Return what is held back of this week."""
        return self.hidden_in(self.monday)

    @property
    def hidden_before(self) -> HiddenWeek:
        """Return what is held back of the week it is compared with, whose own report says as little."""
        return self.hidden_in(self.pair.before.first)

    def hidden_in(self, monday: date) -> HiddenWeek:
        """Return what is held back of the week that starts on `monday`."""
        self._left.add(monday)
        return self._held(monday)

    def _held(self, monday: date) -> HiddenWeek:
        if monday not in self._hidden:
            is_asked = monday in (self.monday, self.pair.before.first)
            period = Period(self, monday, monday + (self.span if is_asked else WEEK) - timedelta(days=1))
            unready = self._released.unready if self._released and monday == self.monday else ()
            self._hidden[monday] = hidden_week(self, period, self._shared_before, unready=unready)
        return self._hidden[monday]

    def _tell_warehouse(self) -> None:
        """Tell the warehouse which hours and days of its weeks readers know as one sum, or not at all.

        So everything that is computed from it, intervals too, tells no more of them.
        """
        recorded = np.unique(self.hours.day[(self.hours.recorded_s > 0).any(axis=0)]).tolist()
        weeks = {date.fromordinal(day - (day - 1) % 7) for day in recorded}
        held = {monday: self._held(monday) for monday in sorted(weeks)}
        groups = [
            [frozenset(self.hours.start_ms[list(hours)].tolist()) for hours in sets if hours]
            for sets in ([w.hours.small | w.hours.others for w in held.values()], [w.untimed for w in held.values()])
        ]
        warehouse, floor_id = self.warehouse, self.floor.floor_id
        warehouse.counted_together[floor_id], warehouse.timed_together[floor_id] = (tuple(sets) for sets in groups)
        without = [monday for monday, week in held.items() if week.why_floor is not None and monday != self.monday]
        warehouse.withheld_days[floor_id] = frozenset(m + timedelta(days=d) for m in without for d in range(7))

    @property
    def is_released(self) -> bool:
        """Tell whether these are the days of a week that goes on which may leave."""
        return self._released is not None

    @property
    def untimed(self) -> frozenset[str | None]:
        """Return the areas whose person-time does not leave before the week is over."""
        return frozenset() if self._released is None else self._released.untimed

    @cached_property
    def _shared_before(self) -> Sequence[earlier.SharedWeek]:
        return earlier.read(self.site)

    @property
    def is_shared_otherwise(self) -> bool:
        """Tell whether this week was shared before, and what changed since, or who is counted, may not be shared."""
        return self.hidden.why_floor in NOT_AGAIN

    @property
    def people_shared(self) -> str:
        """Return whom the week counted when it was shared before; now, where it was not."""
        shared = earlier.versions(self.site, self.floor.floor_id, self.monday)
        return shared[0].people if shared else self.site.settings.people

    def remember_shared(self) -> None:
        """Store what of which weeks leaves with a report of this one, so that later versions do not tell a change.

        Raises:
            DiskError: E304 to E306, it cannot be stored: then the report may not leave.
        """
        left = [week for monday, week in self._hidden.items() if monday in self._left]
        weeks = [week.shared for week in left if week.shared is not None and week.why_floor not in NOT_AGAIN]
        untimed = frozenset(earlier.REST if key is None else key for key in hidden_times(self.this))
        is_this = (self.floor.floor_id, self.monday)
        earlier.remember(
            self.site,
            [
                replace(week, untimed_places=untimed) if (week.floor_id, week.monday) == is_this else week
                for week in weeks
            ],
        )

    @cached_property
    def is_revealed_by_comparing(self) -> bool:
        """Tell whether a count of the hours compared would tell an hour that is held back, in either week.

        The count of all hours less that of the hours compared is the count of those left out, such as a day on which a
        camera was down: with one of two hours of that day shown, the other would be known.
        """
        used = self.pair.used(0) | self.pair.used(1)
        left_out: Flags = np.asarray((self.hours.is_counted & ~used).any(axis=0))
        weeks = (self.pair.before, self.hidden_before), (self.pair.now, self.hidden)
        return any(
            bool(hidden.hours.small or hidden.hours.others) and bool(left_out[period.is_inside].any())
            for period, hidden in weeks
        )

    def is_held_back(self, area_id: str, first: date, last: date) -> bool:
        """Tell whether the report of any week from one day to another holds an area's count or person-time back."""
        weeks = [self.hidden_in(monday) for monday in _mondays(first, last)]
        is_count_hidden = any(week.why_floor is not None or area_id in week.places for week in weeks)
        return is_count_hidden or self.hides_time(area_id, first, last)

    def hides_time(self, area_id: str, first: date, last: date) -> bool:
        """Tell whether the report of any week from one day to another holds an area's person-time back."""
        weeks = (Period(self, monday, monday + WEEK - timedelta(days=1)) for monday in _mondays(first, last))
        return any(area_id in hidden_times(week) for week in weeks)

    @property
    def whole(self) -> Place:
        """Return the whole floor, as far as its cameras' violations can be counted; `everyone` is all cameras."""
        return self.this.whole

    def area(self, area_id: str | None) -> Place:
        """Return what was counted in an area; None is the rest of the floor."""
        return self.this.area(area_id)

    @property
    def not_counted(self) -> Mapping[str, Reason]:
        """Return the cameras whose violations cannot be counted this week, and why."""
        return self.this.not_counted

    @property
    def why_no_violations(self) -> Reason | None:
        """Return why violations cannot be counted on this floor, or None if they can."""
        return self.this.why_no_violations

    @property
    def why_no_exposure(self) -> Reason | None:
        """Return why person-time of this floor is unknown or not given, or None if it is."""
        return self.this.why_no_exposure or self.hidden.why_untimed

    @property
    def why_no_places(self) -> Reason | None:
        """Return why violations cannot be placed on the floor, or None if they can."""
        return self.this.why_no_places


def _mondays(first: date, last: date) -> list[date]:
    monday = first - timedelta(days=first.weekday())
    return [monday + k * WEEK for k in range((last - monday) // WEEK + 1)]


def in_force(data: WeekData, camera: Camera) -> Calibration | None:
    """Return the calibration of a camera at the end of the week; None when it has none."""
    _, end_ms = data.this.span_ms
    valid = [c for c in camera.calibrations if c.valid_from is None or c.valid_from.timestamp() * 1000 < end_ms]
    return valid[-1] if valid else None
