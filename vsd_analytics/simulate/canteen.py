"""A made-up canteen with one camera and two open hours a day: small enough for ten weeks in seconds.

People come in, take food at a counter, pay at a till, and leave past the tray return and the water. The waiting line is
before the till. The change that is planted is in this line: waiting places are marked on the floor, farther apart than
the legal distance. Who comes when, and how long everybody stays where, does not change. Floor metres, x to the right,
y up.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date, datetime, time
from typing import Final, NamedTuple
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.simulate.shop import FloatArray, Rect
from vsd_analytics.site.model import Point

WIDTH_M: Final = 20.0
DEPTH_M: Final = 9.0
TIMEZONE: Final = "Europe/Rome"
OPENS: Final = time(12)
OPEN_S: Final = 7200
INTERVAL_S: Final = 3
"""Seconds from frame to frame."""
PEOPLE_PER_H: Final = 60.0
"""Of a day of average business."""

AREAS: Final[dict[str, tuple[str, Rect]]] = {
    "till": ("Till", (1.6, 1.2, 11.6, 5.9)),
    "counter": ("Food counter", (0.8, 6.2, 6.8, 8.2)),
    "trays": ("Tray return", (17.0, 6.2, 19.6, 8.4)),
    "water": ("Water", (17.0, 3.2, 19.6, 5.2)),
}
"""Names and rectangles by id. Tray return and water are five metres and more from the till: they are its comparison."""
FIXTURES: Final[dict[str, tuple[str, str, Rect]]] = {
    "food": ("Food", "shelf", (1.2, 8.2, 6.4, 8.8)),
    "cash": ("Till", "till", (10.7, 2.2, 11.4, 3.4)),
    "belt": ("Tray belt", "shelf", (18.3, 8.4, 19.7, 8.9)),
    "fountain": ("Fountain", "other", (18.3, 5.2, 19.5, 5.6)),
}
REDESIGN_AREA: Final = "till"
REDESIGN_TEXT: Final = "Waiting places marked on the floor, 2.1 m apart"

_DOOR_IN: Final[Point] = (0.6, 2.0)
_DOOR_OUT: Final[Point] = (19.4, 2.0)
_TILL: Final[Point] = (10.2, 2.8)
_SERVICE_S: Final = 30.0
_LINE_HEAD_X_M: Final = 8.1
_LINE_Y_M: Final = (2.8, 4.95)
"""The line goes left from its head; where it is too long, it goes on above."""
_LINE_LEFT_M: Final = 1.8
_STEP_M: Final = {False: 0.9, True: 2.1}
"""From one to the next in the line, before and after the waiting places were marked."""
_WALK_M_S: Final = 1.1
_TO_LINE_S: Final = 5.0
"""From the counter to the line."""
_SPREAD: Final = 0.06
"""Standard deviation of the log of a day's business."""
_NOISE_M: Final = 0.04


class CanteenDay(NamedTuple):
    """Where everybody was on one day, ordered by frame, then person.

    Attributes:
        frame_ms: UTC milliseconds of each frame: the engine runs in opening hours only.
        frame: Frame of each row (int64).
        person: Number of the person on that day, from 1 (int64).
        x_m: Floor x, with the error of an engine.
        y_m: Floor y.
    """

    frame_ms: NDArray[np.int64]
    frame: NDArray[np.int64]
    person: NDArray[np.int64]
    x_m: FloatArray
    y_m: FloatArray


