"""Which person-time is held back: that of places, and of hours, in which few people are known to have been.

The time of the floor is known, so with them goes the time of another place, or hour, in which enough people were: else
the floor's time less that of all others would be theirs. The floor itself: `people.why_few_on_floor`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from typing import TYPE_CHECKING

import numpy as np

from vsd_analytics.answer import Reason
from vsd_analytics.figures.share.counts import GIVES_AWAY
from vsd_analytics.figures.share.earlier import REST, versions
from vsd_analytics.figures.share.people import has_tracks, people_by_hour_of_day

if TYPE_CHECKING:
    from vsd_analytics.figures.periods import Period


def hidden_times(period: Period) -> Mapping[str | None, Reason]:
    """Return why the person-time of areas is held back, by area; None is the rest of the floor.

    Fewer than `mask_below` people made it, on the day with most of them (`people`). The other place is the rest of the
    floor, or the last area with enough people. What an earlier version of the same days held back stays so: else the
    time of few people would be the sum known then less what is known now.

    Args:
        period: The week of a floor.
    """
    data = period.data
    below = data.mask.below
    if not data.mask.is_on or not data.areas:
        return {}
    few_people = Reason("hidden.few_people", least=below)
    if period.why_few_people is not None:
        return dict.fromkeys([*(a.area_id for a in data.areas), None], few_people)
    n_people = {key: int(n.max(initial=0)) for key, n in period.people_by_day.items()}
    times_h = {key: float(np.nansum(data.panel(period.area(key), period.days).exposure_h)) for key in n_people}
    few = [k for k, n in n_people.items() if times_h[k] > 0 and (n < below or k in data.untimed)]
    others = [k for k in reversed(n_people) if k not in few and times_h[k] > 0] if few else []
    of_same_days = (w for w in versions(data.site, data.floor.floor_id, period.first) if w.through == period.last)
    before = {name for week in of_same_days for name in week.untimed_places}
    stays = [k for k in n_people if times_h[k] > 0 and (REST if k is None else k) in before]
    return dict.fromkeys([*others[:1], *stays], GIVES_AWAY) | dict.fromkeys(few, few_people)


def hidden_hours_of_day(period: Period, area_id: str, times: Mapping[int, float]) -> Mapping[int, Reason]:
    """Return why the person-time of an area is held back in hours of the day whose week is given, by hour.

    With the hours of few people goes the one with fewest of those in which enough were: else the week less all others
    would be theirs.

    Args:
        period: The week of a floor.
        area_id: An area whose time over the week is given.
        times: Person-time of each hour of the day, or people waiting; 0 where nobody was.
    """
    below = period.data.mask.below
    if not period.data.mask.is_on:
        return {}
    n_people = people_by_hour_of_day(period, area_id)
    some = [hour for hour, time in times.items() if time > 0]
    few = [hour for hour in some if n_people.get(hour, 0) < below]
    others = sorted((n_people[hour], hour) for hour in some if hour not in few) if few else []
    return dict.fromkeys(few, Reason("hidden.few_people", least=below)) | {h: GIVES_AWAY for _, h in others[:1]}


def hours_without_times(period: Period, ends: Sequence[date] = ()) -> frozenset[int]:
    """Return the hours of a floor whose person-time is held back, as positions in its hours.

    The other hour is the nearest in which enough people were. Pages that left while the week went on tell the time up
    to a day, so it is of the same days between two such pages. Where there is none, or the floor had few people, no
    hour with anybody in it has a time. Without track ids it is not known how many people an hour had, and none is held
    back.

    Args:
        period: The week of a floor.
        ends: Last days of the pages that left while the week went on.
    """
    data = period.data
    if not data.mask.is_on:
        return frozenset()
    is_used = data.hours.is_counted & period.is_inside
    is_some = np.where(is_used, np.nan_to_num(data.everyone.exposure_h), 0.0).sum(axis=0) > 0
    some = np.flatnonzero(is_some).tolist()
    if period.why_few_people is not None:
        return frozenset(some)
    if not has_tracks(period):
        return frozenset()
    step = np.searchsorted(sorted(end.toordinal() for end in ends), data.hours.day)
    hidden: set[int] = set()
    for of_step in ([i for i in some if step[i] == k] for k in range(len(ends) + 1)):
        few = [i for i in of_step if data.mask.hides(int(data.people_by_hour[i]))]
        enough = sorted(set(of_step) - set(few), key=lambda i: (abs(i - few[0]), i)) if few else []
        hidden.update(few, enough[:1])
    return frozenset(hidden)
