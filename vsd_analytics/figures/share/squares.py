"""Squares of a floor by hour, as readers may see them: classes, and none of an hour with few people in the square.

Weekly maps give the sum of a square over the hours, and the report the sum of an hour over the floor, both exactly.
Beside them classes bound what is hidden. So a class is given only while the time of each square and hour with few
people can be exchanged: some of it can lie in another hour of the same square, while as much in other squares goes the
other way. Either the squares are of one area, or the hours of one time of day: outputs give areas by time of day at
most. All sums and all classes stay as they are then, so they tell no exact time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.figures.share.counts import Mask

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
LEAST_PART: Final = 0.1
"""Part of a hidden time that must be exchangeable."""
N_PARTNERS: Final = 12
"""Squares that are tried in each hour: those that can give most."""
ROOM: Final = 0.999
"""Of the room up to the next class, which itself is another class."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SquareTimes:
    """Person-time by hour of what the weekly map sums up: the square metres of each camera.

    Attributes:
        time_ms: Person-time, shape (n_units, n_hours).
        close_ms: Part of it in violation, same shape.
        square: Square of each unit, shape (n_units,), rising.
        area: Number of the area of each unit, same shape.
        n_people: A lower bound of the different people in each square and hour, shape (n_squares, n_hours).
        recorded_h: Recorded time of each hour, hours, shape (n_hours,).
        hour_of_day: Local hour of each, 0 to 23, same shape.
    """

    time_ms: Ints
    close_ms: Ints
    square: Ints
    area: Ints
    n_people: Ints
    recorded_h: Floats
    hour_of_day: Ints

    def by_square(self, values: Ints) -> Ints:
        """Return the sums of a table of units, shape (n_squares, n_hours)."""
        sums = np.zeros(self.n_people.shape, dtype=values.dtype)
        np.add.at(sums, self.square, values)
        return sums


@dataclass(frozen=True, slots=True)
class ClassSteps:
    """Lower ends of the classes from 1, in milliseconds of a square and recorded hour."""

    time_ms: tuple[float, ...]
    close_ms: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SquareClasses:
    """What is given of squares and hours.

    Attributes:
        time: Class of the person-time, shape (n_squares, n_hours); 0 = less than the first step, few people, or hidden.
        close: Class of the part in violation, same shape; always 0 where `time` is.
    """

    time: Ints
    close: Ints


def square_classes(times: SquareTimes, steps: ClassSteps, mask: Mask, *, given: Flags, counted: Flags) -> SquareClasses:
    """Return the classes of squares and hours that readers may see.

    Args:
        times: What was recorded.
        steps: The classes.
        mask: The site's.
        given: Squares and hours of which other rules let person-time leave, shape (n_squares, n_hours).
        counted: Hours whose count of violations is given, shape (n_hours,).
    """
    time_ms, close_ms = times.by_square(times.time_ms), times.by_square(times.close_ms)
    is_few = (time_ms > 0) & (times.n_people < mask.below) if mask.is_on else np.zeros_like(given)
    time = np.where(given & ~is_few, _class(time_ms, steps.time_ms, times.recorded_h), 0)
    close = np.where((time > 0) & counted, _class(close_ms, steps.close_ms, times.recorded_h), 0)
    while time.any():
        time_ends = _ends(time, steps.time_ms, times.recorded_h, is_given=time > 0)
        close_ends = _ends(close, steps.close_ms, times.recorded_h, is_given=(time > 0) & counted)
        slack = time_ms - time_ends[0], time_ends[1] - time_ms
        both = np.minimum(slack[0], close_ms - close_ends[0]), np.minimum(slack[1], close_ends[1] - close_ms)
        close_part, time_part = (np.where(is_few, v * LEAST_PART, 0.0) for v in (close_ms, time_ms))
        stuck = _stuck(times, times.close_ms, close_part, *both)
        alone = _stuck(times, times.time_ms - times.close_ms, time_part, *slack)
        if alone.any():  # who is too close all the time can be exchanged as such
            stuck |= _stuck(times, times.close_ms, np.where(alone, time_part, 0.0), *both)
        if not stuck.any():
            break
        wider = np.zeros_like(given)
        wider[stuck.any(axis=1)] = True
        if not time[wider].any():
            wider[:, stuck.any(axis=0)] = True
        if not time[wider].any():
            wider[:] = True
        time[wider] = close[wider] = 0
    return SquareClasses(time=time, close=close)


