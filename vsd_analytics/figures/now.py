"""What a floor is like now, for the live page: people beside what is usual, queues, cameras, and the fullest hour.

"Now" is the last quarter-hour of the clock that is over. What is usual, and which hour will be the fullest, comes from
earlier days alone, as on the card of the day (M25).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, time, timedelta
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from vsd_analytics.answer import Reason
from vsd_analytics.figures.forecast import HISTORY_WEEKS
from vsd_analytics.figures.share.counts import mask_of
from vsd_analytics.figures.share.now import Band, beside_limit, beside_usual, in_steps
from vsd_analytics.figures.slots import NO_POSITIONS, Floats, Slots, load_slots
from vsd_analytics.figures.special_days import special_days
from vsd_analytics.figures.today import HOURS, of_enough_people, open_hours_from, weeks_from
from vsd_analytics.site.model import Area, Site
from vsd_analytics.stats.forecast import WeekForecast, forecast_week
from vsd_analytics.stats.hour_of_week import SLOTS, Weeks, recorded_hours
from vsd_analytics.warehouse.dimensions import QUARTER_MS, calendar
from vsd_analytics.warehouse.warehouse import Warehouse

RECORD_DAYS: Final = 10
"""Days like today on which it is looked whether the hour named was the fullest."""
LEAST_RECORD_DAYS: Final = 5
"""Fewer are no record."""
LOADED_WEEKS: Final = HISTORY_WEEKS + RECORD_DAYS + 2
SETTLES_MS: Final = 60_000
"""A quarter-hour counts as over after this: its last messages are still on their way."""
QUARTERS: Final = 4  # of an hour
AHEAD_DAYS: Final = 8
"""How far ahead the next opening is looked for."""
_CAMERAS: Final = """
select
    coverage.camera_id,
    coverage.quarter,
    coverage.recorded_ms::double as recorded_ms,
    coalesce(exposure.exposure_ms, 0)::double as exposure_ms,
    camera_days.has_persons
from coverage
inner join cameras on coverage.camera_id = cameras.camera_id
left join exposure on coverage.camera_id = exposure.camera_id and coverage.quarter = exposure.quarter
left join camera_days on coverage.camera_id = camera_days.camera_id and coverage.quarter // 96 = camera_days.utc_day
where cameras.floor_id = $floor and coverage.quarter between $first and $last and coverage.recorded_ms > 0
order by coverage.camera_id, coverage.quarter
"""
_QUEUES: Final = """
select
    area_id,
    sum(n_people * recorded_ms)::double as person_ms,
    sum(recorded_ms)::double as recorded_ms
