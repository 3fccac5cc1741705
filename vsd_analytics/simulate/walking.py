"""Ways through the free rectangles of a shop: routes, walkers and waiting lines."""

from __future__ import annotations

import heapq
from bisect import bisect_right
from collections.abc import Sequence
from math import hypot
from random import Random
from typing import NamedTuple

from vsd_analytics.simulate.shop import Rect, Shop, WaitingLine
from vsd_analytics.site.model import Point


class Passage(NamedTuple):
    """A passage from one free rectangle into the next: their overlap."""

    zone: str
    portal: Rect


class Routes:
    """Shortest ways between the free rectangles of a shop, each a list of passages.

    Args:
        shop: The shop.
    """

    def __init__(self, shop: Shop) -> None:
        self._zones = shop.zones
        self._neighbours: dict[str, list[Passage]] = {name: [] for name in shop.zones}
        for a, rect_a in shop.zones.items():
            for b, rect_b in shop.zones.items():
                overlap = _overlap(rect_a, rect_b)
                if a != b and overlap is not None:
                    self._neighbours[a].append(Passage(b, overlap))
        self._ways: dict[tuple[str, str], tuple[Passage, ...]] = {}

    def between(self, start: str, goal: str) -> tuple[Passage, ...]:
        """Return the passages from zone `start` to zone `goal`; empty when they are the same.

        The way is the shortest over the centres of the passages (Dijkstra).
        """
        key = (start, goal)
        if key not in self._ways:
            self._ways[key] = self._search(start, goal)
        return self._ways[key]

    def _search(self, start: str, goal: str) -> tuple[Passage, ...]:
        heap: list[tuple[float, int, str, Point, tuple[Passage, ...]]] = [
            (0.0, 0, start, _centre(self._zones[start]), ())
        ]
        done: set[str] = set()
        pushed = 0
        while heap:
            length, _, zone, place, way = heapq.heappop(heap)
            if zone == goal:
                return way
            if zone in done:
                continue
            done.add(zone)
            for step in self._neighbours[zone]:
                at = _centre(step.portal)
                further = length + hypot(at[0] - place[0], at[1] - place[1])
                if step.zone == goal:
                    end = _centre(self._zones[goal])
                    further += hypot(at[0] - end[0], at[1] - end[1])
                pushed += 1
                heapq.heappush(heap, (further, pushed, step.zone, at, (*way, step)))
        raise ValueError(f"no way from {start!r} to {goal!r}")


def _overlap(a: Rect, b: Rect) -> Rect | None:
    x0, y0, x1, y1 = max(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), min(a[3], b[3])
    return (x0, y0, x1, y1) if x1 - x0 > 0.05 and y1 - y0 > 0.05 else None


def _centre(rect: Rect) -> Point:
    return (rect[0] + rect[2]) / 2, (rect[1] + rect[3]) / 2


class Walker:
    """One visitor's way, or that of a group's leader, as knots of time and place between which it runs straight.

    Attributes:
        t_s: Times of the knots, seconds, strictly increasing.
        x_m: Their floor x.
        y_m: Their floor y.
        zone: Free rectangle the walker is in.
        size: People in the group, 1 for somebody alone.

    Args:
        routes: Ways through the shop.
        draw: Source of randomness.
        zone: Free rectangle to start in.
        start_s: When the walker enters.
        place: Where.
        size: People in the group.
    """

    __slots__ = ("_draw", "_routes", "size", "speed_m_s", "t_s", "x_m", "y_m", "zone")

    def __init__(self, routes: Routes, draw: Random, *, zone: str, start_s: float, place: Point, size: int) -> None:
        self._routes, self._draw = routes, draw
        self.zone, self.size = zone, size
        self.t_s, self.x_m, self.y_m = [start_s], [place[0]], [place[1]]
        self.speed_m_s = min(1.6, max(0.8, draw.gauss(1.2 - 0.06 * (size - 1), 0.14)))

    @property
    def now_s(self) -> float:
        """Return the time of the last knot."""
        return self.t_s[-1]

    def go(self, zone: str, place: Point) -> None:
        """Walk to a place in a zone by the shortest way, at a comfortable distance from the corners."""
        x, y = self.x_m[-1], self.y_m[-1]
        for step in self._routes.between(self.zone, zone):
            x0, y0, x1, y1 = step.portal
            x = _pass(x, place[0], x0, x1, self._draw.random())
            y = _pass(y, place[1], y0, y1, self._draw.random())
            self._knot(x, y, self.speed_m_s)
        self._knot(place[0], place[1], self.speed_m_s)
        self.zone = zone

    def stand(self, seconds: float) -> None:
        """Stay in place."""
        self.t_s.append(self.t_s[-1] + max(seconds, 0.01))
        self.x_m.append(self.x_m[-1])
        self.y_m.append(self.y_m[-1])

    def stand_until(self, at_s: float) -> None:
        """Stay in place until a time; do nothing if it has passed."""
        if at_s > self.now_s:
            self.stand(at_s - self.now_s)

    def shuffle(self, place: Point, at_s: float) -> None:
        """Move up in a line, at `at_s` or as soon as the walker has stopped."""
        self.stand_until(at_s)
        self._knot(place[0], place[1], 0.8)

    def _knot(self, x: float, y: float, speed_m_s: float) -> None:
        length = hypot(x - self.x_m[-1], y - self.y_m[-1])
        self.t_s.append(self.t_s[-1] + max(length / speed_m_s, 0.01))
        self.x_m.append(x)
        self.y_m.append(y)


