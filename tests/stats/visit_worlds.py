"""Simulated visits of an area with known dwell times: cut tracks, entries nobody saw, standing people who are lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class World:
    """How people visit an area, and what a camera makes of it.

    Attributes:
        name: For tables.
        median_s: Median dwell time of a usual day.
        spread: Standard deviation of ln dwell time.
        passing: Share of visitors who walk through, in 2 to 6 s.
        day_sd: Standard deviation of a day's factor on dwell times (logarithm).
        per_day: Visits a day.
        cut_per_s: Rate at which a track is lost and another one begins.
        is_cut_standing: Tracks are lost only of people who have stood for a minute.
        unseen: Share of visitors whose entry nobody saw: their track begins inside.
    """

    name: str
    median_s: float = 40.0
    spread: float = 0.9
    passing: float = 0.2
    day_sd: float = 0.15
    per_day: int = 150
    cut_per_s: float = 0.0
    is_cut_standing: bool = False
    unseen: float = 0.0

    def true_dwell(self, rng: np.random.Generator, n: int, factor: NDArray[np.float64]) -> NDArray[np.float64]:
        long_s = self.median_s * factor * np.exp(rng.normal(0, self.spread, n))
        return np.where(rng.random(n) < self.passing, rng.uniform(2, 6, n), long_s)

    def truth(self, limit_s: float) -> tuple[float, float, float, float]:
        """Return the true median, 90 % quantile, share longer than a limit and mean over very many days."""
        rng = np.random.default_rng(0)
        n = 2_000_000
        found = self.true_dwell(rng, n, np.exp(rng.normal(0, self.day_sd, n)))
        return (*np.quantile(found, [0.5, 0.9]).tolist(), float((found > limit_s).mean()), float(found.mean()))


@dataclass(frozen=True)
class Seen:
    """What the camera saw: visits with an entry, pieces of tracks of any kind, and person-time by day."""

    dwell_s: NDArray[np.float64]
    is_cut: NDArray[np.bool_]
    day: NDArray[np.int64]
    person_s: NDArray[np.float64]
    pieces_s: NDArray[np.float64]


def see(world: World, *, n_days: int, seed: int) -> Seen:
    """Return some days of a world."""
    rng = np.random.default_rng(seed)
    n_day = rng.poisson(world.per_day * np.exp(rng.normal(0, 0.2, n_days)))
    day = np.repeat(np.arange(n_days), n_day)
    true_s = world.true_dwell(rng, len(day), np.exp(rng.normal(0, world.day_sd, n_days))[day])
    start_s = 60.0 if world.is_cut_standing else 0.0
    first_cut = start_s + (rng.exponential(1 / world.cut_per_s, len(day)) if world.cut_per_s else np.inf)
    is_cut = first_cut < true_s
    seen_s = np.minimum(first_cut, true_s)
    entered = rng.random(len(day)) >= world.unseen
    pieces = [seen_s]
    if world.cut_per_s:
        left, age = (true_s - first_cut)[is_cut], first_cut[is_cut]
        while len(left):
            wait = rng.exponential(1 / world.cut_per_s, len(left))
            if world.is_cut_standing:
                wait = np.maximum(wait, 0)
            pieces.append(np.minimum(wait, left))
            left, age = (left - wait)[wait < left], age[wait < left]
    return Seen(
        seen_s[entered],
        is_cut[entered],
        day[entered],
        np.bincount(day, weights=true_s, minlength=n_days),
        np.concatenate(pieces),
    )


WORLDS = (
    World("tracks are whole"),
    World("half of the tracks are cut", cut_per_s=0.02),
    World("three quarters are cut", cut_per_s=0.05),
    World("short visits, few a day", median_s=12, per_day=30, cut_per_s=0.03),
    World("days differ much", day_sd=0.4, cut_per_s=0.02),
    World("an entry in three is not seen", unseen=0.33, cut_per_s=0.02),
    World("only standing people are lost", cut_per_s=0.03, is_cut_standing=True),
)
