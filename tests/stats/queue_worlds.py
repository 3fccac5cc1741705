"""Simulated queues with known waits: servers, people who lose patience, cut tracks, unseen entries, a dead camera."""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.stats.recorded_hours import RecordedHours, recorded_hours
from vsd_analytics.stats.waiting import CUT, LEFT, SERVED

Floats = NDArray[np.float64]
HOURLY = np.array([0.6, 0.8, 1.0, 1.2, 1.3, 1.0, 0.9, 1.2, 1.3, 0.7])
"""Arrivals of an hour over those of the mean hour, from opening to closing."""
HOUR_S = 3600.0
CAPACITY = 5


@dataclass(frozen=True)
class World:
    """How people queue, and what cameras make of it.

    Attributes:
        name: For tables.
        per_hour: People who come in a mean hour.
        n_servers: Tills.
        service_s: Mean time of service, gamma distributed with shape 2.
        patience_s: Mean patience, exponential: who would wait longer leaves.
        day_sd: Standard deviation of a day's factor on arrivals (logarithm).
        cut_per_s: Rate at which a track in the queue is lost.
        cut_from_s: Nobody is lost before so long a wait.
        unseen: Share of people whose entry nobody saw.
        dead_h: Hours a day in which the camera of the queue's second half records nothing.
        is_dead_busy: These are always the busiest ones, not any.
        dead_share: Share of the days on which it is dead.
    """

    name: str
    per_hour: float = 80.0
    n_servers: int = 2
    service_s: float = 100.0
    patience_s: float = 300.0
    day_sd: float = 0.15
    cut_per_s: float = 0.0
    cut_from_s: float = 0.0
    unseen: float = 0.0
    dead_h: int = 0
    is_dead_busy: bool = False
    dead_share: float = 1.0


