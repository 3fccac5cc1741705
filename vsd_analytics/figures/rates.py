"""The headline numbers of a place and their changes (M0, M7, and people M3): one definition for all who print them."""

from __future__ import annotations

from datetime import date
from typing import Any, Final

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.panels import WEEK, Array, Panel, Place
from vsd_analytics.figures.periods import Period, TwoPeriods
from vsd_analytics.stats.changes import compare_encounter_rates, compare_exposure, compare_violation_rates
from vsd_analytics.stats.cut_share import widened
from vsd_analytics.stats.estimates import ChangeEstimate, RateEstimate, no_change, no_rate
from vsd_analytics.stats.rates import encounter_rate, violation_rate
from vsd_analytics.stats.weekly_steps import MAX_STEPS

_NOTHING: Final = Reason("recorded.nothing")
NOT_RECORDED: Final = no_rate(_NOTHING, "not_enough_data")
"""The rate of a place whose cameras recorded nothing: that nothing was counted there is no zero."""
NOT_COMPARED: Final = no_change(_NOTHING, "not_enough_data")
"""Its change."""


def violation_rate_level(
    period: Period, place: Place, *, since: int | None = None, until: int | None = None
) -> RateEstimate:
    """Return how often violations happened in a place (M0): sum over cameras of violations / recorded open hours.

    Args:
        period: The days.
        place: The whole floor, an area, or the rest.
        since: Only hours that start at this instant or later (UTC milliseconds); a part of a period has no history.
        until: Only hours that start before it.
    """
    if (why := period.why_no_violations) is not None:
        return no_rate(why)
    if not period.knows(place):
        return NOT_RECORDED
    panel, past = _panels(period, place, since, until)
    rules = period.data.site.settings.for_intervals
    return violation_rate(panel.n, panel.x_h, **history(period, past.n, history_x_h=past.x_h), **rules)


def encounter_rate_level(
    period: Period, place: Place, *, since: int | None = None, until: int | None = None
) -> RateEstimate:
    """Return encounters per person-hour of a place (M7); arguments as for `violation_rate_level`."""
    if (why := period.why_no_violations or period.why_no_exposure) is not None:
        return no_rate(why)
    if not period.knows(place):
        return NOT_RECORDED
    panel, past = _panels(period, place, since, until)
    settings = period.data.site.settings
    return encounter_rate(
        panel.n.sum(axis=0),
        panel.exposure_h.sum(axis=0),
        **history(period, past.n.sum(axis=0), history_exposure_h=past.exposure_h.sum(axis=0)),
        min_exposure_h=settings.min_exposure_h,
        **settings.for_intervals,
    )


def violation_rate_change(pair: TwoPeriods, place: Place, *, since: int | None = None) -> ChangeEstimate:
    """Return the change in how often (M0) over the camera-hours compared; `since` as for `TwoPeriods.compared`.

    Where the share of track ids that are cut changed, its range is wider by what cut ids can do to counts.
    """
    change = change_per_open_hour(pair, place, since=since)
    if pair.cut_shares is None:
        return change
    settings = pair.data.site.settings
    return widened(change, confidence=settings.confidence, about_same_share=settings.about_same_share)


def change_per_open_hour(pair: TwoPeriods, place: Place, *, since: int | None = None) -> ChangeEstimate:
    """Return the change of what a place counts per open hour: violations, or person-seconds in violation (burden)."""
    if not (pair.before.knows(place) and pair.now.knows(place)):
        return NOT_COMPARED
    before, now = pair.compared(place, since=since)
    settings, past = pair.data.site.settings, past_weeks(pair, place, since)
    return compare_violation_rates(
        before.n,
        before.x_h,
        now.n,
        now.x_h,
        history_n=[week.n for week in past],
        history_x_h=[week.x_h for week in past],
        about_same_share=settings.about_same_share,
        **settings.for_intervals,
    )


def encounter_rate_change(pair: TwoPeriods, place: Place, *, since: int | None = None) -> ChangeEstimate:
    """Return the change in encounters per person-hour (M7) over the camera-hours compared.

    Of a place that counts person-seconds in violation instead of violations it is the change of their share (M6).
    """
    if not (pair.before.knows(place) and pair.now.knows(place)):
        return NOT_COMPARED
    before, now = pair.compared(place, since=since)
    settings, past = pair.data.site.settings, past_weeks(pair, place, since)
    return compare_encounter_rates(
        before.n.sum(axis=0),
        before.exposure_h.sum(axis=0),
        now.n.sum(axis=0),
        now.exposure_h.sum(axis=0),
        history_n=[week.n.sum(axis=0) for week in past],
        history_exposure_h=[week.exposure_h.sum(axis=0) for week in past],
        min_exposure_h=settings.min_exposure_h,
        about_same_share=settings.about_same_share,
        **settings.for_intervals,
    )


def change_people(pair: TwoPeriods, place: Place) -> ChangeEstimate:
    """Return the change of the mean number of people in a place over the camera-hours compared."""
    before, now = pair.compared(place)
    settings, past = pair.data.site.settings, past_weeks(pair, place)
    return compare_exposure(
        before.exposure_h,
        before.x_h,
        now.exposure_h,
        now.x_h,
        history_h=[week.exposure_h for week in past],
        history_x_h=[week.x_h for week in past],
        about_same_share=settings.about_same_share,
        **settings.for_intervals,
    )


def mean_people(period: Period, place: Place) -> float | None:
    """Return the mean number of people in a place, person-hours per recorded open hour; None without any."""
    panel = period.data.panel(place, period.days)
    recorded = panel.x_h.sum(axis=1)
    seen = recorded > 0
    return float((panel.exposure_h.sum(axis=1)[seen] / recorded[seen]).sum()) if seen.any() else None


def _panels(period: Period, place: Place, since: int | None, until: int | None) -> tuple[Panel, Panel]:
    is_part = since is not None or until is not None
    panel = period.data.panel(place, period.days, since=since, until=until)
    return panel, period.data.panel(place, [] if is_part else period.history_days)


def past_weeks(pair: TwoPeriods, place: Place, since: int | None = None) -> list[Panel]:
    """Return the weeks before the periods, oldest first, on the weekdays compared.

    None for a part of a week or more than one.
    """
    return [] if since is not None else [pair.data.panel(place, week) for week in past_week_days(pair)]


def past_week_days(pair: TwoPeriods) -> list[list[date]]:
    """Return the days of the weeks before the periods, oldest first, on the weekdays compared; none for other spans."""
    days = [before for before, _ in pair.pairs]
    is_one_week = len({day.weekday() for day in days}) == len(days)
    if not days or not is_one_week:
        return []
    earliest = min(days)
    later = {day for _, day in pair.pairs}
    weeks = [[day - k * WEEK for day in days] for k in range(MAX_STEPS, 0, -1)]
    withheld = pair.data.warehouse.withheld_days.get(pair.data.floor.floor_id, frozenset())
    return [week for week in weeks if max(week) < earliest and not (later | withheld) & set(week)]


def history(period: Period, n: Array, **divided_by: Array) -> dict[str, Any]:
    """Return the arguments that give weeks before to a level; none without any.

    Args:
        period: The period of the level.
        n: What was counted in the weeks before, its last axis their days.
        divided_by: What it is divided by, named as the argument.
    """
    days = period.history_days if n.shape[-1] else []
    weekdays = [np.array([d.weekday() for d in dates], dtype=np.int64) for dates in (period.days, days)]
    if not days:
        return {"weekday": weekdays[0]}
    return {"weekday": weekdays[0], "history_n": n, "history_weekday": weekdays[1], **divided_by}
