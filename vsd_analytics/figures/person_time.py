"""Time of people: how many are in view (M3, M5) and how much of their time is too close to somebody (M6).

Levels with the interval of M0 and M7: days are the clusters (`vsd_analytics.stats.rates`).
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.close_time import SECONDS, close_time, close_time_share, in_units
from vsd_analytics.figures.floor_days import NO_FLOOR
from vsd_analytics.figures.groups import PURGED, camera_lives
from vsd_analytics.figures.panels import Place
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.rates import history
from vsd_analytics.figures.slots import NOTHING_OPEN
from vsd_analytics.site.model import Area, Floor
from vsd_analytics.stats.estimates import RateEstimate, no_rate
from vsd_analytics.stats.rates import violation_rate
from vsd_analytics.warehouse.dimensions import QUARTER_MS

NO_GROUPS: Final = Reason("ids.no_groups")


@dataclass(frozen=True, slots=True)
class PeakQuarter:
    """The quarter-hour with the most people in view.

    Attributes:
        start: Its start, site's zone.
        people: Mean number of people in view in it, sum over cameras.
        recorded_share: Recorded share of it, of the cameras that enter rates in its hour.
    """

    start: datetime
    people: float
    recorded_share: float


@dataclass(frozen=True, slots=True)
class PersonTime:
    """The people of a period, over the camera-hours that enter rates.

    Attributes:
        people: Mean number of people in view (M5): sum over cameras of person-hours / recorded open hours, with the
            interval of M0. Times the recorded hours it is the exposure of M3.
        exposure_h: Person-hours (M3); None when unknown.
        peak: The fullest quarter-hour; None without one that was recorded.
        close: Share of person-time with somebody closer than the legal distance (M6), with the interval of M7.
        close_between: The same, of somebody the person is not together with; its reason says why not.
    """

    people: RateEstimate
    exposure_h: float | None
    peak: PeakQuarter | None
    close: RateEstimate
    close_between: RateEstimate


def person_time(period: Period, *, able: set[str] | None = None) -> PersonTime:
    """Return how many people are in view, and the share of their time too close, of a period of a floor.

    Args:
        period: The days.
        able: Cameras whose track ids tell who is together; None = asked of these days (`camera_lives`).

    Example:
        >>> from vsd_analytics.figures.panels import FloorHours
        >>> from vsd_analytics.figures.periods import Period
        >>> period = Period(FloorHours(warehouse, floor=floor), date(2026, 11, 9), date(2026, 11, 15))
        >>> vsd.person_time(period).people.state
        'ok'
    """
    data = period.data
    if (why := period.why_no_exposure) is not None:
        none = no_rate(why)
        return PersonTime(none, None, None, none, none)
    panel = data.panel(data.everyone, period.days)
    if not panel.x_h.any():
        none = no_rate(NOTHING_OPEN, "not_enough_data")
        return PersonTime(none, None, None, none, none)
    return PersonTime(
        people=people_level(period, data.floor),
        exposure_h=float(panel.exposure_h.sum()),
        peak=_peak(period),
        close=close_time_share(period, close_time(period, data.floor)),
        close_between=_close_between(period, able),
    )


def people_level(period: Period, where: Floor | Area | None) -> RateEstimate:
    """Return the mean number of people (M5) on the floor, in an area, or (None) on the rest of the floor.

    Person-seconds stand for events, so that rules for small counts do not apply.
    """
    data = period.data
    if (why := period.why_no_exposure) is not None:
        return no_rate(why)
    place = data.everyone
    if not isinstance(where, Floor):
        area_id = None if where is None else where.area_id
        _, exposure_h = data.counted_in(area_id)
        place = Place(exposure_h, exposure_h, np.asarray(exposure_h.any(axis=1)), data.is_there(area_id))
    if not place.cameras.any():
        return no_rate(NO_FLOOR)
    now, past = (data.panel(place, days) for days in (period.days, period.history_days))
    if not now.x_h.any():
        return no_rate(NOTHING_OPEN, "not_enough_data")
    weeks_before = history(period, past.exposure_h * 3600, history_x_h=past.x_h)
    level = violation_rate(now.exposure_h * 3600, now.x_h, **data.site.settings.for_intervals, **weeks_before)
    return in_units(level, SECONDS, Reason("nobody.seen"))


def _close_between(period: Period, known: set[str] | None) -> RateEstimate:
    """Return the share of person-time with somebody of another group too close, where track ids tell who is one."""
    data = period.data
    if known is None:
        lives = camera_lives(data.warehouse, data.cameras, first=period.first, last=period.last)
        known = {c.camera_id for c in lives if c.lives.state == "ok"}
    able = np.array([c in known for c in data.ids], dtype=np.bool_)
    if not able.any():
        return no_rate(NO_GROUPS)
    cameras = [c for c, ok in zip(data.ids, able.tolist(), strict=True) if ok]
    rows = data.warehouse.table(_BETWEEN, {"cameras": cameras, "first": period.first, "last": period.last})
    violation_h, all_pairs_h = data.by_hour(rows, "between_h", "all_h")
    counted = data.hours.is_counted & period.is_inside
    if (data.violation_h * counted)[able].sum() > 1.001 * (all_pairs_h * counted)[able].sum() + 1e-6:
        return no_rate(PURGED)
    between = Place(violation_h * SECONDS, data.everyone.exposure_h, able & period.knows_distances)
    return close_time_share(period, between, has_history=False)


def _peak(period: Period) -> PeakQuarter | None:
    data = period.data
    first, end = period.span_ms
    camera, hour = np.nonzero(data.hours.is_counted & period.is_inside)
    rows = data.warehouse.rows(
        _PEAK,
        {
            "cameras": [data.ids[k] for k in camera.tolist()],
            "hours": data.hours.start_ms[hour].tolist(),
            "first": first // QUARTER_MS,
            "end": -(-end // QUARTER_MS),
            "share": data.site.settings.full_hour_share,
        },
    )
    if not rows or rows[0]["people"] is None:
        return None
    row = rows[0]
    return PeakQuarter(data.local(row["quarter"] * QUARTER_MS), row["people"], row["recorded_share"])


_PEAK: Final = """
with used as (select unnest($cameras::varchar[]) as camera_id, unnest($hours::bigint[]) as hour_start_ms),

quarters as (
    select
        c.quarter,
        u.camera_id,
        coalesce(r.recorded_ms, 0) / 900000.0 as recorded,
        coalesce(e.exposure_ms, 0)::double / nullif(r.recorded_ms, 0) as people
    from calendar as c
    inner join used as u on c.hour_start_ms = u.hour_start_ms
    left join coverage as r on u.camera_id = r.camera_id and c.quarter = r.quarter
    left join exposure as e on u.camera_id = e.camera_id and c.quarter = e.quarter
    where c.is_open and c.quarter >= $first and c.quarter < $end
)

select
    quarter,
    sum(people)::double as people,
    avg(recorded)::double as recorded_share
from quarters
group by quarter
having avg(recorded) >= $share
order by people desc, quarter
limit 1
"""

_BETWEEN: Final = """
select
    camera_id,
    hour_start_ms,
    between_s::double / 3600 as between_h,
    violation_s::double / 3600 as all_h
from company_hours
where list_contains($cameras::varchar[], camera_id) and local_date between $first and $last
order by hour_start_ms, camera_id
"""