from area_counts
where floor_id = $floor and area_id is not null and bucket_quarter = $quarter
group by area_id
"""
_QUARTERS: Final = """
select
    coverage.camera_id,
    date_diff('day', $first, calendar.local_date)::bigint as day,
    calendar.local_hour::bigint as hour,
    (coverage.quarter - calendar.hour_start_ms // 900000)::bigint as part,
    coverage.recorded_ms / 3600000.0 as recorded_h,
    coalesce(exposure.exposure_ms, 0) / 3600000.0 as person_h
from coverage
inner join calendar on coverage.quarter = calendar.quarter
left join exposure on coverage.camera_id = exposure.camera_id and coverage.quarter = exposure.quarter
where
    calendar.is_open
    and calendar.local_date between $first and $last
    and list_contains($cameras::varchar[], coverage.camera_id)
"""
READ_BEFORE: Final = ("camera_hours", "camera_slots", "track_hours", "coverage", "exposure")
"""Relations that `usual_day` asks for."""


@dataclass(frozen=True, slots=True)
class Fullest:
    """The hour that should be the fullest of those of a day from some hour on, and how often that was right.

    Attributes:
        hour: Local hour, 0 to 23.
        n_right: Earlier days like this one, forecast from the days before them alone, whose fullest hour from the same
            hour on was the one named.
        n_days: Earlier days that recorded all these hours, at most `RECORD_DAYS`.
    """

    hour: int
    n_right: int
    n_days: int


@dataclass(frozen=True, slots=True, eq=False)
class UsualDay:
    """What the days before say of a day.

    Attributes:
        day: Local date.
        floor_id: Floor.
        slots: Hours in which enough people were, of weeks that begin on the weekday of the day before; of the last one
            nothing.
        quarters: People in view in the first, second, third and last quarter of each hour of that last week (M25).
        fullest: By the hour from which on, the hour that should be the fullest; None where none is named.
        reason: Why nothing is usual; None where something is.
    """

    day: date
    floor_id: str
    slots: Slots
    quarters: tuple[WeekForecast, ...]
    fullest: tuple[Fullest | None, ...]
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class QueueNow:
    """How many people wait in an area with `queue = true`.

    Attributes:
        area_id, name: The area.
        band: How many, beside `queue_limit` where it has one; None where a camera did not record the quarter-hour.
    """

    area_id: str
    name: str
    band: Band | None


@dataclass(frozen=True, slots=True)
class SilentNow:
    """A camera that recorded nothing in the last quarter-hour that is over, nor since.

    Attributes:
        camera_id: The camera.
        last: End of the last quarter-hour of the day in which it recorded something; None = none.
    """

    camera_id: str
    last: datetime | None


@dataclass(frozen=True, slots=True)
class Now:
    """What a floor is like now, as far as readers may know it.

    Attributes:
        at: The clock, in the site's zone.
        floor_id: Floor.
        is_open: The site is open at `at`.
        opens: When it opens next; None while it is open, and where it does not within `AHEAD_DAYS`.
        start: Start of the last quarter-hour that is over.
        was_open: The site was open in it.
        people: People in view in it; None where not known, and while the site is closed.
        reason: Why not, or why it is not known what is usual; None where both are.
        queues: The queues of the floor; none while the site is closed.
        fullest: The fullest hour ahead today; None where none is named, or its record is too short.
        silent: Cameras that send nothing; none while the site is closed.
        n_cameras: Cameras of the floor.
        data_until: End of the last quarter-hour of the day in which a camera recorded something; None = none.
    """

    at: datetime
    floor_id: str
    is_open: bool
    opens: datetime | None
    start: datetime
    was_open: bool
    people: Band | None
    reason: Reason | None
    queues: tuple[QueueNow, ...]
    fullest: Fullest | None
    silent: tuple[SilentNow, ...]
    n_cameras: int
    data_until: datetime | None


def quarter_over(at: datetime) -> int:
    """Return the last quarter-hour that is over at an instant, and settled: UTC quarter-hours since 1970."""
    return (round(at.timestamp() * 1000) - SETTLES_MS) // QUARTER_MS - 1


def day_of(site: Site, at: datetime) -> date:
    """Return the local day of the last quarter-hour that is over: the one that `usual_day` must be of."""
    return _instant(quarter_over(at), site).date()


def first_day(day: date) -> date:
    """Return the first day a warehouse must hold for `usual_day`."""
    return day - timedelta(days=day.weekday(), weeks=LOADED_WEEKS - 1)


def relations(site: Site) -> tuple[str, ...]:
    """Return the relations that `now` asks for."""
    queues = ("area_counts",) if any(area.is_queue for area in site.areas) else ()
    return ("coverage", "exposure", "camera_days", *queues)


def usual_day(warehouse: Warehouse, day: date, *, floor_id: str) -> UsualDay:
    """Return what the days before a day say of it: the usual number of people (M25), and the hour to be the fullest.

    Nothing of the day itself is read, so it is the same all day. The quarters of an hour are forecast each by itself,
    as hours are. An hour is named as the fullest of those from each hour on, with its record on earlier days: each is
    forecast as this one, from the twelve weeks before it, and right where the hour named had most people in view. Days
    that did not record all these hours, and public holidays, do not count.

    Args:
        warehouse: From `first_day(day)`, or from wherever records begin, to the day before.
        day: Local date.
        floor_id: The floor.
    """
    site, yesterday = warehouse.site, day - timedelta(days=1)
    monday = day - timedelta(days=day.weekday())
    loaded = load_slots(warehouse, monday, n_weeks=LOADED_WEEKS, floor_id=floor_id, there=(day, day))
    midnight = datetime.combine(day, time(), tzinfo=site.zone)
    cut = weeks_from(loaded, yesterday, midnight, open_h=open_hours_from(site, yesterday))
    slots = of_enough_people(warehouse, cut)
    last = len(slots.open_h) - 1
    whole = _forecast(site, slots, last)
    quarters = [_forecast(site, part, HISTORY_WEEKS) for part in _parts(warehouse, slots)]
    fullest: list[Fullest | None] = [None] * HOURS
    if whole.state == "ok" and site.calendar.holiday(day) is None:
        rows = [row for row in range(HISTORY_WEEKS, last) if _is_ordinary(site, slots, row)][-RECORD_DAYS:]
        before = {row: _forecast(site, slots, row) for row in rows}
        fullest = [_fullest(cut.people, slots, whole, before, hour) for hour in range(HOURS)]
    why = loaded.why_no_people
    return UsualDay(day, floor_id, slots, tuple(quarters), tuple(fullest), why or whole.reason)


def now(warehouse: Warehouse, usual: UsualDay, at: datetime) -> Now:
    """Return what a floor is like now.

    People of cameras that did not record the quarter-hour are made up for as in M25. A queue is known where every
    camera of the floor recorded it.

    Args:
        warehouse: Holds the day of `usual`.
        usual: What is usual on the day of the last quarter-hour that is over.
        at: The clock, an aware instant in the site's zone.
    """
    site = warehouse.site
    quarter = quarter_over(at)
    this = round(at.timestamp() * 1000) // QUARTER_MS
    is_open, start = _opening(site, at), _instant(quarter, site)
    was_open = is_open[quarter]
    midnight = round(datetime.combine(usual.day, time(), tzinfo=site.zone).timestamp() * 1000) // QUARTER_MS
    asked = {"floor": usual.floor_id, "first": midnight, "last": this}
    cameras = usual.slots.camera_ids
    rows = [row for row in warehouse.rows(_CAMERAS, asked) if row["camera_id"] in cameras]
    last = {row["camera_id"]: int(row["quarter"]) for row in rows}  # in order of time
    over = [row for row in rows if row["quarter"] == quarter]
    people, reason = _people(over, usual, start) if was_open else (None, None)
    least_ms = usual.slots.min_share * QUARTER_MS
    is_whole = {row["camera_id"] for row in over if row["recorded_ms"] >= least_ms} >= {*cameras}
    opens = None if is_open[this] else next((q for q, opened in is_open.items() if opened and q > this), None)
    return Now(
        at=at,
        floor_id=usual.floor_id,
        is_open=is_open[this],
        opens=None if opens is None else _instant(opens, site),
        start=start,
        was_open=was_open,
        people=None if people is None else _band(people, usual, start, site),
        reason=reason or usual.reason,
        queues=_queues(warehouse, usual, quarter, is_whole=is_whole) if was_open else (),
        fullest=_ahead(usual, at),
        silent=tuple(
            SilentNow(c, _instant(last[c] + 1, site) if c in last else None)
            for c in cameras
            if was_open and last.get(c, -1) < quarter
        ),
        n_cameras=len(cameras),
        data_until=_instant(min(max(last.values()), quarter) + 1, site) if last else None,
    )


def _opening(site: Site, at: datetime) -> dict[int, bool]:
    """Return whether the site is open in each quarter-hour from the day before the clock's to days ahead, in order."""
    rows = calendar(site, at.date() - timedelta(days=1), at.date() + timedelta(days=AHEAD_DAYS))
    return dict(zip(rows["quarter"].to_pylist(), rows["is_open"].to_pylist(), strict=True))


def _parts(warehouse: Warehouse, slots: Slots) -> list[Slots]:
    """Return the first, second, third and last quarter of each hour, of hours in which enough people were."""
    first = slots.monday - timedelta(weeks=HISTORY_WEEKS)
    last = slots.monday + timedelta(days=6)
    rows = warehouse.table(_QUARTERS, {"first": first, "last": last, "cameras": list(slots.camera_ids)})
    n_weeks, n_cameras = HISTORY_WEEKS + 1, len(slots.camera_ids)
    camera = pc.index_in(rows["camera_id"], value_set=pa.array(slots.camera_ids, pa.string())).to_numpy()
    slot = rows["day"].to_numpy() * HOURS + rows["hour"].to_numpy()
    recorded_h, person_h = np.zeros((2, QUARTERS, n_cameras, n_weeks * SLOTS))
    for values, name in ((recorded_h, "recorded_h"), (person_h, "person_h")):
        np.add.at(values, (rows["part"].to_numpy(), camera, slot), rows[name].to_numpy())
    cut = _rows(slots, len(slots.open_h) - n_weeks, len(slots.open_h))
    shape = n_cameras, n_weeks, SLOTS
    return [
        replace(
            cut,
            open_h=cut.open_h / QUARTERS,
            recorded_h=recorded.reshape(shape),
            person_h=np.where(np.isnan(cut.person_h), np.nan, people.reshape(shape)),
        )
        for recorded, people in zip(recorded_h, person_h, strict=True)
    ]


def _forecast(site: Site, slots: Slots, row: int) -> WeekForecast:
    """Forecast the people in view of a week of `slots` from the twelve before it."""
    known = _rows(slots, max(0, row - HISTORY_WEEKS), row + 1)
    known.recorded_h[:, -1] = 0.0  # what came is not known yet, not even which cameras recorded it
    weeks = known.people
    days = special_days(site, _first(slots, row), n_weeks=len(weeks.n))
    return forecast_week(
        weeks.n[:-1],
        days.ordinary_h(weeks.x_h)[:-1],
        is_count=False,
        open_h=known.open_h[-1],
        share=site.settings.forecast_share,
        days=days.last,
    )


def _rows(slots: Slots, begin: int, end: int) -> Slots:
    """Return a copy of some weeks, as if there were no others."""
    names = ("scheduled_h", "recorded_h", "person_h", "violation_h", "n_violations")
    parts = {name: getattr(slots, name)[:, begin:end].copy() for name in names}
    return replace(slots, open_h=slots.open_h[begin:end].copy(), **parts)


def _first(slots: Slots, row: int) -> date:
    return slots.monday - timedelta(weeks=len(slots.open_h) - 1 - row)


def _is_ordinary(site: Site, slots: Slots, row: int) -> bool:
    """Tell whether the second day of a week, which is like the day that is asked for, is no public holiday."""
    return site.calendar.holiday(_first(slots, row) + timedelta(days=1)) is None


def _fullest(
    whole: Weeks, slots: Slots, named: WeekForecast, before: Mapping[int, WeekForecast], since: int
) -> Fullest | None:
    """Name the fullest hour of a day from an hour on, with its record; None where fewer than two are forecast.

    Args:
        whole: People of all hours, to tell which were recorded.
        slots: Hours in which enough people were.
        named: Forecast of the last week.
        before: Forecasts of earlier weeks, by row.
        since: Local hour.
    """
    chosen = slice(HOURS + since, 2 * HOURS)
    if np.isfinite(named.mean[chosen]).sum() <= 1:
        return None
    hour = int(np.nanargmax(named.mean[chosen]))
    n_right = n_days = 0
    for row, forecast in before.items():
        is_recorded = (whole.x_h[row, chosen] > 0) | (slots.open_h[row, chosen] == 0)
        rate = _rows(slots, 0, row + 1).people.rate[row, chosen]
        expected, came = _greatest(forecast.mean[chosen]), _greatest(rate)
        if expected is not None and came is not None and is_recorded.all():
            n_days += 1
            n_right += expected == came
    return Fullest(since + hour, n_right, n_days)


def _greatest(values: Floats) -> int | None:
    return None if np.isnan(values).all() else int(np.nanargmax(values))


def _ahead(usual: UsualDay, at: datetime) -> Fullest | None:
    """Return the fullest hour of the rest of today, unless it was wrong as often as right, or hardly ever looked at."""
    named = usual.fullest[at.hour] if at.date() == usual.day else None
    if named is None or named.n_days < LEAST_RECORD_DAYS or 2 * named.n_right <= named.n_days:
        return None
    return named


def _people(rows: Sequence[Mapping[str, Any]], usual: UsualDay, start: datetime) -> tuple[float | None, Reason | None]:
    """Return the mean number of people in view in a quarter-hour of all cameras, or why it is not known."""
    slots, at = usual.slots, [HOURS + start.hour]
    if not all(row["has_persons"] for row in rows):
        return None, NO_POSITIONS
    people_h, recorded_h, open_h = slots.person_h[:, :, at], slots.recorded_h[:, :, at], slots.open_h[:, at]
    people_h[:, -1], recorded_h[:, -1], open_h[-1] = np.nan, 0.0, 1 / QUARTERS
    for row in rows:
        camera = slots.camera_ids.index(row["camera_id"])
        people_h[camera, -1], recorded_h[camera, -1] = (row[k] / 3_600_000 for k in ("exposure_ms", "recorded_ms"))
    together = recorded_hours(people_h, recorded_h, open_h, min_share=slots.min_share)
    rate = float(together.rate[-1, 0])
    return (None, Reason("recorded.nothing")) if np.isnan(rate) else (rate, None)


def _band(n: float, usual: UsualDay, start: datetime, site: Site) -> Band:
    part = usual.quarters[start.minute * QUARTERS // 60]
    lo, hi = (float(ends[HOURS + start.hour]) for ends in (part.lo, part.hi))
    mask = mask_of(site)
    return in_steps(n, mask) if np.isnan(lo) or np.isnan(hi) else beside_usual(n, lo, hi, mask)


def _queues(warehouse: Warehouse, usual: UsualDay, quarter: int, *, is_whole: bool) -> tuple[QueueNow, ...]:
    site = warehouse.site
    asked = [a for a in site.areas if a.is_queue and a.floor_id == usual.floor_id and a.is_there(usual.day, usual.day)]
    if not asked:
        return ()
    rows = warehouse.rows(_QUEUES, {"floor": usual.floor_id, "quarter": quarter})
    row_by_area = {row["area_id"]: row for row in rows}
    least_ms = usual.slots.min_share * QUARTER_MS

    def band(area: Area) -> Band | None:
        row = row_by_area.get(area.area_id, {"person_ms": 0.0, "recorded_ms": QUARTER_MS})
        if not is_whole or row["recorded_ms"] < least_ms:
            return None
        n, mask = row["person_ms"] / row["recorded_ms"], mask_of(site)
        return in_steps(n, mask) if area.queue_limit is None else beside_limit(n, area.queue_limit, mask)

    return tuple(QueueNow(area.area_id, area.name, band(area)) for area in asked)


def _instant(quarter: int, site: Site) -> datetime:
    return datetime.fromtimestamp(quarter * QUARTER_MS / 1000, tz=UTC).astimezone(site.zone)
