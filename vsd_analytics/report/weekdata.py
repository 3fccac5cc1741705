"""The marts of one floor around one week, and the week beside the week before (`vsd_analytics.analysis.panels`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date, timedelta

from vsd_analytics.analysis.comparable import Recalibration
from vsd_analytics.analysis.panels import WEEK, Flags, FloorHours, Panel, Period, Place, TwoPeriods
from vsd_analytics.site import Floor
from vsd_analytics.warehouse.warehouse import Warehouse


class WeekData(FloorHours):
    """The marts of a floor around one week.

    Args:
        warehouse: Opened over the week and the weeks before it that are to be used.
        floor: The floor.
        monday: First day of the week.

    Attributes:
        this: The week.
        pair: The week before and this week.
    """

    def __init__(self, warehouse: Warehouse, *, floor: Floor, monday: date) -> None:
        super().__init__(warehouse, floor=floor)
        self.monday = monday
        self.this = Period(self, monday, self.sunday)
        self.pair = TwoPeriods(Period(self, monday - WEEK, self.sunday - WEEK), self.this)

    @property
    def sunday(self) -> date:
        """Return the last day of the week."""
        return self.monday + timedelta(days=6)

    @property
    def week_days(self) -> list[date]:
        """Return Monday to Sunday."""
        return self.this.days

    def week(self, monday: date | None = None) -> Flags:
        """Return which hours lie in the week that starts on `monday`; None = this week."""
        first = monday or self.monday
        return self.inside(first, first + timedelta(days=6))

    def compared(self, place: Place, *, since: int | None = None) -> tuple[Panel, Panel]:
        """Return the panels of the week before and of this week; see `TwoPeriods.compared`."""
        return self.pair.compared(place, since=since)

    @property
    def whole(self) -> Place:
        """Return the whole floor, as far as its cameras' violations can be counted; `everyone` is all cameras."""
        return self.this.whole

    def area(self, area_id: str | None) -> Place:
        """Return what was counted in an area; None is the rest of the floor."""
        return self.this.area(area_id)

    @property
    def not_counted(self) -> Mapping[str, str]:
        """Return the cameras whose violations cannot be counted this week, and why in words."""
        return self.this.not_counted

    @property
    def why_no_violations(self) -> str | None:
        """Return why violations cannot be counted on this floor, or None if they can."""
        return self.this.why_no_violations

    @property
    def why_no_exposure(self) -> str | None:
        """Return why person-time is unknown on this floor, or None if it is known."""
        return self.this.why_no_exposure

    @property
    def why_no_places(self) -> str | None:
        """Return why violations cannot be placed on the floor, or None if they can."""
        return self.this.why_no_places

    @property
    def recalibrated(self) -> Sequence[Recalibration]:
        """Return the cameras whose facts of this week and the week before were computed under several calibrations."""
        return self.pair.recalibrated

    @property
    def is_comparable(self) -> Flags:
        """Return which cameras may be compared with the week before, shape (n_cameras,), one at least as of `hours`."""
        return self.pair.is_comparable

    @property
    def both_weeks_ms(self) -> tuple[int, int]:
        """Return the start of the week before and the end of this one, UTC milliseconds."""
        return self.pair.span_ms
