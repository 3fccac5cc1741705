"""Time too close of a place: its share of person-time (M6) and its person-minutes per open hour, levels and changes.

Person-seconds stand for events in the statistics of M0 and M7, so that their rules for small counts do not bite. Days
are the clusters. A person counts where they stand, so areas and the rest add up to the floor.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.floor_days import NO_FLOOR
from vsd_analytics.figures.panels import Array, Place
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.figures.rates import NOT_RECORDED, change_per_open_hour, encounter_rate_change, history
from vsd_analytics.site.model import Area, Floor
from vsd_analytics.stats.estimates import ChangeEstimate, RateEstimate, no_rate
from vsd_analytics.stats.rates import encounter_rate, violation_rate

SECONDS: Final = 3600.0
MINUTES: Final = 60.0


def close_time(period: Period, where: Floor | Area | None) -> Place:
    """Return person-seconds in violation as `n`, and person-hours, of the floor, an area, or (None) the rest of it.

    Cameras of which some hour's distances are unknown are left out.
    """
    data = period.data
    if isinstance(where, Floor):
        violation_h, exposure_h, cameras = data.violation_h, data.everyone.exposure_h, data.everyone.cameras
    else:
        area_id = None if where is None else where.area_id
        violation_h, (_, exposure_h) = data.violation_in(area_id), data.counted_in(area_id)
        cameras = np.asarray(exposure_h.any(axis=1))
    is_there = data.is_there(where.area_id) if isinstance(where, Area) else None
    return Place(violation_h * SECONDS, exposure_h, cameras & period.knows_distances, is_there)


def close_time_share(period: Period, place: Place, *, has_history: bool = True) -> RateEstimate:
    """Return the share of person-time in violation (M6) of a place made by `close_time`, with the interval of M7.

    Args:
        period: The days.
        place: Person-seconds in violation, and person-hours.
        has_history: Its `n` holds the weeks before the period too.
    """
    data, settings = period.data, period.data.site.settings
    if not (data.hours.recorded_s > 0)[:, period.is_inside].any():
        return no_rate(Reason("level.unrecorded"), "not_enough_data")
    if (why := period.why_no_exposure) is not None:
        return no_rate(why)
    if not place.cameras.any():
        return no_rate(NO_FLOOR)
    if not period.knows(place):
        return NOT_RECORDED
    now, past = (data.panel(place, days) for days in (period.days, period.history_days if has_history else []))
    estimate = encounter_rate(
        now.n.sum(axis=0),
        now.exposure_h.sum(axis=0),
        min_exposure_h=0.0,
        **settings.for_intervals,
        **history(period, past.n.sum(axis=0), history_exposure_h=past.exposure_h.sum(axis=0)),
    )
    if estimate.value is None:
        return replace(estimate, reason=Reason("nobody.seen_open"))
    estimate = in_units(estimate, SECONDS, Reason("nobody.close"))
    if estimate.lo is not None and estimate.exposure_h < settings.min_exposure_h:
        reason = Reason("level.interval_person_hours", least=settings.min_exposure_h, has=estimate.exposure_h)
        estimate = replace(estimate, lo=None, hi=None, state="not_enough_data", reason=reason)
    return at_most_one(estimate)


def close_time_share_by_hour(period: Period) -> Array:
    """Return the share of the floor's person-time in violation (M6) in each hour of the data, shape (n_hours,).

    Of the camera-hours that enter rates; NaN in hours without any, and where nobody was in view. One hour is one
    cluster, so it has no interval.
    """
    place = close_time(period, period.data.floor)
    used = place.cameras[:, None] & period.data.hours.is_counted & period.is_inside
    close_h, exposure_h = ((v * used).sum(axis=0) for v in (place.n / SECONDS, place.exposure_h))
    share: Array = np.divide(close_h, exposure_h, out=np.full(exposure_h.shape, np.nan), where=exposure_h > 0)
    return share


def burden(period: Period, place: Place) -> RateEstimate:
    """Return person-minutes in violation per recorded open hour, sum over cameras, with the interval of M0."""
    data = period.data
    if not place.cameras.any():
        return no_rate(NO_FLOOR)
    if not period.knows(place):
        return NOT_RECORDED
    now, past = (data.panel(place, days) for days in (period.days, period.history_days))
    rules = data.site.settings.for_intervals
    estimate = violation_rate(now.n, now.x_h, **rules, **history(period, past.n, history_x_h=past.x_h))
    return in_units(estimate, MINUTES, Reason("nobody.close"))


def change_close_time_share(pair: TwoPeriods, place: Place) -> ChangeEstimate:
    """Return the change of the share of person-time in violation (M6) over the camera-hours compared."""
    return _change_in_units(encounter_rate_change(pair, _with_known_distances(pair, place)), SECONDS)


def change_burden(pair: TwoPeriods, place: Place) -> ChangeEstimate:
    """Return the change of person-minutes in violation per open hour over the camera-hours compared."""
    return _change_in_units(change_per_open_hour(pair, _with_known_distances(pair, place)), MINUTES)


def in_units(estimate: RateEstimate, per_unit: float, nothing: Reason) -> RateEstimate:
    """Return an estimate of person-seconds as one of so many seconds each; `nothing` is the reason of a rate of 0."""
    if estimate.value is None:
        return estimate
    if estimate.n_events == 0:
        return replace(estimate, lo=None, hi=None, state="ok", reason=nothing)
    lo, hi = (None if v is None else v / per_unit for v in (estimate.lo, estimate.hi))
    return replace(estimate, value=estimate.value / per_unit, lo=lo, hi=hi, n_events=None)


def at_most_one(estimate: RateEstimate) -> RateEstimate:
    """Return a share that its interval puts at no more than 1."""
    if estimate.value is None:
        return estimate
    return replace(estimate, value=min(1.0, estimate.value), hi=None if estimate.hi is None else min(1.0, estimate.hi))


def _change_in_units(change: ChangeEstimate, per_unit: float) -> ChangeEstimate:
    """Return a change with its rates in so many person-seconds; what was counted is no number of violations."""
    rate_a, rate_b = (None if v is None else v / per_unit for v in (change.rate_a, change.rate_b))
    return replace(change, rate_a=rate_a, rate_b=rate_b, n_a=None, n_b=None)


def _with_known_distances(pair: TwoPeriods, place: Place) -> Place:
    """Return a place without the cameras whose distances are unknown in either period."""
    return replace(place, cameras=place.cameras & pair.before.knows_distances & pair.now.knows_distances)
