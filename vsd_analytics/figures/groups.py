"""People together: the groups of a range, and its violations in two readings, all and between groups (M9).

A violation is within a group when both its people walk in one (mart `track_groups`), or stand in one company for at
least half of it (fact `standing_groups`); every other is between groups. Both readings are reported, side by side.
Where track ids are cut or frames too rare, the filter says that it is not applicable, and no figure between groups is
computed. In queues it is not known who is together: with more than half of the violations there, M9 is not measurable.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from typing import Any, Final

import numpy as np
import pyarrow.compute as pc

from vsd_analytics.answer import Reason, State
from vsd_analytics.figures.floor_days import NO_FLOOR, NO_IDS
from vsd_analytics.figures.group_list import Group, groups_of
from vsd_analytics.figures.panels import Array, FloorHours, Place
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.rates import encounter_rate_level, violation_rate_level
from vsd_analytics.figures.slots import NO_POSITIONS
from vsd_analytics.settings import IntervalRules
from vsd_analytics.site.cameras_by_name import camera_called
from vsd_analytics.site.model import Camera
from vsd_analytics.stats.estimates import RateEstimate
from vsd_analytics.stats.groups import KNOWN_ACCURACY, Accuracy, ShareEstimate, TrackLives, share_by_days, track_lives
from vsd_analytics.warehouse.rules import RULES
from vsd_analytics.warehouse.warehouse import Warehouse

PURGED: Final = Reason("purged.groups")
NOTHING: Final = Reason("recorded.nothing")
_RECORDED: Final = """
select
    camera_id,
    coalesce(bool_or(recorded_s > 0), false) as is_recorded,
    coalesce(bool_or(exposure_s is not null), false) as knows_people,
    coalesce(bool_or(violation_records is not null), false) as knows_distances,
    coalesce(bool_or(n_violations is not null), false) as knows_violations,
    sum(person_records)::bigint as person_records
