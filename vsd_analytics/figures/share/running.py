"""How far a week that goes on may leave: its closed days, but for the last that hold enough.

A page made after each day tells what each day added. So the days of a week are put into steps of at least `mask_below`
violations and people on the floor, and what left is always a whole number of steps, one less than are over: the last of
them stays back, so that what the week's own page adds is never a small count. An area whose counts are small in a step,
or in the step that stays back, is hidden until the week is over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date

from vsd_analytics.figures.panels import Array, FloorHours, Ints
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.people import people_of_floor

Key = str | None
"""Id of an area; None is the rest of the floor."""


@dataclass(frozen=True, slots=True)
class Release:
    """What leaves of a week that goes on.

    Attributes:
        through: Last day that is counted.
        unready: Areas whose counts do not leave yet.
        untimed: Areas whose person-time does not leave yet.
    """

    through: date
    unready: frozenset[Key]
    untimed: frozenset[Key]


def release(data: FloorHours, monday: date, last: date) -> Release | None:
    """Return what may leave of the days from `monday` to `last`, which are closed; None = nothing yet.

    Args:
        data: The floor, its warehouse opened over these days.
        monday: First day of the week.
        last: Last closed day.
    """
    below = data.mask.below
    period = Period(data, monday, last)
    of_floor = data.panel(period.whole, period.days).n.sum(axis=0)
    ends = _steps(of_floor, people_of_floor(period), below)
    if len(ends) <= 1:
        return None
    keys: list[Key] = [*(a.area_id for a in data.areas), None] if data.areas else []
    counts = {key: _by_step(data.panel(period.area(key), period.days).n.sum(axis=0), ends) for key in keys}
    there = {key: _most_by_step(n, ends) for key, n in period.people_by_day.items()} if keys else {}
    return Release(
        period.days[ends[-2] - 1],
        frozenset(key for key in keys if not _is_ready(counts[key], below)),
        frozenset(key for key in keys if not _is_ready(there[key], below)),
    )


def _steps(n: Array, people: Ints, below: int) -> list[int]:
    """Return the ends of steps of days: each has `below` violations and people, or more."""
    ends, total, most = [], 0.0, 0
    for k, (n_day, n_people) in enumerate(zip(n, people, strict=True), 1):
        total, most = total + n_day, max(most, int(n_people))
        if total >= below and most >= below:
            ends.append(k)
            total, most = 0.0, 0
    return ends


def _by_step(n: Array, ends: Sequence[int]) -> list[int]:
    return [int(n[a:b].sum()) for a, b in zip([0, *ends], ends, strict=False)]


def _most_by_step(n: Ints, ends: Sequence[int]) -> list[int]:
    return [int(n[a:b].max(initial=0)) for a, b in zip([0, *ends], ends, strict=False)]


def _is_ready(steps: Sequence[int], below: int) -> bool:
    """Tell whether the sum of all steps but the last may leave, given what left after each of them.

    It may where nothing was counted yet; else what was added since it last left, and what stays, must not be small.
    """
    *before, back = steps
    if not any(before):
        return True
    added, is_ready = 0, True
    for k, n in enumerate(before):
        added += n
        stays = before[k + 1] if k + 1 < len(before) else back
        is_ready = (added == 0 or added >= below) and stays >= below
        if is_ready:
            added = 0
    return is_ready
