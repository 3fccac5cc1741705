"""Simulated walks between areas with known shares: cut tracks, floor that loses people, a dead camera, a blind spot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vsd_analytics.stats.next_area import Leaving

Array = NDArray[np.float64]
AREAS = ("door", "bread", "wine", "till")
NEXT = np.array([
    [0.02, 0.50, 0.30, 0.18],
    [0.10, 0.00, 0.35, 0.55],
    [0.08, 0.22, 0.00, 0.70],
    [0.90, 0.04, 0.06, 0.00],
])  # fmt: skip
"""Share of those who leave an area (row) whose next area is each one."""
N_ROUTES = 4
WALK_S = np.array([[6.0, 6, 14, 30], [6, 6, 8, 24], [14, 8, 6, 16], [30, 24, 16, 6]])
"""Median time on the way."""


@dataclass(frozen=True)
class FlowWorld:
    """How people walk between areas, and what cameras make of it.

    Attributes:
        name: For tables.
        cut_per_s: Rate at which a track is lost; another one begins there.
        cut_at_till: Share of those on the way to the till who are lost just before it, on top.
        blind_from: An area whose ways to the next area nobody sees at all, on every other day: a camera is dead there.
        unmarked: Share of people who leave an area for a place that is none of the areas.
        day_sd: Standard deviation of a day's log-odds of each way.
        per_day: People who come in by the door a day.
    """

    name: str
    cut_per_s: float = 0.0
    cut_at_till: float = 0.0
    blind_from: int | None = None
    unmarked: float = 0.0
    day_sd: float = 0.2
    per_day: int = 120

    def next_shares(self, rng: np.random.Generator) -> Array:
        """Return the shares of one day."""
        odds = NEXT * np.exp(rng.normal(0, self.day_sd, NEXT.shape))
        return np.asarray(odds / odds.sum(axis=1, keepdims=True))

    def truth(self) -> Array:
        """Return the mean shares over very many days, weighted by how many leave."""
        rng = np.random.default_rng(0)
        days = [self.next_shares(rng) for _ in range(4000)]
        n = np.array([_expected_leaving(p, self.unmarked) for p in days])
        return np.asarray((np.array(days) * n[..., None]).sum(axis=0) / n.sum(axis=0)[:, None])


@dataclass(frozen=True)
class SeenFlow:
    """What the cameras saw: people who leave each area, arrivals by area and day, and routes by their number of areas.

    Kinds of routes: 0 to 2 areas between coming in and leaving, and more (3); times from coming in.
    """

    leaving: Sequence[Leaving]
    arrived: Array
    routes: Leaving
    true_routes: Array


def see_flow(world: FlowWorld, *, n_days: int, seed: int) -> SeenFlow:
    """Return some days of a world: people walk from the door until they come back to it."""
    rng = np.random.default_rng(seed)
    rows: list[NDArray[np.float64]] = []
    arrived = np.zeros((len(AREAS), n_days))
    ways: list[NDArray[np.float64]] = []
    for day in range(n_days):
        shares = world.next_shares(rng).cumsum(axis=1)
        at = np.zeros(rng.poisson(world.per_day * np.exp(rng.normal(0, 0.2))), dtype=np.int64)
        who, seen_s, lost_s = np.arange(len(at)), np.zeros(len(at)), np.full(len(at), np.inf)
        n_areas = np.zeros(len(at), dtype=np.int64)
        while len(at):
            to = (rng.random(len(at))[:, None] > shares[at]).sum(axis=1).clip(max=len(AREAS) - 1)
            walk_s = WALK_S[at, to] * np.exp(rng.normal(0, 0.4, len(at)))
            is_gone = rng.random(len(at)) < world.unmarked
            cut_s = rng.exponential(1 / world.cut_per_s, len(at)) if world.cut_per_s else np.full(len(at), np.inf)
            near_till = (AREAS[-1] == np.array(AREAS)[to]) & (rng.random(len(at)) < world.cut_at_till)
            cut_s = np.where(near_till, np.minimum(cut_s, walk_s * 0.9), cut_s)
            cut_s = np.where(is_gone, np.minimum(cut_s, 10.0), cut_s)
            if world.blind_from is not None and day % 2:
                cut_s = np.where(at == world.blind_from, np.minimum(cut_s, 1.0), cut_s)
            is_lost = cut_s < walk_s
            kind = np.where(is_lost | is_gone, -1, to)
            rows.append(np.column_stack([at, np.where(is_lost, cut_s, walk_s), kind, np.full(len(at), day)]))
            arrived[:, day] += np.bincount(to[~is_gone], minlength=len(AREAS))
            lost_s[who] = np.where(
                np.isinf(lost_s[who]) & (is_lost | is_gone), seen_s[who] + np.minimum(cut_s, walk_s), lost_s[who]
            )
            seen_s[who] += walk_s
            goes_on = ~is_gone & (to != 0)
            n_areas[who[goes_on]] += 1
            who, at = who[goes_on], to[goes_on]
        kind = np.minimum(n_areas, N_ROUTES - 1)
        ways.append(np.column_stack([np.minimum(seen_s, lost_s), np.where(np.isinf(lost_s), kind, -1),
                                     np.full(len(kind), day), kind]))  # fmt: skip
    every = np.concatenate(rows)
    leaving = [
        Leaving(of[:, 1], of[:, 2].astype(np.int64), of[:, 3].astype(np.int64))
        for of in (every[every[:, 0] == k] for k in range(len(AREAS)))
    ]
    way = np.concatenate(ways)
    routes = Leaving(way[:, 0], way[:, 1].astype(np.int64), way[:, 2].astype(np.int64))
    return SeenFlow(leaving, arrived, routes, np.bincount(way[:, 3].astype(np.int64), minlength=N_ROUTES) / len(way))


def _expected_leaving(shares: Array, unmarked: float) -> Array:
    """Return how often each area is left by somebody who starts at the door, who ends there."""
    stay = shares * (1 - unmarked)
    stay[:, 0] = 0.0
    return np.asarray(np.linalg.solve(np.eye(len(shares)) - stay.T, np.eye(len(shares))[0]))


WORLDS = (
    FlowWorld("tracks are whole"),
    FlowWorld("a third of the ways is cut", cut_per_s=0.02),
    FlowWorld("half of the ways is cut", cut_per_s=0.045),
    FlowWorld("half is cut, few people", cut_per_s=0.045, per_day=30),
    FlowWorld("half is cut, days differ much", cut_per_s=0.045, day_sd=0.5),
    FlowWorld("a camera is dead on every other day", cut_per_s=0.02, blind_from=1),
    FlowWorld("half of those before the till are lost", cut_per_s=0.02, cut_at_till=0.5),
    FlowWorld("a third leaves where no area is", cut_per_s=0.02, unmarked=0.33),
)
