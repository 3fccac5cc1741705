"""Hours as readers may know them, for all that is computed from hours of several weeks.

A forecast, an unusual hour or a profile made from exact hours would tell those that a report hides. So hidden hours of
a week have equal parts of their sum, as far as the report tells this sum, and are not recorded otherwise: hours whose
count is hidden, of violations, and hours of few people, of their time.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vsd_analytics.figures.panels import WEEK, Flags, Ints
from vsd_analytics.figures.share.together import equal_parts
from vsd_analytics.figures.slots import Floats, Slots
from vsd_analytics.figures.week.data import WeekData


def shared_slots(slots: Slots, data: WeekData) -> Slots:
    """Return hours of some weeks as the reports of these weeks tell them.

    Args:
        slots: What was counted.
        data: The floor; its warehouse holds the weeks.
    """
    if not data.mask.is_on:
        return slots
    n, hidden = slots.n_violations.copy(), np.zeros(slots.open_h.shape, dtype=np.bool_)
    person_h, untimed = slots.person_h.copy(), np.zeros(slots.open_h.shape, dtype=np.bool_)
    for week in range(len(hidden)):
        held = data.hidden_in(slots.monday - (len(hidden) - 1 - week) * WEEK)
        hours = [*held.hours.small, *held.hours.others]
        hidden[week, _slot(data, hours)] = True
        untimed[week, _slot(data, [*held.untimed])] = True
        if held.why_untimed is not None:
            person_h[:, week] = np.nan
        elif untimed[week].any():
            _put_mean(person_h[:, week], untimed[week], slots.is_recorded[:, week])
        if held.why_floor is not None:
            hidden[week], n[:, week] = True, np.nan
        elif hours:
            _put_parts(n[:, week], hidden[week], slots.recorded_h[:, week] > 0, slots.is_recorded[:, week])
    if not hidden.any() and not untimed.any():
        return slots
    return replace(slots, n_violations=n, person_h=person_h, hidden=hidden)


def _slot(data: WeekData, hours: list[int]) -> Ints:
    return np.asarray(24 * data.hours.weekday[hours] + data.hours.hour[hours], dtype=np.int64)


def _put_mean(person_h: Floats, hidden: Flags, counted: Flags) -> None:
    """Put the mean of each camera's person-time into its hours of a week whose time is hidden, or NaN.

    Where a camera recorded only some of these hours, the mean could be the time of few people.
    """
    is_used = counted[:, hidden] & ~np.isnan(person_h[:, hidden])
    is_whole = bool((is_used.all(axis=1) | ~is_used.any(axis=1)).all())
    for camera_h, is_counted in zip(person_h, is_used, strict=True):
        at = np.flatnonzero(hidden)[is_counted]
        camera_h[at] = camera_h[at].mean() if is_whole and len(at) else np.nan


def _put_parts(n: Floats, hidden: Flags, seen: Flags, counted: Flags) -> None:
    """Put equal parts of each camera's sum into its hidden hours of a week, or NaN where no report tells this sum."""
    is_sum_known = bool(counted[seen].all())  # an hour that enters no rate is in the timetable, and in no total
    for camera_n, is_counted in zip(n, counted, strict=True):
        at = np.flatnonzero(hidden & is_counted & ~np.isnan(camera_n))
        camera_n[at] = equal_parts(round(float(camera_n[at].sum())), len(at)) if is_sum_known else np.nan
