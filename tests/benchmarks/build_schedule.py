"""The schedule of a distributed build: when it would end on some workers, given what each of its units costs.

The driver hands out units, and workers take the first one that waits. The driver publishes what comes back, one unit
after the other. Where processes share cores, each gets an equal part of them: so a simulated clock also runs on a
machine that has fewer cores than workers.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from itertools import count
from math import inf


@dataclass(frozen=True, slots=True)
class Phase:
    """Units that are handed out together, and what the driver does alone around them; processor seconds.

    Attributes:
        before_s: Driver, before any of them can be handed out.
        units_s: Worker, each unit, in the order in which they are handed out.
        publish_s: Driver, for each unit that comes back.
    """

    before_s: float
    units_s: Sequence[float]
    publish_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Engine:
    """How an engine hands out units.

    Attributes:
        ahead: Units handed out for each worker and not published yet.
        n_series: Series of units whose results come back together, whole. 0 = each unit comes back by itself.
        start_s: Processor seconds of a worker before its first unit: a start of Java, imports.
        driver_start_s: The same of the driver.
    """

    ahead: int
    n_series: int = 0
    start_s: float = 0.0
    driver_start_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Machines:
    """What the processes run on.

    Attributes:
        cores: Cores that driver and workers share; infinite = one for each.
        others: Processes of others that want a core at any moment, on average.
        slowdown: Processor time of a unit beside one more process, by that of a unit alone: they share memory and
            caches.
    """

    cores: float = inf
    others: float = 0.0
    slowdown: float = 1.0

    def rate(self, n_running: int) -> float:
        """Return the work that each of some running processes gets done in a second."""
        share = min(1.0, self.cores / (n_running + self.others))
        return share / (self.slowdown if n_running > 1 else 1.0)


FREE = Machines()
"""A core for each process."""


@dataclass(frozen=True, slots=True)
class Schedule:
    """What a build takes.

    Attributes:
        makespan_s: From its beginning to its end.
        driver_s: Work of the driver.
        units_s: Work of all units, without what workers need to start.
        n_workers: Number of workers.
        most_waiting: Most results that were there at once and not published yet.
    """

    makespan_s: float
    driver_s: float
    units_s: float
    n_workers: int
    most_waiting: int

    @property
    def efficiency(self) -> float:
        """The share of the time of all workers that units took."""
        return self.units_s / (self.n_workers * self.makespan_s)

    @property
    def driver_share(self) -> float:
        """The share of the build in which the driver works."""
        return self.driver_s / self.makespan_s


class _Clock:
    """Runs processes that share cores: equal parts of them mean that one virtual clock serves all."""

    def __init__(self, machines: Machines) -> None:
        self._machines, self._order = machines, count()
        self._running: list[tuple[float, int, int]] = []
        self._virtual = self.now_s = 0.0

    def start(self, work_s: float, job: int) -> None:
        heappush(self._running, (self._virtual + work_s, next(self._order), job))

    def next(self) -> int:
        """Go on to the next end of a job, and return the job."""
        rate = self._machines.rate(len(self._running))
        end, _, job = heappop(self._running)
        self.now_s += (end - self._virtual) / rate
        self._virtual = end
        return job


_DRIVER = -1


def simulate(
    phases: Iterable[Phase], *, n_workers: int, engine: Engine, machines: Machines = FREE, after_s: float = 0.0
) -> Schedule:
    """Return the schedule of a build.

    Args:
        phases: Its phases; each begins when all units of the one before are published.
        n_workers: Workers, with a unit at a time.
        engine: How units are handed out.
        machines: What driver and workers run on.
        after_s: Processor seconds of the driver at the end.
    """
    clock, unstarted, most, driver_s, units_s = _Clock(machines), n_workers, 0, after_s + engine.driver_start_s, 0.0
    clock.start(engine.driver_start_s, _DRIVER)
    clock.next()
    for phase in phases:
        driver_s += phase.before_s + phase.publish_s * len(phase.units_s)
        units_s += sum(phase.units_s)
        clock.start(phase.before_s, _DRIVER)
        clock.next()
        unstarted, waiting = _run(phase, clock, n_workers, unstarted, engine)
        most = max(most, waiting)
    clock.start(after_s, _DRIVER)
    clock.next()
    return Schedule(clock.now_s, driver_s, units_s, n_workers, most)


def _run(phase: Phase, clock: _Clock, n_workers: int, unstarted: int, engine: Engine) -> tuple[int, int]:
    """Run the units of a phase; return the workers without a unit so far, and the most results that waited."""
    most_ahead = engine.ahead * n_workers
    series = most_ahead // engine.n_series if engine.n_series else 1
    left, queue, ready = deque(range(len(phase.units_s))), deque[int](), 0
    open_of: dict[int, int] = {}  # units not computed yet, by series
    in_flight, computed, most, idle, is_driver_idle = 0, 0, 0, n_workers, True
    while left or in_flight:
        while left and in_flight + series <= most_ahead:
            members = [left.popleft() for _ in range(min(series, len(left)))]
            open_of[members[0] // series] = len(members)
            queue.extend(members)
            in_flight += len(members)
        while queue and idle:
            unit, idle = queue.popleft(), idle - 1
            clock.start(phase.units_s[unit] + (engine.start_s if unstarted else 0.0), unit)
            unstarted -= bool(unstarted)
        if ready and is_driver_idle:
            is_driver_idle = False
            clock.start(phase.publish_s, _DRIVER)
        if (job := clock.next()) == _DRIVER:
            in_flight, ready, computed, is_driver_idle = in_flight - 1, ready - 1, computed - 1, True
            continue
        idle, computed = idle + 1, computed + 1
        most = max(most, computed)
        open_of[job // series] -= 1
        if not open_of[job // series]:
            ready += len(range(job // series * series, min((job // series + 1) * series, len(phase.units_s))))
    return unstarted, most


def largest_first(phase: Phase) -> Phase:
    """Return a phase whose longest units are handed out first."""
    return replace(phase, units_s=sorted(phase.units_s, reverse=True))
