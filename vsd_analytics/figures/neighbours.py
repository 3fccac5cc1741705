"""Others near a person: time with three or more (M32), room around people (M33), others met in a day (M31, M34).

In M31 and M34, others met and people with 15 minutes too close to one of them, a person is a track id: one camera's, of
one site day. Where ids are cut, a person starts again with each, so both figures are given only of cameras whose ids
last (as for M9), and are lower bounds.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from datetime import date
from typing import Final

import numpy as np
import pyarrow as pa

from vsd_analytics.answer import Reason
from vsd_analytics.figures.close_time import SECONDS, close_time_share
from vsd_analytics.figures.episodes import SEED
from vsd_analytics.figures.groups import PURGED
from vsd_analytics.figures.panels import Array, Place
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.room_levels import LEVELS, ROOM_M2, density_edges, level_of
from vsd_analytics.stats.estimates import RateEstimate, no_rate
from vsd_analytics.stats.groups import ShareEstimate, share_by_days
from vsd_analytics.stats.others_met import CountQuantiles, count_quantiles
from vsd_analytics.warehouse.warehouse import Warehouse

THREE: Final = 3


@dataclass(frozen=True, slots=True)
class RoomLevel:
    """Person-time at one of Fruin's levels of service.

    Attributes:
        level: A (most room) to F.
        density_from, density_to: People per m² above which it begins and up to which it goes; None = no end.
        share: Share of person-time, with the interval of M6 between groups.
    """

    level: str
    density_from: float
    density_to: float | None
    share: RateEstimate


def three_or_more(period: Period) -> RateEstimate:
    """Return the share of person-time with three or more others closer than the legal distance (M32)."""
    if (why := period.why_no_exposure) is not None:
        return no_rate(why)
    by_number = _by_number(period)
    if by_number is None:
        return no_rate(PURGED)
    crowded = sum((hours for n, hours in by_number.items() if n >= THREE), start=np.zeros_like(period.data.everyone.n))
    return _share(period, crowded)


def room_around(period: Period) -> tuple[RoomLevel, ...]:
    """Return person-time by how densely people stand around a person, at Fruin's levels of service (M33).

    The density is that of the disc of the legal distance around a person, oneself included: (1 + others) / (pi d^2).
    Floor behind walls and out of view counts as empty, so near them it is too low.
    """
    area_m2 = math.pi * float(period.data.site.settings.distance_m) ** 2
    hours: list[Array] | None = None
    why = period.why_no_exposure
    if why is None and area_m2 < ROOM_M2[0]:
        why = Reason("room.small_disc", least=math.sqrt(ROOM_M2[0] / math.pi))
    if why is None:
        by_number = _by_number(period)
        why = PURGED if by_number is None else None
        if by_number is not None:
            in_company = sum(by_number.values(), start=np.zeros_like(period.data.everyone.n))
            by_number[0] = np.maximum(period.data.everyone.exposure_h - in_company, 0.0)
            hours = [np.zeros_like(in_company) for _ in LEVELS]
            for n, value in by_number.items():
                hours[level_of((1 + n) / area_m2)] += value
    return tuple(
        RoomLevel(
            level,
            *density_edges()[k],
            no_rate(why) if hours is None and why is not None else _share(period, (hours or [])[k]),
        )
        for k, level in enumerate(LEVELS)
    )


def _share(period: Period, hours: Array) -> RateEstimate:
    data = period.data
    place = Place(hours * SECONDS, data.everyone.exposure_h, data.everyone.cameras & period.knows_distances)
    return close_time_share(period, place, has_history=False)


def _by_number(period: Period) -> dict[int, Array] | None:
    """Return person-hours by number of others too close, each (n_cameras, n_hours); None where they were not stored."""
    data = period.data
    rows = data.warehouse.table(
        "select camera_id, hour_start_ms, n_others, violation_s::double / 3600 as hours from neighbour_hours "
        "where list_contains($cameras::varchar[], camera_id) and local_date between $first and $last "
        "order by hour_start_ms, camera_id, n_others",
        {"cameras": data.ids, "first": period.first, "last": period.last},
    )
    n = rows["n_others"].to_numpy()
    hours_by_number = {k: data.by_hour(rows.filter(pa.array(n == k)), "hours")[0] for k in np.unique(n).tolist()}
    stored = sum(hours_by_number.values(), start=np.zeros_like(data.everyone.n))
    if (data.violation_h * period.is_inside).sum() > 1.001 * (stored * period.is_inside).sum() + 1e-6:
        return None  # sealed by a version that did not count others
    return hours_by_number


@dataclass(frozen=True, slots=True)
class OthersMet:
    """Whom the people of a range met.

    Attributes:
        met: Different others closer than the legal distance, by person and day: median and 90 % quantile (M31).
        long_share: Share of people with `contact_s` or more too close to one other within a day (M34), with n and of.
    """

    met: CountQuantiles
    long_share: ShareEstimate


def others_met(warehouse: Warehouse, cameras: Collection[str], *, first: date, last: date) -> OthersMet:
    """Return how many others people met in a range, and the share of them with 15 minutes too close to one.

    Args:
        warehouse: Its days.
        cameras: Ids of the cameras whose track ids last (`groups.camera_lives`).
        first: First site day.
        last: Last site day.
    """
    settings = warehouse.site.settings
    rows = warehouse.table(
        "select site_day, n_met, longest_s::double as longest_s from met_days "
        "where list_contains($cameras::varchar[], camera_id) and site_day between $first and $last "
        "order by site_day, camera_id, track_id",
        {"cameras": sorted(cameras), "first": first, "last": last},
    )
    day = rows["site_day"].to_numpy().astype("datetime64[D]").astype(np.int64)
    is_long = rows["longest_s"].to_numpy() >= settings.contact_s
    _, code = np.unique(day, return_inverse=True)
    return OthersMet(
        met=count_quantiles(rows["n_met"].to_numpy(), day, seed=SEED, **settings.for_intervals),
        long_share=share_by_days(np.bincount(code, weights=is_long), np.bincount(code), **settings.for_intervals),
    )