from camera_hours
where local_date between $first and $last
group by camera_id
"""


@dataclass(frozen=True, slots=True)
class CameraLives:
    """What one camera's track ids allow.

    Attributes:
        camera_id: The camera.
        lives: Whether its ids last; its state and reason decide whether the camera takes part.
        exposure_h: Person-hours in view of tracks, also where another camera counts.
        together_h: Those of people in groups.
        violation_h: Hours that pairs were in violation, all records of the camera.
        within_h: Those within groups.
    """

    camera_id: str
    lives: TrackLives
    exposure_h: float
    together_h: float
    violation_h: float
    within_h: float


@dataclass(frozen=True, slots=True)
class GroupReadings:
    """The headline numbers of one floor in two readings, over the cameras that take part.

    Attributes:
        floor_id: The floor.
        between, n_unknown: As of `Groups`, on this floor.
        violation_rate, violation_rate_between: Violations per open hour (M0), of all and of those between groups.
        encounter_rate, encounter_rate_between: Violations per person-hour (M7), likewise.
    """

    floor_id: str
    between: ShareEstimate
    n_unknown: int
    violation_rate: RateEstimate
    violation_rate_between: RateEstimate
    encounter_rate: RateEstimate
    encounter_rate_between: RateEstimate


@dataclass(frozen=True, slots=True)
class Groups:
    """Who walked or stood together in a range, and what is left between groups.

    Attributes:
        first, last: First and last local day.
        groups: Every group found, also of cameras where the filter is not applicable: there many are missing.
        n_by_size: Number of groups by number of tracks, of cameras that take part.
        cameras: Every camera asked for, with what its ids allow.
        left_out: Why, by camera that takes no part.
        people_share: Share of person-time in groups, 0 to 1; None when not computed.
        time_share: Share of the time pairs were in violation that is within groups; None when not computed.
        between: Share of violations that are between groups (M9), of those in the hours that enter rates whose groups
            are known; of, n and interval.
        n_unknown: Violations in these hours whose groups are unknown; `between` leaves them out, and the readings count
            them as between groups.
        readings: M0 and M7 by floor.
        accuracy: What the rule is known to find.
        state, reason: "ok" where any camera takes part; else why none does.
    """

    first: date
    last: date
    groups: tuple[Group, ...] = field(repr=False)  # there are thousands in a week
    n_by_size: Mapping[int, int]
    cameras: tuple[CameraLives, ...]
    left_out: Mapping[str, Reason | None]
    people_share: float | None
    time_share: float | None
    between: ShareEstimate
    n_unknown: int
    readings: tuple[GroupReadings, ...]
    accuracy: Accuracy
    state: State
    reason: Reason | None


@dataclass(frozen=True, slots=True)
class _Days:
    first: date
    last: date


def groups(
    warehouse: Warehouse, *, camera_id: str | None = None, first: date | None = None, last: date | None = None
) -> Groups:
    """Return who walked or stood together in a range, and its violations between groups.

    Args:
        warehouse: Its days; those before `first` serve as history of the intervals.
        camera_id: Only this camera; None = all.
        first: First local day; None = the warehouse's.
        last: Last local day; None = the warehouse's.

    Raises:
        UsageError: E101, the site has no such camera.

    Example:
        >>> vsd.groups(warehouse).state
        'ok'
    """
    cameras = _cameras(warehouse, camera_id)
    days = _Days(first or warehouse.first, last or warehouse.last)
    lives = camera_lives(warehouse, cameras, first=days.first, last=days.last)
    able = {c.camera_id for c in lives if c.lives.state == "ok"}
    listed_groups = groups_of(warehouse, [c.camera_id for c in cameras], days.first, days.last)
    periods = _periods(warehouse, able, days)
    between, n_unknown = _between(periods, able, warehouse.site.settings.for_intervals)
    exposure_h, together_h, violation_h, within_h = (
        sum(getattr(c, name) for c in lives if c.camera_id in able)
        for name in ("exposure_h", "together_h", "violation_h", "within_h")
    )
    state, reason = _state(lives)
    if reason is not None:
        between = ShareEstimate(None, None, None, 0, 0, 0, state, reason)
    return Groups(
        first=days.first,
        last=days.last,
        groups=listed_groups,
        n_by_size=dict(sorted(Counter(len(g.tracks) for g in listed_groups if g.camera_id in able).items())),
        cameras=lives,
        left_out={c.camera_id: c.lives.reason for c in lives if c.camera_id not in able},
        people_share=together_h / exposure_h if able else None,
        time_share=within_h / violation_h if able and violation_h > 0 else None,
        between=between,
        n_unknown=n_unknown,
        readings=_readings(periods, able),
        accuracy=KNOWN_ACCURACY,
        state=state,
        reason=reason,
    )


def camera_lives(
    warehouse: Warehouse, cameras: Sequence[Camera], *, first: date | None = None, last: date | None = None
) -> tuple[CameraLives, ...]:
    """Return what the track ids of each camera allow in a range, and how much of its time is in groups.

    Args:
        warehouse: Its days.
        cameras: Which.
        first: First day; None = the warehouse's.
        last: Last day; None = the warehouse's.
    """
    settings = warehouse.site.settings
    days = {"first": first or warehouse.first, "last": last or warehouse.last}
    tracks = warehouse.table(
        "select camera_id, life_s::double as life_s, exposure_s::double as exposure_s, n_ends, n_goes_on, "
        "n_came_before from track_days where site_day between $first and $last",
        days,
    )
    values = {name: tracks[name].to_numpy() for name in tracks.column_names[1:]}
    counted = warehouse.rows(
        "select camera_id, sum(n_pairs)::bigint as n_pairs, sum(n_unknown)::bigint as n_unknown, "
        "sum(exposure_s)::double as exposure_s, sum(together_s)::double as together_s, "
        "sum(violation_s)::double as violation_s, sum(within_s)::double as within_s from together_days "
        "where site_day between $first and $last group by camera_id",
        days,
    )
    sums = {row["camera_id"]: row for row in counted}
    recorded = {row["camera_id"]: row for row in warehouse.rows(_RECORDED, days)}
    intervals = {
        row["camera_id"]: row["interval_ms"]
        for row in warehouse.rows(
            "select camera_id, median(interval_ms)::double as interval_ms from camera_days "
            "where date '1970-01-01' + utc_day::integer between $first and $last group by camera_id",
            days,
        )
    }
    all_lives = []
    for camera in (c.camera_id for c in cameras):
        own, row = pc.equal(tracks["camera_id"], camera).to_numpy(), sums.get(camera, {})
        lives = track_lives(
            values["life_s"][own],
            values["exposure_s"][own],
            **{k: int(values[k][own].sum()) for k in ("n_ends", "n_goes_on", "n_came_before")},
            min_life_s=settings.together_life_s,
            max_cut_share=settings.together_cut_share,
        )
        if (why := _why_unknown(recorded[camera], row, intervals.get(camera))) is not None:
            state: State = "not_enough_data" if why == NOTHING else "not_measurable"
            lives = replace(lives, state=state, reason=why)
        hours = (row.get(k, 0.0) / 3600 for k in ("exposure_s", "together_s", "violation_s", "within_s"))
        all_lives.append(CameraLives(camera, lives, *hours))
    return tuple(all_lives)


def between_groups(period: Period, able: set[str] | None = None) -> Place:
    """Return the whole floor of a period with the violations between groups only, for `violation_rate_level`.

    Args:
        period: The days.
        able: Cameras that take part; None = asked of the warehouse's range (`camera_lives`).
    """
    data = period.data
    if able is None:
        able = {c.camera_id for c in camera_lives(data.warehouse, data.cameras) if c.lives.state == "ok"}
    whole = _of_cameras(period, able)
    within, _ = together(period, able)
    n = whole.n - within * whole.cameras[:, None]
    return Place(np.maximum(n, 0.0), whole.exposure_h, whole.cameras)


def _of_cameras(period: Period, able: Collection[str]) -> Place:
    whole = period.whole
    chosen = whole.cameras & np.array([c in able for c in period.data.ids], dtype=np.bool_)
    return Place(whole.n * chosen[:, None], whole.exposure_h * chosen[:, None], chosen)


def _cameras(warehouse: Warehouse, camera_id: str | None) -> list[Camera]:
    if camera_id is not None:
        return [camera_called(warehouse.site, camera_id, option="--camera")]
    return list(warehouse.site.cameras)


def _between(periods: Sequence[Period], able: Collection[str], rules: IntervalRules) -> tuple[ShareEstimate, int]:
    """Return the share of violations between groups on some floors, and how many have unknown groups.

    Of the camera-hours that enter rates, as M8 and both readings of M0 and M7.
    """
    n_days = max((len(period.days) for period in periods), default=0)
    sums = np.zeros((3, n_days))
    for period in periods:
        whole = _of_cameras(period, able)
        counts = (whole.n, *together(period, able))
        sums += [period.data.panel(replace(whole, n=n), period.days).n.sum(axis=0) for n in counts]
    total, within, unknown = sums
    n, n_unknown = round(float(total.sum())), round(float(unknown.sum()))
    if 2 * n_unknown > n:
        reason = Reason("groups.unknown", share=n_unknown / n)
        return ShareEstimate(None, None, None, 0, n - n_unknown, 0, "not_measurable", reason), n_unknown
    return share_by_days(total - unknown - within, total - unknown, **rules), n_unknown


def together(period: Period, able: Collection[str]) -> tuple[Array, Array]:
    """Return violations within groups, and those whose groups are unknown, each of shape (n_cameras, n_hours)."""
    data = period.data
    rows = data.warehouse.table(
        "select camera_id, hour_start_ms, count(*) filter (where is_together)::double as n_within, "
        "count(*) filter (where is_together is null)::double as n_unknown from violations "
        "where is_open and floor_id = $floor group by camera_id, hour_start_ms",
        {"floor": data.floor.floor_id},
    )
    within, unknown = data.by_hour(rows, "n_within", "n_unknown")
    takes_part = np.array([c in able for c in data.ids], dtype=np.float64)[:, None]
    return within * takes_part, unknown * takes_part


def _periods(warehouse: Warehouse, able: Collection[str], days: _Days) -> list[Period]:
    """Return the days of each floor with a camera that takes part."""
    site = warehouse.site
    floors = [f for f in site.floors if any(c.camera_id in able for c in site.cameras if c.floor_id == f.floor_id)]
    return [Period(FloorHours(warehouse, floor=floor), days.first, days.last) for floor in floors]


def _readings(periods: Sequence[Period], able: set[str]) -> tuple[GroupReadings, ...]:
    readings = []
    for period in periods:
        whole, between = _of_cameras(period, able), between_groups(period, able)
        share, n_unknown = _between([period], able, period.data.site.settings.for_intervals)
        readings.append(
            GroupReadings(
                floor_id=period.data.floor.floor_id,
                between=share,
                n_unknown=n_unknown,
                violation_rate=violation_rate_level(period, whole),
                violation_rate_between=violation_rate_level(period, between),
                encounter_rate=encounter_rate_level(period, whole),
                encounter_rate_between=encounter_rate_level(period, between),
            )
        )
    return tuple(readings)


def _state(lives: Sequence[CameraLives]) -> tuple[State, Reason | None]:
    """Return "ok" where any camera takes part, else the state and reason of the camera with most person-time."""
    if any(c.lives.state == "ok" for c in lives):
        return "ok", None
    if not lives:
        return "not_enough_data", Reason("site.no_camera")
    worst = max(lives, key=lambda c: (c.lives.state == "not_measurable", c.exposure_h))
    return worst.lives.state, worst.lives.reason


def _why_unknown(recorded: Mapping[str, Any], counted: Mapping[str, Any], interval_ms: float | None) -> Reason | None:
    """Return why it cannot be known who is together at a camera, whatever its track ids are; None if it can."""
    if not recorded["is_recorded"]:
        return NOTHING
    if not recorded["knows_people"]:
        return NO_POSITIONS
    if not recorded["knows_distances"]:
        return NO_FLOOR
    if not recorded["knows_violations"]:
        return NO_IDS
    if recorded["person_records"] and not counted:
        return PURGED
    least, window_ms = RULES["company_least_records"], RULES["company_window_ms"]
    if interval_ms is not None and least * interval_ms > window_ms:
        return Reason("groups.rare_frames", interval_s=interval_ms / 1000, most_s=window_ms / least / 1000)
    return NO_POSITIONS if counted and 2 * counted["n_unknown"] > counted["n_pairs"] else None


def between_groups_by_area(period: Period, able: Collection[str]) -> Mapping[str | None, Place]:
    """Return each area with its violations between groups only; None is the rest of the floor.

    Violations whose groups are unknown count as between groups, as on the whole floor.

    Args:
        period: The days.
        able: Ids of the cameras that take part. Areas that another camera counts anything in are left out: a part of
            an area is no area.
    """
    data = period.data
    takes_part = np.array([c in able for c in data.ids], dtype=np.bool_)
    rows = data.warehouse.rows(
        "select area_id, camera_id, hour_start_ms, count(*)::double as n from violations "
        "where is_open and is_together and floor_id = $floor group by all order by all",
        {"floor": data.floor.floor_id},
    )
    places: dict[str | None, Place] = {}
    for area_id in (*(a.area_id for a in data.areas), None):
        place = period.area(area_id)
        if not (place.cameras & takes_part).any() or (place.cameras & ~takes_part).any():
            continue
        n = place.n.copy()
        for row in rows:
            if row["area_id"] == area_id and row["camera_id"] in able:
                hour = int(np.searchsorted(data.hours.start_ms, row["hour_start_ms"]))
                n[data.ids.index(row["camera_id"]), hour] -= row["n"]
        places[area_id] = Place(np.maximum(n, 0.0), place.exposure_h, place.cameras, place.is_there)
    return places