def _pass(here: float, there: float, low: float, high: float, chance: float) -> float:
    """Return where to cross a passage along one axis: between the points nearest to here and there, spread a little."""
    near = (min(max(here, low), high) + min(max(there, low), high)) / 2
    spread = min(0.8, 0.45 * (high - low))
    return min(max(near + (2 * chance - 1) * spread, low), high)


def serve(
    walkers: Sequence[Walker], line: WaitingLine, *, draw: Random, service_s: float, open_stations: Sequence[int]
) -> None:
    """Let walkers join a line in the order in which they come, wait, and be served (first come, first served).

    A newcomer joins the end of the line. When the first leaves it, the others move up one after another. For every
    three who wait, one more station opens.

    Args:
        walkers: Everybody who comes, anywhere in the shop; on return they are at their station, served.
        line: The line.
        draw: Source of randomness.
        service_s: Mean time of service (log-normal with coefficient of variation 0.4).
        open_stations: Number of open stations by hour since time 0; the last holds for later hours.
    """
    for walker in walkers:
        zone, (x0, y0, x1, y1) = line.approach
        x, y = walker.x_m[-1] + draw.uniform(-1.0, 1.0), walker.y_m[-1] + draw.uniform(-0.5, 0.5)
        walker.go(zone, (min(max(x, x0), x1), min(max(y, y0), y1)))
    free_at = [0.0] * len(line.stations)
    left_s: list[float] = []  # when those before left the line, in order
    for walker in sorted(walkers, key=lambda w: w.now_s):
        walker.go(line.zone, _place(line, _n_after(left_s, walker.now_s) + 0.3, draw))
        joined_s = walker.now_s
        ahead_s = left_s[len(left_s) - _n_after(left_s, joined_s) :]
        n_open = open_stations[min(max(int(joined_s // 3600), 0), len(open_stations) - 1)]
        n_open = min(n_open + len(ahead_s) // 3, len(free_at))
        station = min(range(n_open), key=lambda k: (max(free_at[k], joined_s), k))
        for rank, gone_s in zip(range(len(ahead_s), 0, -1), ahead_s, strict=True):
            walker.shuffle(_place(line, rank - 1, draw), gone_s + 0.6 * rank)
        walker.stand_until(max(free_at[station] + 1.0, left_s[-1] + 1.0 if left_s else joined_s))
        left_s.append(walker.now_s)
        zone, (x, y) = line.stations[station]
        walker.go(zone, (x + draw.uniform(-0.1, 0.1), y + draw.uniform(-0.3, 0.3)))
        walker.stand(draw.lognormvariate(-0.07, 0.38) * service_s)
        free_at[station] = walker.now_s


def _n_after(times_s: Sequence[float], at_s: float) -> int:
    """Return how many of the ascending times lie after `at_s`."""
    return len(times_s) - bisect_right(times_s, at_s)


def _place(line: WaitingLine, index: float, draw: Random) -> Point:
    k = min(index, line.capacity)
    return (
        line.head[0] + k * line.step[0] + draw.uniform(-0.08, 0.08),
        line.head[1] + k * line.step[1] + draw.uniform(-0.08, 0.08),
    )