def _class(values_ms: Ints, steps_ms: tuple[float, ...], recorded_h: Floats) -> Ints:
    per_h = values_ms / np.where(recorded_h > 0, recorded_h, np.inf)
    return np.searchsorted(np.array(steps_ms), per_h, side="right").astype(np.int64)


def _ends(classes: Ints, steps_ms: tuple[float, ...], recorded_h: Floats, *, is_given: Flags) -> tuple[Floats, Floats]:
    """Return between which times a reader knows each square and hour to lie, by its class alone."""
    low, high = np.array([0.0, *steps_ms]), np.array([*steps_ms, np.inf])
    return np.where(is_given, low[classes] * recorded_h, 0.0), np.where(is_given, high[classes], np.inf) * np.where(
        recorded_h > 0, recorded_h, 1.0
    )


def _stuck(times: SquareTimes, units_ms: Ints, part_ms: Floats, down_ms: Floats, up_ms: Floats) -> Flags:
    """Return which squares and hours cannot exchange a part of their time.

    Args:
        times: What was recorded.
        units_ms: The kind of time that moves, by unit.
        part_ms: How much of it must be able to move, shape (n_squares, n_hours); 0 = none.
        down_ms: How much less each may have, same shape.
        up_ms: How much more.
    """
    most, area = _largest_unit(times, units_ms)
    give_ms = np.minimum(most, down_ms)
    anywhere = int(times.area.max(initial=0)) + 1
    partners = np.stack([_partners(np.where(area == k, give_ms, 0)) for k in range(anywhere)] + [_partners(give_ms)])
    square, hour = np.nonzero(part_ms > 0)
    n_hours = part_ms.shape[1]
    for shift in range(1, n_hours):
        if not len(square):
            break
        other, part = (hour + shift) % n_hours, part_ms[square, hour]
        is_same_time = times.hour_of_day[hour] == times.hour_of_day[other]
        less_ms, more_ms = np.zeros_like(part), np.zeros_like(part)
        for k in range(partners.shape[1]):
            # `less` takes in this hour what the square takes in the other one; `more` the other way round
            less = partners[np.where(is_same_time, anywhere, area[square, hour]), k, other]
            is_partner = (less != square) & (is_same_time | (area[less, other] == area[square, hour]))
            less_ms += np.where(is_partner, np.minimum(give_ms[less, other], ROOM * up_ms[less, hour]), 0.0)
            more = partners[np.where(is_same_time, anywhere, area[square, other]), k, hour]
            is_partner = (more != square) & (is_same_time | (area[more, hour] == area[square, other]))
            more_ms += np.where(is_partner, np.minimum(give_ms[more, hour], ROOM * up_ms[more, other]), 0.0)
        can_less = (np.minimum(give_ms[square, hour], less_ms) >= part) & (up_ms[square, other] > part)
        can_more = (np.minimum(give_ms[square, other], more_ms) >= part) & (up_ms[square, hour] > part)
        stays = ~(can_less | can_more)
        square, hour = square[stays], hour[stays]
    stuck = np.zeros(part_ms.shape, dtype=np.bool_)
    stuck[square, hour] = True
    return stuck


def _largest_unit(times: SquareTimes, units_ms: Ints) -> tuple[Ints, Ints]:
    """Return the most time of one unit in each square and hour, and the area of this unit."""
    most, area = np.full(times.n_people.shape, -1, dtype=np.int64), np.zeros(times.n_people.shape, dtype=np.int64)
    rank = np.arange(len(times.square)) - np.searchsorted(times.square, times.square)
    for k in range(int(rank.max(initial=-1)) + 1):
        unit = np.flatnonzero(rank == k)
        at = times.square[unit]
        is_more = units_ms[unit] > most[at]
        most[at] = np.where(is_more, units_ms[unit], most[at])
        area[at] = np.where(is_more, times.area[unit][:, None], area[at])
    return np.maximum(most, 0), area


def _partners(give_ms: Floats) -> Ints:
    """Return the squares that can give most in each hour, shape (at most N_PARTNERS, n_hours)."""
    return np.argsort(-give_ms, axis=0, kind="stable")[:N_PARTNERS]