@dataclass(frozen=True)
class Day:
    """Who came on a day: seconds since opening, wait, and whether they left before the end, one element each."""

    arrival_s: Floats
    wait_s: Floats
    left: NDArray[np.bool_]

    def people(self) -> Floats:
        """Return the seconds by hour of the day and number of people waiting (0 to 59), shape (n_hours, 60)."""
        ends = self.arrival_s + self.wait_s
        borders = np.arange(len(HOURLY) + 1) * HOUR_S
        at = np.concatenate([self.arrival_s, ends, borders])
        more = np.concatenate([np.ones(len(ends)), -np.ones(len(ends)), np.zeros(len(borders))])
        order = np.argsort(at, kind="stable")
        n = more[order].cumsum()[:-1].astype(int)
        lasts, hour = np.diff(at[order]), (at[order][:-1] // HOUR_S).astype(int)
        open_now = hour < len(HOURLY)
        found = np.zeros((len(HOURLY), 60))
        np.add.at(found, (hour[open_now], np.minimum(n[open_now], 59)), lasts[open_now])
        return found


@dataclass(frozen=True)
class Seen:
    """What the cameras saw of some days.

    Attributes:
        wait_s, outcome, day: Waits with an entry, as `vsd_analytics.stats.waiting.waiting` takes them.
        stands_for: How many entries each wait stands for.
        time_s: Recorded seconds by day and number of people, weighted by the hours they stand for, shape (n_days, 60).
        naive_time_s: The same of all hours, without those whom the dead camera did not see, shape (60,).
        recorded: How much each hour counts.
    """

    wait_s: Floats
    outcome: NDArray[np.int64]
    day: NDArray[np.int64]
    stands_for: Floats
    time_s: Floats
    naive_time_s: Floats
    recorded: RecordedHours


def one_day(world: World, rng: np.random.Generator) -> Day:
    """Return a day of a queue in which who comes first is served first."""
    factor = np.exp(rng.normal(-(world.day_sd**2) / 2, world.day_sd))
    n = rng.poisson(world.per_hour * factor * HOURLY)
    arrival_s = np.sort(np.repeat(np.arange(len(HOURLY)), n) * HOUR_S + rng.uniform(0, HOUR_S, n.sum()))
    service_s = rng.gamma(2.0, world.service_s / 2, len(arrival_s))
    patience_s = rng.exponential(world.patience_s, len(arrival_s))
    free = [0.0] * world.n_servers
    wait_s = np.zeros(len(arrival_s))
    for k, at in enumerate(arrival_s.tolist()):
        wait_s[k] = max(0.0, free[0] - at)
        if wait_s[k] <= patience_s[k]:
            heapq.heapreplace(free, at + wait_s[k] + service_s[k])
    left = wait_s > patience_s
    step_s = rng.uniform(2.0, 8.0, len(arrival_s))  # from the border of the queue to its end
    return Day(arrival_s, np.where(left, patience_s, wait_s) + step_s, left)


@cache
def truth(world: World, n_days: int = 2000) -> dict[str, float]:
    """Return what very many days have: quantiles of waits of those served, share who leave, people waiting."""
    rng = np.random.default_rng(0)
    days = [one_day(world, rng) for _ in range(n_days)]
    wait_s, left = (np.concatenate([getattr(d, name) for d in days]) for name in ("wait_s", "left"))
    time_s = np.sum([d.people().sum(axis=0) for d in days], axis=0)
    median, p90 = np.quantile(wait_s[~left], [0.5, 0.9]).tolist()
    return {"median": median, "p90": p90, "left": float(left.mean()), **of_people(time_s)}


def of_people(time_s: Floats) -> dict[str, float]:
    """Return mean and 90 % quantile of the number of people, shares of time by capacity, and people beyond it."""
    share, n = time_s / time_s.sum(), np.arange(len(time_s))
    return {
        "people": float(share @ n),
        "people p90": float(np.searchsorted(share.cumsum(), 0.9)),
        "from 60 %": float(share[n >= 0.6 * CAPACITY].sum()),
        "full": float(share[n >= CAPACITY].sum()),
        "over": float(share[n > CAPACITY].sum()),
        "surplus": float(share @ np.maximum(n - CAPACITY, 0)),
    }


def see(world: World, *, n_days: int, seed: int) -> Seen:
    """Return some days as cameras saw them."""
    rng = np.random.default_rng(seed)
    n_hours = len(HOURLY)
    is_alive = np.ones((n_days, n_hours), dtype=np.bool_)
    waits, outcomes, days, hours = [], [], [], []
    time_s, naive = np.zeros((n_days, n_hours, 60)), np.zeros(60)
    for d in range(n_days):
        day = one_day(world, rng)
        dead = np.argsort(-HOURLY)[: world.dead_h] if world.is_dead_busy else rng.permutation(n_hours)[: world.dead_h]
        if world.dead_share < 1 and rng.random() >= world.dead_share:
            dead = dead[:0]
        is_alive[d, dead] = False
        cut_s = np.full(len(day.wait_s), np.inf)
        if world.cut_per_s:
            cut_s = world.cut_from_s + rng.exponential(1 / world.cut_per_s, len(day.wait_s))
        is_cut = cut_s < day.wait_s
        hour = (day.arrival_s // HOUR_S).astype(int)
        entered = (rng.random(len(is_cut)) >= world.unseen) & is_alive[d, hour]
        waits.append(np.minimum(day.wait_s, cut_s)[entered])
        outcomes.append(np.where(is_cut, CUT, np.where(day.left, LEFT, SERVED))[entered])
        days.append(np.full(entered.sum(), d))
        hours.append(hour[entered])
        time_s[d] = day.people() * is_alive[d, :, None]
        naive += time_s[d].sum(axis=0) + _half_seen(day, rng)[dead].sum(axis=0)
    of_day, of_hour = np.indices(is_alive.shape)
    recorded = recorded_hours(of_day.ravel() % 7, of_hour.ravel(), np.full(is_alive.size, HOUR_S), is_alive.ravel())
    weight = recorded.weight.reshape(is_alive.shape)
    at_day, at_hour = np.concatenate(days), np.concatenate(hours)
    return Seen(
        np.concatenate(waits), np.concatenate(outcomes), at_day, weight[at_day, at_hour],
        (time_s * weight[..., None]).sum(axis=1), naive, recorded,
    )  # fmt: skip


def _half_seen(day: Day, rng: np.random.Generator) -> Floats:
    """Return the seconds by hour and number of people of whom the living camera saw about half."""
    seen = rng.random(len(day.wait_s)) < 0.5
    return Day(day.arrival_s[seen], day.wait_s[seen], day.left[seen]).people()


WORLDS = (
    World("tracks are whole"),
    World("half of the tracks are cut", cut_per_s=0.01),
    World("three quarters are cut", cut_per_s=0.03),
    World("short queue, few people", per_hour=20, n_servers=1, service_s=130, cut_per_s=0.01),
    World("days differ much", day_sd=0.4, cut_per_s=0.01),
    World("an entry in three is not seen", unseen=0.33, cut_per_s=0.01),
    World("only those who wait a minute are lost", cut_per_s=0.02, cut_from_s=60.0),
    World("a camera is dead in any 3 hours a day", cut_per_s=0.01, dead_h=3),
    World("dead in the 3 busiest hours of half the days", cut_per_s=0.01, dead_h=3, is_dead_busy=True, dead_share=0.5),
    World("dead in the 3 busiest hours of all days", cut_per_s=0.01, dead_h=3, is_dead_busy=True),
)
