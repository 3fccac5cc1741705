"""Hours of the planner's week, square by square, and what is typical of each: what the page replays an hour at a time.

For readers these are classes (`figures.share.squares`). What is typical of an hour is made of the classes that the
weeks before give, so it tells no more than they do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Any, Final

import numpy as np
import shapely

from vsd_analytics.figures.panels import Flags, Ints
from vsd_analytics.figures.periods import Period
from vsd_analytics.figures.share.places import hidden_floor
from vsd_analytics.figures.share.squares import ClassSteps, square_classes
from vsd_analytics.figures.square_hours import SIDE_M, SquareGrid, square_grid, square_times
from vsd_analytics.planner.cell_counts import grid_of
from vsd_analytics.planner.hour_counts import Counted, TwoWeeks, floor_panel, hidden_places, open_slots
from vsd_analytics.planner.map_kinds import BURDEN_STEPS, EXPOSURE_STEPS
from vsd_analytics.wording.catalogue import say
from vsd_analytics.wording.format import plain

RING_STEPS: Final = (BURDEN_STEPS[2], BURDEN_STEPS[4])
"""Person-seconds too close per m² and hour from which a square has a thin, or a thick, ring."""
SHOWN, NOT_RECORDED, FEW_PEOPLE = range(3)
HIDDEN_COUNT: Final = 4
"""Added to the state of an hour whose violations the timetable hides."""
UNITS_MS: Final = (6_000, 1_000)
"""On the operator's page, person-time is in tenths of a minute and time too close in seconds."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Replay:
    """What the page replays.

    Attributes:
        grid: The squares.
        state: Of each open hour: what it shows, and whether its count is hidden, shape (n_hours,).
        n_weeks: Weeks before that its typical hour is made of, at most, same shape.
        now: Person-time and time too close of this week, shape (2, n_squares, n_hours): classes for readers, else in
            `UNITS_MS` per recorded hour.
        typical: The lower median of the same hour in the weeks before, of those that give the square.
    """

    grid: SquareGrid
    state: Ints
    n_weeks: Ints
    now: Ints
    typical: Ints

    @property
    def rings(self) -> tuple[str, ...]:
        """Return what a thin ring means, and a thick one."""
        return tuple(say("planner.replay.ring", n=plain(step)) for step in RING_STEPS)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class _SquareWeek:
    weekday: Ints
    hour: Ints
    state: Ints
    values: Ints
    given: Flags


def replay(data: TwoWeeks, counted: Counted, *, before: Sequence[date]) -> Replay | None:
    """Return the hours of the week by square; None without a map, or where nothing of single hours can be given.

    Args:
        data: The floor.
        counted: The page's places, and the floor shown.
        before: First days of the weeks before, which the typical hours are made of.
    """
    if counted.extent is None or grid_of(counted.extent) is None or data.why_no_exposure is not None:
        return None
    grid = square_grid(counted.extent)
    week = _week(data, counted, data.monday, grid=grid)
    if not (week.values[0] > 0).any():
        return None
    earlier = [_week(data, counted, monday, grid=grid) for monday in before]
    n_weeks, typical = np.zeros_like(week.state), np.zeros_like(week.values)
    for k, (weekday, hour) in enumerate(zip(week.weekday, week.hour, strict=True)):
        n_weeks[k], typical[:, :, k] = _typical(earlier, weekday=weekday, hour=hour)
    return Replay(grid=grid, state=week.state, n_weeks=n_weeks, now=week.values, typical=typical)


def _typical(weeks: Sequence[_SquareWeek], *, weekday: int, hour: int) -> tuple[int, Ints]:
    """Return of how many weeks an hour is known, and the lower median of those that give a square, 0 without any."""
    same = [(w.weekday == weekday) & (w.hour == hour) for w in weeks]
    values, given = (
        np.concatenate([part[..., at] for part, at in zip(parts, same, strict=True)], axis=-1)
        for parts in ([w.values for w in weeks], [w.given for w in weeks])
    )
    n = given.sum(axis=1)
    if not n.any():
        return 0, np.zeros(values.shape[:2], dtype=np.int64)
    at = np.where(n > 0, values.shape[2] - n + (n - 1) // 2, 0)
    middle = np.take_along_axis(np.sort(np.where(given, values, -1), axis=2), at[None, :, None], axis=2)[:, :, 0]
    return int(n.max()), np.where(n > 0, middle, 0)


def _week(data: TwoWeeks, counted: Counted, monday: date, *, grid: SquareGrid) -> _SquareWeek:
    period = Period(data, monday, monday + timedelta(days=6))
    assert counted.extent is not None
    slots, held = open_slots(data, period.days), data.hidden_in(monday)
    is_hidden = 0 in hidden_places(data, [monday], counted.areas)
    panel = floor_panel(data, period.days, counted, [monday], is_hidden=is_hidden)
    recorded_h = panel.recorded_ms[0] / 3_600_000
    is_few = np.isin(slots, list(held.untimed)) | (held.why_untimed is not None) | is_hidden
    is_shown = panel.is_counted[0] & (recorded_h > 0)
    has_count = ~np.isin(slots, list(held.hours.small | held.hours.others))
    state = np.where(is_few, FEW_PEOPLE, np.where(is_shown, SHOWN, NOT_RECORDED)) + np.where(has_count, 0, HIDDEN_COUNT)
    areas = [None if a is None else a.polygon for a in counted.areas]
    times = square_times(data, slots, grid=grid, extent=counted.extent, areas=areas, recorded_h=recorded_h)
    given = _given(data, period, grid=grid)[:, None] & (is_shown & ~is_few)
    if data.mask.is_on:
        classes = square_classes(times, _steps(), data.mask, given=given, counted=has_count)
        values = np.stack((classes.time, classes.close))
    else:
        sums = np.stack([times.by_square(times.time_ms), times.by_square(times.close_ms)])
        per_h = sums * given / np.where(recorded_h > 0, recorded_h, 1.0) / np.array(UNITS_MS)[:, None, None]
        values = np.rint(per_h).astype(np.int64)
    return _SquareWeek(weekday=panel.weekday, hour=panel.hour, state=state, values=values, given=given)


def _steps() -> ClassSteps:
    m2 = SIDE_M**2
    return ClassSteps(
        time_ms=tuple(step * m2 * 60_000 for step in EXPOSURE_STEPS),
        close_ms=tuple(step * m2 * 1_000 for step in RING_STEPS),
    )


def _given(data: TwoWeeks, period: Period, *, grid: SquareGrid) -> Flags:
    """Return the squares that have no floor in common with that of hidden places, shape (n_squares,)."""
    hidden = hidden_floor(data, period)
    meets = shapely.relate_pattern(grid.boxes(), hidden, "T********") if not hidden.is_empty else False
    return np.asarray(~np.broadcast_to(meets, grid.n_squares), dtype=np.bool_)


def replay_meta(replay: Replay) -> dict[str, Any]:
    """Return what the page's script must know beside the packed squares."""
    return {
        "side": SIDE_M,
        "x0": replay.grid.x0 * SIDE_M,
        "y0": replay.grid.y0 * SIDE_M,
        "nx": replay.grid.n_x,
        "ny": replay.grid.n_y,
        "steps": [_steps().time_ms[k] / UNITS_MS[0] for k in range(len(EXPOSURE_STEPS))],
        "rings": [_steps().close_ms[k] / UNITS_MS[1] for k in range(len(RING_STEPS))],
    }
