"""Yesterday and the hours of today so far, beside days like them, and what to expect until tomorrow night.

Days are compared over the same hours: 150 violations by noon are compared with other mornings, never with whole days.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import date, datetime, timedelta
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.answer import Reason, State
from vsd_analytics.figures.forecast import HISTORY_WEEKS
from vsd_analytics.figures.share.counts import mask_of
from vsd_analytics.figures.slots import Floats, Slots, known, load_slots, open_hours
from vsd_analytics.figures.special_days import open_holidays, special_days
from vsd_analytics.figures.unusual import unusual_in_last_week
from vsd_analytics.site.model import Site
from vsd_analytics.stats.forecast import WeekForecast, forecast_week
from vsd_analytics.stats.hour_of_week import SLOTS, Weeks
from vsd_analytics.stats.unusual import UnusualSlots
from vsd_analytics.stats.usual import MIN_WEEKS, Position, UsualRange, usual_range
from vsd_analytics.warehouse.warehouse import Warehouse

LOADED_WEEKS: Final = HISTORY_WEEKS + 2
"""The running week, the twelve before, and one more: on a Monday, the weeks before yesterday begin on a Sunday."""
HOURS: Final = 24
SHOWN_DAYS: Final = 3  # yesterday, today, tomorrow
HALF: Final = 0.5  # of a violation: less is rounded away


@dataclass(frozen=True, slots=True)
class TodayHour:
    """An open hour of yesterday, today or tomorrow.

    Attributes:
        day: Local date.
        hour: Local hour, 0 to 23.
        is_over: It ended before the clock.
        violations: Violations counted, as in the week's timetable; None where nothing was recorded, or is not over.
        estimate: Violations of all cameras in the whole hour, those that were down made up for: what `usual` is of;
            None where less than `partial_hour_share` of it was recorded.
        usual: The same of such an hour by the twelve weeks before yesterday (M25); None where too few recorded it.
        lo, hi: Range that holds four of five such hours.
        seen: People in view of the hour, mean; None as `violations`.
        people: Mean number of people in view of such an hour; None where too few weeks recorded it.
        people_lo, people_hi: Range of that.
        for_readers: `people`, `people_lo` and `people_hi` by the hours in which enough people were.
    """

    day: date
    hour: int
    is_over: bool
    violations: float | None
    estimate: float | None
    usual: float | None
    lo: float | None
    hi: float | None
    seen: float | None
    people: float | None
    people_lo: float | None
    people_hi: float | None
    for_readers: tuple[float | None, float | None, float | None] = (None, None, None)

    @property
    def encounter_rate(self) -> float | None:
        """Return violations per person-hour: the estimate over the people in view; None without people."""
        return self.estimate / self.seen if self.estimate is not None and self.seen else None


@dataclass(frozen=True, slots=True)
class DayLevel:
    """The violations of a day, or of its hours so far, beside the same hours of the same weekday.

    Attributes:
        day: Local date.
        is_over: All its open hours are over.
        until_hour: Local hour at which the last hour that is over ends, 1 to 24; None = no open hour is over yet.
        open_hours: Open hours that are over.
        recorded_hours: Those of them of which at least `partial_hour_share` was recorded; only these are compared.
        violations: Violations counted in the open hours that are over, the sum of the timetable's; None where nothing
            was recorded or violations are not measurable.
        estimate: Violations of all cameras in the recorded hours, those that were down made up for: what `usual` is of;
            None likewise, and without recorded hours.
        usual: Prediction interval (97.5 %) for the same hours of one more such day; None where too few days
            recorded them.
        n_days: Earlier days that recorded them.
        state: "ok" when there is a usual range.
        reason: Why not.
        whole_days: Violations by day of the same weekday in the weeks before, of days that all cameras recorded in all
            open hours; None where they did not record this day so.
        is_rough: Counts are rounded, for readers (`share.days`).
        masked_below: Its count is less than this, and not given; 0 = it is given.
    """

    day: date
    is_over: bool
    until_hour: int | None
    open_hours: int
    recorded_hours: int
    violations: float | None
    estimate: float | None
    usual: UsualRange | None
    n_days: int
    state: State
    reason: Reason | None
    whole_days: Mapping[date, float] | None = None
    is_rough: bool = False
    masked_below: int = 0

    @property
    def position(self) -> Position | None:
        """Return where the estimate lies beside the usual range; None where either is unknown."""
        return None if self.usual is None or self.estimate is None else self.usual.position(self.estimate)


@dataclass(frozen=True, slots=True)
class SilentCamera:
    """A camera that recorded nothing in the last open hour that is over, nor in the hour that has begun.

    Attributes:
        camera_id: The camera.
        last_day: Local date of the last hour it recorded; None = none in the weeks before.
        last_hour: That hour, 0 to 23.
        open_hours: Open hours since then, at most those of the weeks before.
    """

    camera_id: str
    last_day: date | None
    last_hour: int | None
    open_hours: int


@dataclass(frozen=True, slots=True)
class Today:
    """What to know about a floor today: the one place of these numbers, which card, answers and topics only write.

    It stays typed beside its answers, as a reader's card is made of exact counts of earlier days (`whole_days`), which
    no answer may hold.

    Attributes:
        at: The clock, in the site's zone.
        floor_id: Floor; None = the whole site.
        yesterday, so_far: The two days; None where the site was closed.
        hours: The open hours of yesterday, today and tomorrow.
        unusual: Hours of yesterday and today whose count chance hardly explains (M24).
        silent: Cameras that send nothing.
        n_cameras: Cameras of the floor.
        forecast_state: "ok" when hours are forecast.
        forecast_reason: Why not.
        is_of_closed_days: It is a reader's: without the hours of today so far and the counts of hours (`share.days`).
    """

    at: datetime
    floor_id: str | None
    yesterday: DayLevel | None
    so_far: DayLevel | None
    hours: tuple[TodayHour, ...]
    unusual: UnusualSlots
    silent: tuple[SilentCamera, ...]
    n_cameras: int
    forecast_state: State
    forecast_reason: Reason | None
    is_of_closed_days: bool = False

    @property
    def ahead(self) -> tuple[TodayHour, ...]:
        """Return the hours of today and tomorrow that are not over and have a forecast."""
        return tuple(h for h in self.hours if not h.is_over and h.people is not None)


def first_day(at: datetime) -> date:
    """Return the first day a warehouse must hold for `today` at a local instant."""
    return at.date() - timedelta(days=at.weekday(), weeks=LOADED_WEEKS - 1)


def today(warehouse: Warehouse, at: datetime, *, floor_id: str | None = None) -> Today:
    """Return what to know about today: M0 of yesterday and so far, M24 of both days, M25 until tomorrow night.

    A day's usual range is the prediction interval of `stats.usual` from the same hours of the same weekday in the weeks
    before; days that did not record all these hours are left out. Both days are judged together: each range has half of
    the error that `confidence` allows. What was recorded after `at` is not read, but for one question: a camera that
    recorded anything in the hour that has begun is not silent.

    Args:
        warehouse: From `first_day(at)`, or from wherever records begin, to the day of `at`.
        at: The clock, an aware instant in the site's zone.
        floor_id: Only the cameras of this floor; None = all.

    Raises:
        UsageError: E101, the site has no such floor.
    """
    site, settings = warehouse.site, warehouse.site.settings
    yesterday, monday = at.date() - timedelta(days=1), at.date() - timedelta(days=at.weekday())
    there = at.date(), at.date()
    loaded = load_slots(warehouse, monday, n_weeks=LOADED_WEEKS, floor_id=floor_id, there=there)
    slots = weeks_from(loaded, yesterday, at, open_h=open_hours_from(warehouse.site, yesterday))
    n_over = HOURS + at.hour
    confidence = 1 - (1 - settings.confidence) / 2
    violations, people, why = slots.violations, slots.people, slots.why_no_violations
    days = special_days(site, yesterday, n_weeks=len(violations.n))
    rules = {"open_h": slots.open_h[-1], "share": settings.forecast_share, "days": days.last}
    many = of_enough_people(warehouse, slots).people
    counted, seen, told = (
        forecast_week(w.n[:-1], days.ordinary_h(w.x_h)[:-1], is_count=w is violations, **rules)
        for w in (violations, people, many)
    )
    unusual = unusual_in_last_week(slots, site)
    holidays = {note.values["day"]: note for note in open_holidays(site, yesterday)}
    return Today(
        at=at,
        floor_id=floor_id,
        yesterday=_level(slots, violations, 0, holidays.get(yesterday), n_over=n_over, why=why, confidence=confidence),
        so_far=_level(slots, violations, 1, holidays.get(at.date()), n_over=n_over, why=why, confidence=confidence),
        hours=_hours(slots, violations, people, n_over=n_over, counted=counted, seen=seen, told=told),
        unusual=replace(unusual, reason=_of_calendar_weeks(unusual.reason, loaded.violations)),
        silent=_silent(slots, n_over=n_over, is_sending=_recorded_in_hour_of(loaded, at)),
        n_cameras=len(slots.camera_ids),
        forecast_state=seen.state,
        forecast_reason=_of_calendar_weeks(seen.reason, loaded.people),
    )


def _of_calendar_weeks(reason: Reason | None, weeks: Weeks) -> Reason | None:
    """Return a reason that counts recorded weeks as a reader does: two weeks lie in three that begin on a Wednesday."""
    if reason is None or reason.code not in ("forecast.weeks", "unusual.weeks"):
        return reason
    least, has = int(str(reason.values["least"])), int(str(reason.values["has"]))
    return Reason(reason.code, least=least, has=min(has, weeks.n_recorded))


def open_hours_from(site: Site, first: date) -> Floats:
    """Return the open hours of the seven days from `first` on, shape (168,)."""
    monday = first - timedelta(days=first.weekday())
    weeks = [open_hours(site, monday + timedelta(weeks=k)) for k in range(2)]
    return np.concatenate(weeks)[first.weekday() * HOURS :][:SLOTS]


def weeks_from(slots: Slots, first: date, at: datetime, *, open_h: Floats) -> Slots:
    """Return the same hours in weeks that begin on the weekday of `first`; the last one is the week from `first` on.

    Of the weeks that were loaded the oldest is left out: on a Monday, the weeks before yesterday begin on a Sunday.
    What is recorded after `at` is left out, and hours after what was loaded are not recorded.
    """
    begin = (first - slots.monday).days * HOURS + SLOTS
    n_weeks = len(slots.open_h) - 1
    n_slots = n_weeks * SLOTS

    def cut(array: Floats, missing: float) -> Floats:
        flat = array.reshape(*array.shape[:-2], -1)
        padded = np.concatenate([flat, np.full((*flat.shape[:-1], SLOTS), missing)], axis=-1)
        return padded[..., begin : begin + n_slots].reshape(*array.shape[:-2], n_weeks, SLOTS).copy()

    opened, recorded_h = cut(slots.open_h, 0.0), cut(slots.recorded_h, 0.0)
    opened[-1] = open_h
    recorded_h[:, -1, HOURS + at.hour :] = 0.0
    return replace(
        slots,
        monday=first,
        open_h=opened,
        scheduled_h=cut(slots.scheduled_h, 0.0),
        recorded_h=recorded_h,
        person_h=cut(slots.person_h, np.nan),
        violation_h=cut(slots.violation_h, np.nan),
        n_violations=cut(slots.n_violations, np.nan),
    )


def _level(
    slots: Slots,
    violations: Weeks,
    day: int,
    holiday: Reason | None,
    *,
    n_over: int,
    why: Reason | None,
    confidence: float,
) -> DayLevel | None:
    """Return the level of yesterday (0) or today (1); None where the site is closed all day.

    A public holiday has no usual range: days like it are rare.
    """
    open_slots = day * HOURS + np.flatnonzero(slots.open_h[-1, day * HOURS : (day + 1) * HOURS] > 0)
    if not len(open_slots):
        return None
    over = open_slots[open_slots < n_over]
    recorded = over[violations.x_h[-1, over] > 0]
    totals = (violations.rate[:, recorded] * slots.open_h[-1, recorded]).sum(axis=1)  # NaN: an hour was not recorded
    before = totals[:-1][~np.isnan(totals[:-1])]
    usual, reason = None, why
    if reason is None and not len(over):
        reason = Reason("today.not_yet")
    elif reason is None and not len(recorded):
        reason = Reason("recorded.nothing")
    elif reason is None and holiday is not None:
        reason = holiday
    elif reason is None:
        usual = usual_range(before.tolist(), confidence=confidence)
        if usual is None:
            few = len(before) < MIN_WEEKS
            reason = Reason("today.days", least=MIN_WEEKS, has=len(before)) if few else Reason("today.quiet_days")
    has_estimate = why is None and len(recorded) > 0
    counted = slots.counted[over]
    return DayLevel(
        day=slots.monday + timedelta(days=day),
        is_over=len(over) == len(open_slots),
        until_hour=int(over[-1]) % HOURS + 1 if len(over) else None,
        open_hours=len(over),
        recorded_hours=len(recorded),
        violations=None if why is not None or np.isnan(counted).all() else float(np.nansum(counted)),
        estimate=float(totals[-1]) if has_estimate else None,
        usual=usual,
        n_days=len(before) if has_estimate else 0,
        state="ok" if usual is not None else "not_measurable" if why is not None else "not_enough_data",
        reason=reason,
        whole_days=_whole_days(slots, open_slots, slots.monday + timedelta(days=day)),
    )


def _whole_days(slots: Slots, open_slots: NDArray[np.int64], day: date) -> Mapping[date, float] | None:
    is_whole = np.asarray(slots.is_recorded[:, :, open_slots].all(axis=(0, 2)))
    counts = slots.n_violations[:, :, open_slots].sum(axis=(0, 2))
    weeks_ago = len(counts) - 1 - np.flatnonzero(is_whole[:-1])
    return {day - timedelta(weeks=int(k)): float(counts[-1 - k]) for k in weeks_ago} if is_whole[-1] else None


def of_enough_people(warehouse: Warehouse, slots: Slots) -> Slots:
    """Return the hours without the person-time of those in which fewer people than `mask_below` are known to have been.

    At least as many were there as different tracks of one camera (mart `track_hours`), or people in view on average.
    Without track ids it is not known, and all hours stay.
    """
    n_weeks = len(slots.open_h)
    first = slots.monday - timedelta(weeks=n_weeks - 1)
    rows = warehouse.table(
        "select date_diff('day', $first, local_date)::bigint as day, local_hour::bigint as hour, "
        "max(n_tracks)::bigint as n from track_hours where list_contains($cameras::varchar[], camera_id) "
        "and local_date between $first and $last group by all",
        {"first": first, "last": slots.monday + timedelta(days=6), "cameras": list(slots.camera_ids)},
    )
    tracks = np.zeros((n_weeks, SLOTS))
    tracks.reshape(-1)[rows["day"].to_numpy() * HOURS + rows["hour"].to_numpy()] = rows["n"].to_numpy()
    at_once = np.nan_to_num(slots.person_h).max(axis=0, initial=0.0)
    n, mask = np.maximum(tracks, np.ceil(np.round(at_once, 6))), mask_of(warehouse.site)
    is_few = np.vectorize(mask.hides, otypes=[np.bool_])(n) & bool(tracks.any())
    return replace(slots, person_h=np.where(is_few, np.nan, slots.person_h))


def _hours(
    slots: Slots,
    violations: Weeks,
    people: Weeks,
    *,
    n_over: int,
    counted: WeekForecast,
    seen: WeekForecast,
    told: WeekForecast,
) -> tuple[TodayHour, ...]:
    is_known = slots.why_no_violations is None
    return tuple(
        TodayHour(
            day=slots.monday + timedelta(days=int(s) // HOURS),
            hour=int(s) % HOURS,
            is_over=bool(s < n_over),
            violations=known(slots.counted[s]) if is_known and s < n_over else None,
            estimate=known(violations.rate[-1, s] * slots.open_h[-1, s]) if is_known and s < n_over else None,
            usual=known(counted.mean[s]) if is_known else None,
            lo=known(counted.lo[s]) if is_known else None,
            hi=known(counted.hi[s]) if is_known else None,
            seen=known(people.rate[-1, s]) if slots.why_no_people is None and s < n_over else None,
            people=known(seen.mean[s]),
            people_lo=known(seen.lo[s]),
            people_hi=known(seen.hi[s]),
            for_readers=(known(told.mean[s]), known(told.lo[s]), known(told.hi[s])),
        )
        for s in np.flatnonzero(slots.open_h[-1, : SHOWN_DAYS * HOURS] > 0)
    )


def _recorded_in_hour_of(slots: Slots, at: datetime) -> NDArray[np.bool_]:
    """Return which cameras recorded something in the hour that has begun at `at`, shape (n_cameras,)."""
    if at.replace(minute=0, second=0, microsecond=0) == at:
        return np.zeros(len(slots.camera_ids), dtype=np.bool_)
    return np.asarray(slots.recorded_h[:, -1, at.weekday() * HOURS + at.hour] > 0)


def _silent(slots: Slots, *, n_over: int, is_sending: NDArray[np.bool_]) -> tuple[SilentCamera, ...]:
    open_now = np.flatnonzero(slots.open_h[-1, :n_over] > 0)
    if not len(open_now):
        return ()
    is_open = slots.open_h.reshape(-1) > 0
    last_open = HISTORY_WEEKS * SLOTS + int(open_now[-1])
    first = slots.monday - timedelta(weeks=HISTORY_WEEKS)
    silent = []
    for camera_id, recorded_h, sends in zip(
        slots.camera_ids, slots.recorded_h.reshape(len(slots.camera_ids), -1), is_sending, strict=True
    ):
        if sends or recorded_h[last_open] > 0:
            continue
        recorded = np.flatnonzero(recorded_h[:last_open] > 0)
        last = int(recorded[-1]) if len(recorded) else None
        silent.append(
            SilentCamera(
                camera_id=camera_id,
                last_day=None if last is None else first + timedelta(days=last // HOURS),
                last_hour=None if last is None else last % HOURS,
                open_hours=int(is_open[0 if last is None else last + 1 : last_open + 1].sum()),
            )
        )
    return tuple(silent)
