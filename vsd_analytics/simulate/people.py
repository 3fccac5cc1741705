"""The people of one simulated day: arrivals, groups, stops, and positions at every frame.

Arrivals are Poisson by hour of the week times a factor of the day. Singles and groups enter by the door, some stop at
the display, all stop at shelves, some at the pharmacy; all queue at the tills and leave.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from functools import cache
from math import hypot
from random import Random
from typing import NamedTuple

import numpy as np

from vsd_analytics.simulate.positions import IntArray, person_frames
from vsd_analytics.simulate.shop import (
    CHECKOUT,
    DOOR_IN,
    DOOR_OUT,
    PHARMACY,
    SHOP_AFTER,
    SHOP_BEFORE,
    STOPS,
    FloatArray,
    Rect,
    ShelfStop,
    Shop,
)
from vsd_analytics.simulate.walking import Routes, Walker, serve
from vsd_analytics.site.model import Point

MARGIN_S = 900
"""The engine starts this long before opening and stops this long after closing."""

PARTIES_PER_H = 44.0
"""Singles and groups that enter in an average hour."""
_WEEKDAY = (0.92, 0.90, 0.93, 0.97, 1.08, 1.22, 0.95)
_HOUR = (*[0.5] * 8, 0.55, 0.7, 0.88, 1.02, 1.3, 1.0, 0.78, 0.85, 1.08, 1.4, 1.25, 0.9, 0.55, *[0.4] * 3)
_SATURDAY = (*[0.5] * 8, 0.6, 0.85, 1.1, 1.22, 1.2, 0.95, 0.9, 1.05, 1.25, 1.3, 1.1, 0.8, 0.5, *[0.4] * 3)
_DAY_SD = 0.05
_GROUP_SIZES, _GROUP_SHARES = (1, 2, 3, 4), (0.84, 0.13, 0.02, 0.01)
_PHARMACY_SHARE = 0.08
_SERVICE_S, _PHARMACY_S = 74.0, 110.0
_LAST_ENTRY_S = 480.0
_ELBOW_ROOM_M = 2.3  # shoppers look for a place at a shelf this far from the next person


@dataclass(frozen=True, slots=True)
class SimulatedDay:
    """Where everybody is at every frame of one day; rows are ordered by person, then frame.

    Attributes:
        day: Local date.
        opens: Local opening instant.
        closes: Local closing instant.
        first_frame_ms: UTC milliseconds of frame 0.
        interval_ms: Milliseconds from frame to frame.
        n_frames: Frames of the day.
        shop: The shop on that day.
        person: Person of each row, from 0 (int64).
        party: Single or group of each row, from 0 (int64).
        frame: Frame of each row (int64).
        x_m: True floor x of each row.
        y_m: True floor y of each row.
        entered_ms: UTC milliseconds at which each person (not row) entered.
    """

    day: date
    opens: datetime
    closes: datetime
    first_frame_ms: int
    interval_ms: int
    n_frames: int
    shop: Shop
    person: IntArray
    party: IntArray
    frame: IntArray
    x_m: FloatArray
    y_m: FloatArray
    entered_ms: IntArray

    @property
    def frame_ms(self) -> IntArray:
        """Return the UTC milliseconds of all frames."""
        return self.first_frame_ms + self.interval_ms * np.arange(self.n_frames, dtype=np.int64)


def parties_per_hour(day: date, hour: int) -> float:
    """Return the expected singles and groups entering in an hour of the day, before the factor of the day.

    Args:
        day: Local date.
        hour: Local hour 0 to 23.
    """
    weekday = day.weekday()
    return PARTIES_PER_H * _WEEKDAY[weekday] * (_SATURDAY if weekday == 5 else _HOUR)[hour]


def simulate_day(
    opens: datetime, *, closes: datetime, seed: int, interval_s: float, display_moved: bool, busy: float = 1.0
) -> SimulatedDay:
    """Simulate one day of the shop.

    The same seed and date give the same people whatever the frame interval.

    Args:
        opens: Opening instant, with its zone.
        closes: Closing instant of the same local day.
        seed: Seed of the world.
        interval_s: Seconds from frame to frame.
        display_moved: True when the display is already in its new place.
        busy: Factor on the number of people.

    Returns:
        True positions at every frame from 15 minutes before opening to 15 minutes after closing.
    """
    day = opens.date()
    draw = Random(seed * 1_000_003 + day.toordinal())
    noise = np.random.default_rng([seed, day.toordinal()])
    shop = SHOP_AFTER if display_moved else SHOP_BEFORE
    open_s = (closes - opens).total_seconds()
    walkers = _visits(shop, draw, opens=opens, open_s=open_s, busy=busy)

    interval_ms = round(interval_s * 1000)
    n_frames = int((open_s + 2 * MARGIN_S) * 1000 // interval_ms)
    first_ms = round(opens.timestamp() * 1000) - MARGIN_S * 1000
    rows = person_frames(
        shop, walkers, first_frame_s=-MARGIN_S, interval_s=interval_ms / 1000, n_frames=n_frames, noise=noise
    )
    entered = np.array([w.t_s[0] for w in walkers for _ in range(w.size)], dtype=np.float64)
    return SimulatedDay(
        day=day,
        opens=opens,
        closes=closes,
        first_frame_ms=first_ms,
        interval_ms=interval_ms,
        n_frames=n_frames,
        shop=shop,
        person=rows.person,
        party=rows.party,
        frame=rows.frame,
        x_m=rows.x_m,
        y_m=rows.y_m,
        entered_ms=first_ms + MARGIN_S * 1000 + np.round(entered * 1000).astype(np.int64),
    )


@cache
def _routes(display_moved: bool) -> Routes:
    return Routes(SHOP_AFTER if display_moved else SHOP_BEFORE)


def _visits(shop: Shop, draw: Random, *, opens: datetime, open_s: float, busy: float) -> list[Walker]:
    """Return the way of every single and of every group's leader; times are seconds after opening."""
    routes = _routes(shop is SHOP_AFTER)
    factor = busy * draw.lognormvariate(-(_DAY_SD**2) / 2, _DAY_SD)
    walkers = []
    for entry_s in _entries(draw, opens=opens, open_s=open_s - _LAST_ENTRY_S, factor=factor):
        size = draw.choices(_GROUP_SIZES, _GROUP_SHARES)[0]
        walkers.append(Walker(routes, draw, zone="hall", start_s=entry_s, place=_within(DOOR_IN, draw), size=size))

    to_pharmacy = []
    taken: dict[str, deque[_Spot]] = {}
    for walker in walkers:
        hurry = 0.5 if walker.now_s > open_s - 1200 else 1.0
        if draw.random() < shop.display_share and hurry == 1.0:
            spot = draw.choices(shop.display_stops, [s.weight for s in shop.display_stops])[0]
            walker.go(spot.zone, _within(spot.rect, draw))
            walker.stand(_dwell(draw, 90.0))
        for stop in _shopping_list(draw, hurry):
            _browse(walker, stop, draw, mean_s=46.0 * hurry, taken=taken)
        if draw.random() < _PHARMACY_SHARE:
            to_pharmacy.append(walker)
    serve(to_pharmacy, PHARMACY, draw=draw, service_s=_PHARMACY_S, open_stations=[1])
    hours = [opens + timedelta(hours=h) for h in range(int(open_s // 3600) + 1)]
    tills = [1 + int(busy * parties_per_hour(at.date(), at.hour) / 58.0) for at in hours]
    serve(walkers, CHECKOUT, draw=draw, service_s=_SERVICE_S, open_stations=[min(n, 4) for n in tills])
    for walker in walkers:
        walker.go("exit-lane", (draw.uniform(14.0, 16.5), draw.uniform(0.4, 0.9)))
        walker.go("hall", _within(DOOR_OUT, draw))
    return walkers


def _entries(draw: Random, *, opens: datetime, open_s: float, factor: float) -> list[float]:
    """Return the seconds after opening at which singles and groups enter: Poisson, rate constant within an hour."""
    entries = []
    at_s = 0.0
    while at_s < open_s:
        local = opens + timedelta(seconds=at_s)
        rate_h = factor * parties_per_hour(local.date(), local.hour)
        step_s = draw.expovariate(rate_h) * 3600 if rate_h > 0 else 3600.0
        hour_left_s = 3600 - (local.minute * 60 + local.second + local.microsecond / 1e6)
        if step_s > hour_left_s:
            at_s += hour_left_s + 1e-3  # the exponential has no memory: draw again with the next hour's rate
            continue
        at_s += step_s
        if at_s < open_s:
            entries.append(at_s)
    return entries


def _shopping_list(draw: Random, hurry: float) -> list[ShelfStop]:
    """Return the stops of one visit, in the order of a round through the shop from the right to the left or back."""
    n_stops = max(1, round(draw.gammavariate(3.0, 1.5 * hurry)))
    stops = draw.choices(STOPS, [s.weight for s in STOPS], k=n_stops)
    order = {"fruit-front": 0, "fruit-side": 1, "right": 2, "aisle-3": 3, "back": 4, "aisle-2": 5, "aisle-1": 6}
    stops.sort(key=lambda s: order.get(s.zone, 7) + draw.uniform(-0.8, 0.8))
    if draw.random() < 0.25:
        stops.reverse()
    return stops


class _Spot(NamedTuple):
    """A place at a shelf somebody has taken, and until when."""

    x_m: float
    y_m: float
    until_s: float


def _browse(walker: Walker, stop: ShelfStop, draw: Random, *, mean_s: float, taken: dict[str, deque[_Spot]]) -> None:
    """Walk to a shelf and stand at the first of eight random places that nobody else is near, or at the eighth."""
    others = taken.setdefault(stop.zone, deque(maxlen=24))
    x, y = _within(stop.rect, draw)
    for _ in range(7):
        there_s = walker.now_s + hypot(x - walker.x_m[-1], y - walker.y_m[-1]) / walker.speed_m_s
        if all(spot.until_s < there_s or hypot(spot.x_m - x, spot.y_m - y) > _ELBOW_ROOM_M for spot in others):
            break
        x, y = _within(stop.rect, draw)
    walker.go(stop.zone, (x, y))
    walker.stand(_dwell(draw, mean_s))
    others.append(_Spot(x, y, walker.now_s))


def _dwell(draw: Random, mean_s: float) -> float:
    return 4.0 + draw.gammavariate(1.3, mean_s / 1.3)


def _within(rect: Rect, draw: Random) -> Point:
    return draw.uniform(rect[0], rect[2]), draw.uniform(rect[1], rect[3])


def people_inside(day: SimulatedDay) -> IntArray:
    """Return how many people are in the shop at every frame."""
    return np.bincount(day.frame, minlength=day.n_frames)
