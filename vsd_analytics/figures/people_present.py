"""How many people are in a place at once: recorded open time by their number, and levels made of it.

Places that ask for it: queues, and areas and floors with a capacity. Time counts where every camera that sees the place
recorded: without one of them a count is a lower bound, which is no count. Levels are of the open hours of the period:
recorded hours also count for the same hours of the week that were not (`vsd_analytics.stats.recorded_hours`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason, Row
from vsd_analytics.figures.close_time import SECONDS, at_most_one, in_units
from vsd_analytics.figures.panels import MIN_CAMERA_SHARE, Array, Flags, Place
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.rates import NOT_RECORDED, history
from vsd_analytics.site.model import Area, Floor
from vsd_analytics.stats.estimates import RateEstimate, no_rate
from vsd_analytics.stats.rates import violation_rate
from vsd_analytics.stats.recorded_hours import RecordedHours, recorded_hours

NOBODY: Final = Reason("nobody.on_camera")
NEVER: Final = Reason("present.never")
_COUNTS: Final = """
select
    hour_start_ms,
    n_people,
    recorded_open_s::double as seconds
from count_hours
where floor_id = $floor and area_id is not distinct from $area
order by hour_start_ms, n_people
"""


@dataclass(frozen=True, slots=True)
class PeopleQuantile:
    """A number of people that is not exceeded for a share of the time.

    Attributes:
        q: The share of time.
        value: People; None when unknown.
        lo, hi: Limits; None without an interval.
    """

    q: float
    value: int | None
    lo: int | None
    hi: int | None


class Presence:
    """Recorded open time of a place by the number of people in it.

    Args:
        period: The days; those that are loaded before them say which cameras see the place.
        place: An area or a floor that asks for its number of people.
    """

    def __init__(self, period: Period, place: Area | Floor) -> None:
        self.period, self.data = period, period.data
        area_id = place.area_id if isinstance(place, Area) else None
        counted = period.area(area_id) if isinstance(place, Area) else self.data.everyone
        sees = np.asarray(counted.exposure_h.any(axis=1))
        whole = Place(np.zeros_like(counted.exposure_h), counted.exposure_h, sees)
        hours = self.data.hours
        self.cameras: Flags = np.asarray(self.data.camera_weights(whole) >= MIN_CAMERA_SHARE)
        rows = self.data.warehouse.table(_COUNTS, {"floor": self.data.floor.floor_id, "area": area_id})
        at = np.searchsorted(hours.start_ms, rows["hour_start_ms"].to_numpy())
        n = rows["n_people"].to_numpy().astype(np.int64)
        seconds = np.zeros((len(hours.start_ms), int(n.max(initial=0)) + 1))
        seconds[at, n] = rows["seconds"].to_numpy()
        is_empty = ~(whole.exposure_h > 0).any(axis=0)
        has_rows = np.asarray(seconds.any(axis=1))
        together = hours.recorded_s[self.cameras].min(axis=0) if self.cameras.any() else np.zeros(len(has_rows))
        seconds[is_empty & ~has_rows, 0] = together[is_empty & ~has_rows]
        is_there = self.data.is_there(area_id) if area_id is not None else None
        # hours with people but without rows were purged before anybody asked
        is_recorded = hours.all_counted(self.cameras)
        known = np.asarray(is_recorded & (is_empty | has_rows))
        self.is_known: Flags = known if is_there is None else known & is_there
        self.seconds: Array = np.where(self.is_known[:, None], seconds, 0.0)

    @cached_property
    def recorded_share(self) -> float:
        """Return the share of the place's opening hours in which all its cameras recorded."""
        open_s = float(self.data.hours.open_s[self.period.is_inside].sum())
        return float(self.seconds[self.period.is_inside].sum()) / open_s if open_s else 0.0

    @cached_property
    def silent_cameras(self) -> tuple[str, ...]:
        """Return the cameras that see the place and recorded nothing of the period."""
        hours, inside = self.data.hours, self.period.is_inside
        is_silent = hours.scheduled_s[:, inside].any(axis=1) & ~hours.recorded_s[:, inside].any(axis=1)
        return tuple(c for c, silent in zip(self.data.ids, self.cameras & is_silent, strict=True) if silent)

    @property
    def numbers(self) -> Array:
        """Return the numbers of people of the columns of `seconds`."""
        return np.arange(self.seconds.shape[1], dtype=np.float64)

    def mean(self, *, hour: int | None = None) -> RateEstimate:
        """Return the mean number of people, of all hours or of one hour of the day, with the interval of M5."""
        return self._level(self.seconds @ self.numbers, hour, Reason("nobody.seen"))

    def beyond(self, limit: float) -> RateEstimate:
        """Return the mean number of people beyond a limit, 0 where there are fewer."""
        return self._level(self.seconds @ np.maximum(self.numbers - limit, 0.0), None, NEVER)

    def time_share(self, least: float, *, hour: int | None = None) -> RateEstimate:
        """Return the share of time with at least so many people."""
        return self._share(self.numbers >= least, hour)

    def time_share_above(self, limit: float) -> RateEstimate:
        """Return the share of time with more than so many people."""
        return self._share(self.numbers > limit, None)

    def person_time_share(self, chosen: Flags) -> RateEstimate:
        """Return the share of person-time spent while the number of people is one of those chosen, as `numbers`."""
        part, every = self.seconds @ (self.numbers * chosen), self.seconds @ self.numbers
        return at_most_one(self._level(part, None, NEVER, per=every))

    def quantile(self, q: float, *, hour: int | None = None) -> PeopleQuantile:
        """Return the least number of people that is not exceeded for a share of the time.

        Its limits are where the limits of the share of time with more people cross 1 - q (Woodruff, J. Am. Stat. Assoc.
        47, 1952).
        """
        numbers: list[int | None] = [None, None, None]
        for n in range(self.seconds.shape[1]):
            above = self.time_share(n + 1, hour=hour)
            if above.value is None:
                break
            lo, hi = (0.0, 0.0) if above.value == 0 else (above.lo, above.hi)
            for k, share in enumerate((above.value, lo, hi)):
                if numbers[k] is None and share is not None and share <= 1 - q:
                    numbers[k] = n
            if above.value == 0:
                break
        value, low, high = numbers
        has_interval = low is not None and self.time_share(0, hour=hour).lo is not None
        return PeopleQuantile(q, value, low, high) if has_interval else PeopleQuantile(q, value, None, None)

    def hours_of_day(self) -> tuple[int, ...]:
        """Return the hours of the day in which any time of the period is known."""
        known = self.period.is_inside & self.seconds.any(axis=1)
        return tuple(sorted(set(self.data.hours.hour[known].tolist())))

    @cached_property
    def recorded(self) -> RecordedHours:
        """Return how much each hour of the period counts in which the place is known."""
        return hours_that_stand_for_all(self.period, self.is_known)

    @property
    def unrecorded_hours(self) -> tuple[int, ...]:
        """Return the hours of the day that are open in the period and never known: levels say nothing of them."""
        return self.recorded.unknown_hours

    def _share(self, chosen: Flags, hour: int | None) -> RateEstimate:
        return at_most_one(self._level(self.seconds @ chosen.astype(np.float64), hour, NEVER))

    def _level(self, amount: Array, hour: int | None, nothing: Reason, *, per: Array | None = None) -> RateEstimate:
        """Return an amount of seconds by hour, per second of recorded time (or of `per`), days as clusters."""
        if (why := self.period.why_no_exposure) is not None:
            return no_rate(why)
        if not self.cameras.any():
            return no_rate(NOBODY)
        hours, settings = self.data.hours, self.data.site.settings
        chosen = self.is_known if hour is None else self.is_known & (hours.hour == hour)
        time_s = self.seconds.sum(axis=1) if per is None else per
        weight = np.where(self.period.is_inside, self.recorded.weight, 1.0)

        def by_day(values: Array, days: Sequence[int]) -> Array:
            used = np.where(chosen, values * weight, 0.0)
            return np.array([[used[hours.day == d].sum() for d in days]])

        now, past = ([d.toordinal() for d in days] for days in (self.period.days, self.period.history_days))
        x_h = by_day(time_s, now) / 3600
        if not x_h.any():
            return NOT_RECORDED
        estimate = violation_rate(
            by_day(amount, now),
            x_h,
            **settings.for_intervals,
            **history(self.period, by_day(amount, past), history_x_h=by_day(time_s, past) / 3600),
        )
        estimate = in_units(estimate, SECONDS, nothing)
        return estimate if hour is not None or self.recorded.covers_all else _of_other_hours(estimate, self.recorded)