def canteen_day(day: date, *, seed: int, is_marked: bool) -> CanteenDay:
    """Return where everybody in the canteen is on one day, a frame every 3 s.

    The same seed and date give the same people at the same times, whether the waiting places are marked or not.

    Args:
        day: Local date.
        seed: Seed of the world.
        is_marked: The waiting places are marked.
    """
    draw = np.random.default_rng([seed, day.toordinal()])
    n = 1 + draw.poisson(PEOPLE_PER_H * OPEN_S / 3600 * draw.lognormal(-(_SPREAD**2) / 2, _SPREAD))
    arrives = np.sort(draw.beta(1.2, 1.2, n)) * (OPEN_S - 600)
    counter_x, takes_s = draw.uniform(1.2, 6.4, n), 15 + draw.gamma(2.0, 18.0, n)
    counter_y = draw.uniform(7.2, 7.9, n)
    service_s = _SERVICE_S * draw.uniform(0.6, 1.4, n)
    tray_x, tray_s = draw.uniform(17.3, 19.3, n), 10 + draw.gamma(2.0, 16.0, n)
    water_x, water_s = draw.uniform(17.5, 19.2, n), 8 + draw.gamma(2.0, 14.0, n)

    ways: list[list[tuple[float, float, float]]] = []
    for i in range(n):
        way = [(float(arrives[i]), *_DOOR_IN)]
        _go(way, (float(counter_x[i]), float(counter_y[i])), stay_s=float(takes_s[i]))
        ways.append(way)
    _pay(ways, service_s, step_m=_STEP_M[is_marked])
    for i, way in enumerate(ways):
        _go(way, (float(tray_x[i]), 7.8), stay_s=float(tray_s[i]))
        _go(way, (float(water_x[i]), 4.7), stay_s=float(water_s[i]))
        _go(way, _DOOR_OUT, stay_s=0.0)
    return _frames(day, ways, draw)


def _go(way: list[tuple[float, float, float]], to: Point, *, stay_s: float) -> None:
    """Append a straight walk and a stay to a way of (seconds, x, y)."""
    at_s, x, y = way[-1]
    there_s = at_s + float(np.hypot(to[0] - x, to[1] - y)) / _WALK_M_S
    way.append((there_s, *to))
    if stay_s > 0:
        way.append((there_s + stay_s, *to))


def _pay(ways: Sequence[list[tuple[float, float, float]]], service_s: FloatArray, *, step_m: float) -> None:
    """Append waiting and paying: first come, first served; the line moves up when the next is called."""
    joins = [way[-1][0] + _TO_LINE_S for way in ways]
    free_s, called = 0.0, list[float]()
    for i in np.argsort(joins, kind="stable"):
        ahead = [t for t in called if t > joins[i]]
        way = ways[i]
        way.append((joins[i], *_line_place(len(ahead), step_m)))
        for place, moves_s in zip(range(len(ahead) - 1, -1, -1), ahead, strict=True):
            way += [(moves_s, *way[-1][1:]), (moves_s + 2.0, *_line_place(place, step_m))]
        call_s = max(joins[i] + 2.0, free_s)
        way += [(call_s, *way[-1][1:]), (call_s + 2.0, *_TILL)]
        free_s = call_s + 2.0 + float(service_s[i])
        way.append((free_s, *_TILL))
        called.append(call_s)


def _line_place(k: int, step_m: float) -> Point:
    """Return the place of the one who has `k` others before them."""
    per_row = int((_LINE_HEAD_X_M - _LINE_LEFT_M) / step_m) + 1
    row, along = divmod(k, per_row)
    return _LINE_HEAD_X_M - step_m * (along if row % 2 == 0 else per_row - 1 - along), _LINE_Y_M[min(row, 1)]


def _frames(day: date, ways: Sequence[list[tuple[float, float, float]]], draw: np.random.Generator) -> CanteenDay:
    """Return where everybody is at every frame that finds them inside."""
    n_frames = OPEN_S // INTERVAL_S
    frames, people, xs, ys = [], [], [], []
    for i, way in enumerate(ways):
        at_s, x, y = np.array(way).T
        begin, end = (int(np.ceil(t / INTERVAL_S)) for t in (at_s[0], at_s[-1]))
        frame = np.arange(begin, min(end, n_frames), dtype=np.int64)
        frames.append(frame)
        people.append(np.full(len(frame), i + 1, dtype=np.int64))
        xs.append(np.interp(frame * INTERVAL_S, at_s, x))
        ys.append(np.interp(frame * INTERVAL_S, at_s, y))
    frame, person = np.concatenate(frames), np.concatenate(people)
    order = np.lexsort((person, frame))
    noise = draw.normal(0, _NOISE_M, (2, len(order)))
    opens_ms = round(datetime.combine(day, OPENS, ZoneInfo(TIMEZONE)).timestamp() * 1000)
    return CanteenDay(
        frame_ms=opens_ms + 1000 * INTERVAL_S * np.arange(n_frames, dtype=np.int64),
        frame=frame[order],
        person=person[order],
        x_m=np.concatenate(xs)[order] + noise[0],
        y_m=np.concatenate(ys)[order] + noise[1],
    )