def hours_that_stand_for_all(period: Period, is_known: Flags) -> RecordedHours:
    """Return how much each hour of a period counts, of those that are known, shape (n_hours,)."""
    hours = period.data.hours
    return recorded_hours(hours.weekday, hours.hour, np.where(period.is_inside, hours.open_s, 0.0), is_known)


def why_not_all(recorded: RecordedHours) -> Reason:
    """Return why a figure of recorded hours is none of the open hours."""
    return Reason("present.hours", share=recorded.unknown_share)


def _of_other_hours(estimate: RateEstimate, recorded: RecordedHours) -> RateEstimate:
    """Return a level that is one of the recorded hours alone: no interval holds that of the open hours."""
    if estimate.value is None:
        return estimate
    return replace(estimate, lo=None, hi=None, state="not_enough_data", reason=why_not_all(recorded))


def unknown_hours_notes(row: Row) -> list[Reason]:
    """Return what is not known of a place's people, from the cells `silent_cameras` and `unrecorded_hours` of a row."""
    notes = []
    silent, hours = row["silent_cameras"], row["unrecorded_hours"]
    if isinstance(silent, tuple) and silent:
        notes.append(Reason("present.silent", cameras=", ".join(map(str, silent))))
    if isinstance(hours, tuple) and hours:
        notes.append(Reason("present.unrecorded", hours=", ".join(f"{h:02d}:00" for h in hours)))
    return notes
